!> Several points of the grid that are integrated side by side.
!>
!> An ensemble has seats. A point is put into a seat, all seats advance together by one mesh period, and a seat whose point
!> has come to its end is given to another point. What happens in one seat does not depend on the others.
module spurflex_integrate_ensemble
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_period_map, only: period_map
   implicit none
   private

   public :: ensemble, solo_ensemble, new_solo

   !> Points side by side. Their states have one length.
   type, abstract :: ensemble
      !> Seats; length of a state.
      integer :: seats = 1, size = 0
      !> Half of the backlash [m].
      real(wp) :: half_backlash = 0.0_wp
      !> What a component of a state counts for in a norm in metres, shape (size, points).
      real(wp), allocatable :: weight(:, :)
      !> A component is one of the point's own, not room for modes that others have, shape (size, points).
      logical, allocatable :: in_use(:, :)
      !> Extremes of the mesh deflection over the latest period, shape (seats) [m].
      real(wp), allocatable :: smallest(:), largest(:)
   contains
      !> Put a point into a seat.
      procedure(seat_interface), deferred :: seat
      !> Advance all seats by one mesh period.
      procedure(advance_interface), deferred :: advance
      !> Bound of what a difference of states does to the mesh deflection, at any later time while contact is kept.
      procedure(bound_interface), deferred :: deflection_bound
   end type ensemble

   !> One point with its own period map, in a single seat.
   type, extends(ensemble) :: solo_ensemble
      private
      !> The map.
      class(period_map), pointer :: map => null()
   contains
      procedure :: seat => stay_seated
      procedure :: advance => advance_alone
      procedure :: deflection_bound => bound_of_map
   end type solo_ensemble

   abstract interface
      !> Put a point into a seat.
      subroutine seat_interface(self, number, point)
         import :: ensemble
         !> Ensemble.
         class(ensemble), intent(inout) :: self
         !> Seat, and index of the point.
         integer, intent(in) :: number, point
      end subroutine seat_interface

      !> Advance all seats by one mesh period.
      subroutine advance_interface(self, states, tangents)
         import :: ensemble, wp
         !> Ensemble.
         class(ensemble), intent(inout) :: self
         !> States at the section, shape (seats, size); those in empty seats mean nothing.
         real(wp), intent(inout), contiguous :: states(:, :)
         !> Tangents that see the same contact, shape (seats, tangents, size).
         real(wp), intent(inout), optional, contiguous :: tangents(:, :, :)
      end subroutine advance_interface

      !> Bound of what a difference of states does to the mesh deflection.
      pure function bound_interface(self, difference) result(bound)
         import :: ensemble, wp
         !> Ensemble.
         class(ensemble), intent(in) :: self
         !> Difference of two states, shape (size).
         real(wp), intent(in) :: difference(:)
         !> The bound [m].
         real(wp) :: bound
      end function bound_interface
   end interface

contains

   !> Make an ensemble of one point.
   subroutine new_solo(map, solo)
      !> Period map at the point; outlives the ensemble.
      class(period_map), intent(in), target :: map
      !> The ensemble.
      type(solo_ensemble), intent(out) :: solo

      solo%map => map
      solo%size = map%size
      solo%half_backlash = map%half_backlash
      solo%weight = reshape(map%weight, [map%size, 1])
      allocate (solo%in_use(map%size, 1), source=.true.)
      allocate (solo%smallest(1), solo%largest(1), source=0.0_wp)
   end subroutine new_solo

   !> There is one point only.
   subroutine stay_seated(self, number, point)
      !> Ensemble.
      class(solo_ensemble), intent(inout) :: self
      !> Seat and point.
      integer, intent(in) :: number, point

      if (number /= 1 .or. point < 1) self%smallest = 0.0_wp
   end subroutine stay_seated

   !> Advance the point by one mesh period.
   subroutine advance_alone(self, states, tangents)
      !> Ensemble.
      class(solo_ensemble), intent(inout) :: self
      !> State, shape (1, size).
      real(wp), intent(inout), contiguous :: states(:, :)
      !> Tangents, shape (1, tangents, size).
      real(wp), intent(inout), optional, contiguous :: tangents(:, :, :)

      real(wp) :: state(size(states, 2))

      state = states(1, :)
      if (present(tangents)) then
         call advance_with(size(tangents, 2), tangents)
      else
         call self%map%advance(state)
      end if
      states(1, :) = state
      self%smallest = self%map%smallest_deflection
      self%largest = self%map%largest_deflection

   contains

      !> Advance with tangents, whose first dimension has one element.
      subroutine advance_with(count, rows)
         !> Number of tangents.
         integer, intent(in) :: count
         !> Tangents, one in a row.
         real(wp), intent(inout) :: rows(count, size(states, 2))

         call self%map%advance(state, rows)
      end subroutine advance_with

   end subroutine advance_alone

   !> Bound by the map.
   pure function bound_of_map(self, difference) result(bound)
      !> Ensemble.
      class(solo_ensemble), intent(in) :: self
      !> Difference of two states, shape (size).
      real(wp), intent(in) :: difference(:)
      !> The bound [m].
      real(wp) :: bound

      bound = self%map%deflection_bound(difference)
   end function bound_of_map

end module spurflex_integrate_ensemble
