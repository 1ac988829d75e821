!> In which order chunks are handed out, and how long the rest is said to take.
module test_forecast
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: start_static, start_up
   use spurflex_io_case, only: case_type
   use spurflex_measure_response, only: status_missing, status_settled
   use spurflex_sweep_forecast, only: forecast_type, new_forecast
   use spurflex_sweep_plan, only: chunk_type, plan_grid, plan_row
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_forecast

contains

   !> The tests of this suite.
   subroutine collect_forecast(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('every chunk is handed out once', test_permutation), &
                  new_unittest('the pilot is spread evenly', test_pilot), &
                  new_unittest('dearest first', test_dearest), &
                  new_unittest('large chunks first where points cost the same', test_large), &
                  new_unittest('what comes back late changes the order', test_late), &
                  new_unittest('no chunk and one chunk', test_few), &
                  new_unittest('equal times and no times keep the order of the list', test_equal), &
                  new_unittest('one row', test_row), &
                  new_unittest('chained rows', test_chained), &
                  new_unittest('remaining time', test_remaining), &
                  new_unittest('remaining time of a sweep with a dear band', test_band), &
                  new_unittest('many chunks take little time', test_many) &
                  ]
   end subroutine collect_forecast

   !> Tiles of a width and height that cover a grid of so many tiles, row by row.
   pure function tiles(columns, rows, width, height) result(chunks)
      !> Tiles in both directions, and points of each.
      integer, intent(in) :: columns, rows, width, height
      !> The tiles, shape (columns rows).
      type(chunk_type) :: chunks(columns*rows)

      integer :: i, j

      do j = 1, rows
         do i = 1, columns
            chunks(i + (j - 1)*columns) = chunk_type(row=1 + (j - 1)*height, rows=height, first=1 + (i - 1)*width, count=width)
         end do
      end do
   end function tiles

   !> Take all chunks, and tell the time of each when so many later ones have been taken.
   subroutine take_all(forecast, seconds, delay, order)
      !> Forecast.
      type(forecast_type), intent(inout) :: forecast
      !> Time of each chunk [s].
      real(wp), intent(in) :: seconds(:)
      !> Chunks on their way.
      integer, intent(in) :: delay
      !> The chunks as they were taken; 0 where none was left.
      integer, intent(out) :: order(:)

      integer :: k

      do k = 1, size(order)
         call forecast%next(order(k))
         if (k > delay) call forecast%note(order(k - delay), seconds(order(k - delay)))
      end do
   end subroutine take_all

   !> Any grid, any missing points, chained or not; times in any order.
   subroutine test_permutation(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      type(forecast_type) :: forecast
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: status(:, :), order(:), times(:)
      real(wp), allocatable :: seconds(:)
      integer :: i, k, speeds, rows, share, ranks, delay, dice, chunk
      character(len=:), allocatable :: what

      random = random_stream(61_i8)
      do i = 1, 400
         case%solver%start = merge(start_up, start_static, mod(i, 4) == 0)
         call random%pick(1, merge(500, 60, mod(i, 5) == 0), speeds)
         call random%pick(1, 50, rows)
         call random%pick(1, 10, share)
         call random%pick(1, 30, ranks)
         call random%pick(0, 2*ranks, delay)
         allocate (status(speeds, rows), source=status_settled)
         do k = 1, size(status)
            call random%pick(1, 10, dice)
            if (dice <= share) status(1 + mod(k - 1, speeds), 1 + (k - 1)/speeds) = status_missing
         end do
         if (mod(i, 3) == 0) status = status_missing
         chunks = plan_grid(case, status, ranks)
         allocate (order(size(chunks)), seconds(size(chunks)), times(size(chunks)))
         call random%fill(0.0_wp, 1.0_wp, seconds)
         if (mod(i, 7) == 0) seconds = 0.0_wp
         forecast = new_forecast(chunks)
         call take_all(forecast, seconds, delay, order)
         what = to_text(speeds)//' speeds, '//to_text(rows)//' rows, '//to_text(size(chunks))//' chunks'
         call check(error, all(order >= 1 .and. order <= size(chunks)), what)
         if (allocated(error)) return
         times = 0
         do k = 1, size(order)
            times(order(k)) = times(order(k)) + 1
         end do
         call check(error, all(times == 1), what)
         if (allocated(error)) return
         call check(error, forecast%is_exhausted(), 'exhausted')
         if (allocated(error)) return
         call forecast%next(chunk)
         call check(error, chunk, 0, 'none is left')
         if (allocated(error)) return
         deallocate (status, order, seconds, times)
      end do
   end subroutine test_permutation

   !> Of any eight neighbours in a row or in a column one is in the pilot, and no two of the pilot touch.
   subroutine test_pilot(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 40, rows = 24, share = 8
      type(forecast_type) :: forecast
      logical :: in_pilot(columns, rows)
      integer :: chunk, k, i, j

      forecast = new_forecast(tiles(columns, rows, 16, 16))
      in_pilot = .false.
      do k = 1, columns*rows/share
         call forecast%next(chunk)
         if (k == 1) call check(error, chunk, 1, 'the first of the list')
         if (allocated(error)) return
         in_pilot(1 + mod(chunk - 1, columns), 1 + (chunk - 1)/columns) = .true.
         call forecast%note(chunk, 1.0_wp)
      end do
      do j = 1, rows
         do i = 1, columns
            if (i + share - 1 <= columns) call check(error, count(in_pilot(i:i + share - 1, j)), 1, 'in a row')
            if (allocated(error)) return
            if (j + share - 1 <= rows) call check(error, count(in_pilot(i, j:j + share - 1)), 1, 'in a column')
            if (allocated(error)) return
            if (i < columns .and. j < rows) call check(error, count(in_pilot(i:i + 1, j:j + 1)) <= 1, 'touch')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_pilot

   !> A dear band, and costs that change slowly with the speed: after the pilot the band, then they fall.
   subroutine test_dearest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 48, rows = 16, pilot = columns*rows/8, quarters = 4
      type(forecast_type) :: forecast
      real(wp) :: seconds(columns*rows), mean(quarters)
      integer :: order(columns*rows), i, k, dear

      do k = 1, size(seconds)
         i = 1 + mod(k - 1, columns)
         seconds(k) = 1.0_wp + 4.0_wp*abs(i - 15)/columns
         if (abs(i - 30) < 3) seconds(k) = 100.0_wp
      end do
      forecast = new_forecast(tiles(columns, rows, 8, 8))
      call take_all(forecast, seconds, 0, order)
      associate (rest => seconds(order(pilot + 1:)))
         dear = count(rest > 50.0_wp)
         call check(error, all(rest(:dear/2) > 50.0_wp), 'the band comes first')
         if (allocated(error)) return
         call check(error, all(rest(2*dear:) < 50.0_wp), 'the band is done')
         if (allocated(error)) return
         do k = 1, quarters
            mean(k) = sum(rest(1 + (k - 1)*size(rest)/quarters:k*size(rest)/quarters))
         end do
         call check(error, all(mean(2:) < mean(:quarters - 1)), 'costs fall')
      end associate
   end subroutine test_dearest

   !> Points that cost the same in tiles of several sizes.
   subroutine test_large(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 16, rows = 8, pilot = columns*rows/8
      type(forecast_type) :: forecast
      type(chunk_type) :: chunks(columns*rows)
      integer :: order(columns*rows), k

      chunks = tiles(columns, rows, 8, 1)
      chunks%count = 1 + modulo([(3*k, k=1, size(chunks))], 8)
      chunks(1)%count = 8
      forecast = new_forecast(chunks)
      call take_all(forecast, 0.01_wp*chunks%count, 0, order)
      associate (points => chunks(order(pilot + 1:))%count)
         call check(error, all(points(2:) <= points(:size(points) - 1)))
      end associate
   end subroutine test_large

   !> The pilot has seen nothing of a dear region; as soon as two of it are known, the rest of it comes next.
   subroutine test_late(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 64, rows = 2, dear = 4
      type(forecast_type) :: forecast
      real(wp) :: seconds(columns*rows)
      integer :: order(columns*rows), k, last

      ! Columns 34 to 37: those of the pilot next to it are 33 (first row) and 38 (second row).
      seconds = 1.0_wp
      seconds(34:37) = 50.0_wp
      seconds(columns + 34:columns + 37) = 50.0_wp
      forecast = new_forecast(tiles(columns, rows, 4, 4))
      call take_all(forecast, seconds, 0, order)
      last = maxval(pack([(k, k=1, size(order))], seconds(order) > 1.0_wp))
      call check(error, last < size(order)*3/4, 'the last dear one was number '//to_text(last)//' of '//to_text(size(order)) &
                 //', '//to_text(2*dear)//' were dear')
   end subroutine test_late

   !> Nothing to hand out, and one chunk.
   subroutine test_few(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(forecast_type) :: forecast
      type(chunk_type) :: none(0)
      integer :: chunk

      forecast = new_forecast(none)
      call check(error, forecast%is_exhausted(), 'no chunk')
      if (allocated(error)) return
      call forecast%next(chunk)
      call check(error, chunk, 0)
      if (allocated(error)) return
      forecast = new_forecast([chunk_type(row=0, rows=1, first=7, count=3)])
      call forecast%next(chunk)
      call check(error, chunk, 1)
      if (allocated(error)) return
      call check(error, forecast%is_exhausted(), 'one chunk')
      if (allocated(error)) return
      call check(error, forecast%remaining(4, 1.0_wp) < 0.0_wp, 'nothing is known')
      if (allocated(error)) return
      call forecast%note(1, 2.0_wp)
      call check(error, abs(forecast%remaining(4, 1.0_wp)) <= 0.0_wp, 'nothing is left')
      if (allocated(error)) return
      ! Told twice, counted once.
      call forecast%note(1, 2.0_wp)
      call check(error, abs(forecast%remaining(4, 1.0_wp)) <= 0.0_wp, 'still nothing')
   end subroutine test_few

   !> Where nothing is dearer, or nothing took any time, what follows the pilot is in the order of the list.
   subroutine test_equal(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 30, rows = 9
      type(forecast_type) :: forecast
      real(wp) :: seconds(columns*rows)
      integer :: order(columns*rows), kind, delay, k, falls

      do kind = 0, 1
         seconds = real(kind, wp)
         do delay = 0, 300, 100
            forecast = new_forecast(tiles(columns, rows, 5, 3))
            call take_all(forecast, seconds, delay, order)
            falls = count([(order(k) < order(k - 1), k=2, size(order))])
            call check(error, falls, 1, 'times of '//to_text(kind)//' s, told '//to_text(delay)//' chunks later')
            if (allocated(error)) return
         end do
      end do
      if (forecast%remaining(2, 1.0_wp) > 0.0_wp) call check(error, .false., 'nothing is known and remains')
   end subroutine test_equal

   !> The rigid support is one row: every eighth chunk is the pilot.
   subroutine test_row(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(forecast_type) :: forecast
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: order(:)
      real(wp), allocatable :: seconds(:)
      integer :: status(571), k, pilot

      case%solver%start = start_static
      status = status_missing
      chunks = plan_row(case, status, 4)
      allocate (seconds(size(chunks)), source=1.0_wp)
      allocate (order(size(chunks)))
      pilot = (size(chunks) + 7)/8
      ! The dear ones are in the middle.
      seconds(size(chunks)/2:size(chunks)/2 + 16) = 30.0_wp
      forecast = new_forecast(chunks)
      call take_all(forecast, seconds, 0, order)
      call check(error, all(order(:pilot) == [(k, k=1, size(chunks), 8)]), 'pilot')
      if (allocated(error)) return
      call check(error, all(seconds(order(pilot + 1:pilot + 8)) > 1.0_wp), 'dearest first')
   end subroutine test_row

   !> Chained rows cannot be cut: each is dear or cheap as a whole.
   subroutine test_chained(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: rows = 64, pilot = rows/8
      type(case_type) :: case
      type(forecast_type) :: forecast
      type(chunk_type), allocatable :: chunks(:)
      real(wp) :: seconds(rows)
      integer :: status(30, rows), order(rows)

      case%solver%start = start_up
      status = status_missing
      chunks = plan_grid(case, status, rows)
      call check(error, size(chunks), rows, 'row by row')
      if (allocated(error)) return
      seconds = 1.0_wp
      seconds(30:50) = 9.0_wp
      forecast = new_forecast(chunks)
      call take_all(forecast, seconds, 0, order)
      call check(error, all(seconds(order(pilot + 1:pilot + 12)) > 1.0_wp), 'dearest first')
   end subroutine test_chained

   !> Equal chunks: what is left, over the ranks, less what has been worked already.
   subroutine test_remaining(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 20, rows = 10, ranks = 4, done = 100
      real(wp), parameter :: each = 3.0_wp, near = 1.0e-9_wp
      type(forecast_type) :: forecast
      integer :: order(columns*rows), k

      forecast = new_forecast(tiles(columns, rows, 5, 3))
      do k = 1, ranks
         call forecast%next(order(k))
      end do
      do k = 1, done
         call forecast%next(order(k + ranks))
         call forecast%note(order(k), each)
      end do
      ! Every rank has just told of a chunk, or is half through with the next.
      call check(error, abs(forecast%remaining(ranks, done*each/ranks) - (columns*rows - done)*each/ranks) < near, 'just begun')
      if (allocated(error)) return
      call check(error, abs(forecast%remaining(ranks, (done/ranks + 0.5_wp)*each) &
                            - ((columns*rows - done)/ranks - 0.5_wp)*each) < near, 'half through')
      if (allocated(error)) return
      call check(error, abs(forecast%remaining(ranks, (done/ranks + 90)*each) &
                            - ((columns*rows - done)/ranks - 0.5_wp)*each) < near, 'late')
   end subroutine test_remaining

   !> A band of dear speeds, costs that vary by a factor of three from tile to tile, and a file of which a half is there: at
   !> half of the points the remaining time is right to a quarter. Points a second would be wrong by more than a factor of two.
   subroutine test_band(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 571, rows = 91, ranks = 2
      real(wp), parameter :: tolerance = 0.25_wp
      type(case_type) :: case
      type(forecast_type) :: forecast
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: order(:)
      real(wp), allocatable :: seconds(:)
      integer, allocatable :: status(:, :)
      integer :: k, kind, points
      real(wp) :: part, expected

      case%solver%start = start_static
      allocate (status(speeds, rows))
      random = random_stream(67_i8)
      do kind = 1, 2
         status = status_missing
         if (kind == 2) status(:, 1::2) = status_settled
         chunks = plan_grid(case, status, 16)
         allocate (order(size(chunks)), seconds(size(chunks)))
         do k = 1, size(chunks)
            call random%uniform(0.5_wp, 1.5_wp, part)
            seconds(k) = part*chunks(k)%rows*chunks(k)%count
            if (chunks(k)%first > 450 .and. chunks(k)%first < 480) seconds(k) = 40.0_wp*seconds(k)
         end do
         forecast = new_forecast(chunks)
         points = 0
         do k = 1, size(chunks)
            call forecast%next(order(k))
            call forecast%note(order(k), seconds(order(k)))
            points = points + chunks(order(k))%rows*chunks(order(k))%count
            if (2*points >= count(status == status_missing)) exit
         end do
         expected = (sum(seconds) - sum(seconds(order(:k))))/ranks
         part = forecast%remaining(ranks, sum(seconds(order(:k)))/ranks)
         call check(error, abs(part - expected) <= tolerance*expected, to_text(part)//' instead of '//to_text(expected))
         if (allocated(error)) return
         call check(error, sum(seconds(order(:k)))/ranks > 2.0_wp*expected, 'points a second')
         if (allocated(error)) return
         deallocate (order, seconds)
      end do
   end subroutine test_band

   !> A hundred thousand chunks are put in order in no time.
   subroutine test_many(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Far more than it takes, which is well below a second even with checks of all bounds [s].
      real(wp), parameter :: most = 5.0_wp
      integer, parameter :: columns = 400, rows = 250
      type(forecast_type) :: forecast
      type(random_stream) :: random
      real(wp), allocatable :: seconds(:)
      integer, allocatable :: order(:)
      real(wp) :: begun, ended

      allocate (seconds(columns*rows), order(columns*rows))
      random = random_stream(71_i8)
      call random%fill(0.0_wp, 1.0_wp, seconds)
      call cpu_time(begun)
      forecast = new_forecast(tiles(columns, rows, 4, 4))
      call take_all(forecast, seconds, 2048, order)
      call cpu_time(ended)
      call check(error, ended - begun < most, 'took '//to_text(ended - begun)//' s')
      if (allocated(error)) return
      call check(error, sum(int(order, i8)), int(columns*rows, i8)*(columns*rows + 1)/2, 'each once')
   end subroutine test_many

end module test_forecast
