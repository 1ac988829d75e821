!> Makes the ranks wait for each other, and every rank know of an error on any.
module spurflex_io_agreement
   use mpi_f08, only: MPI_Comm, MPI_CHARACTER, MPI_INTEGER, MPI_MIN, MPI_Request, MPI_STATUS_IGNORE, mpi_allreduce, mpi_bcast, &
      mpi_comm_rank, mpi_ibarrier, mpi_test
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_external_process, only: sleep
   implicit none
   private

   public :: await_all, share_error

   !> Seconds of sleep between two looks whether the others have come.
   real(wp), parameter :: nap = 0.5e-3_wp

contains

   !> Wait until every rank is here, asleep: where one of them works long and alone, the MPI library would keep the processors of
   !> the others busy with looking. All ranks call this together.
   subroutine await_all(comm)
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm

      type(MPI_Request) :: request
      logical :: all_here

      call mpi_ibarrier(comm, request)
      do
         call mpi_test(request, all_here, MPI_STATUS_IGNORE)
         if (all_here) exit
         call sleep(nap)
      end do
   end subroutine await_all

   !> After this, either no rank has an error or all have that of the lowest rank with one. All ranks call it together.
   subroutine share_error(comm, error)
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> This rank's error before, the common error after.
      type(error_type), allocatable, intent(inout) :: error

      integer :: rank, source, facts(2)
      character(len=:), allocatable :: message

      call mpi_comm_rank(comm, rank)
      facts(1) = huge(rank)
      if (allocated(error)) facts(1) = rank
      call mpi_allreduce(facts(1), source, 1, MPI_INTEGER, MPI_MIN, comm)
      if (source == huge(rank)) return
      if (rank == source) facts = [error%code, len(error%message)]
      call mpi_bcast(facts, size(facts), MPI_INTEGER, source, comm)
      allocate (character(len=facts(2)) :: message)
      if (rank == source) message = error%message
      call mpi_bcast(message, len(message), MPI_CHARACTER, source, comm)
      if (.not. allocated(error)) allocate (error)
      error%code = facts(1)
      error%message = message
   end subroutine share_error

end module spurflex_io_agreement
