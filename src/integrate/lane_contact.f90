!> The mesh force of a step of the lanes on one branch of the contact, and its derivative.
module spurflex_integrate_lane_contact
   use spurflex_base_kinds, only: wp, i8
   use spurflex_integrate_lane_rule, only: lanes, points, lane_rule, mesh_cycle
   implicit none
   private

   public :: set_law, solve, find_margin, set_gain, force_at, any_below_zero, nothing_added

   !> Derivative of what is added to N where no lane leaves its branch.
   real(wp), parameter :: nothing_added(lanes, points, points) = 0.0_wp

contains

   !> The law N_i = slope_i x_i + rest_i of the branch on which a step begins.
   pure subroutine set_law(rule, pitch, place, x, side, slope, rest)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch.
      integer, intent(in) :: place
      !> g.q at the start [m].
      real(wp), intent(in) :: x(lanes)
      !> Branch: -1, 0 or 1.
      real(wp), intent(out) :: side(lanes)
      !> The law.
      real(wp), intent(out) :: slope(lanes, points), rest(lanes, points)

      real(wp) :: deflection, touches
      integer :: l, i

      do l = 1, lanes
         deflection = rule%static(l) + pitch%error(place) + x(l)
         side(l) = merge(1.0_wp, 0.0_wp, deflection >= pitch%half_backlash)
         side(l) = merge(-1.0_wp, side(l), deflection <= -pitch%half_backlash)
      end do
      do i = 1, points
         do l = 1, lanes
            touches = abs(side(l))*pitch%stiffness(place + i - 1)
            slope(l, i) = touches - pitch%mean_stiffness
            rest(l, i) = touches*(rule%static(l) + pitch%error(place + i - 1) - side(l)*pitch%half_backlash) &
                         + (rule%damping(l)*pitch%error_rate(place + i - 1) - rule%force(l))
         end do
      end do
   end subroutine set_law

   !> N at one place of the period.
   pure function force_at(pitch, place, static, damping, force, x) result(n)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the place in the cycle.
      integer, intent(in) :: place
      !> Static mesh deflection [m], c_m times the mesh frequency [N/m], mean mesh force [N].
      real(wp), intent(in) :: static, damping, force
      !> g.q there [m].
      real(wp), intent(in) :: x
      !> N [N].
      real(wp) :: n

      real(wp) :: deflection

      deflection = static + pitch%error(place) + x
      n = pitch%stiffness(place)*(deflection - max(-pitch%half_backlash, min(pitch%half_backlash, deflection))) &
          - pitch%mean_stiffness*x + (damping*pitch%error_rate(place) - force)
   end function force_at

   !> Solve a step on one branch.
   pure subroutine solve(rule, free_middle, free_end, slope, rest, x, n)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> g.q in the middle and at the end as the modes alone carry it [m].
      real(wp), intent(in) :: free_middle(lanes), free_end(lanes)
      !> The law.
      real(wp), intent(in) :: slope(lanes, points), rest(lanes, points)
      !> g.q at each point [m]; the first is given.
      real(wp), intent(inout) :: x(lanes, points)
      !> N at each point [N].
      real(wp), intent(out) :: n(lanes, points)

      real(wp) :: a, b, c, d, p, q, first, second, third, scale
      integer :: l

      do l = 1, lanes
         first = slope(l, 1)*x(l, 1) + rest(l, 1)
         second = rest(l, 2)
         third = rest(l, 3)
         p = free_middle(l) - rule%middle(l, 1)*first - rule%middle(l, 2)*second - rule%middle(l, 3)*third
         q = free_end(l) - rule%end(l, 1)*first - rule%end(l, 2)*second - rule%end(l, 3)*third
         a = 1.0_wp + rule%middle(l, 2)*slope(l, 2)
         b = rule%middle(l, 3)*slope(l, 3)
         c = rule%end(l, 2)*slope(l, 2)
         d = 1.0_wp + rule%end(l, 3)*slope(l, 3)
         scale = 1.0_wp/(a*d - b*c)
         x(l, 2) = scale*(d*p - b*q)
         x(l, 3) = scale*(a*q - c*p)
         n(l, 1) = first
         n(l, 2) = slope(l, 2)*x(l, 2) + second
         n(l, 3) = slope(l, 3)*x(l, 3) + third
      end do
   end subroutine solve

   !> A number for each lane that is negative where the mesh deflection leaves its branch within the step.
   pure subroutine find_margin(rule, pitch, place, side, x, margin)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch.
      integer, intent(in) :: place
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> The number.
      real(wp), intent(out) :: margin(lanes)

      real(wp) :: border, within, c1, c2, c3
      integer :: l

      do l = 1, lanes
         ! The border that the deflection may cross first, and on which side of it the step begins.
         within = 2.0_wp*abs(side(l)) - 1.0_wp
         border = merge(side(l), sign(1.0_wp, rule%static(l) + pitch%error(place + 1) + x(l, 2)), within > 0.0_wp)
         c1 = within*(border*(rule%static(l) + pitch%error(place) + x(l, 1)) - pitch%half_backlash)
         c2 = within*(border*(rule%static(l) + pitch%error(place + 1) + x(l, 2)) - pitch%half_backlash)
         c3 = border*(rule%static(l) + pitch%error(place + 2) + x(l, 3))
         ! From the gap it may end beyond either border.
         c3 = merge(c3 - pitch%half_backlash, pitch%half_backlash - abs(c3), within > 0.0_wp)
         margin(l) = min(c2, c3, lowest(c1, 4.0_wp*c2 - 3.0_wp*c1 - c3, 2.0_wp*c1 - 4.0_wp*c2 + 2.0_wp*c3))
      end do
   end subroutine find_margin

   !> Any of the lanes has a number below zero; what is not a number is not. Counted, because lanes can count together.
   pure function any_below_zero(number) result(there_is)
      !> The numbers.
      real(wp), intent(in) :: number(lanes)
      !> One is negative.
      logical :: there_is

      integer(i8) :: below
      integer :: l

      below = 0_i8
      do l = 1, lanes
         below = below + merge(1_i8, 0_i8, number(l) < 0.0_wp)
      end do
      there_is = below > 0_i8
   end function any_below_zero

   !> A number that is negative where the parabola s + p u + q u^2, s >= 0, dips below zero between 0 and 1.
   elemental function lowest(s, p, q) result(sign_of)
      !> Its coefficients.
      real(wp), intent(in) :: s, p, q
      !> The number; zero where the vertex is outside.
      real(wp) :: sign_of

      sign_of = merge(min(4.0_wp*q*s - p*p, 0.0_wp), 0.0_wp, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp)
   end function lowest

   !> Derivative of N by what comes into a step.
   pure subroutine set_gain(rule, slope, added_slope, gain)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> Derivative of N on the branch.
      real(wp), intent(in) :: slope(lanes, points)
      !> The same of what was added, or `nothing_added`.
      real(wp), intent(in) :: added_slope(lanes, points, points)
      !> Row: N at each point; column: x at the start, free x in the middle, free x at the end.
      real(wp), intent(out) :: gain(lanes, points, points)

      real(wp) :: law(points, points), p(points), q(points), a, b, c, d, scale, g21, g22, g23, g31, g32, g33
      integer :: l, i, j

      do l = 1, lanes
         do j = 1, points
            do i = 1, points
               law(i, j) = added_slope(l, i, j)
            end do
            law(j, j) = law(j, j) + slope(l, j)
         end do
         do j = 1, points
            p(j) = rule%middle(l, 1)*law(1, j) + rule%middle(l, 2)*law(2, j) + rule%middle(l, 3)*law(3, j)
            q(j) = rule%end(l, 1)*law(1, j) + rule%end(l, 2)*law(2, j) + rule%end(l, 3)*law(3, j)
         end do
         a = 1.0_wp + p(2)
         b = p(3)
         c = q(2)
         d = 1.0_wp + q(3)
         scale = 1.0_wp/(a*d - b*c)
         g22 = scale*d
         g23 = -scale*b
         g32 = -scale*c
         g33 = scale*a
         g21 = -(g22*p(1) + g23*q(1))
         g31 = -(g32*p(1) + g33*q(1))
         do i = 1, points
            gain(l, i, 1) = law(i, 1) + law(i, 2)*g21 + law(i, 3)*g31
            gain(l, i, 2) = law(i, 2)*g22 + law(i, 3)*g32
            gain(l, i, 3) = law(i, 2)*g23 + law(i, 3)*g33
         end do
      end do
   end subroutine set_gain

end module spurflex_integrate_lane_contact
