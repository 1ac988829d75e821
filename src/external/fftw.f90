!> Typed wrapper over the real Fourier transform of FFTW.
!>
!> Plans are estimated, not measured, know nothing of the plans made before and take data wherever it lies, so that a
!> transform gives the same bits in every process.
module spurflex_external_fftw
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_double_complex, c_int, c_null_ptr, c_ptr
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   implicit none
   private

   public :: real_transform, plan_transform, transform_real, release_transform

   !> Flags of fftw3.h: data need not be aligned, plans are chosen without trying them.
   integer(c_int), parameter :: fftw_unaligned = 2_c_int, fftw_estimate = 64_c_int

   !> Transforms of one length. To be released when done with, and not to be copied.
   type :: real_transform
      !> Values of the signal; 0 if nothing is planned.
      integer :: length = 0
      type(c_ptr), private :: plan = c_null_ptr
   end type real_transform

   interface
      !> Plan a transform.
      function fftw_plan_dft_r2c_1d(n, signal, lines, flags) bind(c, name='fftw_plan_dft_r2c_1d') result(plan)
         import :: c_double, c_double_complex, c_int, c_ptr
         integer(c_int), value :: n
         real(c_double), intent(inout) :: signal(*)
         complex(c_double_complex), intent(inout) :: lines(*)
         integer(c_int), value :: flags
         type(c_ptr) :: plan
      end function fftw_plan_dft_r2c_1d

      !> Transform.
      subroutine fftw_execute_dft_r2c(plan, signal, lines) bind(c, name='fftw_execute_dft_r2c')
         import :: c_double, c_double_complex, c_ptr
         type(c_ptr), value :: plan
         real(c_double), intent(inout) :: signal(*)
         complex(c_double_complex), intent(out) :: lines(*)
      end subroutine fftw_execute_dft_r2c

      !> Give a plan back.
      subroutine fftw_destroy_plan(plan) bind(c, name='fftw_destroy_plan')
         import :: c_ptr
         type(c_ptr), value :: plan
      end subroutine fftw_destroy_plan

      !> Forget what earlier plans have taught.
      subroutine fftw_forget_wisdom() bind(c, name='fftw_forget_wisdom')
      end subroutine fftw_forget_wisdom
   end interface

contains

   !> Plan transforms of one length; those planned before are released.
   subroutine plan_transform(transform, length, error)
      !> The transforms.
      type(real_transform), intent(inout) :: transform
      !> Values of the signal.
      integer, intent(in) :: length
      !> Set where there is no plan.
      type(error_type), allocatable, intent(out) :: error

      real(c_double), allocatable :: signal(:)
      complex(c_double_complex), allocatable :: lines(:)

      call release_transform(transform)
      if (length < 1) then
         call fatal_error(error, 'a Fourier transform of '//to_text(length)//' values')
         return
      end if
      allocate (signal(length), lines(length/2 + 1))
      call fftw_forget_wisdom()
      transform%plan = fftw_plan_dft_r2c_1d(int(length, c_int), signal, lines, ior(fftw_estimate, fftw_unaligned))
      if (.not. c_associated(transform%plan)) then
         call fatal_error(error, 'FFTW has no plan for a transform of '//to_text(length)//' values')
         return
      end if
      transform%length = length
   end subroutine plan_transform

   !> Transform a signal: lines(k) = sum_j signal(j) exp(-2 pi i j k/length) with j, k from 0.
   subroutine transform_real(transform, signal, lines, error)
      !> The planned transform.
      type(real_transform), intent(in) :: transform
      !> Signal, shape (length); destroyed.
      real(wp), intent(inout), contiguous :: signal(:)
      !> Its lines, shape (length/2 + 1).
      complex(wp), intent(out), contiguous :: lines(:)
      !> Set where the lengths are not those planned.
      type(error_type), allocatable, intent(out) :: error

      if (transform%length == 0 .or. size(signal) /= transform%length .or. size(lines) /= transform%length/2 + 1) then
         call fatal_error(error, 'a Fourier transform of '//to_text(size(signal))//' values was planned for ' &
                          //to_text(transform%length))
         return
      end if
      call fftw_execute_dft_r2c(transform%plan, signal, lines)
   end subroutine transform_real

   !> Give the plan back.
   subroutine release_transform(transform)
      !> The transforms.
      type(real_transform), intent(inout) :: transform

      if (c_associated(transform%plan)) call fftw_destroy_plan(transform%plan)
      transform%plan = c_null_ptr
      transform%length = 0
   end subroutine release_transform

end module spurflex_external_fftw
