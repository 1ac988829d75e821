!> Motions measured in the lanes, a motion in each seat.
module spurflex_measure_lane_motion
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_ensemble, only: lane_ensemble
   use spurflex_integrate_lane_observe, only: point_view, lane_view, seat_view, observe
   use spurflex_measure_lane_amplitude, only: lane_amplitude
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: response, contact_of
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: measure_lanes, quarter_of, parts, begin_of_window, first_half, second_half

   !> Parts of a window that are measured on their own.
   integer, parameter :: begin_of_window = 1, first_half = 2, second_half = 3, parts = 3

   !> What is being measured in one seat.
   type :: measured_seat
      !> Which of the motions; 0 in an empty seat.
      integer :: item = 0
      !> Mesh periods done.
      integer :: done = 0
      !> Extremes of the mesh deflection [m].
      real(wp) :: smallest = huge(1.0_wp), largest = -huge(1.0_wp)
   end type measured_seat

contains

   !> Measure motions over some mesh periods. A seat that becomes free is taken by the next at once.
   subroutine measure_lanes(points, equations, views, part, view, members, periods, visitor, states, whole, of_parts)
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
      !> Displacements over the first quarter, the first and the second half, shape (parts, n).
      type(response), intent(inout), optional :: of_parts(:, :)

      type(measured_seat) :: seats(points%seats)
      !> The first and the second quarter and the second half, or the whole as the first part.
      type(lane_amplitude) :: amplitude
      type(motion_measure) :: measure
      real(wp) :: moving(points%seats, points%size)
      integer :: part_of(points%seats), next, k

      call amplitude%reserve(parts, points%steps)
      moving = 0.0_wp
      next = 1
      do
         do k = 1, points%seats
            if (seats(k)%item > 0 .or. next > size(members)) cycle
            seats(k) = measured_seat(item=next)
            call amplitude%begin(k, equations(members(next))%static_observation, equations(members(next))%frequency)
            call points%seat(k, members(next))
            call seat_view(view, k, views(part(members(next))))
            moving(k, :) = states(:, next)
            next = next + 1
         end do
         if (all(seats%item == 0)) exit
         call points%advance_recorded(moving)
         call observe(view, points%size/2, points%record, points%steps)
         do k = 1, points%seats
            part_of(k) = 0
            if (seats(k)%item == 0) cycle
            seats(k)%done = seats(k)%done + 1
            part_of(k) = begin_of_window
            if (present(of_parts)) part_of(k) = 1 + count(seats(k)%done > [quarter_of(periods(seats(k)%item)), &
                                                                           periods(seats(k)%item)/2])
         end do
         call amplitude%add(view%seen, points%steps, part_of)
         do k = 1, points%seats
            ! An empty seat is integrated with the others, always from zero, so that nothing can overflow.
            if (seats(k)%item == 0) moving(k, :) = 0.0_wp
            if (seats(k)%item == 0) cycle
            associate (seat => seats(k), i => seats(k)%item)
               seat%smallest = min(seat%smallest, points%smallest(k))
               seat%largest = max(seat%largest, points%largest(k))
               if (seat%done < periods(i)) cycle
               states(:, i) = moving(k, :)
               if (present(of_parts)) then
                  measure = amplitude%measure_of(k, [1])
                  call measure%finish(of_parts(begin_of_window, i))
                  measure = amplitude%measure_of(k, [1, 2])
                  call measure%finish(of_parts(first_half, i))
                  measure = amplitude%measure_of(k, [3])
                  call measure%finish(of_parts(second_half, i))
               end if
               measure = amplitude%measure_of(k, [1, 2, 3])
               call measure%finish(whole(i))
               whole(i)%contact = contact_of(seat%smallest, seat%largest, points%half_backlash)
               seat%item = 0
            end associate
         end do
         call visitor%attend()
      end do
   end subroutine measure_lanes

   !> Mesh periods of the first quarter of a window.
   elemental function quarter_of(periods) result(quarter)
      !> Mesh periods of the window, two at least.
      integer, intent(in) :: periods
      !> One at least.
      integer :: quarter

      quarter = max(periods/4, 1)
   end function quarter_of

end module spurflex_measure_lane_motion
