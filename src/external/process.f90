!> The process: what the MPI library is told before it starts and before it ends, sleeping, and leaving with an exit code that is
!> known only at run time, which Fortran 2008 cannot do.
module spurflex_external_process
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_long, c_null_char, c_null_ptr, c_ptr, c_sizeof
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: hasten_mpi_start, hasten_mpi_end, sleep, exit_process

   !> A variable of the environment that is set already stays.
   integer(c_int), parameter :: keep = 0_c_int
   !> `IPPROTO_TCP` and `TCP_NODELAY` of Linux.
   integer(c_int), parameter :: protocol_tcp = 6_c_int, no_delay = 1_c_int, on = 1_c_int
   !> Descriptors among which the connection to the launcher is: it is made when MPI starts, before files are opened.
   integer(c_int), parameter :: first_descriptor = 3_c_int, last_descriptor = 127_c_int
   !> Longest value that is read.
   integer, parameter :: value_length = 32
   !> What tells a rank that it was started as one of several: by mpirun, or by a batch system.
   character(len=*), parameter :: launchers(4) = [character(len=20) :: 'OMPI_COMM_WORLD_SIZE', 'PMIX_RANK', 'PMIX_NAMESPACE', &
                                                  'PMI_RANK']

   interface
      subroutine c_exit(status) bind(c, name='exit')
         import :: c_int
         integer(c_int), value :: status
      end subroutine c_exit

      !> Sleep.
      function c_nanosleep(time, left) bind(c, name='nanosleep') result(status)
         import :: c_int, c_long, c_ptr
         !> Seconds and nanoseconds: `struct timespec`.
         integer(c_long), intent(in) :: time(2)
         !> Where what is left after a signal is to be told; may be null.
         type(c_ptr), value :: left
         !> 0, or -1 if it ended early.
         integer(c_int) :: status
      end function c_nanosleep

      !> Set a variable of the environment.
      function c_setenv(name, value, overwrite) bind(c, name='setenv') result(status)
         import :: c_char, c_int
         !> Null-terminated name and value.
         character(kind=c_char), intent(in) :: name(*), value(*)
         !> 0: one that is set stays.
         integer(c_int), value :: overwrite
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_setenv

      !> Set an option of a connection.
      function c_setsockopt(descriptor, level, name, value, length) bind(c, name='setsockopt') result(status)
         import :: c_int
         !> Descriptor, protocol and option.
         integer(c_int), value :: descriptor, level, name
         !> Its value.
         integer(c_int), intent(in) :: value
         !> Bytes of it: `socklen_t`.
         integer(c_int), value :: length
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_setsockopt
   end interface

contains

   !> Spare Open MPI the search for networks where all ranks are on one machine: half of its start. What the user has set stays;
   !> other MPI libraries take no notice.
   subroutine hasten_mpi_start()
      character(len=:), allocatable :: ranks, here
      integer(c_int) :: status
      logical :: alone
      integer :: i

      alone = .true.
      do i = 1, size(launchers)
         ranks = value_of(trim(launchers(i)))
         if (ranks /= '') alone = .false.
      end do
      ranks = value_of('OMPI_COMM_WORLD_SIZE')
      here = value_of('OMPI_COMM_WORLD_LOCAL_SIZE')
      if (.not. alone .and. (ranks == '' .or. here /= ranks)) return
      ! A failure costs time only. The daemon of a single process stays, though it could be spared too: it gives each process a
      ! folder of its own for what Open MPI keeps, without which several of them get into each other's way.
      status = c_setenv('OMPI_MCA_pml'//c_null_char, 'ob1'//c_null_char, keep)
   end subroutine hasten_mpi_start

   !> Spare the end of MPI a wait of 40 ms: the process takes its leave from the launcher in small messages over TCP, each of
   !> which would be held back until the one before is acknowledged, and acknowledgements are late where nothing is answered.
   !> Descriptors that are no such connections are passed over.
   subroutine hasten_mpi_end()
      integer(c_int) :: descriptor, status

      do descriptor = first_descriptor, last_descriptor
         ! A failure costs time only.
         status = c_setsockopt(descriptor, protocol_tcp, no_delay, on, int(c_sizeof(on), c_int))
      end do
   end subroutine hasten_mpi_end

   !> Value of a variable of the environment.
   function value_of(name) result(text)
      !> Its name.
      character(len=*), intent(in) :: name
      !> Its value, or how that begins; empty if it is not set.
      character(len=:), allocatable :: text

      character(len=value_length) :: value
      integer :: stat

      call get_environment_variable(name, value, status=stat)
      text = trim(value)
      if (stat == 1) text = ''
   end function value_of

   !> Leave the processor to others for a while; a signal may cut it short.
   subroutine sleep(seconds)
      !> How long [s].
      real(wp), intent(in) :: seconds

      integer(c_int) :: status

      status = c_nanosleep([int(seconds, c_long), int(1.0e9_wp*(seconds - aint(seconds)), c_long)], c_null_ptr)
   end subroutine sleep

   !> End the process; flushes what is open. Does not return.
   subroutine exit_process(code)
      !> Exit code, 0..255.
      integer, intent(in) :: code

      call c_exit(int(code, c_int))
   end subroutine exit_process

end module spurflex_external_process
