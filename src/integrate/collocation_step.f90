!> One step of exponential collocation on one branch of the contact: a small linear system for the driving scalar N at the
!> points of the step, then linear maps of the state and of tangents.
module spurflex_integrate_collocation_step
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_exponential, only: step_coefficients, nodes, width
   use spurflex_integrate_mesh_table, only: mesh_points, branch_law
   implicit none
   private

   public :: solve_step, carry_state, carry_tangents

contains

   !> Solve one step on one branch: values of N and of x = g.q at its points.
   pure subroutine solve_step(step, mesh, branch, state, alpha, force, shift)
      !> Coefficients.
      type(step_coefficients), intent(in) :: step
      !> Mesh at its points.
      type(mesh_points), intent(in) :: mesh
      !> Branch: -1, 0 or 1.
      integer, intent(in) :: branch
      !> State at the start of the step.
      real(wp), intent(in), contiguous :: state(:)
      !> Derivative of N by x at each point.
      real(wp), intent(out) :: alpha(nodes)
      !> N and x at each point.
      real(wp), intent(out) :: force(nodes), shift(nodes)

      real(wp) :: gamma(nodes), free(nodes), matrix(2:nodes, 2:nodes + 1)
      integer :: i, j, m

      call branch_law(mesh, branch, alpha, gamma)
      m = size(state)/2
      shift(1) = sum(state(:m))
      force(1) = alpha(1)*shift(1) + gamma(1)
      do i = 2, nodes
         free(i) = sum(step%carry_re(:, i)*state(:m) - step%carry_im(:, i)*state(m + 1:)) - step%taken(i, 1)*force(1)
         matrix(i, nodes + 1) = alpha(i)*free(i) + gamma(i)
         do j = 2, nodes
            matrix(i, j) = alpha(i)*step%taken(i, j)
         end do
         matrix(i, i) = matrix(i, i) + 1.0_wp
      end do
      call eliminate(matrix)
      force(2:) = matrix(:, nodes + 1)
      do i = 2, nodes
         shift(i) = free(i) - sum(step%taken(i, 2:)*force(2:))
      end do
   end subroutine solve_step

   !> Gaussian elimination of a system whose matrix is near to one; right sides in the columns behind it.
   pure subroutine eliminate(matrix)
      !> Matrix and right sides before, solutions in place of the right sides after.
      real(wp), intent(inout), contiguous :: matrix(:, :)

      real(wp) :: factor
      integer :: i, k, n

      n = size(matrix, 1)
      do k = 1, n
         matrix(k, k + 1:) = matrix(k, k + 1:)/matrix(k, k)
         do i = 1, n
            if (i == k) cycle
            factor = matrix(i, k)
            matrix(i, k + 1:) = matrix(i, k + 1:) - factor*matrix(k, k + 1:)
         end do
      end do
   end subroutine eliminate

   !> Carry a state to one point of the step.
   pure subroutine carry_state(step, force, i, state)
      !> Coefficients.
      type(step_coefficients), intent(in) :: step
      !> N at each point.
      real(wp), intent(in) :: force(nodes)
      !> The point.
      integer, intent(in) :: i
      !> State at the start before, at the point after.
      real(wp), intent(inout), contiguous :: state(:)

      real(wp) :: re, im
      integer :: k, m

      m = size(state)/2
      do k = 1, m
         re = state(k)
         im = state(m + k)
         state(k) = step%carry_re(k, i)*re - step%carry_im(k, i)*im - sum(step%taken_re(k, :, i)*force)
         state(m + k) = step%carry_re(k, i)*im + step%carry_im(k, i)*re - sum(step%taken_im(k, :, i)*force)
      end do
   end subroutine carry_state

   !> Carry tangents over a step: the same linear maps, without what does not depend on the state.
   pure subroutine carry_tangents(step, alpha, tangents)
      !> Coefficients.
      type(step_coefficients), intent(in) :: step
      !> Derivative of N by x at each point.
      real(wp), intent(in) :: alpha(nodes)
      !> Tangents, one in a row, shape (tangents, size).
      real(wp), intent(inout), contiguous :: tangents(:, :)

      real(wp) :: matrix(2:nodes, 2:2*nodes), some(width, size(tangents, 2))
      integer :: i, j, k, first, m, n

      m = size(tangents, 2)/2
      matrix = 0.0_wp
      do i = 2, nodes
         do j = 2, nodes
            matrix(i, j) = alpha(i)*step%taken(i, j)
         end do
         matrix(i, i) = matrix(i, i) + 1.0_wp
         matrix(i, nodes + i - 1) = alpha(i)
      end do
      call eliminate(matrix(:, :2*nodes - 1))
      do first = 1, size(tangents, 1), width
         n = min(width, size(tangents, 1) - first + 1)
         do k = 1, 2*m
            some(:n, k) = tangents(first:first + n - 1, k)
            some(n + 1:, k) = 0.0_wp
         end do
         call carry_some(m, step%carry_re, step%carry_im, step%taken, step%taken_re(:, :, nodes), step%taken_im(:, :, nodes), &
                         alpha(1), matrix(:, nodes + 1:2*nodes - 1), some)
         do k = 1, 2*m
            tangents(first:first + n - 1, k) = some(:n, k)
         end do
      end do
   end subroutine carry_tangents

   !> Carry a vector register of tangents.
   pure subroutine carry_some(m, carry_re, carry_im, taken, taken_re, taken_im, alpha, law, tangents)
      !> Modes.
      integer, intent(in) :: m
      !> exp(lambda c_i h).
      real(wp), intent(in) :: carry_re(m, nodes), carry_im(m, nodes)
      !> What N takes from x at each point, and from the modes at the end.
      real(wp), intent(in) :: taken(nodes, nodes), taken_re(m, nodes), taken_im(m, nodes)
      !> Derivative of N by x at the start, and of N at the other points by what x would be there without N.
      real(wp), intent(in) :: alpha, law(2:nodes, 2:nodes)
      !> Tangents.
      real(wp), intent(inout) :: tangents(width, 2*m)

      real(wp) :: force(width, nodes), free(width, 2:nodes), re, im
      integer :: i, k, r

      force = 0.0_wp
      free = 0.0_wp
      do k = 1, m
         do r = 1, width
            force(r, 1) = force(r, 1) + tangents(r, k)
            free(r, 2) = free(r, 2) + carry_re(k, 2)*tangents(r, k) - carry_im(k, 2)*tangents(r, m + k)
            free(r, 3) = free(r, 3) + carry_re(k, 3)*tangents(r, k) - carry_im(k, 3)*tangents(r, m + k)
            free(r, 4) = free(r, 4) + carry_re(k, 4)*tangents(r, k) - carry_im(k, 4)*tangents(r, m + k)
            free(r, 5) = free(r, 5) + carry_re(k, 5)*tangents(r, k) - carry_im(k, 5)*tangents(r, m + k)
         end do
      end do
      do r = 1, width
         force(r, 1) = alpha*force(r, 1)
         free(r, 2) = free(r, 2) - taken(2, 1)*force(r, 1)
         free(r, 3) = free(r, 3) - taken(3, 1)*force(r, 1)
         free(r, 4) = free(r, 4) - taken(4, 1)*force(r, 1)
         free(r, 5) = free(r, 5) - taken(5, 1)*force(r, 1)
      end do
      do i = 2, nodes
         do r = 1, width
            force(r, i) = law(i, 2)*free(r, 2) + law(i, 3)*free(r, 3) + law(i, 4)*free(r, 4) + law(i, 5)*free(r, 5)
         end do
      end do
      do k = 1, m
         do r = 1, width
            re = tangents(r, k)
            im = tangents(r, m + k)
            tangents(r, k) = carry_re(k, nodes)*re - carry_im(k, nodes)*im &
                             - (taken_re(k, 1)*force(r, 1) + taken_re(k, 2)*force(r, 2) + taken_re(k, 3)*force(r, 3) &
                                + taken_re(k, 4)*force(r, 4) + taken_re(k, 5)*force(r, 5))
            tangents(r, m + k) = carry_re(k, nodes)*im + carry_im(k, nodes)*re &
                                 - (taken_im(k, 1)*force(r, 1) + taken_im(k, 2)*force(r, 2) + taken_im(k, 3)*force(r, 3) &
                                    + taken_im(k, 4)*force(r, 4) + taken_im(k, 5)*force(r, 5))
         end do
      end do
   end subroutine carry_some

end module spurflex_integrate_collocation_step
