!> Recorded motions between their samples.
module test_dense
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_period_map, only: orbit_type, reserve_orbit
   use spurflex_measure_dense, only: interpolate
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_dense

   real(wp), parameter :: period = 1.0e-3_wp

   !> Places of the samples in a piece of five.
   real(wp), parameter :: place(0:4) = [0.0_wp, 0.172673164646011_wp, 0.5_wp, 0.827326835353989_wp, 1.0_wp]

contains

   !> The tests of this suite.
   subroutine collect_dense(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('polynomials of degree five and fourteen are exact', test_polynomials), &
                  new_unittest('samples come back to the bit', test_samples), &
                  new_unittest('an oscillation, its rate and its acceleration', test_oscillation), &
                  new_unittest('pieces of no length are passed over', test_instant) &
                  ]
   end subroutine collect_dense

   !> A power of the time beside the period, with its derivatives.
   pure function power(degree, time) result(motion)
      !> Degree.
      integer, intent(in) :: degree
      !> Time [s].
      real(wp), intent(in) :: time
      !> Value, rate and acceleration.
      real(wp) :: motion(3)

      real(wp) :: u

      u = time/period
      motion = [u**degree, real(degree, wp)*u**max(degree - 1, 0)/period, &
                real(degree*(degree - 1), wp)*u**max(degree - 2, 0)/period**2]
   end function power

   !> A harmonic with its derivatives.
   pure function wave(order, time) result(motion)
      !> Oscillations in the period.
      real(wp), intent(in) :: order
      !> Time [s].
      real(wp), intent(in) :: time
      !> Value, rate and acceleration.
      real(wp) :: motion(3)

      real(wp) :: frequency

      frequency = 2.0_wp*pi*order/period
      motion = [sin(frequency*time + 0.3_wp), frequency*cos(frequency*time + 0.3_wp), &
                -frequency**2*sin(frequency*time + 0.3_wp)]
   end function wave

   !> Sampled powers or waves.
   subroutine sample(pieces, in_piece, waves, number, orbit)
      !> Pieces of the period.
      integer, intent(in) :: pieces
      !> Samples from piece to piece: 1 or 4.
      integer, intent(in) :: in_piece
      !> Waves of order one and up; powers otherwise.
      logical, intent(in) :: waves
      !> How many of them.
      integer, intent(in) :: number
      !> The period.
      type(orbit_type), intent(inout) :: orbit

      real(wp) :: motion(3), share
      integer :: s, q

      call reserve_orbit(orbit, pieces*in_piece, number)
      orbit%samples = pieces*in_piece
      orbit%piece = in_piece
      do s = 0, orbit%samples
         share = real(mod(s, in_piece), wp)
         if (in_piece == 4) share = place(mod(s, 4))
         orbit%time(s) = period*(real(s/in_piece, wp) + share)/real(pieces, wp)
         do q = 1, number
            motion = power(q - 1, orbit%time(s))
            if (waves) motion = wave(real(q, wp), orbit%time(s))
            orbit%value(q, s) = motion(1)
            orbit%rate(q, s) = motion(2)
            orbit%acceleration(q, s) = motion(3)
         end do
      end do
   end subroutine sample

   !> As many powers as there are data.
   subroutine test_polynomials(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off of the divided differences, beside the period and its square for the derivatives.
      real(wp), parameter :: tolerance(3) = [1.0e-13_wp, 1.0e-11_wp, 1.0e-9_wp]
      integer, parameter :: times = 37
      type(orbit_type) :: orbit
      real(wp) :: time(times), motion(15, 3, times)
      integer :: in_piece, pieces, number, i, q

      time = [(period*real(i, wp)/real(times, wp), i=0, times - 1)]
      do in_piece = 1, 4, 3
         number = 3*(in_piece + 1)
         do pieces = 1, 3
            call sample(pieces, in_piece, .false., number, orbit)
            call interpolate(orbit, time, motion(:number, :, :))
            do i = 1, times
               do q = 1, number
                  call check(error, all(abs(motion(q, :, i) - power(q - 1, time(i)))*period**[0, 1, 2] <= tolerance), 'a power')
                  if (allocated(error)) return
               end do
            end do
         end do
      end do
   end subroutine test_polynomials

   !> Times of samples at the ends of pieces, the ends of the period included.
   subroutine test_samples(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(orbit_type) :: orbit
      real(wp) :: motion(4, 3, 8)
      integer :: i

      call sample(7, 4, .true., 4, orbit)
      call interpolate(orbit, orbit%time(0:28:4), motion)
      do i = 1, 8
         call check(error, .not. any(abs(motion(:, 1, i) - orbit%value(:, 4*i - 4)) > 0.0_wp), 'value')
         if (allocated(error)) return
         call check(error, .not. any(abs(motion(:, 2, i) - orbit%rate(:, 4*i - 4)) > 0.0_wp), 'rate')
         if (allocated(error)) return
         call check(error, .not. any(abs(motion(:, 3, i) - orbit%acceleration(:, 4*i - 4)) > 0.0_wp), 'acceleration')
         if (allocated(error)) return
      end do
   end subroutine test_samples

   !> The error beside a wave of phase p in a piece: p^6/(6! 64) with two samples; with five, round-off for p of a radian.
   subroutine test_oscillation(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: times = 64, pieces = 16
      !> With five samples, of value, rate and acceleration.
      real(wp), parameter :: tolerance(3) = [1.0e-13_wp, 1.0e-11_wp, 1.0e-8_wp]
      type(orbit_type) :: orbit
      real(wp) :: time(times), motion(3, 3, times), phase, difference
      integer :: i, q

      time = [(period*real(i, wp)/real(times, wp), i=0, times - 1)]
      call sample(pieces, 1, .true., 3, orbit)
      call interpolate(orbit, time, motion)
      do q = 1, 3
         phase = 2.0_wp*pi*real(q, wp)/real(pieces, wp)
         difference = 0.0_wp
         do i = 1, times
            difference = max(difference, abs(motion(q, 1, i) - sin(2.0_wp*pi*real(q, wp)*time(i)/period + 0.3_wp)))
         end do
         call check(error, difference <= phase**6/46080.0_wp .and. difference > 0.3_wp*phase**6/46080.0_wp, 'degree five')
         if (allocated(error)) return
      end do
      call sample(pieces, 4, .true., 3, orbit)
      call interpolate(orbit, time, motion)
      do i = 1, times
         do q = 1, 3
            call check(error, all(abs(motion(q, :, i) - wave(real(q, wp), time(i)))*(period/(2.0_wp*pi*real(q, wp)))**[0, 1, 2] &
                                  <= tolerance), 'degree fourteen')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_oscillation

   !> A piece that begins and ends at the same time, as where a crossing falls on the end of a step.
   subroutine test_instant(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: times = 5
      type(orbit_type) :: orbit
      real(wp) :: time(times), motion(2, 3, times)
      integer :: i

      call sample(4, 4, .true., 2, orbit)
      ! The second piece shrinks to its start, the third one begins there.
      orbit%time(4:8) = orbit%time(4)
      orbit%value(:, 4:8) = spread(orbit%value(:, 4), 2, 5)
      orbit%rate(:, 4:8) = spread(orbit%rate(:, 4), 2, 5)
      orbit%acceleration(:, 4:8) = spread(orbit%acceleration(:, 4), 2, 5)
      orbit%time(8:12) = orbit%time(4) + place*(orbit%time(12) - orbit%time(4))
      do i = 8, 12
         orbit%value(:, i) = orbit%time(i)
         orbit%rate(:, i) = 1.0_wp
         orbit%acceleration(:, i) = 0.0_wp
      end do
      time = [0.0_wp, 0.1_wp, 0.25_wp, 0.5_wp, 0.7_wp]*period
      call interpolate(orbit, time, motion)
      do i = 3, times
         call check(error, motion(1, 1, i), time(i), 1.0e-14_wp*period, 'the piece behind it')
         if (allocated(error)) return
      end do
      motion(:, 1, 2) = motion(:, 1, 2) - [sin(0.2_wp*pi + 0.3_wp), sin(0.4_wp*pi + 0.3_wp)]
      call check(error, maxval(abs(motion(:, 1, 2))), 0.0_wp, 1.0e-8_wp, 'the piece before it')
   end subroutine test_instant

end module test_dense
