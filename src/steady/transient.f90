!> Transients: motions under way from their start, several side by side, with what has been seen of them.
module spurflex_steady_transient
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_ensemble, only: ensemble
   use spurflex_steady_sections, only: section_ring, longest_period, weighted_norm, find_norms
   use spurflex_steady_watch, only: watch_type
   implicit none
   private

   public :: transient_type, begin_transient, watch_from_now, end_watch, advance_transients, watches

   !> A state of this norm has left every physical range; far below overflow [m].
   real(wp), parameter :: diverged_norm = 1.0e100_wp

   !> Watches over a transient that overlap.
   integer, parameter :: watches = 2

   !> A transient under way.
   type :: transient_type
      !> State at the latest section, and a tangent there, shape (size).
      real(wp), allocatable :: state(:), tangent(:)
      !> Latest sections.
      type(section_ring) :: ring
      !> What is seen of it.
      type(watch_type) :: watch(watches)
      !> Mesh periods integrated.
      integer :: periods = 0
      !> The state is finite.
      logical :: sound = .true.
      !> A tangent is carried, for the watches that sum its growth.
      logical :: grows = .false.
   end type transient_type

contains

   !> Begin a transient.
   pure subroutine begin_transient(weight, in_use, start, transient)
      !> Weights of the states, shape (size).
      real(wp), intent(in) :: weight(:)
      !> A component is one of the point's own, shape (size).
      logical, intent(in) :: in_use(:)
      !> State at the first section, shape (size).
      real(wp), intent(in) :: start(:)
      !> The transient.
      type(transient_type), intent(out) :: transient

      transient%state = start
      transient%tangent = merge(1.0_wp, 0.0_wp, in_use)
      transient%tangent = transient%tangent/weighted_norm(weight, transient%tangent)
      call transient%ring%reset(weight)
      call transient%ring%add(start)
   end subroutine begin_transient

   !> Begin a watch.
   pure subroutine watch_from_now(transient, which, until, grows)
      !> The transient.
      type(transient_type), intent(inout) :: transient
      !> Which watch.
      integer, intent(in) :: which
      !> Mesh period up to which it lasts.
      integer, intent(in) :: until
      !> The growth of a tangent is wanted.
      logical, intent(in) :: grows

      call transient%watch(which)%begin(transient%periods, until, grows)
      if (grows .and. .not. transient%grows) then
         ! Any tangent turns into the direction that grows most, or decays least, but on a torus only slowly.
         associate (direction => transient%ring%return_direction())
            if (any(abs(direction) > 0.0_wp)) transient%tangent = direction
         end associate
      end if
      transient%grows = any(transient%watch%grows)
   end subroutine watch_from_now

   !> End a watch that is not followed by another.
   pure subroutine end_watch(transient, which)
      !> The transient.
      type(transient_type), intent(inout) :: transient
      !> Which watch.
      integer, intent(in) :: which

      transient%watch(which)%is_on = .false.
      transient%watch(which)%grows = .false.
      transient%grows = any(transient%watch%grows)
   end subroutine end_watch

   !> Integrate transients, each up to a period of its own. A seat that becomes free is taken by the next at once.
   subroutine advance_transients(points, members, until, transients, visitor)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Mesh periods in all, shape (n).
      integer, intent(in) :: until(:)
      !> The transients, shape (points).
      type(transient_type), intent(inout) :: transients(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor

      real(wp), dimension(points%seats, points%size) :: states, weights
      real(wp) :: tangents(points%seats, 1, points%size), sizes(points%seats), growth(points%seats)
      integer :: seated(points%seats), next, k, i
      logical :: grows

      states = 0.0_wp
      tangents = 0.0_wp
      weights = 0.0_wp
      growth = 1.0_wp
      seated = 0
      next = 1
      do
         do k = 1, points%seats
            do while (seated(k) == 0 .and. next <= size(members))
               if (transients(members(next))%sound .and. transients(members(next))%periods < until(next)) then
                  seated(k) = next
                  call points%seat(k, members(next))
                  states(k, :) = transients(members(next))%state
                  tangents(k, 1, :) = transients(members(next))%tangent
                  weights(k, :) = points%weight(:, members(next))
               end if
               next = next + 1
            end do
         end do
         if (all(seated == 0)) exit
         grows = .false.
         do k = 1, points%seats
            if (seated(k) > 0) grows = grows .or. transients(members(seated(k)))%grows
         end do
         if (grows) then
            call points%advance(states, tangents)
            call find_norms(points%seats, points%size, weights, tangents, growth)
            growth = max(growth, tiny(1.0_wp))
            do i = 1, points%size
               tangents(:, 1, i) = tangents(:, 1, i)/growth
            end do
         else
            call points%advance(states)
         end if
         call find_norms(points%seats, points%size, weights, states, sizes)
         do k = 1, points%seats
            if (seated(k) == 0) then
               ! An empty seat is integrated with the others, always from zero, so that nothing can overflow.
               states(k, :) = 0.0_wp
               tangents(k, 1, :) = 0.0_wp
               cycle
            end if
            associate (transient => transients(members(seated(k))))
               call see_section(states(k, :), sizes(k), growth(k), until(seated(k)), transient)
               if (grows .and. .not. transient%grows) tangents(k, 1, :) = transient%tangent
               if (transient%sound .and. transient%periods < until(seated(k))) cycle
               transient%state = states(k, :)
               transient%tangent = tangents(k, 1, :)
               seated(k) = 0
               states(k, :) = 0.0_wp
            end associate
         end do
         call visitor%attend()
      end do
   end subroutine advance_transients

   !> See the next section of a transient.
   pure subroutine see_section(state, norm, growth, until, transient)
      !> The section, shape (size), and its norm [m].
      real(wp), intent(in) :: state(:), norm
      !> What the tangent has grown by.
      real(wp), intent(in) :: growth
      !> Mesh period up to which it is integrated.
      integer, intent(in) :: until
      !> The transient.
      type(transient_type), intent(inout) :: transient

      integer :: w

      transient%periods = transient%periods + 1
      ! Earlier ones will not be asked for.
      if (until - transient%periods <= longest_period) call transient%ring%add(state, norm)
      transient%sound = norm < diverged_norm
      do w = 1, watches
         if (transient%watch(w)%is_on) call transient%watch(w)%see(transient%periods, norm, growth)
      end do
   end subroutine see_section

end module spurflex_steady_transient
