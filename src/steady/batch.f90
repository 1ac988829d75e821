!> Small dense matrices of several seats, handled together: the seat is the first index, so that every operation is one of the
!> processor's vectors. LAPACK takes one matrix at a time, and for sixteen rows the calls cost more than the arithmetic.
module spurflex_steady_batch
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: batch, solve_batch, contracting

   !> Matrices in a batch.
   integer, parameter :: batch = 8

   !> Matrices that are squared side by side, one vector of the processor, and rows of a tile of the square.
   integer, parameter :: few = 4, tile = 4

   !> Logarithm of the norm of a power beyond which it will not shrink any more: no physical matrix is that far from normal.
   real(wp), parameter :: hopeless = 1000.0_wp

   !> A matrix whose norm, squared, is this far from one, or its reciprocal, is scaled before it is squared.
   real(wp), parameter :: far_from_one = 1.0e100_wp

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
      !> Matrices.
      real(wp), intent(in) :: matrix(batch, n, n)
      !> They do.
      logical, intent(out) :: it_does(batch)

      ! Rows and columns of zeros fill the last tile, and change nothing.
      real(wp) :: power(few, tile*((n + tile - 1)/tile), tile*((n + tile - 1)/tile))
      integer :: first

      do first = 1, batch, few
         power = 0.0_wp
         power(:, :n, :n) = matrix(first:first + few - 1, :, :)
         call shrink(n, size(power, 2), power, it_does(first:first + few - 1))
      end do
   end subroutine contracting

   !> The same of a few matrices, which fit into the processor's first cache together with their squares.
   pure subroutine shrink(rows, n, power, it_does)
      !> Rows in use; rows, a multiple of `tile`, of which the last are zero.
      integer, intent(in) :: rows, n
      !> The matrices; destroyed.
      real(wp), intent(inout) :: power(few, n, n)
      !> They do.
      logical, intent(out) :: it_does(few)

      real(wp) :: square(few, n, n)
      real(wp), dimension(few) :: norm, factor, logarithm, scaled_norm
      logical :: is_far(few)
      integer :: l, s

      it_does = .false.
      logarithm = 0.0_wp
      factor = 1.0_wp
      square = power
      call rescale(rows, n, square, factor, power, norm)
      do s = 0, most_squarings
         ! The power is kept near a norm of one and the logarithm of its norm apart, so that nothing overflows.
         do l = 1, few
            ! What is not finite never contracts; a power that vanishes has done so.
            factor(l) = 0.0_wp
            if (logarithm(l) >= hopeless) then
               cycle
            else if (.not. norm(l) < huge(1.0_wp)) then
               logarithm(l) = huge(1.0_wp)
            else if (.not. norm(l) > tiny(1.0_wp)) then
               logarithm(l) = -1.0_wp
            else
               logarithm(l) = 2.0_wp*logarithm(l) + 0.5_wp*log(norm(l))
               factor(l) = 1.0_wp/norm(l)
            end if
         end do
         it_does = it_does .or. logarithm < 0.0_wp
         if (all(it_does .or. logarithm >= hopeless)) exit
         is_far = factor > 0.0_wp .and. (norm > far_from_one .or. norm < 1.0_wp/far_from_one)
         if (any(is_far)) then
            square = power
            call rescale(rows, n, square, merge(1.0_wp/sqrt(max(norm, tiny(1.0_wp))), 1.0_wp, is_far), power, scaled_norm)
            where (is_far) factor = 1.0_wp/scaled_norm
         end if
         call multiply(n, power, square)
         call rescale(rows, n, square, factor, power, norm)
      end do
   end subroutine shrink

   !> Square matrices, a tile of four rows and two columns at once: what its elements share is read once.
   pure subroutine multiply(n, matrix, square)
      !> Rows, a multiple of `tile`.
      integer, intent(in) :: n
      !> Matrices.
      real(wp), intent(in) :: matrix(few, n, n)
      !> Their squares.
      real(wp), intent(out) :: square(few, n, n)

      real(wp), dimension(few) :: a1, a2, a3, a4, b1, b2, b3, b4
      integer :: i, j, k, l

      do j = 1, n, 2
         do i = 1, n, tile
            a1 = 0.0_wp
            a2 = 0.0_wp
            a3 = 0.0_wp
            a4 = 0.0_wp
            b1 = 0.0_wp
            b2 = 0.0_wp
            b3 = 0.0_wp
            b4 = 0.0_wp
            do k = 1, n
               ! If it were unrolled early, the compiler would not make one vector of this loop.
               !GCC$ unroll 1
               do l = 1, few
                  a1(l) = a1(l) + matrix(l, i, k)*matrix(l, k, j)
                  a2(l) = a2(l) + matrix(l, i + 1, k)*matrix(l, k, j)
                  a3(l) = a3(l) + matrix(l, i + 2, k)*matrix(l, k, j)
                  a4(l) = a4(l) + matrix(l, i + 3, k)*matrix(l, k, j)
                  b1(l) = b1(l) + matrix(l, i, k)*matrix(l, k, j + 1)
                  b2(l) = b2(l) + matrix(l, i + 1, k)*matrix(l, k, j + 1)
                  b3(l) = b3(l) + matrix(l, i + 2, k)*matrix(l, k, j + 1)
                  b4(l) = b4(l) + matrix(l, i + 3, k)*matrix(l, k, j + 1)
               end do
            end do
            square(:, i, j) = a1
            square(:, i + 1, j) = a2
            square(:, i + 2, j) = a3
            square(:, i + 3, j) = a4
            square(:, i, j + 1) = b1
            square(:, i + 1, j + 1) = b2
            square(:, i + 2, j + 1) = b3
            square(:, i + 3, j + 1) = b4
         end do
      end do
   end subroutine multiply

   !> Matrices times a factor each, and their norms. Rows of zeros in the middle and at the end, room for modes that a point has
   !> not, change no bit: each half of the rows has its own sum.
   pure subroutine rescale(rows, n, matrix, factor, scaled, norm)
      !> Rows in use, and rows.
      integer, intent(in) :: rows, n
      !> Matrices.
      real(wp), intent(in) :: matrix(few, n, n)
      !> Factors.
      real(wp), intent(in) :: factor(few)
      !> The products.
      real(wp), intent(out) :: scaled(few, n, n)
      !> Squares of the Frobenius norms of these.
      real(wp), intent(out) :: norm(few)

      real(wp), dimension(few) :: upper, lower
      integer :: half, i, j, l

      half = (rows + 1)/2
      upper = 0.0_wp
      lower = 0.0_wp
      do j = 1, n
         do i = 1, rows - half
            !GCC$ unroll 1
            do l = 1, few
               scaled(l, i, j) = factor(l)*matrix(l, i, j)
               scaled(l, half + i, j) = factor(l)*matrix(l, half + i, j)
               upper(l) = upper(l) + scaled(l, i, j)**2
               lower(l) = lower(l) + scaled(l, half + i, j)**2
            end do
         end do
         if (half > rows - half) then
            do l = 1, few
               scaled(l, half, j) = factor(l)*matrix(l, half, j)
               upper(l) = upper(l) + scaled(l, half, j)**2
            end do
         end if
         scaled(:, rows + 1:, j) = 0.0_wp
      end do
      norm = upper + lower
   end subroutine rescale

end module spurflex_steady_batch
