!> Numbers as text, in the shortest form that reads back to the same value.
module spurflex_base_text
   use spurflex_base_kinds, only: wp, i4, i8
   implicit none
   private

   public :: to_text, fixed_text

   !> Text of an integer, a real or a logical.
   interface to_text
      module procedure :: integer_text
      module procedure :: long_text
      module procedure :: real_text
      module procedure :: logical_text
   end interface to_text

contains

   !> Decimal digits of an integer.
   pure function integer_text(number) result(text)
      !> The number.
      integer(i4), intent(in) :: number
      !> Its digits, with a leading minus where negative.
      character(len=:), allocatable :: text

      text = long_text(int(number, i8))
   end function integer_text

   !> Decimal digits of a long integer.
   pure function long_text(number) result(text)
      !> The number.
      integer(i8), intent(in) :: number
      !> Its digits, with a leading minus where negative.
      character(len=:), allocatable :: text

      character(len=24) :: buffer

      write (buffer, '(i0)') number
      text = trim(buffer)
   end function long_text

   !> The shortest text of at most 17 significant digits that reads back to the same real.
   pure function real_text(number) result(text)
      !> The number; must be finite to read back.
      real(wp), intent(in) :: number
      !> Text valid as a namelist real.
      character(len=:), allocatable :: text

      integer, parameter :: most_digits = 17
      character(len=32) :: buffer, form
      real(wp) :: back
      integer :: digits, stat

      do digits = 1, most_digits
         write (form, '(a, i0, a)') '(es32.', digits - 1, 'e3)'
         write (buffer, form) number
         read (buffer, *, iostat=stat) back
         if (stat /= 0) exit
         if (.not. (back < number .or. back > number)) exit
      end do
      text = tidy(trim(adjustl(buffer)))
   end function real_text

   !> Rewrite `d.ddE+eee` as a plain decimal where that is short.
   pure function tidy(scientific) result(text)
      !> A number in scientific form.
      character(len=*), intent(in) :: scientific
      !> The same number, plain for exponents -3..7, with a short exponent elsewhere.
      character(len=:), allocatable :: text

      integer, parameter :: smallest_plain = -3, largest_plain = 7
      character(len=:), allocatable :: sign, digits
      character(len=8) :: exponent_text
      integer :: mark, exponent, stat

      mark = scan(scientific, 'E')
      stat = 1
      if (mark > 0) read (scientific(mark + 1:), *, iostat=stat) exponent
      if (stat /= 0) then
         text = scientific
         return
      end if
      sign = ''
      digits = scientific(:mark - 1)
      if (digits(1:1) == '-') then
         sign = '-'
         digits = digits(2:)
      end if
      digits = digits(1:1)//digits(3:)
      if (exponent < smallest_plain .or. exponent > largest_plain) then
         write (exponent_text, '(i0)') exponent
         if (len(digits) == 1) digits = digits//'0'
         text = sign//digits(1:1)//'.'//digits(2:)//'e'//trim(exponent_text)
      else if (exponent < 0) then
         text = sign//'0.'//repeat('0', -exponent - 1)//digits
      else
         if (len(digits) < exponent + 2) digits = digits//repeat('0', exponent + 2 - len(digits))
         text = sign//digits(:exponent + 1)//'.'//digits(exponent + 2:)
      end if
   end function tidy

   !> Namelist text of a logical.
   pure function logical_text(value) result(text)
      !> The value.
      logical, intent(in) :: value
      !> `.true.` or `.false.`.
      character(len=:), allocatable :: text

      text = merge('.true. ', '.false.', value)
      text = trim(text)
   end function logical_text

   !> A real with a fixed number of decimals, for messages to people.
   pure function fixed_text(number, decimals) result(text)
      !> The number.
      real(wp), intent(in) :: number
      !> Digits behind the point, 0 to 9.
      integer, intent(in) :: decimals
      !> Text such as `12.50`.
      character(len=:), allocatable :: text

      character(len=48) :: buffer, form

      write (form, '(a, i0, a)') '(f40.', decimals, ')'
      write (buffer, form) number
      text = trim(adjustl(buffer))
      if (text(1:1) == '.') text = '0'//text
      if (len(text) >= 2) then
         if (text(1:2) == '-.') text = '-0'//text(2:)
      end if
   end function fixed_text

end module spurflex_base_text
