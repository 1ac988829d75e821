!> Matches what stands in a deck with the table of keys: names, types, lengths, ranges and words; fills in defaults.
module spurflex_io_values
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_io_convert, only: deck_value, convert_values
   use spurflex_io_entry, only: entry_type
   use spurflex_io_faults, only: fault_list, excerpt
   use spurflex_io_namelist, only: namelist_type, parse_namelist
   use spurflex_io_schema, only: key_spec, group_spec, deck_keys, deck_groups, find_key, need_never
   use spurflex_io_suggest, only: nearest_name, did_you_mean
   implicit none
   private

   public :: deck_values, collect_values

   !> The values of one deck, key by key.
   type :: deck_values
      !> The table of keys, shape (keys).
      type(key_spec), allocatable :: keys(:)
      !> The value of each key, shape (keys).
      type(deck_value), allocatable :: values(:)
      !> The groups of the table, shape (groups).
      type(group_spec), allocatable :: groups(:)
      !> Line at which each group begins, shape (groups); 0 if it is absent.
      integer, allocatable :: group_lines(:)
      !> Last line of the deck.
      integer :: last_line = 0
   contains
      !> Position of a key in the table.
      procedure :: at
      !> Whether all of some keys of a group have a usable value.
      procedure :: known
      !> Value of a number.
      procedure :: real_of
      !> Value of a whole number.
      procedure :: integer_of
      !> Values of a list of numbers.
      procedure :: reals_of
      !> Value of a text or word.
      procedure :: text_of
   end type deck_values

contains

   !> Match a deck with the table of keys.
   subroutine collect_values(list, table, faults)
      !> What stands in the deck.
      type(namelist_type), intent(in) :: list
      !> The values.
      type(deck_values), intent(out) :: table
      !> Faults: those found here are added.
      type(fault_list), intent(inout) :: faults

      integer :: group_at(size(list%groups)), i

      table%keys = deck_keys()
      table%groups = deck_groups()
      allocate (table%values(size(table%keys)))
      allocate (table%group_lines(size(table%groups)), source=0)
      table%last_line = list%last_line
      call match_groups(list, table, group_at, faults)
      do i = 1, size(list%entries)
         if (group_at(list%entries(i)%group) == 0) cycle
         call match_entry(list%entries(i), trim(table%groups(group_at(list%entries(i)%group))%name), table, faults)
      end do
      call fill_defaults(table, faults)
   end subroutine collect_values

   !> Find each group of the deck in the table.
   subroutine match_groups(list, table, group_at, faults)
      !> What stands in the deck.
      type(namelist_type), intent(in) :: list
      !> The values; the lines of the groups are set.
      type(deck_values), intent(inout) :: table
      !> Position in the table of each group of the deck, shape (groups of the deck); 0 if unknown.
      integer, intent(out) :: group_at(:)
      !> Faults.
      type(fault_list), intent(inout) :: faults

      character(len=len(table%groups%name)) :: names(size(table%groups))
      integer :: i, j, meant

      names = table%groups%name
      do i = 1, size(list%groups)
         group_at(i) = 0
         do j = 1, size(table%groups)
            if (table%groups(j)%name == list%groups(i)%name) group_at(i) = j
         end do
         j = group_at(i)
         if (j == 0) cycle
         if (table%group_lines(j) == 0) then
            table%group_lines(j) = list%groups(i)%line
         else
            call faults%add(list%groups(i)%line, '&'//trim(table%groups(j)%name)//': the group is repeated, it began in line ' &
               //to_text(table%group_lines(j)))
         end if
      end do
      do i = 1, size(list%groups)
         if (group_at(i) > 0 .or. len(list%groups(i)%name) == 0) cycle
         if (faults%is_full()) exit
         call faults%add(list%groups(i)%line, '&'//excerpt(list%groups(i)%name)//': unknown group'// &
            did_you_mean('&'//list%groups(i)%name, '&'//names))
         ! Its keys are checked as those of the group that was probably meant.
         meant = nearest_name('&'//list%groups(i)%name, '&'//names)
         if (meant == 0) cycle
         if (table%group_lines(meant) > 0) cycle
         table%group_lines(meant) = list%groups(i)%line
         group_at(i) = meant
      end do
   end subroutine match_groups

   !> Find an entry in the table and take its values.
   subroutine match_entry(entry, group, table, faults)
      !> The entry.
      type(entry_type), intent(in) :: entry
      !> Its group.
      character(len=*), intent(in) :: group
      !> The values; the one of this entry is set.
      type(deck_values), intent(inout) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      character(len=len(table%keys%key)) :: names(size(table%keys))
      integer :: i, j, meant

      i = find_key(table%keys, group, entry%key)
      if (i > 0) then
         if (table%values(i)%line > 0) then
            call faults%add(entry%line, '&'//group//': '//entry%key//': the key is repeated, it stands in line '// &
               to_text(table%values(i)%line))
         else
            table%values(i)%line = entry%line
            if (.not. entry%broken) call convert_values(entry, table%keys(i), table%values(i), faults)
         end if
      else if (.not. faults%is_full()) then
         j = 0
         do i = 1, size(table%keys)
            if (table%keys(i)%group /= group) cycle
            j = j + 1
            names(j) = table%keys(i)%key
         end do
         if (.not. entry%broken) then
            call faults%add(entry%line, '&'//group//': unknown key '''//excerpt(entry%key)//''''// &
               key_advice(entry%key, names(:j), table%keys))
         end if
         ! The key that was probably meant does not count as missing.
         meant = nearest_name(entry%key, names(:j))
         if (meant > 0) table%values(table%at(group, trim(names(meant))))%excused = .true.
      end if
   end subroutine match_entry

   !> What to do about a key that does not exist.
   pure function key_advice(key, names, keys) result(text)
      !> What was written.
      character(len=*), intent(in) :: key
      !> Names of the keys of its group, shape (keys of the group).
      character(len=*), intent(in) :: names(:)
      !> All keys, shape (keys).
      type(key_spec), intent(in) :: keys(:)
      !> Advice in brackets; empty if there is none.
      character(len=:), allocatable :: text

      integer :: i

      text = did_you_mean(key, names)
      if (len(text) > 0) return
      do i = 1, size(keys)
         if (keys(i)%key == key) then
            text = ' (it belongs in &'//trim(keys(i)%group)//')'
            return
         end if
      end do
   end function key_advice

   !> Give each absent key its default.
   subroutine fill_defaults(table, faults)
      !> The values.
      type(deck_values), intent(inout) :: table
      !> Faults; the defaults of the table add none.
      type(fault_list), intent(inout) :: faults

      type(namelist_type) :: list
      integer :: i

      do i = 1, size(table%keys)
         if (table%values(i)%line > 0 .or. table%keys(i)%need /= need_never .or. table%keys(i)%derived) cycle
         call parse_namelist('&'//trim(table%keys(i)%group)//' '//trim(table%keys(i)%key)//' = '// &
            trim(table%keys(i)%default)//' /', list, faults)
         call convert_values(list%entries(1), table%keys(i), table%values(i), faults)
      end do
   end subroutine fill_defaults

   !> Position of a key in the table.
   pure function at(self, group, key) result(position)
      !> The values.
      class(deck_values), intent(in) :: self
      !> Name of a group of the table.
      character(len=*), intent(in) :: group
      !> Name of a key of that group.
      character(len=*), intent(in) :: key
      !> Position.
      integer :: position

      position = find_key(self%keys, group, key)
   end function at

   !> Whether all of some keys of a group have a usable value.
   pure function known(self, group, names) result(all_known)
      !> The values.
      class(deck_values), intent(in) :: self
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Names of the keys, shape (names).
      character(len=*), intent(in) :: names(:)
      !> They do.
      logical :: all_known

      integer :: i

      all_known = .true.
      do i = 1, size(names)
         all_known = all_known .and. self%values(self%at(group, names(i)))%valid
      end do
   end function known

   !> Value of a number; 0 if it is not usable.
   pure function real_of(self, group, key) result(number)
      !> The values.
      class(deck_values), intent(in) :: self
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Name of the key.
      character(len=*), intent(in) :: key
      !> The number, in the unit of the deck.
      real(wp) :: number

      integer :: i

      number = 0.0_wp
      i = self%at(group, key)
      if (self%values(i)%valid) number = self%values(i)%reals(1)
   end function real_of

   !> Value of a whole number; 0 if it is not usable.
   pure function integer_of(self, group, key) result(number)
      !> The values.
      class(deck_values), intent(in) :: self
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Name of the key.
      character(len=*), intent(in) :: key
      !> The number.
      integer :: number

      integer :: i

      number = 0
      i = self%at(group, key)
      if (self%values(i)%valid) number = self%values(i)%whole
   end function integer_of

   !> Values of a list of numbers; none if they are not usable.
   pure function reals_of(self, group, key) result(numbers)
      !> The values.
      class(deck_values), intent(in) :: self
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Name of the key.
      character(len=*), intent(in) :: key
      !> The numbers, in the unit of the deck, shape (numbers).
      real(wp), allocatable :: numbers(:)

      integer :: i

      i = self%at(group, key)
      if (self%values(i)%valid) then
         numbers = self%values(i)%reals
      else
         allocate (numbers(0))
      end if
   end function reals_of

   !> Value of a text or word; empty if it is not usable.
   pure function text_of(self, group, key) result(text)
      !> The values.
      class(deck_values), intent(in) :: self
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Name of the key.
      character(len=*), intent(in) :: key
      !> The text.
      character(len=:), allocatable :: text

      integer :: i

      text = ''
      i = self%at(group, key)
      if (self%values(i)%valid) text = self%values(i)%texts(1)%text
   end function text_of

end module spurflex_io_values
