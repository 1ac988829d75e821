!> What has to be computed: the points of the grid that are missing, cut into chunks that are handed to ranks.
!>
!> A chunk is a tile of neighbouring speeds and support stiffnesses: dear points, which lie together, fill the lanes of the
!> processor's vectors then, and a tile as wide as a column of the result file is written in one piece. With the starts 'up' and
!> 'down' each point begins where its neighbour ended, and a chunk is some whole rows side by side. The list runs from the
!> softest support to the stiffest; in which order its chunks are handed out is up to the forecast.
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
   implicit none
   private

   public :: chunk_type, plan_row, plan_grid, points_of, is_chained, describe_plan

   !> Points handed out at once at most: few enough to balance, enough to write in one go.
   integer, parameter :: largest_chunk = 256

   !> Speeds of a chunk for each of its support stiffnesses, to a factor of two: a chunk as wide as a column of the result file is
   !> written in one piece a variable, a narrower one row by row; still wider ones fill the lanes less well.
   integer, parameter :: aspect = 4

   !> Chunks that each rank should get at least, where there are enough points: a dear one takes as long as 20 others. With fewer
   !> and larger ones the dearest take longer than all that a rank has to do, with more and smaller ones a point costs more.
   integer, parameter :: chunks_per_rank = 64

   !> Points that a rank solves side by side: fewer in a chunk leave lanes empty.
   integer, parameter :: smallest_chunk = 8

   !> Chunks that each rank should get even if they leave lanes empty: one alone takes as long as the dearest.
   integer, parameter :: fewest_chunks = 2

   !> Neighbouring speeds of some neighbouring rows.
   type :: chunk_type
      !> Index of the first support stiffness, 0 for the rigid support, and number of them.
      integer :: row = 0, rows = 1
      !> Index of the first speed.
      integer :: first = 1
      !> Number of speeds.
      integer :: count = 0
   end type chunk_type

contains

   !> Each point begins where its neighbour ended.
   pure function is_chained(case) result(chained)
      !> Case.
      type(case_type), intent(in) :: case
      !> The start is 'up' or 'down'.
      logical :: chained

      chained = case%solver%start == start_up .or. case%solver%start == start_down
   end function is_chained

   !> Chunks of the missing points of the rigid support.
   pure function plan_row(case, status, ranks) result(chunks)
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of each speed, shape (speed).
      integer, intent(in) :: status(:)
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> The chunks, lowest speed first.
      type(chunk_type), allocatable :: chunks(:)

      chunks = cut_rows(case, reshape(status, [size(status), 1]), ranks)
      chunks%row = 0
   end function plan_row

   !> Chunks of the missing points of the flexible support.
   pure function plan_grid(case, status, ranks) result(chunks)
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of each point, shape (speed, stiffness).
      integer, intent(in) :: status(:, :)
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> The chunks, softest support first.
      type(chunk_type), allocatable :: chunks(:)

      chunks = cut_rows(case, status, ranks)
   end function plan_grid

   !> How many points chunks have.
   pure function points_of(chunks) result(points)
      !> The chunks.
      type(chunk_type), intent(in) :: chunks(:)
      !> Number of points.
      integer :: points

      points = sum(chunks%rows*chunks%count)
   end function points_of

   !> Cut the missing points of some rows into chunks.
   pure function cut_rows(case, status, ranks) result(chunks)
      !> Case.
      type(case_type), intent(in) :: case
      !> Status of each point, shape (speed, row).
      integer, intent(in) :: status(:, :)
      !> Number of ranks.
      integer, intent(in) :: ranks
      !> The chunks.
      type(chunk_type), allocatable :: chunks(:)

      type(chunk_type), allocatable :: found(:)
      integer :: missing, length, height, width, n, first, rows, row, speed

      missing = count(status == status_missing)
      length = max(1, min(smallest_chunk, missing/(ranks*fewest_chunks)), min(largest_chunk, missing/(ranks*chunks_per_rank)))
      ! A power of two: a tile begins with a column of the result file, or several fill it; where there are few rows it is wider.
      width = 1
      do while (2*width**2 <= aspect*length .and. 2*width <= length .and. width < size(status, 1))
         width = 2*width
      end do
      width = max(1, min(width, size(status, 1)))
      height = max(1, min(length/width, size(status, 2)))
      if (height == size(status, 2)) width = max(1, min(length/height, size(status, 1)))
      if (is_chained(case)) then
         height = max(1, min(smallest_chunk, size(status, 2)/ranks))
         width = max(1, size(status, 1))
      end if
      allocate (found(size(status)))
      n = 0
      do first = 1, size(status, 2), height
         rows = min(height, size(status, 2) - first + 1)
         do speed = 1, size(status, 1), width
            associate (tile => status(speed:min(speed + width - 1, size(status, 1)), first:first + rows - 1))
               if (all(tile == status_missing)) then
                  n = n + 1
                  found(n) = chunk_type(row=first, rows=rows, first=speed, count=size(tile, 1))
               else
                  do row = 1, rows
                     call add_runs(tile(:, row), is_chained(case), chunk_type(row=first + row - 1, first=speed), found, n)
                  end do
               end if
            end associate
         end do
      end do
      chunks = found(:n)
   end function cut_rows

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
