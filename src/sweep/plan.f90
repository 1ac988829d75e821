!> What has to be computed: the points of the grid that are missing, cut into chunks.
!>
!> A chunk is a tile of neighbouring speeds and support stiffnesses: dear points, which lie together, fill the lanes of the
!> processor's vectors then, and a tile as wide as a column of the result file is written in one piece. It may be halved, and
!> its halves again, as long as the pieces fill the lanes. With the starts 'up' and 'down' each point begins where its neighbour
!> ended, and a chunk is some whole rows side by side. The list runs from the softest support to the stiffest; in which order
!> its chunks are handed out, and in what pieces, is up to the forecast.
module spurflex_sweep_plan
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: fixed_text, to_text
   use spurflex_integrate_options, only: start_rest, start_static, start_up, start_down
   use spurflex_io_case, only: case_type
   use spurflex_io_record_layout, only: is_recorded, record_bytes, record_kinds, record_section, &
      record_spectrum
   use spurflex_measure_record, only: lines_of, observables, records
   use spurflex_measure_response, only: status_missing
   use spurflex_model_equations, only: rigid_dof, flexible_dof
   use spurflex_sweep_chunk, only: chunk_type, halves_of, most_halvings
   implicit none
   private

   public :: plan_sweep, is_chained, describe_plan

   !> A tile has so many rows and speeds; on a grid of fewer rows it is wider. As wide as a column of the result file it is written
   !> in one piece a variable, a narrower one row by row; still wider or larger ones fill the lanes no better.
   integer, parameter :: tile_rows = 8, tile_speeds = 32

   !> Fewest points of a piece: the points that are solved side by side, twice. In half of that a point costs half as much again,
   !> because no other takes the place of those that have come to their end.
   integer, parameter :: smallest_piece = 16

   !> Pieces that each rank should get even if they leave lanes empty.
   integer, parameter :: fewest_pieces = 2

   !> Most rows side by side with the starts 'up' and 'down': the points that are solved side by side.
   integer, parameter :: most_chained = 8

contains

   !> Each point begins where its neighbour ended.
   pure function is_chained(case) result(chained)
      !> Case.
      type(case_type), intent(in) :: case
      !> The start is 'up' or 'down'.
      logical :: chained

      chained = case%solver%start == start_up .or. case%solver%start == start_down
   end function is_chained

   !> Chunks of the missing points, those of the rigid support first.
   pure function plan_sweep(case, rigid_status, status, ranks) result(chunks)
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of each speed on the rigid support, shape (speed).
      integer, intent(in) :: rigid_status(:)
      !> Status of each point on the flexible one, shape (speed, stiffness).
      integer, intent(in) :: status(:, :)
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> The chunks, the lowest speed first, the softest support first.
      type(chunk_type), allocatable :: chunks(:)

      integer :: fewest

      fewest = max(1, min(smallest_piece, (count(rigid_status == status_missing) + count(status == status_missing)) &
                          /(ranks*fewest_pieces)))
      chunks = cut_rows(case, reshape(rigid_status, [size(rigid_status), 1]), ranks, fewest)
      chunks%row = 0
      chunks = [chunks, cut_rows(case, status, ranks, fewest)]
   end function plan_sweep

   !> Cut the missing points of some rows into chunks.
   pure function cut_rows(case, status, ranks, fewest) result(chunks)
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of each point, shape (speed, row).
      integer, intent(in) :: status(:, :)
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> Fewest points of a piece.
      integer, intent(in) :: fewest
      !> The chunks.
      type(chunk_type), allocatable :: chunks(:)

      type(chunk_type), allocatable :: found(:)
      integer :: height, width, n, first, row, k
      logical :: chained

      chained = is_chained(case)
      height = max(1, min(tile_rows, size(status, 2)))
      width = tile_speeds
      if (height == size(status, 2)) width = max(width, tile_rows*tile_speeds/height)
      if (chained) then
         height = max(1, min(most_chained, size(status, 2)/ranks))
         width = max(1, size(status, 1))
      end if
      allocate (found(size(status)))
      n = 0
      do row = 1, size(status, 2), height
         do first = 1, size(status, 1), width
            call add_missing(status, chained, chunk_type(row=row, rows=min(height, size(status, 2) - row + 1), first=first, &
                                                         count=min(width, size(status, 1) - first + 1)), found, n)
         end do
      end do
      chunks = found(:n)
      if (chained) return
      do k = 1, n
         chunks(k)%halvings = most_halvings(chunks(k), fewest)
      end do
   end function cut_rows

   !> Add what is missing of a tile: as a whole, or in pieces of which everything is missing, which earlier runs may have left.
   pure recursive subroutine add_missing(status, chained, tile, chunks, n)
      !> Status of each point, shape (speed, row).
      integer, intent(in) :: status(:, :)
      !> Rows cannot be cut.
      logical, intent(in) :: chained
      !> The tile.
      type(chunk_type), intent(in) :: tile
      !> The chunks.
      type(chunk_type), intent(inout) :: chunks(:)
      !> How many there are.
      integer, intent(inout) :: n

      type(chunk_type) :: halves(2)
      integer :: row, missing

      associate (points => status(tile%first:tile%first + tile%count - 1, tile%row:tile%row + tile%rows - 1))
         missing = count(points == status_missing)
         if (missing == 0) return
         if (missing == size(points)) then
            n = n + 1
            chunks(n) = tile
         else if (chained .or. size(points) <= smallest_piece) then
            do row = 1, tile%rows
               call add_runs(points(:, row), chained, chunk_type(row=tile%row + row - 1, first=tile%first), chunks, n)
            end do
         else
            halves = halves_of(tile)
            call add_missing(status, chained, halves(1), chunks, n)
            call add_missing(status, chained, halves(2), chunks, n)
         end if
      end associate
   end subroutine add_missing

   !> Add what is missing of one row of a tile, run by run; a chained row as a whole.
   pure subroutine add_runs(status, as_a_whole, begin, chunks, n)
      !> Status of neighbouring points of one row.
      integer, intent(in) :: status(:)
      !> The row cannot be cut.
      logical, intent(in) :: as_a_whole
      !> Row, and index of its first point.
      type(chunk_type), intent(in) :: begin
      !> The chunks.
      type(chunk_type), intent(inout) :: chunks(:)
      !> How many there are.
      integer, intent(inout) :: n

      integer :: i

      if (as_a_whole .and. any(status == status_missing)) then
         n = n + 1
         chunks(n) = begin
         chunks(n)%count = size(status)
         return
      end if
      i = 1
      do while (i <= size(status))
         if (status(i) == status_missing) then
            n = n + 1
            chunks(n) = begin
            chunks(n)%first = begin%first + i - 1
            chunks(n)%count = missing_run(status(i:), size(status))
            i = i + chunks(n)%count
         else
            i = i + 1
         end if
      end do
   end subroutine add_runs

   !> How many points from the first on are missing.
   pure function missing_run(status, most) result(length)
      !> Status of neighbouring points, the first one missing.
      integer, intent(in) :: status(:)
      !> Count no further than this.
      integer, intent(in) :: most
      !> Number of points.
      integer :: length

      length = 1
      do while (length < min(most, size(status)))
         if (status(length + 1) /= status_missing) exit
         length = length + 1
      end do
   end function missing_run

   !> The grid and the planned work, for people.
   pure function describe_plan(case) result(text)
      !> Case.
      type(case_type), intent(in) :: case
      !> Several lines.
      character(len=:), allocatable :: text

      character(len=*), parameter :: newline = new_line('a')
      character(len=:), allocatable :: start, steps

      steps = 'as many as a relative error of '//to_text(case%solver%tolerance)//' needs'
      if (case%solver%steps_per_period > 0) steps = to_text(case%solver%steps_per_period)//' per mesh period'
      associate (sweep => case%sweep)
         text = 'speeds: '//to_text(sweep%speed_count)//' from '//to_text(sweep%speed_first)//' to ' &
                //to_text(sweep%speed_last)//' rev/min'
         if (sweep%flexible) text = text//newline//'support stiffnesses: '//to_text(sweep%stiffness_count)//' from ' &
                                    //to_text(sweep%stiffness_first)//' to '//to_text(sweep%stiffness_last)//' N/m'
         if (sweep%flexible) text = text//newline//'flexible support: ' &
                                    //to_text(int(sweep%speed_count, i8)*sweep%stiffness_count)//' points, ' &
                                    //to_text(flexible_dof)//' of 9 degrees of freedom integrated'
         if (sweep%rigid) text = text//newline//'rigid support: '//to_text(sweep%speed_count)//' points, ' &
                                 //to_text(rigid_dof)//' of 6 degrees of freedom integrated, once per speed'
      end associate
      if (.not. (case%sweep%rigid .and. case%sweep%flexible)) text = text//newline// &
         'skipped: eta, which needs both supports'
      if (.not. any(case%output%products == 'floquet' .or. case%output%products == 'lyapunov')) text = text//newline// &
         'skipped: Floquet multipliers, which no product asks for; stability is decided without them'
      text = text//newline//describe_records(case)
      select case (case%solver%start)
      case (start_rest)
         start = 'from rest, every point on its own'
      case (start_static)
         start = 'from the static equilibrium, every point on its own'
      case (start_up)
         start = 'from the next lower speed, row by row'
      case default
         start = 'from the next higher speed, row by row'
      end select
      text = text//newline//'start: '//start//newline//'steps: '//steps//'; at most '//to_text(case%solver%max_periods) &
             //' mesh periods of transient a point'
   end function describe_plan

   !> What is recorded of each point and how large that is in the file, and what is not.
   pure function describe_records(case) result(text)
      !> Case.
      type(case_type), intent(in) :: case
      !> One or more lines.
      character(len=:), allocatable :: text

      character(len=*), parameter :: newline = new_line('a')
      character(len=*), parameter :: names(record_kinds) = [character(len=16) :: 'spectrum', 'Poincare section', 'history']
      real(wp), parameter :: megabyte = 1.0e6_wp
      character(len=:), allocatable :: extent, quantities, skipped
      integer :: kind, i

      text = ''
      skipped = ''
      do kind = 1, record_kinds
         if (is_recorded(case%output%record, kind)) cycle
         if (skipped /= '') skipped = skipped//', '
         skipped = skipped//trim(names(kind))
      end do
      if (records(case%output%record)) then
         quantities = ''
         do i = 1, size(case%output%record%quantities)
            quantities = quantities//' '//trim(observables(case%output%record%quantities(i))%name)
         end do
         text = 'recorded of each point:'//quantities
      end if
      associate (record => case%output%record)
         do kind = 1, record_kinds
            if (.not. is_recorded(record, kind)) cycle
            select case (kind)
            case (record_spectrum)
               extent = to_text(lines_of(record))//' lines up to order '//to_text(record%highest_order)//', 1/' &
                        //to_text(record%spectrum_periods)//' apart'
            case (record_section)
               extent = to_text(record%sections)//' points with their rates'
            case default
               extent = to_text(record%history_periods)//' mesh periods of '//to_text(record%history_samples) &
                        //' samples, with their rates'
            end select
            text = text//newline//'  '//trim(names(kind))//': '//extent//'; ' &
                   //fixed_text(record_bytes(case%sweep, record, kind)/megabyte, 1)//' MB in the file'
         end do
      end associate
      if (skipped == '') return
      if (text /= '') text = text//newline
      text = text//'skipped: '//skipped//', which no product asks for'
   end function describe_records

end module spurflex_sweep_plan
