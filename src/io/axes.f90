!> The values of the grid: one place, so that the computed points and the written axes cannot differ.
module spurflex_io_axes
   use spurflex_base_kinds, only: wp
   use spurflex_io_case, only: sweep_spec
   implicit none
   private

   public :: speeds, stiffnesses

contains

   !> Speeds, evenly spaced with exact end points.
   pure function speeds(sweep) result(values)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> Speeds of the driving gear [rev/min], shape (speed_count).
      real(wp) :: values(sweep%speed_count)

      integer :: i, last

      last = size(values) - 1
      if (last == 0) values = sweep%speed_first
      if (last <= 0) return
      do i = 0, last
         ! A weighted mean, as it gives round speeds where the spacing is round.
         values(i + 1) = (real(last - i, wp)*sweep%speed_first + real(i, wp)*sweep%speed_last)/real(last, wp)
      end do
      values(1) = sweep%speed_first
      values(last + 1) = sweep%speed_last
   end function speeds

   !> Support stiffnesses, evenly spaced in their logarithm with exact end points.
   !> Where the range is a whole number of decades, the points a decade apart differ by a power of ten exactly.
   pure function stiffnesses(sweep) result(values)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> Support stiffnesses [N/m], shape (stiffness_count).
      real(wp) :: values(sweep%stiffness_count)

      real(wp), parameter :: ten = 10.0_wp
      real(wp) :: range
      integer :: i, last, decades

      last = size(values) - 1
      if (last == 0) values = sweep%stiffness_first
      if (last <= 0) return
      range = log10(sweep%stiffness_last/sweep%stiffness_first)
      decades = nint(range)
      if (same(times_decades(sweep%stiffness_first, decades), sweep%stiffness_last)) then
         do i = 0, last
            values(i + 1) = times_decades(sweep%stiffness_first, i*decades/last) &
               *ten**(real(mod(i*decades, last), wp)/real(last, wp))
         end do
      else
         do i = 0, last
            values(i + 1) = sweep%stiffness_first*ten**(range*real(i, wp)/real(last, wp))
         end do
      end if
      values(1) = sweep%stiffness_first
      values(last + 1) = sweep%stiffness_last
   end function stiffnesses

   !> A number shifted by whole decades; dividing by a power of ten is exact where multiplying by its inverse is not.
   pure function times_decades(number, decades) result(shifted)
      !> The number.
      real(wp), intent(in) :: number
      !> Decades, of either sign.
      integer, intent(in) :: decades
      !> number*10**decades.
      real(wp) :: shifted

      real(wp), parameter :: ten = 10.0_wp

      if (decades >= 0) then
         shifted = number*ten**decades
      else
         shifted = number/ten**(-decades)
      end if
   end function times_decades

   !> Whether two numbers are the same to the last bit.
   pure function same(a, b)
      !> A number.
      real(wp), intent(in) :: a
      !> Another.
      real(wp), intent(in) :: b
      !> They are equal.
      logical :: same

      same = .not. (a < b .or. a > b)
   end function same

end module spurflex_io_axes
