!> Steps of the lanes in which the teeth part or meet.
!>
!> The step is not cut. The mesh force is continued on the branch on which the step begins, and what it then has too much or
!> too little beyond a border, a known integral over a known part of the step, is added to N by its first three Legendre
!> moments. Lanes without a crossing do the same operations and keep what they had, so that no lane knows its neighbours.
module spurflex_integrate_lane_crossing
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_contact, only: solve
   use spurflex_integrate_lane_rule, only: lanes, points, lane_rule, mesh_cycle
   implicit none
   private

   public :: correct

   !> Times that a step with a crossing is solved: each reduces what is left by about (omega h)^2/12.
   integer, parameter :: corrections = 2

   !> Curvature of a deflection over a step that is none [m].
   real(wp), parameter :: no_curvature = 1.0e-200_wp

   !> Gauss points and weights on (0, 1) for the part of a step beyond a border.
   integer, parameter :: gauss = 3
   real(wp), parameter :: gauss_place(gauss) = [0.112701665379258311482073460022_wp, 0.5_wp, &
                                                0.887298334620741688517926539978_wp]
   real(wp), parameter :: gauss_weight(gauss) = [5.0_wp/18.0_wp, 4.0_wp/9.0_wp, 5.0_wp/18.0_wp]

contains

   !> Solve a step again with the force beyond the borders put right.
   pure subroutine correct(rule, pitch, place, side, free_middle, free_end, slope, rest, margin, x, n, added_slope, &
                           smallest, largest, with_slope)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch.
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
      real(wp), dimension(lanes) :: from, until, beyond
      integer :: k, l, border

      corrected = x
      do k = 1, corrections
         added = rest
         do border = -1, 1, 2
            call find_beyond(rule, pitch, place, border, side, corrected, beyond)
            if (.not. minval(beyond) < 0.0_wp) cycle
            call part_beyond(rule, pitch, place, border, side, corrected, beyond, from, until)
            call add_force(rule, pitch, place, border, side, corrected, from, until, added)
         end do
         call solve(rule, free_middle, free_end, slope, added, corrected, forces)
      end do
      do k = 1, points
         do l = 1, lanes
            x(l, k) = merge(corrected(l, k), x(l, k), margin(l) < 0.0_wp)
            n(l, k) = merge(forces(l, k), n(l, k), margin(l) < 0.0_wp)
         end do
      end do
      added_slope = 0.0_wp
      do border = -1, 1, 2
         call find_beyond(rule, pitch, place, border, side, x, beyond)
         do l = 1, lanes
            beyond(l) = merge(beyond(l), 1.0_wp, margin(l) < 0.0_wp)
         end do
         if (.not. minval(beyond) < 0.0_wp) cycle
         call reach(rule, pitch, place, border, side, x, beyond, smallest, largest)
         if (.not. with_slope) cycle
         call part_beyond(rule, pitch, place, border, side, x, beyond, from, until)
         call add_slope(pitch, place, border, side, from, until, added_slope)
      end do
   end subroutine correct

   !> A number for each lane that is negative where the deflection is beyond a border somewhere in the step.
   pure subroutine find_beyond(rule, pitch, place, border, side, x, beyond)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Border: 1 working flank, -1 back flank.
      integer, intent(in) :: border
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> The number.
      real(wp), intent(out) :: beyond(lanes)

      real(wp) :: s, p, q, sign_of, lowest
      integer :: l

      do l = 1, lanes
         call clearance(rule, pitch, place, border, side, x, l, s, p, q, sign_of)
         lowest = merge(min(4.0_wp*q*s - p*p, 0.0_wp), 0.0_wp, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp)
         beyond(l) = min(s + 0.5_wp*p + 0.25_wp*q, s + p + q, lowest)
      end do
   end subroutine find_beyond

   !> The part of a step in which the deflection is beyond a border that it began before.
   pure subroutine part_beyond(rule, pitch, place, border, side, x, beyond, from, until)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch.
      integer, intent(in) :: place
      !> Border: 1 working flank, -1 back flank.
      integer, intent(in) :: border
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> Negative in the lanes that are beyond the border at all.
      real(wp), intent(in) :: beyond(lanes)
      !> The part, as shares of the step; both 1 where there is none.
      real(wp), intent(out) :: from(lanes), until(lanes)

      real(wp) :: s, p, q, root, w, first, second, turn, sign_of
      integer :: l

      do l = 1, lanes
         call clearance(rule, pitch, place, border, side, x, l, s, p, q, sign_of)
         root = p*p - 4.0_wp*q*s
         w = -0.5_wp*(p + sign(sqrt(max(root, 0.0_wp)), p))
         w = merge(w, 1.0_wp, abs(w) > no_curvature)
         turn = merge(q, 1.0_wp, abs(q) > no_curvature)
         first = merge(s/w, merge(w/turn, 1.0_wp, q < -no_curvature), p < 0.0_wp)
         second = merge(w/turn, 1.0_wp, p < 0.0_wp .and. q > no_curvature)
         first = merge(min(max(first, 0.0_wp), 1.0_wp), 1.0_wp, root > 0.0_wp .and. beyond(l) < 0.0_wp)
         from(l) = first
         until(l) = max(min(second, 1.0_wp), first)
      end do
   end subroutine part_beyond

   !> How far the deflection of the lanes beyond a border turns between the points of the step.
   pure subroutine reach(rule, pitch, place, border, side, x, beyond, smallest, largest)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the cycle.
      integer, intent(in) :: place
      !> Border: 1 working flank, -1 back flank.
      integer, intent(in) :: border
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> Negative in the lanes that are beyond the border.
      real(wp), intent(in) :: beyond(lanes)
      !> Extremes of the mesh deflection so far [m].
      real(wp), intent(inout) :: smallest(lanes), largest(lanes)

      real(wp) :: s, p, q, turn, sign_of, extreme
      integer :: l

      do l = 1, lanes
         call clearance(rule, pitch, place, border, side, x, l, s, p, q, sign_of)
         turn = merge(q, 1.0_wp, abs(q) > no_curvature)
         extreme = merge(s - p*p/(4.0_wp*turn), s, p < 0.0_wp .and. p + 2.0_wp*q > 0.0_wp)
         extreme = real(border, wp)*(sign_of*extreme + pitch%half_backlash)
         smallest(l) = merge(min(smallest(l), extreme), smallest(l), beyond(l) < 0.0_wp)
         largest(l) = merge(max(largest(l), extreme), largest(l), beyond(l) < 0.0_wp)
      end do
   end subroutine reach

   !> Clearance to a border over a step, s + p u + q u^2, positive on the side on which the step begins.
   pure subroutine clearance(rule, pitch, place, border, side, x, l, s, p, q, sign_of)
      !$GCC$ ATTRIBUTES always_inline :: clearance
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch, border, lane.
      integer, intent(in) :: place, border, l
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> The parabola [m].
      real(wp), intent(out) :: s, p, q
      !> 1 where the step begins in contact at this border, -1 where not.
      real(wp), intent(out) :: sign_of

      real(wp) :: middle, end

      sign_of = merge(1.0_wp, -1.0_wp, abs(side(l) - real(border, wp)) < 0.5_wp)
      s = sign_of*(real(border, wp)*(rule%static(l) + pitch%error(place) + x(l, 1)) - pitch%half_backlash)
      middle = sign_of*(real(border, wp)*(rule%static(l) + pitch%error(place + 1) + x(l, 2)) - pitch%half_backlash)
      end = sign_of*(real(border, wp)*(rule%static(l) + pitch%error(place + 2) + x(l, 3)) - pitch%half_backlash)
      p = 4.0_wp*middle - 3.0_wp*s - end
      q = 2.0_wp*(s + end) - 4.0_wp*middle
   end subroutine clearance

   !> Add what the force at a border has too little, or take off what it has too much.
   pure subroutine add_force(rule, pitch, place, border, side, x, from, until, added)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch, border.
      integer, intent(in) :: place, border
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> g.q at each point [m].
      real(wp), intent(in) :: x(lanes, points)
      !> Part of the step.
      real(wp), intent(in) :: from(lanes), until(lanes)
      !> What is added to N [N].
      real(wp), intent(inout) :: added(lanes, points)

      real(wp), dimension(lanes) :: mean, tilt, bend
      real(wp) :: s, p, q, k, kp, kq, u, value, sign_of
      integer :: l, g

      k = pitch%stiffness(place)
      kp = 4.0_wp*pitch%stiffness(place + 1) - 3.0_wp*k - pitch%stiffness(place + 2)
      kq = 2.0_wp*(k + pitch%stiffness(place + 2)) - 4.0_wp*pitch%stiffness(place + 1)
      mean = 0.0_wp
      tilt = 0.0_wp
      bend = 0.0_wp
      do g = 1, gauss
         do l = 1, lanes
            call clearance(rule, pitch, place, border, side, x, l, s, p, q, sign_of)
            u = from(l) + (until(l) - from(l))*gauss_place(g)
            value = gauss_weight(g)*(until(l) - from(l))*(k + u*(kp + u*kq))*(s + u*(p + u*q))
            mean(l) = mean(l) + value
            tilt(l) = tilt(l) + 3.0_wp*value*(2.0_wp*u - 1.0_wp)
            bend(l) = bend(l) + 5.0_wp*value*(1.0_wp - 6.0_wp*u*(1.0_wp - u))
         end do
      end do
      do l = 1, lanes
         added(l, 1) = added(l, 1) - real(border, wp)*(mean(l) - tilt(l) + bend(l))
         added(l, 2) = added(l, 2) - real(border, wp)*(mean(l) - 0.5_wp*bend(l))
         added(l, 3) = added(l, 3) - real(border, wp)*(mean(l) + tilt(l) + bend(l))
      end do
   end subroutine add_force

   !> Derivative of what `add_force` adds by x at each point.
   pure subroutine add_slope(pitch, place, border, side, from, until, slope)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the start of the step in the pitch, border.
      integer, intent(in) :: place, border
      !> Branch at the start.
      real(wp), intent(in) :: side(lanes)
      !> Part of the step.
      real(wp), intent(in) :: from(lanes), until(lanes)
      !> The derivative, added to.
      real(wp), intent(inout) :: slope(lanes, points, points)

      real(wp), dimension(lanes, points) :: row, column
      real(wp) :: k, kp, kq, u, value, tilt, bend, sign_of
      integer :: l, g, i, j

      k = pitch%stiffness(place)
      kp = 4.0_wp*pitch%stiffness(place + 1) - 3.0_wp*k - pitch%stiffness(place + 2)
      kq = 2.0_wp*(k + pitch%stiffness(place + 2)) - 4.0_wp*pitch%stiffness(place + 1)
      do g = 1, gauss
         do l = 1, lanes
            sign_of = 1.0_wp - 2.0_wp*merge(1.0_wp, 0.0_wp, abs(side(l) - real(border, wp)) < 0.5_wp)
            u = from(l) + (until(l) - from(l))*gauss_place(g)
            value = sign_of*gauss_weight(g)*(until(l) - from(l))*(k + u*(kp + u*kq))
            tilt = 3.0_wp*(2.0_wp*u - 1.0_wp)
            bend = 5.0_wp*(1.0_wp - 6.0_wp*u*(1.0_wp - u))
            row(l, 1) = value*(1.0_wp - tilt + bend)
            row(l, 2) = value*(1.0_wp - 0.5_wp*bend)
            row(l, 3) = value*(1.0_wp + tilt + bend)
            column(l, 1) = (1.0_wp - 2.0_wp*u)*(1.0_wp - u)
            column(l, 2) = 4.0_wp*u*(1.0_wp - u)
            column(l, 3) = u*(2.0_wp*u - 1.0_wp)
         end do
         do j = 1, points
            do i = 1, points
               do l = 1, lanes
                  slope(l, i, j) = slope(l, i, j) + row(l, i)*column(l, j)
               end do
            end do
         end do
      end do
   end subroutine add_slope

end module spurflex_integrate_lane_crossing
