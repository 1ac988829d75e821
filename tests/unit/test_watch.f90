!> What is seen of a transient from one mesh period on: how far it drifts, whether it comes to rest, and what class it is told.
module test_watch
   use spurflex_base_kinds, only: wp, pi
   use spurflex_steady_irregular, only: classify, may_decide
   use spurflex_steady_outcome, only: steady_motion, status_missing, status_settled, motion_quasi_periodic, motion_chaotic
   use spurflex_steady_watch, only: watch_type
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_watch

   !> Turns a mesh period: of the golden mean, so that sections never repeat.
   real(wp), parameter :: turn = 2.0_wp*pi*(sqrt(5.0_wp) - 1.0_wp)/2.0_wp

   !> Sections of a quasi-periodic motion fill their range only so far within some hundred periods.
   real(wp), parameter :: filled = 1.0e-3_wp

   integer, parameter :: first = 256, second = 512, third = 1024, most = 4000, last_watch = 2464

contains

   !> The tests of this suite.
   subroutine collect_watch(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('drift of a range that shrinks by a known factor', test_drift), &
                  new_unittest('what arrives comes to rest, what leaves does not', test_rest), &
                  new_unittest('a torus is told, also while it still arrives; not what leaves', test_torus), &
                  new_unittest('a tangent that grows is chaos, settled only in the end', test_chaos), &
                  new_unittest('a watch that is too short decides nothing', test_short) &
                  ]
   end subroutine collect_watch

   !> Watch a motion from mesh period 256 to 512 and again to 1024: its norms turn around 2 with an amplitude of its own.
   subroutine observe(amplitude, growth, watch)
      interface
         !> Amplitude at a mesh period.
         pure function amplitude(period)
            import :: wp
            real(wp), intent(in) :: period
            real(wp) :: amplitude
         end function amplitude
      end interface
      !> Growth of the logarithm of the tangent in a period, beside what it wanders.
      real(wp), intent(in) :: growth
      !> The watch, over its second time.
      type(watch_type), intent(out) :: watch

      integer :: period

      call watch%begin(first, second, grows=.false.)
      do period = first + 1, third
         if (period == second + 1) call watch%begin(second, third, grows=.true.)
         call watch%see(period, 2.0_wp + amplitude(real(period, wp))*cos(turn*real(period, wp)), &
                        exp(growth + 0.5_wp*(cos(turn*real(period, wp)) - cos(turn*real(period - 1, wp)))))
      end do
   end subroutine observe

   !> Of a torus: nothing changes.
   pure function steady(period)
      !> Mesh period.
      real(wp), intent(in) :: period
      !> Amplitude.
      real(wp) :: steady

      steady = 1.0_wp + 0.0_wp*period
   end function steady

   !> Of one that is nearly reached, faster than it was before.
   pure function arriving(period)
      !> Mesh period.
      real(wp), intent(in) :: period
      !> Amplitude.
      real(wp) :: arriving

      arriving = 1.0_wp + 0.2_wp*exp(-(period - real(first, wp))/120.0_wp)
   end function arriving

   !> Of one that is left, faster and faster.
   pure function leaving(period)
      !> Mesh period.
      real(wp), intent(in) :: period
      !> Amplitude.
      real(wp) :: leaving

      leaving = 1.0_wp - 0.002_wp*exp((period - real(first, wp))/300.0_wp)
   end function leaving

   !> A range that halves in the second half has a drift of one half; of what has not been seen nothing is said.
   subroutine test_drift(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(watch_type) :: watch
      integer :: period

      call check(error, watch%drift(), 0.0_wp, 0.0_wp, 'nothing seen')
      if (allocated(error)) return
      call watch%begin(0, 100, grows=.false.)
      do period = 1, 100
         call watch%see(period, merge(4.0_wp, 2.0_wp, period <= 50)*real(mod(period, 2), wp), 1.0_wp)
         if (period /= 50) cycle
         call check(error, watch%drift(), 1.0_wp, 0.0_wp, 'one half seen')
         if (allocated(error)) return
      end do
      call check(error, watch%drift(), 0.5_wp, 0.0_wp, 'both halves')
      if (allocated(error)) return
      call watch%begin(100, 300, grows=.false.)
      call check(error, watch%drift(), 0.0_wp, 0.0_wp, 'begun anew')
   end subroutine test_drift

   !> The drift into a watch is that from the second half of the watch before.
   subroutine test_rest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(watch_type) :: watch

      call observe(arriving, 0.0_wp, watch)
      call check(error, watch%comes_to_rest(), 'what arrives comes to rest')
      if (allocated(error)) return
      call check(error, watch%drift() > filled .and. watch%drift() < 0.05_wp, 'it still drifts')
      if (allocated(error)) return
      call observe(leaving, 0.0_wp, watch)
      call check(error, .not. watch%comes_to_rest(), 'what leaves does not')
      if (allocated(error)) return
      watch = watch_type()
      call watch%begin(0, 8, grows=.false.)
      call check(error, watch%comes_to_rest(), 'nothing is known of before')
   end subroutine test_rest

   !> Both drift by about as much.
   subroutine test_torus(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(watch_type) :: watch
      type(steady_motion) :: motion

      call observe(steady, 0.0_wp, watch)
      call classify(watch, third, most, last_watch, motion)
      call check(error, motion%status == status_settled .and. motion%motion == motion_quasi_periodic, 'a torus')
      if (allocated(error)) return
      call check(error, motion%lyapunov_exponent, 0.0_wp, 1.0e-8_wp, 'its exponent')
      if (allocated(error)) return
      motion = steady_motion()
      call observe(arriving, 0.0_wp, watch)
      call classify(watch, third, most, last_watch, motion)
      call check(error, motion%status == status_settled .and. motion%motion == motion_quasi_periodic, 'one that is nearly reached')
      if (allocated(error)) return
      motion = steady_motion()
      call observe(leaving, 0.0_wp, watch)
      call check(error, watch%drift() > filled .and. watch%drift() < 0.025_wp, 'what leaves drifts no more than may be')
      if (allocated(error)) return
      call classify(watch, third, most, last_watch, motion)
      call check(error, motion%status == status_missing, 'what is left is not told')
   end subroutine test_torus

   !> An exponent of 0.1 in a period.
   subroutine test_chaos(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: exponent = 0.1_wp
      type(watch_type) :: watch
      type(steady_motion) :: motion

      call observe(steady, exponent, watch)
      call classify(watch, third, most, last_watch, motion)
      call check(error, motion%motion == motion_chaotic .and. motion%status == status_missing, 'chaos, not settled yet')
      if (allocated(error)) return
      call classify(watch, most, most, last_watch, motion)
      call check(error, motion%motion == motion_chaotic .and. motion%status == status_settled, 'settled in the end')
      if (allocated(error)) return
      ! What the tangent wanders within a watch of 512 periods is no more than this.
      call check(error, motion%lyapunov_exponent, exponent, 1.0_wp/real(third - second, wp), 'its exponent')
   end subroutine test_chaos

   !> A tangent is carried only where a watch may decide.
   subroutine test_short(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(watch_type) :: before, watch
      type(steady_motion) :: motion
      integer :: period

      call observe(steady, 0.0_wp, before)
      call check(error, .not. may_decide(before, 383), 'too short')
      if (allocated(error)) return
      call check(error, may_decide(before, 384), 'long enough for what has arrived')
      if (allocated(error)) return
      call watch%begin(0, 320, grows=.true.)
      do period = 1, 320
         call watch%see(period, 2.0_wp + cos(turn*real(period, wp)), 1.0_wp)
      end do
      call classify(watch, 320, most, last_watch, motion)
      call check(error, motion%status == status_missing, 'a short watch tells nothing')
      if (allocated(error)) return
      call watch%begin(320, 640, grows=.false.)
      do period = 321, 640
         call watch%see(period, merge(4.0_wp, 2.0_wp, period <= 480)*real(mod(period, 2), wp), 1.0_wp)
      end do
      call check(error, .not. may_decide(watch, 511) .and. may_decide(watch, 512), 'what is far away is watched longer')
   end subroutine test_short

end module test_watch
