!> One-sided amplitude spectra: a line of amplitude A, half of its peak-to-peak, reads A; the mean stands first.
module spurflex_measure_spectrum
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_external_fftw, only: real_transform, plan_transform, transform_real, release_transform
   implicit none
   private

   public :: spectrum_maker, find_spectrum, release_spectra

   !> Lengths that are kept planned: one for each period of motion that is met often.
   integer, parameter :: most_plans = 12

   !> What makes spectra; keeps what the next one can use again.
   type :: spectrum_maker
      private
      !> Planned transforms, and the one that is given up next.
      type(real_transform) :: transforms(most_plans)
      integer :: oldest = 1
   end type spectrum_maker

contains

   !> The amplitude spectrum of a signal.
   !>
   !> Without a window the signal must repeat after its length: its lines then lie on those of the transform, and nothing leaks.
   !> Otherwise the window is Hann's, and amplitudes are divided by its coherent gain. The mean, as the window sees it, is taken
   !> off before, so that it leaks into no line.
   subroutine find_spectrum(maker, signal, windowed, spacing, amplitude, error)
      !> What makes spectra.
      type(spectrum_maker), intent(inout) :: maker
      !> Even samples, shape (n).
      real(wp), intent(in) :: signal(:)
      !> Hann's window is laid over it.
      logical, intent(in) :: windowed
      !> Places in `amplitude` from one line of the transform to the next.
      integer, intent(in) :: spacing
      !> Mean, then amplitudes of the lines; zero between those of the transform, shape (lines).
      real(wp), intent(out) :: amplitude(0:)
      !> Set where the signal cannot be transformed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: weight(:), weighted(:)
      complex(wp), allocatable :: line(:)
      real(wp) :: mean, rest
      integer :: n, i, which

      n = size(signal)
      amplitude = 0.0_wp
      call choose_transform(maker, n, which, error)
      if (allocated(error)) return
      allocate (weighted(n), weight(n), line(0:n/2))
      weight = 1.0_wp
      if (windowed) weight = [(2.0_wp*sin(pi*real(i, wp)/real(n, wp))**2, i=0, n - 1)]
      mean = sum(weight*signal)/real(n, wp)
      ! What the first sum rounded off.
      rest = sum(weight*(signal - mean))/real(n, wp)
      mean = mean + rest
      weighted = weight*(signal - mean)
      call transform_real(maker%transforms(which), weighted, line, error)
      if (allocated(error)) return
      amplitude(0) = mean
      ! The weights have mean one; each line has a twin at the negative frequency, but for that at half of the sampling rate.
      do i = 1, min(ubound(amplitude, 1)/spacing, n/2)
         amplitude(spacing*i) = merge(1.0_wp, 2.0_wp, 2*i == n)*abs(line(i))/real(n, wp)
      end do
   end subroutine find_spectrum

   !> The planned transform of a length.
   subroutine choose_transform(maker, length, which, error)
      !> What makes spectra.
      type(spectrum_maker), intent(inout) :: maker
      !> Values of the signal.
      integer, intent(in) :: length
      !> Which of its transforms.
      integer, intent(out) :: which
      !> Set where there is no plan.
      type(error_type), allocatable, intent(out) :: error

      do which = 1, most_plans
         if (maker%transforms(which)%length == length) return
      end do
      which = maker%oldest
      maker%oldest = 1 + mod(which, most_plans)
      call plan_transform(maker%transforms(which), length, error)
   end subroutine choose_transform

   !> Give up everything that is planned.
   subroutine release_spectra(maker)
      !> What makes spectra.
      type(spectrum_maker), intent(inout) :: maker

      integer :: i

      do i = 1, most_plans
         call release_transform(maker%transforms(i))
      end do
   end subroutine release_spectra

end module spurflex_measure_spectrum
