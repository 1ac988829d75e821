!> Amplitude, rms and extremes of a steady motion, period by period.
!>
!> Extremes lie between the samples: each step is the polynomial of degree five that has the values, rates and
!> accelerations of both ends.
module spurflex_measure_motion
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_measure_response, only: response
   implicit none
   private

   public :: motion_measure, see_turns, iy1, ix, iy

   !> Where y1 and the components of both bearing deformations are among the displacements.
   integer, parameter :: iy1 = 1
   integer, parameter :: ix(2) = [2, 4], iy(2) = [3, 5]

   !> What has been seen of one motion.
   type :: motion_measure
      !> y1, d_x1, d_y1, d_x2, d_y2 at the static equilibrium [m].
      real(wp) :: static(5) = 0.0_wp
      !> Extremes of y1, as deviations from the static equilibrium [m].
      real(wp) :: smallest = huge(1.0_wp), largest = -huge(1.0_wp)
      !> Sums over the periods of the mean of y1 and of its square, as deviations.
      real(wp) :: total = 0.0_wp, total_square = 0.0_wp
      integer :: periods = 0
      !> Largest square of each bearing deformation [m2].
      real(wp) :: largest_square(2) = 0.0_wp
   contains
      !> Begin with a motion.
      procedure :: reset
      !> See one mesh period.
      procedure :: add
      !> Write what was found into a response.
      procedure :: finish
   end type motion_measure

contains

   !> Begin with a motion.
   pure subroutine reset(self, static_observation)
      !> Measure.
      class(motion_measure), intent(inout) :: self
      !> y1, d_x1, d_y1, d_x2, d_y2 at the static equilibrium, shape (5) [m].
      real(wp), intent(in) :: static_observation(:)

      self%static = static_observation
      self%smallest = huge(1.0_wp)
      self%largest = -huge(1.0_wp)
      self%total = 0.0_wp
      self%total_square = 0.0_wp
      self%periods = 0
      self%largest_square = 0.0_wp
   end subroutine reset

   !> See one mesh period.
   pure subroutine add(self, orbit)
      !> Measure.
      class(motion_measure), intent(inout) :: self
      !> The period.
      type(orbit_type), intent(in) :: orbit

      real(wp), dimension(0:orbit%samples) :: square, rate, acceleration
      real(wp) :: ignored, x, y
      integer :: gear, last, s

      last = orbit%samples
      call extremes(orbit%time(:last), orbit%value(iy1, :last), orbit%rate(iy1, :last), orbit%acceleration(iy1, :last), &
                    self%smallest, self%largest)
      self%total = self%total + sum(orbit%weight(:last)*orbit%value(iy1, :last))
      self%total_square = self%total_square + sum(orbit%weight(:last)*orbit%value(iy1, :last)**2)
      self%periods = self%periods + 1
      do gear = 1, 2
         do s = 0, last
            x = self%static(ix(gear)) + orbit%value(ix(gear), s)
            y = self%static(iy(gear)) + orbit%value(iy(gear), s)
            associate (vx => orbit%rate(ix(gear), s), ax => orbit%acceleration(ix(gear), s), &
                       vy => orbit%rate(iy(gear), s), ay => orbit%acceleration(iy(gear), s))
               square(s) = x**2 + y**2
               rate(s) = 2.0_wp*(x*vx + y*vy)
               acceleration(s) = 2.0_wp*(vx**2 + x*ax + vy**2 + y*ay)
            end associate
         end do
         ! Nobody asks for the smallest.
         ignored = -huge(1.0_wp)
         call extremes(orbit%time(:last), square, rate, acceleration, ignored, self%largest_square(gear))
      end do
   end subroutine add

   !> Extremes of a sampled quantity whose rates and accelerations are known.
   pure subroutine extremes(time, value, rate, acceleration, low, high)
      !> Times of the samples, shape (n) [s].
      real(wp), intent(in) :: time(:)
      !> Values, rates and accelerations, shape (n).
      real(wp), intent(in) :: value(:), rate(:), acceleration(:)
      !> Smallest and largest value so far, updated.
      real(wp), intent(inout) :: low, high

      real(wp) :: h, room
      integer :: s

      low = min(low, minval(value))
      high = max(high, maxval(value))
      do s = 2, size(time)
         h = time(s) - time(s - 1)
         if (h <= 0.0_wp) cycle
         ! No turn, unless the rate comes back before it reaches zero.
         if (rate(s - 1)*rate(s) > 0.0_wp) then
            if (rate(s - 1)*acceleration(s - 1) >= 0.0_wp .or. rate(s)*acceleration(s) <= 0.0_wp) cycle
         end if
         ! Only a turn that can reach beyond what has been seen is worth its place.
         room = h*(max(abs(rate(s - 1)), abs(rate(s))) + h*max(abs(acceleration(s - 1)), abs(acceleration(s))))
         if (max(value(s - 1), value(s)) + room <= high .and. min(value(s - 1), value(s)) - room >= low) cycle
         call see_turns(h, [value(s - 1), value(s)], [rate(s - 1), rate(s)], [acceleration(s - 1), acceleration(s)], low, high)
      end do
   end subroutine extremes

   !> See the values where the polynomial of degree five through both ends of a step turns.
   pure subroutine see_turns(h, value, rate, acceleration, low, high)
      !> Length of the step [s].
      real(wp), intent(in) :: h
      !> Values, rates and accelerations at both ends.
      real(wp), intent(in) :: value(2), rate(2), acceleration(2)
      !> Smallest and largest value so far, updated.
      real(wp), intent(inout) :: low, high

      real(wp) :: c(0:5), slope(0:4), bend(0:3), rest(3), u, turn

      c(0) = value(1)
      c(1) = h*rate(1)
      c(2) = 0.5_wp*h**2*acceleration(1)
      rest = [value(2) - c(0) - c(1) - c(2), h*rate(2) - c(1) - 2.0_wp*c(2), h**2*acceleration(2) - 2.0_wp*c(2)]
      c(3) = 10.0_wp*rest(1) - 4.0_wp*rest(2) + 0.5_wp*rest(3)
      c(4) = -15.0_wp*rest(1) + 7.0_wp*rest(2) - rest(3)
      c(5) = 6.0_wp*rest(1) - 3.0_wp*rest(2) + 0.5_wp*rest(3)
      slope = [c(1), 2.0_wp*c(2), 3.0_wp*c(3), 4.0_wp*c(4), 5.0_wp*c(5)]
      if (rate(1)*rate(2) <= 0.0_wp) then
         turn = polynomial(c, zero(slope, 0.0_wp, 1.0_wp))
         low = min(low, turn)
         high = max(high, turn)
         return
      end if
      bend = [slope(1), 2.0_wp*slope(2), 3.0_wp*slope(3), 4.0_wp*slope(4)]
      u = zero(bend, 0.0_wp, 1.0_wp)
      if (polynomial(slope, u)*rate(1) >= 0.0_wp) return
      turn = polynomial(c, zero(slope, 0.0_wp, u))
      low = min(low, turn)
      high = max(high, turn)
      turn = polynomial(c, zero(slope, u, 1.0_wp))
      low = min(low, turn)
      high = max(high, turn)
   end subroutine see_turns

   !> A zero of a polynomial between two places where it differs in sign.
   pure function zero(c, from, until) result(u)
      !> Its coefficients, constant first.
      real(wp), intent(in) :: c(0:)
      !> The places.
      real(wp), intent(in) :: from, until
      !> The zero.
      real(wp) :: u

      !> What turns there is off by the square of what the place is off.
      real(wp), parameter :: near_enough = 1.0e-9_wp
      integer, parameter :: most_iterations = 40
      real(wp) :: low, high, at_low, at_high, value, slope, better
      integer :: k, i

      low = from
      high = until
      at_low = polynomial(c, low)
      at_high = polynomial(c, high)
      u = low
      if (abs(at_low - at_high) > 0.0_wp) u = low + (high - low)*min(max(at_low/(at_low - at_high), 0.0_wp), 1.0_wp)
      ! Newton's method, kept between the places where the sign is known to differ.
      do k = 1, most_iterations
         value = c(ubound(c, 1))
         slope = 0.0_wp
         do i = ubound(c, 1) - 1, 0, -1
            slope = slope*u + value
            value = value*u + c(i)
         end do
         if (value*at_low > 0.0_wp) then
            low = u
         else
            high = u
         end if
         better = 0.5_wp*(low + high)
         if (abs(value) < abs(slope)) then
            if (u - value/slope > low .and. u - value/slope < high) better = u - value/slope
         end if
         if (abs(better - u) <= near_enough) exit
         u = better
      end do
      u = better
   end function zero

   !> A polynomial at a place.
   pure function polynomial(c, u) result(value)
      !> Its coefficients, constant first.
      real(wp), intent(in) :: c(0:)
      !> The place.
      real(wp), intent(in) :: u
      !> Its value there.
      real(wp) :: value

      integer :: i

      value = c(ubound(c, 1))
      do i = ubound(c, 1) - 1, 0, -1
         value = value*u + c(i)
      end do
   end function polynomial

   !> Write what was found into a response.
   pure subroutine finish(self, answer)
      !> Measure.
      class(motion_measure), intent(in) :: self
      !> Response whose displacements are filled in.
      type(response), intent(inout) :: answer

      real(wp) :: mean

      mean = self%total/real(self%periods, wp)
      answer%y1_amplitude = 0.5_wp*(self%largest - self%smallest)
      answer%y1_rms = sqrt(max(self%total_square/real(self%periods, wp) - mean**2, 0.0_wp))
      answer%y1_max = self%static(iy1) + self%largest
      answer%y1_min = self%static(iy1) + self%smallest
      answer%bearing_deformation_max = sqrt(self%largest_square)
   end subroutine finish

end module spurflex_measure_motion
