!> The result file as the checkpoint of a sweep: opened or made, what it lacks, and what is done when it is taken away.
module spurflex_sweep_checkpoint
   use mpi_f08, only: MPI_Comm, MPI_IN_PLACE, MPI_INTEGER8, MPI_LOGICAL, MPI_MAX, mpi_allreduce, mpi_bcast, mpi_comm_rank
   use spurflex_base_checksum, only: extended
   use spurflex_base_error, only: error_type, fatal_error, exit_mismatch, exit_stopped
   use spurflex_base_kinds, only: i4, i8
   use spurflex_external_file_watch, only: watch_file, save_contents, end_watch
   use spurflex_external_posix, only: check_writable, is_link
   use spurflex_io_agreement, only: share_error
   use spurflex_io_case, only: case_type
   use spurflex_io_provenance, only: provenance_type, collect_provenance
   use spurflex_io_results, only: results_file, create_results, open_results, close_results, read_status, read_rigid
   use spurflex_io_results_room, only: check_results_room
   use spurflex_measure_response, only: response, status_missing, status_diverged
   use spurflex_sweep_plan, only: is_chained
   use spurflex_sweep_timekeeper, only: timekeeper, stop_file
   use spurflex_sweep_twins, only: twin_table, new_twin_table
   implicit none
   private

   public :: open_file, find_missing, check_agreement, diverged_before, look_after_file

   !> Added to the name of a result file that was taken away: the name under which its contents are saved.
   character(len=*), parameter :: saved_ending = '.saved'

contains

   !> Open the result file: continue an existing one of the same case, else make a new one.
   subroutine open_file(results, keeper, case, comm, fresh, error)
      !> The open file.
      type(results_file), intent(out) :: results
      !> Keeps an eye on it.
      type(timekeeper), intent(inout) :: keeper
      !> Case.
      type(case_type), intent(in) :: case
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Replace an existing file.
      logical, intent(in) :: fresh
      !> Set where the file cannot be used.
      type(error_type), allocatable, intent(out) :: error

      type(provenance_type) :: provenance
      type(error_type), allocatable :: next
      integer :: rank
      logical :: exists(1)

      call collect_provenance(provenance, error)
      call share_error(comm, error)
      if (allocated(error)) return
      call mpi_comm_rank(comm, rank)
      if (rank == 0) call look_before(case, fresh, exists(1), error)
      call share_error(comm, error)
      if (allocated(error)) return
      call mpi_bcast(exists, 1, MPI_LOGICAL, 0, comm)
      if (exists(1) .and. .not. fresh) then
         call open_results(results, case, comm, error)
      else
         call create_results(results, case, comm, provenance, fresh, error)
      end if
      if (allocated(error)) return
      if (rank == 0) call watch_file(keeper%file, case%output%file, error)
      call share_error(comm, error)
      if (allocated(error)) call close_results(results, next)
   end subroutine open_file

   !> Whether a run may begin and its file be written; one rank alone calls this.
   subroutine look_before(case, fresh, exists, error)
      !> Case.
      type(case_type), intent(in) :: case
      !> Replace an existing file.
      logical, intent(in) :: fresh
      !> The file exists.
      logical, intent(out) :: exists
      !> Set if it may not.
      type(error_type), allocatable, intent(out) :: error

      logical :: stops

      inquire (file=case%output%file, exist=exists)
      inquire (file=stop_file(case), exist=stops)
      if (stops) then
         call fatal_error(error, "nothing done: the stop file '"//stop_file(case)//"' is there; remove it and run the same "// &
                          'command again to go on', exit_stopped)
      else if (is_link(case%output%file) .and. (fresh .or. .not. exists)) then
         ! The new file would take the place of the link, on another disk perhaps.
         call fatal_error(error, "'"//case%output%file//"' is a link; a new file is not made in its place. Name the file "// &
                          'itself in the deck, or remove the link', exit_mismatch)
      else if (exists .and. .not. fresh) then
         call check_writable(case%output%file, error)
      else
         call check_results_room(case, error)
      end if
   end subroutine look_before

   !> Save what was computed if the result file was removed or replaced under the run. All ranks call this together, the file
   !> closed.
   subroutine look_after_file(keeper, case, comm, error)
      !> Keeps an eye on the file.
      type(timekeeper), intent(inout) :: keeper
      !> Case.
      type(case_type), intent(in) :: case
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> An error before; set if the file is not in its place.
      type(error_type), allocatable, intent(inout) :: error

      type(error_type), allocatable :: next
      character(len=:), allocatable :: text, saved

      if (.not. keeper%file%in_place()) then
         text = "the result file '"//case%output%file//"' was removed or replaced during the run; "
         call save_contents(keeper%file, case%output%file//saved_ending, saved, next)
         if (allocated(next)) then
            text = text//'what was computed is lost: '//next%message
         else
            text = text//"what was computed is in '"//saved//"': give it its name back to go on"
         end if
         if (allocated(error)) deallocate (error)
         call fatal_error(error, text)
      end if
      call end_watch(keeper%file)
      call share_error(comm, error)
   end subroutine look_after_file

   !> Points of the file that have diverged and are not solved again: a chained row with a missing point is, as a whole.
   pure function diverged_before(case, status) result(points)
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of each point as the run began, shape (speed, row).
      integer, intent(in) :: status(:, :)
      !> Number of points.
      integer :: points

      integer :: row

      points = 0
      do row = 1, size(status, 2)
         if (is_chained(case) .and. any(status(:, row) == status_missing)) cycle
         points = points + count(status(:, row) == status_diverged)
      end do
   end function diverged_before

   !> Whether every rank has read the same states: one that has another file of the same name before it, on a disk of its own,
   !> would write its points there. All ranks call this together.
   subroutine check_agreement(case, comm, rigid_status, status, error)
      !> Case.
      type(case_type), intent(in) :: case
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Status of the rigid points, shape (speed).
      integer, intent(in) :: rigid_status(:)
      !> Status of the flexible points, shape (speed, stiffness).
      integer, intent(in) :: status(:, :)
      !> Set on every rank if they differ.
      type(error_type), allocatable, intent(out) :: error

      integer(i8) :: bounds(2)
      integer(i4) :: checksum
      integer :: i, row

      checksum = 0_i4
      do i = 1, size(rigid_status)
         checksum = extended(checksum, rigid_status(i))
      end do
      do row = 1, size(status, 2)
         do i = 1, size(status, 1)
            checksum = extended(checksum, status(i, row))
         end do
      end do
      bounds = [int(checksum, i8), -int(checksum, i8)]
      call mpi_allreduce(MPI_IN_PLACE, bounds, size(bounds), MPI_INTEGER8, MPI_MAX, comm)
      if (bounds(1) == -bounds(2)) return
      call fatal_error(error, "not all ranks see the same result file '"//case%output%file//"': they need a common folder")
   end subroutine check_agreement

   !> Read which points are missing, and the rigid twins that are there.
   subroutine find_missing(results, case, rigid_status, status, twins, error)
      !> Open file.
      type(results_file), intent(in) :: results
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of the rigid points, shape (speed); empty if they are not asked for.
      integer, allocatable, intent(out) :: rigid_status(:)
      !> Status of the flexible points, shape (speed, stiffness); empty if they are not asked for.
      integer, allocatable, intent(out) :: status(:, :)
      !> The rigid twins; none if they are not asked for.
      type(twin_table), intent(out) :: twins
      !> Set where the file cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(response), allocatable :: rigid(:)

      allocate (rigid_status(merge(case%sweep%speed_count, 0, case%sweep%rigid)))
      allocate (status(merge(case%sweep%speed_count, 0, case%sweep%flexible), &
                       merge(case%sweep%stiffness_count, 0, case%sweep%flexible)))
      call read_status(results, rigid_status, status, error)
      if (allocated(error) .or. .not. case%sweep%rigid) return
      allocate (rigid(case%sweep%speed_count))
      call read_rigid(results, rigid, error)
      if (.not. allocated(error)) twins = new_twin_table(rigid, as_a_whole=is_chained(case))
   end subroutine find_missing

end module spurflex_sweep_checkpoint
