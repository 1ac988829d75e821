!> Typed wrappers over LAPACK that turn `info` into an error.
module spurflex_external_lapack
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   implicit none
   private

   public :: invert_positive_definite, invert_complex, eigenvalues, eigenvectors, solve_real, solve_banded

   !> Work space of `dgeev` per row of the matrix.
   integer, parameter :: work_per_row = 8

   interface
      !> Cholesky factorisation.
      subroutine dpotrf(uplo, n, a, lda, info)
         import :: wp
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotrf

      !> Inverse from the Cholesky factor.
      subroutine dpotri(uplo, n, a, lda, info)
         import :: wp
         character(len=1), intent(in) :: uplo
         integer, intent(in) :: n, lda
         real(wp), intent(inout) :: a(lda, *)
         integer, intent(out) :: info
      end subroutine dpotri

      !> Eigenvalues and eigenvectors of a general matrix.
      subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
         import :: wp
         character(len=1), intent(in) :: jobvl, jobvr
         integer, intent(in) :: n, lda, ldvl, ldvr, lwork
         real(wp), intent(inout) :: a(lda, *), wr(*), wi(*), vl(ldvl, *), vr(ldvr, *), work(*)
         integer, intent(out) :: info
      end subroutine dgeev

      !> Solution of complex linear equations.
      subroutine zgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         integer, intent(in) :: n, nrhs, lda, ldb
         complex(wp), intent(inout) :: a(lda, *), b(ldb, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine zgesv

      !> Solution of complex linear equations with a band matrix.
      subroutine zgbsv(n, kl, ku, nrhs, ab, ldab, ipiv, b, ldb, info)
         import :: wp
         integer, intent(in) :: n, kl, ku, nrhs, ldab, ldb
         complex(wp), intent(inout) :: ab(ldab, *), b(ldb, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine zgbsv

      !> Solution of real linear equations.
      subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(inout) :: a(lda, *), b(ldb, *)
         integer, intent(out) :: ipiv(*), info
      end subroutine dgesv
   end interface

contains

   !> Inverse of a symmetric positive definite matrix.
   subroutine invert_positive_definite(matrix, inverse, error)
      !> The matrix, shape (n, n).
      real(wp), intent(in) :: matrix(:, :)
      !> Its inverse, shape (n, n).
      real(wp), allocatable, intent(out) :: inverse(:, :)
      !> Set where the matrix is not positive definite.
      type(error_type), allocatable, intent(out) :: error

      integer :: n, info, j

      n = size(matrix, 1)
      inverse = matrix
      call dpotrf('L', n, inverse, n, info)
      if (info == 0) call dpotri('L', n, inverse, n, info)
      if (info /= 0) then
         call fatal_error(error, 'a matrix that must be positive definite is not (leading minor '//to_text(info)//')')
         return
      end if
      do j = 2, n
         inverse(:j - 1, j) = inverse(j, :j - 1)
      end do
   end subroutine invert_positive_definite

   !> Eigenvalues and right eigenvectors of a general real matrix.
   subroutine eigenvectors(matrix, values, vectors, error)
      !> The matrix, shape (n, n).
      real(wp), intent(in) :: matrix(:, :)
      !> Eigenvalues, conjugate pairs next to each other, shape (n).
      complex(wp), allocatable, intent(out) :: values(:)
      !> Eigenvectors in columns, shape (n, n).
      complex(wp), allocatable, intent(out) :: vectors(:, :)
      !> Set where the iteration does not converge.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: a(size(matrix, 1), size(matrix, 1)), right(size(matrix, 1), size(matrix, 1))
      real(wp) :: re(size(matrix, 1)), im(size(matrix, 1)), left(1, 1), work(work_per_row*size(matrix, 1))
      integer :: n, info, j

      n = size(matrix, 1)
      a = matrix
      call dgeev('N', 'V', n, a, n, re, im, left, 1, right, n, work, size(work), info)
      if (info /= 0) then
         call fatal_error(error, 'the eigenvalues of a matrix do not converge (code '//to_text(info)//')')
         return
      end if
      allocate (values(n), vectors(n, n))
      values = cmplx(re, im, wp)
      do j = 1, n
         if (im(j) > 0.0_wp) then
            vectors(:, j) = cmplx(right(:, j), right(:, j + 1), wp)
            vectors(:, j + 1) = conjg(vectors(:, j))
         else if (.not. im(j) < 0.0_wp) then
            vectors(:, j) = cmplx(right(:, j), 0.0_wp, wp)
         end if
      end do
   end subroutine eigenvectors

   !> Eigenvalues of a general real matrix.
   subroutine eigenvalues(matrix, values, error)
      !> The matrix, shape (n, n).
      real(wp), intent(in) :: matrix(:, :)
      !> Eigenvalues, shape (n).
      complex(wp), allocatable, intent(out) :: values(:)
      !> Set where the iteration does not converge.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: a(size(matrix, 1), size(matrix, 1)), re(size(matrix, 1)), im(size(matrix, 1))
      real(wp) :: none(1, 1), work(work_per_row*size(matrix, 1))
      integer :: n, info

      n = size(matrix, 1)
      a = matrix
      call dgeev('N', 'N', n, a, n, re, im, none, 1, none, 1, work, size(work), info)
      if (info /= 0) then
         call fatal_error(error, 'the eigenvalues of a matrix do not converge (code '//to_text(info)//')')
         return
      end if
      allocate (values(n))
      values = cmplx(re, im, wp)
   end subroutine eigenvalues

   !> Inverse of a complex matrix.
   subroutine invert_complex(matrix, inverse, error)
      !> The matrix, shape (n, n).
      complex(wp), intent(in) :: matrix(:, :)
      !> Its inverse, shape (n, n).
      complex(wp), allocatable, intent(out) :: inverse(:, :)
      !> Set where the matrix is singular.
      type(error_type), allocatable, intent(out) :: error

      complex(wp) :: a(size(matrix, 1), size(matrix, 1))
      integer :: pivots(size(matrix, 1)), n, info, i

      n = size(matrix, 1)
      a = matrix
      allocate (inverse(n, n), source=(0.0_wp, 0.0_wp))
      do i = 1, n
         inverse(i, i) = (1.0_wp, 0.0_wp)
      end do
      call zgesv(n, n, a, n, pivots, inverse, n, info)
      if (info /= 0) call fatal_error(error, 'a matrix is singular (pivot '//to_text(info)//')')
   end subroutine invert_complex

   !> Solve real linear equations in place.
   subroutine solve_real(matrix, right_side, error)
      !> The matrix, shape (n, n); destroyed.
      real(wp), intent(inout), contiguous :: matrix(:, :)
      !> Right side before, solution after, shape (n).
      real(wp), intent(inout), contiguous :: right_side(:)
      !> Set where the matrix is singular.
      type(error_type), allocatable, intent(out) :: error

      integer :: pivots(size(matrix, 1)), n, info

      n = size(matrix, 1)
      call dgesv(n, 1, matrix, n, pivots, right_side, n, info)
      if (info /= 0) call fatal_error(error, 'a matrix is singular (pivot '//to_text(info)//')')
   end subroutine solve_real

   !> Solve complex linear equations with a band matrix in place.
   subroutine solve_banded(width, band, right_side, error)
      !> Diagonals below the main one, and above it.
      integer, intent(in) :: width
      !> Column j holds column j of the matrix, its element i in row 2 width + 1 + i - j, shape (3 width + 1, n); destroyed.
      complex(wp), intent(inout), contiguous :: band(:, :)
      !> Right side before, solution after, shape (n).
      complex(wp), intent(inout), contiguous :: right_side(:)
      !> Set where the matrix is singular.
      type(error_type), allocatable, intent(out) :: error

      integer :: pivots(size(right_side)), n, info

      n = size(right_side)
      call zgbsv(n, width, width, 1, band, size(band, 1), pivots, right_side, n, info)
      if (info /= 0) call fatal_error(error, 'a band matrix is singular (pivot '//to_text(info)//')')
   end subroutine solve_banded

end module spurflex_external_lapack
