!> Turns what is written for a key into a value of the key's type, or says why that cannot be.
module spurflex_io_convert
   use spurflex_base_kinds, only: wp, i8
   use spurflex_base_text, only: to_text
   use spurflex_io_entry, only: entry_type, value_type
   use spurflex_io_faults, only: fault_list, excerpt, has_control, is_utf8
   use spurflex_io_number, only: read_real, read_integer, numeric_prefix
   use spurflex_io_schema, only: key_spec, words_of, in_range, range_text, kind_integer, kind_real, kind_text, &
      kind_word, most_characters, word_length
   use spurflex_io_suggest, only: did_you_mean
   implicit none
   private

   public :: deck_value, text_value, convert_values, allowed_text, text_fault

   !> A text among others of another length.
   type :: text_value
      !> The text.
      character(len=:), allocatable :: text
   end type text_value

   !> The value of one key.
   type :: deck_value
      !> Line of the key in the deck; 0 if it is absent.
      integer :: line = 0
      !> There is a usable value, from the deck or by default.
      logical :: valid = .false.
      !> A misspelled key was probably meant to be this one.
      logical :: excused = .false.
      !> Value of a whole number.
      integer :: whole = 0
      !> Value or values of a number, shape (values).
      real(wp), allocatable :: reals(:)
      !> Value or values of a text or word, shape (values).
      type(text_value), allocatable :: texts(:)
   end type deck_value

contains

   !> Convert the values of an entry.
   subroutine convert_values(entry, spec, value, faults)
      !> The entry; it is not broken.
      type(entry_type), intent(in) :: entry
      !> Its key.
      type(key_spec), intent(in) :: spec
      !> The value; it is valid if there is no fault.
      type(deck_value), intent(inout) :: value
      !> Faults: those found here are added.
      type(fault_list), intent(inout) :: faults

      integer :: i, j, done
      real(wp) :: number
      character(len=:), allocatable :: reason

      reason = count_fault(entry, spec)
      if (len(reason) > 0) then
         call faults%add(entry%line, '&'//trim(spec%group)//': '//entry%key//': '//reason)
         return
      end if
      value%valid = .true.
      allocate (value%reals(entry%total), value%texts(entry%total))
      done = 0
      do i = 1, size(entry%values)
         call convert_value(entry%values(i), spec, number, reason)
         if (len(reason) > 0) then
            value%valid = .false.
            call faults%add(entry%line, '&'//trim(spec%group)//': '//entry%key//' = '//shown(entry%values(i))//': '//reason)
         end if
         if (spec%kind == kind_integer .and. value%valid) value%whole = nint(number)
         do j = 1, entry%values(i)%copies
            done = done + 1
            value%reals(done) = number
            value%texts(done)%text = entry%values(i)%text
         end do
      end do
   end subroutine convert_values

   !> What is wrong with the number of values.
   pure function count_fault(entry, spec) result(reason)
      !> The entry.
      type(entry_type), intent(in) :: entry
      !> Its key.
      type(key_spec), intent(in) :: spec
      !> The fault; empty if there is none.
      character(len=:), allocatable :: reason

      integer, parameter :: most_listed = 6
      integer :: i

      reason = ''
      if (entry%total <= spec%most) return
      if (spec%most > 1) then
         reason = to_text(entry%total)//' values, but at most '//to_text(spec%most)//' are allowed'
         return
      end if
      do i = 1, min(size(entry%values), most_listed)
         if (i > 1) reason = reason//' '
         if (entry%values(i)%copies > 1) reason = reason//to_text(entry%values(i)%copies)//'*'
         reason = reason//shown(entry%values(i))
      end do
      if (size(entry%values) > most_listed) reason = reason//' ...'
      reason = to_text(entry%total)//' values ('//reason//'), but the key takes one'
      if (spec%kind == kind_text .or. spec%kind == kind_word) then
         if (.not. entry%values(1)%quoted) reason = reason//'; text with blanks or commas stands in quotes'
      else if (len_trim(spec%unit) > 0) then
         reason = reason//'; write one number with a decimal point and without its unit, which is '//trim(spec%unit)
      end if
   end function count_fault

   !> Convert one value.
   subroutine convert_value(value, spec, number, reason)
      !> What is written.
      type(value_type), intent(in) :: value
      !> The key.
      type(key_spec), intent(in) :: spec
      !> Its value, if the key takes a number.
      real(wp), intent(out) :: number
      !> What is wrong; empty if nothing is.
      character(len=:), allocatable, intent(out) :: reason

      integer(i8) :: whole

      number = 0.0_wp
      select case (spec%kind)
      case (kind_text, kind_word)
         reason = text_fault(value%text, spec)
         if (.not. value%quoted) reason = 'text must stand in quotes: '''//excerpt(value%text)//''''
      case default
         if (value%quoted) then
            reason = 'text where a number is expected; '
            if (numeric_prefix(value%text) == len(value%text) .and. len(value%text) > 0) then
               reason = reason//'write it without quotes'
            else
               reason = reason//'allowed is '//allowed_text(spec)
            end if
            return
         end if
         if (spec%kind == kind_integer) then
            call read_integer(value%text, whole, reason)
            if (len(reason) == 0) number = real(whole, wp)
         else
            call read_real(value%text, number, reason)
         end if
         if (len(reason) > 0) then
            if (numeric_prefix(value%text) < len(value%text)) reason = reason//number_advice(value%text, spec)
            reason = reason//'; allowed is '//allowed_text(spec)
         else if (.not. in_range(spec%range, number)) then
            reason = 'out of range; allowed is '//allowed_text(spec)
         end if
      end select
   end subroutine convert_value

   !> What to do about something that is not a number.
   pure function number_advice(text, spec) result(advice)
      !> What is written.
      character(len=*), intent(in) :: text
      !> The key.
      type(key_spec), intent(in) :: spec
      !> Advice; empty if there is none.
      character(len=:), allocatable :: advice

      integer, parameter :: ascii_codes = 128
      integer :: i

      advice = ''
      if (any([(iachar(text(i:i)) >= ascii_codes, i=1, len(text))])) then
         advice = ', it holds a character outside of ASCII'
      else if (numeric_prefix(text) > 0) then
         advice = ' (did you mean '//excerpt(text(:numeric_prefix(text)))//'?)'
         if (len_trim(spec%unit) > 0 .and. verify(text(len(text):), '0123456789.') > 0) then
            advice = advice//', write it without unit'
         end if
      end if
   end function number_advice

   !> What is wrong with a text.
   pure function text_fault(text, spec) result(reason)
      !> The text.
      character(len=*), intent(in) :: text
      !> The key.
      type(key_spec), intent(in) :: spec
      !> The fault; empty if there is none.
      character(len=:), allocatable :: reason

      reason = ''
      if (spec%kind == kind_word) then
         if (len(text) > 0 .and. len_trim(text) == len(text) .and. any(words_of(spec) == text)) return
         reason = 'unknown word'//did_you_mean(text, words_of(spec))//'; allowed is '//allowed_text(spec)
      else if (len(text) > most_characters) then
         reason = to_text(len(text))//' characters, but at most '//to_text(most_characters)//' are allowed'
      else if (has_control(text)) then
         reason = 'a tab or another control character in the text'
      else if (.not. is_utf8(text)) then
         reason = 'the text is not UTF-8'
      end if
   end function text_fault

   !> What a key allows.
   pure function allowed_text(spec) result(text)
      !> The key.
      type(key_spec), intent(in) :: spec
      !> Such as `above 0, at most 1e12 [kg]` or `'rigid', 'flexible', 'both'`.
      character(len=:), allocatable :: text

      character(len=word_length), allocatable :: words(:)
      integer :: i

      select case (spec%kind)
      case (kind_integer, kind_real)
         text = range_text(spec)
         if (len_trim(spec%unit) > 0) text = text//' ['//trim(spec%unit)//']'
      case (kind_word)
         allocate (words, source=words_of(spec))
         text = ''
         do i = 1, size(words)
            if (i > 1) text = text//', '
            text = text//''''//trim(words(i))//''''
         end do
      case default
         text = 'at most '//to_text(most_characters)//' characters'
      end select
   end function allowed_text

   !> A value as the user wrote it.
   pure function shown(value) result(text)
      !> The value.
      type(value_type), intent(in) :: value
      !> It, in quotes if it stood in quotes.
      character(len=:), allocatable :: text

      text = excerpt(value%text)
      if (value%quoted) text = ''''//text//''''
   end function shown

end module spurflex_io_convert
