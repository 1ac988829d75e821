!> A sweep that guards nothing: the points of a deck, handed out and solved as the program does it, but without result file,
!> checksums, locks and looks at files. What the program needs more is the price of surviving, for scripts/benchmark.
!>
!> usage: bare_sweep DECK, on any number of ranks; the deck starts its points from `static` or `rest` and records nothing
program bare_sweep
   use, intrinsic :: iso_fortran_env, only: error_unit
   use mpi_f08, only: MPI_COMM_WORLD, MPI_Abort, MPI_Barrier, MPI_Comm_rank, MPI_Comm_size, MPI_Finalize, MPI_Init
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: fixed_text
   use spurflex_external_process, only: hasten_mpi_start
   use spurflex_external_threads, only: use_one_thread
   use spurflex_integrate_options, only: solver_options
   use spurflex_io_case, only: case_type
   use spurflex_io_log, only: logger, new_logger
   use spurflex_measure_points, only: new_solver, respond, solver_type
   use spurflex_measure_record, only: records
   use spurflex_measure_response, only: response, status_missing
   use spurflex_model_equations, only: equations_type
   use spurflex_sweep_attendance, only: outcome_text, sweep_attendant
   use spurflex_sweep_driver, only: share_case
   use spurflex_sweep_plan, only: chunk_type, is_chained, plan_grid, plan_row, points_of
   use spurflex_sweep_schedule, only: new_scheduler, outcomes
   use spurflex_sweep_timekeeper, only: timekeeper
   use spurflex_sweep_worker, only: set_points
   implicit none

   character(len=1024) :: deck
   type(case_type) :: case
   type(error_type), allocatable :: error
   type(logger), target :: log
   type(timekeeper), target :: keeper
   integer :: rank, ranks, total(outcomes)

   call get_command_argument(1, deck)
   call hasten_mpi_start()
   call MPI_Init()
   call MPI_Comm_rank(MPI_COMM_WORLD, rank)
   call MPI_Comm_size(MPI_COMM_WORLD, ranks)
   log = new_logger(active=rank == 0)
   call share_case(trim(deck), MPI_COMM_WORLD, case, error)
   if (allocated(error)) call give_up(error%message)
   if (is_chained(case) .or. records(case%output%record)) call give_up('this deck chains or records its points')
   call use_one_thread()
   keeper%reason = ''
   total = 0
   if (case%sweep%rigid) call solve(plan_row(case, spread(status_missing, 1, case%sweep%speed_count), ranks))
   if (case%sweep%flexible) call solve(plan_grid(case, spread(spread(status_missing, 1, case%sweep%speed_count), 2, &
                                                              case%sweep%stiffness_count), ranks))
   call log%say('done in '//fixed_text(log%elapsed(), 2)//' s: '//outcome_text(total))
   call MPI_Finalize()

contains

   !> Stop with a message.
   subroutine give_up(message)
      !> Message.
      character(len=*), intent(in) :: message

      if (rank == 0) write (error_unit, '(a)') message
      call MPI_Abort(MPI_COMM_WORLD, 1)
   end subroutine give_up

   !> Solve the points of chunks; counts up `total` on rank 0.
   subroutine solve(chunks)
      !> The chunks.
      type(chunk_type), intent(in) :: chunks(:)

      type(sweep_attendant) :: visitor
      type(solver_type), allocatable :: solver
      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)
      type(response), allocatable :: responses(:)
      real(wp), allocatable :: positions(:, :), velocities(:, :)
      integer :: number, i
      logical :: available

      visitor%log => log
      visitor%points = int(points_of(chunks), i8)
      call log%begin('a sweep that guards nothing')
      call new_scheduler(visitor%schedule, MPI_COMM_WORLD, chunks, keeper)
      options = case%solver
      options%multipliers = any(case%output%products == 'floquet' .or. case%output%products == 'lyapunov')
      allocate (solver)
      call new_solver(options, solver)
      do
         call visitor%schedule%take(number, available)
         if (.not. available) exit
         associate (chunk => chunks(number))
            allocate (responses(chunk%rows*chunk%count))
            call set_points(case, chunk, 1, chunk%count, equations, positions, velocities)
         end associate
         call respond(solver, equations, positions, velocities, visitor, responses)
         do i = 1, size(responses)
            call visitor%schedule%count_point(responses(i)%status)
         end do
         deallocate (responses)
      end do
      call visitor%schedule%finish()
      total = total + visitor%schedule%total
      ! Requests of what follows may not reach this scheduler.
      call MPI_Barrier(MPI_COMM_WORLD)
   end subroutine solve

end program bare_sweep
