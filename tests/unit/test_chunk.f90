!> How chunks are cut into pieces.
module test_chunk
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: i8
   use spurflex_base_text, only: to_text
   use spurflex_sweep_chunk, only: chunk_type, halves_of, most_halvings, part_of, piece_type, points_of
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_chunk

contains

   !> The tests of this suite.
   subroutine collect_chunk(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('the pieces of a chunk cover it once', test_cover), &
                  new_unittest('a tile is halved between stiffnesses first', test_shapes), &
                  new_unittest('pieces are halves of larger pieces', test_nested), &
                  new_unittest('a single point', test_point) &
                  ]
   end subroutine collect_chunk

   !> Any chunk, as far as it can be halved: no piece is too small, one more halving would make one.
   subroutine test_cover(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(random_stream) :: random
      type(chunk_type) :: chunk, part
      integer, allocatable :: times(:, :)
      integer :: i, fewest, halvings, number, least
      character(len=:), allocatable :: what

      random = random_stream(83_i8)
      do i = 1, 400
         call random%pick(1, 40, chunk%rows)
         call random%pick(1, 300, chunk%count)
         call random%pick(1, 9, chunk%row)
         call random%pick(1, 9, chunk%first)
         call random%pick(1, 40, fewest)
         if (points_of(chunk) < fewest) cycle
         what = to_text(chunk%rows)//' rows, '//to_text(chunk%count)//' speeds, '//to_text(fewest)//' points'
         do halvings = most_halvings(chunk, fewest), most_halvings(chunk, fewest) + 1
            allocate (times(chunk%count, chunk%rows), source=0)
            least = huge(least)
            do number = 0, 2**halvings - 1
               part = part_of(chunk, piece_type(halvings=halvings, number=number))
               least = min(least, points_of(part))
               associate (own => times(part%first - chunk%first + 1:part%first - chunk%first + part%count, &
                                       part%row - chunk%row + 1:part%row - chunk%row + part%rows))
                  own = own + 1
               end associate
            end do
            call check(error, all(times == 1), what)
            if (allocated(error)) return
            call check(error, (least >= fewest) .eqv. halvings == most_halvings(chunk, fewest), what)
            if (allocated(error)) return
            deallocate (times)
         end do
      end do
   end subroutine test_cover

   !> A tile as wide as a column of the file stays so when it is halved, and no piece is higher than wide.
   subroutine test_shapes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: rows(5) = [8, 4, 4, 2, 2], speeds(5) = [32, 32, 16, 16, 8]
      type(chunk_type) :: part
      integer :: k

      do k = 1, size(rows)
         part = part_of(chunk_type(rows=rows(1), count=speeds(1)), piece_type(halvings=k - 1, number=0))
         call check(error, part%rows == rows(k) .and. part%count == speeds(k), to_text(part%rows)//' rows, ' &
                    //to_text(part%count)//' speeds')
         if (allocated(error)) return
      end do
      call check(error, most_halvings(chunk_type(rows=rows(1), count=speeds(1)), 16), size(rows) - 1)
   end subroutine test_shapes

   !> Pieces 2 n and 2 n + 1 are the halves of piece n of one halving less.
   subroutine test_nested(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(chunk_type), parameter :: chunk = chunk_type(row=4, rows=11, first=7, count=27)
      type(chunk_type) :: halves(2), part
      integer :: halvings, number, k

      do halvings = 0, 4
         do number = 0, 2**halvings - 1
            halves = halves_of(part_of(chunk, piece_type(halvings=halvings, number=number)))
            do k = 1, 2
               part = part_of(chunk, piece_type(halvings=halvings + 1, number=2*number + k - 1))
               call check(error, all([part%row, part%rows, part%first, part%count] &
                                     == [halves(k)%row, halves(k)%rows, halves(k)%first, halves(k)%count]))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_nested

   !> A point cannot be halved.
   subroutine test_point(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(chunk_type), parameter :: point = chunk_type(row=3, first=5, count=1)
      type(chunk_type) :: halves(2)

      call check(error, most_halvings(point, 1), 0)
      if (allocated(error)) return
      halves = halves_of(point)
      call check(error, all(points_of(halves) == [1, 0]))
   end subroutine test_point

end module test_chunk
