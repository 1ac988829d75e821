!> The equations of the paper, integrated by an explicit Runge-Kutta method of order 8 with every border of the backlash located.
!>
!> Nothing here is shared with the integrators under test: the matrices are those of Eqs. (12)-(27), the coordinates the paper's,
!>
!>     x1, y1, x2, y2, xM, yM, thM, p = r1 th1 - r2 th2
!>
!> as deviations from the static equilibrium under the mean mesh stiffness. The free common rotation is left out. A step is
!> made on one branch of Eq. (4), whose formula goes on beyond its border, so that the right side is smooth; a step that
!> leaves the branch is made again up to the border.
module paper_flow
   use dormand_prince, only: stages, stage_time, stage_weight, step_weight, error_weight_5, error_weight_3
   use spurflex_base_kinds, only: wp, pi
   use spurflex_io_case, only: case_type
   use spurflex_model_mesh, only: mesh_stiffness, transmission_error, transmission_error_rate
   use spurflex_model_paper, only: coordinate_count, mass_matrix, stiffness_matrix, damping_matrix, mesh_direction, torque_vector
   use spurflex_model_parameters, only: mesh_excitation, operating_point, mesh_frequency, support_flexible
   implicit none
   private

   public :: flow_type, motion_seen, new_flow, advance_period, fixed_steps, length_of, n_state

   !> Coordinates; length of the state, positions and rates. On a rigid support those of the gearbox stay zero.
   integer, parameter :: n = 8, n_state = 2*n

   !> Place of each coordinate of the paper among these; 0 for the rotations of the gears.
   integer, parameter :: place(9) = [1, 2, 0, 3, 4, 0, 5, 6, 7]
   integer, parameter :: ix1 = 1, iy1 = 2, ix2 = 3, iy2 = 4, ixm = 5, iym = 6, itm = 7, ip = 8

   !> The equations at one operating point, and how finely they are integrated.
   type :: flow_type
      !> Mesh angular frequency [rad/s] and mesh period [s].
      real(wp) :: frequency = 0.0_wp, period = 0.0_wp
      !> Mesh excitation.
      type(mesh_excitation) :: mesh
      !> M^-1 K and M^-1 C without the mesh, shape (n, n).
      real(wp) :: stiffness(n, n) = 0.0_wp, damping(n, n) = 0.0_wp
      !> Gradient g of the mesh deflection, M^-1 g, shape (n).
      real(wp) :: direction(n) = 0.0_wp, drive(n) = 0.0_wp
      !> Mean mesh force [N], mesh deflection at the static equilibrium [m].
      real(wp) :: mean_force = 0.0_wp, static_deflection = 0.0_wp
      !> Static equilibrium measured from zero displacement, shape (n).
      real(wp) :: static(n) = 0.0_wp
      !> d_x1, d_y1, d_x2, d_y2 are this times the coordinates, Eqs. (6)-(7), shape (4, n).
      real(wp) :: bearing(4, n) = 0.0_wp
      !> What counts as one in each component of the state, shape (n_state).
      real(wp) :: unit(n_state) = 1.0_wp
      !> Components of the state that move.
      integer, allocatable :: active(:)
      !> Local error allowed in a step, in those units.
      real(wp) :: tolerance = 1.0e-12_wp
      !> Length of the next step [s].
      real(wp) :: step = 0.0_wp
      !> Steps made, crossings located.
      integer :: steps = 0, crossings = 0
      !> The integration broke down.
      logical :: failed = .false.
   end type flow_type

   !> What has been seen of a motion.
   type :: motion_seen
      !> Extremes of the deviation of y1 [m] and of the mesh deflection [m].
      real(wp) :: y1(2) = [huge(1.0_wp), -huge(1.0_wp)], deflection(2) = [huge(1.0_wp), -huge(1.0_wp)]
      !> Largest square of each bearing deformation [m2].
      real(wp) :: bearing_square(2) = 0.0_wp
      !> Integrals of y1 and of its square, time [m s, m2 s, s].
      real(wp) :: integral = 0.0_wp, integral_square = 0.0_wp, time = 0.0_wp
   end type motion_seen

   !> Quantities whose zeros are located in a step: rates of y1, of the squares of the bearing deformations, of the deflection.
   integer, parameter :: rate_y1 = 1, rate_bearing_1 = 2, rate_bearing_2 = 3, rate_deflection = 4

   !> Start of a step.
   type :: step_start
      !> Branch of Eq. (4): -1, 0 or 1.
      integer :: branch = 0
      !> Time since the section [s], length of the step [s].
      real(wp) :: time = 0.0_wp, length = 0.0_wp
      !> State and its rate, shape (n_state).
      real(wp) :: state(n_state) = 0.0_wp, slope(n_state) = 0.0_wp
   end type step_start

   !> A border counts as reached at this distance, in the unit of length.
   real(wp), parameter :: on_border = 1.0e-14_wp

   !> Deflections this near to a border, in the unit of length, are looked at more closely; far above the error of a cubic.
   real(wp), parameter :: near_border = 1.0e-2_wp

contains

   !> The equations of one operating point.
   function new_flow(case, point, tolerance) result(flow)
      !> Case.
      type(case_type), intent(in) :: case
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Local error of a step beside the unit of each component.
      real(wp), intent(in) :: tolerance
      !> The equations.
      type(flow_type) :: flow

      real(wp), dimension(coordinate_count(point), coordinate_count(point)) :: mass, stiffness, damping
      real(wp), dimension(coordinate_count(point)) :: direction, torque
      real(wp) :: length, radii(2)
      integer :: i, j

      mass = mass_matrix(case%gears, case%box, point)
      stiffness = stiffness_matrix(case%gears, case%box, point)
      damping = damping_matrix(case%gears, case%box, point)
      direction = mesh_direction(case%gears, point)
      torque = torque_vector(case%load, point)
      flow%mesh = case%gears%mesh
      flow%frequency = mesh_frequency(case%gears%teeth_1, point%speed)
      flow%period = 2.0_wp*pi/flow%frequency
      flow%tolerance = tolerance
      flow%step = flow%period/100.0_wp
      do j = 1, size(direction)
         if (place(j) == 0) cycle
         flow%direction(place(j)) = direction(j)
         flow%drive(place(j)) = direction(j)/mass(j, j)
         do i = 1, size(direction)
            if (place(i) == 0) cycle
            flow%stiffness(place(i), place(j)) = stiffness(i, j)/mass(i, i)
            flow%damping(place(i), place(j)) = damping(i, j)/mass(i, i)
         end do
      end do
      ! p'' = r1 th1'' - r2 th2'', and J th'' = T - g f_m for both gears.
      radii = [direction(3), direction(6)]
      flow%direction(ip) = 1.0_wp
      flow%drive(ip) = radii(1)**2/mass(3, 3) + radii(2)**2/mass(6, 6)
      flow%mean_force = (radii(1)*torque(3)/mass(3, 3) + radii(2)*torque(6)/mass(6, 6))/flow%drive(ip)
      flow%static_deflection = flow%mean_force/flow%mesh%mean_stiffness + sign(flow%mesh%half_backlash, flow%mean_force)
      call set_static(flow, case, point, stiffness, direction)

      flow%bearing(1, [ix1, ixm]) = [1.0_wp, -1.0_wp]
      flow%bearing(2, [iy1, iym, itm]) = [1.0_wp, -1.0_wp, case%box%gear_offset]
      flow%bearing(3, [ix2, ixm]) = [1.0_wp, -1.0_wp]
      flow%bearing(4, [iy2, iym, itm]) = [1.0_wp, -1.0_wp, -case%box%gear_offset]
      length = abs(flow%mean_force)/flow%mesh%mean_stiffness + flow%mesh%half_backlash
      flow%unit(:n) = length
      if (case%box%gear_offset > 0.0_wp) flow%unit(itm) = length/case%box%gear_offset
      flow%unit(n + 1:) = flow%unit(:n)*sqrt(flow%mesh%mean_stiffness*sum(flow%direction*flow%drive))
      flow%active = [(i, i=1, n_state)]
      if (size(direction) < 9) flow%active = [1, 2, 3, 4, 8, 9, 10, 11, 12, 16]
   end function new_flow

   !> Static equilibrium K q = -g F of the sprung coordinates; p makes the deflection right.
   !>
   !> Each bearing holds the mesh force, the supports hold its moment. Solved from the forces: the entries of K round the stiffness
   !> of a soft support away. K must agree nevertheless.
   subroutine set_static(flow, case, point, stiffness, direction)
      !> Equations.
      type(flow_type), intent(inout) :: flow
      !> Case.
      type(case_type), intent(in) :: case
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> K and g of the paper.
      real(wp), intent(in) :: stiffness(:, :), direction(:)

      real(wp), parameter :: agrees = 1.0e-8_wp
      real(wp) :: d(4), force(size(direction))
      integer :: i

      d = -flow%mean_force*flow%direction([ix1, iy1, ix2, iy2])/case%gears%bearing_stiffness([1, 1, 2, 2])
      if (point%support == support_flexible) then
         ! The forces of the bearings on the gearbox cancel, their moments add up.
         flow%static(itm) = case%box%gear_offset*(case%gears%bearing_stiffness(2)*d(4) - case%gears%bearing_stiffness(1)*d(2)) &
            /(case%box%support_offset**2*point%support_stiffness)
      end if
      flow%static([ix1, iy1, ix2, iy2]) = d
      flow%static(iy1) = flow%static(iy1) - case%box%gear_offset*flow%static(itm)
      flow%static(iy2) = flow%static(iy2) + case%box%gear_offset*flow%static(itm)
      flow%static(ip) = flow%static_deflection - dot_product(flow%direction(:itm), flow%static(:itm))

      force = 0.0_wp
      do i = 1, size(direction)
         if (place(i) > 0) force = force + stiffness(:, i)*flow%static(place(i))
      end do
      where (place(:size(direction)) > 0) force = force + direction*flow%mean_force
      flow%failed = maxval(abs(force)) > agrees*abs(flow%mean_force)
   end subroutine set_static

   !> Rate of a state on one branch of Eq. (4).
   pure function slope_of(flow, branch, time, state) result(slope)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Branch.
      integer, intent(in) :: branch
      !> Time since the section [s].
      real(wp), intent(in) :: time
      !> State.
      real(wp), intent(in) :: state(n_state)
      !> Its rate.
      real(wp) :: slope(n_state)

      real(wp) :: force
      integer :: j

      force = flow%mesh%damping*deflection_rate(flow, time, state) - flow%mean_force
      if (branch /= 0) force = force + mesh_stiffness(flow%mesh, flow%frequency*time) &
         *(deflection_of(flow, time, state) - real(branch, wp)*flow%mesh%half_backlash)
      slope(:n) = state(n + 1:)
      slope(n + 1:) = -flow%drive*force
      do j = 1, n
         slope(n + 1:) = slope(n + 1:) - flow%stiffness(:, j)*state(j) - flow%damping(:, j)*state(n + j)
      end do
   end function slope_of

   !> Mesh deflection, Eq. (3) [m].
   pure function deflection_of(flow, time, state) result(deflection)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Time since the section [s].
      real(wp), intent(in) :: time
      !> State.
      real(wp), intent(in) :: state(n_state)
      !> Deflection.
      real(wp) :: deflection

      deflection = flow%static_deflection + sum(flow%direction*state(:n)) + transmission_error(flow%mesh, flow%frequency*time)
   end function deflection_of

   !> Its rate [m/s].
   pure function deflection_rate(flow, time, state) result(rate)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Time since the section [s].
      real(wp), intent(in) :: time
      !> State.
      real(wp), intent(in) :: state(n_state)
      !> Rate.
      real(wp) :: rate

      rate = sum(flow%direction*state(n + 1:)) + flow%frequency*transmission_error_rate(flow%mesh, flow%frequency*time)
   end function deflection_rate

   !> One step, or a part of it, from its start.
   pure subroutine make_step(flow, from, length, state, error)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Start.
      type(step_start), intent(in) :: from
      !> Length [s].
      real(wp), intent(in) :: length
      !> State at the end.
      real(wp), intent(out) :: state(n_state)
      !> Estimated local error beside what is allowed.
      real(wp), intent(out), optional :: error

      real(wp) :: k(n_state, stages), e5(n_state), e3(n_state), s5, s3
      integer :: i, j

      k(:, 1) = from%slope
      do i = 2, stages
         state = from%state
         do j = 1, i - 1
            state = state + (length*stage_weight(j, i))*k(:, j)
         end do
         k(:, i) = slope_of(flow, from%branch, from%time + stage_time(i)*length, state)
      end do
      state = from%state
      do j = 1, stages
         state = state + (length*step_weight(j))*k(:, j)
      end do
      if (.not. present(error)) return
      e5 = 0.0_wp
      e3 = 0.0_wp
      do j = 1, stages
         e5 = e5 + error_weight_5(j)*k(:, j)
         e3 = e3 + error_weight_3(j)*k(:, j)
      end do
      s5 = sum((e5/flow%unit)**2)
      s3 = sum((e3/flow%unit)**2)
      error = 0.0_wp
      if (s5 > 0.0_wp) error = length*s5/sqrt(real(size(flow%active), wp)*(s5 + 0.01_wp*s3))/flow%tolerance
   end subroutine make_step

   !> Branch of Eq. (4) at a section.
   pure function branch_at(flow, deflection) result(branch)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Mesh deflection [m].
      real(wp), intent(in) :: deflection
      !> Branch.
      integer :: branch

      branch = 0
      if (deflection >= flow%mesh%half_backlash) branch = 1
      if (deflection <= -flow%mesh%half_backlash .and. flow%mesh%half_backlash > 0.0_wp) branch = -1
   end function branch_at

   !> Advance a state from section to section.
   subroutine advance_period(flow, state, seen)
      !> Equations; the length of the next step and the counts are kept in it.
      type(flow_type), intent(inout) :: flow
      !> State at the section.
      real(wp), intent(inout) :: state(n_state)
      !> If present, what is seen is added to it.
      type(motion_seen), intent(inout), optional :: seen

      integer, parameter :: most_steps = 200000
      real(wp), parameter :: safety = 0.9_wp, least = 0.2_wp, most = 4.0_wp, exponent = -1.0_wp/8.0_wp, least_error = 1.0e-10_wp
      type(step_start) :: now
      real(wp) :: rest, error, end_state(n_state), end_slope(n_state), part
      integer :: tries, next
      logical :: is_last

      now%state = state
      now%branch = branch_at(flow, deflection_of(flow, 0.0_wp, state))
      now%slope = slope_of(flow, now%branch, 0.0_wp, state)
      do tries = 1, most_steps
         rest = flow%period - now%time
         is_last = flow%step >= rest*(1.0_wp - 1.0e-6_wp)
         now%length = flow%step
         if (is_last) then
            now%length = rest
         else if (2.0_wp*flow%step > rest) then
            now%length = 0.5_wp*rest
         end if
         call make_step(flow, now, now%length, end_state, error)
         if (.not. error <= 1.0_wp) then
            flow%step = now%length*max(least, safety*error**exponent)
            if (.not. flow%step > epsilon(1.0_wp)*flow%period) exit
            cycle
         end if
         ! A step that was shortened to reach the section does not shorten the next one.
         rest = now%length*min(most, safety*max(error, least_error)**exponent)
         if (now%length < flow%step) rest = max(rest, flow%step)
         flow%step = rest
         end_slope = slope_of(flow, now%branch, now%time + now%length, end_state)
         call find_exit(flow, now, end_state, part, next)
         if (next /= now%branch) then
            is_last = .false.
            now%length = part
            call make_step(flow, now, now%length, end_state)
            flow%crossings = flow%crossings + 1
         end if
         if (present(seen)) call see_step(flow, now, end_state, seen)
         flow%steps = flow%steps + 1
         now%time = now%time + now%length
         now%state = end_state
         if (is_last) then
            state = end_state
            return
         end if
         if (next /= now%branch) then
            now%branch = next
            end_slope = slope_of(flow, next, now%time, end_state)
         end if
         now%slope = end_slope
      end do
      flow%failed = .true.
      state = end_state
   end subroutine advance_period

   !> Whether the deflection leaves its branch within a step, and where first.
   subroutine find_exit(flow, from, end_state, part, next)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Start of the step.
      type(step_start), intent(in) :: from
      !> State at its end.
      real(wp), intent(in) :: end_state(n_state)
      !> Time from the start to the border [s].
      real(wp), intent(out) :: part
      !> Branch beyond; the same as before if it is not left.
      integer, intent(out) :: next

      real(wp) :: value(2), rate(2), extreme, turn, state(n_state), low

      part = 0.0_wp
      next = from%branch
      if (.not. flow%mesh%half_backlash > 0.0_wp) return
      value(1) = deflection_of(flow, from%time, from%state)
      value(2) = deflection_of(flow, from%time + from%length, end_state)
      rate(1) = deflection_rate(flow, from%time, from%state)
      rate(2) = deflection_rate(flow, from%time + from%length, end_state)
      low = 0.0_wp
      if (rate(1)*rate(2) < 0.0_wp) then
         ! The deflection turns within the step: look where it does if that may be beyond a border.
         extreme = extreme_of_cubic(from%length, value, rate)
         if (near_exit(extreme) .or. beyond(value(2)) /= from%branch) then
            call locate_rate(flow, from, rate_deflection, rate, turn, state)
            next = beyond(deflection_of(flow, from%time + turn, state))
            if (next /= from%branch) then
               call locate_border(flow, from, border(next), 0.0_wp, turn, part)
               return
            end if
            low = turn
         end if
      end if
      next = beyond(value(2))
      if (next /= from%branch) call locate_border(flow, from, border(next), low, from%length, part)

   contains

      !> Branch that a deflection is on, as seen from the branch of the step.
      integer function beyond(deflection)
         !> Mesh deflection [m].
         real(wp), intent(in) :: deflection

         beyond = from%branch
         if (from%branch == 0) then
            if (deflection > flow%mesh%half_backlash) beyond = 1
            if (deflection < -flow%mesh%half_backlash) beyond = -1
         else if (real(from%branch, wp)*deflection < flow%mesh%half_backlash) then
            beyond = 0
         end if
      end function beyond

      !> The deflection at the border to another branch [m].
      real(wp) function border(next)
         !> The other branch.
         integer, intent(in) :: next

         border = real(from%branch + next, wp)*flow%mesh%half_backlash
      end function border

      !> A deflection that is beyond a border or near to one.
      logical function near_exit(deflection)
         !> Mesh deflection [m].
         real(wp), intent(in) :: deflection

         near_exit = abs(abs(deflection) - flow%mesh%half_backlash) < near_border*flow%unit(1)
         near_exit = near_exit .or. beyond(deflection) /= from%branch
      end function near_exit

   end subroutine find_exit

   !> Extreme of the cubic that has the values and rates of both ends, whose rates differ in sign.
   pure function extreme_of_cubic(h, value, rate) result(extreme)
      !> Length of the step.
      real(wp), intent(in) :: h
      !> Values and rates at both ends.
      real(wp), intent(in) :: value(2), rate(2)
      !> The extreme.
      real(wp) :: extreme

      integer, parameter :: bisections = 20
      real(wp) :: c2, c3, low, high, u
      integer :: k

      c2 = 3.0_wp*(value(2) - value(1)) - h*(2.0_wp*rate(1) + rate(2))
      c3 = -2.0_wp*(value(2) - value(1)) + h*(rate(1) + rate(2))
      low = 0.0_wp
      high = 1.0_wp
      do k = 1, bisections
         u = 0.5_wp*(low + high)
         if ((h*rate(1) + u*(2.0_wp*c2 + 3.0_wp*u*c3))*rate(1) > 0.0_wp) then
            low = u
         else
            high = u
         end if
      end do
      extreme = value(1) + u*(h*rate(1) + u*(c2 + u*c3))
   end function extreme_of_cubic

   !> Time from the start of a step to where the deflection has some value: Newton's method within a bracket.
   subroutine locate_border(flow, from, border, from_time, to_time, part)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Start of the step.
      type(step_start), intent(in) :: from
      !> The value [m].
      real(wp), intent(in) :: border
      !> Bracket [s].
      real(wp), intent(in) :: from_time, to_time
      !> Time [s].
      real(wp), intent(out) :: part

      integer, parameter :: most_tries = 60
      real(wp) :: low, high, side, miss, state(n_state), guess
      integer :: tries

      low = from_time
      high = to_time
      call make_step(flow, from, high, state)
      miss = deflection_of(flow, from%time + high, state) - border
      side = sign(1.0_wp, miss)
      part = high
      do tries = 1, most_tries
         if (abs(miss) <= on_border*flow%unit(1)) return
         if (miss*side > 0.0_wp) then
            high = part
         else
            low = part
         end if
         guess = part - miss/deflection_rate(flow, from%time + part, state)
         if (.not. (guess > low .and. guess < high)) guess = 0.5_wp*(low + high)
         if (.not. (guess > low .and. guess < high)) return
         part = guess
         call make_step(flow, from, part, state)
         miss = deflection_of(flow, from%time + part, state) - border
      end do
   end subroutine locate_border

   !> Time from the start of a step to where a rate vanishes: false position with halved weights (Illinois).
   subroutine locate_rate(flow, from, which, ends, part, state)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Start of the step.
      type(step_start), intent(in) :: from
      !> `rate_...`.
      integer, intent(in) :: which
      !> The rate at both ends; they differ in sign.
      real(wp), intent(in) :: ends(2)
      !> Time [s].
      real(wp), intent(out) :: part
      !> State there.
      real(wp), intent(out) :: state(n_state)

      integer, parameter :: most_tries = 60
      real(wp), parameter :: small = 1.0e-9_wp
      real(wp) :: low, high, f_low, f_high, f
      integer :: tries

      low = 0.0_wp
      high = from%length
      f_low = ends(1)
      f_high = ends(2)
      do tries = 1, most_tries
         part = (low*f_high - high*f_low)/(f_high - f_low)
         call make_step(flow, from, part, state)
         f = rate_of(flow, which, from%time + part, state)
         if (abs(f) <= small*maxval(abs(ends)) .or. abs(high - low) <= small*from%length) return
         if (f*f_high > 0.0_wp) then
            f_low = 0.5_wp*f_low
         else
            low = high
            f_low = f_high
         end if
         high = part
         f_high = f
      end do
   end subroutine locate_rate

   !> One of the rates.
   pure function rate_of(flow, which, time, state) result(rate)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> `rate_...`.
      integer, intent(in) :: which
      !> Time since the section [s].
      real(wp), intent(in) :: time
      !> State.
      real(wp), intent(in) :: state(n_state)
      !> The rate.
      real(wp) :: rate

      integer :: first

      select case (which)
      case (rate_y1)
         rate = state(n + iy1)
      case (rate_deflection)
         rate = deflection_rate(flow, time, state)
      case default
         first = merge(1, 3, which == rate_bearing_1)
         rate = sum(matmul(flow%bearing(first:first + 1, :), flow%static + state(:n)) &
                    *matmul(flow%bearing(first:first + 1, :), state(n + 1:)))
      end select
   end function rate_of

   !> See a step: both ends, the places where something turns, and Gauss points for the integrals.
   subroutine see_step(flow, from, end_state, seen)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Start of the step.
      type(step_start), intent(in) :: from
      !> State at its end.
      real(wp), intent(in) :: end_state(n_state)
      !> What is seen is added.
      type(motion_seen), intent(inout) :: seen

      real(wp), parameter :: gauss_time(5) = 0.5_wp + 0.5_wp*[ &
         -0.906179845938663992797626878299_wp, -0.538469310105683091036314420700_wp, 0.0_wp, &
         0.538469310105683091036314420700_wp, 0.906179845938663992797626878299_wp]
      real(wp), parameter :: gauss_weight(5) = 0.5_wp*[ &
         0.236926885056189087514264040720_wp, 0.478628670499366468041291514836_wp, 0.568888888888888888888888888889_wp, &
         0.478628670499366468041291514836_wp, 0.236926885056189087514264040720_wp]
      real(wp) :: ends(2), part, state(n_state)
      integer :: which, i

      call see_state(from%time, from%state)
      call see_state(from%time + from%length, end_state)
      do which = rate_y1, rate_deflection
         ends(1) = rate_of(flow, which, from%time, from%state)
         ends(2) = rate_of(flow, which, from%time + from%length, end_state)
         if (ends(1)*ends(2) >= 0.0_wp) cycle
         call locate_rate(flow, from, which, ends, part, state)
         call see_state(from%time + part, state)
      end do
      do i = 1, size(gauss_time)
         call make_step(flow, from, gauss_time(i)*from%length, state)
         seen%integral = seen%integral + gauss_weight(i)*from%length*state(iy1)
         seen%integral_square = seen%integral_square + gauss_weight(i)*from%length*state(iy1)**2
      end do
      seen%time = seen%time + from%length

   contains

      !> See a state.
      subroutine see_state(time, state)
         !> Time since the section [s].
         real(wp), intent(in) :: time
         !> State.
         real(wp), intent(in) :: state(n_state)

         real(wp) :: d(4), deflection

         d = matmul(flow%bearing, flow%static + state(:n))
         deflection = deflection_of(flow, time, state)
         seen%y1 = [min(seen%y1(1), state(iy1)), max(seen%y1(2), state(iy1))]
         seen%deflection = [min(seen%deflection(1), deflection), max(seen%deflection(2), deflection)]
         seen%bearing_square = max(seen%bearing_square, [d(1)**2 + d(2)**2, d(3)**2 + d(4)**2])
      end subroutine see_state

   end subroutine see_step

   !> Advance a state on the branch of contact by steps of one length: what the order of the method is seen from.
   subroutine fixed_steps(flow, count, state)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Steps in a mesh period.
      integer, intent(in) :: count
      !> State at the section.
      real(wp), intent(inout) :: state(n_state)

      type(step_start) :: now
      real(wp) :: end_state(n_state)
      integer :: i

      now%branch = 1
      now%length = flow%period/real(count, wp)
      now%state = state
      do i = 1, count
         now%time = real(i - 1, wp)*now%length
         now%slope = slope_of(flow, now%branch, now%time, now%state)
         call make_step(flow, now, now%length, end_state)
         now%state = end_state
      end do
      state = now%state
   end subroutine fixed_steps

   !> Length of a difference of states, its components in their units.
   pure function length_of(flow, difference) result(length)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> Difference.
      real(wp), intent(in) :: difference(n_state)
      !> Length [-].
      real(wp) :: length

      length = norm2(difference/flow%unit)
   end function length_of

end module paper_flow
