!> A chunk of the grid, and the pieces that it is cut into.
!>
!> A chunk is halved across its longer side, and its halves again. Where the cuts are follows from its size alone, so that a piece
!> is known by how often its chunk was halved and by its number.
module spurflex_sweep_chunk
   implicit none
   private

   public :: chunk_type, piece_type, points_of, halves_of, most_halvings, part_of

   !> Up to so many speeds for each of its support stiffnesses a piece is cut between stiffnesses: one as wide as a column of the
   !> result file is written in one go a variable, a narrower one row by row.
   integer, parameter :: aspect = 4

   !> Neighbouring speeds of some neighbouring rows.
   type :: chunk_type
      !> Index of the first support stiffness, 0 for the rigid support, and number of them.
      integer :: row = 0, rows = 1
      !> Index of the first speed.
      integer :: first = 1
      !> Number of speeds.
      integer :: count = 0
      !> So many times it may be halved.
      integer :: halvings = 0
   end type chunk_type

   !> A piece of a chunk.
   type :: piece_type
      !> Number of the chunk; 0 for no piece.
      integer :: chunk = 0
      !> The chunk is halved so many times.
      integer :: halvings = 0
      !> Number of the piece, 0..2**halvings - 1.
      integer :: number = 0
   end type piece_type

contains

   !> How many points a chunk has.
   elemental function points_of(chunk) result(points)
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> Number of points.
      integer :: points

      points = chunk%rows*chunk%count
   end function points_of

   !> The halves of a chunk; the second one of a single point is empty.
   pure function halves_of(chunk) result(halves)
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> Its halves, the first one never smaller.
      type(chunk_type) :: halves(2)

      halves = chunk
      halves%halvings = max(0, chunk%halvings - 1)
      if (chunk%rows > 1 .and. chunk%count <= aspect*chunk%rows) then
         halves(1)%rows = (chunk%rows + 1)/2
         halves(2)%rows = chunk%rows - halves(1)%rows
         halves(2)%row = chunk%row + halves(1)%rows
      else
         halves(1)%count = (chunk%count + 1)/2
         halves(2)%count = chunk%count - halves(1)%count
         halves(2)%first = chunk%first + halves(1)%count
      end if
   end function halves_of

   !> How often a chunk can be halved until a piece has fewer points than wanted.
   pure function most_halvings(chunk, fewest) result(halvings)
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> Fewest points of a piece, at least 1.
      integer, intent(in) :: fewest
      !> That often, and no piece has fewer.
      integer :: halvings

      halvings = 0
      do while (fewest_points(chunk, halvings + 1) >= fewest)
         halvings = halvings + 1
      end do
   end function most_halvings

   !> Points of the smallest piece of a chunk.
   pure recursive function fewest_points(chunk, halvings) result(points)
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> So many times it is halved.
      integer, intent(in) :: halvings
      !> Points; 0 if a piece is empty.
      integer :: points

      type(chunk_type) :: halves(2)

      points = points_of(chunk)
      if (halvings == 0 .or. points == 0) return
      halves = halves_of(chunk)
      points = min(fewest_points(halves(1), halvings - 1), fewest_points(halves(2), halvings - 1))
   end function fewest_points

   !> A piece of a chunk.
   pure function part_of(chunk, piece) result(part)
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> Which piece of it.
      type(piece_type), intent(in) :: piece
      !> The piece.
      type(chunk_type) :: part

      type(chunk_type) :: halves(2)
      integer :: k

      part = chunk
      do k = piece%halvings - 1, 0, -1
         halves = halves_of(part)
         part = halves(1 + ibits(piece%number, k, 1))
      end do
   end function part_of

end module spurflex_sweep_chunk
