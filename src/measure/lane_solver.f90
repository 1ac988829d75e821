!> Points in lanes, with what judges them: periodic motions are measured twice, with more than twice the steps the second time,
!> and the difference is the error estimate. Those that keep contact are measured by their Fourier series instead.
module spurflex_measure_lane_solver
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_ensemble, only: lane_ensemble
   use spurflex_integrate_lane_observe, only: lane_view
   use spurflex_integrate_options, only: solver_options, integrator_newmark
   use spurflex_integrate_steps, only: aim, judge_share, better_lane_steps, newmark_lane_steps
   use spurflex_measure_harmonic_motion, only: series_sampler
   use spurflex_measure_lane_motion, only: measure_lanes, quarter_of, parts, begin_of_window, first_half, second_half
   use spurflex_measure_linear_parts, only: linear_parts
   use spurflex_measure_linear_points, only: harmonics_do, measure_linear
   use spurflex_measure_response, only: response, empty_response, describe_motion, relative_difference, status_inaccurate, &
      reason_given_steps
   use spurflex_model_equations, only: equations_type
   use spurflex_steady_outcome, only: steady_motion
   use spurflex_steady_search, only: describe_orbit
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_shooting, only: find_orbits
   use spurflex_steady_stability, only: follow_orbits, reduce_periods
   implicit none
   private

   public :: lane_solver, measure_orbits, measure_windows

   !> Points in lanes.
   type :: lane_solver
      !> Options.
      type(solver_options) :: options
      !> The points as they are searched for, as they are measured, and those that judge them.
      type(lane_ensemble) :: seekers, points, judge
      !> Steps per mesh period with which collocation finds the motion; the judge takes more than twice as many.
      integer :: steps = 0
      !> Room for what the lanes see.
      type(lane_view) :: view
      !> Samples the series of motions that keep contact.
      type(series_sampler) :: sampler
      !> Linear parts met so far.
      type(linear_parts) :: parts
   contains
      procedure :: by_newmark
   end type lane_solver

contains

   !> Measure periodic motions, with more and more steps where the tolerance asks for them.
   subroutine measure_orbits(solver, equations, part, few, members, visitor, motions, orbits, answers, complete)
      !> Solver; it loads the points.
      type(lane_solver), intent(inout) :: solver
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, and what the mesh was taken to feel of it in the search, shape (n).
      integer, intent(in) :: part(:), few(:)
      !> Which of them.
      integer, intent(in) :: members(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motions, shape (n).
      type(steady_motion), intent(inout) :: motions(:)
      !> Their orbits, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> The responses, shape (n).
      type(response), intent(inout) :: answers(:)
      !> The response meets the tolerance, shape (n).
      logical, intent(inout) :: complete(:)

      integer :: steps(size(equations)), found_by(size(equations)), next, i
      integer, allocatable :: open(:), group(:)
      logical :: agreed(size(equations)), is_whole(size(equations))

      if (harmonics_do(solver%options)) call measure_linear(solver%parts, solver%sampler, solver%options, equations, part, few, &
                                                            members, motions, orbits, answers, complete)
      open = pack(members, .not. complete(members))
      do i = 1, size(equations)
         steps(i) = measuring_steps(solver, equations(i))
      end do
      ! Steps that found the orbits; free steps of Newmark's method did not, and the search leaves out multipliers.
      found_by = steps
      if (solver%options%steps_per_period == 0 .and. (solver%by_newmark() .or. solver%options%multipliers)) found_by = 0
      do i = 1, size(members)
         is_whole(members(i)) = all(solver%parts%truncation(few(members(i)))%felt)
      end do
      do while (size(open) > 0)
         next = minval(steps(open))
         group = pack(open, steps(open) == next)
         agreed(group) = .true.
         solver%points%by_newmark = solver%by_newmark()
         call solver%points%load(equations, solver%parts%modal, part, next, group)
         call find_again(solver, pack(group, found_by(group) /= next), visitor, motions, orbits, agreed, only_follow=.false.)
         call find_again(solver, pack(group, found_by(group) == next .and. .not. is_whole(group)), visitor, motions, orbits, &
                         agreed, only_follow=.true.)
         is_whole(group) = .true.
         call judge_orbits(solver, equations, part, pack(group, agreed(group)), visitor, motions, orbits, answers, agreed)
         do i = 1, size(group)
            associate (p => group(i), error => answers(group(i))%error_estimate)
               steps(p) = 0
               if (.not. agreed(p)) cycle
               call describe_motion(motions(p), answers(p))
               if (solver%options%steps_per_period > 0) then
                  complete(p) = .true.
                  if (error <= solver%options%tolerance) cycle
                  answers(p)%status = status_inaccurate
                  answers(p)%reason = reason_given_steps
               else
                  complete(p) = error <= aim*solver%options%tolerance
                  if (.not. complete(p)) steps(p) = better_lane_steps(next, error, solver%options)
               end if
            end associate
         end do
         open = pack(open, steps(open) > 0 .and. .not. complete(open))
      end do
   end subroutine measure_orbits

   !> Points are measured by Newmark's method, not by the collocation that finds their motions.
   pure function by_newmark(self) result(they_are)
      !> Solver.
      class(lane_solver), intent(in) :: self
      !> They are.
      logical :: they_are

      they_are = self%options%integrator == integrator_newmark
   end function by_newmark

   !> Steps with which a point is measured at first.
   pure function measuring_steps(solver, equations) result(steps)
      !> Solver.
      type(lane_solver), intent(in) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer :: steps

      steps = solver%steps
      if (solver%options%steps_per_period > 0) steps = solver%options%steps_per_period
      if (solver%options%steps_per_period == 0 .and. solver%by_newmark()) steps = newmark_lane_steps(equations)
   end function measuring_steps

   !> Find orbits again with other steps, or in all modes.
   subroutine find_again(solver, members, visitor, motions, orbits, found, only_follow)
      !> Solver, its points loaded with the other steps.
      type(lane_solver), intent(inout) :: solver
      !> Which of the points.
      integer, intent(in) :: members(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motions.
      type(steady_motion), intent(inout) :: motions(:)
      !> Their orbits.
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> The orbit is there.
      logical, intent(inout) :: found(:)
      !> It is known to be stable, and its monodromy is near enough.
      logical, intent(in) :: only_follow

      type(periodic_orbit) :: again(size(members))
      type(periodic_orbit), allocatable :: astray(:)
      integer, allocatable :: which(:)
      logical :: is_found(size(members))
      logical, allocatable :: is_there(:)
      integer :: i

      if (size(members) == 0) return
      again = orbits(members)
      if (only_follow) then
         call find_orbits(solver%points, members, sizes(solver%points, members, again), visitor, again, is_found, &
                          monodromy_is_near=.true., roughly=.true., near_enough=judge_share*solver%options%tolerance)
         ! Where a new monodromy was needed the steps may have led to another motion.
         which = pack([(i, i=1, size(members))], .not. (is_found .and. again%given))
         if (size(which) > 0) then
            astray = orbits(members(which))
            allocate (is_there(size(which)))
            call follow_orbits(solver%points, members(which), sizes(solver%points, members(which), astray), visitor, astray, &
                               is_there)
            again(which) = astray
            is_found(which) = is_there
         end if
      else
         call follow_orbits(solver%points, members, sizes(solver%points, members, again), visitor, again, is_found)
      end if
      do i = 1, size(members)
         associate (motion => motions(members(i)))
            motion%periods_integrated = motion%periods_integrated + again(i)%integrated
            found(members(i)) = is_found(i) .and. again(i)%periods == motion%periods
            if (.not. found(members(i))) cycle
            orbits(members(i)) = again(i)
            call describe_orbit(again(i), solver%options, motion)
         end associate
      end do
   end subroutine find_again

   !> Measure orbits, find them again with more than twice the steps, measure those: the difference is the error estimate.
   subroutine judge_orbits(solver, equations, part, members, visitor, motions, orbits, answers, agreed)
      !> Solver, its points loaded.
      type(lane_solver), intent(inout) :: solver
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, shape (n).
      integer, intent(in) :: part(:)
      !> Which of them.
      integer, intent(in) :: members(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motions, shape (n).
      type(steady_motion), intent(inout) :: motions(:)
      !> Their orbits, shape (n).
      type(periodic_orbit), intent(in) :: orbits(:)
      !> The responses, shape (n).
      type(response), intent(inout) :: answers(:)
      !> The judge finds the orbit too, shape (n).
      logical, intent(inout) :: agreed(:)

      type(periodic_orbit) :: judged(size(members))
      type(response) :: measured(size(members)), judgement(size(members))
      real(wp) :: states(solver%points%size, size(members))
      integer :: i
      logical :: found(size(members))

      if (size(members) == 0) return
      call load_judge(solver, equations, part, members)
      measured = answers(members)
      judgement = answers(members)
      judged = orbits(members)
      do i = 1, size(members)
         states(:, i) = judged(i)%state
      end do
      call measure_lanes(solver%points, equations, solver%parts%views, part, solver%view, members, judged%periods, visitor, &
                         states, measured)
      call find_orbits(solver%judge, members, sizes(solver%points, members, judged), visitor, judged, found, &
                       monodromy_is_near=.true., roughly=.true., near_enough=judge_share*solver%options%tolerance)
      ! Large steps can split a motion in two where the teeth graze.
      call reduce_periods(solver%judge, members, found, visitor, judged)
      found = found .and. judged%periods == orbits(members)%periods
      do i = 1, size(members)
         states(:, i) = judged(i)%state
      end do
      call measure_lanes(solver%judge, equations, solver%parts%views, part, solver%view, members, judged%periods, visitor, states, &
                         judgement)
      do i = 1, size(members)
         measured(i)%error_estimate = max(relative_difference(equations(members(i)), measured(i), judgement(i)), &
                                          solver%parts%modal(part(members(i)))%roundoff)
         motions(members(i))%periods_integrated = motions(members(i))%periods_integrated + judged(i)%integrated
      end do
      agreed(members) = found
      answers(members) = measured
   end subroutine judge_orbits

   !> Load the judge, which collocates with more than twice the steps.
   subroutine load_judge(solver, equations, part, members)
      !> Solver, its points loaded.
      type(lane_solver), intent(inout) :: solver
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, shape (n).
      integer, intent(in) :: part(:)
      !> Which of them will be judged.
      integer, intent(in) :: members(:)

      ! One more than twice as many: where the grids nest, a crossing can leave both with the same part of a step behind it.
      call solver%judge%load(equations, solver%parts%modal, part, &
                             2*merge(solver%steps, solver%points%steps, solver%by_newmark()) + 1, members)
   end subroutine load_judge

   !> Sizes of motions.
   pure function sizes(points, members, orbits) result(scale)
      !> The points.
      type(lane_ensemble), intent(in) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> The motions, shape (n).
      type(periodic_orbit), intent(in) :: orbits(:)
      !> Norms of their sections, or the backlash if that is larger, shape (n) [m].
      real(wp) :: scale(size(orbits))

      integer :: i

      do i = 1, size(orbits)
         scale(i) = max(weighted_norm(points%weight(:, members(i)), orbits(i)%state), points%half_backlash, &
                        tiny(1.0_wp))
      end do
   end function sizes

   !> Measure motions that are not periodic over a window; their error is what two halves of the window, or two numbers of steps,
   !> differ by.
   subroutine measure_windows(solver, equations, part, members, visitor, motions, answers, complete)
      !> Solver; it loads the points.
      type(lane_solver), intent(inout) :: solver
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, shape (n).
      integer, intent(in) :: part(:)
      !> Which of them.
      integer, intent(in) :: members(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The motions; their states move to the end of the window, shape (n).
      type(steady_motion), intent(inout) :: motions(:)
      !> The responses, shape (n).
      type(response), intent(inout) :: answers(:)
      !> The response is complete, shape (n).
      logical, intent(inout) :: complete(:)

      integer :: steps(size(equations)), i
      integer, allocatable :: group(:)

      do i = 1, size(equations)
         steps(i) = measuring_steps(solver, equations(i))
      end do
      do i = 1, size(members)
         if (any(steps(members(:i - 1)) == steps(members(i)))) cycle
         solver%points%by_newmark = solver%by_newmark()
         call solver%points%load(equations, solver%parts%modal, part, steps(members(i)))
         group = pack(members, steps(members) == steps(members(i)))
         call load_judge(solver, equations, part, group)
         call measure_group(group)
      end do
      ! What is not finite may have had too few steps.
      complete(members) = answers(members)%error_estimate < huge(1.0_wp)

   contains

      !> Measure those that have the same steps.
      subroutine measure_group(group)
         !> Which of the points.
         integer, intent(in) :: group(:)

         type(response) :: whole(size(group)), judgement(size(group)), of_parts(parts, size(group))
         real(wp) :: states(solver%points%size, size(group)), judged(solver%points%size, size(group))
         integer :: periods(size(group)), k

         whole = answers(group)
         judgement = whole
         of_parts = empty_response()
         periods = max(solver%options%measured_periods, 2)
         do k = 1, size(group)
            states(:, k) = motions(group(k))%state
         end do
         judged = states
         call measure_lanes(solver%judge, equations, solver%parts%views, part, solver%view, group, quarter_of(periods), visitor, &
                            judged, judgement)
         call measure_lanes(solver%points, equations, solver%parts%views, part, solver%view, group, periods, visitor, states, &
                            whole, of_parts)
         do k = 1, size(group)
            associate (p => group(k))
               whole(k)%error_estimate = max(relative_difference(equations(p), of_parts(first_half, k), of_parts(second_half, k)), &
                                             relative_difference(equations(p), of_parts(begin_of_window, k), judgement(k)))
               motions(p)%state = states(:, k)
               call describe_motion(motions(p), whole(k))
               answers(p) = whole(k)
            end associate
         end do
      end subroutine measure_group

   end subroutine measure_windows

end module spurflex_measure_lane_solver
