!> Amplitude, rms and extremes of the motions in the lanes, period by period: what `spurflex_measure_motion` does with one motion,
!> all lanes at once. Only where a displacement turns between two samples is each lane looked at by itself.
module spurflex_measure_lane_amplitude
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_integrate_lane_rule, only: lanes
   use spurflex_integrate_period_map, only: observables
   use spurflex_measure_motion, only: motion_measure, see_turns, iy1, ix, iy
   implicit none
   private

   public :: lane_amplitude

   !> What extremes are looked for: y1 and the squares of both bearing deformations; their values, rates and accelerations.
   integer, parameter :: quantities = 3, orders = 3

   !> What has been seen of the motion in each lane, in each part of the time that it is measured.
   type :: lane_amplitude
      private
      !> y1, d_x1, d_y1, d_x2, d_y2 at the static equilibrium, shape (lanes, observables) [m].
      real(wp) :: static(lanes, observables) = 0.0_wp
      !> Mesh frequency, shape (lanes) [rad/s].
      real(wp) :: frequency(lanes) = 1.0_wp
      !> Extremes of y1, as deviations from the static equilibrium [m], and of the squares of the bearing deformations [m2], of
      !> which the smallest mean nothing, shape (lanes, quantities, parts).
      real(wp), allocatable :: low(:, :, :), high(:, :, :)
      !> Sums over the periods of the mean of y1 and of its square, as deviations, and the periods, shape (lanes, parts).
      real(wp), allocatable :: total(:, :), total_square(:, :)
      integer, allocatable :: periods(:, :)
      !> The quantities at the samples of a period, shape (lanes, orders, quantities, 0:steps).
      real(wp), allocatable :: sampled(:, :, :, :)
   contains
      !> Make room.
      procedure :: reserve
      !> Begin with a motion in a lane.
      procedure :: begin
      !> See one mesh period of all lanes.
      procedure :: add
      !> What has been seen of the motion in a lane.
      procedure :: measure_of
   end type lane_amplitude

contains

   !> Make room.
   pure subroutine reserve(self, parts, steps)
      !> Amplitudes.
      class(lane_amplitude), intent(inout) :: self
      !> Parts that are measured on their own.
      integer, intent(in) :: parts
      !> Steps per mesh period.
      integer, intent(in) :: steps

      allocate (self%low(lanes, quantities, parts), self%high(lanes, quantities, parts), self%total(lanes, parts), &
                self%total_square(lanes, parts), source=0.0_wp)
      allocate (self%periods(lanes, parts), source=0)
      allocate (self%sampled(lanes, orders, quantities, 0:steps), source=0.0_wp)
   end subroutine reserve

   !> Begin with a motion in a lane.
   pure subroutine begin(self, lane, static_observation, frequency)
      !> Amplitudes.
      class(lane_amplitude), intent(inout) :: self
      !> Lane.
      integer, intent(in) :: lane
      !> y1, d_x1, d_y1, d_x2, d_y2 at the static equilibrium, shape (observables) [m].
      real(wp), intent(in) :: static_observation(:)
      !> Mesh frequency [rad/s].
      real(wp), intent(in) :: frequency

      self%static(lane, :) = static_observation
      self%frequency(lane) = frequency
      self%low(lane, 1, :) = huge(1.0_wp)
      self%low(lane, 2:, :) = -huge(1.0_wp)
      self%high(lane, :, :) = -huge(1.0_wp)
      self%high(lane, 2:, :) = 0.0_wp
      self%total(lane, :) = 0.0_wp
      self%total_square(lane, :) = 0.0_wp
      self%periods(lane, :) = 0
   end subroutine begin

   !> See one mesh period of all lanes.
   pure subroutine add(self, seen, steps, part)
      !> Amplitudes.
      class(lane_amplitude), intent(inout) :: self
      !> Values, rates and accelerations of the displacements, shape (lanes, observables, orders, 0:).
      real(wp), intent(in), contiguous :: seen(:, :, :, 0:)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Part of each motion that the period is in; 0 where the lane is empty.
      integer, intent(in) :: part(lanes)

      real(wp), dimension(lanes) :: h, mean, mean_square
      real(wp), dimension(lanes, quantities) :: low, high
      integer :: l, q

      call set_quantities(self%static, steps, seen, self%sampled)
      call sum_up(steps, seen, mean, mean_square)
      do l = 1, lanes
         h(l) = 2.0_wp*pi/(self%frequency(l)*real(steps, wp))
         low(l, :) = self%low(l, :, max(part(l), 1))
         high(l, :) = self%high(l, :, max(part(l), 1))
      end do
      do q = 1, quantities
         call extremes(h, steps, self%sampled, q, part, low(:, q), high(:, q))
      end do
      do l = 1, lanes
         if (part(l) == 0) cycle
         self%low(l, 1, part(l)) = low(l, 1)
         self%high(l, :, part(l)) = high(l, :)
         self%total(l, part(l)) = self%total(l, part(l)) + mean(l)
         self%total_square(l, part(l)) = self%total_square(l, part(l)) + mean_square(l)
         self%periods(l, part(l)) = self%periods(l, part(l)) + 1
      end do
   end subroutine add

   !> The quantities whose extremes are looked for, at all samples.
   pure subroutine set_quantities(static, steps, seen, sampled)
      !> Displacements at the static equilibrium [m].
      real(wp), intent(in) :: static(lanes, observables)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Values, rates and accelerations of the displacements.
      real(wp), intent(in) :: seen(lanes, observables, orders, 0:steps)
      !> The same of the quantities.
      real(wp), intent(inout) :: sampled(lanes, orders, quantities, 0:steps)

      real(wp) :: x, y, vx, vy
      integer :: s, gear, l

      do s = 0, steps
         do l = 1, lanes
            sampled(l, 1, 1, s) = seen(l, iy1, 1, s)
            sampled(l, 2, 1, s) = seen(l, iy1, 2, s)
            sampled(l, 3, 1, s) = seen(l, iy1, 3, s)
         end do
         do gear = 1, 2
            do l = 1, lanes
               x = static(l, ix(gear)) + seen(l, ix(gear), 1, s)
               y = static(l, iy(gear)) + seen(l, iy(gear), 1, s)
               vx = seen(l, ix(gear), 2, s)
               vy = seen(l, iy(gear), 2, s)
               sampled(l, 1, 1 + gear, s) = x**2 + y**2
               sampled(l, 2, 1 + gear, s) = 2.0_wp*(x*vx + y*vy)
               sampled(l, 3, 1 + gear, s) = 2.0_wp*(vx**2 + x*seen(l, ix(gear), 3, s) + vy**2 + y*seen(l, iy(gear), 3, s))
            end do
         end do
      end do
   end subroutine set_quantities

   !> Means over the period of y1 and of its square, by the trapezoidal rule: exact beyond every order for a periodic motion that is
   !> smooth.
   pure subroutine sum_up(steps, seen, mean, mean_square)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Values, rates and accelerations of the displacements.
      real(wp), intent(in) :: seen(lanes, observables, orders, 0:steps)
      !> The means [m], [m2].
      real(wp), intent(out) :: mean(lanes), mean_square(lanes)

      real(wp) :: weight
      integer :: s, l

      mean = 0.0_wp
      mean_square = 0.0_wp
      do s = 0, steps
         weight = merge(0.5_wp, 1.0_wp, s == 0 .or. s == steps)/real(steps, wp)
         do l = 1, lanes
            mean(l) = mean(l) + weight*seen(l, iy1, 1, s)
            mean_square(l) = mean_square(l) + weight*seen(l, iy1, 1, s)**2
         end do
      end do
   end subroutine sum_up

   !> Extremes of a quantity over a period, between the samples too.
   pure subroutine extremes(h, steps, sampled, q, part, low, high)
      !> Length of a step [s].
      real(wp), intent(in) :: h(lanes)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Quantities at the samples.
      real(wp), intent(in) :: sampled(lanes, orders, quantities, 0:steps)
      !> Which of them.
      integer, intent(in) :: q
      !> Part of each motion; 0 where the lane is empty.
      integer, intent(in) :: part(lanes)
      !> Smallest and largest value so far, updated.
      real(wp), intent(inout) :: low(lanes), high(lanes)

      real(wp) :: room, beyond, comes_back
      integer(i8) :: turns(lanes), any_turns
      integer :: s, l

      do s = 0, steps
         do l = 1, lanes
            low(l) = min(low(l), sampled(l, 1, q, s))
            high(l) = max(high(l), sampled(l, 1, q, s))
         end do
      end do
      do s = 1, steps
         any_turns = 0_i8
         do l = 1, lanes
            ! It turns where the rate changes its sign, or comes back before it reaches zero.
            comes_back = max(sampled(l, 2, q, s - 1)*sampled(l, 3, q, s - 1), -sampled(l, 2, q, s)*sampled(l, 3, q, s))
            turns(l) = merge(1_i8, 0_i8, sampled(l, 2, q, s - 1)*sampled(l, 2, q, s) <= 0.0_wp)
            turns(l) = merge(1_i8, turns(l), comes_back < 0.0_wp)
            ! Only a turn that can reach beyond what has been seen is worth its place.
            room = h(l)*(max(abs(sampled(l, 2, q, s - 1)), abs(sampled(l, 2, q, s))) &
                         + h(l)*max(abs(sampled(l, 3, q, s - 1)), abs(sampled(l, 3, q, s))))
            beyond = max(max(sampled(l, 1, q, s - 1), sampled(l, 1, q, s)) + room - high(l), &
                         low(l) - (min(sampled(l, 1, q, s - 1), sampled(l, 1, q, s)) - room))
            turns(l) = merge(turns(l), 0_i8, beyond > 0.0_wp)
            any_turns = any_turns + turns(l)
         end do
         if (any_turns == 0_i8) cycle
         do l = 1, lanes
            if (turns(l) == 0_i8 .or. part(l) == 0) cycle
            call see_turns(h(l), [sampled(l, 1, q, s - 1), sampled(l, 1, q, s)], [sampled(l, 2, q, s - 1), sampled(l, 2, q, s)], &
                           [sampled(l, 3, q, s - 1), sampled(l, 3, q, s)], low(l), high(l))
         end do
      end do
   end subroutine extremes

   !> What has been seen of the motion in a lane, in some parts of the time together.
   pure function measure_of(self, lane, parts) result(measure)
      !> Amplitudes.
      class(lane_amplitude), intent(in) :: self
      !> Lane.
      integer, intent(in) :: lane
      !> The parts.
      integer, intent(in) :: parts(:)
      !> The measure of the motion.
      type(motion_measure) :: measure

      measure%static = self%static(lane, :)
      measure%smallest = minval(self%low(lane, 1, parts))
      measure%largest = maxval(self%high(lane, 1, parts))
      measure%largest_square = maxval(self%high(lane, 2:, parts), dim=2)
      measure%total = sum(self%total(lane, parts))
      measure%total_square = sum(self%total_square(lane, parts))
      measure%periods = sum(self%periods(lane, parts))
   end function measure_of

end module spurflex_measure_lane_amplitude
