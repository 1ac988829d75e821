!> Steps of the lanes in which the teeth part or meet.
!>
!> The step is not cut. The mesh force is continued on the branch on which the step begins, and what it then has too much or
!> too little beyond a border, a known integral over a known part of the step, is added to N by its first three Legendre
!> moments, in two corrections. The derivative is that of the step solved to the end: near enough for Newton's method to gain
!> several digits a step, and for multipliers as good as the step. Lanes without a crossing do the same operations and keep
!> what they had, so that no lane knows its neighbours.
module spurflex_integrate_lane_crossing
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_contact, only: solve, any_below_zero
   use spurflex_integrate_lane_rule, only: lanes, points, lane_rule, mesh_cycle
   implicit none
   private

   public :: correct

   !> Times that a step with a crossing is solved: each reduces what is left by about (omega h)^2/12.
   integer, parameter :: corrections = 2

   !> Borders of the backlash.
   integer, parameter :: most_borders = 2

   !> Clearance that is none, far below the round-off of any [m].
   real(wp), parameter :: no_clearance = 1.0e-200_wp

   !> Gauss points and weights on (0, 1) for the part of a step beyond a border.
   integer, parameter :: gauss = 3
   real(wp), parameter :: gauss_place(gauss) = [0.112701665379258311482073460022_wp, 0.5_wp, &
                                                0.887298334620741688517926539978_wp]
   real(wp), parameter :: gauss_weight(gauss) = [5.0_wp/18.0_wp, 4.0_wp/9.0_wp, 5.0_wp/18.0_wp]

   !> A border that the lanes cross, each its own.
   type :: border_type
      !> 1 working flank, -1 back flank; 1 where the step begins in contact there, -1 where not.
      real(wp), dimension(lanes) :: flank, begins
      !> Negative in the lanes that are beyond the border at all.
      real(wp), dimension(lanes) :: beyond
   end type border_type

   !> Clearance to a border over a step, s + p u + q u^2 with u from 0 to 1, for each lane.
   type :: parabola_type
      !> Its coefficients [m].
      real(wp), dimension(lanes) :: s, p, q
   end type parabola_type

contains

   !> Solve a step again with the force beyond the borders put right.
   pure subroutine correct(rule, pitch, place, side, free_middle, free_end, slope, rest, margin, x, n, added_slope, &
                           smallest, largest, with_slope)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q in the middle and at the end as the modes alone carry it [m].
      real(wp), intent(in) :: free_middle(lanes), free_end(lanes)
      !> The law of the branch.
      real(wp), intent(in) :: slope(lanes, points), rest(lanes, points)
      !> Negative in the lanes that leave their branch; the others must not notice.
      real(wp), intent(in) :: margin(lanes)
      !> g.q and N at each point, put right.
      real(wp), intent(inout) :: x(lanes, points), n(lanes, points)
      !> Derivative of what is added to N at each point by x at each point.
      real(wp), intent(inout) :: added_slope(lanes, points, points)
      !> Extremes of the mesh deflection so far [m].
      real(wp), intent(inout) :: smallest(lanes), largest(lanes)
      !> The derivative is wanted.
      logical, intent(in) :: with_slope

      real(wp), dimension(lanes, points) :: base, once, added, corrected, forces, old_x, old_n
      real(wp), dimension(lanes) :: from, length
      type(border_type) :: borders(most_borders)
      type(parabola_type) :: gap
      real(wp) :: old, anew, leaves
      integer :: k, l, border, crossed

      do k = 1, points
         do l = 1, lanes
            base(l, k) = rule%static(l) + pitch%error(place + k - 1)
            corrected(l, k) = x(l, k)
            old_x(l, k) = x(l, k)
            old_n(l, k) = n(l, k)
         end do
      end do
      call find_borders(pitch%half_backlash, base, side, margin, x, borders)
      crossed = merge(most_borders, 1, any_below_zero(borders(2)%beyond))
      do k = 1, corrections
         call set_clearance(pitch%half_backlash, base, borders(1), corrected, gap)
         call set_part(gap, borders(1)%beyond, from, length)
         call add_force(pitch, place, borders(1)%flank, gap, from, length, rest, added)
         if (crossed > 1) then
            call set_clearance(pitch%half_backlash, base, borders(2), corrected, gap)
            call set_part(gap, borders(2)%beyond, from, length)
            once = added
            call add_force(pitch, place, borders(2)%flank, gap, from, length, once, added)
         end if
         call solve(rule, free_middle, free_end, slope, added, corrected, forces)
      end do
      do k = 1, points
         do l = 1, lanes
            ! All are read and written, and no store is under a condition: that would cost several times as much.
            leaves = margin(l)
            old = old_x(l, k)
            anew = corrected(l, k)
            x(l, k) = merge(anew, old, leaves < 0.0_wp)
            old = old_n(l, k)
            anew = forces(l, k)
            n(l, k) = merge(anew, old, leaves < 0.0_wp)
         end do
      end do
      do border = 1, crossed
         call set_clearance(pitch%half_backlash, base, borders(border), x, gap)
         call reach(borders(border), pitch%half_backlash, gap, smallest, largest)
         if (.not. with_slope) cycle
         call set_part(gap, borders(border)%beyond, from, length)
         call add_slope(pitch, place, borders(border)%begins, from, length, border == 1, added_slope)
      end do
   end subroutine correct

   !> Which borders are crossed is told by the deflection that the branch alone would have.
   pure subroutine find_borders(half_backlash, base, side, margin, x, borders)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Mesh deflection at each point less g.q [m].
      real(wp), intent(in) :: base(lanes, points)
      !> Branch at the start; negative in the lanes that leave it.
      real(wp), intent(in) :: side(lanes), margin(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> The borders. Hardly ever a lane crosses both in one step: each has its own one for the first.
      type(border_type), intent(out) :: borders(most_borders)

      real(wp) :: at_back, at_working, start, middle, end, p, q, back, working, leaves
      integer :: l

      do l = 1, lanes
         at_back = merge(1.0_wp, -1.0_wp, side(l) < -0.5_wp)
         start = at_back*(-(base(l, 1) + x(l, 1)) - half_backlash)
         middle = at_back*(-(base(l, 2) + x(l, 2)) - half_backlash)
         end = at_back*(-(base(l, 3) + x(l, 3)) - half_backlash)
         p = 4.0_wp*middle - 3.0_wp*start - end
         q = 2.0_wp*(start + end) - 4.0_wp*middle
         back = min(middle, end, merge(min(4.0_wp*q*start - p*p, 0.0_wp), 0.0_wp, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp))
         at_working = merge(1.0_wp, -1.0_wp, side(l) > 0.5_wp)
         start = at_working*(base(l, 1) + x(l, 1) - half_backlash)
         middle = at_working*(base(l, 2) + x(l, 2) - half_backlash)
         end = at_working*(base(l, 3) + x(l, 3) - half_backlash)
         p = 4.0_wp*middle - 3.0_wp*start - end
         q = 2.0_wp*(start + end) - 4.0_wp*middle
         leaves = margin(l)
         working = min(middle, end, merge(min(4.0_wp*q*start - p*p, 0.0_wp), 0.0_wp, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp))
         back = merge(back, 1.0_wp, leaves < 0.0_wp)
         working = merge(working, 1.0_wp, leaves < 0.0_wp)
         borders(1)%flank(l) = merge(-1.0_wp, 1.0_wp, back < 0.0_wp)
         borders(1)%begins(l) = merge(at_back, at_working, back < 0.0_wp)
         borders(1)%beyond(l) = merge(back, working, back < 0.0_wp)
         borders(2)%flank(l) = 1.0_wp
         borders(2)%begins(l) = at_working
         borders(2)%beyond(l) = merge(working, 1.0_wp, back < 0.0_wp)
      end do
   end subroutine find_borders

   !> Clearance to a border over a step, positive on the side on which the step begins.
   pure subroutine set_clearance(half_backlash, base, border, x, gap)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Mesh deflection at each point less g.q [m].
      real(wp), intent(in) :: base(lanes, points)
      !> The border.
      type(border_type), intent(in) :: border
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> The clearance.
      type(parabola_type), intent(out) :: gap

      real(wp) :: towards, there, start, middle, end
      integer :: l

      do l = 1, lanes
         towards = border%begins(l)*border%flank(l)
         there = border%begins(l)*half_backlash
         start = towards*(base(l, 1) + x(l, 1)) - there
         middle = towards*(base(l, 2) + x(l, 2)) - there
         end = towards*(base(l, 3) + x(l, 3)) - there
         gap%s(l) = start
         gap%p(l) = 4.0_wp*middle - 3.0_wp*start - end
         gap%q(l) = 2.0_wp*(start + end) - 4.0_wp*middle
      end do
   end subroutine set_clearance

   !> The part of a step in which the deflection is beyond a border that it began before.
   pure subroutine set_part(gap, beyond, from, length)
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Negative in the lanes that are beyond the border at all.
      real(wp), intent(in) :: beyond(lanes)
      !> Where the part begins, and how long it is, as shares of the step; its length is 0 where there is none.
      real(wp), intent(out) :: from(lanes), length(lanes)

      real(wp) :: s, p, q, w, turn, end, first, outside
      integer :: l

      do l = 1, lanes
         s = gap%s(l)
         p = gap%p(l)
         q = gap%q(l)
         outside = beyond(l)
         ! The roots s/w and w/q without cancellation: one after which the clearance is negative, one after which it is not, in
         ! the order in which p and q say.
         w = -0.5_wp*(p + sign(sqrt(max(p*p - 4.0_wp*q*s, 0.0_wp)) + no_clearance, p))
         turn = w/(q + sign(no_clearance, q))
         turn = min(merge(turn, 1.0_wp, turn > 0.0_wp), 1.0_wp)
         first = merge(min(s/w, 1.0_wp), turn, p < 0.0_wp)
         end = merge(turn, 1.0_wp, p < 0.0_wp)
         first = merge(first, 1.0_wp, outside < 0.0_wp)
         from(l) = first
         length(l) = max(end, first) - first
      end do
   end subroutine set_part

   !> How far the deflection of the lanes beyond a border turns between the points of the step.
   pure subroutine reach(border, half_backlash, gap, smallest, largest)
      !> The border.
      type(border_type), intent(in) :: border
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Extremes of the mesh deflection so far [m].
      real(wp), intent(inout) :: smallest(lanes), largest(lanes)

      real(wp) :: s, p, q, flank, begins, outside, extreme, least, most
      integer :: l

      do l = 1, lanes
         s = gap%s(l)
         p = gap%p(l)
         q = gap%q(l)
         extreme = merge(s - p*p/(4.0_wp*merge(q, 1.0_wp, abs(q) > no_clearance)), s, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp)
         flank = border%flank(l)
         begins = border%begins(l)
         outside = border%beyond(l)
         extreme = flank*(begins*extreme + half_backlash)
         least = merge(extreme, huge(1.0_wp), outside < 0.0_wp)
         most = merge(extreme, -huge(1.0_wp), outside < 0.0_wp)
         smallest(l) = min(smallest(l), least)
         largest(l) = max(largest(l), most)
      end do
   end subroutine reach

   !> Add what the force at a border has too little, or take off what it has too much.
   pure subroutine add_force(pitch, place, flank, gap, from, length, rest, added)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Border of each lane.
      real(wp), intent(in) :: flank(lanes)
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Part of the step.
      real(wp), intent(in) :: from(lanes), length(lanes)
      !> What there is of N without [N].
      real(wp), intent(in) :: rest(lanes, points)
      !> The same with what is added [N].
      real(wp), intent(out) :: added(lanes, points)

      real(wp) :: k, kp, kq, u, value, first, second, third, mean, tilt, bend
      integer :: l, g

      call stiffness_over_step(pitch, place, k, kp, kq)
      do l = 1, lanes
         first = 0.0_wp
         second = 0.0_wp
         third = 0.0_wp
         do g = 1, gauss
            u = from(l) + length(l)*gauss_place(g)
            value = gauss_weight(g)*((k + u*(kp + u*kq))*(gap%s(l) + u*(gap%p(l) + u*gap%q(l))))
            first = first + value
            second = second + value*u
            third = third + value*u*u
         end do
         ! Moments by the Legendre polynomials on (0, 1), each with the square of its norm.
         mean = length(l)*flank(l)*first
         tilt = length(l)*flank(l)*(6.0_wp*second - 3.0_wp*first)
         bend = length(l)*flank(l)*(5.0_wp*first - 30.0_wp*(second - third))
         added(l, 1) = rest(l, 1) - (mean - tilt + bend)
         added(l, 2) = rest(l, 2) - (mean - 0.5_wp*bend)
         added(l, 3) = rest(l, 3) - (mean + tilt + bend)
      end do
   end subroutine add_force

   !> Derivative of what `add_force` adds by x at each point.
   pure subroutine add_slope(pitch, place, begins, from, length, anew, slope)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> 1 where the step begins in contact at the border, -1 where not.
      real(wp), intent(in) :: begins(lanes)
      !> Part of the step.
      real(wp), intent(in) :: from(lanes), length(lanes)
      !> Nothing was added before.
      logical, intent(in) :: anew
      !> The derivative, added to.
      real(wp), intent(inout) :: slope(lanes, points, points)

      real(wp) :: sums(points, points), row(points), column(points), k, kp, kq, u, value
      integer :: l, g, i, j

      call stiffness_over_step(pitch, place, k, kp, kq)
      do l = 1, lanes
         do j = 1, points
            do i = 1, points
               sums(i, j) = merge(0.0_wp, slope(l, i, j), anew)
            end do
         end do
         do g = 1, gauss
            u = from(l) + length(l)*gauss_place(g)
            value = -begins(l)*length(l)*(gauss_weight(g)*(k + u*(kp + u*kq)))
            ! Sums of Legendre polynomials, as in `add_force`; Lagrange polynomials of the points.
            row(1) = value*(9.0_wp + u*(30.0_wp*u - 36.0_wp))
            row(2) = value*(15.0_wp*(u - u*u) - 1.5_wp)
            row(3) = value*(3.0_wp + u*(30.0_wp*u - 24.0_wp))
            column(1) = (1.0_wp - 2.0_wp*u)*(1.0_wp - u)
            column(2) = 4.0_wp*(u - u*u)
            column(3) = u*(2.0_wp*u - 1.0_wp)
            do j = 1, points
               do i = 1, points
                  sums(i, j) = sums(i, j) + row(i)*column(j)
               end do
            end do
         end do
         do j = 1, points
            do i = 1, points
               slope(l, i, j) = sums(i, j)
            end do
         end do
      end do
   end subroutine add_slope

   !> Mesh stiffness over a step, k + kp u + kq u^2 with u from 0 to 1.
   pure subroutine stiffness_over_step(pitch, place, k, kp, kq)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> The coefficients [N/m].
      real(wp), intent(out) :: k, kp, kq

      k = pitch%stiffness(place)
      kp = 4.0_wp*pitch%stiffness(place + 1) - 3.0_wp*k - pitch%stiffness(place + 2)
      kq = 2.0_wp*(k + pitch%stiffness(place + 2)) - 4.0_wp*pitch%stiffness(place + 1)
   end subroutine stiffness_over_step

end module spurflex_integrate_lane_crossing
