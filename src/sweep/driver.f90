!> A whole run: open the file, solve what is missing in it, close the file.
module spurflex_sweep_driver
   use mpi_f08, only: MPI_Comm, MPI_DOUBLE_PRECISION, MPI_INTEGER, MPI_CHARACTER, mpi_bcast, mpi_comm_rank, mpi_comm_size
   use spurflex_base_error, only: error_type, exit_complete, exit_failed_points, exit_stopped
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text, fixed_text
   use spurflex_external_signals, only: survive_size_limit
   use spurflex_external_threads, only: use_one_thread
   use spurflex_io_agreement, only: share_error
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: read_deck, parse_deck
   use spurflex_io_log, only: logger
   use spurflex_io_results, only: results_file, close_results, describe_failures
   use spurflex_measure_effort, only: effort_type, stage_write
   use spurflex_measure_response, only: status_settled, status_diverged
   use spurflex_sweep_attendance, only: outcome_text
   use spurflex_sweep_checkpoint, only: check_agreement, diverged_before, find_missing, look_after_file, open_file
   use spurflex_sweep_chunk, only: chunk_type, points_of
   use spurflex_sweep_plan, only: plan_sweep, describe_plan
   use spurflex_sweep_schedule, only: outcomes
   use spurflex_sweep_timekeeper, only: timekeeper, new_timekeeper, load_text, describe_ends, stop_file
   use spurflex_sweep_twins, only: twin_table
   use spurflex_sweep_worker, only: work_on_chunks
   implicit none
   private

   public :: share_case, run_case

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
      type(error_type), allocatable :: next
      character(len=:), allocatable :: load, failures
      real(wp) :: window, begun, opening, writing
      integer, allocatable :: rigid_status(:), status(:, :)
      type(twin_table), asynchronous :: twins
      type(chunk_type), allocatable, target :: chunks(:)
      type(effort_type) :: effort
      integer :: ranks, total(outcomes), left

      code = exit_complete
      call use_one_thread()
      call survive_size_limit()
      call mpi_comm_size(comm, ranks)
      call new_timekeeper(keeper, case, comm, log%elapsed())
      call log%say(describe_plan(case)//new_line('a')//describe_ends(case))
      begun = log%elapsed()
      call open_file(results, keeper, case, comm, fresh, error)
      if (allocated(error)) return
      call find_missing(results, case, rigid_status, status, twins, error)
      ! No rank may write before every rank has read which points are missing: sharing errors waits for all.
      call share_error(comm, error)
      if (.not. allocated(error)) call check_agreement(case, comm, rigid_status, status, error)
      if (allocated(error)) then
         call close_results(results, next)
         return
      end if

      opening = log%elapsed() - begun
      total = 0
      left = 0
      window = 0.0_wp
      writing = 0.0_wp
      chunks = plan_sweep(case, rigid_status, status, ranks)
      if (size(chunks) > 0) then
         begun = log%elapsed()
         call log%begin(to_text(sum(points_of(chunks)))//' points on '//to_text(ranks)//' ranks')
         call work_on_chunks(case, chunks, comm, results, log, keeper, twins, total, effort, error)
         if (allocated(error)) then
            error%alone = .true.
            return
         end if
         call mpi_bcast(total, outcomes, MPI_INTEGER, 0, comm)
         call log%say(effort%describe())
         writing = effort%seconds(stage_write)
         left = sum(points_of(chunks)) - sum(total)
         window = log%elapsed() - begun
         if (left == 0) call log%finish()
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
      begun = log%elapsed()
      call close_results(results, error)
      call look_after_file(keeper, case, comm, error)
      if (allocated(error)) return
      call log%say('result file: opened in '//fixed_text(opening, 3)//' s, points written in '//fixed_text(writing, 3) &
                   //' s (all ranks), closed in '//fixed_text(log%elapsed() - begun, 3)//' s')
      call log%say('done in '//fixed_text(log%elapsed(), 2)//' s: '//outcome_text(total)//'; results in '//case%output%file)
      if (left > 0) call log%say(advice())

   contains

      !> How to go on after an early end. All ranks call this together.
      function advice() result(text)
         !> A line.
         character(len=:), allocatable :: text

         logical :: stops

         ! Another rank may have left a chunk, for a reason that holds here too.
         call keeper%share_signal(comm)
         stops = keeper%must_stop()
         if (.not. stops) keeper%reason = 'early'
         text = 'stopped '//keeper%reason//' with '//to_text(left)//' points left; '
         inquire (file=stop_file(case), exist=stops)
         if (stops) text = text//"remove '"//stop_file(case)//"' and "
         text = text//'run the same command again to go on'
      end function advice

   end subroutine run_case

end module spurflex_sweep_driver
