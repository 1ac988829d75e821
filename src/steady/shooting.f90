!> Periodic motions by Newton's method on the map over n mesh periods, and their Floquet multipliers.
!>
!> The monodromy comes from tangents that are carried along and see the same contact. While the contact pattern does not
!> change the map is affine and one iteration is exact.
module spurflex_steady_shooting
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_external_lapack, only: eigenvalues
   use spurflex_integrate_ensemble, only: ensemble, solo_ensemble, new_solo
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_batch, only: batch, solve_batch
   use spurflex_steady_outcome, only: longest_named
   use spurflex_steady_sections, only: weighted_norm
   implicit none
   private

   public :: periodic_orbit, find_orbit, find_orbits, floquet_multipliers, advance_periods, contact_is_kept

   !> Newton iterations at most; an affine map needs one, a change of the contact pattern a few more.
   integer, parameter :: most_iterations = 12

   !> Newton has converged when its step is this small beside the motion: it squares the error, so that what is left is round-off.
   real(wp), parameter :: converged_step = 1.0e-9_wp

   !> A Newton step this small is accepted where round-off lets it shrink no further.
   real(wp), parameter :: stagnant_step = 1.0e-8_wp

   !> Iterations after which the step must shrink by a factor each, or Newton's method is going nowhere.
   integer, parameter :: free_iterations = 5

   !> The same for motions that take many mesh periods: a torus comes back near to where it was, but nothing is there.
   integer, parameter :: free_long = 2

   !> Factor by which it must shrink.
   real(wp), parameter :: least_shrinkage = 0.5_wp

   !> A step this many times the size of the motion leads away from it.
   real(wp), parameter :: runaway = 1.0e3_wp

   !> Each step with a monodromy that is only near must shrink by this factor, or the true one is taken.
   real(wp), parameter :: near_shrinkage = 0.1_wp

   !> A step this small beside the motion leaves the monodromy near enough for the next one.
   real(wp), parameter :: near_step = 1.0e-3_wp

   !> What a seat does: advance with tangents, without them because the monodromy is near enough, look at the contact of what
   !> should be the motion, or look whether tangents are worth while.
   integer, parameter :: pass_linear = 1, pass_near = 2, pass_check = 3, pass_look = 4

   !> Newton's method in one seat.
   type :: newton_seat
      !> Which of the motions; 0 in an empty seat.
      integer :: item = 0
      !> `pass_...`, mesh periods done in this pass, iterations done.
      integer :: pass = pass_linear, done = 0, iteration = 0
      !> The pass has come to its end.
      logical :: ends = .false.
      !> Weighted length of the latest step [m].
      real(wp) :: length = huge(1.0_wp)
      !> Extremes of the mesh deflection in this pass [m].
      real(wp) :: low = 0.0_wp, high = 0.0_wp
   end type newton_seat

   !> A periodic motion.
   type :: periodic_orbit
      !> Mesh periods after which it repeats.
      integer :: periods = 0
      !> State at the section, shape (size).
      real(wp), allocatable :: state(:)
      !> Derivative of the map over its period, shape (size, size).
      real(wp), allocatable :: monodromy(:, :)
      !> Weighted length of the last Newton step [m].
      real(wp) :: last_step = 0.0_wp
      !> Extremes of the mesh deflection over its period [m].
      real(wp) :: smallest = 0.0_wp, largest = 0.0_wp
      !> Mesh periods integrated to find it.
      integer :: integrated = 0
   end type periodic_orbit

contains

   !> Advance a state, and tangents with it, by some mesh periods.
   subroutine advance_periods(map, periods, state, tangents, smallest, largest)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> Mesh periods.
      integer, intent(in) :: periods
      !> State at the section, shape (size).
      real(wp), intent(inout), contiguous :: state(:)
      !> Tangents, one in a row, shape (tangents, size).
      real(wp), intent(inout), optional, contiguous :: tangents(:, :)
      !> Extremes of the mesh deflection [m].
      real(wp), intent(out), optional :: smallest, largest

      real(wp) :: low, high
      integer :: k

      low = huge(1.0_wp)
      high = -huge(1.0_wp)
      do k = 1, periods
         call map%advance(state, tangents)
         low = min(low, map%smallest_deflection)
         high = max(high, map%largest_deflection)
      end do
      if (present(smallest)) smallest = low
      if (present(largest)) largest = high
   end subroutine advance_periods

   !> Find a periodic motion near a state.
   subroutine find_orbit(map, start, periods, scale, visitor, orbit, found)
      !> Period map at an operating point.
      class(period_map), intent(inout), target :: map
      !> State near the motion, shape (size).
      real(wp), intent(in) :: start(:)
      !> Mesh periods after which the motion repeats.
      integer, intent(in) :: periods
      !> Size of the motion [m].
      real(wp), intent(in) :: scale
      !> Let in between the iterations.
      class(attendant), intent(inout) :: visitor
      !> The motion.
      type(periodic_orbit), intent(out) :: orbit
      !> There is one.
      logical, intent(out) :: found

      type(solo_ensemble) :: solo
      type(periodic_orbit) :: orbits(1)
      logical :: is_found(1)

      call new_solo(map, solo)
      orbits(1)%periods = periods
      orbits(1)%state = start
      call find_orbits(solo, [1], [scale], visitor, orbits, is_found)
      orbit = orbits(1)
      found = is_found(1)
   end subroutine find_orbit

   !> Find periodic motions of several points, each near a state. A seat that becomes free is taken by the next at once.
   subroutine find_orbits(points, members, scale, visitor, orbits, found, only_affine, monodromy_is_near, roughly)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Size of each motion, shape (n) [m].
      real(wp), intent(in) :: scale(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> Period and a state near the motion before, the motion after, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> There is one, shape (n).
      logical, intent(out) :: found(:)
      !> Give up at once where contact is lost.
      logical, intent(in), optional :: only_affine
      !> The orbits come with monodromies that are nearly theirs: try those first.
      logical, intent(in), optional :: monodromy_is_near
      !> The monodromy may be that of a state nearby, `near_step` away at most.
      logical, intent(in), optional :: roughly

      real(wp) :: states(points%seats, points%size), tangents(points%seats, points%size, points%size)
      type(newton_seat) :: seats(points%seats)
      integer :: next, k
      logical :: affine, near, rough

      rough = .false.
      if (present(roughly)) rough = roughly
      affine = .false.
      if (present(only_affine)) affine = only_affine
      near = .false.
      if (present(monodromy_is_near)) near = monodromy_is_near
      found = .false.
      states = 0.0_wp
      tangents = 0.0_wp
      next = 1
      do
         do k = 1, points%seats
            if (seats(k)%item > 0 .or. next > size(members)) cycle
            seats(k) = newton_seat(item=next, pass=merge(pass_near, merge(pass_look, pass_linear, affine), near))
            orbits(next)%integrated = 0
            call points%seat(k, members(next))
            call begin_pass(points%in_use(:, members(next)), orbits(next)%state, seats(k), states(k, :), tangents(k, :, :))
            next = next + 1
         end do
         if (all(seats%item == 0)) exit
         if (any(seats%item > 0 .and. seats%pass == pass_linear)) then
            call points%advance(states, tangents)
         else
            call points%advance(states)
         end if
         do k = 1, points%seats
            seats(k)%low = min(seats(k)%low, points%smallest(k))
            seats(k)%high = max(seats(k)%high, points%largest(k))
            seats(k)%done = seats(k)%done + 1
            seats(k)%ends = .false.
            if (seats(k)%item == 0) cycle
            seats(k)%ends = seats(k)%done >= orbits(seats(k)%item)%periods
            if (seats(k)%ends .and. seats(k)%pass == pass_linear) then
               orbits(seats(k)%item)%monodromy = transpose(tangents(k, :, :))
            end if
         end do
         call newton_steps(points%size, seats, orbits, states)
         do k = 1, points%seats
            if (.not. seats(k)%ends) cycle
            associate (seat => seats(k), orbit => orbits(seats(k)%item))
               call end_pass(points%weight(:, members(seat%item)), points%half_backlash, scale(seat%item), states(k, :), &
                             affine, rough, seat, orbit, found(seat%item))
               if (seat%item > 0) call begin_pass(points%in_use(:, members(seat%item)), orbit%state, seat, states(k, :), &
                                                  tangents(k, :, :))
            end associate
         end do
         do k = 1, points%seats
            if (seats(k)%item > 0) cycle
            ! An empty seat is integrated with the others, always from zero, so that nothing can overflow.
            states(k, :) = 0.0_wp
            tangents(k, :, :) = 0.0_wp
         end do
         call visitor%attend()
      end do
   end subroutine find_orbits

   !> Begin to advance a state, and a unit tangent for each component, over the period of the motion.
   pure subroutine begin_pass(in_use, start, seat, state, tangents)
      !> A component is one of the point's own, shape (size).
      logical, intent(in) :: in_use(:)
      !> Where from, shape (size).
      real(wp), intent(in) :: start(:)
      !> Seat.
      type(newton_seat), intent(inout) :: seat
      !> State, shape (size).
      real(wp), intent(out) :: state(:)
      !> Tangents, shape (size, size).
      real(wp), intent(inout) :: tangents(:, :)

      integer :: i

      seat%done = 0
      seat%low = huge(1.0_wp)
      seat%high = -huge(1.0_wp)
      state = start
      if (seat%pass /= pass_linear) return
      tangents = 0.0_wp
      do i = 1, size(start)
         if (in_use(i)) tangents(i, i) = 1.0_wp
      end do
   end subroutine begin_pass

   !> A period of the motion has passed: take a Newton step, and decide whether the motion is found or given up.
   subroutine end_pass(weight, half_backlash, scale, step, only_affine, roughly, seat, orbit, found)
      !> Weights of the states, shape (size).
      real(wp), intent(in) :: weight(:)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Size of the motion [m].
      real(wp), intent(in) :: scale
      !> Newton's step, shape (size).
      real(wp), intent(in) :: step(:)
      !> Give up where contact is lost.
      logical, intent(in) :: only_affine
      !> The monodromy may be that of a state nearby.
      logical, intent(in) :: roughly
      !> Seat, free again where there is nothing more to do.
      type(newton_seat), intent(inout) :: seat
      !> The motion.
      type(periodic_orbit), intent(inout) :: orbit
      !> It is found.
      logical, intent(inout) :: found

      real(wp) :: previous
      integer :: item
      logical :: was_kept

      item = seat%item
      seat%item = 0
      orbit%integrated = orbit%integrated + orbit%periods
      orbit%smallest = seat%low
      orbit%largest = seat%high
      was_kept = contact_is_kept(half_backlash, orbit)
      if (only_affine .and. .not. was_kept) return
      if (seat%pass == pass_check) then
         found = was_kept
      else if (seat%pass /= pass_look) then
         previous = seat%length
         seat%length = weighted_norm(weight, step)
         if (.not. seat%length < runaway*scale) return
         if (seat%pass == pass_near .and. seat%length > near_shrinkage*previous) then
            ! The monodromy that was given is not near enough.
            seat%length = huge(1.0_wp)
            seat%pass = pass_linear
            seat%item = item
            return
         end if
         seat%iteration = seat%iteration + 1
         if (seat%iteration > merge(free_iterations, free_long, orbit%periods <= longest_named) .and. &
             seat%length > max(least_shrinkage*previous, stagnant_step*scale)) return
         orbit%state = orbit%state + step
         orbit%last_step = seat%length
         found = seat%length <= converged_step*scale .or. (seat%length <= stagnant_step*scale .and. seat%length > 0.25_wp*previous)
         if (found .or. seat%iteration == most_iterations) return
         if (roughly .and. seat%pass == pass_linear .and. seat%length <= near_step*scale) seat%pass = pass_near
         ! Where the map was affine the new state is the fixed point, if the map is affine there too.
         if (was_kept .and. seat%pass == pass_linear) seat%pass = pass_check
         seat%item = item
         return
      end if
      if (found) return
      seat%pass = pass_linear
      seat%item = item
   end subroutine end_pass

   !> Newton's steps towards the fixed points, in the seats that have come to the end of a pass.
   subroutine newton_steps(n, seats, orbits, states)
      !> Length of a state.
      integer, intent(in) :: n
      !> The seats.
      type(newton_seat), intent(in) :: seats(:)
      !> The motions, with their states and monodromies.
      type(periodic_orbit), intent(in) :: orbits(:)
      !> Where the pass led to before, the step after; not finite where a multiplier is one. Shape (seats, size).
      real(wp), intent(inout) :: states(:, :)

      real(wp) :: matrix(batch, n, n), right(batch, n)
      integer :: k, i, first

      do first = 1, size(seats), batch
         if (.not. any(seats(first:min(first + batch - 1, size(seats)))%ends)) cycle
         matrix = 0.0_wp
         right = 0.0_wp
         do i = 1, n
            matrix(:, i, i) = 1.0_wp
         end do
         do k = first, min(first + batch - 1, size(seats))
            if (.not. seats(k)%ends .or. seats(k)%pass == pass_check .or. seats(k)%pass == pass_look) cycle
            associate (orbit => orbits(seats(k)%item))
               matrix(k - first + 1, :, :) = matrix(k - first + 1, :, :) - orbit%monodromy
               right(k - first + 1, :) = states(k, :) - orbit%state
            end associate
         end do
         call solve_batch(n, matrix, right)
         do k = first, min(first + batch - 1, size(seats))
            if (seats(k)%ends) states(k, :) = right(k - first + 1, :)
         end do
      end do
   end subroutine newton_steps

   !> The teeth never part on a motion: the map is affine.
   pure function contact_is_kept(half_backlash, orbit) result(kept)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> The motion, with the extremes of its mesh deflection.
      type(periodic_orbit), intent(in) :: orbit
      !> Contact on one flank all the time.
      logical :: kept

      kept = orbit%smallest >= half_backlash .or. orbit%largest <= -half_backlash
   end function contact_is_kept

   !> Floquet multipliers: eigenvalues of the monodromy.
   subroutine floquet_multipliers(monodromy, multipliers, error)
      !> Derivative of the map over the period of the motion, shape (size, size).
      real(wp), intent(in) :: monodromy(:, :)
      !> The multipliers, shape (size).
      complex(wp), allocatable, intent(out) :: multipliers(:)
      !> Set where the eigenvalues do not converge.
      type(error_type), allocatable, intent(out) :: error

      call eigenvalues(monodromy, multipliers, error)
   end subroutine floquet_multipliers

end module spurflex_steady_shooting
