!> Small dense matrices of several seats, handled together: the seat is the first index, so that every operation is one of the
!> processor's vectors. LAPACK takes one matrix at a time, and for sixteen rows the calls cost more than the arithmetic.
module spurflex_steady_batch
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: batch, solve_batch, contracting

   !> Matrices in a batch.
   integer, parameter :: batch = 8

   !> Logarithm of the norm of a power beyond which it will not shrink any more: no physical matrix is that far from normal.
   real(wp), parameter :: hopeless = 1000.0_wp

   !> Squarings after which a matrix whose powers do not shrink counts as one that does not contract: the largest multiplier is
   !> then within 1e-9 of one, or beyond it.
   integer, parameter :: most_squarings = 32

contains

   !> Solve a system for each seat by Gaussian elimination with partial pivoting.
   pure subroutine solve_batch(n, matrix, right)
      !> Rows.
      integer, intent(in) :: n
      !> Matrices; destroyed.
      real(wp), intent(inout) :: matrix(batch, n, n)
      !> Right sides before, solutions after; not finite where a matrix is singular.
      real(wp), intent(inout) :: right(batch, n)

      real(wp), dimension(batch) :: largest, chosen, factor, above
      integer :: i, j, k, l

      do k = 1, n
         largest = abs(matrix(:, k, k))
         chosen = real(k, wp)
         do i = k + 1, n
            do l = 1, batch
               chosen(l) = merge(real(i, wp), chosen(l), abs(matrix(l, i, k)) > largest(l))
               largest(l) = max(largest(l), abs(matrix(l, i, k)))
            end do
         end do
         if (any(chosen > real(k, wp))) call swap_rows(n, k, chosen, matrix, right)
         do l = 1, batch
            factor(l) = 1.0_wp/matrix(l, k, k)
         end do
         do j = k + 1, n
            do l = 1, batch
               matrix(l, k, j) = matrix(l, k, j)*factor(l)
            end do
         end do
         do l = 1, batch
            right(l, k) = right(l, k)*factor(l)
         end do
         do j = k + 1, n
            above = matrix(:, k, j)
            do i = k + 1, n
               do l = 1, batch
                  matrix(l, i, j) = matrix(l, i, j) - matrix(l, i, k)*above(l)
               end do
            end do
         end do
         do i = k + 1, n
            do l = 1, batch
               right(l, i) = right(l, i) - matrix(l, i, k)*right(l, k)
            end do
         end do
      end do
      do k = n, 2, -1
         do i = 1, k - 1
            do l = 1, batch
               right(l, i) = right(l, i) - matrix(l, i, k)*right(l, k)
            end do
         end do
      end do
   end subroutine solve_batch

   !> Swap a row of each system with the one chosen for it.
   pure subroutine swap_rows(n, k, chosen, matrix, right)
      !> Rows, and the row.
      integer, intent(in) :: n, k
      !> The row that is chosen in each seat.
      real(wp), intent(in) :: chosen(batch)
      !> Matrices and right sides.
      real(wp), intent(inout) :: matrix(batch, n, n), right(batch, n)

      real(wp) :: kept
      integer :: j, l, other

      do l = 1, batch
         other = nint(chosen(l))
         if (other == k) cycle
         do j = k, n
            kept = matrix(l, k, j)
            matrix(l, k, j) = matrix(l, other, j)
            matrix(l, other, j) = kept
         end do
         kept = right(l, k)
         right(l, k) = right(l, other)
         right(l, other) = kept
      end do
   end subroutine swap_rows

   !> The powers of matrices shrink: all eigenvalues lie inside the unit circle.
   pure subroutine contracting(n, matrix, it_does)
      !> Rows.
      integer, intent(in) :: n
      !> Matrices; destroyed.
      real(wp), intent(inout) :: matrix(batch, n, n)
      !> They do.
      logical, intent(out) :: it_does(batch)

      real(wp) :: square(batch, n, n)
      real(wp), dimension(batch) :: norm, logarithm
      integer :: i, j, l, s

      it_does = .false.
      ! The power is kept of norm one and the logarithm of its norm apart, so that nothing overflows.
      logarithm = 0.0_wp
      do s = 0, most_squarings
         norm = 0.0_wp
         do j = 1, n
            do i = 1, n
               do l = 1, batch
                  norm(l) = norm(l) + matrix(l, i, j)**2
               end do
            end do
         end do
         do l = 1, batch
            ! What is not finite never contracts; a power that vanishes has done so.
            if (logarithm(l) >= hopeless) then
               norm(l) = 0.0_wp
            else if (.not. norm(l) < huge(1.0_wp)) then
               logarithm(l) = huge(1.0_wp)
               norm(l) = 0.0_wp
            else if (.not. norm(l) > tiny(1.0_wp)) then
               logarithm(l) = -1.0_wp
               norm(l) = 0.0_wp
            else
               logarithm(l) = 2.0_wp*logarithm(l) + 0.5_wp*log(norm(l))
               norm(l) = 1.0_wp/sqrt(norm(l))
            end if
         end do
         it_does = it_does .or. logarithm < 0.0_wp
         if (all(it_does .or. logarithm >= hopeless)) exit
         do j = 1, n
            do i = 1, n
               do l = 1, batch
                  matrix(l, i, j) = matrix(l, i, j)*norm(l)
               end do
            end do
         end do
         call multiply(n, matrix, square)
         matrix = square
      end do
   end subroutine contracting

   !> Square matrices. Four rows abreast read the element they share once.
   pure subroutine multiply(n, matrix, square)
      !> Rows.
      integer, intent(in) :: n
      !> Matrices.
      real(wp), intent(in) :: matrix(batch, n, n)
      !> Their squares.
      real(wp), intent(out) :: square(batch, n, n)

      real(wp), dimension(batch) :: first, second, third, fourth
      integer :: i, j, k, l

      do j = 1, n
         do i = 1, n - 3, 4
            first = 0.0_wp
            second = 0.0_wp
            third = 0.0_wp
            fourth = 0.0_wp
            do k = 1, n
               do l = 1, batch
                  first(l) = first(l) + matrix(l, i, k)*matrix(l, k, j)
                  second(l) = second(l) + matrix(l, i + 1, k)*matrix(l, k, j)
                  third(l) = third(l) + matrix(l, i + 2, k)*matrix(l, k, j)
                  fourth(l) = fourth(l) + matrix(l, i + 3, k)*matrix(l, k, j)
               end do
            end do
            square(:, i, j) = first
            square(:, i + 1, j) = second
            square(:, i + 2, j) = third
            square(:, i + 3, j) = fourth
         end do
         do i = n - mod(n, 4) + 1, n
            first = 0.0_wp
            do k = 1, n
               do l = 1, batch
                  first(l) = first(l) + matrix(l, i, k)*matrix(l, k, j)
               end do
            end do
            square(:, i, j) = first
         end do
      end do
   end subroutine multiply

end module spurflex_steady_batch
