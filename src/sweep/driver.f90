!> A whole run: open the file, solve the rigid twins, solve the grid, close the file.
module spurflex_sweep_driver
   use mpi_f08, only: MPI_Comm, MPI_IN_PLACE, MPI_DOUBLE_PRECISION, MPI_MIN, MPI_INTEGER, MPI_CHARACTER, MPI_LOGICAL, &
      mpi_allreduce, mpi_bcast, mpi_comm_rank, mpi_comm_size
   use spurflex_base_error, only: error_type, fatal_error, exit_complete, exit_failed_points, exit_stopped
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text, fixed_text
   use spurflex_external_file_watch, only: watch_file, save_contents, end_watch
   use spurflex_external_posix, only: check_writable
   use spurflex_external_signals, only: watch_for_drain, survive_size_limit
   use spurflex_external_threads, only: use_one_thread
   use spurflex_io_agreement, only: share_error
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: read_deck, parse_deck
   use spurflex_io_log, only: logger
   use spurflex_io_provenance, only: provenance_type, collect_provenance
   use spurflex_io_results, only: results_file, create_results, open_results, close_results, read_status, read_rigid, &
      describe_failures
   use spurflex_io_results_room, only: check_results_room
   use spurflex_measure_effort, only: effort_type
   use spurflex_measure_response, only: response, status_missing, status_settled, status_diverged
   use spurflex_sweep_attendance, only: outcome_text
   use spurflex_sweep_plan, only: chunk_type, plan_row, plan_grid, is_chained, describe_plan
   use spurflex_sweep_schedule, only: outcomes
   use spurflex_sweep_timekeeper, only: timekeeper, new_timekeeper, load_text, describe_ends, stop_file
   use spurflex_sweep_worker, only: work_on_chunks, no_twin
   implicit none
   private

   public :: share_case, run_case

   !> Added to the name of a result file that was taken away: the name under which its contents are saved.
   character(len=*), parameter :: saved_ending = '.saved'

contains

   !> Read a deck on rank 0 and give its case to every rank. All ranks call this together.
   subroutine share_case(file, comm, case, error)
      !> Path of the deck; read on rank 0.
      character(len=*), intent(in) :: file
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> The case.
      type(case_type), intent(out) :: case
      !> Set on every rank, with every fault of the deck.
      type(error_type), allocatable, intent(out) :: error

      character(len=:), allocatable :: text
      integer :: rank, length(1)

      ! Whoever asks for a drain may do so before the first point.
      call watch_for_drain()
      call mpi_comm_rank(comm, rank)
      if (rank == 0) call read_deck(file, case, error)
      call share_error(comm, error)
      if (allocated(error)) return
      if (rank == 0) length = len(case%resolved)
      call mpi_bcast(length, 1, MPI_INTEGER, 0, comm)
      allocate (character(len=length(1)) :: text)
      if (rank == 0) text = case%resolved
      call mpi_bcast(text, length(1), MPI_CHARACTER, 0, comm)
      if (rank /= 0) call parse_deck(text, file, case, error)
      call share_error(comm, error)
      ! What concerns one run only is no part of the resolved deck.
      call mpi_bcast(case%sweep%wall_clock_limit, 1, MPI_DOUBLE_PRECISION, 0, comm)
   end subroutine share_case

   !> Compute what is missing in the result file of a case. All ranks call this together.
   subroutine run_case(case, comm, fresh, log, code, error)
      !> Case.
      type(case_type), intent(in) :: case
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Start over, replacing an existing result file.
      logical, intent(in) :: fresh
      !> Logger.
      type(logger), intent(inout), target :: log
      !> Exit code of the program.
      integer, intent(out) :: code
      !> Set where the run fails.
      type(error_type), allocatable, intent(out) :: error

      type(results_file), target :: results
      type(timekeeper), target :: keeper
      character(len=:), allocatable :: load, failures
      real(wp) :: window
      integer, allocatable :: rigid_status(:), status(:, :)
      real(wp), allocatable :: rigid_deformation(:, :)
      integer :: ranks, total(outcomes), left

      code = exit_complete
      call use_one_thread()
      call survive_size_limit()
      call mpi_comm_size(comm, ranks)
      call new_timekeeper(keeper, case, comm, log%elapsed())
      call log%say(describe_plan(case)//new_line('a')//describe_ends(case))
      call open_file(results, keeper, case, comm, fresh, error)
      if (allocated(error)) return
      call find_missing(results, case, rigid_status, status, rigid_deformation, error)
      ! No rank may write before every rank has read which points are missing: sharing errors waits for all.
      call share_error(comm, error)
      if (allocated(error)) return

      total = 0
      left = 0
      window = 0.0_wp
      if (any(rigid_status == status_missing)) then
         call work_through(plan_row(case, rigid_status, ranks), 'rigid support')
         if (allocated(error)) return
         call mpi_allreduce(MPI_IN_PLACE, rigid_deformation, size(rigid_deformation), MPI_DOUBLE_PRECISION, MPI_MIN, comm)
      end if
      if (any(status == status_missing) .and. left == 0) then
         call work_through(plan_grid(case, status, ranks), 'flexible support')
         if (allocated(error)) return
      end if
      if (left == 0 .and. sum(total) == 0) call log%say('nothing to do: every point of '//case%output%file//' is there')
      total(status_diverged) = total(status_diverged) + diverged_before(case, reshape(rigid_status, [size(rigid_status), 1])) &
                               + diverged_before(case, status)
      if (total(status_diverged) > 0) code = exit_failed_points
      if (left > 0) code = exit_stopped
      if (sum(total) > 0) then
         call load_text(keeper, comm, window, load)
         call log%say(load)
      end if
      if (sum(total) > total(status_settled)) then
         call describe_failures(results, case, failures)
         if (failures /= '') call log%say(failures)
      end if
      call close_results(results, error)
      call look_after_file(keeper, case, comm, error)
      if (allocated(error)) return
      call log%say('done in '//fixed_text(log%elapsed(), 2)//' s: '//outcome_text(total)//'; results in '//case%output%file)
      if (left > 0) call log%say(advice())

   contains

      !> Work through the chunks of one support; counts up `total`, and `left` on every rank.
      subroutine work_through(chunks, support)
         !> The chunks, the same on every rank.
         type(chunk_type), intent(in) :: chunks(:)
         !> Name of the support.
         character(len=*), intent(in) :: support

         type(effort_type) :: effort
         integer :: finished(outcomes)
         real(wp) :: begun

         begun = log%elapsed()
         call log%begin(support//': '//to_text(sum(chunks%rows*chunks%count))//' points on '//to_text(ranks)//' ranks')
         call work_on_chunks(case, chunks, comm, results, log, keeper, rigid_deformation, finished, effort, error)
         if (allocated(error)) then
            error%alone = .true.
            return
         end if
         call mpi_bcast(finished, outcomes, MPI_INTEGER, 0, comm)
         total = total + finished
         call log%say(effort%describe())
         left = left + sum(chunks%rows*chunks%count) - sum(finished)
         window = window + log%elapsed() - begun
         if (left == 0) call log%finish()
      end subroutine work_through

      !> How to go on after an early end.
      function advice() result(text)
         !> A line.
         character(len=:), allocatable :: text

         logical :: stops

         ! Another rank may have left a chunk, for a reason that holds here too.
         stops = keeper%must_stop()
         if (.not. stops) keeper%reason = 'early'
         text = 'stopped '//keeper%reason//' with '//to_text(left)//' points left; '
         inquire (file=stop_file(case), exist=stops)
         if (stops) text = text//"remove '"//stop_file(case)//"' and "
         text = text//'run the same command again to go on'
      end function advice

   end subroutine run_case

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
      character(len=:), allocatable :: text

      if (.not. keeper%file%in_place()) then
         text = "the result file '"//case%output%file//"' was removed or replaced during the run; "
         call save_contents(keeper%file, case%output%file//saved_ending, next)
         if (allocated(next)) then
            text = text//'what was computed is lost: '//next%message
         else
            text = text//"what was computed is in '"//case%output%file//saved_ending//"': give it its name back to go on"
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

   !> Read which points are missing, and the rigid twins that are there.
   subroutine find_missing(results, case, rigid_status, status, rigid_deformation, error)
      !> Open file.
      type(results_file), intent(in) :: results
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of the rigid points, shape (speed); empty if they are not asked for.
      integer, allocatable, intent(out) :: rigid_status(:)
      !> Status of the flexible points, shape (speed, stiffness); empty if they are not asked for.
      integer, allocatable, intent(out) :: status(:, :)
      !> Largest bearing deformations of the rigid twins and their relative error, shape (3, speed); unallocated if they are
      !> not asked for.
      real(wp), allocatable, intent(out) :: rigid_deformation(:, :)
      !> Set where the file cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(response), allocatable :: rigid(:)
      integer :: i

      allocate (rigid_status(merge(case%sweep%speed_count, 0, case%sweep%rigid)))
      allocate (status(merge(case%sweep%speed_count, 0, case%sweep%flexible), &
                       merge(case%sweep%stiffness_count, 0, case%sweep%flexible)))
      call read_status(results, rigid_status, status, error)
      if (allocated(error) .or. .not. case%sweep%rigid) return
      allocate (rigid(case%sweep%speed_count))
      call read_rigid(results, rigid, error)
      allocate (rigid_deformation(3, case%sweep%speed_count), source=no_twin)
      do i = 1, size(rigid)
         if (rigid(i)%status == status_missing .or. rigid(i)%status == status_diverged) cycle
         rigid_deformation(:, i) = [rigid(i)%bearing_deformation_max, rigid(i)%error_estimate]
      end do
   end subroutine find_missing

end module spurflex_sweep_driver
