!> Numbers as they may be written in a deck.
!>
!> The grammar is checked before anything is converted, so that no input raises a floating-point exception and nothing is
!> half accepted as list-directed input does with `1500 rpm` or `NaN`.
module spurflex_io_number
   use spurflex_base_kinds, only: wp, i8
   use spurflex_base_text, only: to_text
   implicit none
   private

   public :: read_real, read_integer, numeric_prefix

   !> Longest number in a deck.
   integer, parameter :: most_characters = 100
   !> Decimal exponents of the leading digit that a double surely holds.
   integer, parameter :: smallest_exponent = -307, largest_exponent = 307
   !> Exponents are not followed beyond this value.
   integer, parameter :: exponent_limit = 100000

   character(len=*), parameter :: digits = '0123456789'

   !> The parts of a number.
   type :: number_parts
      !> Length of the longest beginning that is a number; 0 for none.
      integer :: length = 0
      !> There is neither a point nor an exponent.
      logical :: whole = .true.
      !> Length of the beginning without the exponent.
      integer :: mantissa = 0
      !> The exponent that is written.
      integer :: exponent = 0
      !> Decimal exponent of the leading digit, the point of the mantissa taken into account.
      integer :: magnitude = 0
      !> Every digit of the mantissa is zero.
      logical :: zero = .true.
   end type number_parts

contains

   !> Read a real number.
   pure subroutine read_real(text, number, reason)
      !> The number as written, without blanks.
      character(len=*), intent(in) :: text
      !> Its value; 0 if it is refused.
      real(wp), intent(out) :: number
      !> Why it is refused; empty if it is not.
      character(len=:), allocatable, intent(out) :: reason

      ! Digits that are rounded up may reach what would be refused when it is printed and read again.
      real(wp), parameter :: largest = 10.0_wp**(largest_exponent + 1)
      character(len=*), parameter :: too_large = 'the number is too large for double precision'
      type(number_parts) :: parts
      character(len=most_characters + 8) :: literal
      integer :: stat

      number = 0.0_wp
      reason = ''
      parts = parts_of(text)
      if (len(text) > most_characters) then
         reason = 'a number has at most '//to_text(most_characters)//' characters'
      else if (parts%length == 0 .or. parts%length < len(text)) then
         reason = 'not a finite number'
      else if (parts%zero) then
         if (text(1:1) == '-') number = sign(0.0_wp, -1.0_wp)
      else if (parts%magnitude > largest_exponent) then
         reason = too_large
      else if (parts%magnitude < smallest_exponent) then
         reason = 'the number is too small for double precision; write 0.0'
      else
         literal = text(:parts%mantissa)//'e'//to_text(parts%exponent)
         read (literal, *, iostat=stat) number
         if (stat /= 0) then
            reason = 'not a number'
         else if (abs(number) >= largest) then
            number = 0.0_wp
            reason = too_large
         end if
      end if
   end subroutine read_real

   !> Read a whole number.
   pure subroutine read_integer(text, number, reason)
      !> The number as written, without blanks.
      character(len=*), intent(in) :: text
      !> Its value; 0 if it is refused.
      integer(i8), intent(out) :: number
      !> Why it is refused; empty if it is not.
      character(len=:), allocatable, intent(out) :: reason

      integer(i8), parameter :: ten = 10
      integer, parameter :: largest_whole = 9
      type(number_parts) :: parts
      real(wp) :: real_number
      integer :: i

      number = 0
      call read_real(text, real_number, reason)
      if (len(reason) > 0) return
      parts = parts_of(text)
      if (.not. parts%whole) then
         reason = 'not a whole number'
         if (parts%magnitude > largest_whole) return
         if (abs(real_number - anint(real_number)) > 0.0_wp) return
         reason = 'a whole number has neither point nor exponent (did you mean '//to_text(nint(real_number, i8))//'?)'
      else if (parts%magnitude > range(number) - 1) then
         number = sign(huge(number), nint(sign(1.0_wp, real_number), i8))
      else
         do i = 1, len(text)
            if (index(digits, text(i:i)) > 0) number = ten*number + int(index(digits, text(i:i)) - 1, i8)
         end do
         if (text(1:1) == '-') number = -number
      end if
   end subroutine read_integer

   !> Length of the longest beginning of a text that is a number.
   pure function numeric_prefix(text) result(length)
      !> Any text.
      character(len=*), intent(in) :: text
      !> Characters that form a number; 0 for none.
      integer :: length

      type(number_parts) :: parts

      parts = parts_of(text)
      length = parts%length
   end function numeric_prefix

   !> Take a number apart: [sign] digits [. digits] [e|d [sign] digits].
   pure function parts_of(text) result(parts)
      !> Any text.
      character(len=*), intent(in) :: text
      !> Its parts.
      type(number_parts) :: parts

      integer :: i, first, mantissa_digits, leading, before_point
      logical :: point

      first = 1
      if (len(text) > 0) then
         if (scan(text(1:1), '+-') > 0) first = 2
      end if
      point = .false.
      mantissa_digits = 0
      before_point = 0
      leading = 0
      do i = first, len(text)
         if (text(i:i) == '.' .and. .not. point) then
            point = .true.
         else if (index(digits, text(i:i)) > 0) then
            mantissa_digits = mantissa_digits + 1
            if (.not. point) before_point = before_point + 1
            if (leading == 0 .and. text(i:i) /= '0') leading = mantissa_digits
         else
            exit
         end if
      end do
      if (mantissa_digits == 0) return
      parts%length = i - 1
      parts%mantissa = i - 1
      parts%whole = .not. point
      parts%zero = leading == 0
      call add_exponent(text, parts)
      parts%magnitude = before_point - leading + parts%exponent
   end function parts_of

   !> Take the exponent of a number, if it has one.
   pure subroutine add_exponent(text, parts)
      !> The text.
      character(len=*), intent(in) :: text
      !> Its parts; the mantissa is known.
      type(number_parts), intent(inout) :: parts

      integer :: i, first

      if (parts%mantissa >= len(text)) return
      if (scan(text(parts%mantissa + 1:parts%mantissa + 1), 'eEdD') == 0) return
      first = parts%mantissa + 2
      if (first > len(text)) return
      if (scan(text(first:first), '+-') > 0) first = first + 1
      do i = first, len(text)
         if (index(digits, text(i:i)) == 0) exit
         parts%exponent = min(10*parts%exponent + index(digits, text(i:i)) - 1, exponent_limit)
      end do
      if (i == first) return
      if (text(first - 1:first - 1) == '-') parts%exponent = -parts%exponent
      parts%length = i - 1
      parts%whole = .false.
   end subroutine add_exponent

end module spurflex_io_number
