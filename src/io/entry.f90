!> Reads one entry `key = values` of a namelist group.
module spurflex_io_entry
   use spurflex_base_text, only: to_text
   use spurflex_io_faults, only: fault_list, excerpt
   use spurflex_io_lexer, only: token_type, token_word, token_string, token_broken, token_comma, token_equals, &
      token_group, token_slash, small_letters, is_name
   implicit none
   private

   public :: entry_type, value_type, take_entry

   !> Most values of one entry, repeat counts included.
   integer, parameter :: most_values = 10000

   character(len=*), parameter :: digits = '0123456789'

   !> One value, or several equal ones.
   type :: value_type
      !> What is written, without quotes.
      character(len=:), allocatable :: text
      !> It stood in quotes.
      logical :: quoted = .false.
      !> How many times it counts: 3 for `3*0.0`.
      integer :: copies = 1
   end type value_type

   !> One `key = values`.
   type :: entry_type
      !> Position of its group.
      integer :: group = 0
      !> Key in small letters.
      character(len=:), allocatable :: key
      !> Line of the key.
      integer :: line = 0
      !> Values, shape (values as written).
      type(value_type), allocatable :: values(:)
      !> Number of values, copies counted.
      integer :: total = 0
      !> A fault is noted already; the values mean nothing.
      logical :: broken = .false.
   end type entry_type

contains

   !> Take one entry, up to the next key or the end of the group.
   subroutine take_entry(text, tokens, group, i, entry, faults)
      !> The deck.
      character(len=*), intent(in) :: text
      !> Its tokens.
      type(token_type), intent(in) :: tokens(:)
      !> Ampersand and name of the open group, for messages.
      character(len=*), intent(in) :: group
      !> Position of the first token of the entry; on return, of the first behind it.
      integer, intent(inout) :: i
      !> The entry.
      type(entry_type), intent(out) :: entry
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer :: values, key
      logical :: expected

      call take_key(text, tokens, group, i, entry, faults)
      key = i - 1
      allocate (entry%values(last_of_entry(text, tokens, i) - i + 1))
      values = 0
      expected = .true.
      do i = i, i + size(entry%values) - 1
         select case (tokens(i)%kind)
         case (token_comma)
            if (expected) call refuse(entry, faults, group, 'empty value before a comma')
            if (lacks_value(entry, values)) call refuse(entry, faults, group, 'a repeat count without a value')
            expected = .true.
         case (token_equals)
            call refuse(entry, faults, group, 'more than one ''=''')
         case (token_broken)
            entry%broken = .true.
         case default
            expected = .false.
            if (i > key + 1) then
               if (tokens(i - 1)%kind == token_string .and. tokens(i - 1)%last + 1 == tokens(i)%first) then
                  call refuse(entry, faults, group, 'text directly behind a closing quote; a quote inside of text is doubled')
               end if
            end if
            call take_value(text(tokens(i)%first:tokens(i)%last), entry, values, group, faults)
         end select
      end do
      if (values == 0) call refuse(entry, faults, group, 'no value')
      if (lacks_value(entry, values)) call refuse(entry, faults, group, 'a repeat count without a value')
      entry%values = entry%values(:values)
   end subroutine take_entry

   !> Take the key of an entry and the equals sign.
   subroutine take_key(text, tokens, group, i, entry, faults)
      !> The deck.
      character(len=*), intent(in) :: text
      !> Its tokens.
      type(token_type), intent(in) :: tokens(:)
      !> Ampersand and name of the open group, for messages.
      character(len=*), intent(in) :: group
      !> Position of the first token of the entry; on return, of the first behind the equals sign.
      integer, intent(inout) :: i
      !> The entry; key and line are set.
      type(entry_type), intent(inout) :: entry
      !> Faults.
      type(fault_list), intent(inout) :: faults

      character(len=:), allocatable :: word
      integer :: bracket

      word = text(tokens(i)%first:tokens(i)%last)
      entry%line = tokens(i)%line
      entry%key = ''
      if (tokens(i)%kind /= token_word) then
         call faults%add(entry%line, group//': '//excerpt(word)//' stands where a key is expected')
         entry%broken = .true.
      else
         bracket = index(word, '(')
         entry%key = small_letters(word)
         if (bracket > 1) entry%key = entry%key(:bracket - 1)
         if (.not. precedes_equals(tokens, i)) then
            call refuse(entry, faults, group, 'no ''='' behind the key; write key = value, and text in quotes')
         else if (bracket > 1) then
            call refuse(entry, faults, group, 'an index as in '//excerpt(word)//' is not supported; write the whole list, '// &
               excerpt(entry%key)//' = value, value')
         end if
      end if
      i = i + merge(2, 1, precedes_equals(tokens, i))
   end subroutine take_key

   !> Take one value, with its repeat count.
   subroutine take_value(word, entry, values, group, faults)
      !> What is written, quotes included.
      character(len=*), intent(in) :: word
      !> The entry that gets the value.
      type(entry_type), intent(inout) :: entry
      !> Number of values in it.
      integer, intent(inout) :: values
      !> Ampersand and name of the open group, for messages.
      character(len=*), intent(in) :: group
      !> Faults.
      type(fault_list), intent(inout) :: faults

      type(value_type) :: value
      integer :: star
      logical :: pending

      pending = lacks_value(entry, values)
      value%quoted = scan(word(1:1), '''"') > 0
      star = 0
      if (value%quoted) then
         value%text = unquoted(word)
      else
         star = verify(word, digits)
         if (star > 1) then
            if (word(star:star) /= '*') star = 0
         else
            star = 0
         end if
         value%text = word(star + 1:)
         if (star > 0) value%copies = copies_of(word(:star - 1))
      end if
      if (pending .and. value%quoted) then
         value%copies = entry%values(values)%copies
      else
         if (pending) call refuse(entry, faults, group, 'a repeat count without a value')
         values = values + 1
         entry%total = min(entry%total + value%copies, most_values + 1)
      end if
      entry%values(values) = value
      if (value%copies == 0) call refuse(entry, faults, group, 'a repeat count of 0')
      if (entry%total > most_values) call refuse(entry, faults, group, 'more than '//to_text(most_values)//' values')
   end subroutine take_value

   !> Whether the last value is a repeat count whose value is still to come, as in `3*'text'`.
   pure function lacks_value(entry, values) result(lacks)
      !> The entry.
      type(entry_type), intent(in) :: entry
      !> Number of values in it.
      integer, intent(in) :: values
      !> It is.
      logical :: lacks

      lacks = .false.
      if (values > 0) lacks = len(entry%values(values)%text) == 0 .and. .not. entry%values(values)%quoted
   end function lacks_value

   !> Note a fault of an entry; only the first one, the others follow from it.
   subroutine refuse(entry, faults, group, reason)
      !> The entry.
      type(entry_type), intent(inout) :: entry
      !> Faults.
      type(fault_list), intent(inout) :: faults
      !> Ampersand and name of the group.
      character(len=*), intent(in) :: group
      !> What is wrong.
      character(len=*), intent(in) :: reason

      if (.not. entry%broken) call faults%add(entry%line, group//': '//excerpt(entry%key)//': '//reason)
      entry%broken = .true.
   end subroutine refuse

   !> Position of the last token that belongs to an entry.
   pure function last_of_entry(text, tokens, first) result(last)
      !> The deck.
      character(len=*), intent(in) :: text
      !> Its tokens.
      type(token_type), intent(in) :: tokens(:)
      !> Position of the first token behind the equals sign.
      integer, intent(in) :: first
      !> Position of the last value; first - 1 if there is none.
      integer :: last

      integer :: i

      do i = first, size(tokens)
         if (tokens(i)%kind == token_group .or. tokens(i)%kind == token_slash) exit
         if (tokens(i)%kind /= token_word) cycle
         if (precedes_equals(tokens, i)) exit
         ! A name that begins a line, behind a complete value, is a key whose equals sign is missing.
         if (i > first) then
            if (tokens(i - 1)%line < tokens(i)%line .and. tokens(i - 1)%kind /= token_comma .and. &
               is_name(text(tokens(i)%first:tokens(i)%last))) exit
         end if
      end do
      last = i - 1
   end function last_of_entry

   !> Whether an equals sign follows a token.
   pure function precedes_equals(tokens, i) result(precedes)
      !> The tokens.
      type(token_type), intent(in) :: tokens(:)
      !> Position of the token.
      integer, intent(in) :: i
      !> The next one is an equals sign.
      logical :: precedes

      precedes = .false.
      if (i < size(tokens)) precedes = tokens(i + 1)%kind == token_equals
   end function precedes_equals

   !> Value of a repeat count; one more than the most values if it is larger.
   pure function copies_of(text) result(copies)
      !> Digits.
      character(len=*), intent(in) :: text
      !> Their value.
      integer :: copies

      integer :: i

      copies = 0
      do i = 1, len(text)
         copies = min(10*copies + index(digits, text(i:i)) - 1, most_values + 1)
      end do
   end function copies_of

   !> Text without its quotes.
   pure function unquoted(word) result(text)
      !> Text with an opening and a closing quote.
      character(len=*), intent(in) :: word
      !> What is inside, doubled quotes as one.
      character(len=:), allocatable :: text

      character(len=len(word)) :: buffer
      integer :: i, length

      length = 0
      i = 2
      do while (i < len(word))
         length = length + 1
         buffer(length:length) = word(i:i)
         i = i + merge(2, 1, word(i:i) == word(1:1))
      end do
      text = buffer(:length)
   end function unquoted

end module spurflex_io_entry
