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

   public :: periodic_orbit, move_orbit, find_orbit, find_orbits, floquet_multipliers, advance_periods, contact_is_kept

   !> Newton iterations at most; an affine map needs one, a change of the contact pattern a few more.
   integer, parameter :: most_iterations = 12

   !> Newton has converged when what is left is this small beside the motion: its latest step, or, where the steps shrink fast,
   !> what the next one would be if they went on shrinking by the same factor.
   real(wp), parameter :: converged_step = 1.0e-9_wp

   !> Steps that shrink by this factor or more shrink fast, and one this small beside the motion is near enough to trust in it.
   real(wp), parameter :: fast_shrinkage = 1.0e-2_wp, trusted_step = 1.0e-5_wp

   !> A Newton step this small is accepted where round-off lets it shrink no further.
   real(wp), parameter :: stagnant_step = 1.0e-8_wp

   !> Iterations after which the step must shrink by a factor each, or Newton's method is going nowhere: for motions that take
   !> one mesh period, some, and many. The longer they are, the dearer an iteration and the more often a motion that is not
   !> periodic comes back near to where it was, but nothing is there.
   integer, parameter :: free_iterations = 5, free_some = 3, free_long = 2

   !> Factor by which it must shrink.
   real(wp), parameter :: least_shrinkage = 0.5_wp

   !> A step this many times the size of the motion leads away from it.
   real(wp), parameter :: runaway = 1.0e3_wp

   !> Each step with a monodromy that is only near must shrink by this factor, or the true one is taken.
   real(wp), parameter :: near_shrinkage = 0.1_wp

   !> A step this small beside the motion leaves the monodromy near enough for the next one.
   real(wp), parameter :: near_step = 1.0e-3_wp

   !> What a motion waits for: nothing, it is found or given up; to be advanced with tangents; without them because the monodromy
   !> is near enough; a look at the contact of what should be the motion; a look whether tangents are worth while.
   integer, parameter :: pass_none = 0, pass_linear = 1, pass_near = 2, pass_check = 3, pass_look = 4

   !> Newton's method on one motion.
   type :: newton_item
      !> `pass_...`, mesh periods done in this pass, iterations done.
      integer :: pass = pass_linear, done = 0, iteration = 0
      !> Weighted length of the latest step [m].
      real(wp) :: length = huge(1.0_wp)
      !> Extremes of the mesh deflection in this pass [m].
      real(wp) :: low = 0.0_wp, high = 0.0_wp
   end type newton_item

   !> Newton's method on several motions.
   type :: newton_type
      !> Each motion, shape (n).
      type(newton_item), allocatable :: items(:)
      !> Give up where contact is lost; the monodromy may be that of a state nearby.
      logical :: only_affine = .false., roughly = .false.
   end type newton_type

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

   !> Find periodic motions of several points, each near a state.
   !>
   !> Passes with tangents and passes without take turns, so that no lane carries tangents that it does not need.
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

      type(newton_type) :: newton

      allocate (newton%items(size(members)))
      if (present(roughly)) newton%roughly = roughly
      if (present(only_affine)) newton%only_affine = only_affine
      if (newton%only_affine) newton%items%pass = pass_look
      if (present(monodromy_is_near)) then
         if (monodromy_is_near) newton%items%pass = pass_near
      end if
      orbits%integrated = 0
      found = .false.
      do while (any(newton%items%pass /= pass_none))
         call run_passes(points, members, scale, visitor, newton, orbits, found, with_tangents=.true.)
         call run_passes(points, members, scale, visitor, newton, orbits, found, with_tangents=.false.)
      end do
   end subroutine find_orbits

   !> Run all passes of one kind until none is left. A seat that becomes free is taken by the next motion at once.
   subroutine run_passes(points, members, scale, visitor, newton, orbits, found, with_tangents)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Size of each motion, shape (n) [m].
      real(wp), intent(in) :: scale(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> Newton's method.
      type(newton_type), intent(inout) :: newton
      !> The motions, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> It is found, shape (n).
      logical, intent(inout) :: found(:)
      !> Passes with tangents, or those without.
      logical, intent(in) :: with_tangents

      real(wp) :: states(points%seats, points%size)
      real(wp), allocatable :: tangents(:, :, :)
      integer :: seated(points%seats), next, k
      logical :: ends(points%seats)

      if (.not. any(runs(newton%items, with_tangents))) return
      if (with_tangents) allocate (tangents(points%seats, points%size, points%size), source=0.0_wp)
      states = 0.0_wp
      seated = 0
      next = 1
      do
         do k = 1, points%seats
            do while (seated(k) == 0 .and. next <= size(members))
               if (runs(newton%items(next), with_tangents)) then
                  seated(k) = next
                  call points%seat(k, members(next))
                  call begin_pass(next)
               end if
               next = next + 1
            end do
         end do
         if (all(seated == 0)) exit
         if (with_tangents) then
            call points%advance(states, tangents)
         else
            call points%advance(states)
         end if
         do k = 1, points%seats
            ends(k) = .false.
            if (seated(k) == 0) cycle
            associate (item => newton%items(seated(k)))
               item%low = min(item%low, points%smallest(k))
               item%high = max(item%high, points%largest(k))
               item%done = item%done + 1
               ends(k) = item%done >= orbits(seated(k))%periods
               if (ends(k) .and. with_tangents) orbits(seated(k))%monodromy = transpose(tangents(k, :, :))
            end associate
         end do
         call newton_steps(points%size, seated, ends, newton%items, orbits, states)
         do k = 1, points%seats
            if (.not. ends(k)) cycle
            associate (p => seated(k))
               call end_pass(points%weight(:, members(p)), points%half_backlash, scale(p), states(k, :), newton%only_affine, &
                             newton%roughly, newton%items(p), orbits(p), found(p))
            end associate
            if (runs(newton%items(seated(k)), with_tangents)) then
               call begin_pass(seated(k))
               cycle
            end if
            ! An empty seat is integrated with the others, always from zero, so that nothing can overflow.
            seated(k) = 0
            if (with_tangents) tangents(k, :, :) = 0.0_wp
         end do
         do k = 1, points%seats
            if (seated(k) == 0) states(k, :) = 0.0_wp
         end do
         call visitor%attend()
      end do

   contains

      !> Begin to advance the state of a motion in seat k, and a unit tangent for each component, over its period.
      subroutine begin_pass(p)
         !> Which of the motions.
         integer, intent(in) :: p

         integer :: i

         newton%items(p)%done = 0
         newton%items(p)%low = huge(1.0_wp)
         newton%items(p)%high = -huge(1.0_wp)
         states(k, :) = orbits(p)%state
         if (.not. with_tangents) return
         tangents(k, :, :) = 0.0_wp
         do i = 1, points%size
            if (points%in_use(i, members(p))) tangents(k, i, i) = 1.0_wp
         end do
      end subroutine begin_pass

   end subroutine run_passes

   !> A motion waits for a pass with tangents, or for one without.
   elemental function runs(item, with_tangents) result(it_does)
      !> Newton's method on it.
      type(newton_item), intent(in) :: item
      !> With tangents.
      logical, intent(in) :: with_tangents
      !> It does.
      logical :: it_does

      it_does = item%pass /= pass_none .and. (with_tangents .eqv. item%pass == pass_linear)
   end function runs

   !> A period of the motion has passed: take a Newton step, and decide whether the motion is found or given up.
   subroutine end_pass(weight, half_backlash, scale, step, only_affine, roughly, item, orbit, found)
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
      !> Newton's method; it waits for nothing more where the motion is found or given up.
      type(newton_item), intent(inout) :: item
      !> The motion.
      type(periodic_orbit), intent(inout) :: orbit
      !> It is found.
      logical, intent(inout) :: found

      real(wp) :: previous
      integer :: pass, free
      logical :: was_kept

      pass = item%pass
      item%pass = pass_none
      orbit%integrated = orbit%integrated + orbit%periods
      orbit%smallest = item%low
      orbit%largest = item%high
      was_kept = contact_is_kept(half_backlash, orbit)
      if (only_affine .and. .not. was_kept) return
      if (pass == pass_check .or. pass == pass_look) then
         found = was_kept .and. pass == pass_check
         if (.not. found) item%pass = pass_linear
         return
      end if
      previous = item%length
      item%length = weighted_norm(weight, step)
      if (.not. item%length < runaway*scale) return
      if (pass == pass_near .and. item%length > near_shrinkage*previous) then
         ! The monodromy that was given is not near enough.
         item%length = huge(1.0_wp)
         item%pass = pass_linear
         return
      end if
      item%iteration = item%iteration + 1
      free = free_long
      if (orbit%periods <= longest_named) free = merge(free_iterations, free_some, orbit%periods == 1)
      if (item%iteration > free .and. item%length > max(least_shrinkage*previous, stagnant_step*scale)) return
      orbit%state = orbit%state + step
      orbit%last_step = item%length
      found = item%length <= converged_step*scale .or. (item%length <= stagnant_step*scale .and. item%length > 0.25_wp*previous)
      if (item%iteration > 1 .and. item%length <= min(trusted_step*scale, fast_shrinkage*previous)) then
         found = found .or. item%length*(item%length/previous) <= converged_step*scale
      end if
      if (found .or. item%iteration == most_iterations) return
      item%pass = pass
      if (roughly .and. pass == pass_linear .and. item%length <= near_step*scale) item%pass = pass_near
      ! Where the map was affine the new state is the fixed point, if the map is affine there too.
      if (was_kept .and. item%pass == pass_linear) item%pass = pass_check
   end subroutine end_pass

   !> Newton's steps towards the fixed points, in the seats that have come to the end of a pass.
   subroutine newton_steps(n, seated, ends, items, orbits, states)
      !> Length of a state.
      integer, intent(in) :: n
      !> Which of the motions is in each seat, shape (seats).
      integer, intent(in) :: seated(:)
      !> Its pass has come to its end, shape (seats).
      logical, intent(in) :: ends(:)
      !> Newton's method on each motion.
      type(newton_item), intent(in) :: items(:)
      !> The motions, with their states and monodromies.
      type(periodic_orbit), intent(in) :: orbits(:)
      !> Where the pass led to before, the step after; not finite where a multiplier is one. Shape (seats, size).
      real(wp), intent(inout) :: states(:, :)

      real(wp) :: matrix(batch, n, n), right(batch, n)
      logical :: steps(size(seated))
      integer :: k, i, first, last

      do k = 1, size(seated)
         steps(k) = ends(k)
         if (ends(k)) steps(k) = items(seated(k))%pass == pass_linear .or. items(seated(k))%pass == pass_near
      end do
      do first = 1, size(seated), batch
         last = min(first + batch - 1, size(seated))
         if (.not. any(steps(first:last))) cycle
         matrix = 0.0_wp
         right = 0.0_wp
         do i = 1, n
            matrix(:, i, i) = 1.0_wp
         end do
         do k = first, last
            if (.not. steps(k)) cycle
            associate (orbit => orbits(seated(k)))
               matrix(k - first + 1, :, :) = matrix(k - first + 1, :, :) - orbit%monodromy
               right(k - first + 1, :) = states(k, :) - orbit%state
            end associate
         end do
         call solve_batch(n, matrix, right)
         do k = first, last
            if (steps(k)) states(k, :) = right(k - first + 1, :)
         end do
      end do
   end subroutine newton_steps

   !> Move a motion without copying its matrix.
   pure subroutine move_orbit(from, to)
      !> The motion; without state and monodromy afterwards.
      type(periodic_orbit), intent(inout) :: from
      !> Where to.
      type(periodic_orbit), intent(inout) :: to

      to%periods = from%periods
      to%last_step = from%last_step
      to%smallest = from%smallest
      to%largest = from%largest
      to%integrated = from%integrated
      call move_alloc(from%state, to%state)
      call move_alloc(from%monodromy, to%monodromy)
   end subroutine move_orbit

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
