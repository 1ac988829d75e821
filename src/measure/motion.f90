!> Amplitude, rms and extremes of a steady motion, period by period.
!>
!> Extremes lie between the samples: each step is a cubic through both ends with their slopes, whose extremes are known.
module spurflex_measure_motion
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lanes, only: trajectory_type
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
      !> Mesh period [s].
      real(wp) :: period = 1.0_wp
      !> Extremes of y1, as deviations from the static equilibrium [m].
      real(wp) :: smallest = 0.0_wp, largest = 0.0_wp
      !> Sums of y1 and of its square, as deviations, and how many samples they hold.
      real(wp) :: total = 0.0_wp, total_square = 0.0_wp
      integer :: samples = 0
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
   pure subroutine reset(self, static_observation, period)
      !> Measure.
      class(motion_measure), intent(inout) :: self
      !> y1, d_x1, d_y1, d_x2, d_y2 at the static equilibrium, shape (5) [m].
      real(wp), intent(in) :: static_observation(:)
      !> Mesh period [s].
      real(wp), intent(in) :: period

      self%static = static_observation
      self%period = period
      self%smallest = huge(1.0_wp)
      self%largest = -huge(1.0_wp)
      self%total = 0.0_wp
      self%total_square = 0.0_wp
      self%samples = 0
      self%largest_square = 0.0_wp
   end subroutine reset

   !> See one mesh period of a lane.
   pure subroutine add(self, trajectory, lane)
      !> Measure.
      class(motion_measure), intent(inout) :: self
      !> One period of every lane.
      type(trajectory_type), intent(in) :: trajectory
      !> The lane.
      integer, intent(in) :: lane

      real(wp) :: h, low, high, value(2), slope(2), x(2), y(2), vx(2), vy(2)
      integer :: s, gear, last

      last = ubound(trajectory%value, 3)
      h = self%period/real(last, wp)
      do s = 1, last
         value = trajectory%value(lane, iy1, s - 1:s)
         slope = trajectory%rate(lane, iy1, s - 1:s)
         call cubic_extremes(value, slope, h, low, high)
         self%smallest = min(self%smallest, low)
         self%largest = max(self%largest, high)
         self%total = self%total + value(2)
         self%total_square = self%total_square + value(2)**2
         do gear = 1, 2
            x = self%static(ix(gear)) + trajectory%value(lane, ix(gear), s - 1:s)
            y = self%static(iy(gear)) + trajectory%value(lane, iy(gear), s - 1:s)
            vx = trajectory%rate(lane, ix(gear), s - 1:s)
            vy = trajectory%rate(lane, iy(gear), s - 1:s)
            call cubic_extremes(x*x + y*y, 2.0_wp*(x*vx + y*vy), h, low, high)
            self%largest_square(gear) = max(self%largest_square(gear), high)
         end do
      end do
      self%samples = self%samples + last
   end subroutine add

   !> Extremes over one step of the cubic through both ends with their slopes.
   pure subroutine cubic_extremes(value, slope, h, low, high)
      !> Values at both ends.
      real(wp), intent(in) :: value(2)
      !> Slopes at both ends.
      real(wp), intent(in) :: slope(2)
      !> Length of the step.
      real(wp), intent(in) :: h
      !> Smallest and largest value on the step.
      real(wp), intent(out) :: low, high

      real(wp) :: a, b, c, root, t, inner
      integer :: sign_of_root

      low = minval(value)
      high = maxval(value)
      if (slope(1)*slope(2) >= 0.0_wp) return
      ! value(1) + c t + b t^2 + a t^3 with t from 0 to 1; its derivative changes sign exactly once inside.
      c = h*slope(1)
      a = 2.0_wp*(value(1) - value(2)) + c + h*slope(2)
      b = value(2) - value(1) - c - a
      root = sqrt(max(b*b - 3.0_wp*a*c, 0.0_wp))
      do sign_of_root = -1, 1, 2
         inner = b + real(sign_of_root, wp)*root
         if (abs(inner) <= tiny(1.0_wp)) cycle
         t = -c/inner
         if (t <= 0.0_wp .or. t >= 1.0_wp) cycle
         inner = value(1) + t*(c + t*(b + t*a))
         low = min(low, inner)
         high = max(high, inner)
      end do
   end subroutine cubic_extremes

   !> Write what was found into a response.
   pure subroutine finish(self, answer)
      !> Measure.
      class(motion_measure), intent(in) :: self
      !> Response whose displacements are filled in.
      type(response), intent(inout) :: answer

      real(wp) :: mean

      mean = self%total/real(self%samples, wp)
      answer%y1_amplitude = 0.5_wp*(self%largest - self%smallest)
      answer%y1_rms = sqrt(max(self%total_square/real(self%samples, wp) - mean**2, 0.0_wp))
      answer%y1_max = self%static(iy1) + self%largest
      answer%y1_min = self%static(iy1) + self%smallest
      answer%bearing_deformation_max = sqrt(self%largest_square)
   end subroutine finish

end module spurflex_measure_motion
