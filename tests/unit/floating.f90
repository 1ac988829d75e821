!> Reals as the bits they are, and tests in which values are not finite on purpose.
module floating
   use, intrinsic :: ieee_exceptions, only: ieee_divide_by_zero, ieee_flag_type, ieee_get_halting_mode, ieee_invalid, &
      ieee_overflow, ieee_set_flag, ieee_set_halting_mode
   use spurflex_base_kinds, only: i8, wp
   use test_support, only: error_type
   implicit none
   private

   public :: same_bits, run_untrapped

   !> What stops the program in the debug build.
   type(ieee_flag_type), parameter :: traps(3) = [ieee_invalid, ieee_divide_by_zero, ieee_overflow]

   abstract interface
      !> A test.
      subroutine test_interface(error)
         import :: error_type
         !> Why it failed.
         type(error_type), allocatable, intent(out) :: error
      end subroutine test_interface
   end interface

contains

   !> Two reals are the same, bit by bit.
   elemental function same_bits(a, b) result(same)
      !> The reals.
      real(wp), intent(in) :: a, b
      !> They are.
      logical :: same

      same = transfer(a, 0_i8) == transfer(b, 0_i8)
   end function same_bits

   !> Run a test in which operations on infinities and on NaN do not stop the debug build.
   subroutine run_untrapped(test, error)
      !> The test.
      procedure(test_interface) :: test
      !> Why it failed.
      type(error_type), allocatable, intent(out) :: error

      logical :: halts(size(traps))
      integer :: i

      do i = 1, size(traps)
         call ieee_get_halting_mode(traps(i), halts(i))
         call ieee_set_halting_mode(traps(i), .false.)
      end do
      call test(error)
      do i = 1, size(traps)
         call ieee_set_flag(traps(i), .false.)
         call ieee_set_halting_mode(traps(i), halts(i))
      end do
   end subroutine run_untrapped

end module floating
