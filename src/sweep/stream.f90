!> The grid as a stream of points: chunks come from the scheduler, points go to lanes, responses go to the file.
module spurflex_sweep_stream
   use mpi_f08, only: MPI_Comm
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_lanes, only: trajectory_type, lanes
   use spurflex_integrate_options, only: start_rest, start_down
   use spurflex_io_axes, only: speeds, stiffnesses
   use spurflex_io_case, only: case_type
   use spurflex_io_log, only: logger
   use spurflex_io_results, only: results_file, write_rigid, write_flexible
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: response, empty_response, nan, status_diverged
   use spurflex_model_equations, only: equations_type, new_equations, rest_deviation
   use spurflex_model_parameters, only: operating_point, support_rigid, support_flexible
   use spurflex_steady_outcome, only: steady_outcome
   use spurflex_steady_stream, only: point_stream, point_job
   use spurflex_sweep_plan, only: chunk_type, is_chained
   use spurflex_sweep_schedule, only: scheduler, new_scheduler
   implicit none
   private

   public :: grid_stream, open_stream, close_stream, no_twin

   !> Larger than every deformation: a rigid twin that is not known, or not on this rank.
   real(wp), parameter :: no_twin = huge(1.0_wp)

   !> A chunk in work on this rank.
   type :: open_chunk
      !> The chunk.
      type(chunk_type) :: chunk
      !> Points handed to lanes, and points not yet finished.
      integer :: handed = 0, left = 0
      !> Responses of the chunk, shape (count).
      type(response), allocatable :: responses(:)
   end type open_chunk

   !> What a lane works on.
   type :: lane_work
      !> Slot of the open chunk, 0 for none, and index of the point in the chunk.
      integer :: slot = 0, index = 0
      !> Measures of the motion.
      type(motion_measure) :: measure
      !> Where the last point of a chain ended.
      type(steady_outcome) :: last
   end type lane_work

   !> Points of one support kind.
   type, extends(point_stream) :: grid_stream
      private
      type(case_type) :: case
      type(chunk_type), allocatable :: chunks(:)
      type(scheduler) :: schedule
      type(open_chunk) :: slots(2*lanes)
      type(lane_work) :: work(lanes)
      !> Slot from which independent points are handed out, 0 for none.
      integer :: current = 0
      real(wp), allocatable :: speed(:), stiffness(:)
      !> Largest bearing deformations of the rigid twins, shape (2, speed); unallocated without them.
      real(wp), allocatable, public :: rigid_deformation(:, :)
      !> Where responses go, and who hears of the progress.
      type(results_file), pointer :: results => null()
      type(logger), pointer :: log => null()
      integer(i8) :: points = 0_i8
   contains
      procedure :: next => next_point
      procedure :: observe => observe_point
      procedure :: deliver => deliver_point
      procedure :: poll => poll_ranks
   end type grid_stream

contains

   !> Begin with the points of some chunks. All ranks call this together.
   subroutine open_stream(self, case, chunks, comm, results, log)
      !> Stream.
      type(grid_stream), intent(inout) :: self
      !> Case.
      type(case_type), intent(in) :: case
      !> Chunks, the same on every rank.
      type(chunk_type), intent(in) :: chunks(:)
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Open result file.
      type(results_file), intent(in), target :: results
      !> Logger.
      type(logger), intent(in), target :: log

      self%case = case
      self%chunks = chunks
      self%speed = speeds(case%sweep)
      self%stiffness = stiffnesses(case%sweep)
      self%results => results
      self%log => log
      self%points = sum(int(chunks%count, i8))
      call new_scheduler(self%schedule, comm, size(chunks))
   end subroutine open_stream

   !> End: wait for all ranks. All ranks call this together.
   subroutine close_stream(self, total)
      !> Stream.
      type(grid_stream), intent(inout) :: self
      !> On rank 0: points by outcome on all ranks, shape (outcomes).
      integer, intent(out) :: total(:)

      call self%schedule%finish()
      total = self%schedule%total
   end subroutine close_stream

   !> Hand out a point for a free lane.
   subroutine next_point(self, lane, may_wait, job, available, error)
      !> Stream.
      class(grid_stream), intent(inout) :: self
      !> The free lane.
      integer, intent(in) :: lane
      !> Wait for a chunk.
      logical, intent(in) :: may_wait
      !> The point.
      type(point_job), intent(inout) :: job
      !> There is a point.
      logical, intent(out) :: available
      !> Never set.
      type(error_type), allocatable, intent(out) :: error

      integer :: slot
      logical :: chained

      chained = is_chained(self%case)
      slot = merge(self%work(lane)%slot, self%current, chained)
      if (slot > 0) then
         if (self%slots(slot)%handed == self%slots(slot)%chunk%count) slot = 0
      end if
      available = slot > 0
      if (.not. available) call open_next_chunk(self, may_wait, slot, available)
      if (.not. available) return
      if (.not. chained) self%current = slot

      associate (open => self%slots(slot))
         open%handed = open%handed + 1
         self%work(lane)%slot = slot
         self%work(lane)%index = open%handed
         if (self%case%solver%start == start_down) self%work(lane)%index = open%chunk%count + 1 - open%handed
         job%equations = point_equations(self, open%chunk, self%work(lane)%index)
         call start_state(self, self%work(lane)%last, continues=chained .and. open%handed > 1, job=job)
      end associate
      call self%work(lane)%measure%reset(job%equations%static_observation, &
                                         2.0_wp*pi/job%equations%frequency)
   end subroutine next_point

   !> Take a chunk from the scheduler into a free slot.
   subroutine open_next_chunk(self, may_wait, slot, available)
      !> Stream.
      class(grid_stream), intent(inout) :: self
      !> Wait for a chunk.
      logical, intent(in) :: may_wait
      !> The slot taken.
      integer, intent(out) :: slot
      !> There is a chunk.
      logical, intent(out) :: available

      integer :: number, i

      slot = 0
      call self%schedule%take(may_wait, number, available)
      if (.not. available) return
      ! Each lane holds at most one slot and one more is being handed out, so that one is always free.
      do slot = 1, size(self%slots)
         if (self%slots(slot)%left == 0) exit
      end do
      associate (open => self%slots(slot))
         open%chunk = self%chunks(number)
         open%handed = 0
         open%left = open%chunk%count
         if (allocated(open%responses)) deallocate (open%responses)
         allocate (open%responses(open%chunk%count))
         do i = 1, size(open%responses)
            open%responses(i) = empty_response()
         end do
      end associate
   end subroutine open_next_chunk

   !> Equations of motion of one point of a chunk.
   pure function point_equations(self, chunk, index) result(equations)
      !> Stream.
      class(grid_stream), intent(in) :: self
      !> The chunk.
      type(chunk_type), intent(in) :: chunk
      !> Index of the point in the chunk.
      integer, intent(in) :: index
      !> The equations.
      type(equations_type) :: equations

      type(operating_point) :: point

      point%support = merge(support_flexible, support_rigid, chunk%row > 0)
      point%speed = self%speed(chunk%first + index - 1)
      if (chunk%row > 0) point%support_stiffness = self%stiffness(chunk%row)
      equations = new_equations(self%case%gears, self%case%box, self%case%load, point)
   end function point_equations

   !> Where a point starts: at rest, in static equilibrium, or where its neighbour ended.
   pure subroutine start_state(self, last, continues, job)
      !> Stream.
      class(grid_stream), intent(in) :: self
      !> Where the last point of the lane ended.
      type(steady_outcome), intent(in) :: last
      !> The point continues that one.
      logical, intent(in) :: continues
      !> The point, whose start is filled in.
      type(point_job), intent(inout) :: job

      integer :: n

      n = job%equations%n
      if (allocated(job%position)) deallocate (job%position)
      if (allocated(job%velocity)) deallocate (job%velocity)
      allocate (job%position(n), job%velocity(n), source=0.0_wp)
      if (self%case%solver%start == start_rest) then
         job%position = rest_deviation(job%equations)
      else if (continues .and. last%status /= status_diverged) then
         job%position = last%position
         job%velocity = last%velocity
      end if
   end subroutine start_state

   !> See one measured period of a lane.
   subroutine observe_point(self, lane, trajectory)
      !> Stream.
      class(grid_stream), intent(inout) :: self
      !> The lane.
      integer, intent(in) :: lane
      !> One mesh period of every lane.
      type(trajectory_type), intent(in) :: trajectory

      call self%work(lane)%measure%add(trajectory, lane)
   end subroutine observe_point

   !> Take the outcome of a lane's point; write the chunk when it is complete.
   subroutine deliver_point(self, lane, outcome, error)
      !> Stream.
      class(grid_stream), intent(inout) :: self
      !> The lane.
      integer, intent(in) :: lane
      !> How the search ended.
      type(steady_outcome), intent(in) :: outcome
      !> Set where the chunk cannot be written.
      type(error_type), allocatable, intent(out) :: error

      self%work(lane)%last = outcome
      associate (open => self%slots(self%work(lane)%slot))
         associate (answer => open%responses(self%work(lane)%index))
            answer%motion = outcome%motion
            answer%status = outcome%status
            answer%periods_integrated = outcome%periods_integrated
            answer%contact = outcome%contact
            if (outcome%status /= status_diverged) call self%work(lane)%measure%finish(answer)
         end associate
         call self%schedule%count_point(outcome%status)
         open%left = open%left - 1
         if (open%left == 0) call write_chunk(self, open, error)
      end associate
   end subroutine deliver_point

   !> Write a complete chunk.
   subroutine write_chunk(self, open, error)
      !> Stream.
      class(grid_stream), intent(inout) :: self
      !> The chunk.
      type(open_chunk), intent(in) :: open
      !> Set where it cannot be written.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: eta(2, open%chunk%count), rigid(2)
      integer :: i

      if (open%chunk%row == 0) then
         call write_rigid(self%results, open%chunk%first, open%responses, error)
         if (allocated(self%rigid_deformation)) then
            do i = 1, open%chunk%count
               if (open%responses(i)%status == status_diverged) cycle
               self%rigid_deformation(:, open%chunk%first + i - 1) = open%responses(i)%bearing_deformation_max
            end do
         end if
      else if (allocated(self%rigid_deformation)) then
         do i = 1, open%chunk%count
            rigid = self%rigid_deformation(:, open%chunk%first + i - 1)
            eta(:, i) = nan()
            if (any(rigid >= no_twin) .or. any(rigid <= 0.0_wp) .or. open%responses(i)%status == status_diverged) cycle
            eta(:, i) = 100.0_wp*(open%responses(i)%bearing_deformation_max - rigid)/rigid
         end do
         call write_flexible(self%results, open%chunk%row, open%chunk%first, open%responses, eta, error)
      else
         call write_flexible(self%results, open%chunk%row, open%chunk%first, open%responses, error=error)
      end if
   end subroutine write_chunk

   !> Answer other ranks and say how far the sweep is.
   subroutine poll_ranks(self, error)
      !> Stream.
      class(grid_stream), intent(inout) :: self
      !> Never set.
      type(error_type), allocatable, intent(out) :: error

      call self%schedule%serve()
      associate (total => self%schedule%total)
         call self%log%progress(sum(int(total, i8)), self%points, to_text(total(1))//' settled, '// &
                                to_text(total(2))//' not settled, '//to_text(total(3))//' diverged')
      end associate
   end subroutine poll_ranks

end module spurflex_sweep_stream
