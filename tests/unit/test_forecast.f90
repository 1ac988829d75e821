!> In which order and in what pieces chunks are handed out, and how long the rest is said to take.
module test_forecast
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: start_static, start_up
   use spurflex_io_case, only: case_type
   use spurflex_measure_response, only: status_missing, status_settled
   use spurflex_sweep_chunk, only: chunk_type, most_halvings, part_of, piece_type, points_of
   use spurflex_sweep_forecast, only: forecast_type, new_forecast
   use spurflex_sweep_plan, only: plan_sweep
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
                  new_unittest('every point is handed out once', test_permutation), &
                  new_unittest('the pilot is spread evenly', test_pilot), &
                  new_unittest('dearest first', test_dearest), &
                  new_unittest('what comes back late changes the order', test_late), &
                  new_unittest('one rank gets whole chunks', test_whole), &
                  new_unittest('no piece is longer than one should wait', test_longest), &
                  new_unittest('dear chunks are cut, and all when little is left', test_cut), &
                  new_unittest('the rigid support goes ahead', test_ahead), &
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

      type(piece_type) :: pieces(size(order))
      integer :: k

      do k = 1, size(order)
         call forecast%next(pieces(k))
         order(k) = pieces(k)%chunk
         if (k > delay) call forecast%note(pieces(k - delay), seconds(order(k - delay)))
      end do
   end subroutine take_all

   !> Any grid, any missing points, chained or not, any number of ranks; times in any order.
   subroutine test_permutation(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      type(forecast_type) :: forecast
      type(chunk_type), allocatable :: chunks(:)
      type(piece_type), allocatable :: pieces(:)
      type(chunk_type) :: part
      integer, allocatable :: status(:, :), times(:, :)
      integer :: i, k, speeds, rows, share, ranks, delay, dice, handed_out
      real(wp) :: seconds
      character(len=:), allocatable :: what

      random = random_stream(61_i8)
      do i = 1, 400
         case%solver%start = merge(start_up, start_static, mod(i, 4) == 0)
         call random%pick(1, merge(500, 60, mod(i, 5) == 0), speeds)
         call random%pick(1, 50, rows)
         call random%pick(1, 10, share)
         call random%pick(1, 30, ranks)
         call random%pick(0, 2*ranks, delay)
         ! Row 0 is the rigid support.
         allocate (status(speeds, 0:rows), times(speeds, 0:rows))
         status = status_settled
         do k = 0, size(status) - 1
            call random%pick(1, 10, dice)
            if (dice <= share) status(1 + mod(k, speeds), k/speeds) = status_missing
         end do
         if (mod(i, 3) == 0) status = status_missing
         chunks = plan_sweep(case, status(:, 0), status(:, 1:), ranks)
         forecast = new_forecast(chunks, ranks)
         allocate (pieces(sum(points_of(chunks)) + 1))
         times = 0
         what = to_text(speeds)//' speeds, '//to_text(rows)//' rows, '//to_text(size(chunks))//' chunks'
         do handed_out = 1, size(pieces)
            call forecast%next(pieces(handed_out))
            if (pieces(handed_out)%chunk == 0) exit
            part = part_of(chunks(pieces(handed_out)%chunk), pieces(handed_out))
            associate (own => times(part%first:part%first + part%count - 1, part%row:part%row + part%rows - 1))
               own = own + 1
            end associate
            call random%uniform(0.0_wp, 1.0_wp, seconds)
            if (mod(i, 7) == 0) seconds = 0.0_wp
            if (handed_out > delay) call forecast%note(pieces(handed_out - delay), seconds)
         end do
         call check(error, forecast%is_exhausted(), what)
         if (allocated(error)) return
         ! A chained row with a missing point is solved as a whole.
         if (case%solver%start == start_up) then
            do k = 0, rows
               if (any(status(:, k) == status_missing)) status(:, k) = status_missing
            end do
         end if
         call check(error, all(times == merge(1, 0, status == status_missing)), what)
         if (allocated(error)) return
         deallocate (status, times, pieces)
      end do
   end subroutine test_permutation

   !> With one rank there is nobody to wait for; only the first chunk tells, in small pieces, how long points take.
   subroutine test_whole(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 12, rows = 5
      type(forecast_type) :: forecast
      type(chunk_type) :: chunks(columns*rows)
      type(piece_type) :: piece
      integer :: k, whole

      chunks = tiles(columns, rows, 32, 8)
      chunks%halvings = most_halvings(chunks(1), 16)
      forecast = new_forecast(chunks, 1)
      whole = 0
      do k = 1, 100*size(chunks)
         if (forecast%is_exhausted()) exit
         call forecast%next(piece)
         if (k == 1) call check(error, piece%halvings, chunks(1)%halvings, 'the first')
         if (allocated(error)) return
         if (piece%halvings == 0) whole = whole + 1
         call forecast%note(piece, 1.0e-3_wp*k)
      end do
      call check(error, forecast%is_exhausted())
      if (allocated(error)) return
      call check(error, whole, size(chunks) - 1)
   end subroutine test_whole

   !> Points that take seconds: even one rank gets no piece that takes much longer than it must.
   subroutine test_longest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 20, rows = 6, smallest = 16
      real(wp), parameter :: each = 0.2_wp, longest = 5.0_wp
      type(forecast_type) :: forecast
      type(chunk_type) :: chunks(columns*rows)
      type(piece_type) :: piece
      integer :: k, points

      chunks = tiles(columns, rows, 32, 8)
      chunks%halvings = most_halvings(chunks(1), smallest)
      forecast = new_forecast(chunks, 1)
      do k = 1, 10*size(chunks)
         call forecast%next(piece)
         points = points_of(part_of(chunks(piece%chunk), piece))
         call check(error, points*each <= longest, to_text(points)//' points')
         if (allocated(error)) return
         call forecast%note(piece, points*each)
      end do
   end subroutine test_longest

   !> A few dear tiles among cheap ones: once it is known which they are none of their pieces takes more than an eighth of the time,
   !> most of the cheap ones stay whole, and what is handed out last is small. The ranks then end at about the same time.
   subroutine test_cut(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 40, rows = 20, ranks = 16, smallest = 16
      real(wp), parameter :: cheap = 1.0e-6_wp, dear = 200.0_wp*cheap
      type(forecast_type) :: forecast
      type(chunk_type) :: chunks(columns*rows)
      type(piece_type) :: piece, pieces(ranks)
      real(wp) :: each(columns*rows), free(ranks), fair, longest
      integer :: k, r, points, whole

      chunks = tiles(columns, rows, 32, 8)
      chunks%halvings = most_halvings(chunks(1), smallest)
      each = cheap
      do k = 1, size(each)
         if (abs(mod(k - 1, columns) - 20) < 2) each(k) = dear
      end do
      forecast = new_forecast(chunks, ranks)
      free = 0.0_wp
      longest = 0.0_wp
      whole = 0
      fair = sum(each*points_of(chunks))/ranks
      do
         r = minloc(free, 1)
         if (pieces(r)%chunk > 0) call forecast%note(pieces(r), each(pieces(r)%chunk) &
                                                     *points_of(part_of(chunks(pieces(r)%chunk), pieces(r))))
         call forecast%next(piece)
         if (piece%chunk == 0) exit
         pieces(r) = piece
         points = points_of(part_of(chunks(piece%chunk), piece))
         if (piece%halvings == 0) whole = whole + 1
         if (free(r) > fair/3.0_wp) longest = max(longest, each(piece%chunk)*points)
         free(r) = free(r) + each(piece%chunk)*points
      end do
      call check(error, points, smallest, 'the last one')
      if (allocated(error)) return
      call check(error, whole > size(chunks)/2, to_text(whole)//' stay whole')
      if (allocated(error)) return
      call check(error, longest < fair/8.0_wp, 'longest '//to_text(longest)//' of '//to_text(fair))
      if (allocated(error)) return
      call check(error, maxval(free) < 1.02_wp*fair, 'the last rank ends at '//to_text(maxval(free)))
   end subroutine test_cut

   !> All rigid chunks come first, in the order of the list; their times say nothing about the others.
   subroutine test_ahead(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 16, rows = 8, rigid = 3
      type(forecast_type) :: forecast
      type(chunk_type) :: chunks(rigid + columns*rows)
      type(piece_type) :: piece
      integer :: k, previous

      chunks(:rigid) = tiles(rigid, 1, 256, 1)
      chunks(:rigid)%row = 0
      chunks(:rigid)%halvings = most_halvings(chunks(1), 16)
      chunks(rigid + 1:) = tiles(columns, rows, 32, 8)
      forecast = new_forecast(chunks, 8)
      previous = 0
      do k = 1, 1000
         call forecast%next(piece)
         if (piece%chunk > rigid) exit
         call check(error, piece%chunk >= previous, 'in order')
         if (allocated(error)) return
         previous = piece%chunk
         call forecast%note(piece, 100.0_wp)
      end do
      call check(error, previous == rigid .and. k > 1, 'all of them')
      if (allocated(error)) return
      call check(error, forecast%remaining(1.0_wp) < 0.0_wp, 'nothing is known of the others')
      if (allocated(error)) return
      call forecast%note(piece, 2.0_wp)
      call check(error, abs(forecast%remaining(100.0_wp*(k - 1)/8 + 2.0_wp/8) - (columns*rows - 1)*2.0_wp/8) < 1.0e-9_wp, &
                 to_text(forecast%remaining(100.0_wp*(k - 1)/8 + 2.0_wp/8)))
   end subroutine test_ahead

   !> Of any eight neighbours in a row or in a column one is in the pilot, and no two of the pilot touch.
   subroutine test_pilot(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 40, rows = 24, share = 8
      type(forecast_type) :: forecast
      logical :: in_pilot(columns, rows)
      type(piece_type) :: piece
      integer :: k, i, j

      forecast = new_forecast(tiles(columns, rows, 16, 16), 1)
      in_pilot = .false.
      do k = 1, columns*rows/share
         call forecast%next(piece)
         if (k == 1) call check(error, piece%chunk, 1, 'the first of the list')
         if (allocated(error)) return
         in_pilot(1 + mod(piece%chunk - 1, columns), 1 + (piece%chunk - 1)/columns) = .true.
         call forecast%note(piece, 1.0_wp)
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
      forecast = new_forecast(tiles(columns, rows, 8, 8), 1)
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
      forecast = new_forecast(tiles(columns, rows, 4, 4), 1)
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
      type(piece_type) :: piece

      forecast = new_forecast(none, 1)
      call check(error, forecast%is_exhausted(), 'no chunk')
      if (allocated(error)) return
      call forecast%next(piece)
      call check(error, piece%chunk, 0)
      if (allocated(error)) return
      forecast = new_forecast([chunk_type(row=0, rows=1, first=7, count=3)], 4)
      call forecast%next(piece)
      call check(error, piece%chunk, 1)
      if (allocated(error)) return
      call check(error, forecast%is_exhausted(), 'one chunk')
      if (allocated(error)) return
      call check(error, forecast%remaining(1.0_wp) < 0.0_wp, 'nothing is known')
      if (allocated(error)) return
      call forecast%note(piece, 2.0_wp)
      call check(error, abs(forecast%remaining(1.0_wp)) <= 0.0_wp, 'nothing is left')
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
            forecast = new_forecast(tiles(columns, rows, 5, 3), 1)
            call take_all(forecast, seconds, delay, order)
            falls = count([(order(k) < order(k - 1), k=2, size(order))])
            call check(error, falls, 1, 'times of '//to_text(kind)//' s, told '//to_text(delay)//' chunks later')
            if (allocated(error)) return
         end do
      end do
      if (forecast%remaining(1.0_wp) > 0.0_wp) call check(error, .false., 'nothing is known and remains')
   end subroutine test_equal

   !> A long row: every eighth chunk is the pilot.
   subroutine test_row(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 30000, tile = 256
      type(case_type) :: case
      type(forecast_type) :: forecast
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: order(:), status(:)
      real(wp), allocatable :: seconds(:)
      integer :: none(0, 0), k, pilot

      case%solver%start = start_static
      allocate (status(speeds), source=status_missing)
      chunks = plan_sweep(case, status, none, 4)
      call check(error, size(chunks), ceiling(real(speeds, wp)/tile))
      if (allocated(error)) return
      allocate (seconds(size(chunks)), source=1.0_wp)
      allocate (order(size(chunks)))
      pilot = (size(chunks) + 7)/8
      ! The dear ones are in the middle.
      seconds(size(chunks)/2:size(chunks)/2 + 16) = 30.0_wp
      forecast = new_forecast(chunks, 1)
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
      integer :: none(0), status(30, rows), order(rows)

      case%solver%start = start_up
      status = status_missing
      chunks = plan_sweep(case, none, status, rows)
      call check(error, size(chunks), rows, 'row by row')
      if (allocated(error)) return
      seconds = 1.0_wp
      seconds(30:50) = 9.0_wp
      forecast = new_forecast(chunks, 1)
      call take_all(forecast, seconds, 0, order)
      call check(error, count(seconds(order(pilot + 1:pilot + 12)) > 1.0_wp) >= 11, 'dearest first')
   end subroutine test_chained

   !> Equal chunks: what is left, over the ranks, less what has been worked already.
   subroutine test_remaining(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: columns = 20, rows = 10, ranks = 4, done = 100
      real(wp), parameter :: each = 3.0_wp, near = 1.0e-9_wp
      type(forecast_type) :: forecast
      type(piece_type) :: pieces(columns*rows)
      integer :: k

      forecast = new_forecast(tiles(columns, rows, 5, 3), ranks)
      do k = 1, ranks
         call forecast%next(pieces(k))
      end do
      do k = 1, done
         call forecast%next(pieces(k + ranks))
         call forecast%note(pieces(k), each)
      end do
      ! Every rank has just told of a chunk, or is half through with the next.
      call check(error, abs(forecast%remaining(done*each/ranks) - (columns*rows - done)*each/ranks) < near, 'just begun')
      if (allocated(error)) return
      call check(error, abs(forecast%remaining((done/ranks + 0.5_wp)*each) &
                            - ((columns*rows - done)/ranks - 0.5_wp)*each) < near, 'half through')
      if (allocated(error)) return
      call check(error, abs(forecast%remaining((done/ranks + 90)*each) &
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
      type(piece_type) :: piece
      integer, allocatable :: status(:, :)
      real(wp), allocatable :: each(:)
      integer :: none(0), k, kind, points, total
      real(wp) :: part, spent, expected

      case%solver%start = start_static
      allocate (status(speeds, rows))
      random = random_stream(67_i8)
      do kind = 1, 2
         status = status_missing
         if (kind == 2) status(:, 1::2) = status_settled
         total = count(status == status_missing)
         chunks = plan_sweep(case, none, status, ranks)
         allocate (each(size(chunks)))
         do k = 1, size(chunks)
            call random%uniform(0.5_wp, 1.5_wp, each(k))
            if (chunks(k)%first > 440 .and. chunks(k)%first < 480) each(k) = 40.0_wp*each(k)
         end do
         forecast = new_forecast(chunks, ranks)
         points = 0
         spent = 0.0_wp
         do while (2*points < total)
            call forecast%next(piece)
            k = points_of(part_of(chunks(piece%chunk), piece))
            call forecast%note(piece, k*each(piece%chunk))
            spent = spent + k*each(piece%chunk)
            points = points + k
         end do
         expected = (sum(each*points_of(chunks)) - spent)/ranks
         part = forecast%remaining(spent/ranks)
         call check(error, abs(part - expected) <= tolerance*expected, to_text(part)//' instead of '//to_text(expected))
         if (allocated(error)) return
         call check(error, spent/ranks > 2.0_wp*expected, 'points a second')
         if (allocated(error)) return
         deallocate (each)
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
      forecast = new_forecast(tiles(columns, rows, 4, 4), 1)
      call take_all(forecast, seconds, 2048, order)
      call cpu_time(ended)
      call check(error, ended - begun < most, 'took '//to_text(ended - begun)//' s')
      if (allocated(error)) return
      call check(error, sum(int(order, i8)), int(columns*rows, i8)*(columns*rows + 1)/2, 'each once')
   end subroutine test_many

end module test_forecast
