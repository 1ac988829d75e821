!> Reads namelist text into groups and entries `key = values`, with the line of each, and collects every fault of form.
!>
!> It knows no key. Beside Fortran's own rules it asks for what makes mistakes visible: nothing but comments stands outside
!> of groups, a value is never left empty, and indices such as `key(2) = ` are refused.
module spurflex_io_namelist
   use spurflex_base_text, only: to_text
   use spurflex_io_entry, only: entry_type, take_entry
   use spurflex_io_faults, only: fault_list, excerpt
   use spurflex_io_lexer, only: token_type, tokenize, token_group, token_slash, small_letters
   implicit none
   private

   public :: namelist_type, group_type, parse_namelist

   !> The beginning of a group.
   type :: group_type
      !> Name in small letters, without the ampersand.
      character(len=:), allocatable :: name
      !> Line of the name.
      integer :: line = 0
   end type group_type

   !> Everything that stands in a deck.
   type :: namelist_type
      !> Groups in their order, shape (groups).
      type(group_type), allocatable :: groups(:)
      !> Entries in their order, shape (entries).
      type(entry_type), allocatable :: entries(:)
      !> Number of the last line that holds anything.
      integer :: last_line = 1
   end type namelist_type

contains

   !> Read namelist text.
   subroutine parse_namelist(text, list, faults)
      !> The deck.
      character(len=*), intent(in) :: text
      !> What it holds; what is faulty is left out or marked as broken.
      type(namelist_type), intent(out) :: list
      !> Faults: those found here are added.
      type(fault_list), intent(inout) :: faults

      type(token_type), allocatable :: tokens(:)
      type(entry_type) :: entry
      integer :: i, entries, groups, open

      call tokenize(text, tokens, list%last_line, faults)
      allocate (list%groups(count(tokens%kind == token_group)), list%entries(size(tokens)))
      entries = 0
      groups = 0
      open = 0
      i = 1
      do while (i <= size(tokens))
         if (tokens(i)%kind == token_group) then
            call take_group(text, tokens(i), list%groups, groups, open, faults)
            i = i + 1
         else if (open == 0) then
            call skip_outside(text, tokens, i, faults)
         else if (tokens(i)%kind == token_slash) then
            open = 0
            i = i + 1
         else
            call take_entry(text, tokens, '&'//excerpt(list%groups(open)%name), i, entry, faults)
            entry%group = open
            entries = entries + 1
            list%entries(entries) = entry
         end if
      end do
      if (open > 0) then
         call faults%add(list%groups(open)%line, '&'//excerpt(list%groups(open)%name)// &
            ': no closing ''/'' before the end of the deck')
      end if
      list%groups = list%groups(:groups)
      list%entries = list%entries(:entries)
   end subroutine parse_namelist

   !> Begin a group, or end one with `&end`.
   subroutine take_group(text, token, groups, number, open, faults)
      !> The deck.
      character(len=*), intent(in) :: text
      !> The ampersand and the name.
      type(token_type), intent(in) :: token
      !> Groups so far, shape (most groups).
      type(group_type), intent(inout) :: groups(:)
      !> Number of groups so far.
      integer, intent(inout) :: number
      !> Position of the open group; 0 if none is.
      integer, intent(inout) :: open
      !> Faults.
      type(fault_list), intent(inout) :: faults

      character(len=:), allocatable :: name

      name = small_letters(text(token%first + 1:token%last))
      if (name == 'end') then
         if (open == 0) call faults%add(token%line, '&end: no group is open here')
         open = 0
         return
      end if
      if (open > 0) then
         call faults%add(groups(open)%line, '&'//excerpt(groups(open)%name)//': no closing ''/'' before &'// &
            excerpt(name)//' in line '//to_text(token%line))
      end if
      if (len(name) == 0) call faults%add(token%line, '''&'' must stand directly before the name of a group')
      number = number + 1
      groups(number)%name = name
      groups(number)%line = token%line
      open = number
   end subroutine take_group

   !> Step over whatever stands outside of groups, with one fault for all of it.
   subroutine skip_outside(text, tokens, i, faults)
      !> The deck.
      character(len=*), intent(in) :: text
      !> Its tokens.
      type(token_type), intent(in) :: tokens(:)
      !> Position of the first token outside; on return, of the next group or behind the end.
      integer, intent(inout) :: i
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer :: first

      first = i
      do while (i <= size(tokens))
         if (tokens(i)%kind == token_group) exit
         i = i + 1
      end do
      if (tokens(first)%kind == token_slash) then
         call faults%add(tokens(first)%line, 'a ''/'' here ends no group')
      else
         call faults%add(tokens(first)%line, 'text outside of groups: '// &
            excerpt(text(tokens(first)%first:tokens(first)%last))// &
            '; a group begins with &name and ends with ''/'', a comment begins with ''!''')
      end if
   end subroutine skip_outside

end module spurflex_io_namelist
