!> Motions measured in the lanes, a motion in each seat.
module spurflex_measure_lane_motion
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_ensemble, only: lane_ensemble
   use spurflex_integrate_lane_observe, only: point_view, lane_view, seat_view, observe, take_orbit
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: response, contact_of
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: measure_lanes

   !> What is being measured in one seat.
   type :: measured_seat
      !> Which of the motions; 0 in an empty seat.
      integer :: item = 0
      !> Mesh periods done.
      integer :: done = 0
      !> The whole, and its halves.
      type(motion_measure) :: whole, half(2)
      !> Extremes of the mesh deflection [m].
      real(wp) :: smallest = huge(1.0_wp), largest = -huge(1.0_wp)
   end type measured_seat

contains

   !> Measure motions over some mesh periods. A seat that becomes free is taken by the next at once.
   subroutine measure_lanes(points, equations, views, part, view, members, periods, visitor, states, whole, halves)
      !> The points.
      type(lane_ensemble), intent(inout) :: points
      !> Equations of motion of each point, shape (points).
      type(equations_type), intent(in) :: equations(:)
      !> How the displacements of the linear parts follow from the modes, and which of them is that of each point, shape (points).
      type(point_view), intent(in) :: views(:)
      integer, intent(in) :: part(:)
      !> Room for what the seats see.
      type(lane_view), intent(inout) :: view
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Mesh periods, shape (n).
      integer, intent(in) :: periods(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> Section of each motion; moves to the end, shape (size, n).
      real(wp), intent(inout) :: states(:, :)
      !> Displacements and contact are filled in, shape (n).
      type(response), intent(inout) :: whole(:)
      !> Displacements over the first and the second half, shape (2, n).
      type(response), intent(inout), optional :: halves(:, :)

      type(measured_seat) :: seats(points%seats)
      type(orbit_type) :: orbit
      real(wp) :: moving(points%seats, points%size)
      integer :: next, k

      moving = 0.0_wp
      next = 1
      do
         do k = 1, points%seats
            if (seats(k)%item > 0 .or. next > size(members)) cycle
            seats(k) = measured_seat(item=next)
            call seats(k)%whole%reset(equations(members(next))%static_observation)
            call seats(k)%half(1)%reset(equations(members(next))%static_observation)
            call seats(k)%half(2)%reset(equations(members(next))%static_observation)
            call points%seat(k, members(next))
            call seat_view(view, k, views(part(members(next))))
            moving(k, :) = states(:, next)
            next = next + 1
         end do
         if (all(seats%item == 0)) exit
         call points%advance_recorded(moving)
         call observe(view, points%size/2, points%record, points%steps)
         do k = 1, points%seats
            ! An empty seat is integrated with the others, always from zero, so that nothing can overflow.
            if (seats(k)%item == 0) moving(k, :) = 0.0_wp
            if (seats(k)%item == 0) cycle
            associate (seat => seats(k), i => seats(k)%item)
               call take_orbit(view, k, points%steps, points%record%middles, equations(members(i))%frequency, &
                               orbit)
               call seat%whole%add(orbit)
               seat%done = seat%done + 1
               if (present(halves)) call seat%half(merge(1, 2, 2*seat%done <= periods(i)))%add(orbit)
               seat%smallest = min(seat%smallest, points%smallest(k))
               seat%largest = max(seat%largest, points%largest(k))
               if (seat%done < periods(i)) cycle
               states(:, i) = moving(k, :)
               call seat%whole%finish(whole(i))
               whole(i)%contact = contact_of(seat%smallest, seat%largest, points%half_backlash)
               if (present(halves)) call seat%half(1)%finish(halves(1, i))
               if (present(halves)) call seat%half(2)%finish(halves(2, i))
               seat%item = 0
            end associate
         end do
         call visitor%attend()
      end do
   end subroutine measure_lanes

end module spurflex_measure_lane_motion
