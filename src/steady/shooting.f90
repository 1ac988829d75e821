!> Periodic motions by Newton's method on the map over n mesh periods, and their Floquet multipliers.
!>
!> The monodromy comes from tangents that are carried along and see the same contact. While the contact pattern does not
!> change the map is affine and one iteration is exact.
module spurflex_steady_shooting
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_ensemble, only: ensemble, solo_ensemble, new_solo
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_newton, only: newton_item, newton_steps, end_pass, pass_none, pass_linear, pass_near, pass_look, &
      converged_step
   use spurflex_steady_orbit, only: periodic_orbit
   implicit none
   private

   public :: find_orbit, find_orbits, advance_periods

   !> Newton's method on several motions.
   type :: newton_type
      !> Each motion, shape (n).
      type(newton_item), allocatable :: items(:)
      !> Give up where contact is lost; the monodromy may be that of a state nearby.
      logical :: only_affine = .false., roughly = .false.
      !> What may be left of the distance to a motion that takes one mesh period, beside its size.
      real(wp) :: near_enough = converged_step
   end type newton_type

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
   subroutine find_orbit(map, start, periods, scale, visitor, orbit, found, monodromy, near_enough)
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
      !> A monodromy that is nearly that of the motion, to be tried first, shape (size, size).
      real(wp), intent(in), optional :: monodromy(:, :)
      !> As of `find_orbits`.
      real(wp), intent(in), optional :: near_enough

      type(solo_ensemble) :: solo
      type(periodic_orbit) :: orbits(1)
      logical :: is_found(1)

      call new_solo(map, solo)
      orbits(1)%periods = periods
      orbits(1)%state = start
      if (present(monodromy)) orbits(1)%monodromy = monodromy
      call find_orbits(solo, [1], [scale], visitor, orbits, is_found, monodromy_is_near=present(monodromy), &
                       roughly=present(monodromy), near_enough=near_enough)
      orbit = orbits(1)
      found = is_found(1)
   end subroutine find_orbit

   !> Find periodic motions of several points, each near a state.
   !>
   !> Passes with tangents and passes without take turns, so that no lane carries tangents that it does not need.
   subroutine find_orbits(points, members, scale, visitor, orbits, found, only_affine, monodromy_is_near, roughly, &
                          near_enough)
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
      !> What may be left of the distance to a motion that takes one mesh period, beside its size, if that is more than Newton's
      !> method leaves.
      real(wp), intent(in), optional :: near_enough

      type(newton_type) :: newton

      allocate (newton%items(size(members)))
      if (present(roughly)) newton%roughly = roughly
      if (present(near_enough)) newton%near_enough = max(near_enough, converged_step)
      if (present(only_affine)) newton%only_affine = only_affine
      if (newton%only_affine) newton%items%pass = pass_look
      orbits%given = .false.
      if (present(monodromy_is_near)) orbits%given = monodromy_is_near
      where (orbits%given) newton%items%pass = pass_near
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
      integer :: seated(points%seats), next, k, i
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
               if (.not. (ends(k) .and. with_tangents)) cycle
               if (.not. allocated(orbits(seated(k))%monodromy)) allocate (orbits(seated(k))%monodromy(points%size, points%size))
               do i = 1, points%size
                  orbits(seated(k))%monodromy(:, i) = tangents(k, i, :)
               end do
               orbits(seated(k))%given = .false.
            end associate
         end do
         call newton_steps(points%size, seated, ends, newton%items, orbits, states)
         do k = 1, points%seats
            if (.not. ends(k)) cycle
            associate (p => seated(k))
               call end_pass(points%weight(:, members(p)), points%half_backlash, scale(p), states(k, :), newton%only_affine, &
                             newton%roughly, left_over(orbits(p)%periods), newton%items(p), orbits(p), found(p))
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

      !> What may be left of the distance to a motion: the shortest period of a longer one is told by its sections.
      pure function left_over(periods) result(distance)
         !> Mesh periods after which it repeats.
         integer, intent(in) :: periods
         !> The distance, beside the size of the motion.
         real(wp) :: distance

         distance = merge(newton%near_enough, converged_step, periods == 1)
      end function left_over

      !> Begin to advance the state of a motion in seat k, and a unit tangent for each component, over its period.
      subroutine begin_pass(p)
         !> Which of the motions.
         integer, intent(in) :: p

         integer :: c

         newton%items(p)%done = 0
         newton%items(p)%low = huge(1.0_wp)
         newton%items(p)%high = -huge(1.0_wp)
         states(k, :) = orbits(p)%state
         if (.not. with_tangents) return
         tangents(k, :, :) = 0.0_wp
         do c = 1, points%size
            if (points%in_use(c, members(p))) tangents(k, c, c) = 1.0_wp
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

end module spurflex_steady_shooting
