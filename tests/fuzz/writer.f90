!> Text that is written piece by piece, with blanks and comments strewn in, and the line at which it has arrived.
module fuzz_writer
   use pseudo_random, only: random_stream
   use fuzz_pieces, only: pick, chance
   implicit none
   private

   public :: writer_type

   character(len=1), parameter :: tab = achar(9)

   !> What is written, and at which line it has arrived.
   type :: writer_type
      !> The text so far.
      character(len=:), allocatable :: text
      !> The line end in use.
      character(len=:), allocatable :: line_end
      !> The line being written.
      integer :: line = 1
   contains
      !> Add a piece.
      procedure :: put
      !> Add what means nothing, and begins a new line.
      procedure :: new_line
      !> Add blanks.
      procedure :: space
   end type writer_type

contains

   !> Add a piece.
   subroutine put(self, piece)
      !> What is written.
      class(writer_type), intent(inout) :: self
      !> The piece; a line end only at its end.
      character(len=*), intent(in) :: piece

      if (len(piece) >= len(self%line_end)) then
         if (piece(len(piece) - len(self%line_end) + 1:) == self%line_end) self%line = self%line + 1
      end if
      self%text = self%text//piece
   end subroutine put

   !> Begin a new line, behind a comment perhaps and blank lines.
   subroutine new_line(self, stream)
      !> What is written.
      class(writer_type), intent(inout) :: self
      !> Random numbers.
      type(random_stream), intent(inout) :: stream

      call self%space(stream)
      if (chance(stream, 4)) call self%put('! &sweep speed_first = 1.0 / it''s "only" a comment')
      call self%put(self%line_end)
      do while (chance(stream, 4))
         call self%space(stream)
         call self%put(self%line_end)
      end do
   end subroutine new_line

   !> Add blanks, perhaps.
   subroutine space(self, stream)
      !> What is written.
      class(writer_type), intent(inout) :: self
      !> Random numbers.
      type(random_stream), intent(inout) :: stream

      integer, parameter :: most = 6

      call self%put(repeat(' ', pick(stream, 0, most)))
      if (chance(stream, 3)) call self%put(tab)
   end subroutine space

end module fuzz_writer
