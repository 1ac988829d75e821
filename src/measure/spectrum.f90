!> One-sided amplitude spectra: a line of amplitude A, half of its peak-to-peak, reads A; the mean stands first.
module spurflex_measure_spectrum
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_external_fftw, only: real_transform, plan_transform, transform_real, release_transform
   use spurflex_measure_observation, only: observation_type
   use spurflex_measure_record, only: record_request, mesh_force_observable
   implicit none
   private

   public :: spectrum_maker, series_type, samples_of_spectrum, strides_of, make_spectra, find_spectrum, release_spectra

   !> Samples of the spectrum in a mesh period at least, for each order of the axis, and for each step of collocation, which goes
   !> with the highest natural frequency.
   integer, parameter :: fewest_samples = 64, samples_per_order = 8, samples_per_step = 4

   !> Times as many where the mesh force is wanted: its rate jumps where the teeth part, and its lines fall off slowly.
   integer, parameter :: samples_for_force = 4

   !> Lengths that are kept planned: one for each period of motion that is met often.
   integer, parameter :: most_plans = 12

   !> What makes spectra; keeps what the next one can use again.
   type :: spectrum_maker
      private
      !> Planned transforms, and the one that is given up next.
      type(real_transform) :: transforms(most_plans)
      integer :: oldest = 1
   end type spectrum_maker

   !> Samples of one quantity.
   type :: series_type
      real(wp), allocatable :: value(:)
   end type series_type

contains

   !> Samples of the spectrum in a mesh period: a power of two.
   pure function samples_of_spectrum(request, steps) result(samples)
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> Steps that collocation begins with.
      integer, intent(in) :: steps
      !> Number of samples.
      integer :: samples

      samples = fewest_samples
      do while (samples < max(samples_per_order*request%highest_order, real(samples_per_step*steps, wp)))
         samples = 2*samples
      end do
      if (any(request%quantities == mesh_force_observable)) samples = samples_for_force*samples
   end function samples_of_spectrum

   !> How many samples apart those of each quantity are: a quantity has the same ones whatever else is asked for.
   pure function strides_of(request) result(stride)
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> Shape (quantities).
      integer :: stride(size(request%quantities))

      stride = 1
      if (any(request%quantities == mesh_force_observable)) then
         where (request%quantities /= mesh_force_observable) stride = samples_for_force
      end if
   end function strides_of

   !> The spectra of what was sampled.
   subroutine make_spectra(maker, request, observation, signal, periods, spectrum, error)
      !> Maker.
      type(spectrum_maker), intent(inout) :: maker
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> What is observed.
      type(observation_type), intent(in) :: observation
      !> Samples of each quantity over the period of the motion, or over the window, shape (quantities).
      type(series_type), intent(in) :: signal(:)
      !> Mesh periods after which the motion repeats; 0 if it does not.
      integer, intent(in) :: periods
      !> Amplitudes, shape (lines, quantities).
      real(wp), intent(inout) :: spectrum(:, :)
      !> Set where there is no transform.
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: amplitude(:), repeated(:)
      integer :: i, j, n, per_period, window
      logical :: fits

      window = request%spectrum_periods
      fits = .false.
      if (periods > 0) fits = mod(window, periods) == 0
      allocate (amplitude(size(spectrum, 1)))
      do i = 1, size(spectrum, 2)
         if (.not. observation%exists(i)) cycle
         n = size(signal(i)%value)
         if (fits) then
            call find_spectrum(maker, signal(i)%value, .false., window/periods, amplitude, error)
         else if (periods > 0) then
            per_period = n/periods
            repeated = [(signal(i)%value(1 + mod(j, n)), j=0, window*per_period - 1)]
            call find_spectrum(maker, repeated, .true., 1, amplitude, error)
         else
            call find_spectrum(maker, signal(i)%value, .true., 1, amplitude, error)
         end if
         if (allocated(error)) return
         spectrum(:, i) = amplitude
         spectrum(1, i) = spectrum(1, i) + observation%offset(i)
      end do
   end subroutine make_spectra

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
