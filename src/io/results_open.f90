!> Makes, opens and closes the result file on all ranks together.
module spurflex_io_results_open
   use hdf5, only: H5F_ACC_RDWR_F, H5P_FILE_ACCESS_F, h5fclose_f, h5fopen_f, h5pclose_f, h5pcreate_f, &
      h5pset_fapl_mpio_f, hid_t
   use mpi_f08, only: MPI_Comm, MPI_COMM_NULL, MPI_INFO_NULL, mpi_comm_rank, operator(==)
   use spurflex_base_error, only: error_type, exit_mismatch
   use spurflex_base_text, only: to_text
   use spurflex_external_file_lock, only: acquire_lock, file_lock, release_lock
   use spurflex_external_posix, only: check_writable
   use spurflex_io_agreement, only: await_all, share_error
   use spurflex_io_case, only: case_type
   use spurflex_io_hdf5, only: check, start_hdf5
   use spurflex_io_provenance, only: provenance_type
   use spurflex_io_results_check, only: check_file, check_part
   use spurflex_io_results_create, only: make_part, part_ending, put_in_place
   use spurflex_io_results_support, only: close_support, open_support, support_set
   use spurflex_io_results_verify, only: verify_support
   implicit none
   private

   public :: results_file, create_results, open_results, close_results

   !> A result file that all ranks of a communicator have open.
   type :: results_file
      !> The ranks.
      type(MPI_Comm) :: comm = MPI_COMM_NULL
      !> Guard against another run on the same file, held by rank 0.
      type(file_lock) :: lock
      !> Open file.
      integer(hid_t) :: file = -1_hid_t
      !> Variables of the rigid support, on (speed); empty if it is not asked for.
      type(support_set) :: rigid
      !> Variables of the flexible support, on (speed, stiffness); empty if it is not asked for.
      type(support_set) :: flexible
   end type results_file

contains

   !> Make a new result file under another name, rename it, and open it on every rank. All ranks call this together.
   subroutine create_results(results, case, comm, provenance, replace, error)
      !> The open file.
      type(results_file), intent(out) :: results
      !> What is computed.
      type(case_type), intent(in) :: case
      !> The ranks that write.
      type(MPI_Comm), intent(in) :: comm
      !> What computes it.
      type(provenance_type), intent(in) :: provenance
      !> Replace a file of that name, once the new one stands.
      logical, intent(in) :: replace
      !> Set on every rank if the file exists, another run has it, or it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer :: rank

      call start_hdf5(error)
      call share_error(comm, error)
      if (allocated(error)) return
      results%comm = comm
      call mpi_comm_rank(comm, rank)
      if (rank == 0) then
         call acquire_lock(results%lock, lock_path(case), error)
         if (.not. allocated(error)) call check_part(case%output%file, error)
         if (.not. allocated(error)) call make_part(case%output%file, case, provenance, replace, error)
      end if
      call await_all(comm)
      call share_error(comm, error)
      if (.not. allocated(error)) then
         ! An existing file is replaced only when every rank can go on with the new one.
         call check_on_all_ranks(case%output%file//part_ending, comm, error)
         if (rank == 0) call put_in_place(case%output%file, error)
      end if
      call open_shared(results, case, error)
   end subroutine create_results

   !> Open an existing result file on every rank to continue it; points whose checksum does not fit become missing. All ranks
   !> call this together.
   subroutine open_results(results, case, comm, error)
      !> The open file.
      type(results_file), intent(out) :: results
      !> What is computed.
      type(case_type), intent(in) :: case
      !> The ranks that write.
      type(MPI_Comm), intent(in) :: comm
      !> Set on every rank, with `exit_mismatch` and what differs if the file belongs to another deck or version.
      type(error_type), allocatable, intent(out) :: error

      type(error_type), allocatable :: next
      integer :: rank

      call start_hdf5(error)
      call share_error(comm, error)
      if (allocated(error)) return
      results%comm = comm
      call mpi_comm_rank(comm, rank)
      if (rank == 0) then
         call acquire_lock(results%lock, lock_path(case), error)
         if (.not. allocated(error)) call check_file(case%output%file, case, error)
      end if
      call open_shared(results, case, error)
      if (.not. allocated(error)) call verify_support(results%rigid, comm, error)
      if (.not. allocated(error)) call verify_support(results%flexible, comm, error)
      if (.not. allocated(error) .or. results%comm == MPI_COMM_NULL) return
      call close_results(results, next)
   end subroutine open_results

   !> Close the file and remove its lock; does nothing if it is not open. All ranks call this together.
   subroutine close_results(results, error)
      !> The open file.
      type(results_file), intent(inout) :: results
      !> Set on every rank if a rank cannot close.
      type(error_type), allocatable, intent(out) :: error

      type(error_type), allocatable :: next
      integer :: ierr

      if (results%comm == MPI_COMM_NULL) return
      call close_support(results%rigid, error)
      call close_support(results%flexible, next)
      call keep_first(error, next)
      if (results%file >= 0) then
         call h5fclose_f(results%file, ierr)
         call check(ierr, 'close the result file', error)
         results%file = -1_hid_t
      end if
      call share_error(results%comm, error)
      ! Every rank has closed: the file is free.
      call release_lock(results%lock, next)
      call keep_first(error, next)
      call share_error(results%comm, error)
      results%comm = MPI_COMM_NULL
   end subroutine close_results

   !> Open the file on every rank, unless rank 0 found that it should not be; then leave nothing open and no lock.
   subroutine open_shared(results, case, error)
      !> The file, with its communicator.
      type(results_file), intent(inout) :: results
      !> What is computed.
      type(case_type), intent(in) :: case
      !> This rank's error before, the common error after.
      type(error_type), allocatable, intent(inout) :: error

      type(error_type), allocatable :: next
      integer(hid_t) :: access
      integer :: ierr(4)

      associate (path => case%output%file)
      call share_error(results%comm, error)
      if (.not. allocated(error)) call check_on_all_ranks(path, results%comm, error)
      if (.not. allocated(error)) then
         call h5pcreate_f(H5P_FILE_ACCESS_F, access, ierr(1))
         call h5pset_fapl_mpio_f(access, results%comm%MPI_VAL, MPI_INFO_NULL%MPI_VAL, ierr(2))
         call h5fopen_f(path, H5F_ACC_RDWR_F, results%file, ierr(3), access_prp=access)
         call h5pclose_f(access, ierr(4))
         call check(minval(ierr), "open '"//path//"' for writing on every rank", error)
         if (allocated(error)) results%file = -1_hid_t
         call share_error(results%comm, error)
      end if
      if (.not. allocated(error)) then
         call open_support(results%rigid, results%file, case, .true., error)
         if (.not. allocated(error)) call open_support(results%flexible, results%file, case, .false., error)
         if (allocated(error)) then
            error%code = exit_mismatch
            error%message = "the result file '"//path//"' is damaged: "//error%message
         end if
         call share_error(results%comm, error)
      end if
      end associate
      if (allocated(error)) call close_results(results, next)
   end subroutine open_shared

   !> Whether every rank can write to a file. A rank that cannot, while the others open it together, would leave them waiting.
   subroutine check_on_all_ranks(path, comm, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Set on every rank if one cannot.
      type(error_type), allocatable, intent(out) :: error

      integer :: rank

      call mpi_comm_rank(comm, rank)
      call check_writable(path, error)
      if (allocated(error)) error%message = error%message//' on rank '//to_text(rank)//'; all ranks need the same folder'
      call share_error(comm, error)
   end subroutine check_on_all_ranks

   !> Keep the first of two errors.
   pure subroutine keep_first(error, next)
      !> The error so far.
      type(error_type), allocatable, intent(inout) :: error
      !> Another, gone afterwards.
      type(error_type), allocatable, intent(inout) :: next

      if (.not. allocated(next)) return
      if (allocated(error)) then
         deallocate (next)
      else
         call move_alloc(next, error)
      end if
   end subroutine keep_first

   !> Path of the lock file.
   pure function lock_path(case) result(path)
      !> What is computed.
      type(case_type), intent(in) :: case
      !> The path.
      character(len=:), allocatable :: path

      path = case%output%file//'.lock'
   end function lock_path

end module spurflex_io_results_open
