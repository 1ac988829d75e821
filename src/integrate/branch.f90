!> Branches of the contact, and where a step leaves one.
!>
!> Over a step the mesh deflection is the polynomial through its values at the Lobatto points. Its clearance to the border
!> of the branch is looked at between the points too, so that no crossing is missed, not even one that only grazes.
module spurflex_integrate_branch
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_exponential, only: nodes, lagrange
   implicit none
   private

   public :: branch_of, first_crossing, refine_crossing, most_crossings

   !> Crossings in one step at most; what crosses more often grazes within round-off and is carried on as it is.
   integer, parameter :: most_crossings = 8

   !> Parts into which a step is divided to look for crossings.
   integer, parameter :: parts = 16

   !> Iterations that locate a zero of a polynomial at most; about eight reach round-off.
   integer, parameter :: most_iterations = 60

contains

   !> Branch of a mesh deflection: 1 contact, 0 gap, -1 back flank.
   pure function branch_of(deflection, half_backlash) result(branch)
      !> Mesh deflection [m].
      real(wp), intent(in) :: deflection
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> The branch.
      integer :: branch

      branch = 0
      if (deflection <= -half_backlash) branch = -1
      if (deflection >= half_backlash) branch = 1
   end function branch_of

   !> The first crossing of a border of the branch within a step.
   pure subroutine first_crossing(branch, deflection, half_backlash, where_crossed, next)
      !> Branch on which the step was solved.
      integer, intent(in) :: branch
      !> Mesh deflection at the points of the step [m].
      real(wp), intent(in) :: deflection(nodes)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Where, as a share of the step.
      real(wp), intent(out) :: where_crossed
      !> Branch behind the crossing; the same branch if there is none.
      integer, intent(out) :: next

      real(wp) :: other

      next = branch
      where_crossed = 1.0_wp
      if (branch /= 0) then
         call first_zero(real(branch, wp)*deflection - half_backlash, where_crossed)
         if (where_crossed < 1.0_wp) next = merge(0, -branch, half_backlash > 0.0_wp)
      else
         call first_zero(half_backlash - deflection, where_crossed)
         call first_zero(half_backlash + deflection, other)
         if (where_crossed < 1.0_wp) next = 1
         if (other < where_crossed) next = -1
         where_crossed = min(where_crossed, other)
      end if
   end subroutine first_crossing

   !> The first place where a clearance becomes negative, 1 if it does not within the step.
   pure subroutine first_zero(clearance, place)
      !> Clearance at the points of the step.
      real(wp), intent(in) :: clearance(nodes)
      !> The place, as a share of the step.
      real(wp), intent(out) :: place

      real(wp) :: c(0:nodes - 1), low, high, value(-1:parts + 1), vertex, curvature, smallest
      integer :: k

      place = 1.0_wp
      smallest = minval(clearance)
      ! The polynomial undershoots its points by less than they spread.
      if (smallest > maxval(clearance) - smallest) return
      c = matmul(lagrange, clearance)
      do k = -1, parts + 1
         value(k) = polynomial(c, real(k, wp)/real(parts, wp))
      end do
      do k = 0, parts
         if (k > 0 .and. value(k) < 0.0_wp) then
            high = real(k, wp)/real(parts, wp)
            exit
         end if
         ! A dip between the places looked at: the vertex of the parabola through three of them.
         curvature = value(k - 1) - 2.0_wp*value(k) + value(k + 1)
         if (value(k) <= value(k - 1) .and. value(k) <= value(k + 1) .and. curvature > 0.0_wp) then
            vertex = (real(k, wp) + 0.5_wp*(value(k - 1) - value(k + 1))/curvature)/real(parts, wp)
            if (vertex > 0.0_wp .and. vertex < 1.0_wp .and. polynomial(c, vertex) < 0.0_wp) then
               high = vertex
               exit
            end if
         end if
         if (k == parts) return
      end do
      low = real(max(k - 1, 0), wp)/real(parts, wp)
      place = zero_between(c, low, high)
   end subroutine first_zero

   !> The zero of a polynomial that is positive at one end of an interval and negative at the other.
   pure function zero_between(c, positive, negative) result(place)
      !> Its coefficients, constant first.
      real(wp), intent(in) :: c(0:nodes - 1)
      !> The ends.
      real(wp), intent(in) :: positive, negative
      !> The zero.
      real(wp) :: place

      real(wp) :: low, high, at_low, at_high, value
      integer :: k, side

      ! False position; an end that stays twice loses half of its weight (the Illinois rule).
      low = positive
      high = negative
      at_low = max(polynomial(c, low), 0.0_wp)
      at_high = polynomial(c, high)
      place = low
      side = 0
      do k = 1, most_iterations
         if (.not. at_low - at_high > 0.0_wp) exit
         value = place
         place = (at_low*high - at_high*low)/(at_low - at_high)
         if (abs(place - value) <= epsilon(1.0_wp)) exit
         value = polynomial(c, place)
         if (value < 0.0_wp) then
            high = place
            at_high = value
            if (side < 0) at_low = 0.5_wp*at_low
            side = -1
         else
            low = place
            at_low = value
            if (side > 0) at_high = 0.5_wp*at_high
            side = 1
         end if
      end do
   end function zero_between

   !> Improve the place of a crossing from the deflection at the end of the part before it.
   pure subroutine refine_crossing(branch, next, deflection, half_backlash, longest, length, miss)
      !> Branches before and behind the crossing.
      integer, intent(in) :: branch, next
      !> Mesh deflection at the points of the part before the crossing [m].
      real(wp), intent(in) :: deflection(nodes)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> The longest part that there can be [s].
      real(wp), intent(in) :: longest
      !> Length of the part, improved [s].
      real(wp), intent(inout) :: length
      !> How far from the border the part ended [m].
      real(wp), intent(out) :: miss

      real(wp) :: border, slope, better
      integer :: m

      border = half_backlash*real(merge(branch, next, branch /= 0), wp)
      miss = deflection(nodes) - border
      slope = 0.0_wp
      do m = 1, nodes - 1
         slope = slope + real(m, wp)*sum(lagrange(m, :)*deflection)
      end do
      if (.not. abs(slope) > abs(miss)) return
      better = length*(1.0_wp - miss/slope)
      if (better > 0.0_wp .and. better < longest) length = better
   end subroutine refine_crossing

   !> A polynomial at a place.
   pure function polynomial(c, u) result(value)
      !> Its coefficients, constant first.
      real(wp), intent(in) :: c(0:nodes - 1)
      !> The place.
      real(wp), intent(in) :: u
      !> Its value there.
      real(wp) :: value

      integer :: m

      value = c(nodes - 1)
      do m = nodes - 2, 0, -1
         value = value*u + c(m)
      end do
   end function polynomial

end module spurflex_integrate_branch
