!> What the chunks that are left will cost, the order in which they are best handed out, and in what pieces: dearest first, and
!> the smaller the less is left.
!>
!> Points differ in cost by a factor of 100 and dear ones lie together, in bands of speed. A dear piece that is begun late keeps
!> all other ranks waiting; but a point costs less in a large piece, where others take the places of those that have come to their
!> end. So a pilot comes first: a piece of every eighth chunk of the grid, spread evenly. What a point of another chunk will cost
!> is then taken from the nearest chunks of which the time is known; pieces that come back make it better. As long as much is
!> left pieces may be dear; what is dear is cut, what is cheap is handed out whole, until little is left for each rank.
!> Nothing that is computed depends on the order or on the pieces.
module spurflex_sweep_forecast
   use spurflex_base_kinds, only: i8, wp
   use spurflex_sweep_chunk, only: chunk_type, part_of, piece_type, points_of
   implicit none
   private

   public :: forecast_type, new_forecast

   !> One bin in so many is in the pilot ...
   integer, parameter :: pilot_share = 8
   !> ... and from row to row of bins it moves on by so many: no two of the pilot are then nearer than the root of 8.
   integer, parameter :: pilot_skew = 3
   !> A piece has at most this part of a rank's points, whatever it seems to cost: a dear one takes as long as 20 others.
   integer, parameter :: largest_part = 16
   !> It should take at most this part of the time that is left; a single rank need not cut at all ...
   integer, parameter :: dearest_part = 8
   !> ... unless that takes longer [s]: what is in hand is lost with a run that is killed, and waited for by one that is asked to
   !> stop. As long as no time of the grid is known, a point counts as the mean of those that went ahead.
   real(wp), parameter :: longest_piece = 5.0_wp
   !> Less than any point takes [s].
   real(wp), parameter :: shortest_point = 1.0e-9_wp
   !> Distances to the next bin of speed and of row: costs change faster with the speed.
   integer(i8), parameter :: speed_step = 2_i8, row_step = 1_i8
   !> What is expected changes when a quarter more is known: dear regions that the pilot has missed are then found. Before the order
   !> depends on it, twice as much is enough.
   integer, parameter :: revision_share = 4
   !> Bins in each direction at most.
   integer, parameter :: most_bins = 1024
   !> Chunks are sorted by classes of cost, so many to a factor of two, and all that cost less than the last one are equal.
   integer, parameter :: classes_per_octave = 8, classes = 24*classes_per_octave

   !> The chunks of a sweep, what they cost or will cost.
   type :: forecast_type
      private
      !> The chunks; number of ranks; points in all.
      type(chunk_type), allocatable :: chunks(:)
      integer :: ranks = 1, points = 0
      !> Chunks that go ahead of all others: what they cost says nothing about these.
      logical, allocatable :: is_ahead(:)
      !> Chunks in the order in which they are handed out, first those that go ahead and the pilot; how many are done with: those of
      !> the pilot when a piece of them is handed out, others when all is.
      integer, allocatable :: order(:)
      integer :: passed = 0
      !> How much of each chunk is handed out, in its smallest pieces; points of it that are not, and that are at work.
      integer, allocatable :: given(:), left(:), out(:)
      !> Points that are handed out, and, but for those that go ahead, of which the time is known.
      integer :: handed_out = 0, known = 0
      !> What a point of each chunk is expected to take [s].
      real(wp), allocatable :: expected(:)
      !> Bin of each chunk, shape (speed and row, chunk).
      integer, allocatable :: bin(:, :)
      !> Known times [s] and points of each bin, shape (speed, row).
      real(wp), allocatable :: seconds(:, :), counted(:, :)
      !> The order has been made since the pilot was handed out; so many points with known times make it again.
      logical :: is_ordered = .false.
      integer :: next_revision = 1
      !> Points of which the time is known, those that go ahead too, and these times; expected times of the points at work and of
      !> those that wait [s].
      integer :: timed = 0
      real(wp) :: spent = 0.0_wp, at_work = 0.0_wp, waiting = 0.0_wp
   contains
      !> Everything is handed out.
      procedure :: is_exhausted
      !> The next piece to hand out.
      procedure :: next
      !> A piece has taken its time.
      procedure :: note
      !> How long the rest will take.
      procedure :: remaining
   end type forecast_type

contains

   !> A forecast for chunks of which nothing is known yet.
   pure function new_forecast(chunks, ranks) result(self)
      !> The chunks.
      type(chunk_type), intent(in) :: chunks(:)
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> The forecast.
      type(forecast_type) :: self

      integer, allocatable :: rest(:)
      logical, allocatable :: taken(:, :), in_pilot(:)
      integer :: width, height, columns, rows, c, k

      self%chunks = chunks
      self%ranks = ranks
      self%left = points_of(chunks)
      self%points = sum(self%left)
      allocate (self%expected(size(chunks)), source=0.0_wp)
      allocate (self%given(size(chunks)), self%out(size(chunks)), self%bin(2, size(chunks)), source=0)
      ! The flexible points wait for their rigid twins, and these are few.
      self%is_ahead = chunks%row == 0 .and. any(chunks%row > 0)
      rest = pack([(c, c=1, size(chunks))], .not. self%is_ahead)
      self%order = pack([(c, c=1, size(chunks))], self%is_ahead)
      if (size(rest) == 0) return
      ! Bins as large as the tiles; of a resumed file, that has no tiles, not too many.
      call divide(chunks(rest)%first, chunks(rest)%count, width, columns)
      call divide(chunks(rest)%row, chunks(rest)%rows, height, rows)
      self%bin(1, rest) = 1 + (chunks(rest)%first - minval(chunks(rest)%first))/width
      self%bin(2, rest) = 1 + (chunks(rest)%row - minval(chunks(rest)%row))/height
      allocate (self%seconds(columns, rows), self%counted(columns, rows), source=0.0_wp)
      allocate (taken(columns, rows), source=.false.)
      allocate (in_pilot(size(rest)))
      do k = 1, size(rest)
         associate (i => self%bin(1, rest(k)), j => self%bin(2, rest(k)))
            in_pilot(k) = k == 1 .or. (modulo(i - 1 + pilot_skew*(j - 1), pilot_share) == 0 .and. .not. taken(i, j))
            taken(i, j) = taken(i, j) .or. in_pilot(k)
         end associate
      end do
      self%order = [self%order, pack(rest, in_pilot)]
   end function new_forecast

   !> Divide the extent of all chunks in one direction into bins.
   pure subroutine divide(first, length, width, bins)
      !> First index and length of each chunk, at least one chunk.
      integer, intent(in) :: first(:), length(:)
      !> Width of a bin, and number of bins.
      integer, intent(out) :: width, bins

      integer :: extent

      extent = maxval(first) - minval(first) + 1
      width = max(1, maxval(length), (extent + most_bins - 1)/most_bins)
      bins = (extent + width - 1)/width
   end subroutine divide

   !> Everything is handed out.
   pure function is_exhausted(self) result(exhausted)
      !> Forecast.
      class(forecast_type), intent(in) :: self
      !> Nothing is left.
      logical :: exhausted

      exhausted = self%handed_out == self%points
   end function is_exhausted

   !> The next piece to hand out: of the chunks that go ahead, then the pilot, then of the dearest chunk that is left.
   pure subroutine next(self, piece)
      !> Forecast.
      class(forecast_type), intent(inout) :: self
      !> The piece; none if none is left.
      type(piece_type), intent(out) :: piece

      integer :: chunk, points

      if (self%is_exhausted()) return
      if (self%passed == size(self%order) .and. .not. self%is_ordered) call revise(self)
      chunk = self%order(self%passed + 1)
      call cut(self, chunk, piece)
      points = points_of(part_of(self%chunks(chunk), piece))
      self%handed_out = self%handed_out + points
      self%left(chunk) = self%left(chunk) - points
      self%out(chunk) = self%out(chunk) + points
      if (self%left(chunk) == 0 .or. .not. (self%is_ordered .or. self%is_ahead(chunk))) self%passed = self%passed + 1
      self%at_work = self%at_work + points*self%expected(chunk)
      self%waiting = self%waiting - points*self%expected(chunk)
   end subroutine next

   !> Cut the next piece off a chunk: the largest that is not too dear and that begins where the last one ended.
   pure subroutine cut(self, chunk, piece)
      !> Forecast.
      type(forecast_type), intent(inout) :: self
      !> Number of the chunk.
      integer, intent(in) :: chunk
      !> The piece.
      type(piece_type), intent(out) :: piece

      real(wp) :: points, each, most
      integer :: smallest

      points = real(points_of(self%chunks(chunk)), wp)
      each = max(self%expected(chunk), shortest_point)
      if (self%known == 0) each = max(self%spent/max(self%timed, 1), shortest_point)
      most = longest_piece/each
      ! The first pieces of all tell how long that may be.
      if (self%timed == 0) most = 1.0_wp
      if (self%ranks > 1) then
         most = min(most, real(self%points, wp)/(self%ranks*largest_part))
         if (self%is_ordered .and. self%known > 0) most = min(most, (self%at_work + self%waiting) &
                                                              /(self%ranks*dearest_part*each))
      end if
      piece%chunk = chunk
      associate (halvings => self%chunks(chunk)%halvings, given => self%given(chunk))
         do while (piece%halvings < halvings)
            smallest = 2**(halvings - piece%halvings)
            if (points <= most*2.0_wp**piece%halvings .and. mod(given, smallest) == 0) exit
            piece%halvings = piece%halvings + 1
         end do
         smallest = 2**(halvings - piece%halvings)
         piece%number = given/smallest
         given = given + smallest
      end associate
   end subroutine cut

   !> A piece has taken its time.
   pure subroutine note(self, piece, seconds)
      !> Forecast.
      class(forecast_type), intent(inout) :: self
      !> The piece.
      type(piece_type), intent(in) :: piece
      !> Its time [s].
      real(wp), intent(in) :: seconds

      integer :: points

      points = points_of(part_of(self%chunks(piece%chunk), piece))
      self%out(piece%chunk) = self%out(piece%chunk) - points
      self%timed = self%timed + points
      self%spent = self%spent + seconds
      if (self%is_ahead(piece%chunk)) return
      self%known = self%known + points
      self%at_work = self%at_work - points*self%expected(piece%chunk)
      associate (i => self%bin(1, piece%chunk), j => self%bin(2, piece%chunk))
         self%seconds(i, j) = self%seconds(i, j) + seconds
         self%counted(i, j) = self%counted(i, j) + real(points, wp)
      end associate
      if (self%known >= self%next_revision) call revise(self)
   end subroutine note

   !> How long the rest will take, all ranks together; negative if nothing is known yet.
   pure function remaining(self, elapsed) result(seconds)
      !> Forecast.
      class(forecast_type), intent(in) :: self
      !> Time since the first piece was handed out [s].
      real(wp), intent(in) :: elapsed
      !> The time [s].
      real(wp) :: seconds

      real(wp) :: begun

      seconds = -1.0_wp
      if (self%known == 0) return
      ! What the ranks have worked and not told yet went into the pieces at work.
      begun = min(max(self%ranks*elapsed - self%spent, 0.0_wp), 0.5_wp*self%at_work)
      seconds = max(self%at_work + self%waiting - begun, 0.0_wp)/real(self%ranks, wp)
   end function remaining

   !> Expect other times of the points; once the pilot is handed out, put the chunks of which something is left in order.
   pure subroutine revise(self)
      !> Forecast.
      class(forecast_type), intent(inout) :: self

      real(wp), allocatable :: rate(:, :)
      integer :: c

      self%is_ordered = self%is_ordered .or. self%passed == size(self%order)
      self%next_revision = self%known + merge(self%known/revision_share, self%known, self%is_ordered) + 1
      if (self%known > 0) then
         rate = rates(self%seconds, self%counted)
         do c = 1, size(self%chunks)
            if (self%is_ahead(c)) cycle
            self%expected(c) = rate(self%bin(1, c), self%bin(2, c))
         end do
         self%at_work = sum(self%out*self%expected)
         self%waiting = sum(self%left*self%expected)
      end if
      if (.not. self%is_ordered) return
      self%order = pack([(c, c=1, size(self%chunks))], self%left > 0)
      self%order = dearest_first(self%order, self%expected(self%order))
      self%passed = 0
   end subroutine revise

   !> What a point of each bin is expected to cost: the mean over the bin and its neighbours of what is known nearest to each.
   !> Of a single tile it would be no good guess, and those taken for the cheapest would turn out dearer.
   pure function rates(seconds, counted) result(rate)
      !> Known times [s] and points of each bin, shape (speed, row).
      real(wp), intent(in) :: seconds(:, :), counted(:, :)
      !> Time of a point [s], shape (speed, row).
      real(wp), allocatable :: rate(:, :)

      integer(i8), allocatable :: nearest(:, :)
      real(wp), allocatable :: here(:, :)
      integer :: columns, rows, i, j

      columns = size(counted, 1)
      rows = size(counted, 2)
      nearest = nearest_known(counted > 0.0_wp)
      allocate (here(columns, rows))
      do j = 1, rows
         do i = 1, columns
            associate (column => 1 + mod(nearest(i, j), int(columns, i8)), row => 1 + nearest(i, j)/columns)
               here(i, j) = seconds(column, row)/counted(column, row)
            end associate
         end do
      end do
      ! At the ends of the grid the last bin is its own neighbour.
      here = (here([1, (i, i=1, columns - 1)], :) + here + here([(i, i=2, columns), columns], :))/3.0_wp
      rate = (here(:, [1, (j, j=1, rows - 1)]) + here + here(:, [(j, j=2, rows), rows]))/3.0_wp
   end function rates

   !> For each bin the nearest one of which something is known: its column and columns times its row, both from 0.
   pure function nearest_known(known) result(nearest)
      !> Of which bins something is known, shape (speed, row); of one at least.
      logical, intent(in) :: known(:, :)
      !> The nearest one, shape (speed, row).
      integer(i8), allocatable :: nearest(:, :)

      integer(i8) :: bins, far
      integer :: i, j

      ! Distance times the number of bins, and the number of the bin: the smallest is the nearest. The distance is that of
      ! going along the speeds and then along the rows.
      bins = size(known, kind=i8)
      far = bins*(size(known, 1)*speed_step + size(known, 2)*row_step)
      allocate (nearest(size(known, 1), size(known, 2)))
      do j = 1, size(known, 2)
         do i = 1, size(known, 1)
            nearest(i, j) = merge(0_i8, far, known(i, j)) + i - 1 + int(j - 1, i8)*size(known, 1)
         end do
         do i = 2, size(known, 1)
            nearest(i, j) = min(nearest(i, j), nearest(i - 1, j) + bins*speed_step)
         end do
         do i = size(known, 1) - 1, 1, -1
            nearest(i, j) = min(nearest(i, j), nearest(i + 1, j) + bins*speed_step)
         end do
      end do
      do j = 2, size(known, 2)
         nearest(:, j) = min(nearest(:, j), nearest(:, j - 1) + bins*row_step)
      end do
      do j = size(known, 2) - 1, 1, -1
         nearest(:, j) = min(nearest(:, j), nearest(:, j + 1) + bins*row_step)
      end do
      nearest = mod(nearest, bins)
   end function nearest_known

   !> Sort chunks by their cost to within a class; equal ones stay in their order.
   pure function dearest_first(chunks, cost) result(sorted)
      !> The chunks.
      integer, intent(in) :: chunks(:)
      !> Their costs, none negative, shape as the chunks.
      real(wp), intent(in) :: cost(:)
      !> The same chunks.
      integer :: sorted(size(chunks))

      integer :: group(size(chunks)), begin(classes + 1), c
      real(wp) :: most, least

      most = max(maxval(cost), tiny(most))
      least = most*2.0_wp**(-real(classes, wp)/classes_per_octave)
      group = classes
      do c = 1, size(chunks)
         if (cost(c) > least) group(c) = min(classes, 1 + int(classes_per_octave*log(most/cost(c))/log(2.0_wp)))
      end do
      begin = 0
      begin(1) = 1
      do c = 1, size(chunks)
         begin(group(c) + 1) = begin(group(c) + 1) + 1
      end do
      do c = 2, classes
         begin(c) = begin(c) + begin(c - 1)
      end do
      do c = 1, size(chunks)
         sorted(begin(group(c))) = chunks(c)
         begin(group(c)) = begin(group(c)) + 1
      end do
   end function dearest_first

end module spurflex_sweep_forecast
