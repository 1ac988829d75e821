!> Newmark's method of average acceleration (beta = 1/4, gamma = 1/2) in lanes, a point in each.
!>
!> For linear parts in their modes it is the trapezoidal rule: with the acceleration taken from the equation of motion at the
!> start, both give the same states step by step,
!>
!>     z_j <- R_j z_j - B_j (N_0 + N_1),   R_j = (1 + lambda_j h/2)/(1 - lambda_j h/2),   B_j = (h/2) b_j/(1 - lambda_j h/2)
!>
!> The mesh force at the end is the root of one scalar equation of three straight branches, which is solved exactly.
!> Coefficients: R in `full`, B in the first point of `taken`, the sum of Re B in the first point of `end`.
module spurflex_integrate_lane_newmark
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_lane_rule, only: lanes, most_modes, lane_rule, point_rule, mesh_cycle, lane_gain, lane_record
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system
   implicit none
   private

   public :: new_newmark_rule, advance_newmark, carry_newmark

contains

   !> Coefficients of a step.
   pure subroutine new_newmark_rule(modal, equations, steps, rule)
      !> Modes of the linear part.
      type(modal_system), intent(in) :: modal
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The coefficients.
      type(point_rule), intent(out) :: rule

      complex(wp) :: half
      integer :: j

      rule%modes = modal%modes
      rule%static = equations%static_deflection
      rule%damping = equations%mesh%damping*equations%frequency
      rule%force = equations%mean_force
      do j = 1, modal%modes
         half = modal%rate(j)*pi/(equations%frequency*real(steps, wp))
         rule%full_re(j) = real((1.0_wp + half)/(1.0_wp - half), wp)
         rule%full_im(j) = aimag((1.0_wp + half)/(1.0_wp - half))
         half = modal%influence(j)*pi/(equations%frequency*real(steps, wp))/(1.0_wp - half)
         rule%taken_re(j, 1) = real(half, wp)
         if (.not. modal%is_real(j)) rule%taken_im(j, 1) = aimag(half)
      end do
      rule%end(1) = sum(rule%taken_re(:rule%modes, 1))
   end subroutine new_newmark_rule

   !> Advance every lane by one mesh period.
   subroutine advance_newmark(rule, pitch, states, smallest, largest, gain, record)
      !> Coefficients.
      type(lane_rule), intent(in) :: rule
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Real parts of the modes, then imaginary parts, shape (lanes, 2 modes).
      real(wp), intent(inout) :: states(lanes, 2*rule%modes)
      !> Extremes of the mesh deflection [m].
      real(wp), intent(out) :: smallest(lanes), largest(lanes)
      !> If present, the derivative of N by x at the ends of the steps for the tangents, in n(:, 1, 1, :) at the start and in
      !> n(:, 2, 1, :) at the end of each.
      type(lane_gain), intent(inout), optional :: gain
      !> If present, the ends of the steps are recorded.
      type(lane_record), intent(inout), optional :: record

      real(wp), dimension(lanes, most_modes) :: re, im, full_re, full_im, taken_re, taken_im
      real(wp), dimension(lanes) :: x, n, before, slope, free, static, damping, force, taken, in_gap
      real(wp) :: part_re, part_im
      integer :: s, l, j, modes

      modes = rule%modes
      ! Copies on the stack are aligned to the vectors.
      full_re(:, :modes) = rule%full_re(:, :modes)
      full_im(:, :modes) = rule%full_im(:, :modes)
      taken_re(:, :modes) = rule%taken_re(:, :modes, 1)
      taken_im(:, :modes) = rule%taken_im(:, :modes, 1)
      static = rule%static
      damping = rule%damping
      force = rule%force
      re(:, :modes) = states(:, :modes)
      im(:, :modes) = states(:, modes + 1:)
      free = 0.0_wp
      do j = 1, modes
         do l = 1, lanes
            free(l) = free(l) + re(l, j)
         end do
      end do
      taken = 0.0_wp
      in_gap = 1.0_wp
      call meet(pitch, 0, static, damping, force, taken, in_gap, free, x, n, slope)
      taken = rule%end(:, 1)
      in_gap = 1.0_wp/(1.0_wp - taken*pitch%mean_stiffness)
      smallest = static + pitch%error(0) + x
      largest = smallest
      if (present(record)) call keep(0)
      free = 0.0_wp
      do j = 1, modes
         do l = 1, lanes
            part_re = full_re(l, j)*re(l, j) - full_im(l, j)*im(l, j)
            im(l, j) = full_re(l, j)*im(l, j) + full_im(l, j)*re(l, j)
            re(l, j) = part_re
            free(l) = free(l) + part_re
         end do
      end do
      ! From here on re and im are the modes carried over the step that comes: one pass over them a step.
      do s = 1, pitch%steps
         if (present(gain)) gain%n(:, 1, 1, s) = slope
         do l = 1, lanes
            before(l) = n(l)
            free(l) = free(l) - taken(l)*n(l)
         end do
         call meet(pitch, 2*s, static, damping, force, taken, in_gap, free, x, n, slope)
         do l = 1, lanes
            before(l) = before(l) + n(l)
            free(l) = 0.0_wp
            smallest(l) = min(smallest(l), static(l) + pitch%error(2*s) + x(l))
            largest(l) = max(largest(l), static(l) + pitch%error(2*s) + x(l))
         end do
         if (present(gain)) gain%n(:, 2, 1, s) = slope
         if (s == pitch%steps .or. present(record)) then
            do j = 1, modes
               do l = 1, lanes
                  re(l, j) = re(l, j) - taken_re(l, j)*before(l)
                  im(l, j) = im(l, j) - taken_im(l, j)*before(l)
               end do
            end do
            if (present(record)) call keep(s)
            if (s == pitch%steps) exit
            before = 0.0_wp
         end if
         do j = 1, modes
            do l = 1, lanes
               part_re = re(l, j) - taken_re(l, j)*before(l)
               part_im = im(l, j) - taken_im(l, j)*before(l)
               re(l, j) = full_re(l, j)*part_re - full_im(l, j)*part_im
               im(l, j) = full_re(l, j)*part_im + full_im(l, j)*part_re
               free(l) = free(l) + re(l, j)
            end do
         end do
      end do
      states(:, :modes) = re(:, :modes)
      states(:, modes + 1:) = im(:, :modes)

   contains

      !> Record the end of a step.
      subroutine keep(step)
         !> The step, from 0 where the period begins.
         integer, intent(in) :: step

         record%re(:, :modes, step) = re(:, :modes)
         record%im(:, :modes, step) = im(:, :modes)
         record%force(:, step) = n
      end subroutine keep

   end subroutine advance_newmark

   !> Solve x + taken N(x) = free for the mesh at one place of the period.
   pure subroutine meet(pitch, place, static, damping, force, taken, in_gap, free, x, n, slope)
      !> The mesh.
      type(mesh_cycle), intent(in) :: pitch
      !> Index of the place in the cycle.
      integer, intent(in) :: place
      !> Static mesh deflection [m], c_m times the mesh frequency [N/m], mean mesh force [N].
      real(wp), intent(in) :: static(lanes), damping(lanes), force(lanes)
      !> What N takes from x [m/N].
      real(wp), intent(in) :: taken(lanes)
      !> 1/(1 - taken k_m0) [-].
      real(wp), intent(in) :: in_gap(lanes)
      !> x without N [m].
      real(wp), intent(in) :: free(lanes)
      !> g.q [m], N [N] and the derivative of N by x [N/m].
      real(wp), intent(out) :: x(lanes), n(lanes), slope(lanes)

      real(wp) :: offset, rest, side, stiffness, in_contact
      integer :: l

      do l = 1, lanes
         offset = static(l) + pitch%error(place)
         rest = damping(l)*pitch%error_rate(place) - force(l)
         ! On the branch of the gap; where that ends beyond a border the root is on the branch behind it, for x rises with free.
         x(l) = (free(l) - taken(l)*rest)*in_gap(l)
         in_contact = 1.0_wp/(1.0_wp + taken(l)*(pitch%stiffness(place) - pitch%mean_stiffness))
         side = merge(1.0_wp, 0.0_wp, offset + x(l) > pitch%half_backlash)
         side = merge(-1.0_wp, side, offset + x(l) < -pitch%half_backlash)
         stiffness = abs(side)*pitch%stiffness(place)
         slope(l) = stiffness - pitch%mean_stiffness
         rest = rest + stiffness*(offset - side*pitch%half_backlash)
         x(l) = (free(l) - taken(l)*rest)*merge(in_contact, in_gap(l), abs(side) > 0.5_wp)
         n(l) = slope(l)*x(l) + rest
      end do
   end subroutine meet

   !> Carry tangents of every lane over the period whose derivatives were taken.
   pure subroutine carry_newmark(rule, steps, gain, count, tangents)
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

      real(wp), dimension(lanes, most_modes) :: re, im, full_re, full_im, taken_re, taken_im
      real(wp), dimension(lanes) :: x, n, taken, free
      real(wp) :: carried
      integer :: c, s, j, l, modes

      modes = rule%modes
      full_re(:, :modes) = rule%full_re(:, :modes)
      full_im(:, :modes) = rule%full_im(:, :modes)
      taken_re(:, :modes) = rule%taken_re(:, :modes, 1)
      taken_im(:, :modes) = rule%taken_im(:, :modes, 1)
      taken = rule%end(:, 1)
      do c = 1, count
         re(:, :modes) = tangents(:, c, :modes)
         im(:, :modes) = tangents(:, c, modes + 1:)
         x = 0.0_wp
         do j = 1, modes
            do l = 1, lanes
               x(l) = x(l) + re(l, j)
            end do
         end do
         do s = 1, steps
            free = 0.0_wp
            do j = 1, modes
               do l = 1, lanes
                  carried = full_re(l, j)*re(l, j) - full_im(l, j)*im(l, j)
                  im(l, j) = full_re(l, j)*im(l, j) + full_im(l, j)*re(l, j)
                  re(l, j) = carried
                  free(l) = free(l) + carried
               end do
            end do
            do l = 1, lanes
               n(l) = gain%n(l, 1, 1, s)*x(l)
               x(l) = (free(l) - taken(l)*n(l))/(1.0_wp + taken(l)*gain%n(l, 2, 1, s))
               n(l) = n(l) + gain%n(l, 2, 1, s)*x(l)
            end do
            do j = 1, modes
               do l = 1, lanes
                  re(l, j) = re(l, j) - taken_re(l, j)*n(l)
                  im(l, j) = im(l, j) - taken_im(l, j)*n(l)
               end do
            end do
         end do
         tangents(:, c, :modes) = re(:, :modes)
         tangents(:, c, modes + 1:) = im(:, :modes)
      end do
   end subroutine carry_newmark

end module spurflex_integrate_lane_newmark
