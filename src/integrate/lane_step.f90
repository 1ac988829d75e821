!> Several points of the grid advanced at once, a point in each lane of the processor's vectors.
module spurflex_integrate_lane_step
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_contact, only: set_law, solve, find_margin, set_gain, force_at, any_below_zero, &
      nothing_added
   use spurflex_integrate_lane_crossing, only: correct
   use spurflex_integrate_lane_rule, only: lanes, most_modes, points, lane_rule, copy_rule, mesh_cycle, lane_gain, lane_record
   implicit none
   private

   public :: advance_lanes

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
               free_middle(l) = free_middle(l) + (r%half_re(l, j)*re(l, j) - r%half_im(l, j)*im(l, j))
               carried_re(l, j) = r%full_re(l, j)*re(l, j) - r%full_im(l, j)*im(l, j)
               carried_im(l, j) = r%full_re(l, j)*im(l, j) + r%full_im(l, j)*re(l, j)
               free_end(l) = free_end(l) + carried_re(l, j)
            end do
         end do
         call set_law(r, pitch, 2*s - 2, x(:, 1), side, slope, rest)
         call solve(r, free_middle, free_end, slope, rest, x, n)
         call find_margin(r, pitch, 2*s - 2, side, x, margin)
         crosses = any_below_zero(margin)
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
