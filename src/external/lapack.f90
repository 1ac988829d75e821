!> Typed wrappers over LAPACK that turn `info` into an error.
module spurflex_external_lapack
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   implicit none
   private

   public :: invert_positive_definite

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

end module spurflex_external_lapack
