!> The motion that a start leads to, against long runs of another method.
module test_search
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use period_maps, only: methods
   use runge_kutta, only: new_runge_kutta, runge_kutta_type, sampled_amplitude
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_options, only: integrator_collocation, integrator_newmark, solver_options
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_points, only: new_solver, solver_type, respond_one
   use spurflex_measure_response, only: empty_response, motion_chaotic, &
      motion_quasi_periodic, response, status_settled
   use spurflex_model_equations, only: equations_type, new_equations, rest_deviation
   use spurflex_model_parameters, only: gearbox
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_search

   !> Accuracy asked of the solver [-].
   real(wp), parameter :: asked = 1.0e-4_wp

   !> Runge-Kutta with 256 steps a period where the teeth part; measured 4e-5.
   real(wp), parameter :: other_method = 1.0e-3_wp

contains

   !> The tests of this suite.
   subroutine collect_search(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('three starts between the jumps', test_hysteresis), &
                  new_unittest('static starts near the end of a branch', test_static), &
                  new_unittest('soft supports from the static equilibrium', test_soft), &
                  new_unittest('soft supports from rest', test_rest), &
                  new_unittest('a 2T motion is not called 1T by Newmark, nor its numbers', test_refined_class), &
                  new_unittest('a 1T motion that large steps split where the teeth graze', test_split), &
                  new_unittest('a weakly unstable 1T is not where a motion stays', test_weakly_unstable), &
                  new_unittest('a multiplier is given for periodic motions only', test_no_multiplier) &
                  ]
   end subroutine collect_search

   !> Solve a point.
   subroutine solve_point(equations, options, position, velocity, answer)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Options.
      type(solver_options), intent(in) :: options
      !> Start before, section of the motion after; the static equilibrium where unallocated.
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> The response.
      type(response), intent(out) :: answer

      type(solver_type), allocatable :: solver
      type(no_attendant) :: nobody

      if (.not. allocated(position)) allocate (position(equations%n), velocity(equations%n), source=0.0_wp)
      allocate (solver)
      call new_solver(options, solver)
      call respond_one(solver, equations, position, velocity, nobody, answer)
   end subroutine solve_point

   !> With 16 steps a mesh period the sections of this motion alternate by 4e-5 of it, next to the jump.
   subroutine test_split(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gearbox) :: box
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)

      box = reference_box()
      box%support_offset = 0.1127_wp
      call solve_point(new_equations(reference_gears(), box, reference_load(), flexible_point(3090.0_wp, 10.0_wp**10.5_wp)), &
                       solver_options(integrator=integrator_collocation, tolerance=1.0e-3_wp), position, velocity, answer)
      call check(error, answer%status, status_settled, 'status')
      if (allocated(error)) return
      call check(error, answer%motion, 1, 'class')
   end subroutine test_split

   !> Amplitude of y1 over the last periods of a long run by Runge-Kutta.
   function brute_force(equations, position, velocity, periods) result(amplitude)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Start.
      real(wp), intent(in) :: position(:), velocity(:)
      !> Mesh periods.
      integer, intent(in) :: periods
      !> The amplitude [m].
      real(wp) :: amplitude

      integer, parameter :: steps = 256, measured = 8
      type(runge_kutta_type) :: method
      real(wp) :: state(2*equations%n), samples(0:measured*steps)
      integer :: k, last

      method = new_runge_kutta(equations, steps)
      state = [position, velocity]
      last = 0
      do k = 1, periods
         call method%advance(state)
         if (k <= periods - measured) cycle
         samples(last:last + steps) = method%y1
         last = last + steps
      end do
      amplitude = sampled_amplitude(samples)
   end function brute_force

   !> At 3100 rev/min on a rigid support, coming from below, from above and from the static equilibrium: below the jump up and
   !> above the jump down there are two motions. Each is where 5000 periods of Runge-Kutta end from the same start.
   subroutine test_hysteresis(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: first(3) = [3000.0_wp, 3200.0_wp, 3100.0_wp], step(3) = [10.0_wp, -10.0_wp, 0.0_wp]
      integer, parameter :: points = 10, long = 5000
      !> The branches are at 7.7 and 12.6 micrometres.
      real(wp), parameter :: apart = 1.5_wp
      type(equations_type) :: equations
      type(solver_options) :: options
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:), before(:), rate_before(:)
      real(wp) :: amplitude(3)
      integer :: start, k

      options = solver_options(integrator=integrator_collocation, tolerance=asked)
      do start = 1, 3
         if (allocated(position)) deallocate (position, velocity)
         do k = merge(points, 0, start == 3), points
            equations = new_equations(reference_gears(), reference_box(), reference_load(), &
                                      rigid_point(first(start) + step(start)*real(k, wp)))
            if (allocated(position)) then
               before = position
               rate_before = velocity
            else
               before = spread(0.0_wp, 1, equations%n)
               rate_before = before
            end if
            call solve_point(equations, options, position, velocity, answer)
            call check(error, answer%status, status_settled, 'status')
            if (allocated(error)) return
         end do
         amplitude(start) = answer%y1_amplitude
         call check(error, brute_force(equations, before, rate_before, long), amplitude(start), &
                    other_method*amplitude(start), 'long run from start '//to_text(start))
         if (allocated(error)) return
      end do
      call check(error, amplitude(2) > apart*amplitude(1), 'up and down are on different branches')
   end subroutine test_hysteresis

   !> Static starts on either side of where their motion changes branch, on both supports; both integrators.
   subroutine test_static(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(5) = [1100.0_wp, 1180.0_wp, 3040.0_wp, 3120.0_wp, 3500.0_wp]
      integer, parameter :: long = 1000
      type(equations_type) :: equations
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:), zero(:)
      real(wp) :: amplitude
      integer :: i, method, support

      do support = 1, 2
         do i = 1, size(speed)
            if (support == 1) then
               equations = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speed(i)))
            else
               equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(speed(i), 2.5e8_wp))
            end if
            zero = spread(0.0_wp, 1, equations%n)
            amplitude = brute_force(equations, zero, zero, long)
            do method = 1, size(methods)
               if (allocated(position)) deallocate (position, velocity)
               call solve_point(equations, solver_options(integrator=methods(method), tolerance=asked), position, velocity, answer)
               call check(error, answer%status, status_settled, 'status at '//to_text(speed(i))//' rev/min')
               if (allocated(error)) return
               call check(error, answer%y1_amplitude, amplitude, other_method*amplitude, &
                          'amplitude at '//to_text(speed(i))//' rev/min')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_static

   !> Amplitude of y1 at the end of a long run by collocation.
   subroutine long_run(equations, position, velocity, periods, amplitude, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Start.
      real(wp), intent(in) :: position(:), velocity(:)
      !> Mesh periods.
      integer, intent(in) :: periods
      !> The amplitude [m].
      real(wp), intent(out) :: amplitude
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 24
      type(collocation_map) :: map
      type(orbit_type) :: orbit
      type(motion_measure) :: measure
      type(response) :: measured
      type(library_error), allocatable :: fault
      real(wp), allocatable :: state(:)
      integer :: k

      amplitude = 0.0_wp
      call map%load(equations, steps, fault)
      if (allocated(fault)) then
         call test_failed(error, fault%message)
         return
      end if
      state = map%to_state(position, velocity)
      do k = 1, periods
         call map%advance(state)
      end do
      call measure%reset(equations%static_observation)
      call map%advance(state, orbit=orbit)
      call measure%add(orbit)
      measured = empty_response()
      call measure%finish(measured)
      amplitude = measured%y1_amplitude
   end subroutine long_run

   !> Supports on which a transient takes thousands of periods.
   subroutine test_soft(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_soft(.false., error)
   end subroutine test_soft

   !> The same, metres away from the static equilibrium at first.
   subroutine test_rest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_soft(.true., error)
   end subroutine test_rest

   !> Soft supports, contact kept and lost: the motion is the one that a run of 60,000 periods ends with.
   subroutine compare_soft(from_rest, error)
      !> Start with every coordinate zero, not at the static equilibrium.
      logical, intent(in) :: from_rest
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: stiffness(2) = [1.0e3_wp, 1.0e5_wp], speed(2) = [1500.0_wp, 2600.0_wp]
      !> exp(-2.7e-4) a period: metres are below a nanometre after that.
      integer, parameter :: long = 60000
      !> A drift of a micrometre over the long run's last period; the amplitude itself is good to 1e-6.
      real(wp), parameter :: tolerance = 1.0e-4_wp
      type(equations_type) :: equations
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: amplitude
      integer :: i, k

      do k = 1, size(stiffness)
         do i = 1, size(speed)
            equations = new_equations(reference_gears(), reference_box(), reference_load(), &
                                      flexible_point(speed(i), stiffness(k)))
            position = spread(0.0_wp, 1, equations%n)
            velocity = position
            if (from_rest) position = rest_deviation(equations)
            call long_run(equations, position, velocity, long, amplitude, error)
            if (allocated(error)) return
            call solve_point(equations, solver_options(integrator=integrator_collocation, tolerance=asked), position, velocity, &
                             answer)
            call check(error, answer%status, status_settled, 'status on '//to_text(stiffness(k))//' N/m')
            if (allocated(error)) return
            call check(error, answer%y1_amplitude, amplitude, tolerance*amplitude, &
                       'amplitude on '//to_text(stiffness(k))//' N/m at '//to_text(speed(i))//' rev/min')
            if (allocated(error)) return
         end do
      end do
   end subroutine compare_soft

   !> Near the onset of 2T a coarse Newmark step has the wrong motion. Whatever steps it takes in the end, what it calls settled
   !> has the class and the amplitude that collocation finds.
   subroutine test_refined_class(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 6
      real(wp), parameter :: rigid(speeds) = [5370.0_wp, 5376.0_wp, 5389.0_wp, 5393.0_wp, 5450.0_wp, 5500.0_wp], &
         flexible(speeds) = [5430.0_wp, 5446.0_wp, 5450.0_wp, 5453.0_wp, 5470.0_wp, 5500.0_wp]
      real(wp), parameter :: tolerance = 1.0e-3_wp
      type(equations_type) :: equations
      type(response) :: newmark, judge
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: speed
      integer :: i, support

      do support = 1, 2
         do i = 1, speeds
            if (support == 1) then
               speed = rigid(i)
               equations = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speed))
            else
               speed = flexible(i)
               equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(speed, 2.5e8_wp))
            end if
            if (allocated(position)) deallocate (position, velocity)
            call solve_point(equations, solver_options(integrator=integrator_collocation, tolerance=tolerance), &
                             position, velocity, judge)
            deallocate (position, velocity)
            call solve_point(equations, solver_options(integrator=integrator_newmark, tolerance=tolerance), &
                             position, velocity, newmark)
            if (newmark%status /= status_settled) cycle
            call check(error, newmark%motion, judge%motion, 'class at '//to_text(speed)//' rev/min')
            if (allocated(error)) return
            call check(error, newmark%y1_amplitude, judge%y1_amplitude, 2.0_wp*tolerance*judge%y1_amplitude, &
                       'amplitude at '//to_text(speed)//' rev/min')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_refined_class

   !> At 4880 and 4940 rev/min on a rigid support 1T is unstable by 3e-4 and 5e-4 a period: a run that starts on it leaves it
   !> after more than 8000 periods, for motions more than twice as large. Not to be settled with the amplitude of 1T.
   subroutine test_weakly_unstable(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: from(2) = [4870.0_wp, 4950.0_wp], to(2) = [4880.0_wp, 4940.0_wp]
      integer, parameter :: long = 40000, last = 200
      !> Two hundred periods of a motion that does not repeat.
      real(wp), parameter :: tolerance = 0.02_wp
      type(equations_type) :: equations
      type(response) :: answer, measured
      type(collocation_map) :: map
      type(orbit_type) :: orbit
      type(motion_measure) :: measure
      type(library_error), allocatable :: fault
      real(wp), allocatable :: position(:), velocity(:), state(:)
      integer :: i, k

      do i = 1, size(from)
         if (allocated(position)) deallocate (position, velocity)
         equations = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(from(i)))
         call solve_point(equations, solver_options(integrator=integrator_collocation, tolerance=asked), position, velocity, &
                          answer)
         equations = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(to(i)))
         call map%load(equations, 32, fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
         state = map%to_state(position, velocity)
         call solve_point(equations, solver_options(integrator=integrator_collocation, tolerance=asked), position, velocity, &
                          answer)
         if (answer%status /= status_settled) cycle
         call measure%reset(equations%static_observation)
         do k = 1, long
            if (k <= long - last) then
               call map%advance(state)
            else
               call map%advance(state, orbit=orbit)
               call measure%add(orbit)
            end if
         end do
         measured = empty_response()
         call measure%finish(measured)
         call check(error, answer%y1_amplitude, measured%y1_amplitude, tolerance*measured%y1_amplitude, &
                    'amplitude called settled at '//to_text(to(i))//' rev/min')
         if (allocated(error)) return
      end do
   end subroutine test_weakly_unstable

   !> A motion without a period has no Floquet multiplier: it is not a number, not zero.
   subroutine test_no_multiplier(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)

      call solve_point(new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(4900.0_wp)), &
                       solver_options(integrator=integrator_collocation, tolerance=asked), position, velocity, answer)
      call check(error, answer%motion == motion_quasi_periodic .or. answer%motion == motion_chaotic, 'a motion without a period')
      if (allocated(error)) return
      call check(error, ieee_is_nan(answer%floquet_magnitude), 'no multiplier')
   end subroutine test_no_multiplier

end module test_search
