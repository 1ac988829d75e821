!> The measured response of one operating point: find the steady motion, measure it, and measure how good the numbers are.
!>
!> A periodic motion is found a second time by other means, exponential collocation with less than half the step, and the
!> difference is the error estimate. Where the step is free it is halved until the estimate meets the tolerance. The numbers of a motion that
!> is not periodic depend on the window: their estimate is what two halves of the window differ by.
module spurflex_measure_point
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_factory, only: make_map
   use spurflex_integrate_options, only: solver_options, integrator_newmark
   use spurflex_integrate_period_map, only: period_map, orbit_type
   use spurflex_integrate_steps, only: first_steps, better_steps, most_steps
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: response, empty_response, status_settled, status_inaccurate, status_diverged, &
      contact_kept, contact_lost, contact_both_flanks
   use spurflex_model_equations, only: equations_type
   use spurflex_steady_outcome, only: steady_motion
   use spurflex_steady_search, only: find_steady_motion
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_shooting, only: periodic_orbit, find_orbit
   implicit none
   private

   public :: point_solver, new_point_solver, respond

   !> What solves points one after the other; keeps what the next point can use again.
   type :: point_solver
      private
      !> Options.
      type(solver_options) :: options
      !> The integrator, and the one that judges it.
      class(period_map), allocatable :: map
      type(collocation_map) :: judge
      !> The period last recorded.
      type(orbit_type) :: orbit
   end type point_solver

contains

   !> Make a solver.
   subroutine new_point_solver(options, solver)
      !> Options.
      type(solver_options), intent(in) :: options
      !> The solver.
      type(point_solver), intent(out) :: solver

      solver%options = options
      call make_map(options, solver%map)
   end subroutine new_point_solver

   !> The response of one point. A point that fails is a status in the response, not an error.
   subroutine respond(solver, equations, position, velocity, visitor, answer)
      !> Solver.
      type(point_solver), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium and its rate: at the start before, at the last section after, shape (n).
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The response.
      type(response), intent(out) :: answer

      type(steady_motion) :: motion
      type(error_type), allocatable :: error
      integer :: steps

      answer = empty_response()
      answer%status = status_diverged
      steps = solver%options%steps_per_period
      if (steps == 0) steps = first_steps(equations, solver%options)
      call solver%map%load(equations, steps, error)
      if (allocated(error)) return
      call find_steady_motion(solver%map, solver%map%to_state(position, velocity), solver%options, visitor, motion)
      answer%status = motion%status
      answer%motion = motion%motion
      answer%periods_integrated = motion%periods_integrated
      if (motion%status == status_diverged) return
      if (motion%periods > 0) answer%floquet_magnitude = motion%floquet_magnitude
      answer%lyapunov_exponent = motion%lyapunov_exponent
      answer%lyapunov_error = motion%lyapunov_error
      if (motion%periods > 0) then
         call measure_periodic(solver, equations, visitor, motion, answer)
      else
         call measure_window(solver, equations, visitor, motion, answer)
      end if
      call solver%map%from_state(motion%state, position, velocity)
   end subroutine respond

   !> Measure a periodic motion and its error; take smaller steps where that is wanted and allowed.
   subroutine measure_periodic(solver, equations, visitor, motion, answer)
      !> Solver, its map loaded.
      type(point_solver), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motion; found again with every smaller step.
      type(steady_motion), intent(inout) :: motion
      !> The response.
      type(response), intent(inout) :: answer

      type(response) :: judged
      real(wp), allocatable :: position(:), velocity(:)
      integer :: steps
      logical :: found

      do
         call measure_periods(solver%map, motion%periods, motion%state, equations, solver%orbit, answer)
         call solver%map%from_state(motion%state, position, velocity)
         call judge_motion(solver, equations, position, velocity, motion%periods, visitor, judged, found)
         if (found) then
            answer%error_estimate = relative_difference(answer, judged)
            if (answer%error_estimate <= solver%options%tolerance) exit
         end if
         if (solver%options%steps_per_period > 0 .or. solver%map%steps >= most_steps) exit
         steps = better_steps(solver%map%steps, merge(answer%error_estimate, 1.0_wp, found), solver%options)
         call refine(solver%map, equations, steps, motion, visitor, found)
         if (.not. found) exit
      end do
      if (.not. answer%error_estimate <= solver%options%tolerance) answer%status = status_inaccurate
   end subroutine measure_periodic

   !> Find a motion again with smaller steps.
   subroutine refine(map, equations, steps, motion, visitor, found)
      !> Period map.
      class(period_map), intent(inout) :: map
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The motion.
      type(steady_motion), intent(inout) :: motion
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> It is there.
      logical, intent(out) :: found

      type(periodic_orbit) :: orbit
      type(error_type), allocatable :: error
      real(wp), allocatable :: position(:), velocity(:)

      found = .false.
      call map%from_state(motion%state, position, velocity)
      call map%load(equations, steps, error)
      if (allocated(error)) return
      motion%state = map%to_state(position, velocity)
      call find_orbit(map, motion%state, motion%periods, size_of(map, motion%state), visitor, orbit, found)
      if (found) motion%state = orbit%state
   end subroutine refine

   !> Find and measure a motion with the judging integrator.
   subroutine judge_motion(solver, equations, position, velocity, periods, visitor, judged, found)
      !> Solver.
      type(point_solver), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Section of the motion, shape (n).
      real(wp), intent(in) :: position(:), velocity(:)
      !> Mesh periods after which the motion repeats.
      integer, intent(in) :: periods
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> What the judge measures.
      type(response), intent(out) :: judged
      !> The judge finds the motion too.
      logical, intent(out) :: found

      type(periodic_orbit) :: orbit
      type(error_type), allocatable :: error
      real(wp), allocatable :: state(:)
      integer :: steps

      found = .false.
      ! One more than twice as many: where the grids nest, a crossing can leave both runs with the same interval behind it.
      steps = 2*solver%map%steps + 1
      if (solver%options%integrator == integrator_newmark) steps = first_steps(equations)
      call solver%judge%load(equations, steps, error)
      if (allocated(error)) return
      allocate (state(solver%judge%size))
      state = solver%judge%to_state(position, velocity)
      call find_orbit(solver%judge, state, periods, size_of(solver%judge, state), visitor, orbit, found)
      if (.not. found) return
      call measure_periods(solver%judge, periods, orbit%state, equations, solver%orbit, judged)
   end subroutine judge_motion

   !> Size of a motion from its section [m].
   pure function size_of(map, state) result(scale)
      !> Period map.
      class(period_map), intent(in) :: map
      !> Section, shape (size).
      real(wp), intent(in) :: state(:)
      !> Its norm, or the backlash if that is larger.
      real(wp) :: scale

      scale = max(weighted_norm(map%weight, state), map%half_backlash)
   end function size_of

   !> Measure some periods from a section on.
   subroutine measure_periods(map, periods, state, equations, orbit, answer)
      !> Period map.
      class(period_map), intent(inout) :: map
      !> Mesh periods.
      integer, intent(in) :: periods
      !> Section, shape (size).
      real(wp), intent(in) :: state(:)
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Room for a recorded period.
      type(orbit_type), intent(inout) :: orbit
      !> Displacements and contact are filled in.
      type(response), intent(inout) :: answer

      type(motion_measure) :: measure
      real(wp) :: moving(size(state)), smallest, largest
      integer :: k

      call measure%reset(equations%static_observation)
      smallest = huge(1.0_wp)
      largest = -huge(1.0_wp)
      moving = state
      do k = 1, periods
         call map%advance(moving, orbit=orbit)
         call measure%add(orbit)
         smallest = min(smallest, map%smallest_deflection)
         largest = max(largest, map%largest_deflection)
      end do
      call measure%finish(answer)
      answer%contact = contact_of(smallest, largest, equations%mesh%half_backlash)
   end subroutine measure_periods

   !> Whether the teeth part.
   pure function contact_of(smallest, largest, half_backlash) result(contact)
      !> Extremes of the mesh deflection [m].
      real(wp), intent(in) :: smallest, largest
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> `contact_...`.
      integer :: contact

      if (smallest >= half_backlash .or. largest <= -half_backlash) then
         contact = contact_kept
      else if (largest >= half_backlash .and. smallest <= -half_backlash) then
         contact = contact_both_flanks
      else
         contact = contact_lost
      end if
   end function contact_of

   !> Measure a motion that is not periodic over a window; its error is what two halves of the window differ by.
   subroutine measure_window(solver, equations, visitor, motion, answer)
      !> Solver, its map loaded.
      type(point_solver), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motion; its state moves to the end of the window.
      type(steady_motion), intent(inout) :: motion
      !> The response.
      type(response), intent(inout) :: answer

      type(motion_measure) :: whole, half(2)
      type(response) :: halves(2)
      real(wp) :: smallest, largest
      integer :: k, periods, which

      call whole%reset(equations%static_observation)
      call half(1)%reset(equations%static_observation)
      call half(2)%reset(equations%static_observation)
      smallest = huge(1.0_wp)
      largest = -huge(1.0_wp)
      periods = max(solver%options%measured_periods, 2)
      do k = 1, periods
         call solver%map%advance(motion%state, orbit=solver%orbit)
         which = merge(1, 2, 2*k <= periods)
         call whole%add(solver%orbit)
         call half(which)%add(solver%orbit)
         smallest = min(smallest, solver%map%smallest_deflection)
         largest = max(largest, solver%map%largest_deflection)
         call visitor%attend()
      end do
      call whole%finish(answer)
      call half(1)%finish(halves(1))
      call half(2)%finish(halves(2))
      answer%error_estimate = relative_difference(halves(1), halves(2))
      answer%contact = contact_of(smallest, largest, equations%mesh%half_backlash)
   end subroutine measure_window

   !> The larger relative difference of two responses in amplitude and in bearing deformation.
   pure function relative_difference(a, b) result(difference)
      !> Both responses.
      type(response), intent(in) :: a, b
      !> Relative difference; zero where both are zero.
      real(wp) :: difference

      difference = maxval(abs([a%y1_amplitude - b%y1_amplitude, a%bearing_deformation_max - b%bearing_deformation_max]) &
                          /max([b%y1_amplitude, b%bearing_deformation_max], tiny(1.0_wp)))
   end function relative_difference

end module spurflex_measure_point
