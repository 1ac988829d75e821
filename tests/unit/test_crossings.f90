!> Where a step leaves its branch of the contact, and motions with contact lost against another method.
module test_crossings
   use cases, only: balanced_load, flexible_point, reference_box, reference_gears, rigid_point
   use pseudo_random, only: random_stream
   use runge_kutta, only: new_runge_kutta, runge_kutta_type
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_branch, only: branch_of, first_crossing, refine_crossing
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_exponential, only: lagrange, node, nodes
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_crossings

   !> Half of the backlash in the tests of polynomials, and its borders.
   real(wp), parameter :: b = 1.0_wp

   !> A few operations with numbers of size one.
   real(wp), parameter :: roundoff = 1.0e-12_wp

contains

   !> The tests of this suite.
   subroutine collect_crossings(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('branch of a deflection', test_branch), &
                  new_unittest('a plain crossing of every border', test_plain), &
                  new_unittest('no backlash: from flank to flank', test_no_backlash), &
                  new_unittest('a dip anywhere in the step', test_dip), &
                  new_unittest('contact that is only touched is kept', test_touch), &
                  new_unittest('random polynomials against a fine scan', test_random), &
                  new_unittest('the first of several crossings', test_first), &
                  new_unittest('a crossing is refined', test_refine), &
                  new_unittest('a crossing without a slope is left alone', test_refine_flat), &
                  new_unittest('contact lost, against Runge-Kutta', test_contact_lost), &
                  new_unittest('both flanks, against Runge-Kutta', test_both_flanks), &
                  new_unittest('no backlash, against Runge-Kutta', test_linear) &
                  ]
   end subroutine collect_crossings

   !> Borders belong to the flanks; without backlash there is no gap.
   subroutine test_branch(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: deflection(5) = [-2.0_wp, -1.0_wp, 0.0_wp, 1.0_wp, 2.0_wp]
      integer, parameter :: expected(5) = [-1, -1, 0, 1, 1], without_gap(5) = [-1, -1, 1, 1, 1]
      integer :: i

      do i = 1, size(deflection)
         call check(error, branch_of(deflection(i), b), expected(i), 'branch at '//to_text(deflection(i)))
         if (allocated(error)) return
         call check(error, branch_of(deflection(i), 0.0_wp), without_gap(i), 'without backlash at '//to_text(deflection(i)))
         if (allocated(error)) return
      end do
   end subroutine test_branch

   !> A straight line from one side of a border to the other.
   subroutine test_plain(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: from(4) = [1, 0, 0, -1], to(4) = [0, 1, -1, 0]
      real(wp), parameter :: place(5) = [1.0e-9_wp, 0.01_wp, 0.5_wp, 0.97_wp, 0.999999_wp]
      real(wp) :: found, border, side
      integer :: next, i, k

      do i = 1, size(from)
         border = b*real(from(i) + to(i), wp)
         side = real(to(i) - from(i), wp)
         do k = 1, size(place)
            call first_crossing(from(i), border + side*(node - place(k)), b, found, next)
            call check(error, next, to(i), 'branch behind a crossing at '//to_text(place(k)))
            if (allocated(error)) return
            call check(error, found, place(k), roundoff, 'place')
            if (allocated(error)) return
            call first_crossing(from(i), border - side*(node + place(k)), b, found, next)
            call check(error, next, from(i), 'away from the border')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_plain

   !> Without backlash contact passes from one flank to the other.
   subroutine test_no_backlash(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: found
      integer :: next

      call first_crossing(1, 0.3_wp - node, 0.0_wp, found, next)
      call check(error, next, -1, 'to the back flank')
      if (allocated(error)) return
      call check(error, found, 0.3_wp, roundoff, 'place')
      if (allocated(error)) return
      call first_crossing(-1, node - 0.3_wp, 0.0_wp, found, next)
      call check(error, next, 1, 'and back')
   end subroutine test_no_backlash

   !> A parabola that dips below the border by a hair, wherever in the step: no grazing contact loss is passed over.
   subroutine test_dip(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Depth beside the height of the parabola over the step: a thousandth of a step long.
      real(wp), parameter :: depth = 2.5e-7_wp
      integer, parameter :: places = 400
      real(wp) :: vertex, found
      integer :: next, k

      do k = 1, places - 1
         vertex = real(k, wp)/real(places, wp)
         call first_crossing(1, b + (node - vertex)**2 - depth, b, found, next)
         call check(error, next, 0, 'a dip at '//to_text(vertex)//' of the step')
         if (allocated(error)) return
         ! A double zero as near as this is known to the root of round-off.
         call check(error, found, vertex - sqrt(depth), sqrt(roundoff), 'where it begins')
         if (allocated(error)) return
         call first_crossing(0, b - (node - vertex)**2 + depth, b, found, next)
         call check(error, next, 1, 'a touch from the gap at '//to_text(vertex)//' of the step')
         if (allocated(error)) return
      end do
   end subroutine test_dip

   !> A parabola whose vertex stays above the border by a hair does not cross it.
   subroutine test_touch(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: places = 100
      real(wp) :: vertex, found
      integer :: next, k

      do k = 0, places
         vertex = real(k, wp)/real(places, wp)
         call first_crossing(1, b + (node - vertex)**2 + roundoff, b, found, next)
         call check(error, next, 1, 'no crossing at '//to_text(vertex)//' of the step')
         if (allocated(error)) return
      end do
   end subroutine test_touch

   !> Polynomials of degree four through random values, looked at in many places.
   subroutine test_random(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: draws = 2000, scan = 2000, enough = 500
      type(random_stream) :: random
      real(wp) :: clearance(nodes), found, first, u
      integer :: next, k, i, crossings

      crossings = 0
      do k = 1, draws
         call random%fill(-0.3_wp, 1.0_wp, clearance)
         clearance(1) = abs(clearance(1))
         call first_crossing(1, b + clearance, b, found, next)
         first = 1.0_wp
         do i = 1, scan
            u = real(i, wp)/real(scan, wp)
            if (value(clearance, u) < 0.0_wp) then
               first = u
               exit
            end if
         end do
         if (first < 1.0_wp) then
            crossings = crossings + 1
            call check(error, found <= first, 'crossing of draw '//to_text(k)//' is not passed over')
            if (allocated(error)) return
         end if
         if (next /= 1) call check(error, abs(value(clearance, found)), 0.0_wp, roundoff, 'a zero in draw '//to_text(k))
         if (allocated(error)) return
      end do
      call check(error, crossings >= enough, 'many of the polynomials cross')

   contains

      !> Value of the polynomial.
      pure function value(at_nodes, place)
         !> Its values at the points.
         real(wp), intent(in) :: at_nodes(nodes)
         !> The place.
         real(wp), intent(in) :: place
         !> The value.
         real(wp) :: value

         integer :: m

         value = 0.0_wp
         do m = nodes - 1, 0, -1
            value = value*place + sum(lagrange(m, :)*at_nodes)
         end do
      end function value

   end subroutine test_random

   !> From the gap to the back flank first, then to the front flank.
   subroutine test_first(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: found, lowest
      integer :: next

      ! delta = 16 (u - 1/4)^2 - 1.5 reaches -1 going down at 1/4 - sqrt(0.5)/4 and +1 going up at 1/4 + sqrt(2.5)/4.
      call first_crossing(0, 16.0_wp*(node - 0.25_wp)**2 - 1.5_wp, b, found, next)
      lowest = 0.25_wp - 0.25_wp*sqrt(0.5_wp)
      call check(error, next, -1, 'the back flank comes first')
      if (allocated(error)) return
      call check(error, found, lowest, roundoff, 'place')
      if (allocated(error)) return
      call first_crossing(0, 1.5_wp - 16.0_wp*(node - 0.25_wp)**2, b, found, next)
      call check(error, next, 1, 'mirrored, the front flank')
   end subroutine test_first

   !> Newton's step on the length of the part before the crossing.
   subroutine test_refine(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The part is 1e-3 too long: the square of that is left.
      real(wp), parameter :: exact = 0.4_wp, guess = exact*(1.0_wp + 1.0e-3_wp), left_over = 1.0e-6_wp
      real(wp) :: length, miss

      length = guess
      call refine_crossing(1, 0, b + exact**2 - (length*node)**2, b, 1.0_wp, length, miss)
      call check(error, miss, exact**2 - guess**2, roundoff, 'miss')
      if (allocated(error)) return
      call check(error, length, exact, left_over, 'length, leaving contact')
      if (allocated(error)) return
      length = guess
      call refine_crossing(0, -1, -b + exact**2 - (length*node)**2, b, 1.0_wp, length, miss)
      call check(error, length, exact, left_over, 'length, reaching the back flank')
   end subroutine test_refine

   !> A step of Newton's method that leads out of the step, or divides by nothing, is not taken.
   subroutine test_refine_flat(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: guess = 0.5_wp
      real(wp) :: length, miss, deflection(nodes)

      deflection = b + 0.25_wp
      length = guess
      call refine_crossing(1, 0, deflection, b, 1.0_wp, length, miss)
      call check(error, length, guess, tiny(1.0_wp), 'no slope')
      if (allocated(error)) return
      ! The border lies 0.3 behind a part of 0.5, but only 0.6 are left.
      length = guess
      call refine_crossing(1, 0, b + 0.3_wp - (node - 1.0_wp)*guess, b, 0.6_wp, length, miss)
      call check(error, length, guess, tiny(1.0_wp), 'out of the step')
   end subroutine test_refine_flat

   !> Contact lost at the reference case.
   subroutine test_contact_lost(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare(reference_gears(), 110.0_wp, 2600.0_wp, error)
   end subroutine test_contact_lost

   !> Little torque and much transmission error: the teeth rattle from flank to flank.
   subroutine test_both_flanks(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears

      gears = reference_gears()
      gears%mesh%error_amplitudes = 3.0e-5_wp
      call compare(gears, 11.0_wp, 2600.0_wp, error)
   end subroutine test_both_flanks

   !> Without backlash the mesh is linear, whichever flank carries.
   subroutine test_linear(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears

      gears = reference_gears()
      gears%mesh%half_backlash = 0.0_wp
      call compare(gears, 11.0_wp, 2600.0_wp, error)
   end subroutine test_linear

   !> Two periods from the static equilibrium, on both supports, by collocation and by Runge-Kutta.
   subroutine compare(gears, torque, speed, error)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Driving torque [N m].
      real(wp), intent(in) :: torque
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Runge-Kutta steps over a border lose a share of (w h)^2 = (0.002)^2 of the motion each; measured 2e-7.
      real(wp), parameter :: tolerance = 1.0e-6_wp
      integer, parameter :: periods = 2, coarse = 32, fine = 16384
      type(collocation_map) :: map
      type(runge_kutta_type) :: method
      type(equations_type) :: equations(2)
      type(library_error), allocatable :: fault
      real(wp), allocatable :: position(:), velocity(:), state(:), exact(:)
      integer :: i, k, n

      equations(1) = new_equations(gears, reference_box(), balanced_load(gears, torque), rigid_point(speed))
      equations(2) = new_equations(gears, reference_box(), balanced_load(gears, torque), flexible_point(speed, 2.5e8_wp))
      do i = 1, size(equations)
         n = equations(i)%n
         call map%load(equations(i), coarse, fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
         method = new_runge_kutta(equations(i), fine)
         exact = spread(0.0_wp, 1, 2*n)
         state = map%to_state(exact(:n), exact(:n))
         do k = 1, periods
            call map%advance(state)
            call method%advance(exact)
         end do
         call map%from_state(state, position, velocity)
         call check(error, maxval(abs(position - exact(:n))), 0.0_wp, tolerance*maxval(abs(exact(:n))), 'position')
         if (allocated(error)) return
         call check(error, maxval(abs(velocity - exact(n + 1:))), 0.0_wp, tolerance*maxval(abs(exact(n + 1:))), 'velocity')
         if (allocated(error)) return
      end do
   end subroutine compare

end module test_crossings
