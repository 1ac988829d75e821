!> Which points are handed out, in what pieces and in what order.
module test_plan
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: i8
   use spurflex_integrate_options, only: start_down, start_rest, start_static, start_up
   use spurflex_io_case, only: case_type
   use spurflex_measure_response, only: status_diverged, status_missing, status_not_settled, status_settled
   use spurflex_sweep_plan, only: chunk_type, is_chained, plan_grid, plan_row
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_plan

   integer, parameter :: done(3) = [status_settled, status_not_settled, status_diverged]

contains

   !> The tests of this suite.
   subroutine collect_plan(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('starts that chain points', test_chained), &
                  new_unittest('chunks cover the missing points once', test_cover), &
                  new_unittest('chained rows are whole', test_rows), &
                  new_unittest('softest support first', test_order), &
                  new_unittest('the rigid support is row 0', test_rigid), &
                  new_unittest('nothing is missing', test_nothing), &
                  new_unittest('enough chunks for every rank', test_ranks) &
                  ]
   end subroutine collect_plan

   !> A grid with a share of its points missing.
   subroutine draw(random, speeds, rows, missing_share, status)
      !> Random numbers.
      type(random_stream), intent(inout) :: random
      !> Number of speeds and rows.
      integer, intent(in) :: speeds, rows
      !> Missing points in ten.
      integer, intent(in) :: missing_share
      !> Status of each point.
      integer, allocatable, intent(out) :: status(:, :)

      integer :: i, j, dice, kind

      allocate (status(speeds, rows))
      do j = 1, rows
         do i = 1, speeds
            call random%pick(1, 10, dice)
            call random%pick(1, size(done), kind)
            status(i, j) = merge(status_missing, done(kind), dice <= missing_share)
         end do
      end do
   end subroutine draw

   !> How often each point is in a chunk; -1 anywhere if a chunk leaves the grid.
   pure function covered(chunks, speeds, rows) result(times)
      !> Chunks.
      type(chunk_type), intent(in) :: chunks(:)
      !> Number of speeds and rows.
      integer, intent(in) :: speeds, rows
      !> Shape (speed, row).
      integer :: times(speeds, rows)

      integer :: c

      times = 0
      do c = 1, size(chunks)
         associate (chunk => chunks(c))
            if (chunk%row < 1 .or. chunk%row > rows .or. chunk%first < 1 .or. chunk%count < 1 &
                .or. chunk%first + chunk%count - 1 > speeds) then
               times = -1
               return
            end if
            times(chunk%first:chunk%first + chunk%count - 1, chunk%row) = &
               times(chunk%first:chunk%first + chunk%count - 1, chunk%row) + 1
         end associate
      end do
   end function covered

   !> 'up' and 'down' chain, 'rest' and 'static' do not.
   subroutine test_chained(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: starts(4) = [start_rest, start_static, start_up, start_down]
      logical, parameter :: expected(4) = [.false., .false., .true., .true.]
      type(case_type) :: case
      integer :: i

      do i = 1, size(starts)
         case%solver%start = starts(i)
         call check(error, is_chained(case) .eqv. expected(i))
         if (allocated(error)) return
      end do
   end subroutine test_chained

   !> Any grid, any share of missing points, any number of ranks.
   subroutine test_cover(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      integer, allocatable :: status(:, :)
      integer :: i, speeds, rows, share, ranks

      case%solver%start = start_static
      random = random_stream(31_i8)
      do i = 1, 300
         call random%pick(1, 90, speeds)
         call random%pick(1, 12, rows)
         call random%pick(0, 10, share)
         call random%pick(1, 9, ranks)
         call draw(random, speeds, rows, share, status)
         call check(error, all(covered(plan_grid(case, status, ranks), speeds, rows) &
                               == merge(1, 0, status == status_missing)))
         if (allocated(error)) return
      end do
   end subroutine test_cover

   !> A row of which any point is missing is one chunk; others are none.
   subroutine test_rows(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: status(:, :)
      integer :: i, c, speeds, rows, share

      random = random_stream(37_i8)
      do i = 1, 100
         case%solver%start = merge(start_up, start_down, mod(i, 2) == 0)
         call random%pick(1, 40, speeds)
         call random%pick(1, 12, rows)
         call random%pick(0, 3, share)
         call draw(random, speeds, rows, share, status)
         chunks = plan_grid(case, status, 4)
         call check(error, size(chunks), count(any(status == status_missing, dim=1)), 'one chunk a row')
         if (allocated(error)) return
         do c = 1, size(chunks)
            call check(error, chunks(c)%first == 1 .and. chunks(c)%count == speeds, 'whole rows')
            if (allocated(error)) return
            call check(error, any(status(:, chunks(c)%row) == status_missing), 'rows with missing points')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_rows

   !> Rows of rising stiffness, speeds of rising number.
   subroutine test_order(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: status(:, :)
      integer :: c

      random = random_stream(41_i8)
      case%solver%start = start_rest
      call draw(random, 200, 15, 7, status)
      chunks = plan_grid(case, status, 2)
      do c = 2, size(chunks)
         call check(error, chunks(c)%row > chunks(c - 1)%row .or. (chunks(c)%row == chunks(c - 1)%row &
                                                                   .and. chunks(c)%first > chunks(c - 1)%first))
         if (allocated(error)) return
      end do
   end subroutine test_order

   !> The chunks of the rigid support cover its missing speeds and have no row.
   subroutine test_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: status(:, :)

      random = random_stream(43_i8)
      case%solver%start = start_static
      call draw(random, 571, 1, 6, status)
      chunks = plan_row(case, status(:, 1), 3)
      call check(error, all(chunks%row == 0), 'row')
      if (allocated(error)) return
      chunks%row = 1
      call check(error, all(covered(chunks, 571, 1) == merge(1, 0, status == status_missing)), 'cover')
   end subroutine test_rigid

   !> A complete grid, and one without points, have no chunks.
   subroutine test_nothing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      integer :: status(10, 3), none(0, 0)
      integer :: start

      status = status_settled
      do start = start_rest, start_down
         case%solver%start = start
         call check(error, size(plan_grid(case, status, 2)), 0, 'complete')
         if (allocated(error)) return
         call check(error, size(plan_grid(case, none, 2)), 0, 'empty')
         if (allocated(error)) return
      end do
   end subroutine test_nothing

   !> No chunk holds more than a small part of the work of a rank.
   subroutine test_ranks(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 571, rows = 9, part = 8
      type(case_type) :: case
      integer :: status(speeds, rows), ranks

      case%solver%start = start_static
      status = status_missing
      do ranks = 1, 64
         associate (chunks => plan_grid(case, status, ranks))
            call check(error, part*maxval(chunks%count) <= speeds*rows/ranks)
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_ranks

end module test_plan
