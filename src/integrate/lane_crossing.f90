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

   !> Curvature of a deflection over a step that is none [m].
   real(wp), parameter :: no_curvature = 1.0e-200_wp

   !> Gauss points and weights on (0, 1) for the part of a step beyond a border.
   integer, parameter :: gauss = 3
   real(wp), parameter :: gauss_place(gauss) = [0.112701665379258311482073460022_wp, 0.5_wp, &
                                                0.887298334620741688517926539978_wp]
   real(wp), parameter :: gauss_weight(gauss) = [5.0_wp/18.0_wp, 4.0_wp/9.0_wp, 5.0_wp/18.0_wp]

   !> Clearance to a border over a step, s + p u + q u^2 with u from 0 to 1, for each lane.
   type :: parabola_type
      !> Its coefficients [m].
      real(wp), dimension(lanes) :: s, p, q
      !> 1 where the step begins in contact at this border, -1 where not.
      real(wp), dimension(lanes) :: begins
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

      real(wp), dimension(lanes, points) :: added, corrected, forces
      real(wp), dimension(lanes, most_borders) :: flank, beyond
      real(wp), dimension(lanes) :: from, until
      type(parabola_type) :: gap
      integer :: k, l, border, borders

      ! Which borders are crossed is told by the deflection that the branch alone would have.
      flank(:, 1) = -1.0_wp
      flank(:, 2) = 1.0_wp
      do border = 1, most_borders
         call set_clearance(rule, pitch, place, flank(:, border), side, x, gap)
         do l = 1, lanes
            beyond(l, border) = min(gap%s(l) + 0.5_wp*gap%p(l) + 0.25_wp*gap%q(l), gap%s(l) + gap%p(l) + gap%q(l), &
                                    merge(min(4.0_wp*gap%q(l)*gap%s(l) - gap%p(l)*gap%p(l), 0.0_wp), 0.0_wp, &
                                          gap%p(l) < 0.0_wp .and. gap%p(l) + 2.0_wp*gap%q(l) > 0.0_wp))
            beyond(l, border) = merge(beyond(l, border), 1.0_wp, margin(l) < 0.0_wp)
         end do
      end do
      ! Hardly ever a lane crosses both in one step: each has its own one for the first.
      do l = 1, lanes
         flank(l, 1) = merge(-1.0_wp, 1.0_wp, beyond(l, 1) < 0.0_wp)
         from(l) = merge(beyond(l, 1), beyond(l, 2), beyond(l, 1) < 0.0_wp)
         beyond(l, 2) = merge(beyond(l, 2), 1.0_wp, beyond(l, 1) < 0.0_wp)
         beyond(l, 1) = from(l)
      end do
      borders = merge(most_borders, 1, any_below_zero(beyond(:, 2)))
      corrected = x
      do k = 1, corrections
         added = rest
         do border = 1, borders
            call set_clearance(rule, pitch, place, flank(:, border), side, corrected, gap)
            call set_part(gap, beyond(:, border), from, until)
            call add_force(pitch, place, flank(:, border), gap, from, until, added)
         end do
         call solve(rule, free_middle, free_end, slope, added, corrected, forces)
      end do
      do k = 1, points
         do l = 1, lanes
            x(l, k) = merge(corrected(l, k), x(l, k), margin(l) < 0.0_wp)
            n(l, k) = merge(forces(l, k), n(l, k), margin(l) < 0.0_wp)
         end do
      end do
      do border = 1, borders
         call set_clearance(rule, pitch, place, flank(:, border), side, x, gap)
         call reach(flank(:, border), pitch%half_backlash, gap, beyond(:, border), smallest, largest)
         if (.not. with_slope) cycle
         call set_part(gap, beyond(:, border), from, until)
         call add_slope(pitch, place, gap, from, until, border == 1, added_slope)
      end do
   end subroutine correct

   !> Clearance to a border over a step, positive on the side on which the step begins.
   pure subroutine set_clearance(rule, pitch, place, flank, side, x, gap)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Border of each lane: 1 working flank, -1 back flank.
      real(wp), intent(in) :: flank(lanes)
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> The clearance.
      type(parabola_type), intent(out) :: gap

      real(wp) :: sign_of, start, middle, end
      integer :: l

      do l = 1, lanes
         sign_of = merge(1.0_wp, -1.0_wp, abs(side(l) - flank(l)) < 0.5_wp)
         start = sign_of*(flank(l)*(rule%static(l) + pitch%error(place) + x(l, 1)) - pitch%half_backlash)
         middle = sign_of*(flank(l)*(rule%static(l) + pitch%error(place + 1) + x(l, 2)) - pitch%half_backlash)
         end = sign_of*(flank(l)*(rule%static(l) + pitch%error(place + 2) + x(l, 3)) - pitch%half_backlash)
         gap%begins(l) = sign_of
         gap%s(l) = start
         gap%p(l) = 4.0_wp*middle - 3.0_wp*start - end
         gap%q(l) = 2.0_wp*(start + end) - 4.0_wp*middle
      end do
   end subroutine set_clearance

   !> The part of a step in which the deflection is beyond a border that it began before.
   pure subroutine set_part(gap, beyond, from, until)
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Negative in the lanes that are beyond the border at all.
      real(wp), intent(in) :: beyond(lanes)
      !> The part, as shares of the step; both 1 where there is none.
      real(wp), intent(out) :: from(lanes), until(lanes)

      real(wp) :: s, p, q, root, w, first, second, turn
      integer :: l

      do l = 1, lanes
         s = gap%s(l)
         p = gap%p(l)
         q = gap%q(l)
         root = p*p - 4.0_wp*q*s
         w = -0.5_wp*(p + sign(sqrt(max(root, 0.0_wp)), p))
         w = merge(w, 1.0_wp, abs(w) > no_curvature)
         turn = w/merge(q, 1.0_wp, abs(q) > no_curvature)
         first = merge(s/w, merge(turn, 1.0_wp, q < -no_curvature), p < 0.0_wp)
         second = merge(turn, 1.0_wp, p < 0.0_wp .and. q > no_curvature)
         first = merge(min(max(first, 0.0_wp), 1.0_wp), 1.0_wp, root > 0.0_wp .and. beyond(l) < 0.0_wp)
         from(l) = first
         until(l) = max(min(second, 1.0_wp), first)
      end do
   end subroutine set_part

   !> How far the deflection of the lanes beyond a border turns between the points of the step.
   pure subroutine reach(flank, half_backlash, gap, beyond, smallest, largest)
      !> Border of each lane.
      real(wp), intent(in) :: flank(lanes)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Negative in the lanes that are beyond the border.
      real(wp), intent(in) :: beyond(lanes)
      !> Extremes of the mesh deflection so far [m].
      real(wp), intent(inout) :: smallest(lanes), largest(lanes)

      real(wp) :: s, p, q, extreme
      integer :: l

      do l = 1, lanes
         s = gap%s(l)
         p = gap%p(l)
         q = gap%q(l)
         extreme = merge(s - p*p/(4.0_wp*merge(q, 1.0_wp, abs(q) > no_curvature)), s, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp)
         extreme = flank(l)*(gap%begins(l)*extreme + half_backlash)
         smallest(l) = merge(min(smallest(l), extreme), smallest(l), beyond(l) < 0.0_wp)
         largest(l) = merge(max(largest(l), extreme), largest(l), beyond(l) < 0.0_wp)
      end do
   end subroutine reach

   !> Add what the force at a border has too little, or take off what it has too much.
   pure subroutine add_force(pitch, place, flank, gap, from, until, added)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Border of each lane.
      real(wp), intent(in) :: flank(lanes)
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Part of the step.
      real(wp), intent(in) :: from(lanes), until(lanes)
      !> What is added to N [N].
      real(wp), intent(inout) :: added(lanes, points)

      real(wp) :: k, kp, kq, u, value, mean, tilt, bend
      integer :: l, g

      k = pitch%stiffness(place)
      kp = 4.0_wp*pitch%stiffness(place + 1) - 3.0_wp*k - pitch%stiffness(place + 2)
      kq = 2.0_wp*(k + pitch%stiffness(place + 2)) - 4.0_wp*pitch%stiffness(place + 1)
      do l = 1, lanes
         mean = 0.0_wp
         tilt = 0.0_wp
         bend = 0.0_wp
         do g = 1, gauss
            u = from(l) + (until(l) - from(l))*gauss_place(g)
            value = gauss_weight(g)*(until(l) - from(l))*(k + u*(kp + u*kq))*(gap%s(l) + u*(gap%p(l) + u*gap%q(l)))
            mean = mean + value
            tilt = tilt + 3.0_wp*value*(2.0_wp*u - 1.0_wp)
            bend = bend + 5.0_wp*value*(1.0_wp - 6.0_wp*u*(1.0_wp - u))
         end do
         added(l, 1) = added(l, 1) - flank(l)*(mean - tilt + bend)
         added(l, 2) = added(l, 2) - flank(l)*(mean - 0.5_wp*bend)
         added(l, 3) = added(l, 3) - flank(l)*(mean + tilt + bend)
      end do
   end subroutine add_force

   !> Derivative of what `add_force` adds by x at each point.
   pure subroutine add_slope(pitch, place, gap, from, until, anew, slope)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Clearance.
      type(parabola_type), intent(in) :: gap
      !> Part of the step.
      real(wp), intent(in) :: from(lanes), until(lanes)
      !> Nothing was added before.
      logical, intent(in) :: anew
      !> The derivative, added to.
      real(wp), intent(inout) :: slope(lanes, points, points)

      real(wp) :: sums(points, points), row(points), column(points), k, kp, kq, u, value, tilt, bend
      integer :: l, g, i, j

      k = pitch%stiffness(place)
      kp = 4.0_wp*pitch%stiffness(place + 1) - 3.0_wp*k - pitch%stiffness(place + 2)
      kq = 2.0_wp*(k + pitch%stiffness(place + 2)) - 4.0_wp*pitch%stiffness(place + 1)
      do l = 1, lanes
         do j = 1, points
            do i = 1, points
               sums(i, j) = merge(0.0_wp, slope(l, i, j), anew)
            end do
         end do
         do g = 1, gauss
            u = from(l) + (until(l) - from(l))*gauss_place(g)
            value = -gap%begins(l)*gauss_weight(g)*(until(l) - from(l))*(k + u*(kp + u*kq))
            tilt = 3.0_wp*(2.0_wp*u - 1.0_wp)
            bend = 5.0_wp*(1.0_wp - 6.0_wp*u*(1.0_wp - u))
            row(1) = value*(1.0_wp - tilt + bend)
            row(2) = value*(1.0_wp - 0.5_wp*bend)
            row(3) = value*(1.0_wp + tilt + bend)
            column(1) = (1.0_wp - 2.0_wp*u)*(1.0_wp - u)
            column(2) = 4.0_wp*u*(1.0_wp - u)
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

end module spurflex_integrate_lane_crossing
