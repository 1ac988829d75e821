!> Points side by side in lanes: against collocation of order eight, their tangents and recorded periods, and that no seat knows
!> its neighbours.
module test_lanes
   use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use floating, only: run_untrapped, same_bits
   use pseudo_random, only: random_stream
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_lane_ensemble, only: lane_ensemble, narrow, widen
   use spurflex_integrate_lane_observe, only: lane_view, new_point_view, observe, seat_view
   use spurflex_integrate_lane_rule, only: lanes
   use spurflex_integrate_options, only: integrator_collocation, integrator_newmark, solver_options
   use spurflex_integrate_period_map, only: observables, orbit_type, reserve_orbit
   use spurflex_measure_lane_amplitude, only: lane_amplitude
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_points, only: new_solver, respond, respond_one, solver_type
   use spurflex_measure_response, only: contact_both_flanks, contact_kept, contact_lost, contact_of, response
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_mesh, only: transmission_error
   use spurflex_model_modal, only: from_modes, modal_system, new_modal_system
   use spurflex_model_parameters, only: gear_pair, gearbox
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_lanes

   !> What differs between the tests that compare with collocation: three kinds of contact, no backlash and hardly any.
   integer, parameter :: regimes = 5
   character(len=*), parameter :: regime_names(regimes) = [character(len=18) :: 'contact kept', 'contact lost', 'both flanks', &
                                                           'no backlash', 'hardly any']
   integer, parameter :: kept = 1, lost = 2, both = 3, none = 4, tiny_gap = 5

   !> Support stiffnesses of the points, one in each lane; the first, 0, is the rigid support [N/m].
   real(wp), parameter :: supports(lanes) = [0.0_wp, 1.0e3_wp, 1.0e5_wp, 1.0e7_wp, 2.5e8_wp, 1.0e9_wp, 1.0e10_wp, 1.0e12_wp]

contains

   !> The tests of this suite.
   subroutine collect_lanes(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('order 4 towards collocation, contact kept', test_order_kept), &
                  new_unittest('order 4 towards collocation, contact lost', test_order_lost), &
                  new_unittest('order 4 towards collocation, both flanks', test_order_both), &
                  new_unittest('order 4 towards collocation, no backlash', test_order_none), &
                  new_unittest('order 4 towards collocation, both borders in one step', test_order_tiny), &
                  new_unittest('extremes of the mesh deflection', test_extremes), &
                  new_unittest('tangents are the derivative of the map', test_tangents), &
                  new_unittest('tangents as by collocation', test_tangents_limit), &
                  new_unittest('tangents one by one and together', test_tangent_count), &
                  new_unittest('recorded displacements against the recorded modes', test_record), &
                  new_unittest('recorded periods as by collocation', test_record_limit), &
                  new_unittest('extremes of all lanes as of one motion', test_amplitudes), &
                  new_unittest('recording and tangents change no bit', test_passengers), &
                  new_unittest('no bit depends on the seat', test_seats), &
                  new_unittest('no bit depends on the neighbours', test_neighbours), &
                  new_unittest('no bit depends on neighbours that are not finite', test_broken_neighbours), &
                  new_unittest('no bit depends on room for more modes', test_room), &
                  new_unittest('no bit of a response depends on its list', test_lists), &
                  new_unittest('no bit of a multiplier depends on its list', test_multipliers), &
                  new_unittest('no bit of a multiplier depends on room for more modes', test_multipliers_room), &
                  new_unittest('nor on the order or the company of refined points', test_refined_lists), &
                  new_unittest('nor with Newmark''s method', test_newmark_lists) &
                  ]
   end subroutine collect_lanes

   !> Gears of a regime.
   pure function regime_gears(regime) result(gears)
      !> Regime.
      integer, intent(in) :: regime
      !> The gear pair.
      type(gear_pair) :: gears

      gears = reference_gears()
      if (regime >= both) gears%mesh%error_amplitudes = 3.0e-5_wp
      select case (regime)
      case (lost)
         gears%mesh%half_backlash = 1.0e-4_wp
      case (both)
         gears%mesh%half_backlash = 1.0e-6_wp
      case (none)
         gears%mesh%half_backlash = 0.0_wp
      case (tiny_gap)
         gears%mesh%half_backlash = 1.0e-9_wp
      end select
   end function regime_gears

   !> Speed of a regime [rev/min].
   pure function regime_speed(regime) result(speed)
      !> Regime.
      integer, intent(in) :: regime
      !> The speed.
      real(wp) :: speed

      real(wp), parameter :: all_speeds(regimes) = [900.0_wp, 3500.0_wp, 2600.0_wp, 2600.0_wp, 2600.0_wp]

      speed = all_speeds(regime)
   end function regime_speed

   !> Equations of motion and modes of a regime on every support.
   subroutine make_points(regime, equations, modal, error)
      !> Regime.
      integer, intent(in) :: regime
      !> The points.
      type(equations_type), intent(out) :: equations(lanes)
      type(modal_system), intent(out) :: modal(lanes)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer :: k

      do k = 1, lanes
         if (supports(k) > 0.0_wp) then
            equations(k) = new_equations(regime_gears(regime), reference_box(), reference_load(), &
                                         flexible_point(regime_speed(regime), supports(k)))
         else
            equations(k) = new_equations(regime_gears(regime), reference_box(), reference_load(), &
                                         rigid_point(regime_speed(regime)))
         end if
         call find_modes(equations(k), modal(k), error)
         if (allocated(error)) return
      end do
   end subroutine make_points

   !> Modes of a point, failing the test where there are none.
   subroutine find_modes(equations, modal, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The modes.
      type(modal_system), intent(out) :: modal
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      call new_modal_system(equations, modal, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine find_modes

   !> Load a map, failing the test where that fails.
   subroutine load(map, equations, steps, error)
      !> Map.
      type(collocation_map), intent(inout) :: map
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

   !> Give points to lanes, each to the lane of its number; the order of the points is theirs.
   subroutine fill_seats(equations, modal, steps, points)
      !> The points.
      type(equations_type), intent(in) :: equations(:)
      type(modal_system), intent(in) :: modal(:)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The lanes.
      type(lane_ensemble), intent(inout) :: points

      integer :: k

      call points%load(equations, modal, [(k, k=1, size(equations))], steps)
      do k = 1, min(lanes, size(equations))
         call points%seat(k, k)
      end do
   end subroutine fill_seats

   !> States of a motion from the static equilibrium, by collocation.
   subroutine settle(equations, periods, states, error)
      !> The points.
      type(equations_type), intent(in) :: equations(:)
      !> Mesh periods.
      integer, intent(in) :: periods
      !> States with room for as many modes as the widest of them has, shape (points, size).
      real(wp), allocatable, intent(out) :: states(:, :)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 32
      type(collocation_map) :: maps(size(equations))
      real(wp), allocatable :: state(:)
      integer :: k, i

      do k = 1, size(equations)
         call load(maps(k), equations(k), steps, error)
         if (allocated(error)) return
      end do
      allocate (states(size(equations), maxval(maps%size)), source=0.0_wp)
      do k = 1, size(equations)
         state = spread(0.0_wp, 1, maps(k)%size)
         do i = 1, periods
            call maps(k)%advance(state)
         end do
         states(k, :) = widen(state, size(states, 2)/2)
      end do
   end subroutine settle

   !> Contact kept.
   subroutine test_order_kept(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Errors of 128 steps at 900 rev/min: (w h)^4 with w h = 0.2, times some ten radians.
      real(wp), parameter :: tolerance = 1.0e-6_wp

      call check_order(kept, tolerance, .true., error)
   end subroutine test_order_kept

   !> Contact lost and found again.
   subroutine test_order_lost(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Measured 4e-7 at 128 steps.
      real(wp), parameter :: tolerance = 2.0e-6_wp

      call check_order(lost, tolerance, .false., error)
   end subroutine test_order_lost

   !> Both flanks struck.
   subroutine test_order_both(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Measured 6e-8 at 128 steps.
      real(wp), parameter :: tolerance = 2.0e-7_wp

      call check_order(both, tolerance, .false., error)
   end subroutine test_order_both

   !> Without backlash the mesh is linear, with varying stiffness.
   subroutine test_order_none(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Measured 6e-8 at 128 steps.
      real(wp), parameter :: tolerance = 2.0e-7_wp

      call check_order(none, tolerance, .true., error)
   end subroutine test_order_none

   !> A backlash so small that both borders are crossed within one step.
   subroutine test_order_tiny(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Measured 6e-8 at 128 steps.
      real(wp), parameter :: tolerance = 2.0e-7_wp

      call check_order(tiny_gap, tolerance, .true., error)
   end subroutine test_order_tiny

   !> The lanes approach collocation with many steps from the same state, over one period and over twenty, on every support.
   subroutine check_order(regime, tolerance, is_smooth, error)
      !> Regime.
      integer, intent(in) :: regime
      !> Error of the largest number of steps, beside the motion.
      real(wp), intent(in) :: tolerance
      !> Every doubling of the steps shows the order. Otherwise the error depends on where in a step the crossings come to lie,
      !> and only many doublings do.
      logical, intent(in) :: is_smooth
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Numbers of steps; those of collocation leave an error below 1e-10.
      integer, parameter :: steps(4) = [16, 32, 64, 128], fine = 256, periods(2) = [1, 20]
      real(wp), parameter :: order = 3.5_wp
      !> Mesh periods from the static equilibrium to the start.
      integer, parameter :: settling = 3
      integer, parameter :: contacts(regimes) = [contact_kept, contact_lost, contact_both_flanks, contact_both_flanks, &
                                                 contact_both_flanks]
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(collocation_map) :: map
      type(lane_ensemble) :: points
      real(wp), allocatable :: start(:, :), states(:, :), exact(:, :), state(:)
      real(wp) :: miss(size(steps), lanes), smallest, largest
      integer :: i, k, p, s

      call make_points(regime, equations, modal, error)
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      do p = 1, size(periods)
         exact = start
         do k = 1, lanes
            call load(map, equations(k), fine, error)
            if (allocated(error)) return
            state = narrow(start(k, :), modal(k)%modes)
            smallest = huge(1.0_wp)
            largest = -huge(1.0_wp)
            do i = 1, periods(p)
               call map%advance(state)
               smallest = min(smallest, map%smallest_deflection)
               largest = max(largest, map%largest_deflection)
            end do
            exact(k, :) = widen(state, size(start, 2)/2)
            call check(error, contact_of(smallest, largest, map%half_backlash), contacts(regime), trim(regime_names(regime)))
            if (allocated(error)) return
         end do
         do s = 1, size(steps)
            call fill_seats(equations, modal, steps(s), points)
            states = start
            do i = 1, periods(p)
               call points%advance(states)
            end do
            do k = 1, lanes
               miss(s, k) = norm2(states(k, :) - exact(k, :))/norm2(exact(k, :))
            end do
         end do
         do k = 1, lanes
            associate (place => to_text(periods(p))//' periods, support '//to_text(supports(k)), last => size(steps))
               call check(error, miss(last, k), 0.0_wp, tolerance, 'error over '//place)
               if (allocated(error)) return
               call check(error, log(miss(1, k)/miss(last, k))/log(2.0_wp) >= order*real(last - 1, wp), 'order over '//place)
               if (allocated(error)) return
               if (.not. is_smooth) cycle
               call check(error, all(log(miss(:last - 1, k)/miss(2:, k))/log(2.0_wp) >= order), 'every order over '//place)
               if (allocated(error)) return
            end associate
         end do
      end do
   end subroutine check_order

   !> Extremes of the mesh deflection, by which contact is told.
   subroutine test_extremes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Between two samples, half a step of 128 apart, a vibration that is carried by 50 rad over the period, as at 900 rev/min,
      !> reaches (0.1)^2/2 of its amplitude further; at most 1e-4 of the motion was measured.
      real(wp), parameter :: tolerance = 5.0e-4_wp
      integer, parameter :: steps = 128, fine = 512, settling = 20
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(collocation_map) :: map
      type(lane_ensemble) :: points
      real(wp), allocatable :: states(:, :), moved(:, :), state(:)
      real(wp) :: range, section
      integer :: k, regime

      do regime = 1, regimes
         call make_points(regime, equations, modal, error)
         if (allocated(error)) return
         call settle(equations, settling, states, error)
         if (allocated(error)) return
         call fill_seats(equations, modal, steps, points)
         moved = states
         call points%advance(moved)
         do k = 1, lanes
            call load(map, equations(k), fine, error)
            if (allocated(error)) return
            state = narrow(states(k, :), modal(k)%modes)
            call map%advance(state)
            range = map%largest_deflection - map%smallest_deflection
            ! The section at the end belongs to the next period.
            section = equations(k)%static_deflection + transmission_error(equations(k)%mesh, 0.0_wp) &
                      + sum(moved(k, :points%size/2))
            call check(error, min(points%smallest(k), section), map%smallest_deflection, tolerance*range, &
                       'smallest, '//trim(regime_names(regime))//', support '//to_text(supports(k)))
            if (allocated(error)) return
            call check(error, max(points%largest(k), section), map%largest_deflection, tolerance*range, &
                       'largest, '//trim(regime_names(regime))//', support '//to_text(supports(k)))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_extremes

   !> Unit tangents in every lane.
   pure function unit_tangents(length) result(tangents)
      !> Length of a state.
      integer, intent(in) :: length
      !> One tangent for each component.
      real(wp) :: tangents(lanes, length, length)

      integer :: i

      tangents = 0.0_wp
      do i = 1, length
         tangents(:, i, i) = 1.0_wp
      end do
   end function unit_tangents

   !> Tangents equal differences of maps from neighbouring states.
   subroutine test_tangents(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Length of a difference [m]: so small that few crossings pass into another step.
      real(wp), parameter :: length = 1.0e-11_wp
      integer, parameter :: steps(2) = [16, 64], settling = 20
      !> What differences may miss beside the largest tangent. Where nothing is crossed, or nothing changes there, the map is linear
      !> and the round-off of the motion over the difference is left; otherwise what the corrections of a step with a crossing leave
      !> unsolved, measured 2e-4 and 4e-7.
      real(wp), parameter :: roundoff = 1.0e-8_wp, unsolved(2) = [1.0e-3_wp, 2.0e-6_wp]
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(lane_ensemble) :: points
      real(wp), allocatable :: start(:, :), states(:, :), up(:, :), down(:, :), tangents(:, :, :)
      real(wp) :: tolerance, largest, miss
      integer :: regime, i, k, s

      do regime = 1, regimes
         call make_points(regime, equations, modal, error)
         if (allocated(error)) return
         call settle(equations, settling, start, error)
         if (allocated(error)) return
         do s = 1, size(steps)
            tolerance = merge(unsolved(s), roundoff, regime == lost .or. regime == both)
            call fill_seats(equations, modal, steps(s), points)
            states = start
            tangents = unit_tangents(points%size)
            call points%advance(states, tangents)
            do i = 1, points%size
               up = start
               up(:, i) = up(:, i) + length
               down = start
               down(:, i) = down(:, i) - length
               call points%advance(up)
               call points%advance(down)
               do k = 1, lanes
                  ! Places without a mode: nothing is there, and nothing comes of it.
                  largest = max(1.0_wp, maxval(abs(tangents(k, i, :))))
                  miss = maxval(abs(tangents(k, i, :) - (up(k, :) - down(k, :))/(2.0_wp*length)))
                  call check(error, miss, 0.0_wp, tolerance*largest, to_text(steps(s))//' steps, ' &
                             //trim(regime_names(regime))//', support '//to_text(supports(k))//', component '//to_text(i))
                  if (allocated(error)) return
               end do
            end do
         end do
      end do
   end subroutine test_tangents

   !> With many steps the tangents are those of collocation.
   subroutine test_tangents_limit(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Relative to the largest: the error of the motion itself; measured 5e-6 where both flanks are struck.
      real(wp), parameter :: tolerance = 2.0e-5_wp
      integer, parameter :: steps = 128, fine = 64, settling = 20
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(collocation_map) :: map
      type(lane_ensemble) :: points
      real(wp), allocatable :: states(:, :), start(:, :), tangents(:, :, :), state(:), expected(:, :)
      real(wp), allocatable :: identity(:, :, :)
      integer :: regime, i, k, m, n

      do regime = 1, regimes
         call make_points(regime, equations, modal, error)
         if (allocated(error)) return
         call settle(equations, settling, start, error)
         if (allocated(error)) return
         call fill_seats(equations, modal, steps, points)
         states = start
         tangents = unit_tangents(points%size)
         call points%advance(states, tangents)
         do k = 1, lanes
            call load(map, equations(k), fine, error)
            if (allocated(error)) return
            m = modal(k)%modes
            n = points%size/2
            identity = unit_tangents(map%size)
            expected = identity(1, :, :)
            state = narrow(start(k, :), m)
            call map%advance(state, expected)
            do i = 1, 2*m
               associate (found => narrow(tangents(k, merge(i, n + i - m, i <= m), :), m))
                  call check(error, maxval(abs(found - expected(i, :))), 0.0_wp, &
                             tolerance*max(1.0_wp, maxval(abs(expected))), trim(regime_names(regime))//', support ' &
                             //to_text(supports(k))//', component '//to_text(i))
               end associate
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_tangents_limit

   !> Tangents are carried in pairs and alone: a pair is two that are alone.
   subroutine test_tangent_count(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The same operations in other code: contracted in another way, relative to the largest.
      real(wp), parameter :: roundoff = 1.0e-13_wp
      integer, parameter :: steps = 24, settling = 20
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(lane_ensemble) :: points
      type(random_stream) :: random
      real(wp), allocatable :: states(:, :), start(:, :), tangents(:, :, :), one(:, :, :), three(:, :, :)
      integer :: i

      call make_points(both, equations, modal, error)
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      call fill_seats(equations, modal, steps, points)
      allocate (tangents(lanes, 3, points%size))
      do i = 1, points%size
         call random%fill(-1.0_wp, 1.0_wp, tangents(:, 1, i))
         call random%fill(-1.0_wp, 1.0_wp, tangents(:, 2, i))
         call random%fill(-1.0_wp, 1.0_wp, tangents(:, 3, i))
      end do
      three = tangents
      states = start
      call points%advance(states, three)
      do i = 1, 3
         one = tangents(:, i:i, :)
         states = start
         call points%advance(states, one)
         call check(error, maxval(abs(one(:, 1, :) - three(:, i, :))), 0.0_wp, roundoff*maxval(abs(three)), &
                    'tangent '//to_text(i))
         if (allocated(error)) return
      end do
   end subroutine test_tangent_count

   !> What is seen of the latest period of one lane, as a period of a point alone.
   subroutine take_orbit(self, lane, steps, frequency, orbit)
      !> View.
      type(lane_view), intent(in) :: self
      !> Lane.
      integer, intent(in) :: lane
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Mesh frequency [rad/s].
      real(wp), intent(in) :: frequency
      !> The period.
      type(orbit_type), intent(inout) :: orbit

      integer :: s

      call reserve_orbit(orbit, steps)
      orbit%samples = steps
      orbit%piece = 1
      do s = 0, steps
         orbit%time(s) = 2.0_wp*pi*real(s, wp)/(frequency*real(steps, wp))
         orbit%weight(s) = 1.0_wp/real(steps, wp)
         orbit%value(:, s) = self%seen(lane, :, 1, s)
         orbit%rate(:, s) = self%seen(lane, :, 2, s)
         orbit%acceleration(:, s) = self%seen(lane, :, 3, s)
      end do
      ! The trapezoidal rule is exact beyond every order for a periodic motion that is smooth.
      orbit%weight([0, steps]) = 0.5_wp/real(steps, wp)
   end subroutine take_orbit

   !> What is seen of a period is the displacements of the recorded modes, from section to section.
   subroutine test_record(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Condition of the eigenvectors times round-off, relative to the largest.
      real(wp), parameter :: roundoff = 1.0e-9_wp
      integer, parameter :: steps = 24, settling = 20
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(lane_ensemble) :: points
      type(lane_view) :: view
      type(orbit_type) :: orbit
      real(wp), allocatable :: states(:, :), start(:, :), position(:), velocity(:)
      real(wp) :: value_scale, rate_scale
      integer :: k, s, m

      call make_points(both, equations, modal, error)
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      do k = 1, lanes
         call seat_view(view, k, new_point_view(modal(k)))
      end do
      call fill_seats(equations, modal, steps, points)
      states = start
      call points%advance_recorded(states)
      call observe(view, points%size/2, points%record, steps)
      do k = 1, lanes
         m = modal(k)%modes
         call take_orbit(view, k, steps, equations(k)%frequency, orbit)
         call check(error, orbit%samples, steps, 'samples')
         if (allocated(error)) return
         call check(error, all(same_bits(points%record%re(k, :m, 0), start(k, :m))), 'begins at the section')
         if (allocated(error)) return
         call check(error, all(same_bits(points%record%re(k, :m, steps), states(k, :m))), 'ends at the section')
         if (allocated(error)) return
         call check(error, sum(orbit%weight(:orbit%samples)), 1.0_wp, roundoff, 'weights')
         if (allocated(error)) return
         value_scale = maxval(abs(orbit%value(:, :orbit%samples)))
         rate_scale = maxval(abs(orbit%rate(:, :orbit%samples)))
         do s = 0, orbit%samples
            call from_modes(modal(k), [points%record%re(k, :m, s), points%record%im(k, :m, s)], position, velocity)
            call check(error, maxval(abs(orbit%value(:, s) - matmul(equations(k)%observation, position))), 0.0_wp, &
                       roundoff*value_scale, 'value, support '//to_text(supports(k))//', sample '//to_text(s))
            if (allocated(error)) return
            call check(error, maxval(abs(orbit%rate(:, s) - matmul(equations(k)%observation, velocity))), 0.0_wp, &
                       roundoff*rate_scale, 'rate, support '//to_text(supports(k))//', sample '//to_text(s))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_record

   !> Values, rates and accelerations of a recorded period are those of collocation at the same times.
   subroutine test_record_limit(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Relative to the largest of each, measured 2e-5.
      real(wp), parameter :: tolerance = 1.0e-4_wp
      !> Of a mesh period: times that are the same.
      real(wp), parameter :: same_time = 1.0e-9_wp
      integer, parameter :: steps = 64, fine = 2*steps, settling = 20
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(collocation_map) :: map
      type(lane_ensemble) :: points
      type(lane_view) :: view
      type(orbit_type) :: orbit, expected
      real(wp), allocatable :: states(:, :), start(:, :), state(:), position(:), velocity(:)
      real(wp) :: miss(3), scale(3)
      integer :: regime, k, s, t, last

      do regime = 1, regimes
         call make_points(regime, equations, modal, error)
         if (allocated(error)) return
         call settle(equations, settling, start, error)
         if (allocated(error)) return
         call fill_seats(equations, modal, steps, points)
         do k = 1, lanes
            call seat_view(view, k, new_point_view(modal(k)))
         end do
         states = start
         call points%advance_recorded(states)
         call observe(view, points%size/2, points%record, steps)
         do k = 1, lanes
            call load(map, equations(k), fine, error)
            if (allocated(error)) return
            state = narrow(start(k, :), modal(k)%modes)
            call map%advance(state, orbit=expected)
            call take_orbit(view, k, steps, equations(k)%frequency, orbit)
            last = expected%samples
            scale = [maxval(abs(expected%value(:, :last))), maxval(abs(expected%rate(:, :last))), &
                     maxval(abs(expected%acceleration(:, :last)))]
            do s = 0, orbit%samples
               t = minloc(abs(expected%time(:last) - orbit%time(s)), 1) - 1
               call check(error, orbit%time(s), expected%time(t), same_time*map%period, 'time')
               if (allocated(error)) return
               miss = [maxval(abs(orbit%value(:, s) - expected%value(:, t))), &
                       maxval(abs(orbit%rate(:, s) - expected%rate(:, t))), &
                       maxval(abs(orbit%acceleration(:, s) - expected%acceleration(:, t)))]
               call check(error, maxval(miss/scale), 0.0_wp, tolerance, &
                          trim(regime_names(regime))//', support '//to_text(supports(k))//', sample '//to_text(s))
               if (allocated(error)) return
            end do
            call map%from_state(state, position, velocity)
            call check(error, maxval(abs(orbit%value(:, orbit%samples) - matmul(equations(k)%observation, position))), 0.0_wp, &
                       tolerance*scale(1), 'value at the section')
            if (allocated(error)) return
            call check(error, maxval(abs(orbit%rate(:, orbit%samples) - matmul(equations(k)%observation, velocity))), 0.0_wp, &
                       tolerance*scale(2), 'rate at the section')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_record_limit

   !> Sums of harmonics that turn between the samples, over some periods in three parts, in lanes of which one is empty: each
   !> motion by itself gives the same.
   subroutine test_amplitudes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Relative.
      real(wp), parameter :: roundoff = 1.0e-12_wp
      integer, parameter :: periods = 9, parts = 3, harmonics = 4, empty = 6
      integer, parameter :: steps(3) = [5, 16, 33]
      type(random_stream) :: random
      type(lane_amplitude) :: amplitude
      type(motion_measure) :: measure, alone(lanes, 0:parts)
      type(lane_view) :: view
      type(orbit_type) :: orbit
      type(response) :: answer, expected
      real(wp) :: static(lanes, observables), frequency(lanes), size(2, harmonics), phase, drift
      integer :: part(lanes), j, k, l, s, period, observable, order

      do j = 1, 3
         amplitude = lane_amplitude()
         call amplitude%reserve(parts, steps(j))
         do observable = 1, observables
            call random%fill(-1.0_wp, 1.0_wp, static(:, observable))
         end do
         call random%fill(1.0e3_wp, 2.0e4_wp, frequency)
         do l = 1, lanes
            call amplitude%begin(l, static(l, :), frequency(l))
            do k = 0, parts
               call alone(l, k)%reset(static(l, :))
            end do
         end do
         if (allocated(view%seen)) deallocate (view%seen)
         allocate (view%seen(lanes, observables, 3, 0:steps(j)), source=0.0_wp)
         do period = 1, periods
            do observable = 1, observables
               do l = 1, lanes
                  do k = 1, harmonics
                     call random%fill(-1.0_wp, 1.0_wp, size(:, k))
                  end do
                  do s = 0, steps(j)
                     phase = 2.0_wp*pi*real(s, wp)/real(steps(j), wp)
                     do order = 1, 3
                        drift = 0.5_wp*pi*real(order - 1, wp)
                        view%seen(l, observable, order, s) = frequency(l)**(order - 1)*sum( &
                                                         [(real(k, wp)**(order - 3)*(size(1, k)*cos(real(k, wp)*phase + drift) &
                                                                           + size(2, k)*sin(real(k, wp)*phase + drift)), &
                                                           k=1, harmonics)])
                     end do
                  end do
               end do
            end do
            part = [(1 + mod(period*l, parts), l=1, lanes)]
            part(empty) = 0
            call amplitude%add(view%seen, steps(j), part)
            do l = 1, lanes
               if (l == empty) cycle
               call take_orbit(view, l, steps(j), frequency(l), orbit)
               call alone(l, part(l))%add(orbit)
               call alone(l, 0)%add(orbit)
            end do
         end do
         measure = amplitude%measure_of(empty, [1, 2, 3])
         call check(error, measure%periods, 0, 'periods of the empty lane')
         if (allocated(error)) return
         call check(error, measure%largest < measure%smallest .and. .not. any(measure%largest_square > 0.0_wp), &
                    'extremes of the empty lane')
         if (allocated(error)) return
         do l = 1, lanes
            if (l == empty) cycle
            do k = 0, parts
               ! Some lanes never see some of the parts; the first is the whole.
               if (alone(l, k)%periods == 0) cycle
               measure = amplitude%measure_of(l, pack([1, 2, 3], [1, 2, 3] == k .or. k == 0))
               call alone(l, k)%finish(expected)
               call measure%finish(answer)
               call check(error, answer%y1_amplitude, expected%y1_amplitude, roundoff*expected%y1_amplitude, 'amplitude')
               if (allocated(error)) return
               call check(error, answer%y1_rms, expected%y1_rms, roundoff*expected%y1_rms, 'rms')
               if (allocated(error)) return
               call check(error, answer%y1_max, expected%y1_max, roundoff*expected%y1_amplitude, 'largest')
               if (allocated(error)) return
               call check(error, answer%y1_min, expected%y1_min, roundoff*expected%y1_amplitude, 'smallest')
               if (allocated(error)) return
               call check(error, maxval(abs(answer%bearing_deformation_max/expected%bearing_deformation_max - 1.0_wp)), 0.0_wp, &
                          roundoff, 'bearing deformation')
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_amplitudes

   !> A state goes the same way alone, with tangents and while it is recorded.
   subroutine test_passengers(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 24, settling = 3, periods = 10
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(lane_ensemble) :: points
      real(wp), allocatable :: alone(:, :), carrying(:, :), recorded(:, :), tangents(:, :, :)
      real(wp) :: smallest(lanes), largest(lanes)
      integer :: i, regime

      do regime = 1, regimes
         call make_points(regime, equations, modal, error)
         if (allocated(error)) return
         call settle(equations, settling, alone, error)
         if (allocated(error)) return
         call fill_seats(equations, modal, steps, points)
         carrying = alone
         recorded = alone
         tangents = unit_tangents(points%size)
         do i = 1, periods
            call points%advance(alone)
            smallest = points%smallest
            largest = points%largest
            call points%advance(carrying, tangents)
            call check(error, all(same_bits(alone, carrying)), 'with tangents, '//trim(regime_names(regime)))
            if (allocated(error)) return
            call check(error, all(same_bits(smallest, points%smallest) .and. same_bits(largest, points%largest)), &
                       'extremes with tangents, '//trim(regime_names(regime)))
            if (allocated(error)) return
            call points%advance_recorded(recorded)
            call check(error, all(same_bits(alone, recorded)), 'recorded, '//trim(regime_names(regime)))
            if (allocated(error)) return
            call check(error, all(same_bits(smallest, points%smallest) .and. same_bits(largest, points%largest)), &
                       'extremes while recorded, '//trim(regime_names(regime)))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_passengers

   !> Points that share a mesh: one crosses borders all the time, another never.
   subroutine mixed_points(equations, modal, error)
      !> The points.
      type(equations_type), intent(out) :: equations(lanes)
      type(modal_system), intent(out) :: modal(lanes)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speeds(lanes) = [5500.0_wp, 900.0_wp, 3500.0_wp, 2600.0_wp, 600.0_wp, 4500.0_wp, 5000.0_wp, 1250.0_wp]
      integer :: k

      do k = 1, lanes
         if (k < lanes) then
            equations(k) = new_equations(reference_gears(), reference_box(), reference_load(), &
                                         flexible_point(speeds(k), supports(lanes + 1 - k)))
         else
            equations(k) = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speeds(k)))
         end if
         call find_modes(equations(k), modal(k), error)
         if (allocated(error)) return
      end do
   end subroutine mixed_points

   !> Advance seats over some periods, with tangents and recorded by turns, and put all that comes of it side by side.
   subroutine run_seats(points, steps, frequency, views, start, found)
      !> The lanes, seated.
      type(lane_ensemble), intent(inout) :: points
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Mesh frequency of each seat [rad/s].
      real(wp), intent(in) :: frequency(lanes)
      !> What the seats see.
      type(lane_view), intent(inout) :: views
      !> States, shape (lanes, size).
      real(wp), intent(in) :: start(:, :)
      !> What each seat comes to, shape (lanes, any).
      real(wp), allocatable, intent(out) :: found(:, :)

      integer, parameter :: periods = 6
      type(orbit_type) :: orbit
      real(wp), dimension(lanes, points%size) :: states
      real(wp), dimension(lanes, points%size, points%size) :: tangents
      real(wp), dimension(lanes, 1, points%size) :: one
      real(wp), dimension(lanes, 3*periods) :: smallest, largest
      real(wp), dimension(lanes, 5, steps + 1) :: value, rate, acceleration
      integer :: i, k, n

      states = start
      tangents = unit_tangents(points%size)
      one = 1.0_wp
      do i = 1, periods
         call points%advance(states)
         smallest(:, 3*i - 2) = points%smallest
         largest(:, 3*i - 2) = points%largest
         call points%advance(states, tangents)
         smallest(:, 3*i - 1) = points%smallest
         largest(:, 3*i - 1) = points%largest
         call points%advance(states, one)
         smallest(:, 3*i) = points%smallest
         largest(:, 3*i) = points%largest
      end do
      call points%advance_recorded(states)
      call observe(views, points%size/2, points%record, steps)
      do k = 1, lanes
         call take_orbit(views, k, steps, frequency(k), orbit)
         value(k, :, :) = orbit%value(:, :steps)
         rate(k, :, :) = orbit%rate(:, :steps)
         acceleration(k, :, :) = orbit%acceleration(:, :steps)
      end do
      n = points%size
      found = reshape([states, tangents, one, smallest, largest, value, rate, acceleration], &
                      [lanes, n + n*n + n + 6*periods + 15*(steps + 1)])
   end subroutine run_seats

   !> Seat points in some order and run them.
   subroutine run_order(equations, modal, order, start, found)
      !> The points.
      type(equations_type), intent(in) :: equations(:)
      type(modal_system), intent(in) :: modal(:)
      !> Which point sits in each seat; 0 leaves it empty.
      integer, intent(in) :: order(lanes)
      !> State of each seat.
      real(wp), intent(in) :: start(:, :)
      !> What each seat comes to.
      real(wp), allocatable, intent(out) :: found(:, :)

      integer, parameter :: steps = 24
      type(lane_ensemble) :: points
      type(lane_view) :: view
      real(wp) :: frequency(lanes)
      integer :: k

      call points%load(equations, modal, [(k, k=1, size(equations))], steps)
      frequency = equations(1)%frequency
      do k = 1, lanes
         if (order(k) == 0) cycle
         call points%seat(k, order(k))
         call seat_view(view, k, new_point_view(modal(order(k))))
         frequency(k) = equations(order(k))%frequency
      end do
      call run_seats(points, steps, frequency, view, start, found)
   end subroutine run_order

   !> A point comes to the same in every seat, among the same points.
   subroutine test_seats(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: settling = 10
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      real(wp), allocatable :: start(:, :), expected(:, :), found(:, :)
      integer :: order(lanes), turn, k

      call mixed_points(equations, modal, error)
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      call run_order(equations, modal, [(k, k=1, lanes)], start, expected)
      do turn = 1, 2*lanes - 1
         order = cshift([(k, k=1, lanes)], turn)
         if (turn >= lanes) order = order(lanes:1:-1)
         call run_order(equations, modal, order, start(order, :), found)
         do k = 1, lanes
            call check(error, all(same_bits(found(k, :), expected(order(k), :))), &
                       'point '//to_text(order(k))//' in seat '//to_text(k))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_seats

   !> A point comes to the same alone, among copies of itself, and among any others.
   subroutine test_neighbours(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: settling = 10
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      real(wp), allocatable :: start(:, :), states(:, :), expected(:, :), found(:, :)
      integer :: order(lanes), p, k, other, seat

      call mixed_points(equations, modal, error)
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      call run_order(equations, modal, [(k, k=1, lanes)], start, expected)
      do p = 1, lanes
         seat = 1 + mod(3*p, lanes)
         do other = 0, lanes
            order = other
            order(seat) = p
            states = 0.0_wp*start
            if (other > 0) states = spread(start(other, :), 1, lanes)
            states(seat, :) = start(p, :)
            call run_order(equations, modal, order, states, found)
            call check(error, all(same_bits(found(seat, :), expected(p, :))), 'point '//to_text(p)//' beside '//to_text(other))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_neighbours

   !> A point comes to the same beside states that are far out, infinite or not a number.
   subroutine test_broken_neighbours(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call run_untrapped(seat_broken_neighbours, error)
   end subroutine test_broken_neighbours

   !> The same, where nothing is trapped.
   subroutine seat_broken_neighbours(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: settling = 10
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      real(wp), allocatable :: start(:, :), states(:, :), expected(:, :), found(:, :)
      real(wp) :: broken(4)
      integer :: p, k, b

      broken = [1.0e100_wp, huge(1.0_wp), ieee_value(1.0_wp, ieee_positive_inf), ieee_value(1.0_wp, ieee_quiet_nan)]
      call mixed_points(equations, modal, error)
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      call run_order(equations, modal, [(k, k=1, lanes)], start, expected)
      do b = 1, size(broken)
         do p = 1, lanes
            states = start
            states(p, :) = broken(b)
            call run_order(equations, modal, [(k, k=1, lanes)], states, found)
            do k = 1, lanes
               if (k == p) cycle
               call check(error, all(same_bits(found(k, :), expected(k, :))), 'point '//to_text(k)//', fault '//to_text(b) &
                          //' in seat '//to_text(p))
               if (allocated(error)) return
            end do
            ! All but one.
            states = broken(b)
            states(p, :) = start(p, :)
            call run_order(equations, modal, [(k, k=1, lanes)], states, found)
            call check(error, all(same_bits(found(p, :), expected(p, :))), 'point '//to_text(p)//' among faults '//to_text(b))
            if (allocated(error)) return
         end do
      end do
   end subroutine seat_broken_neighbours

   !> Places for the modes of others change nothing.
   subroutine test_room(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: settling = 10, steps = 24, periods = 20
      type(equations_type) :: equations(lanes)
      type(modal_system) :: modal(lanes)
      type(lane_ensemble) :: wide, own
      real(wp), allocatable :: start(:, :), states(:, :), alone(:, :)
      integer :: i, k, p

      call mixed_points(equations, modal, error)
      if (allocated(error)) return
      p = lanes
      call check(error, modal(p)%modes < maxval(modal%modes), 'the point has fewer modes than others')
      if (allocated(error)) return
      call settle(equations, settling, start, error)
      if (allocated(error)) return
      call fill_seats(equations, modal, steps, wide)
      call fill_seats(equations(p:p), modal(p:p), steps, own)
      states = start
      allocate (alone(lanes, own%size), source=0.0_wp)
      alone(1, :) = narrow(start(p, :), modal(p)%modes)
      do i = 1, periods
         call wide%advance(states)
         call own%advance(alone)
      end do
      call check(error, all(same_bits(alone(1, :), narrow(states(p, :), modal(p)%modes))), 'state')
      if (allocated(error)) return
      call check(error, all(same_bits(states(p, :), widen(alone(1, :), wide%size/2))), 'zeros behind')
      if (allocated(error)) return
      do k = 1, own%size/2
         call check(error, same_bits(own%weight(k, 1), wide%weight(k, p)), 'weights')
         if (allocated(error)) return
      end do
   end subroutine test_room

   !> Two responses are the same, bit by bit.
   pure function same_response(a, b) result(same)
      !> The responses.
      type(response), intent(in) :: a, b
      !> They are.
      logical :: same

      same = all(same_bits([a%y1_amplitude, a%y1_rms, a%y1_max, a%y1_min, a%bearing_deformation_max, a%error_estimate, &
                            a%floquet_magnitude, a%lyapunov_exponent, a%lyapunov_error], &
                           [b%y1_amplitude, b%y1_rms, b%y1_max, b%y1_min, b%bearing_deformation_max, b%error_estimate, &
                            b%floquet_magnitude, b%lyapunov_exponent, b%lyapunov_error])) &
             .and. all([a%motion, a%status, a%periods_integrated, a%contact] &
                       == [b%motion, b%status, b%periods_integrated, b%contact])
   end function same_response

   !> A tile of the grid whose points have different numbers of modes: a support of about critical damping.
   subroutine make_tile(speeds, rows, equations)
      !> Speeds [rev/min].
      real(wp), intent(in) :: speeds(:)
      !> Support stiffnesses [N/m].
      real(wp), intent(in) :: rows(:)
      !> Equations of motion, row by row.
      type(equations_type), allocatable, intent(out) :: equations(:)

      type(gearbox) :: box
      integer :: i, k

      box = reference_box()
      allocate (equations(size(speeds)*size(rows)))
      do k = 1, size(rows)
         ! Every other row.
         box%damping_ratio = merge(0.15_wp, 1.5_wp, mod(k, 2) == 1)
         do i = 1, size(speeds)
            equations((k - 1)*size(speeds) + i) = new_equations(reference_gears(), box, reference_load(), &
                                                                flexible_point(speeds(i), rows(k)))
         end do
      end do
   end subroutine make_tile

   !> Responses of a list of points, solved with a new solver in pieces.
   subroutine respond_in_pieces(options, equations, order, piece, answers, positions, velocities)
      !> Options.
      type(solver_options), intent(in) :: options
      !> The points.
      type(equations_type), intent(in) :: equations(:)
      !> The order in which they are solved.
      integer, intent(in) :: order(:)
      !> Points at once.
      integer, intent(in) :: piece
      !> The responses, in the order of the points.
      type(response), intent(out) :: answers(:)
      !> Where the motions end, in the order of the points.
      real(wp), allocatable, intent(out) :: positions(:, :), velocities(:, :)

      type(solver_type), allocatable :: solver
      type(response) :: some(piece)
      type(no_attendant) :: nobody
      real(wp) :: position(equations(1)%n, piece), velocity(equations(1)%n, piece)
      integer :: first, n

      allocate (solver)
      call new_solver(options, solver)
      allocate (positions(equations(1)%n, size(equations)), velocities(equations(1)%n, size(equations)))
      do first = 1, size(order), piece
         n = min(piece, size(order) - first + 1)
         associate (now => order(first:first + n - 1))
            position = 0.0_wp
            velocity = 0.0_wp
            if (piece == 1) then
               call respond_one(solver, equations(now(1)), position(:, 1), velocity(:, 1), nobody, some(1))
            else
               call respond(solver, equations(now), position(:, :n), velocity(:, :n), nobody, some(:n))
            end if
            answers(now) = some(:n)
            positions(:, now) = position(:, :n)
            velocities(:, now) = velocity(:, :n)
         end associate
      end do
   end subroutine respond_in_pieces

   !> Solve points whole, backwards, shuffled, one by one and in pieces: the same bits.
   subroutine compare_lists(options, equations, error)
      !> Options.
      type(solver_options), intent(in) :: options
      !> The points.
      type(equations_type), intent(in) :: equations(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: pieces(6) = [0, 0, 1, 5, 8, 13]
      character(len=*), parameter :: ways(6) = [character(len=14) :: 'backwards', 'shuffled', 'one by one', 'fives', 'eights', &
                                                'thirteens shuf']
      type(response) :: whole(size(equations)), answers(size(equations))
      type(random_stream) :: random
      real(wp), allocatable :: positions(:, :), velocities(:, :), position(:, :), velocity(:, :)
      integer :: order(size(equations)), i, way, other, kept_one

      call respond_in_pieces(options, equations, [(i, i=1, size(order))], size(order), whole, positions, velocities)
      do way = 1, size(pieces)
         order = [(i, i=1, size(order))]
         if (way == 1) order = order(size(order):1:-1)
         if (way == 2 .or. way == 6) then
            do i = size(order), 2, -1
               call random%pick(1, i, other)
               kept_one = order(i)
               order(i) = order(other)
               order(other) = kept_one
            end do
         end if
         call respond_in_pieces(options, equations, order, merge(size(order), pieces(way), pieces(way) == 0), answers, &
                                position, velocity)
         do i = 1, size(order)
            call check(error, same_response(answers(i), whole(i)), 'point '//to_text(i)//', '//trim(ways(way))//': ' &
                       //to_text(answers(i)%y1_amplitude)//', '//to_text(answers(i)%periods_integrated)//' periods and ' &
                       //to_text(whole(i)%y1_amplitude)//', '//to_text(whole(i)%periods_integrated))
            if (allocated(error)) return
            call check(error, all(same_bits(position(:, i), positions(:, i)) .and. same_bits(velocity(:, i), velocities(:, i))), &
                       'section of point '//to_text(i)//', '//trim(ways(way)))
            if (allocated(error)) return
         end do
      end do
   end subroutine compare_lists

   !> A list of points, and what is asked for.
   subroutine make_list(rows, multipliers, options, equations)
      !> Support stiffnesses [N/m].
      real(wp), intent(in) :: rows(:)
      !> Multipliers are asked for.
      logical, intent(in) :: multipliers
      !> Options.
      type(solver_options), intent(out) :: options
      !> The points.
      type(equations_type), allocatable, intent(out) :: equations(:)

      integer, parameter :: speeds = 14
      integer :: i

      options%integrator = integrator_collocation
      options%max_periods = 400
      options%measured_periods = 20
      options%multipliers = multipliers
      call make_tile([(1000.0_wp + 375.0_wp*real(i, wp), i=1, speeds)], rows, equations)
   end subroutine make_list

   !> Periodic motions of one, two and three periods, others, contact of every kind, supports with real modes and without.
   subroutine test_lists(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)
      type(modal_system) :: first, last

      call make_list([1.0e3_wp, 1.0e6_wp, 2.5e8_wp, 1.0e9_wp], .false., options, equations)
      call find_modes(equations(1), first, error)
      if (allocated(error)) return
      call find_modes(equations(size(equations)), last, error)
      if (allocated(error)) return
      call check(error, first%modes /= last%modes, 'numbers of modes differ')
      if (allocated(error)) return
      call compare_lists(options, equations, error)
   end subroutine test_lists

   !> Multipliers of points with the same number of modes.
   subroutine test_multipliers(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)

      call make_list([2.5e8_wp], .true., options, equations)
      call compare_lists(options, equations, error)
   end subroutine test_multipliers

   !> Multipliers of points among others that have more modes.
   subroutine test_multipliers_room(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)

      call make_list([1.0e3_wp, 1.0e6_wp], .true., options, equations)
      call compare_lists(options, equations, error)
   end subroutine test_multipliers_room

   !> Newmark's method in lanes.
   subroutine test_newmark_lists(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: coarse = 1.0e-2_wp
      integer, parameter :: speeds = 5
      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)
      integer :: i

      options%integrator = integrator_newmark
      options%max_periods = 100
      options%measured_periods = 4
      options%multipliers = .false.
      options%tolerance = coarse
      call make_tile([(1000.0_wp + 900.0_wp*real(i, wp), i=1, speeds)], [1.0e5_wp, 2.5e8_wp], equations)
      call compare_lists(options, equations, error)
   end subroutine test_newmark_lists

   !> Tolerances that ask for more steps, and for the integrator of high order.
   subroutine test_refined_lists(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: tolerances(2) = [1.0e-5_wp, 1.0e-8_wp]
      integer, parameter :: speeds = 12
      type(solver_options) :: options
      type(equations_type), allocatable :: equations(:)
      integer :: i

      options%integrator = integrator_collocation
      options%max_periods = 200
      options%measured_periods = 10
      options%multipliers = .false.
      call make_tile([(1500.0_wp + 350.0_wp*real(i, wp), i=1, speeds)], [1.0e5_wp, 2.5e8_wp], equations)
      do i = 1, size(tolerances)
         options%tolerance = tolerances(i)
         call compare_lists(options, equations, error)
         if (allocated(error)) return
      end do
   end subroutine test_refined_lists

end module test_lanes
