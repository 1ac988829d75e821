!> Cuts namelist text into words, strings and signs, each with its line.
module spurflex_io_lexer
   use spurflex_base_text, only: to_text
   use spurflex_io_faults, only: fault_list, excerpt
   implicit none
   private

   public :: token_type, tokenize, small_letters, is_name
   public :: token_word, token_string, token_broken, token_comma, token_equals, token_group, token_slash

   !> Anything unquoted: a key, a number, a word.
   integer, parameter :: token_word = 1
   !> Text in quotes; the quotes belong to it.
   integer, parameter :: token_string = 2
   !> Text whose closing quote is missing; the fault is noted.
   integer, parameter :: token_broken = 3
   !> A comma.
   integer, parameter :: token_comma = 4
   !> An equals sign.
   integer, parameter :: token_equals = 5
   !> The ampersand and name that begin a group, or `&end`.
   integer, parameter :: token_group = 6
   !> The slash that ends a group.
   integer, parameter :: token_slash = 7

   !> Most pieces of a deck.
   integer, parameter :: most_tokens = 100000

   character(len=1), parameter :: tab = achar(9), line_feed = achar(10), carriage_return = achar(13)
   character(len=*), parameter :: blanks = ' '//tab
   character(len=*), parameter :: ends = line_feed//carriage_return
   character(len=*), parameter :: capitals = 'ABCDEFGHIJKLMNOPQRSTUVWXYZ', letters = 'abcdefghijklmnopqrstuvwxyz'
   character(len=*), parameter :: quotes = '''"'

   !> One piece of the text.
   type :: token_type
      !> `token_word` ...
      integer :: kind = token_word
      !> Its first and last character in the text.
      integer :: first = 0, last = 0
      !> Its line, from 1.
      integer :: line = 0
   end type token_type

contains

   !> Cut a text into tokens; comments and blanks drop out.
   subroutine tokenize(text, tokens, last_line, faults)
      !> The deck.
      character(len=*), intent(in) :: text
      !> The tokens, shape (tokens).
      type(token_type), allocatable, intent(out) :: tokens(:)
      !> Number of the last line that holds anything.
      integer, intent(out) :: last_line
      !> Faults: those found here are added.
      type(fault_list), intent(inout) :: faults

      type(token_type) :: token
      integer :: position, line, end_of_line, count

      allocate (tokens(min(len(text), most_tokens)))
      count = 0
      line = 1
      last_line = 1
      position = 1
      end_of_line = line_end(text, position)
      do while (position <= len(text))
         if (scan(text(position:position), ends) > 0) then
            line = line + 1
            if (text(position:min(position + 1, len(text))) == carriage_return//line_feed) position = position + 1
            position = position + 1
            end_of_line = line_end(text, position)
         else if (scan(text(position:position), blanks) > 0) then
            position = position + 1
         else if (text(position:position) == '!') then
            last_line = line
            position = end_of_line + 1
         else
            last_line = line
            if (count == most_tokens) then
               call faults%add(line, 'the deck has more than '//to_text(most_tokens)//' words; the rest is not read')
               return
            end if
            token = token_at(text(:end_of_line), position, line)
            if (token%kind == token_broken) then
               call faults%add(line, 'text has no closing quote on its line: '//excerpt(text(token%first:token%last)))
            end if
            count = count + 1
            tokens(count) = token
            position = token%last + 1
         end if
      end do
      tokens = tokens(:count)
   end subroutine tokenize

   !> The token that begins at a position.
   pure function token_at(text, position, line) result(token)
      !> The deck up to the end of the line.
      character(len=*), intent(in) :: text
      !> Where the token begins.
      integer, intent(in) :: position
      !> Line of that position.
      integer, intent(in) :: line
      !> The token.
      type(token_type) :: token

      token%first = position
      token%last = position
      token%line = line
      select case (text(position:position))
      case (',')
         token%kind = token_comma
      case ('=')
         token%kind = token_equals
      case ('''', '"')
         call take_string(text, token)
      case ('&')
         token%kind = token_group
         call take_word(text, token)
      case default
         token%kind = token_word
         if (ends_group(text, position)) then
            token%kind = token_slash
         else
            call take_word(text, token)
         end if
      end select
   end function token_at

   !> Find the end of a quoted text; a doubled quote stands for one inside.
   pure subroutine take_string(text, token)
      !> The deck up to the end of the line.
      character(len=*), intent(in) :: text
      !> The token; its first character is the opening quote.
      type(token_type), intent(inout) :: token

      character(len=1) :: quote
      integer :: i

      quote = text(token%first:token%first)
      token%kind = token_string
      i = token%first + 1
      do while (i <= len(text))
         if (text(i:i) == quote) then
            token%last = i
            if (i == len(text)) return
            if (text(i + 1:i + 1) /= quote) return
            i = i + 1
         end if
         i = i + 1
      end do
      token%kind = token_broken
      token%last = len(text)
   end subroutine take_string

   !> Find the end of a word. An index in brackets belongs to it, whatever it holds.
   pure subroutine take_word(text, token)
      !> The deck up to the end of the line.
      character(len=*), intent(in) :: text
      !> The token; its first character is known.
      type(token_type), intent(inout) :: token

      character(len=*), parameter :: stops = blanks//quotes//',=!'
      integer, parameter :: longest_index = 80
      integer :: i

      i = token%first
      do
         if (text(i:i) == '(') i = i + max(index(text(i:min(i + longest_index, len(text))), ')'), 1) - 1
         token%last = i
         if (i == len(text)) exit
         i = i + 1
         if (scan(text(i:i), stops) > 0) exit
         if (ends_group(text, i)) exit
      end do
   end subroutine take_word

   !> Whether a character is a slash that ends a group and not one inside of an unquoted path.
   pure function ends_group(text, position) result(slash)
      !> The deck up to the end of the line.
      character(len=*), intent(in) :: text
      !> Which character.
      integer, intent(in) :: position
      !> It is a slash before a blank, a comment, a group or the end.
      logical :: slash

      slash = text(position:position) == '/'
      if (slash .and. position < len(text)) slash = scan(text(position + 1:position + 1), blanks//'!&') > 0
   end function ends_group

   !> Last character of a line.
   pure function line_end(text, position) result(last)
      !> The deck.
      character(len=*), intent(in) :: text
      !> A place in the line; may lie behind the text.
      integer, intent(in) :: position
      !> Its last character, without the line end.
      integer :: last

      last = len(text)
      if (position > len(text)) return
      last = scan(text(position:), ends)
      last = merge(position + last - 2, len(text), last > 0)
   end function line_end
   !> Whether a word has the form of a key.
   pure function is_name(word) result(name)
      !> The word.
      character(len=*), intent(in) :: word
      !> A letter, then letters, digits and underscores; no word for a number.
      logical :: name

      name = verify(word(1:1), capitals//letters) == 0 .and. verify(word, capitals//letters//'0123456789_') == 0
      if (name) name = all(small_letters(word) /= [character(len=8) :: 'nan', 'inf', 'infinity'])
   end function is_name

   !> Text with small letters.
   pure function small_letters(text) result(small)
      !> Any text.
      character(len=*), intent(in) :: text
      !> The same in small letters.
      character(len=:), allocatable :: small

      integer :: i, place

      small = text
      do i = 1, len(text)
         place = index(capitals, text(i:i))
         if (place > 0) small(i:i) = letters(place:place)
      end do
   end function small_letters

end module spurflex_io_lexer
