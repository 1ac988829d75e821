!> Numeric kinds used by every module.
module spurflex_base_kinds
   use, intrinsic :: iso_fortran_env, only: int32, int64, real64
   implicit none
   private

   public :: wp, i4, i8, pi

   !> Working precision of every physical quantity: IEEE double.
   integer, parameter :: wp = real64

   !> Integer kinds: default-sized and long counters.
   integer, parameter :: i4 = int32, i8 = int64

   !> Circle constant.
   real(wp), parameter :: pi = 3.141592653589793238462643383279502884_wp

end module spurflex_base_kinds
