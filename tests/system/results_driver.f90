!> Exercises the result file for the system tests:
!> `results_driver MODE FILE SUPPORT SPEEDS STIFFNESSES [TITLE]`, on any number of ranks. Modes:
!> `create` a file without points; `write` every point of a new file; `resume` an existing file and write what is missing;
!> `verify` that an existing file holds every point; `die` half way through a new file; `hold` a new file open until
!> `FILE.go` exists; `time` the writing of a new file. The exit code is that of the error, as in the program.
program results_driver
   use, intrinsic :: iso_c_binding, only: c_int
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use mpi_f08, only: MPI_Barrier, MPI_COMM_WORLD, MPI_Comm_rank, MPI_Comm_size, MPI_Finalize, MPI_Init, MPI_Wtime
   use spurflex_base_error, only: error_type, exit_internal
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_io_case, only: case_type
   use spurflex_io_provenance, only: collect_provenance, provenance_type
   use spurflex_io_results, only: close_results, create_results, describe_damage, open_results, read_rigid, read_status, &
      results_file, write_flexible, write_rigid
   use spurflex_measure_response, only: contact_lost, reason_most_steps, reason_none, response, status_missing, &
      status_settled
   implicit none

   interface
      !> End the process with a code.
      subroutine c_exit(code) bind(c, name='exit')
         import :: c_int
         !> Exit code.
         integer(c_int), value :: code
      end subroutine c_exit

      !> Send this process a signal.
      function c_raise(signal) bind(c, name='raise') result(status)
         import :: c_int
         !> Signal number.
         integer(c_int), value :: signal
         !> 0, or not on failure.
         integer(c_int) :: status
      end function c_raise
   end interface

   !> Points in one write.
   integer, parameter :: run_length = 32
   !> The signal that cannot be caught.
   integer(c_int), parameter :: signal_kill = 9_c_int

   type(case_type) :: case
   type(results_file) :: results
   type(provenance_type) :: provenance
   type(error_type), allocatable :: error
   character(len=:), allocatable :: mode
   integer, allocatable :: rigid_status(:), flexible_status(:, :)
   integer :: rank, ranks
   real(wp) :: started

   call MPI_Init()
   call MPI_Comm_rank(MPI_COMM_WORLD, rank)
   call MPI_Comm_size(MPI_COMM_WORLD, ranks)
   call read_arguments()

   started = MPI_Wtime()
   select case (mode)
   case ('create', 'write', 'die', 'hold', 'time')
      call collect_provenance(provenance, error)
      call give_up_on(error)
      call create_results(results, case, MPI_COMM_WORLD, provenance, .false., error)
   case default
      call open_results(results, case, MPI_COMM_WORLD, error)
   end select
   call give_up_on(error)
   if (mode == 'time') call report('created')
   if (rank == 0) write (output_unit, '(a)') 'rigid: '//describe_damage(results, rigid=.true.), &
      'flexible: '//describe_damage(results, rigid=.false.)

   allocate (rigid_status(case%sweep%speed_count), flexible_status(case%sweep%speed_count, case%sweep%stiffness_count))
   call read_status(results, rigid_status, flexible_status, error)
   call give_up_on(error)
   select case (mode)
   case ('write', 'resume', 'time')
      call write_missing(dies=.false.)
   case ('die')
      call write_missing(dies=.true.)
   case ('verify')
      call verify()
   case ('hold')
      call hold()
   end select
   if (mode == 'time') call report('written')
   call close_results(results, error)
   call give_up_on(error)
   if (mode == 'time') call report('closed')
   call MPI_Finalize()

contains

   !> Make the case from the command line.
   subroutine read_arguments()
      character(len=256) :: words(6)
      integer :: i

      words = ''
      do i = 1, command_argument_count()
         call get_command_argument(i, words(i))
      end do
      mode = trim(words(1))
      case%title = trim(words(6))
      case%output%file = trim(words(2))
      case%sweep%rigid = words(3) == 'rigid' .or. words(3) == 'both'
      case%sweep%flexible = words(3) == 'flexible' .or. words(3) == 'both'
      read (words(4), *) case%sweep%speed_count
      if (case%sweep%flexible) read (words(5), *) case%sweep%stiffness_count
      case%sweep%speed_first = 1000.0_wp
      case%sweep%speed_last = 5000.0_wp
      case%sweep%stiffness_first = 1.0e3_wp
      case%sweep%stiffness_last = 1.0e7_wp
      case%resolved = '&case'//new_line('a')//"  title = '"//case%title//"'"//new_line('a')//'/'//new_line('a') &
         //'&sweep'//new_line('a')//"  support = '"//trim(words(3))//"'"//new_line('a') &
         //'  speed_count = '//to_text(case%sweep%speed_count)//new_line('a') &
         //'  stiffness_count = '//to_text(case%sweep%stiffness_count)//new_line('a')//'/'//new_line('a')
   end subroutine read_arguments

   !> The made-up response at a point: numbers that tell where they belong.
   pure function response_at(speed, stiffness) result(point)
      !> Index of the speed.
      integer, intent(in) :: speed
      !> Index of the stiffness, 0 on the rigid support.
      integer, intent(in) :: stiffness
      !> The response.
      type(response) :: point

      real(wp) :: place

      place = real(speed, wp) + 1000.0_wp*real(stiffness, wp)
      point%y1_amplitude = place
      point%y1_rms = place + 0.125_wp
      point%y1_max = place + 0.25_wp
      point%y1_min = -place
      point%bearing_deformation_max = [place + 0.5_wp, place + 0.625_wp]
      point%error_estimate = 1.0_wp/place
      point%motion = 1 + mod(speed, 8)
      point%status = status_settled
      point%reason = merge(reason_most_steps, reason_none, mod(speed, 2) == 0)
      point%periods_integrated = speed + 1000*stiffness
      point%contact = contact_lost
   end function response_at

   !> Write this rank's share of the points that are missing.
   subroutine write_missing(dies)
      !> The last rank dies half way through its share.
      logical, intent(in) :: dies

      type(response), allocatable :: responses(:)
      real(wp), allocatable :: eta(:, :)
      integer :: stiffness, first, last, i, turn, turns

      turns = (case%sweep%stiffness_count + 1)*((case%sweep%speed_count - 1)/run_length + 1)
      turn = 0
      do stiffness = merge(0, 1, case%sweep%rigid), case%sweep%stiffness_count
         do first = 1, case%sweep%speed_count, run_length
            turn = turn + 1
            if (dies .and. rank == ranks - 1 .and. turn > turns/2) i = c_raise(signal_kill)
            if (mod(turn, ranks) /= rank) cycle
            last = min(first + run_length - 1, case%sweep%speed_count)
            responses = [(response_at(i, stiffness), i=first, last)]
            if (stiffness == 0) then
               if (all(rigid_status(first:last) /= status_missing)) cycle
               call write_rigid(results, first, responses, error)
            else if (all(flexible_status(first:last, stiffness) /= status_missing)) then
               cycle
            else if (case%sweep%rigid) then
               eta = reshape([(real([i, stiffness, 0], wp), i=first, last)], [3, last - first + 1])
               call write_flexible(results, stiffness, 1, first, responses, eta, error)
            else
               call write_flexible(results, stiffness, 1, first, responses, error=error)
            end if
            call give_up_on(error)
         end do
      end do
   end subroutine write_missing

   !> Exit with the code of an internal error unless the file holds every point and gives the rigid responses back.
   subroutine verify()
      type(response), allocatable :: responses(:)
      type(response) :: expected
      logical :: right
      integer :: i

      right = all(flexible_status == status_settled)
      allocate (responses(case%sweep%speed_count))
      call read_rigid(results, responses, error)
      call give_up_on(error)
      do i = 1, size(responses)
         if (.not. case%sweep%rigid) exit
         ! What is missing is not a number.
         right = right .and. rigid_status(i) == status_settled
         if (.not. right) exit
         expected = response_at(i, 0)
         right = responses(i)%status == expected%status &
            .and. responses(i)%reason == expected%reason .and. responses(i)%motion == expected%motion &
            .and. responses(i)%contact == expected%contact &
            .and. responses(i)%periods_integrated == expected%periods_integrated &
            .and. all(abs(reals_of(responses(i)) - reals_of(expected)) <= 0.0_wp)
      end do
      if (.not. right) call c_exit(int(exit_internal, c_int))
   end subroutine verify

   !> Every real of a response.
   pure function reals_of(point) result(reals)
      !> The response.
      type(response), intent(in) :: point
      !> Its reals.
      real(wp) :: reals(7)

      reals = [point%y1_amplitude, point%y1_rms, point%y1_max, point%y1_min, point%bearing_deformation_max, &
         point%error_estimate]
   end function reals_of

   !> Wait for a file to appear.
   subroutine hold()
      logical :: released

      do
         inquire (file=case%output%file//'.go', exist=released)
         if (released) exit
      end do
   end subroutine hold

   !> Print the time since the start.
   subroutine report(what)
      !> What is done.
      character(len=*), intent(in) :: what

      call MPI_Barrier(MPI_COMM_WORLD)
      if (rank == 0) write (output_unit, '(a, f10.4, a)') what//' after', MPI_Wtime() - started, ' s'
   end subroutine report

   !> Leave the program if there is an error, which every rank then has.
   subroutine give_up_on(failure)
      !> The error.
      type(error_type), allocatable, intent(in) :: failure

      if (.not. allocated(failure)) return
      if (rank == 0) write (error_unit, '(a)') failure%message
      call MPI_Finalize()
      call c_exit(int(failure%code, c_int))
   end subroutine give_up_on

end program results_driver
