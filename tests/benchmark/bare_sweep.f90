!> A sweep that guards nothing: the points of a deck, handed out and solved as the program does it, but without checkpoints,
!> checksums, locks and looks at files. Its results go to rank 0 at the end, which writes them at once into a plain file beside
!> the deck's, `.bare` behind its name. What the program needs more is the price of surviving, for scripts/benchmark.
!>
!> usage: bare_sweep DECK, on any number of ranks; the deck starts its points from `static` or `rest` and records nothing
program bare_sweep
   use, intrinsic :: iso_fortran_env, only: error_unit
   use hdf5, only: H5F_ACC_TRUNC_F, H5T_NATIVE_DOUBLE, H5T_NATIVE_INTEGER, h5dclose_f, h5dcreate_f, h5dwrite_f, h5fclose_f, &
      h5fcreate_f, h5sclose_f, h5screate_simple_f, hid_t, hsize_t
   use mpi_f08, only: MPI_COMM_WORLD, MPI_DOUBLE_PRECISION, MPI_INTEGER, MPI_SUM, MPI_Abort, MPI_Barrier, MPI_Comm_rank, &
      MPI_Comm_size, MPI_Finalize, MPI_Init, MPI_Reduce
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: fixed_text
   use spurflex_external_process, only: hasten_mpi_start
   use spurflex_external_threads, only: use_one_thread
   use spurflex_integrate_options, only: solver_options
   use spurflex_io_case, only: case_type
   use spurflex_io_hdf5, only: start_hdf5
   use spurflex_io_log, only: logger, new_logger
   use spurflex_io_results_layout, only: flexible_variables, get_values, real_value, rigid_variables, variable_type
   use spurflex_measure_points, only: new_solver, respond, solver_type
   use spurflex_measure_record, only: records
   use spurflex_measure_response, only: response, status_missing
   use spurflex_model_equations, only: equations_type
   use spurflex_sweep_attendance, only: outcome_text, sweep_attendant
   use spurflex_sweep_driver, only: share_case
   use spurflex_sweep_chunk, only: chunk_type, points_of
   use spurflex_sweep_plan, only: is_chained, plan_sweep
   use spurflex_sweep_schedule, only: new_scheduler, outcomes
   use spurflex_sweep_timekeeper, only: timekeeper
   use spurflex_sweep_worker, only: set_points
   implicit none

   character(len=1024) :: deck
   type(case_type) :: case
   type(error_type), allocatable :: error
   type(logger), target :: log
   type(timekeeper), target :: keeper
   type(response), allocatable :: known(:, :)
   integer :: rank, ranks, total(outcomes)
   real(wp) :: begun

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
   allocate (known(case%sweep%speed_count, 0:case%sweep%stiffness_count))
   known%status = status_missing
   associate (speeds => case%sweep%speed_count, rows => case%sweep%stiffness_count)
      call solve(plan_sweep(case, spread(status_missing, 1, merge(speeds, 0, case%sweep%rigid)), &
                            spread(spread(status_missing, 1, speeds), 2, merge(rows, 0, case%sweep%flexible)), ranks))
   end associate
   begun = log%elapsed()
   call keep()
   call log%say('result file: written in '//fixed_text(log%elapsed() - begun, 3)//' s')
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

   !> Solve the points of chunks; `total` of all ranks on rank 0.
   subroutine solve(chunks)
      !> The chunks.
      type(chunk_type), intent(in), target :: chunks(:)

      type(sweep_attendant) :: visitor
      type(solver_type), allocatable :: solver
      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)
      type(response), allocatable :: responses(:)
      real(wp), allocatable :: positions(:, :), velocities(:, :)
      type(chunk_type) :: chunk
      integer :: i
      logical :: available

      visitor%log => log
      visitor%points = sum(int(points_of(chunks), i8))
      call log%begin('a sweep that guards nothing')
      call new_scheduler(visitor%schedule, MPI_COMM_WORLD, chunks, keeper)
      options = case%solver
      options%multipliers = any(case%output%products == 'floquet' .or. case%output%products == 'lyapunov')
      allocate (solver)
      call new_solver(options, solver)
      do
         call visitor%schedule%take(chunk, available)
         if (.not. available) exit
         allocate (responses(points_of(chunk)))
         call set_points(case, chunk, 1, chunk%count, equations, positions, velocities)
         call respond(solver, equations, positions, velocities, visitor, responses)
         do i = 1, size(responses)
            call visitor%schedule%count_point(responses(i)%status)
         end do
         known(chunk%first:chunk%first + chunk%count - 1, chunk%row:chunk%row + chunk%rows - 1) = &
            reshape(responses, [chunk%count, chunk%rows])
         deallocate (responses)
      end do
      call visitor%schedule%finish()
      total = visitor%schedule%total
   end subroutine solve

   !> Collect all responses on rank 0 and write them.
   subroutine keep()
      integer(hid_t) :: file
      integer :: ierr

      if (rank == 0) then
         call start_hdf5(error)
         if (allocated(error)) call give_up(error%message)
         call h5fcreate_f(case%output%file//'.bare', H5F_ACC_TRUNC_F, file, ierr)
         if (ierr < 0) call give_up('cannot make the file')
      end if
      call keep_variables(file, rigid_variables(case%sweep, case%output%products), known(:, 0:0))
      call keep_variables(file, flexible_variables(case%sweep, case%output%products), known(:, 1:))
      if (rank == 0) call h5fclose_f(file, ierr)
   end subroutine keep

   !> Collect and write the variables of one support.
   subroutine keep_variables(file, variables, points)
      !> Open file; rank 0 only.
      integer(hid_t), intent(in) :: file
      !> The variables.
      type(variable_type), intent(in) :: variables(:)
      !> This rank's responses, shape (speed, row).
      type(response), intent(in) :: points(:, :)

      type(response) :: mine(size(points))
      real(wp) :: reals(size(points)), all_reals(size(points)), eta(3, size(points))
      integer :: integers(size(points)), all_integers(size(points)), ierr(4), i
      integer(hid_t) :: space, dataset, kind

      mine = reshape(points, [size(points)])
      eta = 0.0_wp
      do i = 1, size(variables)
         reals = 0.0_wp
         integers = 0
         call get_values(variables(i)%quantity, mine, eta, reals, integers)
         ! The others have zeros where these are known.
         where (mine%status == status_missing) reals = 0.0_wp
         where (mine%status == status_missing) integers = 0
         call MPI_Reduce(reals, all_reals, size(reals), MPI_DOUBLE_PRECISION, MPI_SUM, 0, MPI_COMM_WORLD)
         call MPI_Reduce(integers, all_integers, size(integers), MPI_INTEGER, MPI_SUM, 0, MPI_COMM_WORLD)
         if (rank > 0) cycle
         kind = merge(H5T_NATIVE_DOUBLE, H5T_NATIVE_INTEGER, variables(i)%kind == real_value)
         call h5screate_simple_f(2, int(shape(points), hsize_t), space, ierr(1))
         call h5dcreate_f(file, trim(variables(i)%name), kind, space, dataset, ierr(2))
         if (variables(i)%kind == real_value) then
            call h5dwrite_f(dataset, kind, all_reals, int(shape(points), hsize_t), ierr(3))
         else
            call h5dwrite_f(dataset, kind, all_integers, int(shape(points), hsize_t), ierr(3))
         end if
         call h5dclose_f(dataset, ierr(4))
         if (minval(ierr) < 0) call give_up('cannot write '//trim(variables(i)%name))
         call h5sclose_f(space, ierr(1))
      end do
   end subroutine keep_variables

end program bare_sweep
