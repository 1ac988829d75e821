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

   public :: step_coefficients, set_step, set_point, node, nodes, lagrange, width, last

   !> Points of a step.
   integer, parameter :: nodes = 5

   !> Modes, or tangents, that are taken together: one AVX-512 register or two AVX2 registers of doubles.
   integer, parameter :: width = 8

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
   real(wp), parameter :: small = 3.0_wp

   !> Terms of the series at most.
   integer, parameter :: most_terms = 30

   !> 1/m for the series and its recurrence.
   real(wp), parameter :: reciprocal(most_terms + nodes) = 1.0_wp/[ &
                             1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp, 7.0_wp, 8.0_wp, 9.0_wp, 10.0_wp, 11.0_wp, &
                             12.0_wp, 13.0_wp, 14.0_wp, 15.0_wp, 16.0_wp, 17.0_wp, 18.0_wp, 19.0_wp, 20.0_wp, 21.0_wp, &
                             22.0_wp, 23.0_wp, 24.0_wp, 25.0_wp, 26.0_wp, 27.0_wp, 28.0_wp, 29.0_wp, 30.0_wp, 31.0_wp, &
                             32.0_wp, 33.0_wp, 34.0_wp, 35.0_wp]

   !> Last term of the series, beside the first, that still counts: round-off.
   real(wp), parameter :: last_term = 1.0e-17_wp

   !> Highest moment.
   integer, parameter :: last = nodes - 1

contains

   !> Compute the coefficients of a step.
   pure subroutine set_step(modal, length, step, inner)
      !> The modes.
      type(modal_system), intent(in) :: modal
      !> Length of the step [s].
      real(wp), intent(in) :: length
      !> The coefficients.
      type(step_coefficients), intent(inout) :: step
      !> The modes will be wanted at the inner points too, not only at the end; they will if absent.
      logical, intent(in), optional :: inner

      real(wp), dimension(width) :: y_re, y_im, b_re, b_im, c_re, c_im
      real(wp), dimension(width, 0:last) :: moment_re, moment_im
      real(wp), dimension(width, nodes) :: t_re, t_im
      integer :: i, j, k, first, last_mode, n
      logical :: all_points

      all_points = .true.
      if (present(inner)) all_points = inner
      if (.not. allocated(step%carry_re)) call allocate_step(modal, step)
      step%length = length
      step%taken = 0.0_wp
      do first = 1, modal%modes, width
         last_mode = min(first + width - 1, modal%modes)
         n = last_mode - first + 1
         y_re = 0.0_wp
         y_im = 0.0_wp
         b_re = 0.0_wp
         b_im = 0.0_wp
         do k = 1, n
            y_re(k) = length*real(modal%rate(first + k - 1), wp)
            y_im(k) = length*aimag(modal%rate(first + k - 1))
            b_re(k) = length*real(modal%influence(first + k - 1), wp)
            b_im(k) = length*aimag(modal%influence(first + k - 1))
         end do
         do i = 2, nodes
            call set_point(i, y_re, y_im, b_re, b_im, c_re, c_im, moment_re, moment_im)
            step%carry_re(first:last_mode, i) = c_re(:n)
            step%carry_im(first:last_mode, i) = c_im(:n)
            call add_deflection(moment_re, step%taken(i, :))
            if (i < nodes .and. .not. all_points) cycle
            call take_polynomials(moment_re, t_re)
            call take_polynomials(moment_im, t_im)
            do j = 1, nodes
               step%taken_re(first:last_mode, j, i) = t_re(:n, j)
               step%taken_im(first:last_mode, j, i) = t_im(:n, j)
            end do
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
   end subroutine allocate_step

   !> What the moments take from the mesh deflection, for each value of N.
   pure subroutine add_deflection(moment, taken)
      !> Real parts of the moments.
      real(wp), intent(in) :: moment(width, 0:last)
      !> Sum over the modes so far, shape (nodes).
      real(wp), intent(inout) :: taken(nodes)

      real(wp) :: total(0:last)
      integer :: j, m

      do m = 0, last
         total(m) = ((moment(1, m) + moment(2, m)) + (moment(3, m) + moment(4, m))) &
                    + ((moment(5, m) + moment(6, m)) + (moment(7, m) + moment(8, m)))
      end do
      do j = 1, nodes
         taken(j) = taken(j) + sum(lagrange(:, j)*total)
      end do
   end subroutine add_deflection

   !> From moments of powers to moments of the Lagrange polynomials.
   pure subroutine take_polynomials(moment, taken)
      !> Moments of the powers.
      real(wp), intent(in) :: moment(width, 0:last)
      !> Moments of the polynomials.
      real(wp), intent(out) :: taken(width, nodes)

      integer :: j, k

      do j = 1, nodes
         do k = 1, width
            taken(k, j) = lagrange(0, j)*moment(k, 0) + lagrange(1, j)*moment(k, 1) + lagrange(2, j)*moment(k, 2) &
                          + lagrange(3, j)*moment(k, 3) + lagrange(4, j)*moment(k, 4)
         end do
      end do
   end subroutine take_polynomials

   !> Moments of the powers at one point of the step, a vector of modes at a time.
   pure subroutine set_point(i, x_re, x_im, b_re, b_im, carry_re, carry_im, re, im)
      !> The point.
      integer, intent(in) :: i
      !> lambda h.
      real(wp), intent(in) :: x_re(width), x_im(width)
      !> h b.
      real(wp), intent(in) :: b_re(width), b_im(width)
      !> exp(c_i lambda h).
      real(wp), intent(out) :: carry_re(width), carry_im(width)
      !> Moments of the powers, times h b.
      real(wp), intent(out) :: re(width, 0:last), im(width, 0:last)

      real(wp), dimension(width) :: y_re, y_im, power_re, power_im
      real(wp) :: product
      integer :: k, m

      do k = 1, width
         y_re(k) = node(i)*x_re(k)
         y_im(k) = node(i)*x_im(k)
         power_re(k) = b_re(k)
         power_im(k) = b_im(k)
      end do
      call small_moments(y_re, y_im, re, im)
      do k = 1, width
         carry_re(k) = 1.0_wp + y_re(k)*re(k, 0) - y_im(k)*im(k, 0)
         carry_im(k) = y_re(k)*im(k, 0) + y_im(k)*re(k, 0)
      end do
      if (any(abs(y_re) + abs(y_im) > small)) then
         do k = 1, width
            if (abs(y_re(k)) + abs(y_im(k)) > small) then
               call large_moments(y_re(k), y_im(k), re(k, :), im(k, :), carry_re(k), carry_im(k))
            end if
         end do
      end if
      do m = 0, last
         do k = 1, width
            power_re(k) = node(i)*power_re(k)
            power_im(k) = node(i)*power_im(k)
            product = power_re(k)*re(k, m) - power_im(k)*im(k, m)
            im(k, m) = power_re(k)*im(k, m) + power_im(k)*re(k, m)
            re(k, m) = product
         end do
      end do
   end subroutine set_point

   !> The moments of small arguments: downwards from the series J_4 = 1/5 (1 + y/6 (1 + y/7 (1 + ...))).
   pure subroutine small_moments(y_re, y_im, re, im)
      !> Arguments.
      real(wp), intent(in) :: y_re(width), y_im(width)
      !> J_0..J_4 of each; meaningless where the argument is large.
      real(wp), intent(out) :: re(width, 0:last), im(width, 0:last)

      real(wp), dimension(width) :: sum_re, sum_im
      real(wp) :: largest, term, inverse, product
      integer :: k, m, terms

      largest = 0.0_wp
      do k = 1, width
         largest = max(largest, abs(y_re(k)) + abs(y_im(k)))
      end do
      largest = min(largest, small)
      term = 1.0_wp
      do terms = 1, most_terms - 1
         term = term*largest*reciprocal(terms + nodes)
         if (term < last_term) exit
      end do
      sum_re = 1.0_wp
      sum_im = 0.0_wp
      do m = terms, 1, -1
         inverse = reciprocal(m + nodes)
         do k = 1, width
            product = inverse*(sum_re(k)*y_re(k) - sum_im(k)*y_im(k))
            sum_im(k) = inverse*(sum_re(k)*y_im(k) + sum_im(k)*y_re(k))
            sum_re(k) = 1.0_wp + product
         end do
      end do
      do k = 1, width
         re(k, last) = sum_re(k)*reciprocal(nodes)
         im(k, last) = sum_im(k)*reciprocal(nodes)
      end do
      do m = last, 1, -1
         inverse = reciprocal(m)
         do k = 1, width
            re(k, m - 1) = inverse*(y_re(k)*re(k, m) - y_im(k)*im(k, m) + 1.0_wp)
            im(k, m - 1) = inverse*(y_re(k)*im(k, m) + y_im(k)*re(k, m))
         end do
      end do
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
