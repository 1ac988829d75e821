!> Coefficients of one exponential collocation step.
!>
!> The linear part is carried by its modes exactly; what drives them, N, is the polynomial through its values at the
!> Lobatto points c_1 = 0 ... c_5 = 1 of the step. With x = lambda h
!>
!>     z(c_i h) = exp(c_i x) z(0) - b h sum_j N_j int_0^c_i exp(x (c_i - u)) l_j(u) du
!>
!> The integrals come from the moments J_m = int_0^1 exp(y (1 - u)) u^m du with y = c_i x: upwards from J_0 where |y| is
!> large, downwards from a series for J_4 where it is small, so that neither loses digits.
!> Reference for exponential integrators: M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209.
module spurflex_integrate_exponential
   use spurflex_base_kinds, only: wp
   use spurflex_model_modal, only: modal_system
   implicit none
   private

   public :: step_coefficients, set_step, node, nodes, lagrange

   !> Points of a step.
   integer, parameter :: nodes = 5

   !> Outer inner Lobatto point, (1 - sqrt(3/7))/2.
   real(wp), parameter :: c2 = 0.172673164646011428100853771876_wp

   !> The Lobatto points on [0, 1].
   real(wp), parameter :: node(nodes) = [0.0_wp, c2, 0.5_wp, 1.0_wp - c2, 1.0_wp]

   !> Coefficients of one step.
   type :: step_coefficients
      !> Length [s].
      real(wp) :: length = 0.0_wp
      !> exp(lambda c_i h), shape (modes, nodes).
      real(wp), allocatable :: carry_re(:, :), carry_im(:, :)
      !> What the value of N at point j takes from the mode at point i, shape (modes, j, i).
      real(wp), allocatable :: taken_re(:, :, :), taken_im(:, :, :)
      !> What it takes from the mesh deflection, shape (i, j).
      real(wp) :: taken(nodes, nodes) = 0.0_wp
   end type step_coefficients

   !> Coefficients of the Lagrange polynomials: l_j(u) = sum_m lagrange(m, j) u^m, shape (0:nodes-1, nodes).
   real(wp), parameter :: a = node(2), b = node(3), c = node(4)
   real(wp), parameter :: d1 = a*b*c, d2 = a*(a - b)*(a - c)*(a - 1.0_wp), d3 = b*(b - a)*(b - c)*(b - 1.0_wp), &
      d4 = c*(c - a)*(c - b)*(c - 1.0_wp), d5 = (1.0_wp - a)*(1.0_wp - b)*(1.0_wp - c)
   real(wp), parameter :: lagrange(0:nodes - 1, nodes) = reshape([ &
      d1/d1, -(a*b + a*c + b*c + a*b*c)/d1, (a + b + c + a*b + a*c + b*c)/d1, -(a + b + c + 1.0_wp)/d1, 1.0_wp/d1, &
      0.0_wp, -b*c/d2, (b*c + b + c)/d2, -(b + c + 1.0_wp)/d2, 1.0_wp/d2, &
      0.0_wp, -a*c/d3, (a*c + a + c)/d3, -(a + c + 1.0_wp)/d3, 1.0_wp/d3, &
      0.0_wp, -a*b/d4, (a*b + a + b)/d4, -(a + b + 1.0_wp)/d4, 1.0_wp/d4, &
      0.0_wp, -a*b*c/d5, (a*b + a*c + b*c)/d5, -(a + b + c)/d5, 1.0_wp/d5], [nodes, nodes])

   !> |y| below which the moments come from the series.
   real(wp), parameter :: small = 2.0_wp

   !> Terms of the series for J_4: |y|^k 4!/(k + 5)! is below round-off from there on for |y| <= `small`.
   integer, parameter :: terms = 22

contains

   !> Compute the coefficients of a step.
   pure subroutine set_step(modal, length, step)
      !> The modes.
      type(modal_system), intent(in) :: modal
      !> Length of the step [s].
      real(wp), intent(in) :: length
      !> The coefficients.
      type(step_coefficients), intent(inout) :: step

      complex(wp) :: moment(0:nodes - 1), carry, taken
      real(wp) :: power
      integer :: i, j, m, k

      if (.not. allocated(step%carry_re)) call allocate_step(modal%modes, step)
      step%length = length
      step%taken = 0.0_wp
      do k = 1, modal%modes
         do i = 2, nodes
            call moments(node(i)*length*modal%rate(k), moment, carry)
            step%carry_re(k, i) = real(carry, wp)
            step%carry_im(k, i) = aimag(carry)
            power = length
            do m = 0, nodes - 1
               power = power*node(i)
               moment(m) = power*modal%influence(k)*moment(m)
            end do
            do j = 1, nodes
               taken = sum(lagrange(:, j)*moment)
               step%taken_re(k, j, i) = real(taken, wp)
               step%taken_im(k, j, i) = aimag(taken)
               step%taken(i, j) = step%taken(i, j) + real(taken, wp)
            end do
         end do
      end do
   end subroutine set_step

   !> Make room.
   pure subroutine allocate_step(modes, step)
      !> Number of modes.
      integer, intent(in) :: modes
      !> The coefficients.
      type(step_coefficients), intent(inout) :: step

      allocate (step%carry_re(modes, nodes), source=1.0_wp)
      allocate (step%carry_im(modes, nodes), source=0.0_wp)
      allocate (step%taken_re(modes, nodes, nodes), step%taken_im(modes, nodes, nodes), source=0.0_wp)
   end subroutine allocate_step

   !> The moments J_m(y) = int_0^1 exp(y (1 - u)) u^m du, m = 0..4, and exp(y).
   pure subroutine moments(y, moment, exponential)
      !> Argument.
      complex(wp), intent(in) :: y
      !> J_0..J_4.
      complex(wp), intent(out) :: moment(0:nodes - 1)
      !> exp(y).
      complex(wp), intent(out) :: exponential

      integer, parameter :: last = nodes - 1
      complex(wp) :: inverse, total
      integer :: m, k

      if (abs(real(y, wp)) + abs(aimag(y)) > small) then
         exponential = exp(y)
         inverse = 1.0_wp/y
         moment(0) = (exponential - 1.0_wp)*inverse
         do m = 1, last
            moment(m) = (real(m, wp)*moment(m - 1) - 1.0_wp)*inverse
         end do
      else
         ! J_4 = 1/5 (1 + y/6 (1 + y/7 (1 + ...)))
         total = (1.0_wp, 0.0_wp)
         do k = terms, 1, -1
            total = 1.0_wp + total*y*(1.0_wp/real(k + last + 1, wp))
         end do
         moment(last) = total/real(last + 1, wp)
         do m = last, 1, -1
            moment(m - 1) = (y*moment(m) + 1.0_wp)/real(m, wp)
         end do
         exponential = 1.0_wp + y*moment(0)
      end if
   end subroutine moments

end module spurflex_integrate_exponential
