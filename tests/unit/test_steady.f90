!> The search for steady motions: sections, Newton's method on the period map, and what a start leads to.
module test_steady
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use pseudo_random, only: random_stream
   use spurflex_base_attendant, only: attendant, no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_options, only: solver_options
   use spurflex_integrate_period_map, only: period_map
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair, load_type, operating_point
   use spurflex_steady_outcome, only: motion_unresolved, status_diverged, status_not_settled, status_settled, steady_motion
   use spurflex_steady_search, only: find_steady_motion
   use spurflex_steady_sections, only: longest_period, section_ring, weighted_norm
   use spurflex_steady_orbit, only: floquet_multipliers, periodic_orbit
   use spurflex_steady_shooting, only: find_orbit
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_steady

   !> Counts how often it is let in.
   type, extends(attendant) :: counter
      !> Times.
      integer :: times = 0
   contains
      !> Count.
      procedure :: attend => count_visit
   end type counter

contains

   !> The tests of this suite.
   subroutine collect_steady(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('sections of motions of one to eight periods', test_sections), &
                  new_unittest('sections of a transient', test_transient_sections), &
                  new_unittest('sections of a torus return along it', test_return_direction), &
                  new_unittest('one Newton iteration while contact is kept', test_affine), &
                  new_unittest('Floquet multipliers keep Liouville''s formula', test_liouville), &
                  new_unittest('no periodic motion in an unstable linear system', test_unstable), &
                  new_unittest('the motion is the one that the transient ends in', test_transient), &
                  new_unittest('the motion repeats after its period and not before', test_shortest), &
                  new_unittest('the start decides between two motions', test_branches), &
                  new_unittest('too few periods leave a motion not settled', test_not_settled), &
                  new_unittest('a growing motion has diverged', test_diverged), &
                  new_unittest('visitors are let in', test_visitor) &
                  ]
   end subroutine collect_steady

   !> Count.
   subroutine count_visit(self)
      !> The visitor.
      class(counter), intent(inout) :: self

      self%times = self%times + 1
   end subroutine count_visit

   !> Load a point, failing the test where that fails.
   subroutine load(map, gears, point, steps, error)
      !> Map.
      class(period_map), intent(inout) :: map
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      call map%load(new_equations(gears, reference_box(), reference_load(), point), steps, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine load

   !> The state at the static equilibrium.
   pure function static_state(map) result(state)
      !> Map.
      class(period_map), intent(in) :: map
      !> Its zero deviation.
      real(wp) :: state(map%size)

      state = 0.0_wp
   end function static_state

   !> Distance of a state to the sections of a periodic motion, relative to its size.
   function distance_to(map, motion, state) result(nearest)
      !> Map.
      class(period_map), intent(inout) :: map
      !> The motion.
      type(steady_motion), intent(in) :: motion
      !> The state.
      real(wp), intent(in) :: state(:)
      !> The distance.
      real(wp) :: nearest

      real(wp) :: moving(size(state))
      integer :: k

      nearest = huge(nearest)
      moving = motion%state
      do k = 1, motion%periods
         nearest = min(nearest, weighted_norm(map%weight, state - moving)/weighted_norm(map%weight, motion%state))
         call map%advance(moving)
      end do
   end function distance_to

   !> The period of exact repetitions.
   subroutine test_sections(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: longest = 8
      type(section_ring) :: ring
      integer :: n, i

      do n = 1, longest
         call ring%reset([1.0_wp, 2.0_wp])
         do i = 1, 100
            call ring%add([1.0_wp + real(mod(i, n)**2, wp), -real(mod(i, n), wp)])
         end do
         call check(error, ring%distance(n), 0.0_wp, 0.0_wp, 'distance after the period')
         if (allocated(error)) return
         call check(error, all([(ring%distance(i) > 0.1_wp, i=1, n - 1)]), 'distance before')
         if (allocated(error)) return
         call check(error, ring%scale(), norm2([1.0_wp + real((n - 1)**2, wp), 2.0_wp*real(n - 1, wp)]), 1.0e-14_wp, 'size', &
                    relative=.true.)
         if (allocated(error)) return
      end do
   end subroutine test_sections

   !> Between sections of a torus that come back near to each other lies its tangent; where they are the same there is none.
   subroutine test_return_direction(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: turn = 2.399963229728653_wp, weight(2) = [1.0_wp, 2.0_wp]
      real(wp) :: direction(2), tangent(2), angle
      type(section_ring) :: ring
      integer :: i

      call ring%reset(weight)
      call ring%add([1.0_wp, 0.0_wp])
      call check(error, all(abs(ring%return_direction()) <= 0.0_wp), 'no direction from a single section')
      if (allocated(error)) return
      do i = 1, 150
         angle = turn*real(i, wp)
         call ring%add([cos(angle), 0.5_wp*sin(angle)])
      end do
      direction = ring%return_direction()
      tangent = [-sin(angle), 0.5_wp*cos(angle)]
      call check(error, weighted_norm(weight, direction), 1.0_wp, 1.0e-14_wp, 'a unit vector')
      if (allocated(error)) return
      ! The nearest return is 55 sections back, 0.051 rad away.
      call check(error, abs(sum(weight**2*direction*tangent)), 1.0_wp, 5.0e-4_wp, 'along the tangent')
      if (allocated(error)) return
      call ring%add([cos(angle), 0.5_wp*sin(angle)])
      call check(error, all(abs(ring%return_direction()) <= 0.0_wp), 'no direction between equal sections')
   end subroutine test_return_direction

   !> What sections of a decay differ by; there are none before the first.
   subroutine test_transient_sections(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(section_ring) :: ring
      integer :: i

      call ring%reset([1.0_wp])
      call ring%add([3.0_wp])
      call check(error, ring%distance(1) >= huge(1.0_wp), 'one section')
      if (allocated(error)) return
      do i = 1, 200
         call ring%add([1.0_wp + 2.0_wp*0.999_wp**i])
      end do
      call check(error, ring%distance(1), 2.0_wp*0.999_wp**199*0.001_wp, 1.0e-14_wp, 'a period')
      if (allocated(error)) return
      call check(error, ring%distance(longest_period), 2.0_wp*0.999_wp**200*(0.999_wp**(-longest_period) - 1.0_wp), 1.0e-14_wp, &
                 'as many periods as are kept')
      if (allocated(error)) return
      call check(error, ring%distance(longest_period + 1) >= huge(1.0_wp), 'more')
   end subroutine test_transient_sections

   !> While contact is kept the map is affine: from anywhere near, the motion is found at once, also on a soft support.
   subroutine test_affine(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: stiffness(4) = [1.0e3_wp, 1.0e5_wp, 2.5e8_wp, 1.0e12_wp]
      !> Round-off of the map, amplified by 1/(1 - 0.9995) on the softest support, relative.
      real(wp), parameter :: tolerance = 1.0e-9_wp
      type(collocation_map) :: map
      type(gear_pair) :: gears
      type(no_attendant) :: nobody
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: state(:)
      integer :: k
      logical :: found

      gears = reference_gears()
      gears%mesh%error_amplitudes = 1.0e-6_wp
      do k = 1, size(stiffness)
         call load(map, gears, flexible_point(1500.0_wp, stiffness(k)), 32, error)
         if (allocated(error)) return
         call find_orbit(map, static_state(map), 1, 1.0e-5_wp, nobody, orbit, found)
         call check(error, found, 'found')
         if (allocated(error)) return
         call check(error, orbit%integrated <= 3, 'one iteration, and one to be sure')
         if (allocated(error)) return
         state = orbit%state
         call map%advance(state)
         call check(error, weighted_norm(map%weight, state - orbit%state), 0.0_wp, &
                    tolerance*weighted_norm(map%weight, state), 'repeats')
         if (allocated(error)) return
      end do
   end subroutine test_affine

   !> The product of the multipliers is exp(-trace(M^-1 C) T), whatever the mesh stiffness does and where contact is lost:
   !> the mesh damping acts all the time.
   subroutine test_liouville(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Of the method at this step.
      real(wp), parameter :: tolerance = 1.0e-6_wp
      type(collocation_map) :: map
      type(equations_type) :: equations
      type(operating_point) :: points(4)
      type(no_attendant) :: nobody
      type(periodic_orbit) :: orbit
      type(library_error), allocatable :: fault
      complex(wp), allocatable :: multipliers(:)
      real(wp), allocatable :: inverse(:, :), damping(:, :)
      real(wp) :: trace
      integer :: i, j, k, n
      logical :: found

      points = [rigid_point(1500.0_wp), rigid_point(3500.0_wp), flexible_point(1500.0_wp, 3.0e7_wp), &
                flexible_point(3500.0_wp, 2.5e8_wp)]
      do k = 1, size(points)
         call load(map, reference_gears(), points(k), 64, error)
         if (allocated(error)) return
         equations = new_equations(reference_gears(), reference_box(), reference_load(), points(k))
         n = equations%n
         call check(error, map%size, 2*n, 'every mode is kept')
         if (allocated(error)) return
         call find_orbit(map, settled_state(map, 300), 1, 1.0e-5_wp, nobody, orbit, found)
         call check(error, found, 'found')
         if (allocated(error)) return
         call floquet_multipliers(orbit%monodromy, multipliers, fault)
         call check(error, .not. allocated(fault), 'eigenvalues')
         if (allocated(error)) return
         inverse = inverse_of(equations%mass)
         damping = equations%mesh%damping*spread(equations%direction, 2, n)*spread(equations%direction, 1, n)
         do i = 1, n
            damping(i, i) = damping(i, i) + equations%damping(i)
         end do
         trace = 0.0_wp
         do i = 1, n
            do j = 1, n
               trace = trace + inverse(i, j)*damping(j, i)
            end do
         end do
         call check(error, sum(log(abs(multipliers))), -trace*map%period, tolerance, relative=.true.)
         if (allocated(error)) return
      end do
   end subroutine test_liouville

   !> State after some periods from the static equilibrium.
   function settled_state(map, periods) result(state)
      !> Map.
      class(period_map), intent(inout) :: map
      !> Mesh periods.
      integer, intent(in) :: periods
      !> The state.
      real(wp) :: state(map%size)

      integer :: k

      state = 0.0_wp
      do k = 1, periods
         call map%advance(state)
      end do
   end function settled_state

   !> Inverse of a matrix.
   function inverse_of(matrix) result(inverse)
      !> The matrix, shape (n, n).
      real(wp), intent(in) :: matrix(:, :)
      !> Its inverse.
      real(wp) :: inverse(size(matrix, 1), size(matrix, 1))

      real(wp) :: unit(size(matrix, 1))
      integer :: i

      do i = 1, size(matrix, 1)
         unit = 0.0_wp
         unit(i) = 1.0_wp
         inverse(:, i) = solve(matrix, unit)
      end do
   end function inverse_of

   !> Gears without damping and backlash whose stiffness varies in resonance: the only periodic motion is unstable.
   pure function growing_gears() result(gears)
      !> The gear pair.
      type(gear_pair) :: gears

      gears = reference_gears()
      gears%bearing_damping = 0.0_wp
      gears%mesh%damping = 0.0_wp
      gears%mesh%half_backlash = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.9_wp
   end function growing_gears

   !> An unstable periodic motion is not a steady motion.
   subroutine test_unstable(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(collocation_map) :: map
      type(no_attendant) :: nobody
      type(steady_motion) :: motion

      call load(map, growing_gears(), flexible_point(8.0e3_wp, 1.0e7_wp), 32, error)
      if (allocated(error)) return
      call find_steady_motion(map, static_state(map), solver_options(max_periods=50), nobody, motion)
      call check(error, motion%periods, 0, 'periods')
      if (allocated(error)) return
      call check(error, motion%status /= status_settled, 'status')
   end subroutine test_unstable

   !> Many points and starts: a long transient from the same start ends on the motion that was found.
   subroutine test_transient(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> On these supports a transient loses two in a hundred every period.
      real(wp), parameter :: softest = 7.0_wp, stiffest = 12.0_wp
      integer, parameter :: points = 50, periods = 2000, enough = 40
      !> Share of the motion that is left of the slowest transients and of those near bifurcations.
      real(wp), parameter :: tolerance = 1.0e-2_wp
      type(collocation_map) :: map
      type(gear_pair) :: gears
      type(operating_point) :: point
      type(no_attendant) :: nobody
      type(steady_motion) :: motion
      type(random_stream) :: random
      real(wp), allocatable :: start(:), state(:), position(:), velocity(:)
      real(wp) :: speed, exponent, excitation
      integer :: i, k, used

      random = random_stream(101_i8)
      used = 0
      do i = 1, points
         call random%uniform(300.0_wp, 5000.0_wp, speed)
         call random%uniform(softest, stiffest, exponent)
         call random%uniform(2.0e-6_wp, 1.0e-5_wp, excitation)
         gears = reference_gears()
         gears%mesh%error_amplitudes = excitation
         point = flexible_point(speed, 10.0_wp**exponent)
         if (mod(i, 5) == 0) point = rigid_point(speed)
         call load(map, gears, point, 16, error)
         if (allocated(error)) return
         start = static_state(map)
         if (mod(i, 2) == 0) then
            call map%from_state(start, position, velocity)
            call random%fill(-1.0e-5_wp, 1.0e-5_wp, position)
            call random%fill(-0.2_wp, 0.2_wp, velocity)
            start = map%to_state(position, velocity)
         end if
         call find_steady_motion(map, start, solver_options(), nobody, motion)
         if (motion%status /= status_settled .or. motion%periods == 0) cycle
         used = used + 1
         state = start
         do k = 1, periods
            call map%advance(state)
         end do
         call check(error, distance_to(map, motion, state), 0.0_wp, tolerance)
         if (allocated(error)) return
      end do
      call check(error, used >= enough, 'most motions are periodic')
   end subroutine test_transient

   !> Points with subharmonics, by both integrators: no proper part of the period repeats, and none of the multipliers grows.
   subroutine test_shortest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speeds(8) = [1500.0_wp, 2800.0_wp, 4000.0_wp, 5200.0_wp, 5400.0_wp, 5550.0_wp, 5800.0_wp, 6000.0_wp]
      !> Of the converged Newton iteration, and far below any subharmonic, relative.
      real(wp), parameter :: repeated = 1.0e-7_wp, different = 1.0e-4_wp
      type(collocation_map), target :: collocation
      type(newmark_map), target :: newmark
      class(period_map), pointer :: map
      type(no_attendant) :: nobody
      type(steady_motion) :: motion
      real(wp), allocatable :: state(:)
      real(wp) :: scale, away
      integer :: i, k, method, subharmonic

      do method = 1, 2
         if (method == 1) map => collocation
         if (method == 2) map => newmark
         subharmonic = 0
         do i = 1, size(speeds)
            call load(map, reference_gears(), rigid_point(speeds(i)), merge(16, 128, method == 1), error)
            if (allocated(error)) return
            call find_steady_motion(map, static_state(map), solver_options(), nobody, motion)
            if (motion%status /= status_settled .or. motion%periods == 0) cycle
            if (motion%periods > 1) subharmonic = subharmonic + 1
            call check(error, motion%floquet_magnitude > 0.0_wp .and. motion%floquet_magnitude < 1.0_wp, 'stable')
            if (allocated(error)) return
            scale = weighted_norm(map%weight, motion%state)
            state = motion%state
            do k = 1, motion%periods
               call map%advance(state)
               away = weighted_norm(map%weight, state - motion%state)
               if (k < motion%periods .and. mod(motion%periods, k) == 0) then
                  call check(error, away > different*scale, 'does not repeat before')
               else if (k == motion%periods) then
                  call check(error, away, 0.0_wp, repeated*scale, 'repeats')
               end if
               if (allocated(error)) return
            end do
         end do
         call check(error, subharmonic >= 3, 'some are subharmonic')
         if (allocated(error)) return
      end do
   end subroutine test_shortest

   !> The gear pair of Kahraman and Singh (J. Sound Vib. 142 (1990) 49) at W = speed/1000: z = 0.05, Fm = Fa = 0.1.
   pure subroutine kahraman_singh(speed, equations)
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> Equations of motion.
      type(equations_type), intent(out) :: equations

      real(wp), parameter :: natural = 2.0_wp*pi*1000.0_wp, half_backlash = 1.0e-5_wp
      type(gear_pair) :: gears
      real(wp) :: torque

      gears = reference_gears()
      gears%teeth_1 = 60
      gears%base_radius = 0.05_wp
      gears%inertia = 0.005_wp
      gears%bearing_stiffness = 4.0e11_wp
      gears%bearing_damping = 4.0e5_wp
      gears%mesh%mean_stiffness = natural**2
      gears%mesh%stiffness_coefficients = 0.0_wp
      gears%mesh%error_amplitudes = 0.1_wp*half_backlash
      gears%mesh%error_phases = -0.5_wp*pi
      gears%mesh%damping = 2.0_wp*0.05_wp*natural
      gears%mesh%half_backlash = half_backlash
      torque = 0.1_wp*natural**2*half_backlash/20.0_wp
      equations = new_equations(gears, reference_box(), load_type(torque, torque), rigid_point(speed))
   end subroutine kahraman_singh

   !> Between 585.3 and 731.4 there are two motions: from below the linear one, from above the one that parts the teeth.
   subroutine test_branches(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: step = 10.0_wp
      type(collocation_map) :: map
      type(no_attendant) :: nobody
      type(steady_motion) :: motion
      type(equations_type) :: equations
      type(library_error), allocatable :: fault
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: speed
      integer :: direction, i
      logical :: parts

      do direction = 1, -1, -2
         speed = 650.0_wp - real(direction, wp)*12.0_wp*step
         do i = 1, 13
            call kahraman_singh(speed, equations)
            call map%load(equations, 16, fault)
            call check(error, .not. allocated(fault), 'load')
            if (allocated(error)) return
            if (i == 1) then
               position = spread(0.0_wp, 1, equations%n)
               velocity = position
            end if
            call find_steady_motion(map, map%to_state(position, velocity), solver_options(), nobody, motion)
            call check(error, motion%status, status_settled, 'status')
            if (allocated(error)) return
            call check(error, motion%periods, 1, 'periods')
            if (allocated(error)) return
            call map%from_state(motion%state, position, velocity)
            speed = speed + real(direction, wp)*step
         end do
         call map%advance(motion%state)
         parts = map%smallest_deflection < map%half_backlash
         call check(error, parts .eqv. direction == -1, 'the branch')
         if (allocated(error)) return
      end do
   end subroutine test_branches

   !> A motion of many periods cannot be told in a few.
   subroutine test_not_settled(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: most = 16
      type(collocation_map) :: map
      type(no_attendant) :: nobody
      type(steady_motion) :: motion

      call load(map, reference_gears(), rigid_point(4900.0_wp), 16, error)
      if (allocated(error)) return
      call find_steady_motion(map, static_state(map), solver_options(max_periods=most), nobody, motion)
      call check(error, motion%status, status_not_settled, 'status')
      if (allocated(error)) return
      call check(error, motion%motion, motion_unresolved, 'motion')
      if (allocated(error)) return
      call check(error, size(motion%state), map%size, 'a state to measure from')
   end subroutine test_not_settled

   !> A motion that grows without end.
   subroutine test_diverged(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(newmark_map) :: map
      type(no_attendant) :: nobody
      type(steady_motion) :: motion

      call load(map, growing_gears(), flexible_point(8.0e3_wp, 1.0e7_wp), 128, error)
      if (allocated(error)) return
      call find_steady_motion(map, static_state(map), solver_options(max_periods=100000), nobody, motion)
      call check(error, motion%status, status_diverged, 'status')
      if (allocated(error)) return
      call check(error, motion%motion, motion_unresolved, 'motion')
   end subroutine test_diverged

   !> Whoever waits is let in about once a period.
   subroutine test_visitor(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(collocation_map) :: map
      type(counter) :: visitor
      type(steady_motion) :: motion

      call load(map, reference_gears(), rigid_point(4900.0_wp), 16, error)
      if (allocated(error)) return
      call find_steady_motion(map, static_state(map), solver_options(max_periods=200), visitor, motion)
      call check(error, visitor%times >= 200)
   end subroutine test_visitor

end module test_steady
