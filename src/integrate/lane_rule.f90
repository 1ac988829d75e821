!> Points of the grid in the lanes of the processor's vectors: what a point brings into its lane, and what all share.
!>
!> The method is exponential collocation at three Lobatto points (order four) with a constant step. The modes of the linear
!> part are carried exactly; the scalar N that drives them is collocated at both ends and the middle of a step:
!>
!>     x_i = Re sum_j E_ij z_j - sum_k T_ik N_k,   z_j <- E_j z_j - sum_k W_jk N_k
module spurflex_integrate_lane_rule
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_exponential, only: set_point, width, last, nodes
   use spurflex_model_equations, only: equations_type
   use spurflex_model_mesh, only: mesh_stiffness, transmission_error, transmission_error_rate
   use spurflex_model_modal, only: modal_system
   use spurflex_model_parameters, only: mesh_excitation
   implicit none
   private

   public :: lanes, most_modes, points, abreast
   public :: lane_rule, mesh_cycle, lane_gain, lane_record, point_rule, new_point_rule, new_mesh_cycle, load_rule, copy_rule

   !> Lanes: one or two vectors of the processor.
   integer, parameter :: lanes = 8

   !> Places for modes: all real ones of eight degrees of freedom.
   integer, parameter :: most_modes = 16

   !> Points of a step: its start, its middle and its end.
   integer, parameter :: points = 3

   !> Coefficients of a step, a point in each lane.
   type :: lane_rule
      !> exp(lambda h/2) and exp(lambda h).
      real(wp), dimension(lanes, most_modes) :: half_re, half_im, full_re, full_im
      !> What N at each point takes from each mode over the step.
      real(wp), dimension(lanes, most_modes, points) :: taken_re, taken_im
      !> What N at each point takes from the mesh deflection in the middle and at the end of the step [m/N].
      real(wp), dimension(lanes, points) :: middle, end
      !> Static mesh deflection [m], c_m times the mesh frequency [N/m], mean mesh force [N].
      real(wp), dimension(lanes) :: static, damping, force
      !> Modes in use.
      integer :: modes = 0
   end type lane_rule

   !> The mesh over one period, the same for every point: at the ends and in the middle of every step.
   type :: mesh_cycle
      !> Steps per mesh period.
      integer :: steps = 0
      !> Mesh stiffness [N/m], transmission error [m] and its derivative by the phase [m], shape (0:2 steps).
      real(wp), allocatable :: stiffness(:), error(:), error_rate(:)
      !> Mean mesh stiffness [N/m], half of the backlash [m].
      real(wp) :: mean_stiffness = 0.0_wp, half_backlash = 0.0_wp
   end type mesh_cycle

   !> Derivative of N at the points of every step by what comes into the step: x at its start, and x in the middle and at the end
   !> as the modes alone carry it.
   type :: lane_gain
      !> Shape (lanes, points, points, steps).
      real(wp), allocatable :: n(:, :, :, :)
   end type lane_gain

   !> Steps of a record that are looked at together: it has room for this many from any of its steps on.
   integer, parameter :: abreast = 4

   !> A recorded period.
   type :: lane_record
      !> Modes at the ends of the steps, shape (lanes, most_modes, 0:steps + abreast - 1).
      real(wp), allocatable :: re(:, :, :), im(:, :, :)
      !> N there, shape (lanes, 0:steps + abreast - 1) [N].
      real(wp), allocatable :: force(:, :)
   end type lane_record

   !> Coefficients of a step of one point; the same as those of `lane_rule`.
   type :: point_rule
      integer :: modes = 0
      real(wp), dimension(most_modes) :: half_re = 0.0_wp, half_im = 0.0_wp, full_re = 0.0_wp, full_im = 0.0_wp
      real(wp), dimension(most_modes, points) :: taken_re = 0.0_wp, taken_im = 0.0_wp
      real(wp), dimension(points) :: middle = 0.0_wp, end = 0.0_wp
      real(wp) :: static = 0.0_wp, damping = 0.0_wp, force = 0.0_wp
   end type point_rule

   !> Places of the middle and of the end of a step among the points of `spurflex_integrate_exponential`.
   integer, parameter :: place_of_middle = 3, place_of_end = nodes

   !> Lagrange polynomials of the points 0, 1/2, 1: coefficients of the powers in a column.
   real(wp), parameter :: parabola(0:2, points) = reshape([1.0_wp, -3.0_wp, 2.0_wp, 0.0_wp, 4.0_wp, -4.0_wp, &
                                                           0.0_wp, -1.0_wp, 2.0_wp], [3, points])

contains

   !> Coefficients of a step.
   subroutine new_point_rule(modal, equations, steps, rule)
      !> Modes of the linear part.
      type(modal_system), intent(in) :: modal
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The coefficients.
      type(point_rule), intent(out) :: rule

      real(wp), dimension(width) :: y_re, y_im, b_re, b_im, carry_re, carry_im, taken
      real(wp), dimension(width, 0:last) :: moment_re, moment_im
      real(wp) :: h
      integer :: first, n, i, k

      rule%modes = modal%modes
      rule%static = equations%static_deflection
      rule%damping = equations%mesh%damping*equations%frequency
      rule%force = equations%mean_force
      h = 2.0_wp*pi/(equations%frequency*real(steps, wp))
      do first = 1, modal%modes, width
         n = min(width, modal%modes - first + 1)
         y_re = 0.0_wp
         y_im = 0.0_wp
         b_re = 0.0_wp
         b_im = 0.0_wp
         y_re(:n) = h*real(modal%rate(first:first + n - 1), wp)
         y_im(:n) = h*aimag(modal%rate(first:first + n - 1))
         b_re(:n) = h*real(modal%influence(first:first + n - 1), wp)
         b_im(:n) = h*aimag(modal%influence(first:first + n - 1))
         call set_point(place_of_middle, y_re, y_im, b_re, b_im, carry_re, carry_im, moment_re, moment_im)
         rule%half_re(first:first + n - 1) = carry_re(:n)
         rule%half_im(first:first + n - 1) = carry_im(:n)
         do i = 1, points
            rule%middle(i) = rule%middle(i) + sum(weighed(moment_re, i))
         end do
         call set_point(place_of_end, y_re, y_im, b_re, b_im, carry_re, carry_im, moment_re, moment_im)
         rule%full_re(first:first + n - 1) = carry_re(:n)
         rule%full_im(first:first + n - 1) = carry_im(:n)
         do i = 1, points
            taken = weighed(moment_re, i)
            rule%taken_re(first:first + n - 1, i) = taken(:n)
            taken = weighed(moment_im, i)
            rule%taken_im(first:first + n - 1, i) = taken(:n)
         end do
      end do
      do i = 1, points
         rule%end(i) = sum(rule%taken_re(:rule%modes, i))
      end do
      ! The imaginary part of a real mode means nothing: what is put there is forgotten at once.
      do k = 1, modal%modes
         if (.not. modal%is_real(k)) cycle
         rule%taken_im(k, :) = 0.0_wp
      end do
   end subroutine new_point_rule

   !> Integral over a step of the polynomial that is one at a point and zero at the others.
   pure function weighed(moment, point) result(integral)
      !> Integrals of the powers, shape (width, 0:last).
      real(wp), intent(in) :: moment(width, 0:last)
      !> The point.
      integer, intent(in) :: point
      !> For each mode.
      real(wp) :: integral(width)

      integral = moment(:, 0)*parabola(0, point) + moment(:, 1)*parabola(1, point) + moment(:, 2)*parabola(2, point)
   end function weighed

   !> The mesh over one period.
   pure subroutine new_mesh_cycle(mesh, steps, pitch)
      !> Mesh.
      type(mesh_excitation), intent(in) :: mesh
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The mesh at the ends and in the middle of every step.
      type(mesh_cycle), intent(out) :: pitch

      real(wp) :: phase
      integer :: k

      pitch%steps = steps
      pitch%mean_stiffness = mesh%mean_stiffness
      pitch%half_backlash = mesh%half_backlash
      allocate (pitch%stiffness(0:2*steps), pitch%error(0:2*steps), pitch%error_rate(0:2*steps))
      do k = 0, 2*steps
         phase = pi*real(k, wp)/real(steps, wp)
         pitch%stiffness(k) = mesh_stiffness(mesh, phase)
         pitch%error(k) = transmission_error(mesh, phase)
         pitch%error_rate(k) = transmission_error_rate(mesh, phase)
      end do
   end subroutine new_mesh_cycle

   !> Put a point into a lane.
   pure subroutine load_rule(rule, lane, point)
      !> Coefficients of all lanes, with the number of modes that there is room for.
      type(lane_rule), intent(inout) :: rule
      !> Lane.
      integer, intent(in) :: lane
      !> Coefficients of the point.
      type(point_rule), intent(in) :: point

      integer :: i, j

      do j = 1, rule%modes
         rule%half_re(lane, j) = point%half_re(j)
         rule%half_im(lane, j) = point%half_im(j)
         rule%full_re(lane, j) = point%full_re(j)
         rule%full_im(lane, j) = point%full_im(j)
         do i = 1, points
            rule%taken_re(lane, j, i) = point%taken_re(j, i)
            rule%taken_im(lane, j, i) = point%taken_im(j, i)
         end do
      end do
      rule%middle(lane, :) = point%middle
      rule%end(lane, :) = point%end
      rule%static(lane) = point%static
      rule%damping(lane) = point%damping
      rule%force(lane) = point%force
   end subroutine load_rule

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

end module spurflex_integrate_lane_rule
