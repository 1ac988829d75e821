!> Faults found in a deck: collected while it is read, and reported all at once.
module spurflex_io_faults
   use spurflex_base_error, only: error_type, fatal_error, exit_deck
   use spurflex_base_text, only: to_text
   implicit none
   private

   public :: fault_list, excerpt, printable, has_control, is_utf8

   !> Most faults kept; further ones are only counted, so that a hostile deck cannot fill the memory.
   integer, parameter :: most_kept = 1000
   !> Most faults shown to the user.
   integer, parameter :: most_shown = 50

   !> One fault.
   type :: fault_type
      !> Line of the deck; 0 where the fault has none.
      integer :: line = 0
      !> What is wrong, without file and line.
      character(len=:), allocatable :: text
   end type fault_type

   !> The faults of one deck.
   type :: fault_list
      private
      !> Faults found, those not kept included.
      integer :: found = 0
      !> The faults kept, shape (most_kept) once there is one.
      type(fault_type), allocatable :: kept(:)
   contains
      !> Note a fault.
      procedure :: add
      !> Number of faults found so far.
      procedure :: count => count_faults
      !> Whether further faults are only counted; then nobody needs to think of good advice.
      procedure :: is_full
      !> Make one error of all faults.
      procedure :: report
   end type fault_list

contains

   !> Note a fault.
   subroutine add(self, line, text)
      !> The list.
      class(fault_list), intent(inout) :: self
      !> Line of the deck; 0 for none.
      integer, intent(in) :: line
      !> What is wrong.
      character(len=*), intent(in) :: text

      if (.not. allocated(self%kept)) allocate (self%kept(most_kept))
      self%found = self%found + 1
      if (self%found > most_kept) return
      self%kept(self%found)%line = line
      self%kept(self%found)%text = text
   end subroutine add

   !> Number of faults found so far.
   pure function count_faults(self) result(number)
      !> The list.
      class(fault_list), intent(in) :: self
      !> Faults found.
      integer :: number

      number = self%found
   end function count_faults

   !> Whether further faults are only counted.
   pure function is_full(self) result(full)
      !> The list.
      class(fault_list), intent(in) :: self
      !> No further fault is kept.
      logical :: full

      full = self%found >= most_kept
   end function is_full

   !> Make one error of all faults, in the order of their lines; no error without faults.
   subroutine report(self, name, error)
      !> The list.
      class(fault_list), intent(in) :: self
      !> Name of the deck, printed before each fault.
      character(len=*), intent(in) :: name
      !> The error; its message has one line per fault.
      type(error_type), allocatable, intent(out) :: error

      character(len=:), allocatable :: message, place
      integer :: lines(most_kept), order(most_kept), i, kept, shown

      if (self%found == 0) return
      kept = min(self%found, most_kept)
      do i = 1, kept
         lines(i) = self%kept(i)%line
      end do
      order(:kept) = line_order(lines(:kept))
      shown = min(self%found, most_shown)
      message = ''
      do i = 1, shown
         place = excerpt(name)
         if (self%kept(order(i))%line > 0) place = place//':'//to_text(self%kept(order(i))%line)
         if (i > 1) message = message//new_line('a')
         message = message//place//': '//self%kept(order(i))%text
      end do
      if (self%found > shown) then
         message = message//new_line('a')//excerpt(name)//': and '//to_text(self%found - shown)//' more'
      end if
      call fatal_error(error, message, exit_deck)
   end subroutine report

   !> The order that sorts lines and keeps equal ones in their order.
   pure function line_order(lines) result(order)
      !> Lines, shape (n).
      integer, intent(in) :: lines(:)
      !> Positions in `lines`.
      integer :: order(size(lines))

      integer :: i, j, this

      order = [(i, i=1, size(lines))]
      do i = 2, size(lines)
         this = order(i)
         do j = i - 1, 1, -1
            if (lines(order(j)) <= lines(this)) exit
            order(j + 1) = order(j)
         end do
         order(j + 1) = this
      end do
   end function line_order

   !> A piece of the deck in a form that is safe and short enough to show.
   pure function excerpt(text) result(shown)
      !> Text from outside.
      character(len=*), intent(in) :: text
      !> At most `most_characters` bytes of it; control characters and what is not UTF-8 show as `?`.
      character(len=:), allocatable :: shown

      integer, parameter :: most_characters = 200
      character(len=:), allocatable :: character
      integer :: i

      shown = ''
      i = 1
      do while (i <= len(text))
         call take_character(text, '?', i, character)
         if (len(shown) + len(character) > most_characters) then
            shown = shown//'...'
            return
         end if
         shown = shown//character
      end do
   end function excerpt

   !> A text without what cannot be printed.
   pure function printable(text, mark) result(clean)
      !> Any text.
      character(len=*), intent(in) :: text
      !> What takes the place of control characters and of what is not UTF-8.
      character(len=1), intent(in) :: mark
      !> The text, in UTF-8.
      character(len=:), allocatable :: clean

      character(len=:), allocatable :: character
      integer :: i

      clean = ''
      i = 1
      do while (i <= len(text))
         call take_character(text, mark, i, character)
         clean = clean//character
      end do
   end function printable

   !> Whether a text holds control characters.
   pure function has_control(text) result(has)
      !> The text.
      character(len=*), intent(in) :: text
      !> It does.
      logical :: has

      integer :: i

      has = .false.
      do i = 1, len(text)
         has = has .or. begins_with_control(text(i:))
      end do
   end function has_control

   !> Take the next character of a text.
   pure subroutine take_character(text, mark, i, character)
      !> The text.
      character(len=*), intent(in) :: text
      !> What takes the place of control characters and of what is not UTF-8.
      character(len=1), intent(in) :: mark
      !> Where the character begins; on return, where the next one does.
      integer, intent(inout) :: i
      !> The character.
      character(len=:), allocatable, intent(out) :: character

      integer :: bytes

      bytes = utf8_bytes(text(i:))
      if (bytes == 0 .or. begins_with_control(text(i:))) then
         character = mark
      else
         character = text(i:i + bytes - 1)
      end if
      i = i + max(bytes, 1)
   end subroutine take_character

   !> Whether a text is UTF-8; plain ASCII is.
   pure function is_utf8(text) result(valid)
      !> The text.
      character(len=*), intent(in) :: text
      !> It is.
      logical :: valid

      integer :: i, bytes

      i = 1
      do while (i <= len(text))
         bytes = utf8_bytes(text(i:))
         if (bytes == 0) exit
         i = i + bytes
      end do
      valid = i > len(text)
   end function is_utf8

   !> Length of the UTF-8 character that begins a text.
   pure function utf8_bytes(text) result(bytes)
      !> The text; not empty.
      character(len=*), intent(in) :: text
      !> 1 to 4; 0 if there is no such character.
      integer :: bytes

      integer :: lead, second, i

      lead = iachar(text(1:1))
      select case (lead)
      case (:int(z'7f'))
         bytes = 1
      case (int(z'c2'):int(z'df'))
         bytes = 2
      case (int(z'e0'):int(z'ef'))
         bytes = 3
      case (int(z'f0'):int(z'f4'))
         bytes = 4
      case default
         bytes = 0
      end select
      if (bytes > len(text)) bytes = 0
      if (bytes < 2) return
      ! Overlong forms, surrogates and codes beyond the last one are left to the second byte.
      second = iachar(text(2:2))
      if ((lead == int(z'e0') .and. second < int(z'a0')) .or. (lead == int(z'ed') .and. second > int(z'9f')) .or. &
         (lead == int(z'f0') .and. second < int(z'90')) .or. (lead == int(z'f4') .and. second > int(z'8f'))) bytes = 0
      do i = 2, bytes
         if (iachar(text(i:i)) < int(z'80') .or. iachar(text(i:i)) > int(z'bf')) then
            bytes = 0
            return
         end if
      end do
   end function utf8_bytes

   !> Whether a text begins with a control character: ASCII's, or those of Unicode from 128 to 159, which terminals obey too.
   pure function begins_with_control(text) result(control)
      !> The text; not empty.
      character(len=*), intent(in) :: text
      !> It does.
      logical :: control

      integer, parameter :: first_printable = 32, delete = 127

      control = iachar(text(1:1)) < first_printable .or. iachar(text(1:1)) == delete
      if (control .or. len(text) < 2) return
      control = iachar(text(1:1)) == int(z'c2') .and. iachar(text(2:2)) >= int(z'80') .and. iachar(text(2:2)) < int(z'a0')
   end function begins_with_control

end module spurflex_io_faults
