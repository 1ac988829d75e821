!> Which points are handed out, in what pieces and in what order.
module test_plan
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: i8
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: start_down, start_rest, start_static, start_up
   use spurflex_io_case, only: case_type, sweep_spec
   use spurflex_io_results_layout, only: variable_type, flexible_variables, width_of
   use spurflex_measure_record, only: observable_of
   use spurflex_measure_response, only: status_diverged, status_missing, status_not_settled, status_settled
   use spurflex_sweep_chunk, only: chunk_type, part_of, piece_type, points_of
   use spurflex_sweep_plan, only: describe_plan, is_chained, plan_sweep
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_plan

   !> No rigid support.
   integer, parameter :: none(0) = [integer ::]

   integer, parameter :: done(3) = [status_settled, status_not_settled, status_diverged]

   !> Most points and rows of a chunk that is not chained.
   integer, parameter :: largest_chunk = 256, tallest_tile = 8

contains

   !> The tests of this suite.
   subroutine collect_plan(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('starts that chain points', test_chained), &
                  new_unittest('chunks cover the missing points once', test_cover), &
                  new_unittest('no chunk is larger than it may be', test_sizes), &
                  new_unittest('neighbouring missing points make tiles', test_tiles), &
                  new_unittest('what earlier runs left is not cut further', test_left), &
                  new_unittest('tiles keep to the columns of the file', test_columns), &
                  new_unittest('chained rows are whole', test_rows), &
                  new_unittest('softest support first', test_order), &
                  new_unittest('the rigid support is row 0 and comes first', test_rigid), &
                  new_unittest('nothing is missing', test_nothing), &
                  new_unittest('enough pieces for every rank', test_ranks), &
                  new_unittest('what is recorded and what is skipped', test_description) &
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
            if (min(chunk%row, chunk%rows, chunk%first, chunk%count) < 1 .or. chunk%row + chunk%rows - 1 > rows &
                .or. chunk%first + chunk%count - 1 > speeds) then
               times = -1
               return
            end if
            associate (tile => times(chunk%first:chunk%first + chunk%count - 1, chunk%row:chunk%row + chunk%rows - 1))
               tile = tile + 1
            end associate
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

      random = random_stream(31_i8)
      do i = 1, 1000
         case%solver%start = merge(start_static, start_rest, mod(i, 2) == 0)
         call random%pick(1, merge(400, 90, mod(i, 7) == 0), speeds)
         call random%pick(1, merge(60, 12, mod(i, 5) == 0), rows)
         call random%pick(0, 10, share)
         call random%pick(1, 40, ranks)
         call draw(random, speeds, rows, share, status)
         if (mod(i, 3) == 0) call punch(random, status)
         call check(error, all(covered(plan_sweep(case, none, status, ranks), speeds, rows) &
                               == merge(1, 0, status == status_missing)), to_text(speeds)//' speeds, '//to_text(rows) &
                    //' rows, '//to_text(ranks)//' ranks')
         if (allocated(error)) return
      end do
   end subroutine test_cover

   !> A grid of which only a rectangle is done, or missing: what an interrupted run leaves.
   subroutine punch(random, status)
      !> Random numbers.
      type(random_stream), intent(inout) :: random
      !> Status of each point.
      integer, intent(inout) :: status(:, :)

      integer :: i(2), j(2), kind

      call random%pick(1, size(status, 1), i(1))
      call random%pick(i(1), size(status, 1), i(2))
      call random%pick(1, size(status, 2), j(1))
      call random%pick(j(1), size(status, 2), j(2))
      call random%pick(1, 2, kind)
      status = merge(status_missing, status_settled, kind == 1)
      status(i(1):i(2), j(1):j(2)) = merge(status_settled, status_missing, kind == 1)
   end subroutine punch

   !> Large grids, of which much is missing, on few ranks.
   subroutine test_sizes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      integer, allocatable :: status(:, :)
      integer :: i, speeds, rows, share, ranks

      random = random_stream(53_i8)
      case%solver%start = start_static
      do i = 1, 300
         call random%pick(1, 600, speeds)
         call random%pick(1, 100, rows)
         call random%pick(5, 10, share)
         call random%pick(1, 8, ranks)
         call draw(random, speeds, rows, share, status)
         associate (chunks => plan_sweep(case, none, status, ranks))
            if (size(chunks) == 0) cycle
            call check(error, maxval(chunks%rows*chunks%count) <= largest_chunk, 'largest chunk')
            if (allocated(error)) return
            call check(error, maxval(chunks%rows) <= tallest_tile, 'tallest tile')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_sizes

   !> A grid of which nothing is done is cut into few tiles, wider than high, of several rows where there are points enough.
   subroutine test_tiles(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Points in a chunk at least, in the mean: enough for a vector of the processor.
      integer, parameter :: fewest = 4
      integer, parameter :: speeds(4) = [1, 64, 571, 3000], rows(4) = [1, 3, 61, 300]
      type(case_type) :: case
      integer, allocatable :: status(:, :)
      integer :: i, k, ranks

      case%solver%start = start_static
      do k = 1, size(rows)
         do i = 1, size(speeds)
            allocate (status(speeds(i), rows(k)), source=status_missing)
            do ranks = 1, 17, 4
               associate (chunks => plan_sweep(case, none, status, ranks))
                  call check(error, all(covered(chunks, speeds(i), rows(k)) == 1), 'cover')
                  if (allocated(error)) return
                  if (size(status) < 8*fewest*ranks) cycle
                  call check(error, size(chunks)*fewest <= size(status), to_text(speeds(i))//' speeds, '//to_text(rows(k)) &
                             //' rows, '//to_text(ranks)//' ranks: '//to_text(size(chunks))//' chunks')
                  if (allocated(error)) return
                  if (min(speeds(i), rows(k)) < tallest_tile) cycle
                  call check(error, maxval(chunks%count) >= maxval(chunks%rows), 'wider than high')
                  if (allocated(error)) return
                  if (maxval(chunks%rows*chunks%count) < 32) cycle
                  call check(error, maxval(chunks%rows) > 1 .and. maxval(chunks%count) <= 9*maxval(chunks%rows), 'not too wide')
                  if (allocated(error)) return
               end associate
            end do
            deallocate (status)
         end do
      end do
   end subroutine test_tiles

   !> On a grid of many rows no tile crosses the border of a column, and large ones fill it.
   subroutine test_columns(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 571, rows = 91
      type(case_type) :: case
      type(variable_type), allocatable :: variables(:)
      integer, allocatable :: status(:, :)
      integer :: column, ranks

      allocate (variables, source=flexible_variables(sweep_spec(flexible=.true.)))
      call check(error, width_of(variables(1), [speeds, 1]), speeds, 'a single row')
      if (allocated(error)) return
      column = width_of(variables(1), [speeds, rows])
      case%solver%start = start_static
      allocate (status(speeds, rows), source=status_missing)
      do ranks = 1, 100
         associate (chunks => plan_sweep(case, none, status, ranks))
            call check(error, all((chunks%first - 1)/column == (chunks%first + chunks%count - 2)/column), 'borders on ' &
                       //to_text(ranks)//' ranks')
            if (allocated(error)) return
            call check(error, maxval(chunks%count), column, 'width of a large tile')
            if (allocated(error)) return
         end associate
      end do
   end subroutine test_columns

   !> Chained rows are whole, side by side where several are missing; every row of which any point is missing is in one chunk,
   !> and the others are in none.
   subroutine test_rows(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: status(:, :)
      integer :: i, k, speeds, rows, share, ranks

      random = random_stream(37_i8)
      do i = 1, 300
         case%solver%start = merge(start_up, start_down, mod(i, 2) == 0)
         call random%pick(1, 40, speeds)
         call random%pick(1, 40, rows)
         call random%pick(0, 3, share)
         call random%pick(1, 40, ranks)
         call draw(random, speeds, rows, share, status)
         ! Some rows that are missing as a whole, next to each other.
         if (mod(i, 3) == 0) status(:, :rows/2) = status_missing
         chunks = plan_sweep(case, none, status, ranks)
         call check(error, all(chunks%first == 1 .and. chunks%count == speeds), 'whole rows')
         if (allocated(error)) return
         associate (times => covered(chunks, speeds, rows))
            do k = 1, rows
               call check(error, all(times(:, k) == merge(1, 0, any(status(:, k) == status_missing))), 'row '//to_text(k) &
                          //' of '//to_text(rows))
               if (allocated(error)) return
            end do
         end associate
         if (size(chunks) == 0) cycle
         call check(error, maxval(chunks%rows) <= max(1, rows/ranks), 'rows left for the other ranks')
         if (allocated(error)) return
      end do
   end subroutine test_rows

   !> Rows of rising stiffness, tile by tile: no tile is begun that is softer than all rows of the tiles under way. Speeds of rising
   !> number within a row.
   subroutine test_order(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 200, rows = 45
      type(case_type) :: case
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: status(:, :)
      integer :: c, k, share, latest(rows)

      random = random_stream(41_i8)
      case%solver%start = start_rest
      do share = 1, 10
         call draw(random, speeds, rows, share, status)
         chunks = plan_sweep(case, none, status, 2)
         latest = 0
         do c = 1, size(chunks)
            associate (first => chunks(c)%row, last => chunks(c)%row + chunks(c)%rows - 1)
               call check(error, last + tallest_tile > maxval(chunks(:c)%row), 'softest first')
               if (allocated(error)) return
               do k = first, last
                  call check(error, chunks(c)%first > latest(k), 'speeds of row '//to_text(k))
                  if (allocated(error)) return
                  latest(k) = chunks(c)%first + chunks(c)%count - 1
               end do
            end associate
         end do
      end do
   end subroutine test_order

   !> The chunks of the rigid support cover its missing speeds, have no row and come before all others.
   subroutine test_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 571, rows = 12
      type(case_type) :: case
      type(random_stream) :: random
      type(chunk_type), allocatable :: chunks(:)
      integer, allocatable :: rigid(:, :), status(:, :)
      integer :: k

      random = random_stream(43_i8)
      case%solver%start = start_static
      call draw(random, speeds, 1, 6, rigid)
      call draw(random, speeds, rows, 6, status)
      chunks = plan_sweep(case, rigid(:, 1), status, 3)
      k = count(chunks%row == 0)
      call check(error, all(chunks(:k)%row == 0), 'rigid ones first')
      if (allocated(error)) return
      call check(error, all(covered(chunks(k + 1:), speeds, rows) == merge(1, 0, status == status_missing)), 'flexible')
      if (allocated(error)) return
      chunks%row = 1
      call check(error, all(covered(chunks(:k), speeds, 1) == merge(1, 0, rigid == status_missing)), 'rigid')
   end subroutine test_rigid

   !> A run that was stopped has left some pieces of tiles: each is a chunk again, and neighbouring halves are one.
   subroutine test_left(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 571, rows = 91
      type(case_type) :: case
      type(chunk_type), allocatable :: chunks(:), found(:)
      type(chunk_type) :: part
      integer, allocatable :: status(:, :)
      integer :: halvings, c

      case%solver%start = start_static
      allocate (status(speeds, rows), source=status_missing)
      chunks = plan_sweep(case, none, status, 1)
      do halvings = 0, minval(chunks%halvings)
         status = status_settled
         do c = 1, size(chunks)
            part = part_of(chunks(c), piece_type(halvings=halvings, number=mod(5*c, 2**halvings)))
            status(part%first:part%first + part%count - 1, part%row:part%row + part%rows - 1) = status_missing
         end do
         found = plan_sweep(case, none, status, 1)
         call check(error, size(found), size(chunks), to_text(halvings)//' halvings')
         if (allocated(error)) return
         call check(error, all(covered(found, speeds, rows) == merge(1, 0, status == status_missing)), 'cover')
         if (allocated(error)) return
      end do
   end subroutine test_left

   !> A complete grid, and one without points, have no chunks.
   subroutine test_nothing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      integer :: status(10, 3), nowhere(0, 0), no_speed(0, 3), no_row(10, 0)
      integer :: start

      status = status_settled
      do start = start_rest, start_down
         case%solver%start = start
         call check(error, size(plan_sweep(case, none, status, 2)), 0, 'complete')
         if (allocated(error)) return
         call check(error, size(plan_sweep(case, status(:, 1), nowhere, 2)), 0, 'complete row')
         if (allocated(error)) return
         call check(error, size(plan_sweep(case, none, nowhere, 2)), 0, 'empty')
         if (allocated(error)) return
         call check(error, size(plan_sweep(case, none, no_speed, 2)), 0, 'no speeds')
         if (allocated(error)) return
         call check(error, size(plan_sweep(case, none, no_row, 2)), 0, 'no rows')
         if (allocated(error)) return
      end do
   end subroutine test_nothing

   !> Every rank finds a piece, and the pieces are not smaller than that needs.
   subroutine test_ranks(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: speeds = 571, rows = 9, full = 16
      type(case_type) :: case
      integer :: status(speeds, rows), ranks, c

      case%solver%start = start_static
      status = status_missing
      do ranks = 1, 600, 7
         associate (chunks => plan_sweep(case, none, status, ranks))
            call check(error, sum(2**chunks%halvings) >= ranks, to_text(ranks)//' ranks')
            if (allocated(error)) return
            do c = 1, size(chunks)
               call check(error, points_of(chunks(c)) >= 2**chunks(c)%halvings*min(full, speeds*rows/(2*ranks)), 'full lanes')
               if (allocated(error)) return
            end do
         end associate
      end do
   end subroutine test_ranks

   !> The description names what is recorded, how large that is in the file, and what no product asks for.
   subroutine test_description(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      character(len=:), allocatable :: text

      case%solver%start = start_static
      case%sweep%rigid = .true.
      case%sweep%flexible = .true.
      case%sweep%speed_count = 50
      case%sweep%stiffness_count = 4
      allocate (case%output%products(0))
      case%output%record%quantities = [observable_of('y1'), observable_of('mesh_force')]
      text = describe_plan(case)
      call check(error, index(text, 'skipped: spectrum, Poincare section, history, which no product asks for') > 0, text)
      if (allocated(error)) return
      call check(error, index(text, 'recorded') == 0, text)
      if (allocated(error)) return
      case%output%record%spectrum = .true.
      case%output%record%history = .true.
      text = describe_plan(case)
      call check(error, index(text, 'recorded of each point: y1 mesh_force'//new_line('a')) > 0, text)
      if (allocated(error)) return
      ! 250 points, 2 quantities: 3361 lines, and 2049 samples with their rates, of 8 bytes.
      call check(error, index(text, '  spectrum: 3361 lines up to order 4.0, 1/840 apart; 13.4 MB in the file') > 0, text)
      if (allocated(error)) return
      call check(error, index(text, '  history: 8 mesh periods of 256 samples, with their rates; 16.4 MB in the file') > 0, text)
      if (allocated(error)) return
      call check(error, index(text, 'skipped: Poincare section, which no product asks for') > 0, text)
   end subroutine test_description

end module test_plan
