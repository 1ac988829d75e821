!> What two resolved decks disagree on, key by key.
module spurflex_io_deck_difference
   implicit none
   private

   public :: deck_difference

   !> Most differences that are listed.
   integer, parameter :: most_listed = 12
   !> Longest line compared.
   integer, parameter :: line_length = 1024
   character(len=1), parameter :: newline = new_line('a')

contains

   !> The differing lines, each under its group.
   pure function deck_difference(old, new, old_label, new_label) result(text)
      !> A resolved deck.
      character(len=*), intent(in) :: old
      !> Another.
      character(len=*), intent(in) :: new
      !> What the first is, for people.
      character(len=*), intent(in) :: old_label
      !> What the second is.
      character(len=*), intent(in) :: new_label
      !> One line a difference, each led by a newline; empty if there is none.
      character(len=:), allocatable :: text

      character(len=line_length), allocatable :: old_lines(:), new_lines(:)
      integer :: i, j, listed

      call group_lines(old, old_lines)
      call group_lines(new, new_lines)
      text = ''
      listed = 0
      do i = 1, size(old_lines)
         if (old_lines(i) == '' .or. any(new_lines == old_lines(i))) cycle
         listed = listed + 1
         if (listed > most_listed) exit
         text = text//newline//'  '//old_label//': '//trim(old_lines(i))
         do j = 1, size(new_lines)
            if (key_of(new_lines(j)) /= key_of(old_lines(i))) cycle
            text = text//newline//'  '//new_label//': '//trim(new_lines(j))
         end do
      end do
      do j = 1, size(new_lines)
         if (new_lines(j) == '' .or. any(old_lines == new_lines(j))) cycle
         if (any_key(key_of(new_lines(j)), old_lines)) cycle
         listed = listed + 1
         if (listed > most_listed) exit
         text = text//newline//'  '//new_label//': '//trim(new_lines(j))
      end do
      if (listed > most_listed) text = text//newline//'  ...'
      if (len(text) == 0 .and. old /= new) text = newline//'  blanks, or the order of lines'
   end function deck_difference

   !> Take a deck apart into the lines that set a key, each led by its group.
   pure subroutine group_lines(deck, lines)
      !> Namelist text.
      character(len=*), intent(in) :: deck
      !> Lines such as `&sweep speed_count = 5`, shape (newlines + 1), blank where there are fewer.
      character(len=line_length), allocatable, intent(out) :: lines(:)

      character(len=:), allocatable :: line, group
      integer :: first, last, filled

      allocate (lines(count_newlines(deck) + 1))
      lines = ''
      filled = 0
      group = ''
      first = 1
      do while (first <= len(deck))
         last = index(deck(first:), newline) + first - 2
         if (last < first - 1) last = len(deck)
         line = trim(adjustl(deck(first:last)))
         first = last + 2
         if (len(line) == 0) cycle
         if (line(1:1) == '&') then
            group = line
         else if (line /= '/') then
            filled = filled + 1
            lines(filled) = group//' '//line
         end if
      end do
   end subroutine group_lines

   !> How many newlines a text has.
   pure function count_newlines(text) result(newlines)
      !> The text.
      character(len=*), intent(in) :: text
      !> Their number.
      integer :: newlines

      integer :: i

      newlines = 0
      do i = 1, len(text)
         if (text(i:i) == newline) newlines = newlines + 1
      end do
   end function count_newlines

   !> Group and key of a line.
   pure function key_of(line) result(key)
      !> A line with its group.
      character(len=*), intent(in) :: line
      !> What stands before the equals sign.
      character(len=:), allocatable :: key

      key = line(:max(index(line, '=') - 1, 0))
      if (len(key) == 0) key = line
   end function key_of

   !> Whether a key is set in any line.
   pure function any_key(key, lines) result(found)
      !> Group and key.
      character(len=*), intent(in) :: key
      !> Lines with their groups.
      character(len=line_length), intent(in) :: lines(:)
      !> It is set.
      logical :: found

      integer :: i

      found = .false.
      do i = 1, size(lines)
         if (key_of(lines(i)) == key) found = .true.
      end do
   end function any_key

end module spurflex_io_deck_difference
