!> Coefficients of an exponential collocation step against their integrals, and the Lagrange polynomials they come from.
module test_exponential
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_exponential, only: lagrange, node, nodes, set_step, step_coefficients
   use spurflex_model_modal, only: modal_system
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_exponential

   !> Precision of the integrals to compare with.
   integer, parameter :: qp = selected_real_kind(30)

   !> Points of Gauss's rule in a panel; with a panel for each unit of |lambda h| the rule is exact to quadruple precision.
   integer, parameter :: gauss_points = 20

   !> Round-off of the moments times what the coefficients of the Lagrange polynomials, up to 27, make of it.
   real(wp), parameter :: roundoff = 1.0e-13_wp

contains

   !> The tests of this suite.
   subroutine collect_exponential(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('points are those of Lobatto', test_points), &
                  new_unittest('Lagrange polynomials', test_lagrange), &
                  new_unittest('coefficients are their integrals', test_integrals), &
                  new_unittest('both sides of the change of method', test_seam), &
                  new_unittest('coefficients of a step taken again', test_reuse), &
                  new_unittest('modes add up in the mesh deflection', test_sum) &
                  ]
   end subroutine collect_exponential

   !> The inner points are the zeros of the derivative of the Legendre polynomial of degree four.
   subroutine test_points(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: tiny_error = 1.0e-15_wp
      real(wp) :: x
      integer :: i

      do i = 2, nodes - 1
         x = 2.0_wp*node(i) - 1.0_wp
         call check(error, 2.5_wp*(7.0_wp*x**3 - 3.0_wp*x), 0.0_wp, 10.0_wp*tiny_error, 'P4 at point '//to_text(i))
         if (allocated(error)) return
      end do
      call check(error, node(1) + node(nodes), 1.0_wp, tiny_error, 'ends')
   end subroutine test_points

   !> One at their own point, zero at the others; they add up to one and reproduce every power up to the fourth.
   subroutine test_lagrange(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: draws = 200
      type(random_stream) :: random
      real(wp) :: u, value(nodes)
      integer :: i, k, power

      do i = 1, nodes
         value = values(node(i))
         value(i) = value(i) - 1.0_wp
         call check(error, maxval(abs(value)), 0.0_wp, roundoff, 'at point '//to_text(i))
         if (allocated(error)) return
      end do
      do k = 1, draws
         call random%uniform(0.0_wp, 1.0_wp, u)
         value = values(u)
         call check(error, sum(value), 1.0_wp, roundoff, 'partition of unity')
         if (allocated(error)) return
         do power = 1, nodes - 1
            call check(error, sum(value*node**power), u**power, roundoff, 'power '//to_text(power))
            if (allocated(error)) return
         end do
      end do

   contains

      !> Values of the polynomials.
      pure function values(place) result(at_place)
         !> The place.
         real(wp), intent(in) :: place
         !> The values.
         real(wp) :: at_place(nodes)

         integer :: m

         at_place = 0.0_wp
         do m = nodes - 1, 0, -1
            at_place = at_place*place + lagrange(m, :)
         end do
      end function values

   end subroutine test_lagrange

   !> |lambda h| from 1e-8 to 1e3: undamped, damped by 15 %, damped by 90 %, real.
   subroutine test_integrals(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      complex(wp), parameter :: direction(4) = [(0.0_wp, 1.0_wp), (-0.15_wp, 0.98868599666425938_wp), &
                                                (-0.9_wp, 0.43588989435406736_wp), (-1.0_wp, 0.0_wp)]
      real(wp), parameter :: sizes(14) = [1.0e-8_wp, 1.0e-6_wp, 1.0e-4_wp, 1.0e-2_wp, 0.1_wp, 0.5_wp, 1.0_wp, 2.0_wp, 3.0_wp, &
                                          5.0_wp, 10.0_wp, 30.0_wp, 1.0e2_wp, 1.0e3_wp]
      integer :: i, k

      do k = 1, size(direction)
         do i = 1, size(sizes)
            call compare(sizes(i)*direction(k), 1.0_wp, error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_integrals

   !> The moments come from a series below |Re| + |Im| = 2 and from a recurrence above, point by point.
   subroutine test_seam(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: seam = 2.0_wp, beside = 1.0e-6_wp, step = 1.0e-3_wp
      complex(wp), parameter :: direction(3) = [(0.0_wp, 1.0_wp), (-0.5_wp, 0.5_wp), (-1.0_wp, 0.0_wp)]
      integer :: i, k

      do k = 1, size(direction)
         do i = 2, nodes
            call compare(seam*(1.0_wp - beside)/node(i)*direction(k), step, error)
            if (allocated(error)) return
            call compare(seam*(1.0_wp + beside)/node(i)*direction(k), step, error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_seam

   !> A step that was set before gives the same coefficients as a new one.
   subroutine test_reuse(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(step_coefficients) :: fresh, used
      type(modal_system) :: modal

      modal = one_mode((-1.0_wp, 10.0_wp))
      call set_step(modal, 0.3_wp, used)
      call set_step(modal, 0.1_wp, used)
      call set_step(modal, 0.1_wp, fresh)
      call check(error, maxval(abs(fresh%taken - used%taken)), 0.0_wp, tiny(1.0_wp), 'taken')
      if (allocated(error)) return
      call check(error, maxval(abs(fresh%carry_re - used%carry_re)), 0.0_wp, tiny(1.0_wp), 'carry')
   end subroutine test_reuse

   !> What the deflection loses is the sum of what the modes lose.
   subroutine test_sum(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(step_coefficients) :: step
      type(modal_system) :: modal
      integer :: i, j

      modal%modes = 3
      modal%rate = [(-1.0_wp, 10.0_wp), (-3.0_wp, 0.0_wp), (-0.1_wp, 2.0_wp)]
      modal%is_real = [.false., .true., .false.]
      modal%influence = [(0.5_wp, 0.25_wp), (1.0_wp, 0.0_wp), (-0.3_wp, 0.1_wp)]
      call set_step(modal, 0.2_wp, step)
      do j = 1, nodes
         do i = 2, nodes
            call check(error, step%taken(i, j), sum(step%taken_re(:, j, i)), roundoff*0.2_wp, 'point '//to_text(i))
            if (allocated(error)) return
         end do
         call check(error, step%taken(1, j), 0.0_wp, tiny(1.0_wp), 'nothing is lost at the start')
         if (allocated(error)) return
      end do
   end subroutine test_sum

   !> One mode that a unit force drives.
   pure function one_mode(rate) result(modal)
      !> Its eigenvalue.
      complex(wp), intent(in) :: rate
      !> The mode.
      type(modal_system) :: modal

      modal%modes = 1
      modal%rate = [rate]
      modal%is_real = [.not. abs(aimag(rate)) > 0.0_wp]
      modal%influence = [(1.0_wp, 0.0_wp)]
   end function one_mode

   !> Compare the coefficients of a step with their integrals.
   subroutine compare(x, length, error)
      !> lambda h.
      complex(wp), intent(in) :: x
      !> Length of the step.
      real(wp), intent(in) :: length
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(step_coefficients) :: step
      complex(qp) :: exact(nodes), carry, rate
      complex(wp) :: taken
      real(wp) :: scale
      integer :: i, j

      call set_step(one_mode(x/length), length, step)
      ! The eigenvalue as the step saw it, rounded to double precision.
      rate = cmplx(x/length, kind=qp)
      do i = 2, nodes
         exact = integrals(rate*real(length, qp), real(node(i), qp))
         carry = exp(rate*real(length, qp)*real(node(i), qp))
         ! A phase of |x| is known to |x| units of round-off.
         call check(error, abs(cmplx(step%carry_re(1, i), step%carry_im(1, i), wp) - cmplx(carry, kind=wp)), 0.0_wp, &
                    roundoff*max(1.0_wp, 1.0e-2_wp*abs(x)), 'exponential at |lambda h| = '//to_text(abs(x)))
         if (allocated(error)) return
         scale = real(maxval(abs(exact)), wp)
         do j = 1, nodes
            taken = cmplx(step%taken_re(1, j, i), step%taken_im(1, j, i), wp)/length
            call check(error, abs(taken - cmplx(exact(j), kind=wp)), 0.0_wp, roundoff*scale, &
                       'point '//to_text(i)//' from '//to_text(j)//' at |lambda h| = '//to_text(abs(x)))
            if (allocated(error)) return
         end do
      end do
   end subroutine compare

   !> int_0^c exp(x (c - u)) l_j(u) du for every j by Gauss's rule in quadruple precision.
   pure function integrals(x, c) result(total)
      !> lambda h.
      complex(qp), intent(in) :: x
      !> Upper end.
      real(qp), intent(in) :: c
      !> The integrals.
      complex(qp) :: total(nodes)

      real(qp) :: abscissa(gauss_points), weight(gauss_points), u, width, polynomial(nodes)
      integer :: panels, k, i, j, m

      call gauss(abscissa, weight)
      panels = 1 + ceiling(abs(x)*c)
      width = c/real(panels, qp)
      total = (0.0_qp, 0.0_qp)
      do k = 0, panels - 1
         do i = 1, gauss_points
            u = width*(real(k, qp) + abscissa(i))
            do j = 1, nodes
               polynomial(j) = 1.0_qp
               do m = 1, nodes
                  if (m /= j) polynomial(j) = polynomial(j)*(u - real(node(m), qp))/(real(node(j), qp) - real(node(m), qp))
               end do
            end do
            total = total + width*weight(i)*exp(x*(c - u))*polynomial
         end do
      end do
   end function integrals

   !> Points and weights of Gauss's rule on [0, 1], by Newton's method on the Legendre polynomial.
   pure subroutine gauss(abscissa, weight)
      !> Points.
      real(qp), intent(out) :: abscissa(gauss_points)
      !> Weights; they add up to one.
      real(qp), intent(out) :: weight(gauss_points)

      integer, parameter :: iterations = 12
      real(qp) :: x, before, value, next, slope
      integer :: i, k, m

      do i = 1, gauss_points
         x = cos(acos(-1.0_qp)*(real(i, qp) - 0.25_qp)/(real(gauss_points, qp) + 0.5_qp))
         do k = 1, iterations
            before = 1.0_qp
            value = x
            do m = 2, gauss_points
               next = (real(2*m - 1, qp)*x*value - real(m - 1, qp)*before)/real(m, qp)
               before = value
               value = next
            end do
            slope = real(gauss_points, qp)*(x*value - before)/(x**2 - 1.0_qp)
            x = x - value/slope
         end do
         abscissa(i) = 0.5_qp*(1.0_qp - x)
         weight(i) = 1.0_qp/((1.0_qp - x**2)*slope**2)
      end do
   end subroutine gauss

end module test_exponential
