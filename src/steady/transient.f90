!> The steady motion by waiting for it: integrate until the section repeats, then let the motion be measured.
!>
!> All lanes run side by side; a lane that is done takes the next point at once.
module spurflex_steady_transient
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lanes, only: integrator_type, trajectory_type, lanes, observables
   use spurflex_integrate_options, only: solver_options
   use spurflex_steady_outcome, only: steady_outcome, status_settled, status_not_settled, status_diverged, &
      contact_kept, contact_lost, contact_both_flanks, motion_unresolved
   use spurflex_steady_section, only: section_monitor
   use spurflex_steady_stream, only: point_stream, point_job
   implicit none
   private

   public :: solve_by_transient

   integer, parameter :: phase_idle = 0, phase_settling = 1, phase_measuring = 2

   !> A state of this energy norm has left every physical range; far below overflow.
   real(wp), parameter :: diverged_norm = 1.0e100_wp

   !> Progress of one lane.
   type :: lane_type
      !> Idle, settling or measuring.
      integer :: phase = phase_idle
      !> Periods left to measure.
      integer :: periods_left = 0
      !> Half of the backlash [m].
      real(wp) :: half_backlash = 0.0_wp
      !> Extremes of the mesh deflection over the measured periods [m].
      real(wp) :: smallest = 0.0_wp, largest = 0.0_wp
      !> Sections seen.
      type(section_monitor) :: monitor
      !> What is found.
      type(steady_outcome) :: outcome
   end type lane_type

contains

   !> Solve every point that a stream hands out.
   subroutine solve_by_transient(integrator, options, stream, error)
      !> Integrator without points.
      class(integrator_type), intent(inout) :: integrator
      !> Tolerance, most periods, measured periods.
      type(solver_options), intent(in) :: options
      !> Source of points and sink of outcomes.
      class(point_stream), intent(inout) :: stream
      !> Set where the stream or the integrator fails; the points then end early.
      type(error_type), allocatable, intent(out) :: error

      type(lane_type) :: lane(lanes)
      type(trajectory_type) :: trajectory
      integer :: l

      allocate (trajectory%value(lanes, observables, 0:integrator%samples), source=0.0_wp)
      allocate (trajectory%rate(lanes, observables, 0:integrator%samples), source=0.0_wp)
      do
         do l = 1, lanes
            if (lane(l)%phase == phase_idle) call load_next(integrator, stream, l, lane, error)
            if (allocated(error)) return
         end do
         if (all(lane%phase == phase_idle)) exit
         if (any(lane%phase == phase_measuring)) then
            call integrator%advance(trajectory)
         else
            call integrator%advance()
         end if
         do l = 1, lanes
            select case (lane(l)%phase)
            case (phase_settling)
               call settle(integrator, options, l, lane(l))
            case (phase_measuring)
               call stream%observe(l, trajectory)
               call measure(integrator, l, lane(l))
            end select
            if (lane(l)%phase == phase_idle .and. lane(l)%outcome%status /= 0) then
               call stream%deliver(l, lane(l)%outcome, error)
               if (allocated(error)) return
               lane(l)%outcome%status = 0
            end if
         end do
         call stream%poll(error)
         if (allocated(error)) return
      end do
   end subroutine solve_by_transient

   !> Put the next point, if there is one, into a free lane.
   subroutine load_next(integrator, stream, l, lane, error)
      !> Integrator.
      class(integrator_type), intent(inout) :: integrator
      !> Source of points.
      class(point_stream), intent(inout) :: stream
      !> The free lane.
      integer, intent(in) :: l
      !> All lanes.
      type(lane_type), intent(inout) :: lane(lanes)
      !> Set where the stream or the integrator fails.
      type(error_type), allocatable, intent(out) :: error

      type(point_job) :: job
      logical :: available

      call stream%next(l, all(lane%phase == phase_idle), job, available, error)
      if (allocated(error) .or. .not. available) return
      call integrator%load(l, job%equations, job%position, job%velocity, error)
      if (allocated(error)) return
      lane(l)%phase = phase_settling
      lane(l)%half_backlash = job%equations%mesh%half_backlash
      lane(l)%outcome%periods_integrated = 0
      lane(l)%outcome%status = 0
      call lane(l)%monitor%reset(job%equations)
      call lane(l)%monitor%add(job%position, job%velocity)
   end subroutine load_next

   !> After a period of the transient: go on, measure, or give up.
   subroutine settle(integrator, options, l, lane)
      !> Integrator.
      class(integrator_type), intent(inout) :: integrator
      !> Tolerance, most periods, measured periods.
      type(solver_options), intent(in) :: options
      !> Number of the lane.
      integer, intent(in) :: l
      !> The lane.
      type(lane_type), intent(inout) :: lane

      integer :: n

      associate (outcome => lane%outcome)
         outcome%periods_integrated = outcome%periods_integrated + 1
         call lane%monitor%add(integrator%position(l, :integrator%n), integrator%velocity(l, :integrator%n))
         call lane%monitor%repeating(options%tolerance, n)
         if (.not. lane%monitor%size() < diverged_norm) then
            outcome%status = status_diverged
            outcome%motion = motion_unresolved
            outcome%contact = contact_kept
            call keep_state(integrator, l, lane)
            integrator%position(l, :) = 0.0_wp
            integrator%velocity(l, :) = 0.0_wp
         else if (n > 0) then
            outcome%status = status_settled
            outcome%motion = n
            call begin_measuring(n)
         else if (outcome%periods_integrated >= options%max_periods) then
            outcome%status = status_not_settled
            outcome%motion = motion_unresolved
            call begin_measuring(options%measured_periods)
         end if
      end associate

   contains

      !> Measure from the next period on.
      subroutine begin_measuring(periods)
         !> How many periods.
         integer, intent(in) :: periods

         lane%phase = phase_measuring
         lane%periods_left = periods
         lane%smallest = huge(1.0_wp)
         lane%largest = -huge(1.0_wp)
      end subroutine begin_measuring

   end subroutine settle

   !> After a measured period: note contact, end after the last one.
   subroutine measure(integrator, l, lane)
      !> Integrator.
      class(integrator_type), intent(in) :: integrator
      !> Number of the lane.
      integer, intent(in) :: l
      !> The lane.
      type(lane_type), intent(inout) :: lane

      lane%smallest = min(lane%smallest, integrator%smallest_deflection(l))
      lane%largest = max(lane%largest, integrator%largest_deflection(l))
      lane%periods_left = lane%periods_left - 1
      if (lane%periods_left > 0) return
      if (lane%smallest >= lane%half_backlash .or. lane%largest <= -lane%half_backlash) then
         lane%outcome%contact = contact_kept
      else if (lane%largest >= lane%half_backlash .and. lane%smallest <= -lane%half_backlash) then
         lane%outcome%contact = contact_both_flanks
      else
         lane%outcome%contact = contact_lost
      end if
      call keep_state(integrator, l, lane)
   end subroutine measure

   !> Keep the last section of a lane and free it.
   subroutine keep_state(integrator, l, lane)
      !> Integrator.
      class(integrator_type), intent(in) :: integrator
      !> Number of the lane.
      integer, intent(in) :: l
      !> The lane.
      type(lane_type), intent(inout) :: lane

      lane%outcome%position = integrator%position(l, :integrator%n)
      lane%outcome%velocity = integrator%velocity(l, :integrator%n)
      lane%phase = phase_idle
   end subroutine keep_state

end module spurflex_steady_transient
