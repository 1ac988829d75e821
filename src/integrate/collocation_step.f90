!> One step of exponential collocation on one branch of the contact: a small linear system for the driving scalar N at the
!> points of the step, then linear maps of the state and of tangents.
module spurflex_integrate_collocation_step
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_exponential, only: step_coefficients, nodes
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

      real(wp) :: matrix(2:nodes, 2:2*nodes), force(size(tangents, 1), nodes), free(size(tangents, 1), 2:nodes)
      real(wp), dimension(size(tangents, 1)) :: re, im
      integer :: i, j, k, m

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
      force = 0.0_wp
      do k = 1, m
         force(:, 1) = force(:, 1) + alpha(1)*tangents(:, k)
      end do
      do i = 2, nodes
         free(:, i) = -step%taken(i, 1)*force(:, 1)
         do k = 1, m
            free(:, i) = free(:, i) + step%carry_re(k, i)*tangents(:, k) - step%carry_im(k, i)*tangents(:, m + k)
         end do
      end do
      do i = 2, nodes
         do j = 2, nodes
            force(:, i) = force(:, i) + matrix(i, nodes + j - 1)*free(:, j)
         end do
      end do
      do k = 1, m
         re = tangents(:, k)
         im = tangents(:, m + k)
         tangents(:, k) = step%carry_re(k, nodes)*re - step%carry_im(k, nodes)*im
         tangents(:, m + k) = step%carry_re(k, nodes)*im + step%carry_im(k, nodes)*re
         do j = 1, nodes
            tangents(:, k) = tangents(:, k) - step%taken_re(k, j, nodes)*force(:, j)
            tangents(:, m + k) = tangents(:, m + k) - step%taken_im(k, j, nodes)*force(:, j)
         end do
      end do
   end subroutine carry_tangents

end module spurflex_integrate_collocation_step
