!> Amplitude spectra of signals whose lines are known, and the Fourier transform below them.
module test_spectrum
   use pseudo_random, only: random_stream
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_base_text, only: to_text
   use spurflex_external_fftw, only: plan_transform, real_transform, release_transform, transform_real
   use spurflex_measure_spectrum, only: find_spectrum, release_spectra, spectrum_maker
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_spectrum

   !> Round-off of a transform, beside the largest value.
   real(wp), parameter :: roundoff = 1.0e-14_wp

   !> Mesh periods of the window, samples in each, places of the axis up to order four.
   integer, parameter :: window = 840, samples = 64, lines = 4*window + 1

contains

   !> The tests of this suite.
   subroutine collect_spectrum(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('transform against the sum that defines it', test_transform), &
                  new_unittest('transforms that were not planned are errors', test_unplanned), &
                  new_unittest('lines of a motion of three mesh periods', test_subharmonic), &
                  new_unittest('Parseval without a window', test_parseval), &
                  new_unittest('Hann''s window on lines of the axis', test_hann_on), &
                  new_unittest('Hann''s window between lines of the axis', test_hann_between), &
                  new_unittest('a large mean leaks into no line', test_mean), &
                  new_unittest('power under Hann''s window', test_hann_power), &
                  new_unittest('the highest line is half of the sampling rate', test_highest), &
                  new_unittest('no bit depends on the lengths met before', test_lengths) &
                  ]
   end subroutine collect_spectrum

   !> The amplitude spectrum, failing the test where there is none.
   subroutine find(maker, signal, windowed, spacing, amplitude, error)
      !> What makes spectra.
      type(spectrum_maker), intent(inout) :: maker
      !> Samples.
      real(wp), intent(in) :: signal(:)
      !> With Hann's window.
      logical, intent(in) :: windowed
      !> Places from line to line.
      integer, intent(in) :: spacing
      !> Amplitudes, shape (0:).
      real(wp), intent(out) :: amplitude(0:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      call find_spectrum(maker, signal, windowed, spacing, amplitude, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine find

   !> One harmonic.
   pure function harmonic(amplitude, order, phase, periods) result(signal)
      !> Amplitude.
      real(wp), intent(in) :: amplitude
      !> Multiple of the mesh frequency.
      real(wp), intent(in) :: order
      !> Phase at the first sample [rad].
      real(wp), intent(in) :: phase
      !> Mesh periods.
      integer, intent(in) :: periods
      !> Samples, shape (periods samples).
      real(wp), allocatable :: signal(:)

      integer :: i

      signal = [(amplitude*cos(2.0_wp*pi*order*real(i, wp)/real(samples, wp) + phase), i=0, periods*samples - 1)]
   end function harmonic

   !> Even and odd lengths, and one of large prime factors.
   subroutine test_transform(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: lengths(5) = [1, 2, 15, 64, 194]
      type(real_transform) :: transform
      type(library_error), allocatable :: fault
      type(random_stream) :: random
      real(wp), allocatable :: signal(:), kept(:)
      complex(wp), allocatable :: line(:)
      complex(wp) :: expected
      real(wp) :: angle
      integer :: i, j, k, n

      random = random_stream(5_i8)
      do i = 1, size(lengths)
         n = lengths(i)
         call plan_transform(transform, n, fault)
         call check(error, .not. allocated(fault), 'planned')
         if (allocated(error)) return
         allocate (signal(n), line(0:n/2))
         call random%fill(-1.0_wp, 1.0_wp, signal)
         kept = signal
         call transform_real(transform, signal, line, fault)
         call check(error, .not. allocated(fault), 'transformed')
         if (allocated(error)) return
         do k = 0, n/2
            expected = (0.0_wp, 0.0_wp)
            do j = 0, n - 1
               angle = -2.0_wp*pi*real(mod(j*k, n), wp)/real(n, wp)
               expected = expected + kept(j + 1)*cmplx(cos(angle), sin(angle), wp)
            end do
            call check(error, abs(line(k) - expected), 0.0_wp, roundoff*real(n, wp), 'line '//to_text(k)//' of '//to_text(n))
            if (allocated(error)) return
         end do
         deallocate (signal, line)
      end do
      call release_transform(transform)
      call check(error, transform%length, 0, 'released')
   end subroutine test_transform

   !> No values, and other values than planned.
   subroutine test_unplanned(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(real_transform) :: transform
      type(library_error), allocatable :: fault
      real(wp) :: signal(8)
      complex(wp) :: line(5)

      signal = 1.0_wp
      call transform_real(transform, signal, line, fault)
      call check(error, allocated(fault), 'nothing is planned')
      if (allocated(error)) return
      call plan_transform(transform, 0, fault)
      call check(error, allocated(fault), 'no values')
      if (allocated(error)) return
      call plan_transform(transform, 9, fault)
      call check(error, .not. allocated(fault), 'nine values')
      if (allocated(error)) return
      call transform_real(transform, signal, line, fault)
      call release_transform(transform)
      call check(error, allocated(fault), 'eight values where nine are planned')
   end subroutine test_unplanned

   !> Mean, lines at thirds of the mesh frequency, nothing else.
   subroutine test_subharmonic(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: periods = 3
      type(spectrum_maker) :: maker
      real(wp) :: amplitude(0:lines - 1), expected(0:lines - 1)

      expected = 0.0_wp
      expected([0, window/3, window, 5*window/3, 4*window]) = [-2.0_wp, 0.7_wp, 1.5_wp, 0.01_wp, 0.2_wp]
      call find(maker, -2.0_wp + harmonic(0.7_wp, 1.0_wp/3.0_wp, 0.4_wp, periods) + harmonic(1.5_wp, 1.0_wp, 1.1_wp, periods) &
                + harmonic(0.01_wp, 5.0_wp/3.0_wp, -0.3_wp, periods) + harmonic(0.2_wp, 4.0_wp, 2.0_wp, periods), .false., &
                window/periods, amplitude, error)
      call release_spectra(maker)
      if (allocated(error)) return
      call check(error, maxval(abs(amplitude - expected)), 0.0_wp, roundoff, 'lines')
   end subroutine test_subharmonic

   !> Half of the squares of all lines is the variance.
   subroutine test_parseval(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Odd, so that every line has a twin.
      integer, parameter :: half = 472, n = 2*half + 1
      type(spectrum_maker) :: maker
      type(random_stream) :: random
      real(wp) :: signal(n), amplitude(0:half), mean

      random = random_stream(7_i8)
      call random%fill(-1.0_wp, 3.0_wp, signal)
      call find(maker, signal, .false., 1, amplitude, error)
      call release_spectra(maker)
      if (allocated(error)) return
      mean = sum(signal)/real(n, wp)
      call check(error, amplitude(0), mean, roundoff, 'mean')
      if (allocated(error)) return
      call check(error, 0.5_wp*sum(amplitude(1:)**2), sum((signal - mean)**2)/real(n, wp), roundoff, 'variance', relative=.true.)
   end subroutine test_parseval

   !> The amplitude itself, half of it beside, nothing farther away; the same for every line, the lowest but one and the highest.
   subroutine test_hann_on(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: places(4) = [2, 517, window, 4*window - 1]
      !> Round-off of phases of up to 20,000 radians.
      real(wp), parameter :: tolerance = 2.0e-12_wp
      type(spectrum_maker) :: maker
      real(wp) :: amplitude(0:lines - 1), expected(0:lines - 1)
      integer :: i

      do i = 1, size(places)
         call find(maker, harmonic(1.7_wp, real(places(i), wp)/real(window, wp), 0.3_wp*real(i, wp), window), .true., 1, &
                   amplitude, error)
         if (allocated(error)) return
         expected = 0.0_wp
         expected(places(i) - 1:places(i) + 1) = [0.85_wp, 1.7_wp, 0.85_wp]
         call check(error, maxval(abs(amplitude - expected)), 0.0_wp, tolerance, 'line '//to_text(places(i)))
         if (allocated(error)) return
      end do
      call release_spectra(maker)
   end subroutine test_hann_on

   !> The nearest line reads sin(pi d)/(pi d (1 - d^2)) of the amplitude, d the distance in lines: 1.42 dB less at most.
   subroutine test_hann_between(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The line at the negative frequency, a thousand lines away, leaks this.
      real(wp), parameter :: tolerance = 1.0e-8_wp
      real(wp), parameter :: distances(4) = [0.1_wp, 0.25_wp, 1.0_wp/3.0_wp, 0.5_wp]
      integer, parameter :: place = 1000
      type(spectrum_maker) :: maker
      real(wp) :: amplitude(0:lines - 1), expected
      integer :: i

      do i = 1, size(distances)
         associate (d => distances(i))
            call find(maker, harmonic(1.0_wp, (real(place, wp) + d)/real(window, wp), 0.9_wp, window), .true., 1, amplitude, error)
            if (allocated(error)) return
            expected = sin(pi*d)/(pi*d*(1.0_wp - d**2))
         end associate
         call check(error, amplitude(place), expected, tolerance, 'nearest line')
         if (allocated(error)) return
         call check(error, maxval(amplitude) <= 1.0_wp .and. maxval(amplitude) >= 0.848_wp, 'the scalloping loss')
         if (allocated(error)) return
         ! Side lobes fall off with the third power of the distance.
         call check(error, maxval(amplitude(place + 100:)) < 1.0e-6_wp, 'a hundred lines away')
         if (allocated(error)) return
      end do
      call release_spectra(maker)
   end subroutine test_hann_between

   !> Metres beside micrometres.
   subroutine test_mean(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off of the samples.
      real(wp), parameter :: tolerance = 1.0e-15_wp
      type(spectrum_maker) :: maker
      real(wp) :: amplitude(0:lines - 1)

      call find(maker, 2.0_wp + harmonic(1.0e-6_wp, 1.0_wp, 0.2_wp, window), .true., 1, amplitude, error)
      call release_spectra(maker)
      if (allocated(error)) return
      call check(error, amplitude(0), 2.0_wp, tolerance, 'mean')
      if (allocated(error)) return
      call check(error, amplitude(window), 1.0e-6_wp, tolerance, 'line')
      if (allocated(error)) return
      call check(error, maxval(amplitude(1:window - 2)), 0.0_wp, tolerance, 'below the line')
   end subroutine test_mean

   !> Lines far from each other: half of the squares is the variance times the equivalent noise bandwidth, 3/2.
   subroutine test_hann_power(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(spectrum_maker) :: maker
      real(wp) :: amplitude(0:lines - 1)

      call find(maker, harmonic(1.0_wp, 0.25_wp, 0.2_wp, window) + harmonic(0.5_wp, 1.0_wp, 0.7_wp, window) &
                + harmonic(0.1_wp, 3.5_wp, -1.0_wp, window), .true., 1, amplitude, error)
      call release_spectra(maker)
      if (allocated(error)) return
      call check(error, 0.5_wp*sum(amplitude(1:)**2), 1.5_wp*0.5_wp*(1.0_wp + 0.25_wp + 0.01_wp), 10.0_wp*roundoff, 'power')
   end subroutine test_hann_power

   !> A line without a twin, and places beyond it.
   subroutine test_highest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(spectrum_maker) :: maker
      real(wp) :: amplitude(0:20), expected(0:20)
      integer :: i

      expected = 0.0_wp
      expected(16) = 3.0_wp
      call find(maker, [(merge(3.0_wp, -3.0_wp, mod(i, 2) == 0), i=0, 15)], .false., 2, amplitude, error)
      call release_spectra(maker)
      if (allocated(error)) return
      call check(error, maxval(abs(amplitude - expected)), 0.0_wp, roundoff, 'lines')
   end subroutine test_highest

   !> More lengths than are kept planned, in another order, and again.
   subroutine test_lengths(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: many = 20
      type(spectrum_maker) :: maker, fresh
      real(wp) :: signal(samples*many), first(0:100), again(0:100)
      integer :: i, periods
      type(random_stream) :: random

      random = random_stream(11_i8)
      call random%fill(-1.0_wp, 1.0_wp, signal)
      do i = 1, 3*many
         periods = 1 + mod(7*i, many)
         call find(maker, signal(:samples*periods), mod(i, 2) == 0, 1, first, error)
         if (allocated(error)) return
         call find(fresh, signal(:samples*periods), mod(i, 2) == 0, 1, again, error)
         if (allocated(error)) return
         call release_spectra(fresh)
         call check(error, .not. any(abs(first - again) > 0.0_wp), 'the same bits')
         if (allocated(error)) return
      end do
      call release_spectra(maker)
   end subroutine test_lengths

end module test_spectrum
