!> Newmark's method: order, energy, the linear frequency response, tangents, recorded orbits.
module test_newmark
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_options, only: solver_options
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair, gearbox, operating_point
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_newmark

contains

   !> The tests of this suite.
   subroutine collect_newmark(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('order 2 while contact is kept', test_order), &
                  new_unittest('static equilibrium without excitation stays', test_equilibrium), &
                  new_unittest('energy is kept without damping and excitation', test_energy), &
                  new_unittest('gamma above a half takes energy', test_algorithmic_damping), &
                  new_unittest('linear frequency response of the method', test_discrete_response), &
                  new_unittest('linear frequency response to second order', test_response_order), &
                  new_unittest('a map can be loaded again', test_reload), &
                  new_unittest('recorded states are the states', test_record), &
                  new_unittest('recorded accelerations', test_acceleration), &
                  new_unittest('tangents are the derivative of the map', test_tangents), &
                  new_unittest('mesh period and extreme deflections', test_extremes) &
                  ]
   end subroutine collect_newmark

   !> Gears whose teeth stay in contact: a tenth of the transmission error.
   pure function gentle_gears() result(gears)
      !> The gear pair.
      type(gear_pair) :: gears

      gears = reference_gears()
      gears%mesh%error_amplitudes = 1.0e-6_wp
   end function gentle_gears

   !> Gears without damping and excitation on a support without damping.
   pure subroutine undamped(gears, box)
      !> The gear pair.
      type(gear_pair), intent(out) :: gears
      !> The gearbox.
      type(gearbox), intent(out) :: box

      gears = reference_gears()
      gears%bearing_damping = 0.0_wp
      gears%mesh%damping = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      gears%mesh%error_amplitudes = 0.0_wp
      box = reference_box()
      box%damping_ratio = 0.0_wp
   end subroutine undamped

   !> Load a point, failing the test where that fails.
   subroutine load(map, equations, options, error)
      !> Map.
      type(newmark_map), intent(inout) :: map
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Steps and Newmark's parameters.
      type(solver_options), intent(in) :: options
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      map%beta = options%newmark_beta
      map%gamma = options%newmark_gamma
      call map%load(equations, options%steps_per_period, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine load

   !> A state that is nothing special.
   pure function some_state(n, unit) result(state)
      !> Degrees of freedom.
      integer, intent(in) :: n
      !> Size of the first coordinate.
      real(wp), intent(in) :: unit
      !> The state.
      real(wp) :: state(n)

      integer :: i

      state = [(unit*cos(real(i - 1, wp)), i=1, n)]
   end function some_state

   !> The state of a point after some periods.
   subroutine run(equations, options, periods, position, velocity, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Steps and Newmark's parameters.
      type(solver_options), intent(in) :: options
      !> Mesh periods.
      integer, intent(in) :: periods
      !> Deviation and rate: start and end.
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(newmark_map) :: map
      real(wp), allocatable :: state(:)
      integer :: i

      call load(map, equations, options, error)
      if (allocated(error)) return
      state = map%to_state(position, velocity)
      do i = 1, periods
         call map%advance(state)
      end do
      call map%from_state(state, position, velocity)
   end subroutine run

   !> Halving the step divides the error of the state by four, on both supports.
   subroutine test_order(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps(3) = [16384, 512, 1024], periods = 3
      !> The next term of the error adds less than this.
      real(wp), parameter :: tolerance = 0.05_wp
      type(operating_point) :: points(2)
      type(equations_type) :: equations
      real(wp), allocatable :: weight(:), position(:), velocity(:), exact(:), state(:)
      real(wp) :: distance(size(steps))
      integer :: i, k

      points = [rigid_point(1500.0_wp), flexible_point(1500.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         equations = new_equations(gentle_gears(), reference_box(), reference_load(), points(k))
         weight = [spread(equations%frequency, 1, equations%n), spread(1.0_wp, 1, equations%n)]
         do i = 1, size(steps)
            position = spread(0.0_wp, 1, equations%n)
            velocity = position
            call run(equations, solver_options(steps_per_period=steps(i)), periods, position, velocity, error)
            if (allocated(error)) return
            if (i == 1) exact = weight*[position, velocity]
            state = weight*[position, velocity]
            distance(i) = norm2(state - exact)
         end do
         call check(error, log(distance(2)/distance(3))/log(2.0_wp), 2.0_wp, tolerance)
         if (allocated(error)) return
      end do
   end subroutine test_order

   !> Nothing excites, nothing moves: zero deviation stays zero to the last bit.
   subroutine test_equilibrium(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The mean force and that of the teeth cancel but for round-off of 2e3 N on springs of 1e8 N/m [m].
      real(wp), parameter :: tolerance = 1.0e-19_wp
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(equations_type) :: equations
      real(wp), allocatable :: position(:), velocity(:)

      call undamped(gears, box)
      equations = new_equations(gears, box, reference_load(), flexible_point(1500.0_wp, 1.0e3_wp))
      position = spread(0.0_wp, 1, equations%n)
      velocity = position
      call run(equations, solver_options(steps_per_period=64), 20, position, velocity, error)
      if (allocated(error)) return
      call check(error, maxval(abs(position)), 0.0_wp, tolerance)
   end subroutine test_equilibrium

   !> Energy of the deviation, with the teeth in contact under their mean stiffness.
   pure function energy(equations, position, velocity) result(total)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Deviation and its rate.
      real(wp), intent(in) :: position(:), velocity(:)
      !> Kinetic and potential energy.
      real(wp) :: total

      total = 0.5_wp*(dot_product(velocity, matmul(equations%mass, velocity)) + sum(equations%stiffness*position**2) &
                      + equations%mesh%mean_stiffness*dot_product(equations%direction, position)**2)
   end function energy

   !> The average acceleration keeps the energy of a linear system, also over a thousand periods.
   subroutine test_energy(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: periods = 1000
      !> A random walk of 3e4 roundings stays below 1e-13, an even drift below 1e-11.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(operating_point) :: points(3)
      type(equations_type) :: equations
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: before
      integer :: k

      call undamped(gears, box)
      points = [rigid_point(1500.0_wp), flexible_point(1500.0_wp, 1.0e3_wp), flexible_point(4000.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         equations = new_equations(gears, box, reference_load(), points(k))
         position = some_state(equations%n, 2.0e-7_wp)
         velocity = some_state(equations%n, 1.0e-3_wp)
         before = energy(equations, position, velocity)
         call run(equations, solver_options(steps_per_period=32), periods, position, velocity, error)
         if (allocated(error)) return
         call check(error, energy(equations, position, velocity), before, tolerance, relative=.true.)
         if (allocated(error)) return
      end do
   end subroutine test_energy

   !> With gamma > 1/2 the fast modes die out; beta is then large enough for stability.
   subroutine test_algorithmic_damping(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(gearbox) :: box
      type(equations_type) :: equations
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: before, after
      integer :: k

      call undamped(gears, box)
      equations = new_equations(gears, box, reference_load(), flexible_point(1500.0_wp, 2.5e8_wp))
      position = some_state(equations%n, 2.0e-7_wp)
      velocity = some_state(equations%n, 1.0e-3_wp)
      before = energy(equations, position, velocity)
      do k = 1, 5
         call run(equations, solver_options(steps_per_period=32, newmark_beta=0.3025_wp, newmark_gamma=0.6_wp), 4, &
                        position, velocity, error)
         if (allocated(error)) return
         after = energy(equations, position, velocity)
         call check(error, after < before, 'less energy')
         if (allocated(error)) return
         before = after
      end do
   end subroutine test_algorithmic_damping

   !> Steady response of the linear system, b = 0 and k_m1 = 0, to the transmission error e_1 sin(w t).
   !>
   !> The average acceleration is the trapezoidal rule: at frequency w it acts as the continuous system at
   !> (2/dt) tan(w dt/2), driven by the exact rate of the transmission error.
   function linear_response(equations, frequency) result(response)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Frequency at which the system acts.
      real(wp), intent(in) :: frequency
      !> Complex amplitude of the deviation, whose imaginary part is that at phase 0.
      complex(wp) :: response(equations%n)

      complex(wp), parameter :: im = (0.0_wp, 1.0_wp)
      complex(wp) :: dynamic(equations%n, equations%n)
      integer :: i, j, n

      n = equations%n
      associate (g => equations%direction, k => equations%mesh%mean_stiffness, c => equations%mesh%damping)
         do j = 1, n
            do i = 1, n
               dynamic(i, j) = -frequency**2*equations%mass(i, j) + (k + im*frequency*c)*g(i)*g(j)
            end do
            dynamic(j, j) = dynamic(j, j) + equations%stiffness(j) + im*frequency*equations%damping(j)
         end do
         response = solve(dynamic, -g*(k + im*equations%frequency*c)*equations%mesh%error_amplitudes(1))
      end associate
   end function linear_response

   !> Steady state of the linear system after many periods, as a complex amplitude.
   subroutine settled_response(point, steps, equations, response, error)
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Steps per period.
      integer, intent(in) :: steps
      !> Equations of motion.
      type(equations_type), intent(out) :: equations
      !> Complex amplitude.
      complex(wp), allocatable, intent(out) :: response(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The slowest mode loses a tenth a period: 1e-14 is left.
      integer, parameter :: periods = 300
      type(gear_pair) :: gears
      real(wp), allocatable :: position(:), velocity(:)

      gears = reference_gears()
      gears%mesh%half_backlash = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      equations = new_equations(gears, reference_box(), reference_load(), point)
      position = spread(0.0_wp, 1, equations%n)
      velocity = position
      call run(equations, solver_options(steps_per_period=steps), periods, position, velocity, error)
      associate (rate => tan(pi/real(steps, wp))*equations%frequency*real(steps, wp)/pi)
         response = cmplx(velocity/rate, position, wp)
      end associate
   end subroutine settled_response

   !> The steady state is that of the method in closed form, to round-off.
   subroutine test_discrete_response(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Conditioning of the dynamic stiffness near resonance, and what is left of the transient.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      integer, parameter :: steps = 32
      type(operating_point) :: points(4)
      type(equations_type) :: equations
      complex(wp), allocatable :: response(:), expected(:)
      real(wp) :: frequency
      integer :: k

      points = [rigid_point(1500.0_wp), rigid_point(900.0_wp), flexible_point(1500.0_wp, 2.5e8_wp), &
                flexible_point(480.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         call settled_response(points(k), steps, equations, response, error)
         if (allocated(error)) return
         frequency = equations%frequency*real(steps, wp)/pi*tan(pi/real(steps, wp))
         expected = linear_response(equations, frequency)
         call check(error, maxval(abs(response - expected)), 0.0_wp, tolerance*maxval(abs(expected)))
         if (allocated(error)) return
      end do
   end subroutine test_discrete_response

   !> The amplitude of y1 converges to that of the continuous system with the square of the step.
   subroutine test_response_order(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The next term of the error adds less than this to the order.
      real(wp), parameter :: tolerance = 0.05_wp
      !> Error at the finer step, relative: a twelfth of (2 pi/steps)^2, times the slope of the resonance curve.
      real(wp), parameter :: largest = 1.0e-3_wp
      integer, parameter :: steps(2) = [128, 256]
      type(operating_point) :: points(2)
      type(equations_type) :: equations
      complex(wp), allocatable :: response(:)
      real(wp) :: exact, difference(2)
      integer :: i, k

      points = [rigid_point(1500.0_wp), flexible_point(1500.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         do i = 1, 2
            call settled_response(points(k), steps(i), equations, response, error)
            if (allocated(error)) return
            exact = abs(sum(equations%observation(1, :)*linear_response(equations, equations%frequency)))
            difference(i) = abs(sum(equations%observation(1, :)*response))/exact - 1.0_wp
         end do
         call check(error, abs(difference(2)) <= largest, 'error')
         if (allocated(error)) return
         call check(error, log(difference(1)/difference(2))/log(2.0_wp), 2.0_wp, tolerance, 'order')
         if (allocated(error)) return
      end do
   end subroutine test_response_order

   !> A map that is loaded anew holds nothing of its former point, whatever its support and steps.
   subroutine test_reload(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: periods = 5
      type(newmark_map) :: used, fresh
      type(equations_type) :: equations
      real(wp), allocatable :: state(:), expected(:)
      integer :: i

      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(2600.0_wp, 1.0e5_wp))
      call load(used, equations, solver_options(steps_per_period=32), error)
      if (allocated(error)) return
      state = used%to_state(some_state(equations%n, 1.0e-6_wp), some_state(equations%n, 1.0e-3_wp))
      call used%advance(state)
      equations = new_equations(gentle_gears(), reference_box(), reference_load(), rigid_point(900.0_wp))
      call load(used, equations, solver_options(steps_per_period=64), error)
      if (allocated(error)) return
      call load(fresh, equations, solver_options(steps_per_period=64), error)
      if (allocated(error)) return
      state = used%to_state(some_state(equations%n, 1.0e-6_wp), some_state(equations%n, 1.0e-3_wp))
      expected = fresh%to_state(some_state(equations%n, 1.0e-6_wp), some_state(equations%n, 1.0e-3_wp))
      do i = 1, periods
         call used%advance(state)
         call fresh%advance(expected)
      end do
      call check(error, size(state), size(expected), 'size')
      if (allocated(error)) return
      call check(error, all(abs(state - expected) <= 0.0_wp), 'state')
   end subroutine test_reload

   !> Recording and tangents change no bit of the motion; the ends of the record are the states at the sections.
   subroutine test_record(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Another order of the sums, relative to the largest term.
      real(wp), parameter :: roundoff = 1.0e-14_wp
      type(newmark_map) :: map
      type(equations_type) :: equations
      type(orbit_type) :: orbit
      real(wp), allocatable :: state(:), plain(:), tangents(:, :), position(:), velocity(:), value(:), rate(:)
      integer :: i, k

      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(2600.0_wp, 1.0e8_wp))
      call load(map, equations, solver_options(steps_per_period=64), error)
      if (allocated(error)) return
      state = map%to_state(some_state(equations%n, 1.0e-6_wp), some_state(equations%n, 1.0e-3_wp))
      plain = state
      allocate (tangents(2, map%size), source=1.0_wp)
      do i = 1, 5
         do k = 0, 1
            call map%from_state(state, position, velocity)
            value = matmul(equations%observation, position)
            rate = matmul(equations%observation, velocity)
            if (k == 0) call map%advance(state, tangents, orbit)
            associate (s => k*orbit%samples)
               call check(error, maxval(abs(orbit%value(:, s) - value)), 0.0_wp, roundoff*maxval(abs(value)), 'value')
               if (allocated(error)) return
               call check(error, maxval(abs(orbit%rate(:, s) - rate)), 0.0_wp, roundoff*maxval(abs(rate)), 'rate')
               if (allocated(error)) return
               call check(error, orbit%time(s), real(k, wp)*map%period, roundoff*map%period, 'time')
               if (allocated(error)) return
            end associate
         end do
         call check(error, sum(orbit%weight(:orbit%samples)), 1.0_wp, roundoff, 'sum of the weights')
         if (allocated(error)) return
         call map%advance(plain)
         call check(error, all(abs(plain - state) <= 0.0_wp), 'same bits')
         if (allocated(error)) return
      end do
   end subroutine test_record

   !> Recorded accelerations are the derivatives of the recorded rates: central differences agree to second order.
   subroutine test_acceleration(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 2048
      !> A sixth of the step squared times the third derivative, which vibrates with 3e4 1/s: (3e4 h)^2/6, doubled.
      real(wp), parameter :: tolerance = 2.0e-4_wp
      type(newmark_map) :: map
      type(equations_type) :: equations
      type(orbit_type) :: orbit
      real(wp), allocatable :: state(:)
      real(wp) :: difference, scale
      integer :: k, s

      equations = new_equations(gentle_gears(), reference_box(), reference_load(), flexible_point(1500.0_wp, 1.0e8_wp))
      call load(map, equations, solver_options(steps_per_period=steps), error)
      if (allocated(error)) return
      state = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
      call map%advance(state)
      call map%advance(state, orbit=orbit)
      do k = 1, size(orbit%value, 1)
         scale = maxval(abs(orbit%acceleration(k, :steps)))
         do s = 1, steps - 1
            difference = (orbit%rate(k, s + 1) - orbit%rate(k, s - 1))/(orbit%time(s + 1) - orbit%time(s - 1))
            call check(error, orbit%acceleration(k, s), difference, tolerance*scale)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_acceleration

   !> Tangents are the derivative of the map: differences of maps from neighbouring states, with contact lost.
   subroutine test_tangents(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The map is affine as long as no step changes its branch: round-off of the difference is all there is.
      real(wp), parameter :: step = 1.0e-12_wp, tolerance = 1.0e-6_wp
      type(newmark_map) :: map
      type(equations_type) :: equations
      real(wp), allocatable :: start(:), state(:), up(:), down(:), tangents(:, :), scale(:)
      integer :: i

      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(2600.0_wp, 1.0e8_wp))
      call load(map, equations, solver_options(steps_per_period=64), error)
      if (allocated(error)) return
      ! Displacements in metres, rates in their size at the mesh frequency.
      scale = [spread(1.0_wp, 1, equations%n), spread(equations%frequency, 1, equations%n)]
      start = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
      do i = 1, 10
         call map%advance(start)
      end do
      state = start
      allocate (tangents(map%size, map%size), source=0.0_wp)
      do i = 1, map%size
         tangents(i, i) = scale(i)
      end do
      call map%advance(state, tangents)
      call check(error, map%smallest_deflection < map%half_backlash, 'contact is lost')
      if (allocated(error)) return
      do i = 1, map%size
         up = start
         up(i) = up(i) + step*scale(i)
         down = start
         down(i) = down(i) - step*scale(i)
         call map%advance(up)
         call map%advance(down)
         call check(error, maxval(abs(tangents(i, :) - (up - down)/(2.0_wp*step))/scale), 0.0_wp, &
                    tolerance*max(1.0_wp, maxval(abs(tangents(i, :))/scale)))
         if (allocated(error)) return
      end do
   end subroutine test_tangents

   !> A linear system in its steady state: the extremes of delta are its mean plus and minus its amplitude.
   subroutine test_extremes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 1024, periods = 300
      !> The extreme lies at most half a step from a sample: (pi/steps)^2/2 of the amplitude.
      real(wp), parameter :: sampling = 0.5_wp*(pi/real(steps, wp))**2
      !> Error of the method at this step.
      real(wp), parameter :: method = 1.0e-4_wp
      type(gear_pair) :: gears
      type(equations_type) :: equations
      type(newmark_map) :: map
      real(wp), allocatable :: state(:)
      real(wp) :: amplitude
      integer :: i

      gears = reference_gears()
      gears%mesh%half_backlash = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      equations = new_equations(gears, reference_box(), reference_load(), rigid_point(1500.0_wp))
      call load(map, equations, solver_options(steps_per_period=steps), error)
      if (allocated(error)) return
      state = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
      do i = 1, periods
         call map%advance(state)
      end do
      call check(error, map%period, 60.0_wp/(55.0_wp*1500.0_wp), epsilon(1.0_wp), 'period')
      if (allocated(error)) return
      amplitude = abs(sum(equations%direction*linear_response(equations, equations%frequency)) &
                      + gears%mesh%error_amplitudes(1))
      call check(error, map%largest_deflection, equations%static_deflection + amplitude, (sampling + method)*amplitude, &
                 'largest')
      if (allocated(error)) return
      call check(error, map%smallest_deflection, equations%static_deflection - amplitude, (sampling + method)*amplitude, &
                 'smallest')
   end subroutine test_extremes

end module test_newmark
