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
      !> What drives the modes, shape (modes).
      real(wp), allocatable :: influence_re(:), influence_im(:)
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
   real(wp), parameter :: small = 3.0_wp

   !> Terms of the series at most.
   integer, parameter :: most_terms = 30

   !> Last term of the series, beside the first, that still counts: round-off.
   real(wp), parameter :: last_term = 1.0e-17_wp

   !> Highest moment.
   integer, parameter :: last = nodes - 1

contains

   !> Compute the coefficients of a step.
   pure subroutine set_step(modal, length, step)
      !> The modes.
      type(modal_system), intent(in) :: modal
      !> Length of the step [s].
      real(wp), intent(in) :: length
      !> The coefficients.
      type(step_coefficients), intent(inout) :: step

      real(wp), dimension(modal%modes) :: y_re, y_im
      real(wp), dimension(modal%modes, 0:last) :: re, im
      real(wp) :: power, product
      integer :: i, j, m, k

      if (.not. allocated(step%carry_re)) call allocate_step(modal, step)
      step%length = length
      step%taken_re = 0.0_wp
      step%taken_im = 0.0_wp
      do i = 2, nodes
         y_re = node(i)*length*real(modal%rate, wp)
         y_im = node(i)*length*aimag(modal%rate)
         call small_moments(y_re, y_im, re, im, step%carry_re(:, i), step%carry_im(:, i))
         do k = 1, modal%modes
            if (abs(y_re(k)) + abs(y_im(k)) > small) then
               call large_moments(y_re(k), y_im(k), re(k, :), im(k, :), step%carry_re(k, i), step%carry_im(k, i))
            end if
         end do
         power = length
         do m = 0, last
            power = power*node(i)
            do k = 1, modal%modes
               product = power*(step%influence_re(k)*re(k, m) - step%influence_im(k)*im(k, m))
               im(k, m) = power*(step%influence_re(k)*im(k, m) + step%influence_im(k)*re(k, m))
               re(k, m) = product
            end do
         end do
         do j = 1, nodes
            do m = 0, last
               do k = 1, modal%modes
                  step%taken_re(k, j, i) = step%taken_re(k, j, i) + lagrange(m, j)*re(k, m)
                  step%taken_im(k, j, i) = step%taken_im(k, j, i) + lagrange(m, j)*im(k, m)
               end do
            end do
            step%taken(i, j) = sum(step%taken_re(:, j, i))
         end do
      end do
   end subroutine set_step

   !> Make room.
   pure subroutine allocate_step(modal, step)
      !> The modes.
      type(modal_system), intent(in) :: modal
      !> The coefficients.
      type(step_coefficients), intent(inout) :: step

      allocate (step%carry_re(modal%modes, nodes), source=1.0_wp)
      allocate (step%carry_im(modal%modes, nodes), source=0.0_wp)
      allocate (step%taken_re(modal%modes, nodes, nodes), step%taken_im(modal%modes, nodes, nodes), source=0.0_wp)
      allocate (step%influence_re(modal%modes), step%influence_im(modal%modes))
      step%influence_re = real(modal%influence, wp)
      step%influence_im = aimag(modal%influence)
   end subroutine allocate_step

   !> The moments of many small arguments: downwards from the series J_4 = 1/5 (1 + y/6 (1 + y/7 (1 + ...))).
   pure subroutine small_moments(y_re, y_im, re, im, carry_re, carry_im)
      !> Arguments, shape (n).
      real(wp), intent(in), contiguous :: y_re(:), y_im(:)
      !> J_0..J_4 of each, shape (n, 0:4); meaningless where the argument is large.
      real(wp), intent(out) :: re(size(y_re), 0:last), im(size(y_re), 0:last)
      !> exp(y) of each, shape (n).
      real(wp), intent(out) :: carry_re(size(y_re)), carry_im(size(y_re))

      real(wp), dimension(size(y_re)) :: sum_re, sum_im
      real(wp) :: largest, term, inverse, product
      integer :: k, m, terms

      largest = min(maxval(abs(y_re) + abs(y_im)), small)
      term = 1.0_wp
      do terms = 1, most_terms
         term = term*largest/real(terms + nodes, wp)
         if (term < last_term) exit
      end do
      sum_re = 1.0_wp
      sum_im = 0.0_wp
      do m = min(terms, most_terms), 1, -1
         inverse = 1.0_wp/real(m + nodes, wp)
         do k = 1, size(y_re)
            product = inverse*(sum_re(k)*y_re(k) - sum_im(k)*y_im(k))
            sum_im(k) = inverse*(sum_re(k)*y_im(k) + sum_im(k)*y_re(k))
            sum_re(k) = 1.0_wp + product
         end do
      end do
      re(:, last) = sum_re/real(nodes, wp)
      im(:, last) = sum_im/real(nodes, wp)
      do m = last, 1, -1
         inverse = 1.0_wp/real(m, wp)
         do k = 1, size(y_re)
            re(k, m - 1) = inverse*(y_re(k)*re(k, m) - y_im(k)*im(k, m) + 1.0_wp)
            im(k, m - 1) = inverse*(y_re(k)*im(k, m) + y_im(k)*re(k, m))
         end do
      end do
      carry_re = 1.0_wp + y_re*re(:, 0) - y_im*im(:, 0)
      carry_im = y_re*im(:, 0) + y_im*re(:, 0)
   end subroutine small_moments

   !> The moments of a large argument: upwards from J_0 = (exp(y) - 1)/y.
   pure subroutine large_moments(y_re, y_im, re, im, carry_re, carry_im)
      !> Argument.
      real(wp), intent(in) :: y_re, y_im
      !> J_0..J_4.
      real(wp), intent(out) :: re(0:last), im(0:last)
      !> exp(y).
      real(wp), intent(out) :: carry_re, carry_im

      complex(wp) :: y, inverse, moment
      integer :: m

      y = cmplx(y_re, y_im, wp)
      inverse = 1.0_wp/y
      moment = exp(y)
      carry_re = real(moment, wp)
      carry_im = aimag(moment)
      moment = (moment - 1.0_wp)*inverse
      do m = 0, last
         if (m > 0) moment = (real(m, wp)*moment - 1.0_wp)*inverse
         re(m) = real(moment, wp)
         im(m) = aimag(moment)
      end do
   end subroutine large_moments

end module spurflex_integrate_exponential
