!> Which points of a result file failed, and why, in words.
module spurflex_io_results_failures
   use spurflex_base_error, only: error_type
   use spurflex_base_text, only: to_text
   use spurflex_io_axes, only: speeds, stiffnesses
   use spurflex_io_case, only: sweep_spec
   use spurflex_io_results_set, only: read_flags
   use spurflex_io_results_support, only: block_type, blocks_of, support_set
   use spurflex_measure_response, only: reason_given_steps, reason_max_periods, reason_most_steps, reason_no_step, &
      reason_non_finite, reason_not_confirmed, status_diverged, status_missing
   implicit none
   private

   public :: failures_text, reason_sentence

   !> Failed points that are named.
   integer, parameter :: most_named = 5
   !> Reasons there are.
   integer, parameter :: reasons = reason_not_confirmed

   character(len=*), parameter :: newline = new_line('a')

   !> What is found while the file is read.
   type :: failures_type
      !> Points that failed.
      integer :: failed = 0
      !> The first of them by name, one a line.
      character(len=:), allocatable :: named
      !> Points by reason, the failed ones left out, shape (reasons).
      integer :: others(reasons) = 0
   end type failures_type

contains

   !> A reason in words.
   pure function reason_sentence(reason) result(sentence)
      !> `reason_...`.
      integer, intent(in) :: reason
      !> The words.
      character(len=:), allocatable :: sentence

      select case (reason)
      case (reason_non_finite)
         sentence = 'the state became infinite or not a number'
      case (reason_no_step)
         sentence = 'the equations of motion cannot be integrated with any steps tried'
      case (reason_max_periods)
         sentence = 'no class of motion could be told within max_periods'
      case (reason_given_steps)
         sentence = 'steps_per_period misses the tolerance'
      case (reason_most_steps)
         sentence = 'the most steps there are miss the tolerance'
      case (reason_not_confirmed)
         sentence = 'the second integrator does not find the motion'
      case default
         sentence = 'no reason is known'
      end select
   end function reason_sentence

   !> The failed points of both supports, and the reasons of the others that are not settled.
   subroutine failures_text(rigid, flexible, sweep, text, error)
      !> The supports.
      type(support_set), intent(in) :: rigid, flexible
      !> Grid.
      type(sweep_spec), intent(in) :: sweep
      !> One or more lines; empty if every point is settled.
      character(len=:), allocatable, intent(out) :: text
      !> Set if the file cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(failures_type) :: found
      integer :: reason

      found%named = ''
      text = ''
      call collect(rigid, sweep, 'rigid support, ', found, error)
      if (allocated(error)) return
      call collect(flexible, sweep, '', found, error)
      if (allocated(error)) return
      if (found%failed > 0) then
         text = to_text(found%failed)//' points failed'
         if (found%failed == 1) text = '1 point failed'
         if (found%failed > most_named) text = text//', the first of them'
         text = text//':'//found%named
      end if
      do reason = 1, reasons
         if (found%others(reason) == 0) cycle
         if (text /= '') text = text//newline
         text = text//to_text(found%others(reason))//' not settled or less accurate than asked for: '//reason_sentence(reason)
      end do
   end subroutine failures_text

   !> Collect the points of one support that are not settled.
   subroutine collect(set, sweep, support, found, error)
      !> The support.
      type(support_set), intent(in) :: set
      !> Grid.
      type(sweep_spec), intent(in) :: sweep
      !> Name of the support.
      character(len=*), intent(in) :: support
      !> What is found.
      type(failures_type), intent(inout) :: found
      !> Set if the file cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(block_type), allocatable :: blocks(:)
      integer, allocatable :: states(:), why(:)
      integer :: b, i

      blocks = blocks_of(set)
      do b = 1, size(blocks)
         associate (points => blocks(b)%end - blocks(b)%begin + 1)
            allocate (states(points), why(points))
         end associate
         states = status_missing
         why = 0
         call read_flags(set%points, 'status', blocks(b)%first, blocks(b)%extent, states, error)
         if (.not. allocated(error)) call read_flags(set%points, 'reason', blocks(b)%first, blocks(b)%extent, why, error)
         if (allocated(error)) return
         do i = 1, size(states)
            if (states(i) == status_diverged) then
               found%failed = found%failed + 1
               if (found%failed > most_named) cycle
               found%named = found%named//newline//'  '//support//place(sweep, blocks(b)%begin + i - 1)//': ' &
                             //reason_sentence(why(i))
            else if (why(i) >= 1 .and. why(i) <= reasons) then
               found%others(why(i)) = found%others(why(i)) + 1
            end if
         end do
         deallocate (states, why)
      end do

   contains

      !> Speed and stiffness of a point.
      pure function place(grid, point) result(where_it_is)
         !> Grid.
         type(sweep_spec), intent(in) :: grid
         !> Number of the point in the order of the file.
         integer, intent(in) :: point
         !> Text such as `1500.0 rev/min, 1.0e3 N/m`.
         character(len=:), allocatable :: where_it_is

         associate (speed => speeds(grid), stiffness => stiffnesses(grid))
            where_it_is = to_text(speed(mod(point - 1, grid%speed_count) + 1))//' rev/min'
            if (size(set%points%extents) > 1) where_it_is = where_it_is//', ' &
                                                           //to_text(stiffness((point - 1)/grid%speed_count + 1))//' N/m'
         end associate
      end function place

   end subroutine collect

end module spurflex_io_results_failures
