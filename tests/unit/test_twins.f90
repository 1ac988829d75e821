!> What is known of the rigid twins, and how points are compared with them.
module test_twins
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use spurflex_base_kinds, only: wp
   use spurflex_measure_response, only: empty_response, nan, response, status_diverged, status_settled
   use spurflex_sweep_chunk, only: chunk_type
   use spurflex_sweep_twins, only: new_twin_table, twin_table
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_twins

contains

   !> The tests of this suite.
   subroutine collect_twins(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('none are asked for', test_none), &
                  new_unittest('what is known and what is missing', test_known), &
                  new_unittest('eta of points and of failed ones', test_eta) &
                  ]
   end subroutine collect_twins

   !> A response with deformations.
   pure function found(deformation, relative_error) result(answer)
      !> Largest deformation of both bearings [m], and their relative error.
      real(wp), intent(in) :: deformation(2), relative_error
      !> The response.
      type(response) :: answer

      answer = empty_response()
      answer%status = status_settled
      answer%bearing_deformation_max = deformation
      answer%error_estimate = relative_error
   end function found

   !> Without a rigid support nobody waits, and there is no eta.
   subroutine test_none(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(twin_table) :: twins
      type(chunk_type) :: chunk

      chunk = chunk_type(row=1, first=1, count=1)
      call check(error, twins%are_known() .and. twins%cover(chunk))
      if (allocated(error)) return
      call check(error, all(ieee_is_nan(twins%eta_of(chunk, [found([1.0_wp, 1.0_wp], 0.0_wp)]))))
   end subroutine test_none

   !> A missing twin keeps the table from being known; a diverged one does not.
   subroutine test_known(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(twin_table) :: twins
      type(response) :: rigid(3)

      rigid(1) = found([1.0_wp, 2.0_wp], 0.0_wp)
      rigid(2) = empty_response()
      rigid(2)%status = status_diverged
      rigid(3) = empty_response()
      twins = new_twin_table(rigid, .false.)
      call check(error, .not. twins%are_known(), 'one is missing')
      if (allocated(error)) return
      call check(error, twins%cover(chunk_type(row=1, first=1, count=2)), 'two are there')
      if (allocated(error)) return
      call check(error, .not. twins%cover(chunk_type(row=1, first=2, count=2)), 'not the third')
      if (allocated(error)) return
      call twins%keep(3, [found([1.0_wp, 1.0_wp], 0.0_wp)])
      call check(error, twins%cover(chunk_type(row=1, first=1, count=3)), 'all are there')
      if (allocated(error)) return
      twins = new_twin_table(rigid(:2), .true.)
      call check(error, twins%are_known() .and. twins%cover(chunk_type(row=1, first=1, count=2)), 'none is missing')
      if (allocated(error)) return
      twins = new_twin_table(rigid, .true.)
      call check(error, .not. twins%cover(chunk_type(row=1, first=1, count=1)), 'all are found again')
   end subroutine test_known

   !> Two rows of three speeds: eta = 100 (flexible/rigid - 1) with the twin of the same speed, NaN where one of both diverged.
   subroutine test_eta(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: near = 1.0e-12_wp
      type(twin_table) :: twins
      type(response) :: rigid(4), flexible(6)
      real(wp) :: eta(3, 6)

      rigid(1) = found([7.0_wp, 7.0_wp], 0.0_wp)
      rigid(2) = found([2.0_wp, 4.0_wp], 1.0e-3_wp)
      rigid(3) = empty_response()
      rigid(3)%status = status_diverged
      rigid(4) = found([1.0_wp, 1.0_wp], 0.0_wp)
      twins = new_twin_table(rigid, .false.)
      flexible = found([3.0_wp, 2.0_wp], 2.0e-3_wp)
      flexible(6)%status = status_diverged
      eta = twins%eta_of(chunk_type(row=5, rows=2, first=2, count=3), flexible)
      call check(error, maxval(abs(eta(:, 1) - [50.0_wp, -50.0_wp, 0.45_wp])) < near, 'first row')
      if (allocated(error)) return
      call check(error, maxval(abs(eta(:, 4) - eta(:, 1))) <= 0.0_wp, 'second row')
      if (allocated(error)) return
      call check(error, maxval(abs(eta(:, 3) - [200.0_wp, 100.0_wp, 0.6_wp])) < near, 'last speed')
      if (allocated(error)) return
      call check(error, all(ieee_is_nan(eta(:, [2, 5, 6]))), 'diverged')
      if (allocated(error)) return
      ! Of the last twin no error is known.
      call twins%keep(4, [found([1.0_wp, 1.0_wp], nan())])
      eta = twins%eta_of(chunk_type(row=5, rows=2, first=2, count=3), flexible)
      call check(error, maxval(abs(eta(:2, 3) - [200.0_wp, 100.0_wp])) < near .and. ieee_is_nan(eta(3, 3)), 'no error estimate')
   end subroutine test_eta

end module test_twins
