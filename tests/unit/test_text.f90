!> Numbers as text: short, and read back to the same value.
module test_text
   use spurflex_base_kinds, only: i8, pi, wp
   use spurflex_base_text, only: fixed_text, to_text
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_text

contains

   !> The tests of this suite.
   subroutine collect_text(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('integers', test_integers), &
                  new_unittest('long integers', test_long_integers), &
                  new_unittest('plain reals', test_plain_reals), &
                  new_unittest('reals with an exponent', test_exponent_reals), &
                  new_unittest('limits of the plain form', test_plain_limits), &
                  new_unittest('reals read back to the same bits', test_round_trip), &
                  new_unittest('logicals', test_logicals), &
                  new_unittest('fixed decimals', test_fixed) &
                  ]
   end subroutine collect_text

   !> Integers have their digits and nothing else.
   subroutine test_integers(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, to_text(0), '0')
      if (allocated(error)) return
      call check(error, to_text(-42), '-42')
      if (allocated(error)) return
      call check(error, to_text(huge(0)), '2147483647')
   end subroutine test_integers

   !> Long integers beyond the range of the default kind.
   subroutine test_long_integers(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, to_text(3000000000_i8), '3000000000')
      if (allocated(error)) return
      call check(error, to_text(-huge(0_i8)), '-9223372036854775807')
   end subroutine test_long_integers

   !> Reals of ordinary size are plain decimals with a digit on both sides of the point.
   subroutine test_plain_reals(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, to_text(0.0_wp), '0.0')
      if (allocated(error)) return
      call check(error, to_text(1500.0_wp), '1500.0')
      if (allocated(error)) return
      call check(error, to_text(-0.25_wp), '-0.25')
      if (allocated(error)) return
      call check(error, to_text(0.1_wp), '0.1')
      if (allocated(error)) return
      call check(error, to_text(pi), '3.141592653589793')
   end subroutine test_plain_reals

   !> Very large and very small reals have an exponent.
   subroutine test_exponent_reals(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, to_text(1.0e10_wp), '1.0e10')
      if (allocated(error)) return
      call check(error, to_text(-2.5e-6_wp), '-2.5e-6')
      if (allocated(error)) return
      call check(error, to_text(1.0e-300_wp), '1.0e-300')
   end subroutine test_exponent_reals

   !> The plain form ends at exponents -3 and 7.
   subroutine test_plain_limits(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, to_text(0.001_wp), '0.001')
      if (allocated(error)) return
      call check(error, to_text(0.0001_wp), '1.0e-4')
      if (allocated(error)) return
      call check(error, to_text(1.0e7_wp), '10000000.0')
      if (allocated(error)) return
      call check(error, to_text(1.0e8_wp), '1.0e8')
   end subroutine test_plain_limits

   !> The text of a real names exactly that real, whatever its size.
   subroutine test_round_trip(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: samples = 400
      character(len=:), allocatable :: text
      real(wp) :: number, back
      integer :: i

      do i = 1, samples
         ! Irrational significands, exponents from 1e-40 to 1e40, both signs.
         number = sin(real(i, wp))*10.0_wp**(mod(i, 81) - 40)
         text = to_text(number)
         read (text, *) back
         call check(error, transfer(back, 0_i8), transfer(number, 0_i8), text)
         if (allocated(error)) return
      end do
      call check(error, len(to_text(1.0_wp/3.0_wp)) <= 18, 'at most 17 digits behind 0.')
   end subroutine test_round_trip

   !> Logicals are namelist text.
   subroutine test_logicals(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, to_text(.true.), '.true.')
      if (allocated(error)) return
      call check(error, to_text(.false.), '.false.')
   end subroutine test_logicals

   !> A fixed number of decimals, with a digit before the point.
   subroutine test_fixed(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, fixed_text(12.5_wp, 2), '12.50')
      if (allocated(error)) return
      call check(error, fixed_text(0.125_wp, 1), '0.1')
      if (allocated(error)) return
      call check(error, fixed_text(-0.5_wp, 1), '-0.5')
      if (allocated(error)) return
      call check(error, fixed_text(99.96_wp, 1), '100.0')
   end subroutine test_fixed

end module test_text
