!> Amplitude, rms and extremes of sampled signals whose measures are known.
module test_motion
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_period_map, only: observables, orbit_type, reserve_orbit
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: empty_response, response
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_motion

   real(wp), parameter :: period = 1.0e-3_wp, frequency = 2.0_wp*pi/period

   !> Mean, and amplitude and phase of the first and the third harmonic, of y1, d_x1, d_y1, d_x2, d_y2.
   real(wp), parameter :: mean(observables) = [0.3e-6_wp, 0.0_wp, 0.0_wp, 1.0e-6_wp, -2.0e-6_wp]
   real(wp), parameter :: first(observables) = [2.0e-6_wp, 3.0e-6_wp, 1.0e-6_wp, 2.0e-6_wp, 2.0e-6_wp]
   real(wp), parameter :: third(observables) = [0.4e-6_wp, 0.0_wp, 0.0_wp, 0.5e-6_wp, 0.3e-6_wp]
   real(wp), parameter :: first_phase(observables) = [0.7_wp, 0.3_wp, 0.3_wp + 0.5_wp*pi, 1.9_wp, 0.1_wp]
   real(wp), parameter :: third_phase(observables) = [2.1_wp, 0.0_wp, 0.0_wp, 0.4_wp, 1.3_wp]

   !> Static equilibrium of the same.
   real(wp), parameter :: static(observables) = [5.0e-6_wp, 0.0_wp, 0.0_wp, 4.0e-6_wp, 3.0e-6_wp]

contains

   !> The tests of this suite.
   subroutine collect_motion(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('amplitude and extremes of y1', test_extremes), &
                  new_unittest('extremes between the samples to fourth order', test_order), &
                  new_unittest('rms about the mean', test_rms), &
                  new_unittest('largest bearing deformations', test_bearings), &
                  new_unittest('several periods', test_periods), &
                  new_unittest('uneven samples', test_uneven), &
                  new_unittest('constant motion', test_constant) &
                  ]
   end subroutine collect_motion

   !> A quantity at some time: value, rate and acceleration.
   pure function signal(k, time, scale) result(motion)
      !> The quantity, 1..observables.
      integer, intent(in) :: k
      !> Time [s].
      real(wp), intent(in) :: time
      !> Factor of the vibration.
      real(wp), intent(in) :: scale
      !> Value, rate and acceleration.
      real(wp) :: motion(3)

      real(wp) :: one, three

      one = frequency*time + first_phase(k)
      three = 3.0_wp*frequency*time + third_phase(k)
      motion = [first(k)*sin(one) + third(k)*sin(three), &
                frequency*(first(k)*cos(one) + 3.0_wp*third(k)*cos(three)), &
                -frequency**2*(first(k)*sin(one) + 9.0_wp*third(k)*sin(three))]
      motion = scale*motion
      motion(1) = motion(1) + mean(k)
   end function signal

   !> One period of the signals.
   subroutine sample(orbit, samples, shift, scale, bend)
      !> The period.
      type(orbit_type), intent(inout) :: orbit
      !> Samples after the first.
      integer, intent(in) :: samples
      !> Time of the first sample.
      real(wp), intent(in) :: shift
      !> Factor of the vibration.
      real(wp), intent(in) :: scale
      !> How unevenly the samples lie, 0 for evenly.
      real(wp), intent(in) :: bend

      real(wp) :: motion(3), share
      integer :: s, k

      call reserve_orbit(orbit, samples)
      orbit%samples = samples
      do s = 0, samples
         share = real(s, wp)/real(samples, wp)
         orbit%time(s) = period*(share + bend*sin(2.0_wp*pi*share)/(2.0_wp*pi))
         do k = 1, observables
            motion = signal(k, orbit%time(s) + shift, scale)
            orbit%value(k, s) = motion(1)
            orbit%rate(k, s) = motion(2)
            orbit%acceleration(k, s) = motion(3)
         end do
      end do
      orbit%weight = 0.0_wp
      do s = 1, samples
         orbit%weight(s - 1:s) = orbit%weight(s - 1:s) + 0.5_wp*(orbit%time(s) - orbit%time(s - 1))/period
      end do
   end subroutine sample

   !> The measures of one period.
   subroutine measure_one(samples, shift, scale, bend, answer)
      !> Samples after the first.
      integer, intent(in) :: samples
      !> Time of the first sample.
      real(wp), intent(in) :: shift
      !> Factor of the vibration.
      real(wp), intent(in) :: scale
      !> How unevenly the samples lie.
      real(wp), intent(in) :: bend
      !> The measures.
      type(response), intent(out) :: answer

      type(motion_measure) :: measure
      type(orbit_type) :: orbit

      call sample(orbit, samples, shift, scale, bend)
      answer = empty_response()
      call measure%reset(static)
      call measure%add(orbit)
      call measure%finish(answer)
   end subroutine measure_one

   !> Extremes of y1, and largest bearing deformations, by looking very closely.
   subroutine look_closely(scale, largest, smallest, deformation)
      !> Factor of the vibration.
      real(wp), intent(in) :: scale
      !> Largest and smallest y1.
      real(wp), intent(out) :: largest, smallest
      !> Largest deformation of each bearing.
      real(wp), intent(out) :: deformation(2)

      !> The best of these is off by (3 pi/looks)^2/2 of the amplitude: 1e-11.
      integer, parameter :: looks = 2000000
      real(wp) :: motion(3), time, values(observables)
      integer :: i, k

      largest = -huge(largest)
      smallest = huge(smallest)
      deformation = 0.0_wp
      do i = 1, looks
         time = period*real(i, wp)/real(looks, wp)
         do k = 1, observables
            motion = signal(k, time, scale)
            values(k) = static(k) + motion(1)
         end do
         largest = max(largest, values(1))
         smallest = min(smallest, values(1))
         deformation = max(deformation, [norm2(values(2:3)), norm2(values(4:5))])
      end do
   end subroutine look_closely

   !> Fine sampling: everything is right to many digits, the static equilibrium included.
   subroutine test_extremes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Of the looking closely, relative.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(response) :: answer
      real(wp) :: largest, smallest, deformation(2)

      call look_closely(1.0_wp, largest, smallest, deformation)
      call measure_one(512, 0.0_wp, 1.0_wp, 0.0_wp, answer)
      call check(error, answer%y1_max, largest, tolerance, 'largest', relative=.true.)
      if (allocated(error)) return
      call check(error, answer%y1_min, smallest, tolerance, 'smallest', relative=.true.)
      if (allocated(error)) return
      call check(error, answer%y1_amplitude, 0.5_wp*(largest - smallest), tolerance, 'amplitude', relative=.true.)
   end subroutine test_extremes

   !> The largest error over many positions of the samples falls with the fourth power of their distance, or faster.
   subroutine test_order(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: positions = 50, samples(2) = [16, 32]
      real(wp), parameter :: least = 4.0_wp
      type(response) :: answer
      real(wp) :: largest, smallest, deformation(2), worst(4, 2)
      integer :: i, p

      call look_closely(1.0_wp, largest, smallest, deformation)
      worst = 0.0_wp
      do i = 1, 2
         do p = 1, positions
            call measure_one(samples(i), period*real(p, wp)/real(positions*samples(i), wp), 1.0_wp, 0.0_wp, answer)
            worst(:, i) = max(worst(:, i), abs([answer%y1_max - largest, answer%y1_min - smallest, &
                                                answer%bearing_deformation_max - deformation]))
         end do
      end do
      ! The deformation of the first bearing has no polynomial part: a circle around a point, an ellipse in general.
      do i = 1, 4
         call check(error, log(worst(i, 1)/worst(i, 2))/log(2.0_wp) >= least, 'order')
         if (allocated(error)) return
      end do
   end subroutine test_order

   !> The square root of half the sum of the squared amplitudes, whatever mean and static equilibrium are.
   subroutine test_rms(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The trapezoidal rule is exact for so few harmonics.
      real(wp), parameter :: roundoff = 1.0e-13_wp
      type(response) :: answer

      call measure_one(16, 0.2e-3_wp, 1.0_wp, 0.0_wp, answer)
      call check(error, answer%y1_rms, sqrt(0.5_wp*(first(1)**2 + third(1)**2)), roundoff, relative=.true.)
   end subroutine test_rms

   !> Largest distance from the unstrained bearing, static equilibrium included; it is not that of the largest components.
   subroutine test_bearings(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Of the looking closely, relative.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(response) :: answer
      real(wp) :: largest, smallest, deformation(2)

      call look_closely(1.0_wp, largest, smallest, deformation)
      call measure_one(512, 0.0_wp, 1.0_wp, 0.0_wp, answer)
      ! The first bearing moves on an ellipse around its unstrained position: the larger half-axis.
      call check(error, answer%bearing_deformation_max(1), 3.0e-6_wp, tolerance, 'first', relative=.true.)
      if (allocated(error)) return
      call check(error, answer%bearing_deformation_max(2), deformation(2), tolerance, 'second', relative=.true.)
   end subroutine test_bearings

   !> Extremes are those of all periods, the mean square is that of all periods; a new motion starts afresh.
   subroutine test_periods(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Sums of a hundred terms, relative.
      real(wp), parameter :: roundoff = 1.0e-13_wp
      type(motion_measure) :: measure
      type(orbit_type) :: orbit
      type(response) :: both, larger, again

      call measure%reset(static)
      call sample(orbit, 64, 0.0_wp, 1.0_wp, 0.0_wp)
      call measure%add(orbit)
      call sample(orbit, 48, 0.0_wp, 2.0_wp, 0.0_wp)
      call measure%add(orbit)
      both = empty_response()
      call measure%finish(both)
      call measure_one(48, 0.0_wp, 2.0_wp, 0.0_wp, larger)
      call check(error, both%y1_amplitude, larger%y1_amplitude, roundoff, 'amplitude', relative=.true.)
      if (allocated(error)) return
      call check(error, both%y1_rms, sqrt(0.5_wp*2.5_wp*(first(1)**2 + third(1)**2)), roundoff, 'rms', relative=.true.)
      if (allocated(error)) return
      call measure%reset(static)
      call sample(orbit, 48, 0.0_wp, 2.0_wp, 0.0_wp)
      call measure%add(orbit)
      again = empty_response()
      call measure%finish(again)
      call check(error, again%y1_max, larger%y1_max, 0.0_wp, 'largest afterwards')
      if (allocated(error)) return
      call check(error, again%y1_rms, larger%y1_rms, 0.0_wp, 'rms afterwards')
   end subroutine test_periods

   !> Samples may lie unevenly, and twice at one time.
   subroutine test_uneven(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The trapezoidal rule over uneven samples, relative.
      real(wp), parameter :: quadrature = 1.0e-4_wp
      !> Polynomials of degree five over at most a 170th of the period.
      real(wp), parameter :: tolerance = 1.0e-8_wp
      type(motion_measure) :: measure
      type(orbit_type) :: orbit
      type(response) :: even, uneven, doubled

      call measure_one(512, 0.0_wp, 1.0_wp, 0.0_wp, even)
      call measure_one(256, 0.0_wp, 1.0_wp, 0.5_wp, uneven)
      call check(error, uneven%y1_amplitude, even%y1_amplitude, tolerance, 'amplitude', relative=.true.)
      if (allocated(error)) return
      call check(error, uneven%y1_rms, even%y1_rms, quadrature, 'rms', relative=.true.)
      if (allocated(error)) return
      call sample(orbit, 256, 0.0_wp, 1.0_wp, 0.5_wp)
      call reserve_orbit(orbit, 512)
      call sample(orbit, 256, 0.0_wp, 1.0_wp, 0.5_wp)
      orbit%time(101:257) = orbit%time(100:256)
      orbit%weight(101:257) = orbit%weight(100:256)
      orbit%weight(100) = 0.0_wp
      orbit%value(:, 101:257) = orbit%value(:, 100:256)
      orbit%rate(:, 101:257) = orbit%rate(:, 100:256)
      orbit%acceleration(:, 101:257) = orbit%acceleration(:, 100:256)
      orbit%samples = 257
      call measure%reset(static)
      call measure%add(orbit)
      doubled = empty_response()
      call measure%finish(doubled)
      call check(error, doubled%y1_amplitude, uneven%y1_amplitude, 0.0_wp, 'amplitude of the doubled sample')
      if (allocated(error)) return
      call check(error, doubled%bearing_deformation_max(2), uneven%bearing_deformation_max(2), 0.0_wp, &
                 'deformation of the doubled sample')
   end subroutine test_uneven

   !> No vibration: no amplitude, no rms, extremes at the mean.
   subroutine test_constant(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The rms is the root of a difference of squares of the mean.
      real(wp), parameter :: roundoff = 1.0e-7_wp*0.3e-6_wp
      type(response) :: answer

      call measure_one(16, 0.0_wp, 0.0_wp, 0.0_wp, answer)
      call check(error, answer%y1_amplitude, 0.0_wp, 0.0_wp, 'amplitude')
      if (allocated(error)) return
      call check(error, answer%y1_rms, 0.0_wp, roundoff, 'rms')
      if (allocated(error)) return
      call check(error, answer%y1_max, static(1) + mean(1), 0.0_wp, 'largest')
   end subroutine test_constant

end module test_motion
