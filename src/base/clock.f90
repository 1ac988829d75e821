!> A clock that only goes forward, whatever is done to the date: every waiting and measuring of time goes by it.
module spurflex_base_clock
   use spurflex_base_kinds, only: wp, i8
   implicit none
   private

   public :: steady_seconds

contains

   !> Time since some fixed moment. With a count of eight bytes, `system_clock` is the system's monotonic clock.
   function steady_seconds() result(seconds)
      !> Seconds.
      real(wp) :: seconds

      integer(i8) :: count, rate

      call system_clock(count, rate)
      seconds = real(count, wp)/real(rate, wp)
   end function steady_seconds

end module spurflex_base_clock
