!> Several points of the grid advanced at once, a point in each lane of the processor's vectors.
module spurflex_integrate_lane_step
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_contact, only: set_law, solve, find_margin, set_gain, force_at, nothing_added
   use spurflex_integrate_lane_crossing, only: correct
   use spurflex_integrate_lane_rule, only: lanes, most_modes, points, lane_rule, mesh_cycle, lane_gain, lane_record
   implicit none
   private

   public :: advance_lanes, carry_lane_tangents

contains

   !> Advance every lane by one mesh period.
   subroutine advance_lanes(rule, pitch, states, smallest, largest, gain, record)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Real parts of the modes, then imaginary parts, shape (lanes, 2 modes).
      real(wp), intent(inout) :: states(lanes, 2*rule%modes)
      !> Extremes of the mesh deflection [m].
      real(wp), intent(out) :: smallest(lanes), largest(lanes)
      !> If present, the derivatives for the tangents.
      type(lane_gain), intent(inout), optional :: gain
      !> If present, the period is recorded.
      type(lane_record), intent(inout), optional :: record

      real(wp), dimension(lanes, most_modes) :: re, im, carried_re, carried_im
      real(wp), dimension(lanes, points) :: x, n, slope, rest
      real(wp), dimension(lanes, points, points) :: added_slope
      real(wp), dimension(lanes) :: free_middle, free_end, side, margin
      real(wp) :: first, second
      type(lane_rule) :: r
      integer :: s, l, j
      logical :: crosses

      call copy_rule(rule, r)
      re(:, :r%modes) = states(:, :r%modes)
      im(:, :r%modes) = states(:, r%modes + 1:)
      smallest = huge(1.0_wp)
      largest = -huge(1.0_wp)
      x(:, 3) = 0.0_wp
      do j = 1, r%modes
         do l = 1, lanes
            x(l, 3) = x(l, 3) + re(l, j)
         end do
      end do
      do s = 1, pitch%steps
         do l = 1, lanes
            x(l, 1) = x(l, 3)
            free_middle(l) = 0.0_wp
            free_end(l) = 0.0_wp
         end do
         do j = 1, r%modes
            do l = 1, lanes
               free_middle(l) = free_middle(l) + r%half_re(l, j)*re(l, j) - r%half_im(l, j)*im(l, j)
               carried_re(l, j) = r%full_re(l, j)*re(l, j) - r%full_im(l, j)*im(l, j)
               carried_im(l, j) = r%full_re(l, j)*im(l, j) + r%full_im(l, j)*re(l, j)
               free_end(l) = free_end(l) + carried_re(l, j)
            end do
         end do
         call set_law(r, pitch, 2*s - 2, x(:, 1), side, slope, rest)
         call solve(r, free_middle, free_end, slope, rest, x, n)
         call find_margin(r, pitch, 2*s - 2, side, x, margin)
         crosses = minval(margin) < 0.0_wp
         if (crosses) then
            call correct(r, pitch, 2*s - 2, side, free_middle, free_end, slope, rest, margin, x, n, added_slope, &
                         smallest, largest, present(gain))
         end if
         do l = 1, lanes
            first = r%static(l) + pitch%error(2*s - 2) + x(l, 1)
            second = r%static(l) + pitch%error(2*s - 1) + x(l, 2)
            smallest(l) = min(smallest(l), min(first, second))
            largest(l) = max(largest(l), max(first, second))
         end do
         if (present(gain)) then
            if (crosses) then
               call set_gain(r, slope, added_slope, gain%n(:, :, :, s))
            else
               call set_gain(r, slope, nothing_added, gain%n(:, :, :, s))
            end if
         end if
         if (present(record)) then
            call keep(r, pitch, s - 1, x(:, 1), re, im, record)
         end if
         do j = 1, r%modes
            do l = 1, lanes
               re(l, j) = carried_re(l, j) - r%taken_re(l, j, 1)*n(l, 1) - r%taken_re(l, j, 2)*n(l, 2) - r%taken_re(l, j, 3)*n(l, 3)
               im(l, j) = carried_im(l, j) - r%taken_im(l, j, 1)*n(l, 1) - r%taken_im(l, j, 2)*n(l, 2) - r%taken_im(l, j, 3)*n(l, 3)
            end do
         end do
      end do
      states(:, :r%modes) = re(:, :r%modes)
      states(:, r%modes + 1:) = im(:, :r%modes)
      if (present(record)) call keep(r, pitch, pitch%steps, x(:, 3), re, im, record)
   end subroutine advance_lanes

   !> Carry tangents of every lane over the period whose derivatives were taken.
   pure subroutine carry_lane_tangents(rule, steps, gain, count, tangents)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Derivatives.
      type(lane_gain), intent(in) :: gain
      !> Number of tangents.
      integer, intent(in) :: count
      !> The tangents, shape (lanes, count, 2 modes).
      real(wp), intent(inout) :: tangents(lanes, count, 2*rule%modes)

      type(lane_rule) :: r
      integer :: c, m

      call copy_rule(rule, r)
      m = r%modes
      ! A full set goes in pairs of the real and the imaginary part of a mode: which tangents go together does not depend on how
      ! many modes there is room for.
      if (count == 2*m) then
         do c = 1, m
            call carry_two(r, steps, gain, tangents(:, c, :m), tangents(:, c, m + 1:), tangents(:, m + c, :m), &
                           tangents(:, m + c, m + 1:))
         end do
      else
         do c = 1, count
            call carry_one(r, steps, gain, tangents(:, c, :m), tangents(:, c, m + 1:))
         end do
      end if
   end subroutine carry_lane_tangents

   !> Carry two tangents: they read the coefficients together.
   pure subroutine carry_two(r, steps, gain, first_re, first_im, second_re, second_im)
      !> Coefficients.
      type(lane_rule), intent(in) :: r
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Derivatives.
      type(lane_gain), intent(in) :: gain
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
            a1(l) = gain%n(l, 1, 1, s)*x_a(l) + gain%n(l, 1, 2, s)*middle_a(l) + gain%n(l, 1, 3, s)*end_a(l)
            a2(l) = gain%n(l, 2, 1, s)*x_a(l) + gain%n(l, 2, 2, s)*middle_a(l) + gain%n(l, 2, 3, s)*end_a(l)
            a3(l) = gain%n(l, 3, 1, s)*x_a(l) + gain%n(l, 3, 2, s)*middle_a(l) + gain%n(l, 3, 3, s)*end_a(l)
            x_a(l) = end_a(l) - r%end(l, 1)*a1(l) - r%end(l, 2)*a2(l) - r%end(l, 3)*a3(l)
            b1(l) = gain%n(l, 1, 1, s)*x_b(l) + gain%n(l, 1, 2, s)*middle_b(l) + gain%n(l, 1, 3, s)*end_b(l)
            b2(l) = gain%n(l, 2, 1, s)*x_b(l) + gain%n(l, 2, 2, s)*middle_b(l) + gain%n(l, 2, 3, s)*end_b(l)
            b3(l) = gain%n(l, 3, 1, s)*x_b(l) + gain%n(l, 3, 2, s)*middle_b(l) + gain%n(l, 3, 3, s)*end_b(l)
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
      !> Derivatives.
      type(lane_gain), intent(in) :: gain
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
            n1(l) = gain%n(l, 1, 1, s)*x(l) + gain%n(l, 1, 2, s)*middle(l) + gain%n(l, 1, 3, s)*end(l)
            n2(l) = gain%n(l, 2, 1, s)*x(l) + gain%n(l, 2, 2, s)*middle(l) + gain%n(l, 2, 3, s)*end(l)
            n3(l) = gain%n(l, 3, 1, s)*x(l) + gain%n(l, 3, 2, s)*middle(l) + gain%n(l, 3, 3, s)*end(l)
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

   !> Copy the coefficients in use: copies on the stack are aligned to the vectors.
   pure subroutine copy_rule(rule, copy)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> Their copy.
      type(lane_rule), intent(inout) :: copy

      integer :: m

      m = rule%modes
      copy%modes = m
      copy%half_re(:, :m) = rule%half_re(:, :m)
      copy%half_im(:, :m) = rule%half_im(:, :m)
      copy%full_re(:, :m) = rule%full_re(:, :m)
      copy%full_im(:, :m) = rule%full_im(:, :m)
      copy%taken_re(:, :m, :) = rule%taken_re(:, :m, :)
      copy%taken_im(:, :m, :) = rule%taken_im(:, :m, :)
      copy%middle = rule%middle
      copy%end = rule%end
      copy%static = rule%static
      copy%damping = rule%damping
      copy%force = rule%force
   end subroutine copy_rule

   !> Record the end of a step.
   pure subroutine keep(rule, pitch, step, x, re, im, record)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> The step, from 0 where the period begins.
      integer, intent(in) :: step
      !> g.q there [m].
      real(wp), intent(in) :: x(lanes)
      !> Modes there.
      real(wp), intent(in) :: re(lanes, most_modes), im(lanes, most_modes)
      !> Where to.
      type(lane_record), intent(inout) :: record

      integer :: l

      record%re(:, :rule%modes, step) = re(:, :rule%modes)
      record%im(:, :rule%modes, step) = im(:, :rule%modes)
      do l = 1, lanes
         record%force(l, step) = force_at(pitch, 2*step, rule%static(l), rule%damping(l), rule%force(l), x(l))
      end do
   end subroutine keep

end module spurflex_integrate_lane_step
