!> The name that somebody probably meant.
module spurflex_io_suggest
   use spurflex_io_lexer, only: small_letters
   implicit none
   private

   public :: nearest_name, did_you_mean

   !> Longer words are not compared.
   integer, parameter :: most_characters = 40

contains

   !> Position of the name that is closest to a word.
   pure function nearest_name(word, names) result(nearest)
      !> What was written.
      character(len=*), intent(in) :: word
      !> Names that exist, shape (names), padded with blanks.
      character(len=*), intent(in) :: names(:)
      !> Position in `names`; 0 if none is close.
      integer :: nearest

      integer, parameter :: letters_per_slip = 3, shortest_part = 3
      integer :: i, distance, best

      nearest = 0
      if (len_trim(word) == 0 .or. len_trim(word) > most_characters) return
      best = (len_trim(word) + letters_per_slip - 1)/letters_per_slip + 1
      do i = 1, size(names)
         distance = edit_distance(small_letters(trim(word)), small_letters(trim(names(i))))
         if (distance < best) then
            best = distance
            nearest = i
         end if
      end do
      if (nearest > 0 .or. len_trim(word) < shortest_part) return
      do i = 1, size(names)
         if (index(names(i), small_letters(trim(word))) > 0) then
            nearest = i
            return
         end if
      end do
   end function nearest_name

   !> The end of a message about a misspelled word.
   pure function did_you_mean(word, names) result(text)
      !> What was written.
      character(len=*), intent(in) :: word
      !> Names that exist, shape (names), padded with blanks.
      character(len=*), intent(in) :: names(:)
      !> ` (did you mean 'name'?)`, or nothing if no name is close.
      character(len=:), allocatable :: text

      integer :: nearest

      text = ''
      nearest = nearest_name(word, names)
      if (nearest > 0) text = ' (did you mean '''//trim(names(nearest))//'''?)'
   end function did_you_mean

   !> Slips that turn one word into another: a letter left out, added, replaced, or two neighbours swapped.
   pure function edit_distance(a, b) result(distance)
      !> One word.
      character(len=*), intent(in) :: a
      !> The other.
      character(len=*), intent(in) :: b
      !> Number of slips.
      integer :: distance

      integer :: cost(0:len(a), 0:len(b)), i, j

      cost(:, 0) = [(i, i=0, len(a))]
      cost(0, :) = [(j, j=0, len(b))]
      do j = 1, len(b)
         do i = 1, len(a)
            cost(i, j) = min(cost(i - 1, j) + 1, cost(i, j - 1) + 1, &
               cost(i - 1, j - 1) + merge(0, 1, a(i:i) == b(j:j)))
            if (i < 2 .or. j < 2) cycle
            if (a(i:i) == b(j - 1:j - 1) .and. a(i - 1:i - 1) == b(j:j)) then
               cost(i, j) = min(cost(i, j), cost(max(i - 2, 0), max(j - 2, 0)) + 1)
            end if
         end do
      end do
      distance = cost(len(a), len(b))
   end function edit_distance

end module spurflex_io_suggest
