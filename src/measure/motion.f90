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

   public :: motion_measure

   integer, parameter :: iy1 = 1
   integer, parameter :: ix(2) = [2, 4], iy(2) = [3, 5]

   !> What has been seen of one motion.
   type :: motion_measure
      private
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

      real(wp) :: square(0:orbit%samples), rate(0:orbit%samples), acceleration(0:orbit%samples)
      real(wp) :: ignored
      integer :: gear, last

      last = orbit%samples
      call extremes(orbit%time(:last), orbit%value(iy1, :last), orbit%rate(iy1, :last), orbit%acceleration(iy1, :last), &
                    self%smallest, self%largest)
      self%total = self%total + sum(orbit%weight(:last)*orbit%value(iy1, :last))
      self%total_square = self%total_square + sum(orbit%weight(:last)*orbit%value(iy1, :last)**2)
      self%periods = self%periods + 1
      do gear = 1, 2
         associate (x => self%static(ix(gear)) + orbit%value(ix(gear), :last), vx => orbit%rate(ix(gear), :last), &
                    ax => orbit%acceleration(ix(gear), :last), y => self%static(iy(gear)) + orbit%value(iy(gear), :last), &
                    vy => orbit%rate(iy(gear), :last), ay => orbit%acceleration(iy(gear), :last))
            square = x**2 + y**2
            rate = 2.0_wp*(x*vx + y*vy)
            acceleration = 2.0_wp*(vx**2 + x*ax + vy**2 + y*ay)
         end associate
         ignored = huge(1.0_wp)
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

      real(wp) :: turns(size(value))
      integer :: s, found

      found = 0
      do s = 2, size(time)
         if (rate(s - 1)*rate(s) >= 0.0_wp .or. time(s) <= time(s - 1)) cycle
         found = found + 1
         turns(found) = turning_value(time(s) - time(s - 1), value(s - 1:s), rate(s - 1:s), acceleration(s - 1:s))
      end do
      low = min(low, minval(value), minval(turns(:found)))
      high = max(high, maxval(value), maxval(turns(:found)))
   end subroutine extremes

   !> Value where the polynomial of degree five through both ends of a step turns.
   pure function turning_value(h, value, rate, acceleration) result(turn)
      !> Length of the step [s].
      real(wp), intent(in) :: h
      !> Values, rates and accelerations at both ends; the rates differ in sign.
      real(wp), intent(in) :: value(2), rate(2), acceleration(2)
      !> The extreme.
      real(wp) :: turn

      integer, parameter :: bisections = 40
      real(wp) :: c(0:5), low, high, u, slope, rest(3)
      integer :: k

      c(0) = value(1)
      c(1) = h*rate(1)
      c(2) = 0.5_wp*h**2*acceleration(1)
      rest = [value(2) - c(0) - c(1) - c(2), h*rate(2) - c(1) - 2.0_wp*c(2), h**2*acceleration(2) - 2.0_wp*c(2)]
      c(3) = 10.0_wp*rest(1) - 4.0_wp*rest(2) + 0.5_wp*rest(3)
      c(4) = -15.0_wp*rest(1) + 7.0_wp*rest(2) - rest(3)
      c(5) = 6.0_wp*rest(1) - 3.0_wp*rest(2) + 0.5_wp*rest(3)
      low = 0.0_wp
      high = 1.0_wp
      do k = 1, bisections
         u = 0.5_wp*(low + high)
         slope = c(1) + u*(2.0_wp*c(2) + u*(3.0_wp*c(3) + u*(4.0_wp*c(4) + u*5.0_wp*c(5))))
         if (slope*rate(1) > 0.0_wp) then
            low = u
         else
            high = u
         end if
      end do
      turn = c(0) + u*(c(1) + u*(c(2) + u*(c(3) + u*(c(4) + u*c(5)))))
   end function turning_value

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
