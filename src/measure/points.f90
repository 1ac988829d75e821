!> The measured responses of several operating points: a tile of the grid.
!>
!> Points are solved side by side in lanes. The motion is found with a few steps a mesh period; a periodic one is found again
!> with more than twice as many, and the difference is the error estimate; one that keeps contact is a Fourier series and needs
!> neither. A point whose estimate misses the tolerance gets more steps, and goes on alone, by the integrator of high order,
!> where lanes would need too many.
module spurflex_measure_points
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_ensemble, only: narrow
   use spurflex_integrate_options, only: solver_options, integrator_collocation, integrator_newmark
   use spurflex_integrate_steps, only: first_lane_steps, most_lane_steps, most_newmark_steps
   use spurflex_measure_effort, only: effort_type, stage_search, stage_measure, stage_alone
   use spurflex_measure_lane_search, only: search_in_lanes
   use spurflex_measure_lane_solver, only: lane_solver, measure_orbits, measure_windows
   use spurflex_measure_point, only: point_solver, new_point_solver, respond_alone
   use spurflex_measure_response, only: response, empty_response
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: from_modes
   use spurflex_steady_outcome, only: steady_motion, status_diverged
   use spurflex_steady_orbit, only: periodic_orbit
   implicit none
   private

   public :: solver_type, new_solver, respond, respond_one

   !> What solves points; keeps what the next points can use again.
   type :: solver_type
      private
      !> Solves points in lanes.
      type(lane_solver) :: lanes
      !> Solves points one after the other.
      type(point_solver) :: alone
      !> What the points cost.
      type(effort_type), public :: effort
   end type solver_type

contains

   !> Make a solver.
   subroutine new_solver(options, solver)
      !> Options.
      type(solver_options), intent(in) :: options
      !> The solver.
      type(solver_type), intent(out) :: solver

      solver%lanes%options = options
      call new_point_solver(options, solver%alone)
   end subroutine new_solver

   !> The response of one point. A point that fails is a status in the response, not an error.
   subroutine respond_one(solver, equations, position, velocity, visitor, answer)
      !> Solver.
      type(solver_type), intent(inout) :: solver
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium and its rate: at the start before, at the last section after, shape (n).
      real(wp), intent(inout) :: position(:), velocity(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The response.
      type(response), intent(out) :: answer

      type(response) :: answers(1)
      real(wp) :: positions(size(position), 1), velocities(size(velocity), 1)

      positions(:, 1) = position
      velocities(:, 1) = velocity
      call respond(solver, [equations], positions, velocities, visitor, answers)
      position = positions(:, 1)
      velocity = velocities(:, 1)
      answer = answers(1)
   end subroutine respond_one

   !> The responses of several points. A point that fails is a status in its response, not an error.
   subroutine respond(solver, equations, positions, velocities, visitor, answers)
      !> Solver.
      type(solver_type), intent(inout) :: solver
      !> Equations of motion of each point, shape (points).
      type(equations_type), intent(in) :: equations(:)
      !> Deviation from the static equilibrium and its rate: at the start before, at the last section after, shape (n, points).
      real(wp), intent(inout) :: positions(:, :), velocities(:, :)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The responses, shape (points).
      type(response), intent(out) :: answers(:)

      type(steady_motion) :: motions(size(equations))
      type(equations_type), allocatable :: chosen(:)
      real(wp), dimension(size(positions, 1), size(positions, 2)) :: start_positions, start_velocities
      real(wp), allocatable :: position(:), velocity(:)
      integer :: steps(size(equations)), part(size(equations)), i, k
      integer, allocatable :: group(:)
      logical :: done(size(equations))
      type(periodic_orbit) :: orbits(size(equations))

      done = .false.
      start_positions = positions
      start_velocities = velocities
      if (solve_in_lanes(solver%lanes%options)) then
         call solver%lanes%parts%forget()
         do i = 1, size(equations)
            call solver%lanes%parts%find(equations(i), part(i))
            steps(i) = huge(steps)
            if (part(i) > 0) steps(i) = first_lane_steps(equations(i), solver%lanes%parts%modal(part(i)), &
                                                         solver%lanes%options%tolerance)
         end do
         do i = 1, size(equations)
            if (steps(i) > most_lane_steps .or. any(steps(:i - 1) == steps(i))) cycle
            group = pack([(k, k=1, size(equations))], steps == steps(i))
            if (size(group) == size(equations)) then
               call respond_in_lanes(solver%lanes, equations, part, steps(i), positions, velocities, group, visitor, &
                                     solver%effort, motions, orbits, answers, done)
               cycle
            end if
            ! Given as an argument, `equations(group)` would be a copy whose components gfortran never frees.
            chosen = equations(group)
            call respond_in_lanes(solver%lanes, chosen, part(group), steps(i), positions, velocities, group, visitor, &
                                  solver%effort, motions, orbits, answers, done)
         end do
      end if
      associate (lanes => solver%lanes)
         solver%effort%steps = lanes%seekers%steps_done + lanes%points%steps_done + lanes%judge%steps_done
         solver%effort%modes = lanes%seekers%modes_done + lanes%points%modes_done + lanes%judge%modes_done
      end associate
      do i = 1, size(equations)
         if (done(i)) then
            call solver%effort%count_point(answers(i), motions(i)%periods > 0, alone=.false.)
            cycle
         end if
         call solver%effort%begin()
         position = positions(:, i)
         velocity = velocities(:, i)
         call respond_alone(solver%alone, equations(i), start_positions(:, i), start_velocities(:, i), position, velocity, &
                            visitor, motions(i), orbits(i)%monodromy, answers(i))
         positions(:, i) = position
         velocities(:, i) = velocity
         call solver%effort%end(stage_alone)
         call solver%effort%count_point(answers(i), motions(i)%periods > 0, alone=.true.)
      end do
   end subroutine respond

   !> Lanes can find the motions: with free steps, or with given ones by Newmark's method of average acceleration.
   pure function solve_in_lanes(options) result(they_can)
      !> Options.
      type(solver_options), intent(in) :: options
      !> They can.
      logical :: they_can

      they_can = options%steps_per_period == 0 .or. (options%integrator == integrator_newmark .and. is_average(options) &
                                                     .and. options%steps_per_period <= most_newmark_steps)
   end function solve_in_lanes

   !> Newmark's method takes the average acceleration.
   pure function is_average(options) result(it_does)
      !> Options.
      type(solver_options), intent(in) :: options
      !> It does.
      logical :: it_does

      it_does = .not. (abs(options%newmark_beta - 0.25_wp) > 0.0_wp .or. abs(options%newmark_gamma - 0.5_wp) > 0.0_wp)
   end function is_average

   !> Find motions in lanes, and measure them there as far as lanes meet the tolerance.
   subroutine respond_in_lanes(solver, equations, part, steps, positions, velocities, group, visitor, effort, motions, &
                               orbits, answers, done)
      !> Solver.
      type(lane_solver), intent(inout) :: solver
      !> Equations of motion of each point of the group, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point of the group, shape (n).
      integer, intent(in) :: part(:)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Start of every point; where its motion is found, a section of it.
      real(wp), intent(inout) :: positions(:, :), velocities(:, :)
      !> Points of the group, shape (n).
      integer, intent(in) :: group(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> What the points cost.
      type(effort_type), intent(inout) :: effort
      !> Motion of every point; its status remains `status_missing` if it must be found by other means.
      type(steady_motion), intent(inout) :: motions(:)
      !> Of every point that is periodic and not complete, the monodromy in its own modes; nothing else is filled in.
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> Response of every point.
      type(response), intent(inout) :: answers(:)
      !> The response of every point is complete.
      logical, intent(inout) :: done(:)

      type(steady_motion) :: found(size(group))
      type(periodic_orbit) :: near(size(group))
      type(response) :: measured(size(group))
      real(wp), allocatable :: position(:), velocity(:)
      integer, allocatable :: own(:)
      logical :: complete(size(group))
      integer :: few(size(group)), i, k

      call effort%begin()
      ! Steps that are given choose the motion too; free ones are chosen to measure it, and collocation finds it.
      solver%steps = steps
      solver%seekers%by_newmark = solver%options%steps_per_period > 0
      call search_in_lanes(solver%seekers, solver%parts, equations, part, &
                           merge(solver%options%steps_per_period, steps, solver%seekers%by_newmark), solver%options, &
                           positions(:, group), velocities(:, group), visitor, few, found, near)
      call effort%end(stage_search)
      complete = .false.
      measured = empty_response()
      if (solver%options%integrator == integrator_collocation .or. is_average(solver%options)) then
         call measure_windows(solver, equations, part, pack([(i, i=1, size(group))], found%status /= status_diverged &
                                                      .and. found%periods == 0), visitor, found, measured, complete)
         call measure_orbits(solver, equations, part, few, pack([(i, i=1, size(group))], found%periods > 0), visitor, found, near, &
                             measured, complete)
      end if
      call effort%end(stage_measure)
      do i = 1, size(group)
         ! What diverges in lanes may have had too few steps.
         if (found(i)%status == status_diverged) cycle
         associate (modal => solver%parts%modal(part(i)))
            call from_modes(modal, narrow(found(i)%state, modal%modes), position, velocity)
         end associate
         positions(:, group(i)) = position
         velocities(:, group(i)) = velocity
         motions(group(i)) = found(i)
         done(group(i)) = complete(i)
         if (complete(i)) answers(group(i)) = measured(i)
         if (complete(i) .or. found(i)%periods == 0) cycle
         own = [(k, k=1, solver%parts%modal(part(i))%modes)]
         own = [own, size(found(i)%state)/2 + own]
         orbits(group(i))%monodromy = near(i)%monodromy(own, own)
      end do
   end subroutine respond_in_lanes

end module spurflex_measure_points
