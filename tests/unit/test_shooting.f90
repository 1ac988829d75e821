!> Monodromy, Floquet multipliers and Newton's method on the period map, by both integrators.
module test_shooting
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use period_maps, only: largest_multiplier, load_map, method_names, methods
   use pseudo_random, only: random_stream
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_options, only: integrator_collocation
   use spurflex_integrate_period_map, only: period_map
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_steady_lyapunov, only: lyapunov_sum, unknown
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: floquet_multipliers, periodic_orbit
   use spurflex_steady_shooting, only: advance_periods, find_orbit
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_shooting

   !> Steps per mesh period of each method.
   integer, parameter :: steps(2) = [128, 32]

   !> Size of the motions [m].
   real(wp), parameter :: motion_size = 1.0e-5_wp

contains

   !> The tests of this suite.
   subroutine collect_shooting(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('monodromy against differences, contact kept', test_monodromy_kept), &
                  new_unittest('monodromy against differences, contact lost', test_monodromy_lost), &
                  new_unittest('product of the multipliers', test_product), &
                  new_unittest('an affine map takes one iteration', test_affine), &
                  new_unittest('the orbit of one period is fixed', test_fixed), &
                  new_unittest('2T stable beside an unstable 1T', test_two_periods), &
                  new_unittest('onset of 2T, rigid support', test_onset_rigid), &
                  new_unittest('onset of 2T, flexible support', test_onset_flexible), &
                  new_unittest('exponent of a periodic motion', test_exponent), &
                  new_unittest('exponent of a growth that wanders', test_wandering), &
                  new_unittest('nothing is found far from any motion', test_hopeless) &
                  ]
   end subroutine collect_shooting

   !> The reference case on a rigid or a flexible support.
   pure function reference_equations(is_rigid, speed) result(equations)
      !> The support is rigid.
      logical, intent(in) :: is_rigid
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> Equations of motion.
      type(equations_type) :: equations

      if (is_rigid) then
         equations = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speed))
      else
         equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(speed, 2.5e8_wp))
      end if
   end function reference_equations

   !> Where contact is kept the map is affine: differences are exact, whatever their length.
   subroutine test_monodromy_kept(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_differences(900.0_wp, 1.0e-7_wp, .true., error)
   end subroutine test_monodromy_kept

   !> Where contact is lost the crossings move with the state.
   subroutine test_monodromy_lost(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_differences(2600.0_wp, 1.0e-12_wp, .false., error)
   end subroutine test_monodromy_lost

   !> Compare the monodromy with central differences.
   subroutine compare_differences(speed, length, is_kept, error)
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> Length of the differences in units of the weights [m].
      real(wp), intent(in) :: length
      !> Contact is kept.
      logical, intent(in) :: is_kept
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off of a motion of 1e-5 m over a difference of 1e-12 m, and the change of the crossings over it.
      real(wp), parameter :: tolerance = 1.0e-6_wp
      class(period_map), allocatable :: map
      type(periodic_orbit) :: orbit
      type(no_attendant) :: nobody
      real(wp), allocatable :: ahead(:), behind(:), column(:), scale(:)
      integer :: k, i, support
      logical :: found

      do support = 1, 2
         do k = 1, size(methods)
            call load_map(methods(k), reference_equations(support == 1, speed), steps(k), map, error)
            if (allocated(error)) return
            call settle(map, orbit, found)
            call check(error, found, 'a motion with '//method_names(k))
            if (allocated(error)) return
            call check(error, orbit%smallest >= map%half_backlash .eqv. is_kept, 'contact as expected')
            if (allocated(error)) return
            ! A component that no weight counts is moved like a coordinate that does.
            scale = merge(map%weight, maxval(map%weight), map%weight > 0.0_wp)
            do i = 1, map%size
               ahead = orbit%state
               behind = orbit%state
               ahead(i) = ahead(i) + length/scale(i)
               behind(i) = behind(i) - length/scale(i)
               call map%advance(ahead)
               call map%advance(behind)
               column = 0.5_wp*(ahead - behind)/length*scale(i)
               call check(error, weighted_norm(map%weight, column - orbit%monodromy(:, i))/scale(i), 0.0_wp, tolerance, &
                          method_names(k)//', column '//to_text(i))
               if (allocated(error)) return
            end do
         end do
      end do

   contains

      !> The motion of one period that the static equilibrium leads to.
      subroutine settle(map, orbit, found)
         !> Map.
         class(period_map), intent(inout) :: map
         !> The motion.
         type(periodic_orbit), intent(out) :: orbit
         !> There is one.
         logical, intent(out) :: found

         real(wp) :: state(map%size)

         state = 0.0_wp
         call advance_periods(map, 60, state)
         call find_orbit(map, state, 1, motion_size, nobody, orbit, found)
      end subroutine settle

   end subroutine compare_differences

   !> Liouville's formula: the product of the multipliers is exp(T trace) with the trace of the first-order system, mesh
   !> damping included, whatever the contact does; with all the modes in, and with the modes left out taken off.
   subroutine test_product(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Relative, on the logarithm of the product.
      real(wp), parameter :: tolerance = 1.0e-8_wp
      real(wp), parameter :: speed(3) = [900.0_wp, 2600.0_wp, 5500.0_wp]
      type(collocation_map) :: map
      type(library_error), allocatable :: fault
      type(equations_type) :: equations
      complex(wp), allocatable :: multipliers(:)
      real(wp), allocatable :: state(:), tangents(:, :), kept(:, :)
      real(wp) :: trace
      integer, allocatable :: place(:)
      integer :: i, k, support, m

      do support = 1, 2
         do k = 1, size(speed)
            equations = reference_equations(support == 1, speed(k))
            call map%load(equations, 64, fault)
            if (allocated(fault)) then
               call test_failed(error, fault%message)
               return
            end if
            m = map%modal%modes
            trace = 2.0_wp*sum(real(map%modal%rate, wp), .not. map%modal%is_real) + sum(real(map%modal%rate, wp), map%modal%is_real)
            call check(error, trace, full_trace(equations), tolerance*abs(trace), 'nothing is left out')
            if (allocated(error)) return
            ! Imaginary parts of real modes are no state.
            place = pack([(i, i=1, 2*m)], [spread(.true., 1, m), .not. map%modal%is_real])
            state = spread(0.0_wp, 1, map%size)
            if (allocated(tangents)) deallocate (tangents)
            allocate (tangents(map%size, map%size), source=0.0_wp)
            do i = 1, map%size
               tangents(i, i) = 1.0_wp
            end do
            call advance_periods(map, 1, state, tangents)
            kept = tangents(place, place)
            call floquet_multipliers(kept, multipliers, fault)
            if (allocated(fault)) then
               call test_failed(error, fault%message)
               return
            end if
            call check(error, sum(log(abs(multipliers))), trace*map%period, tolerance*abs(trace*map%period), &
                       'product at '//to_text(speed(k))//' rev/min')
            if (allocated(error)) return
         end do
      end do

   contains

      !> Trace of the first-order system.
      function full_trace(of) result(trace)
         !> Equations of motion.
         type(equations_type), intent(in) :: of
         !> The trace.
         real(wp) :: trace

         real(wp) :: matrix(of%n, of%n), inverse(of%n, of%n), unit(of%n)
         integer :: j

         matrix = of%mesh%damping*spread(of%direction, 2, of%n)*spread(of%direction, 1, of%n)
         do j = 1, of%n
            matrix(j, j) = matrix(j, j) + of%damping(j)
         end do
         do j = 1, of%n
            unit = 0.0_wp
            unit(j) = 1.0_wp
            inverse(:, j) = solve(of%mass, unit)
         end do
         trace = -sum(inverse*transpose(matrix))
      end function full_trace

   end subroutine test_product

   !> Contact kept: one Newton step is exact, from any start that keeps it; one more period shows that it does.
   subroutine test_affine(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Newton's system is conditioned by the slowest multiplier, 0.7.
      real(wp), parameter :: roundoff = 1.0e-12_wp
      integer, parameter :: one_iteration = 2
      class(period_map), allocatable :: map
      type(periodic_orbit) :: orbit
      type(no_attendant) :: nobody
      type(random_stream) :: random
      real(wp), allocatable :: state(:), again(:)
      integer :: k, support
      logical :: found

      do support = 1, 2
         do k = 1, size(methods)
            call load_map(methods(k), reference_equations(support == 1, 600.0_wp), steps(k), map, error)
            if (allocated(error)) return
            allocate (state(map%size))
            call random%fill(-1.0e-8_wp, 1.0e-8_wp, state)
            state = state/max(map%weight, 1.0_wp)
            call find_orbit(map, state, 1, motion_size, nobody, orbit, found)
            call check(error, found, 'found with '//method_names(k))
            if (allocated(error)) return
            call check(error, orbit%integrated, one_iteration, 'periods integrated with '//method_names(k))
            if (allocated(error)) return
            again = orbit%state
            call map%advance(again)
            call check(error, weighted_norm(map%weight, again - orbit%state), 0.0_wp, roundoff*motion_size, 'it is fixed')
            if (allocated(error)) return
            deallocate (state)
         end do
      end do
   end subroutine test_affine

   !> Contact lost: the state comes back after a period.
   subroutine test_fixed(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The tolerance of Newton's method.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      class(period_map), allocatable :: map
      type(periodic_orbit) :: orbit
      type(no_attendant) :: nobody
      real(wp), allocatable :: state(:), again(:)
      integer :: k
      logical :: found

      do k = 1, size(methods)
         call load_map(methods(k), reference_equations(.false., 3500.0_wp), steps(k), map, error)
         if (allocated(error)) return
         state = spread(0.0_wp, 1, map%size)
         call advance_periods(map, 40, state)
         call find_orbit(map, state, 1, motion_size, nobody, orbit, found)
         call check(error, found, 'found with '//method_names(k))
         if (allocated(error)) return
         again = orbit%state
         call map%advance(again)
         call check(error, weighted_norm(map%weight, again - orbit%state), 0.0_wp, tolerance*motion_size, 'it is fixed')
         if (allocated(error)) return
      end do
   end subroutine test_fixed

   !> At 5500 rev/min on a rigid support the motion repeats after two periods; the motion of one period is unstable.
   subroutine test_two_periods(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Sections of the 2T motion differ by far more than this share of its size.
      real(wp), parameter :: apart = 1.0e-2_wp
      class(period_map), allocatable :: map
      type(periodic_orbit) :: single, double
      type(no_attendant) :: nobody
      real(wp), allocatable :: position(:), velocity(:), state(:)
      real(wp) :: modulus
      complex(wp) :: multiplier
      logical :: found

      call follow(.true., 5300.0_wp, 5500.0_wp, position, velocity, map, single, error)
      if (allocated(error)) return
      call largest_multiplier(single, modulus, error, multiplier)
      if (allocated(error)) return
      call check(error, modulus > 1.0_wp, '1T is unstable')
      if (allocated(error)) return
      call check(error, real(multiplier, wp) < -1.0_wp, 'its multiplier has passed -1')
      if (allocated(error)) return

      state = map%to_state(position, velocity)
      state = state + 1.0e-7_wp/map%weight
      call advance_periods(map, 1000, state)
      call find_orbit(map, state, 2, motion_size, nobody, double, found)
      call check(error, found, '2T is found')
      if (allocated(error)) return
      call largest_multiplier(double, modulus, error)
      if (allocated(error)) return
      call check(error, modulus < 1.0_wp, '2T is stable')
      if (allocated(error)) return
      call map%advance(state)
      call check(error, weighted_norm(map%weight, state - double%state) > apart*motion_size, 'and not 1T')
   end subroutine test_two_periods

   !> Follow the motion of one period from one speed to another in steps of 10 rev/min.
   subroutine follow(is_rigid, from, to, position, velocity, map, orbit, error)
      !> The support is rigid.
      logical, intent(in) :: is_rigid
      !> Speeds [rev/min].
      real(wp), intent(in) :: from, to
      !> Section of the motion; where unallocated before, the static equilibrium leads to the first one.
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> Map of the last speed.
      class(period_map), allocatable, intent(inout) :: map
      !> The motion at the last speed.
      type(periodic_orbit), intent(out) :: orbit
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: step = 10.0_wp
      integer, parameter :: settling = 1500, fine = 64
      type(no_attendant) :: nobody
      real(wp), allocatable :: state(:)
      integer :: k, last
      logical :: found

      last = nint((to - from)/step)
      do k = 0, last
         call load_map(integrator_collocation, reference_equations(is_rigid, from + step*real(k, wp)), fine, map, error)
         if (allocated(error)) return
         if (allocated(position)) then
            state = map%to_state(position, velocity)
         else
            state = spread(0.0_wp, 1, map%size)
            call advance_periods(map, settling, state)
         end if
         call find_orbit(map, state, 1, motion_size, nobody, orbit, found)
         call check(error, found, '1T at '//to_text(from + step*real(k, wp))//' rev/min')
         if (allocated(error)) return
         call map%from_state(orbit%state, position, velocity)
      end do
   end subroutine follow

   !> Rigid support.
   subroutine test_onset_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check_onset(.true., 5300.0_wp, 5380.0_wp, error)
   end subroutine test_onset_rigid

   !> Flexible support.
   subroutine test_onset_flexible(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check_onset(.false., 5200.0_wp, 5440.0_wp, error)
   end subroutine test_onset_flexible

   !> A multiplier of 1T passes -1 between two speeds 10 rev/min apart; from there on 1T is left and 2T is where the motion goes.
   subroutine check_onset(is_rigid, from, last_stable, error)
      !> The support is rigid.
      logical, intent(in) :: is_rigid
      !> Where to begin, and the last of the speeds in steps of 10 rev/min at which 1T is stable.
      real(wp), intent(in) :: from, last_stable
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: step = 10.0_wp, kick = 1.0e-9_wp, same = 1.0e-4_wp
      class(period_map), allocatable :: map
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:), state(:), later(:)
      real(wp) :: modulus
      complex(wp) :: multiplier

      call follow(is_rigid, from, last_stable, position, velocity, map, orbit, error)
      if (allocated(error)) return
      call largest_multiplier(orbit, modulus, error)
      if (allocated(error)) return
      call check(error, modulus < 1.0_wp, '1T is stable before the onset')
      if (allocated(error)) return

      call follow(is_rigid, last_stable + step, last_stable + step, position, velocity, map, orbit, error)
      if (allocated(error)) return
      call largest_multiplier(orbit, modulus, error, multiplier)
      if (allocated(error)) return
      call check(error, modulus > 1.0_wp .and. real(multiplier, wp) < 0.0_wp, 'a multiplier has passed -1')
      if (allocated(error)) return
      state = orbit%state + kick/map%weight
      call advance_periods(map, 4000, state)
      later = state
      call map%advance(later)
      call check(error, weighted_norm(map%weight, later - state) > same*motion_size, '1T is left')
      if (allocated(error)) return
      call map%advance(later)
      call check(error, weighted_norm(map%weight, later - state), 0.0_wp, same*motion_size, 'for 2T')
   end subroutine check_onset

   !> A long tangent grows by the largest multiplier over n periods, and the standard error covers what is left.
   subroutine test_exponent(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The tangent turns with the phase of a complex multiplier: its logarithm wanders by a few units over 2048 periods.
      real(wp), parameter :: wandering = 5.0_wp
      integer, parameter :: settling = 200, summed = 2048
      class(period_map), allocatable :: map
      type(periodic_orbit) :: orbit
      type(no_attendant) :: nobody
      type(lyapunov_sum) :: growth
      real(wp), allocatable :: state(:), tangent(:, :)
      real(wp) :: modulus, exponent, exponent_error, wander
      integer :: k, periods, case_number
      logical :: found
      real(wp), parameter :: speed(3) = [900.0_wp, 2600.0_wp, 5500.0_wp]
      integer, parameter :: repeats(3) = [1, 1, 2]

      do case_number = 1, size(speed)
         call load_map(integrator_collocation, reference_equations(.true., speed(case_number)), steps(2), map, error)
         if (allocated(error)) return
         state = spread(0.0_wp, 1, map%size)
         call advance_periods(map, 2000, state)
         call find_orbit(map, state, repeats(case_number), motion_size, nobody, orbit, found)
         call check(error, found, 'a motion at '//to_text(speed(case_number))//' rev/min')
         if (allocated(error)) return
         call largest_multiplier(orbit, modulus, error)
         if (allocated(error)) return
         state = orbit%state
         tangent = spread([(1.0_wp/map%weight(k), k=1, map%size)], 1, 1)
         call growth%reset(summed)
         do k = 1, settling + summed
            call map%advance(state, tangent)
            if (k > settling) call growth%add(weighted_norm(map%weight, tangent(1, :)))
            tangent = tangent/weighted_norm(map%weight, tangent(1, :))
         end do
         call growth%exponent(exponent, exponent_error, periods, wander)
         call check(error, exponent, log(modulus)/real(repeats(case_number), wp), wandering/real(periods, wp), &
                    'exponent at '//to_text(speed(case_number))//' rev/min')
         if (allocated(error)) return
         call check(error, exponent_error, 0.0_wp, wandering/real(periods, wp), 'and its error')
         if (allocated(error)) return
      end do
   end subroutine test_exponent

   !> On a torus the logarithm of a tangent only wanders, here by a cosine of the golden mean: its weighted mean tells the rate that
   !> is added to it, to many digits more than the mean does, once all that was planned is seen.
   subroutine test_wandering(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: planned = 384, late = 3
      real(wp), parameter :: rates(3) = [0.0_wp, 0.01_wp, -0.02_wp], half_range = 2.0_wp, tolerance = 1.0e-8_wp
      real(wp), parameter :: turn = 2.0_wp*pi*(sqrt(5.0_wp) - 1.0_wp)/2.0_wp
      type(lyapunov_sum) :: growth
      real(wp) :: exponent, exponent_error, wander
      integer :: i, k, periods

      do i = 1, size(rates)
         call growth%reset(planned)
         do k = 1, planned + late
            call growth%add(exp(rates(i) + half_range*(cos(turn*real(k, wp)) - cos(turn*real(k - 1, wp)))))
            if (k /= planned - 1) cycle
            call growth%smooth_exponent(exponent, exponent_error)
            call check(error, exponent_error >= unknown, 'unknown before the end')
            if (allocated(error)) return
         end do
         call growth%smooth_exponent(exponent, exponent_error)
         call check(error, exponent, rates(i), tolerance, 'weighted mean')
         if (allocated(error)) return
         call check(error, exponent_error, 0.0_wp, tolerance, 'its error')
         if (allocated(error)) return
         call growth%exponent(exponent, exponent_error, periods, wander)
         call check(error, exponent, rates(i), 2.0_wp*half_range/real(planned, wp), 'mean')
         if (allocated(error)) return
         call check(error, wander <= 2.0_wp*half_range + abs(rates(i))*real(planned + late, wp), 'range of the growth')
         if (allocated(error)) return
      end do
   end subroutine test_wandering

   !> A start that is no motion at all, far out, ends without one or with one that is fixed; never with nonsense.
   subroutine test_hopeless(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: tolerance = 1.0e-6_wp
      class(period_map), allocatable :: map
      type(periodic_orbit) :: orbit
      type(no_attendant) :: nobody
      type(random_stream) :: random
      real(wp), allocatable :: state(:), again(:)
      integer :: k, draw
      logical :: found

      do k = 1, size(methods)
         call load_map(methods(k), reference_equations(.true., 4890.0_wp), steps(k), map, error)
         if (allocated(error)) return
         do draw = 1, 10
            state = spread(0.0_wp, 1, map%size)
            call random%fill(-1.0e-3_wp, 1.0e-3_wp, state)
            state = state/max(map%weight, 1.0_wp)
            call find_orbit(map, state, 1, motion_size, nobody, orbit, found)
            if (.not. found) cycle
            again = orbit%state
            call map%advance(again)
            call check(error, weighted_norm(map%weight, again - orbit%state), 0.0_wp, tolerance*motion_size, &
                       'what is found is a motion')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_hopeless

end module test_shooting
