!> Tangents of several points carried over a mesh period, a point in each lane of the processor's vectors or, where few points have
!> any, a tangent.
module spurflex_integrate_lane_tangents
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_rule, only: lanes, most_modes, points, lane_rule, copy_rule, lane_gain
   implicit none
   private

   public :: carry_lane_tangents

   !> Lanes with a full set of tangents up to which each is carried by itself: it takes about a fifth of the time of all lanes.
   integer, parameter :: few_lanes = 4

contains

   !> Carry tangents of every lane over the period whose derivatives were taken.
   pure subroutine carry_lane_tangents(rule, steps, gain, number, tangents, rounds)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Derivatives.
      type(lane_gain), intent(in) :: gain
      !> Number of tangents.
      integer, intent(in) :: number
      !> The tangents, shape (lanes, number, 2 modes).
      real(wp), intent(inout) :: tangents(lanes, number, 2*rule%modes)
      !> How often all lanes went over the period.
      integer, intent(out) :: rounds

      type(lane_rule) :: r
      real(wp) :: largest(lanes)
      integer :: c, l, m

      m = rule%modes
      rounds = number
      if (number == 2*m) then
         largest = largest_of(tangents)
         if (count(largest > 0.0_wp) <= few_lanes) then
            rounds = 2*count(largest > 0.0_wp)*((m + lanes - 1)/lanes)
            do l = 1, lanes
               if (largest(l) > 0.0_wp) call carry_lone(rule, l, steps, gain, tangents(l, :, :))
            end do
            return
         end if
      end if
      call copy_rule(rule, r)
      ! A full set goes in pairs of the real and the imaginary part of a mode: which tangents go together does not depend on how
      ! many modes there is room for.
      if (number == 2*m) then
         do c = 1, m
            call carry_two(r, steps, gain%n, tangents(:, c, :m), tangents(:, c, m + 1:), tangents(:, m + c, :m), &
                           tangents(:, m + c, m + 1:))
         end do
      else
         do c = 1, number
            call carry_one(r, steps, gain%n, tangents(:, c, :m), tangents(:, c, m + 1:))
         end do
      end if
   end subroutine carry_lane_tangents

   !> Largest component of the tangents of each lane; zero where there are none.
   pure function largest_of(tangents) result(largest)
      !> Tangents, shape (lanes, count, 2 modes).
      real(wp), intent(in) :: tangents(:, :, :)
      !> Its modulus, shape (lanes).
      real(wp) :: largest(lanes)

      integer :: c, j, l

      largest = 0.0_wp
      do j = 1, size(tangents, 3)
         do c = 1, size(tangents, 2)
            do l = 1, lanes
               largest(l) = max(largest(l), abs(tangents(l, c, j)))
            end do
         end do
      end do
   end function largest_of

   !> Carry a full set of tangents of one lane, a tangent in each lane.
   pure subroutine carry_lone(rule, lane, steps, gain, tangents)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The lane.
      integer, intent(in) :: lane
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Derivatives.
      type(lane_gain), intent(in) :: gain
      !> The tangents, shape (2 modes, 2 modes).
      real(wp), intent(inout) :: tangents(:, :)

      type(lane_rule) :: r
      real(wp) :: own(lanes, points, points, steps), first(lanes, 2*rule%modes), second(lanes, 2*rule%modes)
      integer :: m, c, n

      m = rule%modes
      r%modes = m
      r%half_re(:, :m) = spread(rule%half_re(lane, :m), 1, lanes)
      r%half_im(:, :m) = spread(rule%half_im(lane, :m), 1, lanes)
      r%full_re(:, :m) = spread(rule%full_re(lane, :m), 1, lanes)
      r%full_im(:, :m) = spread(rule%full_im(lane, :m), 1, lanes)
      r%taken_re(:, :m, :) = spread(rule%taken_re(lane, :m, :), 1, lanes)
      r%taken_im(:, :m, :) = spread(rule%taken_im(lane, :m, :), 1, lanes)
      r%end = spread(rule%end(lane, :), 1, lanes)
      own = spread(gain%n(lane, :, :, :steps), 1, lanes)
      do c = 1, m, lanes
         n = min(lanes, m - c + 1)
         first = 0.0_wp
         second = 0.0_wp
         first(:n, :) = tangents(c:c + n - 1, :)
         second(:n, :) = tangents(m + c:m + c + n - 1, :)
         call carry_two(r, steps, own, first(:, :m), first(:, m + 1:), second(:, :m), second(:, m + 1:))
         tangents(c:c + n - 1, :) = first(:n, :)
         tangents(m + c:m + c + n - 1, :) = second(:n, :)
      end do
   end subroutine carry_lone

   !> Carry two tangents: they read the coefficients together.
   pure subroutine carry_two(r, steps, gain, first_re, first_im, second_re, second_im)
      !> Coefficients.
      type(lane_rule), intent(in) :: r
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Derivatives, as in `lane_gain`.
      real(wp), intent(in), contiguous :: gain(:, :, :, :)
      !> The tangents, shape (lanes, modes).
      real(wp), intent(inout) :: first_re(:, :), first_im(:, :), second_re(:, :), second_im(:, :)

      real(wp), dimension(lanes, most_modes) :: re_a, im_a, re_b, im_b, carried_re_a, carried_im_a, carried_re_b, carried_im_b
      real(wp), dimension(lanes) :: x_a, x_b, middle_a, middle_b, end_a, end_b, a1, a2, a3, b1, b2, b3
      integer :: s, j, l

      re_a(:, :r%modes) = first_re
      im_a(:, :r%modes) = first_im
      re_b(:, :r%modes) = second_re
      im_b(:, :r%modes) = second_im
      x_a = 0.0_wp
      x_b = 0.0_wp
      do j = 1, r%modes
         do l = 1, lanes
            x_a(l) = x_a(l) + re_a(l, j)
            x_b(l) = x_b(l) + re_b(l, j)
         end do
      end do
      do s = 1, steps
         do l = 1, lanes
            middle_a(l) = 0.0_wp
            middle_b(l) = 0.0_wp
            end_a(l) = 0.0_wp
            end_b(l) = 0.0_wp
         end do
         do j = 1, r%modes
            do l = 1, lanes
               middle_a(l) = middle_a(l) + r%half_re(l, j)*re_a(l, j) - r%half_im(l, j)*im_a(l, j)
               middle_b(l) = middle_b(l) + r%half_re(l, j)*re_b(l, j) - r%half_im(l, j)*im_b(l, j)
               carried_re_a(l, j) = r%full_re(l, j)*re_a(l, j) - r%full_im(l, j)*im_a(l, j)
               carried_re_b(l, j) = r%full_re(l, j)*re_b(l, j) - r%full_im(l, j)*im_b(l, j)
               carried_im_a(l, j) = r%full_re(l, j)*im_a(l, j) + r%full_im(l, j)*re_a(l, j)
               carried_im_b(l, j) = r%full_re(l, j)*im_b(l, j) + r%full_im(l, j)*re_b(l, j)
               end_a(l) = end_a(l) + carried_re_a(l, j)
               end_b(l) = end_b(l) + carried_re_b(l, j)
            end do
         end do
         do l = 1, lanes
            a1(l) = gain(l, 1, 1, s)*x_a(l) + gain(l, 1, 2, s)*middle_a(l) + gain(l, 1, 3, s)*end_a(l)
            a2(l) = gain(l, 2, 1, s)*x_a(l) + gain(l, 2, 2, s)*middle_a(l) + gain(l, 2, 3, s)*end_a(l)
            a3(l) = gain(l, 3, 1, s)*x_a(l) + gain(l, 3, 2, s)*middle_a(l) + gain(l, 3, 3, s)*end_a(l)
            x_a(l) = end_a(l) - r%end(l, 1)*a1(l) - r%end(l, 2)*a2(l) - r%end(l, 3)*a3(l)
            b1(l) = gain(l, 1, 1, s)*x_b(l) + gain(l, 1, 2, s)*middle_b(l) + gain(l, 1, 3, s)*end_b(l)
            b2(l) = gain(l, 2, 1, s)*x_b(l) + gain(l, 2, 2, s)*middle_b(l) + gain(l, 2, 3, s)*end_b(l)
            b3(l) = gain(l, 3, 1, s)*x_b(l) + gain(l, 3, 2, s)*middle_b(l) + gain(l, 3, 3, s)*end_b(l)
            x_b(l) = end_b(l) - r%end(l, 1)*b1(l) - r%end(l, 2)*b2(l) - r%end(l, 3)*b3(l)
         end do
         do j = 1, r%modes
            do l = 1, lanes
               re_a(l, j) = carried_re_a(l, j) - r%taken_re(l, j, 1)*a1(l) - r%taken_re(l, j, 2)*a2(l) - r%taken_re(l, j, 3)*a3(l)
               re_b(l, j) = carried_re_b(l, j) - r%taken_re(l, j, 1)*b1(l) - r%taken_re(l, j, 2)*b2(l) - r%taken_re(l, j, 3)*b3(l)
               im_a(l, j) = carried_im_a(l, j) - r%taken_im(l, j, 1)*a1(l) - r%taken_im(l, j, 2)*a2(l) - r%taken_im(l, j, 3)*a3(l)
               im_b(l, j) = carried_im_b(l, j) - r%taken_im(l, j, 1)*b1(l) - r%taken_im(l, j, 2)*b2(l) - r%taken_im(l, j, 3)*b3(l)
            end do
         end do
      end do
      first_re = re_a(:, :r%modes)
      first_im = im_a(:, :r%modes)
      second_re = re_b(:, :r%modes)
      second_im = im_b(:, :r%modes)
   end subroutine carry_two

   !> Carry one tangent.
   pure subroutine carry_one(r, steps, gain, tangent_re, tangent_im)
      !> Coefficients.
      type(lane_rule), intent(in) :: r
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Derivatives, as in `lane_gain`.
      real(wp), intent(in), contiguous :: gain(:, :, :, :)
      !> The tangent, shape (lanes, modes).
      real(wp), intent(inout) :: tangent_re(:, :), tangent_im(:, :)

      real(wp), dimension(lanes, most_modes) :: re, im, carried_re, carried_im
      real(wp), dimension(lanes) :: x, middle, end, n1, n2, n3
      integer :: s, j, l

      re(:, :r%modes) = tangent_re
      im(:, :r%modes) = tangent_im
      x = 0.0_wp
      do j = 1, r%modes
         do l = 1, lanes
            x(l) = x(l) + re(l, j)
         end do
      end do
      do s = 1, steps
         do l = 1, lanes
            middle(l) = 0.0_wp
            end(l) = 0.0_wp
         end do
         do j = 1, r%modes
            do l = 1, lanes
               middle(l) = middle(l) + r%half_re(l, j)*re(l, j) - r%half_im(l, j)*im(l, j)
               carried_re(l, j) = r%full_re(l, j)*re(l, j) - r%full_im(l, j)*im(l, j)
               carried_im(l, j) = r%full_re(l, j)*im(l, j) + r%full_im(l, j)*re(l, j)
               end(l) = end(l) + carried_re(l, j)
            end do
         end do
         do l = 1, lanes
            n1(l) = gain(l, 1, 1, s)*x(l) + gain(l, 1, 2, s)*middle(l) + gain(l, 1, 3, s)*end(l)
            n2(l) = gain(l, 2, 1, s)*x(l) + gain(l, 2, 2, s)*middle(l) + gain(l, 2, 3, s)*end(l)
            n3(l) = gain(l, 3, 1, s)*x(l) + gain(l, 3, 2, s)*middle(l) + gain(l, 3, 3, s)*end(l)
            x(l) = end(l) - r%end(l, 1)*n1(l) - r%end(l, 2)*n2(l) - r%end(l, 3)*n3(l)
         end do
         do j = 1, r%modes
            do l = 1, lanes
               re(l, j) = carried_re(l, j) - r%taken_re(l, j, 1)*n1(l) - r%taken_re(l, j, 2)*n2(l) - r%taken_re(l, j, 3)*n3(l)
               im(l, j) = carried_im(l, j) - r%taken_im(l, j, 1)*n1(l) - r%taken_im(l, j, 2)*n2(l) - r%taken_im(l, j, 3)*n3(l)
            end do
         end do
      end do
      tangent_re = re(:, :r%modes)
      tangent_im = im(:, :r%modes)
   end subroutine carry_one

end module spurflex_integrate_lane_tangents
