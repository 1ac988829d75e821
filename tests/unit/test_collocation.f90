!> Exponential collocation: order, the linear frequency response, crossings of the contact borders, tangents.
module test_collocation
   use cases, only: balanced_load, flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use pseudo_random, only: random_stream
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, i8
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_period_map, only: orbit_type, period_map
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair, operating_point
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_collocation

contains

   !> The tests of this suite.
   subroutine collect_collocation(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('coordinates to modes and back', test_coordinates), &
                  new_unittest('linear frequency response to round-off', test_response), &
                  new_unittest('order 8 while contact is kept', test_order), &
                  new_unittest('crossings are located', test_crossings), &
                  new_unittest('the limit of Newmark''s method', test_newmark_limit), &
                  new_unittest('mirrored torques give the mirrored motion', test_mirror), &
                  new_unittest('tangents are the derivative of the map', test_tangents), &
                  new_unittest('a map can be loaded again', test_reload), &
                  new_unittest('recorded states, times and weights', test_record), &
                  new_unittest('recorded accelerations', test_acceleration) &
                  ]
   end subroutine collect_collocation

   !> Gears whose teeth stay in contact: a tenth of the transmission error.
   pure function gentle_gears() result(gears)
      !> The gear pair.
      type(gear_pair) :: gears

      gears = reference_gears()
      gears%mesh%error_amplitudes = 1.0e-6_wp
   end function gentle_gears

   !> Points on both supports, the softest and the stiffest included.
   pure function some_points(speed) result(points)
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> The points.
      type(operating_point) :: points(4)

      points = [rigid_point(speed), flexible_point(speed, 1.0e3_wp), flexible_point(speed, 2.5e8_wp), &
                flexible_point(speed, 1.0e12_wp)]
   end function some_points

   !> Load a point, failing the test where that fails.
   subroutine load(map, equations, steps, error)
      !> Map.
      class(period_map), intent(inout) :: map
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      call map%load(equations, steps, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine load

   !> Gears that part, and with little backlash strike on both flanks, at 2600 rev/min.
   pure function rough_gears(half_backlash) result(gears)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> The gear pair.
      type(gear_pair) :: gears

      gears = reference_gears()
      gears%mesh%error_amplitudes = 3.0e-5_wp
      gears%mesh%half_backlash = half_backlash
   end function rough_gears

   !> Coordinates, weighted to metres, after some periods from the static equilibrium.
   subroutine run(map, equations, steps, periods, final, error)
      !> Map.
      class(period_map), intent(inout) :: map
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Mesh periods.
      integer, intent(in) :: periods
      !> Deviation, then its rate over the mesh frequency, shape (2 n) [m].
      real(wp), allocatable, intent(out) :: final(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: state(:), position(:), velocity(:)
      integer :: i

      call load(map, equations, steps, error)
      if (allocated(error)) return
      state = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
      do i = 1, periods
         call map%advance(state)
      end do
      call map%from_state(state, position, velocity)
      final = [position, velocity/equations%frequency]
   end subroutine run

   !> What the mesh drives comes back from the modes: states of the motion itself.
   subroutine test_coordinates(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Condition of the eigenvectors times round-off, relative.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(collocation_map) :: map
      type(equations_type) :: equations
      type(operating_point) :: points(4)
      real(wp), allocatable :: state(:), again(:), position(:), velocity(:)
      integer :: i, k

      points = some_points(2600.0_wp)
      do k = 1, size(points)
         equations = new_equations(reference_gears(), reference_box(), reference_load(), points(k))
         call load(map, equations, 16, error)
         if (allocated(error)) return
         state = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
         do i = 1, 5
            call map%advance(state)
         end do
         call map%from_state(state, position, velocity)
         again = map%to_state(position, velocity)
         call check(error, maxval(abs(again - state)), 0.0_wp, tolerance*maxval(abs(state)))
         if (allocated(error)) return
      end do
   end subroutine test_coordinates

   !> b = 0 and k_m1 = 0: the steady state is that of the dynamic stiffness, with no error of the step.
   subroutine test_response(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      complex(wp), parameter :: im = (0.0_wp, 1.0_wp)
      !> The slowest mode loses a tenth a period: 1e-14 is left after this many.
      integer, parameter :: periods = 300
      !> Conditioning of the dynamic stiffness; the steps are so small that the polynomial is a sine to round-off.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(collocation_map) :: map
      type(gear_pair) :: gears
      type(equations_type) :: equations
      type(operating_point) :: points(4)
      complex(wp), allocatable :: dynamic(:, :), expected(:)
      real(wp), allocatable :: final(:)
      integer :: i, j, k, n

      gears = reference_gears()
      gears%mesh%half_backlash = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      points = [rigid_point(1500.0_wp), rigid_point(900.0_wp), flexible_point(1500.0_wp, 2.5e8_wp), &
                flexible_point(480.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         equations = new_equations(gears, reference_box(), reference_load(), points(k))
         n = equations%n
         call run(map, equations, 64, periods, final, error)
         if (allocated(error)) return
         if (allocated(dynamic)) deallocate (dynamic)
         allocate (dynamic(n, n))
         associate (w => equations%frequency, g => equations%direction, stiffness => gears%mesh%mean_stiffness, &
                    c => gears%mesh%damping)
            do j = 1, n
               do i = 1, n
                  dynamic(i, j) = -w**2*equations%mass(i, j) + (stiffness + im*w*c)*g(i)*g(j)
               end do
               dynamic(j, j) = dynamic(j, j) + equations%stiffness(j) + im*w*equations%damping(j)
            end do
            expected = solve(dynamic, -g*(stiffness + im*w*c)*gears%mesh%error_amplitudes(1))
         end associate
         ! At phase 0 a sine of complex amplitude a stands at Im a and moves with w Re a.
         call check(error, maxval(abs(cmplx(final(n + 1:), final(:n), wp) - expected)), 0.0_wp, &
                    tolerance*maxval(abs(expected)))
         if (allocated(error)) return
      end do
   end subroutine test_response

   !> Halving the step divides the error by 256.
   subroutine test_order(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps(3) = [256, 16, 32], periods = 3
      !> The next terms of the error at so few steps.
      real(wp), parameter :: tolerance = 0.25_wp
      type(collocation_map) :: map
      type(equations_type) :: equations
      type(operating_point) :: points(2)
      real(wp), allocatable :: exact(:), final(:)
      real(wp) :: distance(size(steps))
      integer :: i, k

      points = [rigid_point(900.0_wp), flexible_point(900.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         equations = new_equations(gentle_gears(), reference_box(), reference_load(), points(k))
         do i = 1, size(steps)
            call run(map, equations, steps(i), periods, final, error)
            if (allocated(error)) return
            if (i == 1) exact = final
            distance(i) = norm2(final - exact)
         end do
         call check(error, map%smallest_deflection >= map%half_backlash, 'contact is kept')
         if (allocated(error)) return
         call check(error, log(distance(2)/distance(3))/log(2.0_wp), 8.0_wp, tolerance, 'order')
         if (allocated(error)) return
      end do
   end subroutine test_order

   !> Where contact is lost, and where both flanks are struck, the step hardly matters: no crossing is smeared.
   subroutine test_crossings(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: periods = 3
      !> Relative to the motion; measured 1.2e-9 and, by order eight, 5e-11.
      real(wp), parameter :: tolerance(2) = [1.0e-8_wp, 5.0e-10_wp]
      integer, parameter :: steps(2) = [16, 24]
      type(collocation_map) :: map
      type(gear_pair) :: gears
      type(equations_type) :: equations
      type(operating_point) :: points(4)
      real(wp), allocatable :: exact(:), final(:)
      integer :: i, k, flanks

      points = some_points(2600.0_wp)
      do flanks = 1, 2
         gears = rough_gears(merge(1.0e-5_wp, 1.0e-6_wp, flanks == 1))
         do k = 1, size(points)
            equations = new_equations(gears, reference_box(), reference_load(), points(k))
            call run(map, equations, 160, periods, exact, error)
            if (allocated(error)) return
            call check(error, map%smallest_deflection < map%half_backlash, 'the teeth part')
            if (allocated(error)) return
            if (flanks == 2) call check(error, map%smallest_deflection < -map%half_backlash, 'and strike on the back flank')
            if (allocated(error)) return
            do i = 1, size(steps)
               call run(map, equations, steps(i), periods, final, error)
               if (allocated(error)) return
               call check(error, norm2(final - exact), 0.0_wp, tolerance(i)*norm2(exact))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_crossings

   !> Newmark's method comes to the same motion as its step goes to zero, with contact lost, on every support.
   subroutine test_newmark_limit(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps(2) = [2048, 8192], periods = 2
      !> Second order: a phase error of (w h)^2/12 a radian of the fast vibration, over 30 radians, at the finer step.
      real(wp), parameter :: tolerance = 2.0e-5_wp
      !> At least so much nearer for a quarter of the step; 16 but for the steps in which contact changes.
      real(wp), parameter :: nearer = 8.0_wp
      type(collocation_map) :: map
      type(newmark_map) :: newmark
      type(equations_type) :: equations
      type(operating_point) :: points(4)
      real(wp), allocatable :: exact(:), final(:)
      real(wp) :: distance(2)
      integer :: i, k

      points = some_points(2600.0_wp)
      do k = 1, size(points)
         equations = new_equations(rough_gears(1.0e-5_wp), reference_box(), reference_load(), points(k))
         call run(map, equations, 64, periods, exact, error)
         if (allocated(error)) return
         do i = 1, size(steps)
            call run(newmark, equations, steps(i), periods, final, error)
            if (allocated(error)) return
            distance(i) = norm2(final - exact)/norm2(exact)
         end do
         call check(error, distance(2), 0.0_wp, tolerance, 'distance')
         if (allocated(error)) return
         call check(error, distance(1) >= nearer*distance(2), 'nearer with smaller steps')
         if (allocated(error)) return
      end do
   end subroutine test_newmark_limit

   !> Torques and transmission error of the other sign give the mirrored motion, by both methods.
   subroutine test_mirror(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Places of crossings and sums may round differently, relative.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(collocation_map) :: map
      type(newmark_map) :: newmark
      type(gear_pair) :: gears, mirrored
      type(equations_type) :: front, back
      real(wp), allocatable :: final(:), other(:)
      integer :: method

      gears = reference_gears()
      mirrored = gears
      mirrored%mesh%error_amplitudes = -gears%mesh%error_amplitudes
      front = new_equations(gears, reference_box(), balanced_load(gears, 110.0_wp), flexible_point(2600.0_wp, 1.0e7_wp))
      back = new_equations(mirrored, reference_box(), balanced_load(gears, -110.0_wp), flexible_point(2600.0_wp, 1.0e7_wp))
      do method = 1, 2
         if (method == 1) then
            call run(map, front, 16, 4, final, error)
            if (allocated(error)) return
            call run(map, back, 16, 4, other, error)
         else
            call run(newmark, front, 128, 4, final, error)
            if (allocated(error)) return
            call run(newmark, back, 128, 4, other, error)
         end if
         if (allocated(error)) return
         call check(error, norm2(final + other), 0.0_wp, tolerance*norm2(final))
         if (allocated(error)) return
      end do
   end subroutine test_mirror

   !> Tangents equal differences of maps from neighbouring states, with contact lost.
   subroutine test_tangents(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Modes are metres of mesh deflection; the second derivative comes from the moving crossings alone.
      real(wp), parameter :: step = 1.0e-10_wp, tolerance = 1.0e-4_wp
      type(collocation_map) :: map
      type(equations_type) :: equations
      type(operating_point) :: points(3)
      real(wp), allocatable :: start(:), state(:), up(:), down(:), tangents(:, :)
      integer :: i, k

      points = [rigid_point(2600.0_wp), flexible_point(2600.0_wp, 1.0e5_wp), flexible_point(2600.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         equations = new_equations(rough_gears(1.0e-5_wp), reference_box(), reference_load(), points(k))
         call load(map, equations, 16, error)
         if (allocated(error)) return
         start = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
         do i = 1, 5
            call map%advance(start)
         end do
         state = start
         if (allocated(tangents)) deallocate (tangents)
         allocate (tangents(map%size, map%size), source=0.0_wp)
         do i = 1, map%size
            tangents(i, i) = 1.0_wp
         end do
         call map%advance(state, tangents)
         call check(error, map%smallest_deflection < map%half_backlash, 'the teeth part')
         if (allocated(error)) return
         do i = 1, map%size
            up = start
            up(i) = up(i) + step
            down = start
            down(i) = down(i) - step
            call map%advance(up)
            call map%advance(down)
            call check(error, maxval(abs(tangents(i, :) - (up - down)/(2.0_wp*step))), 0.0_wp, &
                       tolerance*max(1.0_wp, maxval(abs(tangents(i, :)))))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_tangents

   !> A map that is loaded anew holds nothing of its former point, whatever its support, speed and steps.
   subroutine test_reload(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(collocation_map) :: used, fresh
      type(equations_type) :: equations
      type(operating_point) :: point
      type(random_stream) :: random
      real(wp), allocatable :: final(:), expected(:)
      real(wp) :: speed, exponent
      integer :: i, steps

      random = random_stream(29_i8)
      do i = 1, 30
         call random%uniform(500.0_wp, 5000.0_wp, speed)
         call random%uniform(3.0_wp, 12.0_wp, exponent)
         call random%pick(12, 24, steps)
         ! The same support again at every third point, for the modes are kept then.
         if (mod(i, 3) /= 0) point = flexible_point(speed, 10.0_wp**exponent)
         if (mod(i, 7) == 0) point = rigid_point(speed)
         point%speed = speed
         equations = new_equations(reference_gears(), reference_box(), reference_load(), point)
         call run(used, equations, steps, 2, final, error)
         if (allocated(error)) return
         block
            type(collocation_map) :: empty
            fresh = empty
         end block
         call run(fresh, equations, steps, 2, expected, error)
         if (allocated(error)) return
         call check(error, size(final), size(expected), 'size')
         if (allocated(error)) return
         call check(error, all(abs(final - expected) <= 0.0_wp), 'state')
         if (allocated(error)) return
      end do
   end subroutine test_reload

   !> Recording changes no bit; its ends are the sections; its weights integrate polynomials in time.
   subroutine test_record(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Sums of some hundred terms, relative to the largest.
      real(wp), parameter :: roundoff = 1.0e-12_wp
      !> What the eigenvectors leave of it, as in the test of the coordinates.
      real(wp), parameter :: modes = 1.0e-10_wp
      type(collocation_map) :: map
      type(equations_type) :: equations
      type(orbit_type) :: orbit
      real(wp), allocatable :: state(:), plain(:), position(:), velocity(:), value(:), rate(:)
      integer :: i, k, power

      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(2600.0_wp, 2.5e8_wp))
      call load(map, equations, 16, error)
      if (allocated(error)) return
      state = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
      plain = state
      do i = 1, 5
         do k = 0, 1
            call map%from_state(state, position, velocity)
            value = matmul(equations%observation, position)
            rate = matmul(equations%observation, velocity)
            if (k == 0) call map%advance(state, orbit=orbit)
            associate (s => k*orbit%samples)
               call check(error, maxval(abs(orbit%value(:, s) - value)), 0.0_wp, modes*1.0e-5_wp, 'value')
               if (allocated(error)) return
               call check(error, maxval(abs(orbit%rate(:, s) - rate)), 0.0_wp, modes*1.0e-5_wp*3.0e4_wp, 'rate')
               if (allocated(error)) return
               call check(error, orbit%time(s), real(k, wp)*map%period, roundoff*map%period, 'time')
               if (allocated(error)) return
            end associate
         end do
         associate (n => orbit%samples)
            call check(error, all(orbit%time(1:n) >= orbit%time(0:n - 1)), 'times in order')
            if (allocated(error)) return
            do power = 0, 5
               call check(error, sum(orbit%weight(:n)*(orbit%time(:n)/map%period)**power), 1.0_wp/real(power + 1, wp), &
                          roundoff, 'mean of a power of time')
               if (allocated(error)) return
            end do
         end associate
         call map%advance(plain)
         call check(error, all(abs(plain - state) <= 0.0_wp), 'same bits')
         if (allocated(error)) return
      end do
   end subroutine test_record

   !> Values, rates and accelerations fit together: over each interval the polynomials from its two ends meet.
   subroutine test_acceleration(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Two Taylor polynomials to second order that meet in the middle of h/5 of a step: (w h/10)^3/6 with w h = 1/4 at
      !> 256 steps, doubled, relative to the largest value.
      real(wp), parameter :: tolerance = 2.0e-5_wp
      type(collocation_map) :: map
      type(equations_type) :: equations
      type(orbit_type) :: orbit
      real(wp), allocatable :: state(:)
      real(wp) :: half, left, right
      integer :: i, k, s

      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(2600.0_wp, 2.5e8_wp))
      call load(map, equations, 256, error)
      if (allocated(error)) return
      state = map%to_state(spread(0.0_wp, 1, equations%n), spread(0.0_wp, 1, equations%n))
      do i = 1, 3
         call map%advance(state, orbit=orbit)
      end do
      do s = 1, orbit%samples
         half = 0.5_wp*(orbit%time(s) - orbit%time(s - 1))
         do k = 1, size(orbit%value, 1)
            left = orbit%value(k, s - 1) + half*orbit%rate(k, s - 1) + 0.5_wp*half**2*orbit%acceleration(k, s - 1)
            right = orbit%value(k, s) - half*orbit%rate(k, s) + 0.5_wp*half**2*orbit%acceleration(k, s)
            call check(error, left, right, tolerance*maxval(abs(orbit%value(k, :orbit%samples))))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_acceleration

end module test_collocation
