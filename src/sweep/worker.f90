!> One rank's work: take a piece of the grid, solve its points, write it, take the next.
module spurflex_sweep_worker
   use mpi_f08, only: MPI_Comm, MPI_INTEGER8, MPI_DOUBLE_PRECISION, MPI_SUM, mpi_reduce
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, i4, i8
   use spurflex_integrate_options, only: solver_options, start_rest, start_down
   use spurflex_io_axes, only: speeds, stiffnesses
   use spurflex_io_case, only: case_type
   use spurflex_io_log, only: logger
   use spurflex_io_results, only: describe_damage, results_file
   use spurflex_measure_effort, only: effort_type, ways, stages, stage_write, kinds_of_steps
   use spurflex_measure_points, only: solver_type, new_solver, respond
   use spurflex_measure_record, only: records
   use spurflex_measure_recorder, only: recorder_type, new_recorder, release_recorder
   use spurflex_measure_response, only: response, status_diverged
   use spurflex_model_equations, only: equations_type, new_equations, rest_deviation
   use spurflex_model_parameters, only: operating_point, support_rigid, support_flexible
   use spurflex_sweep_attendance, only: sweep_attendant
   use spurflex_sweep_chunk, only: chunk_type, points_of
   use spurflex_sweep_plan, only: is_chained
   use spurflex_sweep_recording, only: record_points
   use spurflex_sweep_schedule, only: new_scheduler
   use spurflex_sweep_timekeeper, only: timekeeper
   use spurflex_sweep_twins, only: twin_table
   use spurflex_sweep_writing, only: finding, outbox, write_finding
   implicit none
   private

   public :: work_on_chunks, set_points

contains

   !> Solve the points of chunks, piece by piece, as long as there are any. All ranks call this together.
   subroutine work_on_chunks(case, chunks, comm, results, log, keeper, twins, total, effort, error)
      !> Case.
      type(case_type), intent(in) :: case
      !> Chunks, the same on every rank.
      type(chunk_type), intent(in), target :: chunks(:)
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Open result file.
      type(results_file), intent(in) :: results
      !> Logger.
      type(logger), intent(inout), target :: log
      !> This rank's time.
      type(timekeeper), intent(inout), target :: keeper
      !> Rigid twins.
      type(twin_table), intent(inout), asynchronous :: twins
      !> On rank 0: points by status on all ranks, shape (outcomes).
      integer, intent(out) :: total(:)
      !> On rank 0: what the points cost on all ranks.
      type(effort_type), intent(out) :: effort
      !> Set where a chunk cannot be written.
      type(error_type), allocatable, intent(out) :: error

      type(sweep_attendant) :: visitor
      type(solver_type), allocatable :: solver
      type(solver_options) :: options
      type(recorder_type), allocatable :: recorder
      type(finding) :: found
      type(outbox) :: unwritten
      logical :: available

      visitor%log => log
      visitor%points = sum(int(points_of(chunks), i8))
      call new_scheduler(visitor%schedule, comm, chunks, keeper)
      options = case%solver
      options%multipliers = any(case%output%products == 'floquet' .or. case%output%products == 'lyapunov')
      allocate (solver)
      call new_solver(options, solver)
      allocate (recorder)
      call new_recorder(options, case%output%record, recorder)
      call say_damage(chunks, results, log)
      do
         call visitor%schedule%take(found%chunk, available)
         if (.not. available) exit
         associate (points => points_of(found%chunk))
            allocate (found%responses(points))
            allocate (found%checksums(points), source=0_i4)
         end associate
         ! Rigid points come first: after a flexible one there are no more.
         if (found%chunk%row > 0) call twins%share(comm)
         call solve_chunk(case, found%chunk, solver, recorder, results, visitor, found%responses, found%checksums, error)
         if (allocated(error)) return
         call solver%effort%begin()
         if (found%chunk%row == 0) then
            call twins%keep(found%chunk%first, found%responses)
            call write_finding(found, twins, results, visitor%schedule, error)
            deallocate (found%responses, found%checksums)
         else
            call unwritten%put(found)
            ! What it takes to write what has waited is not what this piece takes.
            if (unwritten%has_older()) call keeper%end_piece()
            if (twins%are_known()) call unwritten%empty(twins, results, visitor%schedule, error)
         end if
         if (allocated(error)) return
         call solver%effort%end(stage_write)
      end do
      ! Other ranks may be at work yet, and ask rank 0 for more.
      call twins%share(comm)
      do while (.not. twins%are_known())
         call visitor%attend()
      end do
      call solver%effort%begin()
      call unwritten%empty(twins, results, visitor%schedule, error)
      if (allocated(error)) return
      call solver%effort%end(stage_write)
      call release_recorder(recorder)
      call visitor%schedule%finish()
      total = visitor%schedule%total
      effort = effort_type()
      call mpi_reduce(solver%effort%points, effort%points, ways, MPI_INTEGER8, MPI_SUM, 0, comm)
      call mpi_reduce(solver%effort%steps, effort%steps, kinds_of_steps, MPI_INTEGER8, MPI_SUM, 0, comm)
      call mpi_reduce(solver%effort%modes, effort%modes, kinds_of_steps, MPI_INTEGER8, MPI_SUM, 0, comm)
      call mpi_reduce(solver%effort%seconds, effort%seconds, stages, MPI_DOUBLE_PRECISION, MPI_SUM, 0, comm)
   end subroutine work_on_chunks

   !> Say what of the file is computed again.
   subroutine say_damage(chunks, results, log)
      !> The chunks.
      type(chunk_type), intent(in) :: chunks(:)
      !> Open result file.
      type(results_file), intent(in) :: results
      !> Logger.
      type(logger), intent(in) :: log

      character(len=:), allocatable :: damage
      logical :: rigid
      integer :: k

      do k = 1, 2
         rigid = k == 1
         if (.not. any((chunks%row == 0) .eqv. rigid)) cycle
         damage = describe_damage(results, rigid)
         if (damage /= '') call log%say(trim(merge('rigid:    ', 'flexible: ', rigid))//' '//damage)
      end do
   end subroutine say_damage

   !> Solve the points of a chunk; record what is asked for of them, and write that.
   subroutine solve_chunk(case, chunk, solver, recorder, results, visitor, responses, checksums, error)
      !> Case.
      type(case_type), intent(in) :: case
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> Solver.
      type(solver_type), intent(inout) :: solver
      !> Records motions.
      type(recorder_type), intent(inout) :: recorder
      !> Open result file.
      type(results_file), intent(in) :: results
      !> Let in now and then.
      type(sweep_attendant), intent(inout) :: visitor
      !> Responses at the speeds of one row after the other, shape (count rows).
      type(response), intent(out) :: responses(:)
      !> Checksums of what was recorded, shape (count rows); left alone if nothing is.
      integer(i4), intent(inout) :: checksums(:)
      !> Set where what was recorded cannot be written.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type), allocatable :: equations(:)
      real(wp), allocatable :: positions(:, :), velocities(:, :)
      integer :: i, k

      if (.not. is_chained(case)) then
         call set_points(case, chunk, 1, chunk%count, equations, positions, velocities)
         call respond(solver, equations, positions, velocities, visitor, responses)
         if (records(case%output%record)) call record_points(case%output%record, recorder, chunk, equations, positions, &
                                                             velocities, responses, results, visitor, checksums, error)
         return
      end if
      ! Rows side by side, each point from where its neighbour ended.
      do k = 1, chunk%count
         i = merge(chunk%count + 1 - k, k, case%solver%start == start_down)
         call continue_rows(i, k == 1)
         if (allocated(error)) return
      end do

   contains

      !> Solve the points of one speed.
      subroutine continue_rows(i, begins)
         !> Index of the speed in the chunk.
         integer, intent(in) :: i
         !> It is the first one: it continues no other.
         logical, intent(in) :: begins

         type(response) :: column(chunk%rows)
         integer(i4) :: column_checksums(chunk%rows)
         type(chunk_type) :: tile
         real(wp), allocatable :: start_positions(:, :), start_velocities(:, :)
         integer :: row, next

         call set_points(case, chunk, i, i, equations, start_positions, start_velocities)
         if (begins) then
            positions = start_positions
            velocities = start_velocities
         else
            next = merge(1, -1, case%solver%start == start_down)
            do row = 1, chunk%rows
               if (responses((row - 1)*chunk%count + i + next)%status /= status_diverged) cycle
               positions(:, row) = start_positions(:, row)
               velocities(:, row) = start_velocities(:, row)
            end do
         end if
         call respond(solver, equations, positions, velocities, visitor, column)
         responses(i::chunk%count) = column
         if (.not. records(case%output%record)) return
         tile = chunk
         tile%first = chunk%first + i - 1
         tile%count = 1
         call record_points(case%output%record, recorder, tile, equations, positions, velocities, column, results, visitor, &
                            column_checksums, error)
         checksums(i::chunk%count) = column_checksums
      end subroutine continue_rows

   end subroutine solve_chunk

   !> The points of some speeds of a chunk, at the starts that continue no other.
   subroutine set_points(case, chunk, first, last, equations, positions, velocities)
      !> Case.
      type(case_type), intent(in) :: case
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> First and last speed, as indices in the chunk.
      integer, intent(in) :: first, last
      !> Equations of motion at the speeds of one row after the other, shape ((last - first + 1) rows).
      type(equations_type), allocatable, intent(out) :: equations(:)
      !> Deviation from the static equilibrium and its rate, shape (n, (last - first + 1) rows).
      real(wp), allocatable, intent(out) :: positions(:, :), velocities(:, :)

      type(operating_point) :: point
      real(wp), allocatable :: speed(:), stiffness(:)
      integer :: i, row, p

      speed = speeds(case%sweep)
      stiffness = stiffnesses(case%sweep)
      point%support = merge(support_flexible, support_rigid, chunk%row > 0)
      allocate (equations((last - first + 1)*chunk%rows))
      do row = 1, chunk%rows
         if (chunk%row > 0) point%support_stiffness = stiffness(chunk%row + row - 1)
         do i = first, last
            point%speed = speed(chunk%first + i - 1)
            equations((row - 1)*(last - first + 1) + i - first + 1) = new_equations(case%gears, case%box, case%load, point)
         end do
      end do
      allocate (positions(equations(1)%n, size(equations)), velocities(equations(1)%n, size(equations)))
      do p = 1, size(equations)
         call set_start(case, equations(p), positions(:, p), velocities(:, p))
      end do
   end subroutine set_points

   !> Where a point starts that continues no other: at rest, or in static equilibrium.
   pure subroutine set_start(case, equations, position, velocity)
      !> Case.
      type(case_type), intent(in) :: case
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium and its rate, shape (n).
      real(wp), intent(out) :: position(:), velocity(:)

      position = 0.0_wp
      velocity = 0.0_wp
      if (case%solver%start == start_rest) position = rest_deviation(equations)
   end subroutine set_start

end module spurflex_sweep_worker
