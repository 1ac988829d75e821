!> Places in a text picked at random: words, lines, any stretch; and how one text takes the place of another.
module fuzz_pieces
   use pseudo_random, only: random_stream
   implicit none
   private

   public :: pick, chance, any_place, word_at, number_at, line_at, replaced

   character(len=1), parameter :: tab = achar(9), line_feed = achar(10)
   character(len=*), parameter :: between_words = ' ,='//tab//line_feed
   character(len=*), parameter :: digits = '0123456789'

contains

   !> An integer of a range.
   function pick(stream, first, last) result(number)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> Ends of the range, both of which occur.
      integer, intent(in) :: first, last
      !> The integer; `first` if the range is empty.
      integer :: number

      call stream%pick(first, max(first, last), number)
   end function pick

   !> True in one of so many cases.
   function chance(stream, cases) result(happens)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> How many cases.
      integer, intent(in) :: cases
      !> It is the one.
      logical :: happens

      happens = pick(stream, 1, cases) == 1
   end function chance

   !> Any place of a text; 1 in an empty one.
   function any_place(stream, text) result(place)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The text.
      character(len=*), intent(in) :: text
      !> Position of a character.
      integer :: place

      place = pick(stream, 1, len(text))
   end function any_place

   !> The first word at or behind a place.
   pure function word_at(text, place) result(ends)
      !> The text.
      character(len=*), intent(in) :: text
      !> The place.
      integer, intent(in) :: place
      !> First and last character; the last is before the first if there is no word.
      integer :: ends(2)

      integer :: length

      ends(1) = place
      do while (ends(1) > 1)
         if (scan(text(ends(1) - 1:min(ends(1), len(text))), between_words) > 0) exit
         ends(1) = ends(1) - 1
      end do
      length = verify(text(ends(1):), between_words)
      if (length == 0) then
         ends = [len(text) + 1, len(text)]
         return
      end if
      ends(1) = ends(1) + length - 1
      length = scan(text(ends(1):), between_words)
      ends(2) = merge(ends(1) + length - 2, len(text), length > 0)
   end function word_at

   !> The first value behind a place that looks like a number.
   pure function number_at(text, place) result(ends)
      !> The text.
      character(len=*), intent(in) :: text
      !> The place.
      integer, intent(in) :: place
      !> First and last character; the last is before the first if there is no number.
      integer :: ends(2)

      integer :: from

      from = place
      do while (from <= len(text))
         ends = word_at(text, from)
         if (ends(2) < ends(1)) return
         if (scan(text(ends(1):ends(1)), digits//'+-.') > 0) return
         from = ends(2) + 1
      end do
      ends = [len(text) + 1, len(text)]
   end function number_at

   !> The line that a place lies in.
   pure function line_at(text, place) result(ends)
      !> The text.
      character(len=*), intent(in) :: text
      !> The place.
      integer, intent(in) :: place
      !> First and last character; the newline belongs to it.
      integer :: ends(2)

      integer :: length

      ends(1) = index(text(:min(place, len(text) + 1) - 1), line_feed, back=.true.) + 1
      length = index(text(ends(1):), line_feed)
      ends(2) = merge(ends(1) + length - 1, len(text), length > 0)
   end function line_at

   !> A text with a stretch of it replaced.
   pure function replaced(text, ends, piece) result(changed)
      !> The text.
      character(len=*), intent(in) :: text
      !> First and last character of the stretch; the last is before the first to insert only.
      integer, intent(in) :: ends(2)
      !> What takes its place.
      character(len=*), intent(in) :: piece
      !> The new text.
      character(len=:), allocatable :: changed

      changed = text(:ends(1) - 1)//piece//text(max(ends(2), ends(1) - 1) + 1:)
   end function replaced

end module fuzz_pieces
