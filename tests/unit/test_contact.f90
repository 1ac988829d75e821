!> The exact mesh force of a step: it solves its equation on every branch.
module test_contact
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: wp, i8
   use spurflex_integrate_contact, only: contact_force
   use spurflex_model_mesh, only: backlash_deflection
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_contact

   !> Draws side by side.
   integer, parameter :: many = 8

contains

   !> The tests of this suite.
   subroutine collect_contact(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('solves its equation on all branches', test_random), &
                  new_unittest('no backlash', test_no_backlash), &
                  new_unittest('explicit limit is Eq. 5', test_explicit), &
                  new_unittest('continuous at the borders of the branches', test_borders), &
                  new_unittest('odd', test_odd), &
                  new_unittest('derivatives of the force', test_derivatives) &
                  ]
   end subroutine collect_contact

   !> Largest residual of f = c (v - h_v f) + k phi(d - h_d f), relative to its terms.
   pure function residual(d, v, k, c, b, h_d, h_v, force) result(largest)
      !> Deflection and rate without mesh force.
      real(wp), intent(in) :: d(many), v(many)
      !> Stiffness, damping, half of the backlash.
      real(wp), intent(in) :: k, c, b
      !> What a unit force takes from deflection and rate.
      real(wp), intent(in) :: h_d(many), h_v(many)
      !> Force.
      real(wp), intent(in) :: force(many)
      !> The residual.
      real(wp) :: largest

      real(wp), dimension(many) :: right, scale

      right = c*(v - h_v*force) + k*backlash_deflection(d - h_d*force, b)
      scale = c*(abs(v) + h_v*abs(force)) + k*(abs(d) + h_d*abs(force) + b)
      largest = maxval(abs(force - right)/scale)
   end function residual

   !> Numbers of the size that gears have, and far from it; all three branches occur many times.
   subroutine test_random(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> A few operations.
      real(wp), parameter :: roundoff = 1.0e-14_wp
      integer, parameter :: draws = 1000, enough = 500
      type(random_stream) :: random
      real(wp), dimension(many) :: d, v, h_d, h_v, force, exponent, by_d, by_v
      real(wp) :: k, c, b
      integer :: i, branches(-1:1)

      random = random_stream(3_i8)
      branches = 0
      do i = 1, draws
         call random%uniform(1.0e7_wp, 1.0e9_wp, k)
         call random%uniform(0.0_wp, 1.0e4_wp, c)
         call random%uniform(1.0e-6_wp, 1.0e-5_wp, b)
         call random%fill(-3.0e-5_wp, 3.0e-5_wp, d)
         call random%fill(-0.1_wp, 0.1_wp, v)
         call random%fill(-14.0_wp, -7.0_wp, exponent)
         h_d = 10.0_wp**exponent
         call random%fill(-10.0_wp, -2.0_wp, exponent)
         h_v = 10.0_wp**exponent
         call contact_force(d, v, k, c, b, h_d, h_v, force, by_d, by_v)
         call check(error, residual(d, v, k, c, b, h_d, h_v, force), 0.0_wp, roundoff)
         if (allocated(error)) return
         branches(-1) = branches(-1) + count(d - h_d*force <= -b)
         branches(1) = branches(1) + count(d - h_d*force >= b)
         branches(0) = branches(0) + count(abs(d - h_d*force) < b)
      end do
      call check(error, minval(branches) >= enough, 'every branch occurs')
   end subroutine test_random

   !> b = 0: the linear spring and damper, in closed form.
   subroutine test_no_backlash(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: roundoff = 1.0e-14_wp, k = 3.2e8_wp, c = 2.0e3_wp
      type(random_stream) :: random
      real(wp), dimension(many) :: d, v, h_d, h_v, force, expected, by_d, by_v
      integer :: i

      random = random_stream(5_i8)
      do i = 1, 200
         call random%fill(-3.0e-5_wp, 3.0e-5_wp, d)
         call random%fill(-0.1_wp, 0.1_wp, v)
         call random%fill(0.0_wp, 1.0e-9_wp, h_d)
         call random%fill(0.0_wp, 1.0e-4_wp, h_v)
         call contact_force(d, v, k, c, 0.0_wp, h_d, h_v, force, by_d, by_v)
         expected = (c*v + k*d)/(1.0_wp + c*h_v + k*h_d)
         call check(error, maxval(abs(force - expected)), 0.0_wp, roundoff*(c*0.1_wp + k*3.0e-5_wp))
         if (allocated(error)) return
      end do
   end subroutine test_no_backlash

   !> Where a force takes nothing away, the force is that of Eq. (5).
   subroutine test_explicit(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: roundoff = 1.0e-14_wp, k = 3.2e8_wp, c = 2.0e3_wp, b = 1.0e-5_wp
      type(random_stream) :: random
      real(wp), dimension(many) :: d, v, zero, force, expected, by_d, by_v

      random = random_stream(17_i8)
      zero = 0.0_wp
      call random%fill(-3.0e-5_wp, 3.0e-5_wp, d)
      call random%fill(-0.1_wp, 0.1_wp, v)
      call contact_force(d, v, k, c, b, zero, zero, force, by_d, by_v)
      expected = c*v + k*backlash_deflection(d, b)
      call check(error, maxval(abs(force - expected)), 0.0_wp, roundoff*k*b)
   end subroutine test_explicit

   !> A free deflection just inside and just outside of the gap gives nearly the same force, on both sides.
   subroutine test_borders(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: k = 3.2e8_wp, c = 2.0e3_wp, b = 1.0e-5_wp, hd = 1.0e-10_wp, hv = 1.0e-5_wp, v = 0.02_wp
      !> The force is a few tens of newtons.
      real(wp), parameter :: roundoff = 1.0e-12_wp
      real(wp), dimension(many) :: d, force, width, by_d, by_v
      real(wp) :: gap_force, border
      integer :: i, side

      gap_force = c*v/(1.0_wp + c*hv)
      do side = -1, 1, 2
         border = real(side, wp)*b + hd*gap_force
         do i = 1, 30
            width = b*2.0_wp**(-i)
            d = border
            d(1) = border - width(1)
            d(2) = border + width(2)
            call contact_force(d, spread(v, 1, many), k, c, b, spread(hd, 1, many), spread(hv, 1, many), force, by_d, by_v)
            call check(error, force(3), gap_force, roundoff, 'on the border')
            if (allocated(error)) return
            ! The force grows with the free deflection, at no more than the stiffness of the teeth.
            call check(error, force(2) >= force(1) .and. force(2) - force(1) <= 2.0_wp*k*width(1) + roundoff, 'across it')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_borders

   !> Front and back flank are alike.
   subroutine test_odd(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: k = 3.2e8_wp, c = 2.0e3_wp, b = 1.0e-5_wp
      type(random_stream) :: random
      real(wp), dimension(many) :: d, v, h_d, h_v, force, mirrored, by_d, by_v

      random = random_stream(19_i8)
      call random%fill(-3.0e-5_wp, 3.0e-5_wp, d)
      call random%fill(-0.1_wp, 0.1_wp, v)
      call random%fill(0.0_wp, 1.0e-9_wp, h_d)
      call random%fill(0.0_wp, 1.0e-4_wp, h_v)
      call contact_force(d, v, k, c, b, h_d, h_v, force, by_d, by_v)
      call contact_force(-d, -v, k, c, b, h_d, h_v, mirrored, by_d, by_v)
      call check(error, all(abs(force + mirrored) <= 0.0_wp))
   end subroutine test_odd

   !> The derivatives by d and v equal differences: the force is piecewise linear, so that they are exact on a branch.
   subroutine test_derivatives(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: k = 3.2e8_wp, c = 2.0e3_wp, b = 1.0e-5_wp, step_d = 1.0e-9_wp, step_v = 1.0e-5_wp
      !> Round-off of forces of 1e4 N over the steps.
      real(wp), parameter :: tolerance_d = 1.0e4_wp*1.0e-15_wp/step_d, tolerance_v = 1.0e4_wp*1.0e-15_wp/step_v
      type(random_stream) :: random
      real(wp) :: d, v, h_d, h_v, force, up, down, by_d, by_v, ignored_d, ignored_v
      integer :: i, used

      random = random_stream(23_i8)
      used = 0
      do i = 1, 1000
         call random%uniform(-3.0e-5_wp, 3.0e-5_wp, d)
         call random%uniform(-0.1_wp, 0.1_wp, v)
         call random%uniform(0.0_wp, 1.0e-9_wp, h_d)
         call random%uniform(0.0_wp, 1.0e-4_wp, h_v)
         call contact_force(d, v, k, c, b, h_d, h_v, force, by_d, by_v)
         ! Not across a border of the branches.
         if (abs(abs(d - h_d*c*v/(1.0_wp + c*h_v)) - b) < 2.0_wp*step_d) cycle
         used = used + 1
         call contact_force(d + step_d, v, k, c, b, h_d, h_v, up, ignored_d, ignored_v)
         call contact_force(d - step_d, v, k, c, b, h_d, h_v, down, ignored_d, ignored_v)
         call check(error, by_d, (up - down)/(2.0_wp*step_d), tolerance_d, 'by d')
         if (allocated(error)) return
         call contact_force(d, v + step_v, k, c, b, h_d, h_v, up, ignored_d, ignored_v)
         call contact_force(d, v - step_v, k, c, b, h_d, h_v, down, ignored_d, ignored_v)
         call check(error, by_v, (up - down)/(2.0_wp*step_v), tolerance_v, 'by v')
         if (allocated(error)) return
      end do
      call check(error, used >= 900, 'most draws are used')
   end subroutine test_derivatives

end module test_contact
