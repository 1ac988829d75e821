!> The measured response of one operating point on its own: find the steady motion, measure it, and measure how good the numbers
!> are.
!>
!> A periodic motion is found a second time by other means, exponential collocation with less than half the step, and the
!> difference is the error estimate. Where the step is free it is halved until the estimate meets the tolerance. The numbers
!> of a motion that is not periodic depend on the window: their estimate is what its halves, or two integrators, differ by.
module spurflex_measure_point
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_ensemble, only: solo_ensemble, new_solo
   use spurflex_integrate_factory, only: make_map
   use spurflex_integrate_options, only: solver_options, integrator_newmark
   use spurflex_integrate_period_map, only: period_map, orbit_type
   use spurflex_integrate_steps, only: first_steps, better_steps, most_steps, judge_share
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: response, empty_response, status_missing, status_inaccurate, &
      status_diverged, reason_non_finite, reason_no_step, reason_given_steps, reason_most_steps, reason_not_confirmed, &
      contact_of, describe_motion, relative_difference
   use spurflex_model_equations, only: equations_type
   use spurflex_steady_outcome, only: steady_motion
   use spurflex_steady_search, only: find_steady_motion, describe_orbit
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_shooting, only: find_orbit
   use spurflex_steady_stability, only: find_stable_orbits, follow_orbits
   implicit none
   private

   public :: point_solver, new_point_solver, respond_alone

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
   subroutine respond_alone(solver, equations, start_position, start_velocity, position, velocity, visitor, motion, monodromy, &
                            answer)
      !> Solver.
      type(point_solver), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium and its rate at the start, shape (n).
      real(wp), intent(in) :: start_position(:), start_velocity(:)
      !> The same at a section of the motion if that is known, at the start if not, before; at the last section after.
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motion, with the status `status_missing` if it is not known.
      type(steady_motion), intent(inout) :: motion
      !> Derivative of the map over the period of a known motion in its modes, near enough for Newton's method, shape
      !> (2 modes, 2 modes); not allocated if there is none.
      real(wp), allocatable, intent(inout) :: monodromy(:, :)
      !> The response.
      type(response), intent(out) :: answer

      type(error_type), allocatable :: error
      real(wp), allocatable :: state(:)
      integer :: steps
      logical :: is_free, known, found, agreed, accurate

      answer = empty_response()
      answer%status = status_diverged
      answer%reason = reason_no_step
      steps = solver%options%steps_per_period
      if (steps == 0) steps = first_steps(equations, solver%options)
      accurate = .false.
      agreed = .false.
      known = motion%status /= status_missing
      is_free = solver%options%steps_per_period == 0 .and. solver%options%integrator == integrator_newmark
      if (is_free .and. .not. known) then
         ! Steps that meet the tolerance on the motion may be too coarse to tell which motion the start leads to.
         call load_judge(solver, equations, position, velocity, state, known)
         if (.not. known) return
         call find_steady_motion(solver%judge, state, solver%options, visitor, motion)
         call solver%judge%from_state(motion%state, position, velocity)
      end if
      do
         call solver%map%load(equations, steps, error)
         if (allocated(error)) return
         if (known .and. motion%periods > 0) then
            call follow_motion(solver%map, position, velocity, visitor, solver%options, motion, monodromy, found)
            if (is_free .and. .not. found .and. steps < most_steps) then
               steps = better_steps(steps, 1.0_wp, solver%options)
               cycle
            end if
            known = found
         else if (known) then
            motion%state = solver%map%to_state(position, velocity)
         end if
         if (.not. known) then
            if (allocated(monodromy)) deallocate (monodromy)
            call find_steady_motion(solver%map, solver%map%to_state(start_position, start_velocity), solver%options, visitor, &
                                    motion)
         end if
         call describe_motion(motion, answer)
         if (motion%status == status_diverged) return
         if (motion%periods == 0) then
            call measure_window(solver, equations, visitor, motion, answer)
            accurate = .true.
            if (.not. all(ieee_is_finite(motion%state))) then
               answer = empty_response()
               answer%status = status_diverged
               answer%reason = reason_non_finite
               answer%periods_integrated = motion%periods_integrated
               return
            end if
            exit
         end if
         call measure_periods(solver%map, motion%periods, motion%state, equations, solver%orbit, answer)
         call solver%map%from_state(motion%state, position, velocity)
         call judge_motion(solver, equations, position, velocity, motion%periods, visitor, monodromy, answer, &
                           agreed)
         if (agreed) accurate = answer%error_estimate <= solver%options%tolerance
         if (accurate .or. solver%options%steps_per_period > 0 .or. steps >= most_steps) exit
         steps = better_steps(steps, merge(answer%error_estimate, 1.0_wp, agreed), solver%options)
         known = agreed
      end do
      call solver%map%from_state(motion%state, position, velocity)
      if (accurate) return
      answer%status = status_inaccurate
      if (.not. agreed) then
         answer%reason = reason_not_confirmed
      else
         answer%reason = merge(reason_given_steps, reason_most_steps, solver%options%steps_per_period > 0)
      end if
   end subroutine respond_alone

   !> Find a motion again, near where it was with larger steps; it must still be stable and take as long.
   subroutine follow_motion(map, position, velocity, visitor, options, motion, monodromy, found)
      !> Period map with the smaller steps.
      class(period_map), intent(inout), target :: map
      !> Section of the motion with the larger ones, shape (n).
      real(wp), intent(in) :: position(:), velocity(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> Whether multipliers are asked for.
      type(solver_options), intent(in) :: options
      !> The motion.
      type(steady_motion), intent(inout) :: motion
      !> Monodromy with the larger steps, in the modes, if it is known; that with the smaller ones where it had to be found.
      real(wp), allocatable, intent(inout) :: monodromy(:, :)
      !> It is there.
      logical, intent(out) :: found

      type(solo_ensemble) :: solo
      type(periodic_orbit) :: orbit(1)
      real(wp) :: scale(1)
      logical :: is_found(1), is_modal

      call new_solo(map, solo)
      orbit(1)%state = map%to_state(position, velocity)
      orbit(1)%periods = motion%periods
      scale = size_of(map, orbit(1)%state)
      is_modal = .false.
      select type (map)
      type is (collocation_map)
         is_modal = .true.
      end select
      if (is_modal .and. allocated(monodromy)) then
         orbit(1)%monodromy = monodromy
         call follow_orbits(solo, [1], scale, visitor, orbit, is_found)
      else
         call find_stable_orbits(solo, [1], scale, visitor, orbit, is_found)
      end if
      motion%periods_integrated = motion%periods_integrated + orbit(1)%integrated
      found = is_found(1) .and. orbit(1)%periods == motion%periods
      if (.not. found) return
      call describe_orbit(orbit(1), options, motion)
      if (is_modal) monodromy = orbit(1)%monodromy
   end subroutine follow_motion

   !> Find and measure a motion with the judging integrator; the difference is the error estimate.
   subroutine judge_motion(solver, equations, position, velocity, periods, visitor, monodromy, answer, agreed)
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
      !> Monodromy of the motion in its modes, if it is known.
      real(wp), allocatable, intent(in) :: monodromy(:, :)
      !> The response, whose error estimate is filled in.
      type(response), intent(inout) :: answer
      !> The judge finds the motion too.
      logical, intent(out) :: agreed

      type(response) :: judged
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: state(:)
      real(wp) :: scale

      call load_judge(solver, equations, position, velocity, state, agreed)
      if (.not. agreed) return
      scale = size_of(solver%judge, state)
      call find_orbit(solver%judge, state, periods, scale, visitor, orbit, agreed, monodromy, judge_share*solver%options%tolerance)
      answer%periods_integrated = answer%periods_integrated + orbit%integrated
      if (.not. agreed .and. allocated(monodromy)) then
         call find_orbit(solver%judge, state, periods, scale, visitor, orbit, agreed)
         answer%periods_integrated = answer%periods_integrated + orbit%integrated
      end if
      if (.not. agreed) return
      judged = empty_response()
      call measure_periods(solver%judge, periods, orbit%state, equations, solver%orbit, judged)
      answer%error_estimate = max(relative_difference(equations, answer, judged), solver%judge%roundoff)
   end subroutine judge_motion

   !> Give the judging integrator a point and a state.
   subroutine load_judge(solver, equations, position, velocity, state, loaded)
      !> Solver.
      type(point_solver), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Section, shape (n).
      real(wp), intent(in) :: position(:), velocity(:)
      !> The judge's state, shape (size).
      real(wp), allocatable, intent(out) :: state(:)
      !> The judge can integrate the point.
      logical, intent(out) :: loaded

      type(error_type), allocatable :: error
      integer :: steps

      ! One more than twice as many: where the grids nest, a crossing can leave both runs with the same interval behind it.
      steps = 2*solver%map%steps + 1
      if (solver%options%integrator == integrator_newmark) steps = 2*first_steps(equations) + 1
      call solver%judge%load(equations, steps, error)
      loaded = .not. allocated(error)
      if (.not. loaded) return
      allocate (state(solver%judge%size))
      state = solver%judge%to_state(position, velocity)
   end subroutine load_judge

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

   !> Measure a motion that is not periodic over a window; its error is what two halves of the window, or two integrators, differ
   !> by.
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

      type(motion_measure) :: whole, half(2), judge
      type(response) :: halves(2), judged
      real(wp), allocatable :: position(:), velocity(:), state(:)
      real(wp) :: smallest, largest
      integer :: k, periods
      logical :: is_judged

      call solver%map%from_state(motion%state, position, velocity)
      call load_judge(solver, equations, position, velocity, state, is_judged)
      call whole%reset(equations%static_observation)
      call half(1)%reset(equations%static_observation)
      call half(2)%reset(equations%static_observation)
      call judge%reset(equations%static_observation)
      smallest = huge(1.0_wp)
      largest = -huge(1.0_wp)
      periods = max(solver%options%measured_periods, 2)
      do k = 1, periods
         if (is_judged) then
            call solver%judge%advance(state, orbit=solver%orbit)
            call judge%add(solver%orbit)
         end if
         call solver%map%advance(motion%state, orbit=solver%orbit)
         call whole%add(solver%orbit)
         call half(merge(1, 2, 2*k <= periods))%add(solver%orbit)
         smallest = min(smallest, solver%map%smallest_deflection)
         largest = max(largest, solver%map%largest_deflection)
         call visitor%attend()
      end do
      halves = empty_response()
      judged = empty_response()
      call whole%finish(answer)
      call half(1)%finish(halves(1))
      call half(2)%finish(halves(2))
      answer%error_estimate = relative_difference(equations, halves(1), halves(2))
      if (is_judged) then
         call judge%finish(judged)
         answer%error_estimate = max(answer%error_estimate, relative_difference(equations, answer, judged))
      end if
      answer%contact = contact_of(smallest, largest, equations%mesh%half_backlash)
   end subroutine measure_window

end module spurflex_measure_point
