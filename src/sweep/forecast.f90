!> What the chunks that are left will cost, and the order in which they are best handed out: dearest first.
!>
!> Points differ in cost by a factor of 100 and dear ones lie together, in bands of speed. A dear chunk that is begun late keeps
!> all other ranks waiting. So a pilot comes first: every eighth tile of the grid, spread evenly. What a point of another tile
!> will cost is then taken from the nearest tiles of which the time is known; chunks that come back make it better.
!> Nothing that is computed depends on the order.
module spurflex_sweep_forecast
   use spurflex_base_kinds, only: i8, wp
   use spurflex_sweep_plan, only: chunk_type
   implicit none
   private

   public :: forecast_type, new_forecast

   !> One bin in so many is in the pilot ...
   integer, parameter :: pilot_share = 8
   !> ... and from row to row of bins it moves on by so many: no two of the pilot are then nearer than the root of 8.
   integer, parameter :: pilot_skew = 3
   !> Distances to the next bin of speed and of row: costs change faster with the speed.
   integer(i8), parameter :: speed_step = 2_i8, row_step = 1_i8
   !> What is expected changes when a quarter more is known: dear regions that the pilot has missed are then found. Before the order
   !> depends on it, twice as much is enough.
   integer, parameter :: revision_share = 4
   !> Bins in each direction at most.
   integer, parameter :: most_bins = 1024
   !> Chunks are sorted by classes of cost, so many to a factor of two, and all that cost less than the last one are equal.
   integer, parameter :: classes_per_octave = 8, classes = 24*classes_per_octave

   !> The chunks of one phase, what they cost or will cost.
   type :: forecast_type
      private
      !> Chunks in the order in which they are handed out; how many have been, how many are the pilot.
      integer, allocatable :: order(:)
      integer :: handed_out = 0, pilot = 0
      !> Points of each chunk; what it is expected to take, before its time is known [s].
      integer, allocatable :: points(:)
      real(wp), allocatable :: expected(:)
      !> Which are handed out; of which the time is known, and how many these are.
      logical, allocatable :: is_out(:), is_known(:)
      integer :: known = 0
      !> Bin of each chunk, shape (speed and row, chunk).
      integer, allocatable :: bin(:, :)
      !> Known times [s] and points of each bin, shape (speed, row).
      real(wp), allocatable :: seconds(:, :), counted(:, :)
      !> The order has been made since the pilot was handed out; so many known times make it again.
      logical :: is_ordered = .false.
      integer :: next_revision = 1
      !> Known times, expected times of the chunks at work and of those that wait [s].
      real(wp) :: spent = 0.0_wp, at_work = 0.0_wp, waiting = 0.0_wp
   contains
      !> Every chunk is handed out.
      procedure :: is_exhausted
      !> The next chunk to hand out.
      procedure :: next
      !> A chunk has taken its time.
      procedure :: note
      !> How long the rest will take.
      procedure :: remaining
   end type forecast_type

contains

   !> A forecast for chunks of which nothing is known yet.
   pure function new_forecast(chunks) result(self)
      !> The chunks.
      type(chunk_type), intent(in) :: chunks(:)
      !> The forecast.
      type(forecast_type) :: self

      integer :: width, height, columns, rows, c
      logical, allocatable :: taken(:, :), in_pilot(:)

      self%points = chunks%rows*chunks%count
      allocate (self%expected(size(chunks)), source=0.0_wp)
      allocate (self%is_out(size(chunks)), self%is_known(size(chunks)), in_pilot(size(chunks)), source=.false.)
      allocate (self%order(size(chunks)), self%bin(2, size(chunks)))
      if (size(chunks) == 0) return
      ! Bins as large as the tiles; of a resumed file, that has no tiles, not too many.
      call divide(chunks%first, chunks%count, width, columns)
      call divide(chunks%row, chunks%rows, height, rows)
      self%bin(1, :) = 1 + (chunks%first - minval(chunks%first))/width
      self%bin(2, :) = 1 + (chunks%row - minval(chunks%row))/height
      allocate (self%seconds(columns, rows), self%counted(columns, rows), source=0.0_wp)
      allocate (taken(columns, rows), source=.false.)
      do c = 1, size(chunks)
         associate (i => self%bin(1, c), j => self%bin(2, c))
            in_pilot(c) = c == 1 .or. (modulo(i - 1 + pilot_skew*(j - 1), pilot_share) == 0 .and. .not. taken(i, j))
            taken(i, j) = taken(i, j) .or. in_pilot(c)
         end associate
      end do
      self%pilot = count(in_pilot)
      self%order = [pack([(c, c=1, size(chunks))], in_pilot), pack([(c, c=1, size(chunks))], .not. in_pilot)]
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

   !> Every chunk is handed out.
   pure function is_exhausted(self) result(exhausted)
      !> Forecast.
      class(forecast_type), intent(in) :: self
      !> None is left.
      logical :: exhausted

      exhausted = self%handed_out == size(self%order)
   end function is_exhausted

   !> The next chunk to hand out: first the pilot, then the dearest that is left.
   pure subroutine next(self, chunk)
      !> Forecast.
      class(forecast_type), intent(inout) :: self
      !> Its number, 0 if none is left.
      integer, intent(out) :: chunk

      chunk = 0
      if (self%is_exhausted()) return
      if (self%handed_out >= self%pilot .and. .not. self%is_ordered) call revise(self)
      self%handed_out = self%handed_out + 1
      chunk = self%order(self%handed_out)
      self%is_out(chunk) = .true.
      self%at_work = self%at_work + self%expected(chunk)
      self%waiting = self%waiting - self%expected(chunk)
   end subroutine next

   !> A chunk has taken its time.
   pure subroutine note(self, chunk, seconds)
      !> Forecast.
      class(forecast_type), intent(inout) :: self
      !> Its number.
      integer, intent(in) :: chunk
      !> Its time [s].
      real(wp), intent(in) :: seconds

      if (self%is_known(chunk)) return
      self%is_known(chunk) = .true.
      self%known = self%known + 1
      self%spent = self%spent + seconds
      self%at_work = self%at_work - self%expected(chunk)
      associate (i => self%bin(1, chunk), j => self%bin(2, chunk))
         self%seconds(i, j) = self%seconds(i, j) + seconds
         self%counted(i, j) = self%counted(i, j) + real(self%points(chunk), wp)
      end associate
      if (self%known >= self%next_revision) call revise(self)
   end subroutine note

   !> How long the rest will take, all ranks together; negative if nothing is known yet.
   pure function remaining(self, ranks, elapsed) result(seconds)
      !> Forecast.
      class(forecast_type), intent(in) :: self
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> Time since the first chunk was handed out [s].
      real(wp), intent(in) :: elapsed
      !> The time [s].
      real(wp) :: seconds

      real(wp) :: begun

      seconds = -1.0_wp
      if (self%known == 0) return
      ! What the ranks have worked and not told yet went into the chunks at work.
      begun = min(max(ranks*elapsed - self%spent, 0.0_wp), 0.5_wp*self%at_work)
      seconds = max(self%at_work + self%waiting - begun, 0.0_wp)/real(ranks, wp)
   end function remaining

   !> Expect other times of the chunks, and put those that are neither handed out nor in the pilot in order.
   pure subroutine revise(self)
      !> Forecast.
      class(forecast_type), intent(inout) :: self

      real(wp), allocatable :: rate(:, :)
      integer :: c

      self%is_ordered = self%handed_out >= self%pilot
      self%next_revision = self%known + merge(self%known/revision_share, self%known, self%is_ordered) + 1
      self%at_work = 0.0_wp
      self%waiting = 0.0_wp
      if (self%known == 0) return
      rate = rates(self%seconds, self%counted)
      do c = 1, size(self%order)
         if (self%is_known(c)) cycle
         self%expected(c) = self%points(c)*rate(self%bin(1, c), self%bin(2, c))
         if (self%is_out(c)) then
            self%at_work = self%at_work + self%expected(c)
         else
            self%waiting = self%waiting + self%expected(c)
         end if
      end do
      associate (rest => self%order(max(self%handed_out, self%pilot) + 1:))
         rest = dearest_first(rest, self%expected(rest))
      end associate
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
