!> Writes what a deck says in another form that means the same, or with one fault at a known line.
module fuzz_spelling
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_io_entry, only: entry_type, value_type
   use spurflex_io_namelist, only: namelist_type
   use spurflex_io_schema, only: deck_keys, find_key, key_spec, kind_integer, kind_real, need_always
   use fuzz_pieces, only: pick, chance
   use fuzz_writer, only: writer_type
   implicit none
   private

   public :: fault_type, respelled

   character(len=1), parameter :: line_feed = achar(10), carriage_return = achar(13)
   character(len=*), parameter :: capitals = 'ABCDEFGHIJKLMNOPQRSTUVWXYZ', letters = 'abcdefghijklmnopqrstuvwxyz'

   !> Kinds of faults: a value that is none for the key.
   integer, parameter :: fault_value = 1
   !> A key that does not exist.
   integer, parameter :: fault_key = 2
   !> A key given twice.
   integer, parameter :: fault_twice = 3
   !> An index behind a key.
   integer, parameter :: fault_index = 4
   !> A group that does not exist.
   integer, parameter :: fault_group = 5
   !> A group given twice.
   integer, parameter :: fault_again = 6
   !> A group that is not closed.
   integer, parameter :: fault_open = 7
   !> Words outside of groups.
   integer, parameter :: fault_outside = 8
   !> A key that is missing.
   integer, parameter :: fault_missing = 9
   !> How many kinds there are.
   integer, parameter :: fault_kinds = 9

   !> Values that no numeric key takes.
   character(len=24), parameter :: bad_numbers(*) = [character(len=24) :: &
      'nan', 'inf', '-Infinity', '1e999', '1e-400', '-1e999', '1.0rpm', '''1.0''', 'rigid', '0x10', '1e', '--1', '1.0.0', &
      '.true.', '1000000000*1.0', '10001*0.0', '0*1.0', '9999999999999999999', '1.5e18', '-1.5e18', '(1.0,0.0)', '1,,2', ',', &
      '3*', '''open', '1.0 = 2.0', '1e5e5', '*', '1'//char(194)//char(178)]
   !> Values that no key of text takes.
   character(len=24), parameter :: bad_texts(*) = [character(len=24) :: &
      '1', '''a'' ''b''', '''a''''', 'rigid', '''a'//achar(9)//'''', '''a'//char(255)//'''', '"a''', '''''x''''', '.true.', &
      '''a'//char(194)//char(155)//'''']

   !> A fault put into a deck.
   type :: fault_type
      !> Where it is noticed.
      integer :: line = 0
      !> What the message must hold.
      character(len=:), allocatable :: word
   end type fault_type

contains

   !> A deck in another form.
   subroutine respelled(list, stream, text, fault)
      !> What the deck holds; accepted by the reader.
      type(namelist_type), intent(in) :: list
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> Its new text.
      character(len=:), allocatable, intent(out) :: text
      !> Asks for a fault, and says where it is.
      type(fault_type), intent(out), optional :: fault

      type(writer_type) :: writer
      integer :: groups(size(list%groups)), kind, chosen, g

      writer%text = ''
      writer%line_end = line_feed
      if (chance(stream, 3)) writer%line_end = carriage_return//line_feed
      if (chance(stream, 6)) writer%line_end = carriage_return
      if (chance(stream, 4)) writer%text = char(239)//char(187)//char(191)
      groups = shuffled(stream, size(list%groups))
      kind = 0
      chosen = 0
      if (present(fault)) then
         kind = pick(stream, 1, fault_kinds)
         chosen = pick(stream, 1, size(groups))
      end if
      do g = 1, size(groups)
         call writer%new_line(stream)
         if (g == chosen .and. kind == fault_outside) then
            call note(fault, writer%line, 'outside')
            call writer%put('zzz'//writer%line_end)
         else if (g == chosen .and. kind == fault_group) then
            call note(fault, writer%line, 'unknown group')
            call writer%put('&zzzzzzzzzzz /'//writer%line_end)
         end if
         if (g == chosen) then
            call put_group(writer, list, groups(g), stream, kind, fault)
         else
            call put_group(writer, list, groups(g), stream, 0)
         end if
      end do
      text = writer%text
   end subroutine respelled

   !> Write one group.
   subroutine put_group(writer, list, group, stream, kind, fault)
      !> What is written.
      type(writer_type), intent(inout) :: writer
      !> What the deck holds.
      type(namelist_type), intent(in) :: list
      !> Position of the group.
      integer, intent(in) :: group
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> Which fault to put in; 0 for none.
      integer, intent(in) :: kind
      !> Where it is; set for faults of a group.
      type(fault_type), intent(inout), optional :: fault

      type(key_spec), allocatable :: keys(:)
      integer, allocatable :: entries(:)
      integer :: i, bad, key, began

      keys = deck_keys()
      entries = pack([(i, i=1, size(list%entries))], [(list%entries(i)%group == group, i=1, size(list%entries))])
      entries = entries(shuffled(stream, size(entries)))
      bad = merge(pick(stream, 1, size(entries)), 0, kind > 0 .and. size(entries) > 0)
      began = writer%line
      call writer%put('&'//any_case(stream, list%groups(group)%name)//' ')
      do i = 1, size(entries)
         call writer%new_line(stream)
         key = find_key(keys, list%groups(group)%name, list%entries(entries(i))%key)
         if (i /= bad) then
            call put_entry(writer, list%entries(entries(i)), stream)
         else
            call put_bad_entry(writer, list%entries(entries(i)), keys(key), stream, kind, began, fault)
         end if
      end do
      if (present(fault) .and. kind == fault_open) call note(fault, began, 'no closing')
      if (kind /= fault_open) call close_group(writer, stream)
      if (present(fault) .and. kind == fault_again) then
         call writer%new_line(stream)
         call note(fault, writer%line, 'group is repeated')
         call writer%put('&'//list%groups(group)%name//' /'//writer%line_end)
      end if
   end subroutine put_group

   !> Note where a fault is.
   subroutine note(fault, line, word)
      !> The fault.
      type(fault_type), intent(inout) :: fault
      !> Where it is noticed.
      integer, intent(in) :: line
      !> What the message must hold.
      character(len=*), intent(in) :: word

      fault%line = line
      fault%word = word
   end subroutine note

   !> End a group in one of the forms there are.
   subroutine close_group(writer, stream)
      !> What is written.
      type(writer_type), intent(inout) :: writer
      !> Random numbers.
      type(random_stream), intent(inout) :: stream

      call writer%new_line(stream)
      if (chance(stream, 4)) then
         call writer%put('&'//any_case(stream, 'end'))
      else
         call writer%put('/')
      end if
      call writer%new_line(stream)
   end subroutine close_group

   !> Write one entry with a fault, if the fault is one of entries.
   subroutine put_bad_entry(writer, entry, spec, stream, kind, group_line, fault)
      !> What is written.
      type(writer_type), intent(inout) :: writer
      !> The entry.
      type(entry_type), intent(in) :: entry
      !> Its key.
      type(key_spec), intent(in) :: spec
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> Which fault.
      integer, intent(in) :: kind
      !> Line at which the group began.
      integer, intent(in) :: group_line
      !> Where it is; set for faults of an entry.
      type(fault_type), intent(inout) :: fault

      character(len=:), allocatable :: value

      select case (kind)
      case (fault_value)
         if (spec%kind == kind_integer .or. spec%kind == kind_real) then
            value = trim(bad_numbers(pick(stream, 1, size(bad_numbers))))
            ! A torque may be any finite number.
            if (index(value, 'e18') > 0 .or. verify(value, '0123456789') == 0) then
               if (spec%range%upper > 1.0e18_wp) value = 'nan'
            end if
         else
            value = trim(bad_texts(pick(stream, 1, size(bad_texts))))
         end if
         call note(fault, writer%line, trim(spec%key))
         ! Text without end is noticed before anybody knows of keys.
         if (any(value == [character(len=8) :: '''open', '''a''''', '"a'''])) fault%word = 'no closing quote'
         call writer%put(entry%key//' = '//value//writer%line_end)
      case (fault_key)
         call put_entry(writer, entry, stream)
         call writer%put(writer%line_end)
         call note(fault, writer%line, 'unknown key ''qqqqqqqqqqqqqqqqqqq''')
         call writer%put('qqqqqqqqqqqqqqqqqqq = 1'//writer%line_end)
      case (fault_twice)
         call put_entry(writer, entry, stream)
         call writer%put(writer%line_end)
         call note(fault, writer%line, trim(spec%key)//': the key is repeated')
         call put_entry(writer, entry, stream)
      case (fault_index)
         call note(fault, writer%line, trim(spec%key)//': an index')
         call writer%put(entry%key//'(1) = 1'//writer%line_end)
      case (fault_missing)
         if (spec%need == need_always) then
            call note(fault, group_line, 'key '''//trim(spec%key)//''' is missing')
         else
            call put_entry(writer, entry, stream)
         end if
      case default
         call put_entry(writer, entry, stream)
      end select
   end subroutine put_bad_entry

   !> Write one entry in another form.
   subroutine put_entry(writer, entry, stream)
      !> What is written.
      type(writer_type), intent(inout) :: writer
      !> The entry.
      type(entry_type), intent(in) :: entry
      !> Random numbers.
      type(random_stream), intent(inout) :: stream

      integer :: i, j, copies
      logical :: counted, first

      call writer%put(any_case(stream, entry%key))
      call writer%space(stream)
      if (chance(stream, 10)) call writer%new_line(stream)
      call writer%put('=')
      if (chance(stream, 10)) call writer%new_line(stream)
      first = .true.
      do i = 1, size(entry%values)
         counted = chance(stream, 3)
         copies = merge(1, entry%values(i)%copies, counted)
         do j = 1, copies
            if (.not. first) then
               call writer%space(stream)
               if (chance(stream, 2)) then
                  call writer%put(',')
               else
                  call writer%put(' ')
               end if
               if (chance(stream, 3)) call writer%new_line(stream)
            end if
            first = .false.
            call writer%space(stream)
            if (counted) call writer%put(to_text(entry%values(i)%copies)//'*')
            call writer%put(other_value(stream, entry%values(i)))
         end do
      end do
      call writer%put(' ')
   end subroutine put_entry

   !> A value in another form.
   function other_value(stream, value) result(text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The value.
      type(value_type), intent(in) :: value
      !> Text that means the same.
      character(len=:), allocatable :: text

      character(len=*), parameter :: exponents = 'eEdD'
      integer, parameter :: long_number = 90
      character(len=1) :: quote
      integer :: i, mark

      if (value%quoted) then
         quote = merge('"', '''', chance(stream, 2))
         text = quote
         do i = 1, len(value%text)
            text = text//value%text(i:i)
            if (value%text(i:i) == quote) text = text//quote
         end do
         text = text//quote
         return
      end if
      text = value%text
      mark = scan(text, exponents)
      if (mark > 0) then
         i = pick(stream, 1, 4)
         text(mark:mark) = exponents(i:i)
      else if (chance(stream, 3) .and. index(text, '.') > 0 .and. len(text) < long_number) then
         text = text//'d0'
      end if
      if (chance(stream, 4) .and. scan(text(1:1), '+-') == 0 .and. len(text) < long_number) text = '+'//text
   end function other_value

   !> A word in capital and small letters.
   function any_case(stream, word) result(text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The word, in small letters.
      character(len=*), intent(in) :: word
      !> The word.
      character(len=:), allocatable :: text

      integer :: i, place

      text = word
      if (chance(stream, 2)) return
      do i = 1, len(text)
         place = index(letters, text(i:i))
         if (chance(stream, 2) .and. place > 0) text(i:i) = capitals(place:place)
      end do
   end function any_case

   !> The numbers from 1 in any order.
   function shuffled(stream, most) result(order)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The last number.
      integer, intent(in) :: most
      !> The numbers, shape (most).
      integer :: order(most)

      integer :: i, j, swap

      order = [(i, i=1, most)]
      do i = most, 2, -1
         j = pick(stream, 1, i)
         swap = order(i)
         order(i) = order(j)
         order(j) = swap
      end do
   end function shuffled

end module fuzz_spelling
