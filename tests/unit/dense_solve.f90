!> Solutions of small dense systems by LAPACK, for results to compare with.
module dense_solve
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: solve

   !> Solution of a system of linear equations; the matrix must not be singular.
   interface solve
      module procedure :: solve_real
      module procedure :: solve_complex
   end interface solve

   interface
      !> Real system.
      subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         integer, intent(in) :: n, nrhs, lda, ldb
         real(wp), intent(inout) :: a(lda, n), b(ldb, nrhs)
         integer, intent(out) :: ipiv(n), info
      end subroutine dgesv

      !> Complex system.
      subroutine zgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
         import :: wp
         integer, intent(in) :: n, nrhs, lda, ldb
         complex(wp), intent(inout) :: a(lda, n), b(ldb, nrhs)
         integer, intent(out) :: ipiv(n), info
      end subroutine zgesv
   end interface

contains

   !> Solution of a real system.
   function solve_real(matrix, right) result(x)
      !> Matrix, shape (n, n).
      real(wp), intent(in) :: matrix(:, :)
      !> Right-hand side, shape (n).
      real(wp), intent(in) :: right(:)
      !> Solution, shape (n).
      real(wp) :: x(size(right))

      real(wp) :: a(size(right), size(right)), b(size(right), 1)
      integer :: pivots(size(right)), n, info

      n = size(right)
      a = matrix
      b(:, 1) = right
      call dgesv(n, 1, a, n, pivots, b, n, info)
      if (info /= 0) error stop 'a test solves a singular real system'
      x = b(:, 1)
   end function solve_real

   !> Solution of a complex system.
   function solve_complex(matrix, right) result(x)
      !> Matrix, shape (n, n).
      complex(wp), intent(in) :: matrix(:, :)
      !> Right-hand side, shape (n).
      complex(wp), intent(in) :: right(:)
      !> Solution, shape (n).
      complex(wp) :: x(size(right))

      complex(wp) :: a(size(right), size(right)), b(size(right), 1)
      integer :: pivots(size(right)), n, info

      n = size(right)
      a = matrix
      b(:, 1) = right
      call zgesv(n, 1, a, n, pivots, b, n, info)
      if (info /= 0) error stop 'a test solves a singular complex system'
      x = b(:, 1)
   end function solve_complex

end module dense_solve
