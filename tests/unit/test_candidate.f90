!> What the search remembers: which period Newton's method is to be tried with next, and when it is not.
module test_candidate
   use spurflex_base_kinds, only: wp, pi
   use spurflex_steady_candidate, only: candidate_type
   use spurflex_steady_orbit, only: periodic_orbit, move_orbit
   use spurflex_steady_transient, only: begin_transient, transient_type
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_candidate

   real(wp), parameter :: weight(2) = 1.0_wp, scale = 1.0_wp
   integer, parameter :: most_periods = 4000
   logical, parameter :: in_use(2) = .true.

contains

   !> The tests of this suite.
   subroutine collect_candidate(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('a start is tried with one period', test_start), &
                  new_unittest('the shortest period that nearly repeats', test_shortest), &
                  new_unittest('a multiple of an unstable motion may be one of its own', test_multiple), &
                  new_unittest('motions of several periods have a phase', test_phase), &
                  new_unittest('what led to an unstable motion is not tried again', test_unstable), &
                  new_unittest('a stable motion that comes nearer is waited for', test_waits), &
                  new_unittest('who leaves a motion behind is looked at again', test_leaves), &
                  new_unittest('many periods are tried late, and only where they nearly repeat', test_long) &
                  ]
   end subroutine collect_candidate

   !> A transient whose latest sections turn around the origin.
   subroutine turn(periods, radius, growth, per_turn, transient)
      !> Mesh periods.
      integer, intent(in) :: periods
      !> Radius in the end, factor by which it grows a period, and periods a turn.
      real(wp), intent(in) :: radius, growth, per_turn
      !> The transient.
      type(transient_type), intent(out) :: transient

      real(wp) :: angle, r
      integer :: k

      call begin_transient(weight, in_use, section(0), transient)
      do k = 1, periods
         transient%state = section(k)
         transient%periods = k
         call transient%ring%add(transient%state)
      end do

   contains

      !> The section after some periods.
      function section(after) result(place)
         !> The periods.
         integer, intent(in) :: after
         !> Where.
         real(wp) :: place(2)

         r = radius*growth**(after - periods)
         angle = 2.0_wp*pi*real(after, wp)/per_turn
         place = r*[cos(angle), sin(angle)]
      end function section

   end subroutine turn

   !> A motion of some periods at the origin, or somewhere else.
   function orbit_at(place, periods) result(orbit)
      !> Where.
      real(wp), intent(in) :: place(2)
      !> Its periods.
      integer, intent(in) :: periods
      !> The motion.
      type(periodic_orbit) :: orbit

      orbit%periods = periods
      orbit%state = place
      allocate (orbit%monodromy(2, 2), source=0.0_wp)
   end function orbit_at

   !> Before anything has moved there is one period to try.
   subroutine test_start(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      real(wp) :: recurrence
      integer :: periods

      call turn(0, 1.0_wp, 1.0_wp, 3.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 1, 'one period')
      if (allocated(error)) return
      call check(error, .not. candidate%may_follow(transient), 'nothing to follow')
   end subroutine test_start

   !> Exact repetitions; three periods that nearly repeat although sixty-four do so much more nearly.
   subroutine test_shortest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      real(wp) :: recurrence
      integer :: periods, n

      do n = 1, 8
         call turn(24, 1.0_wp, 1.0_wp, real(n, wp), transient)
         call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
         call check(error, periods, n, 'exact turns')
         if (allocated(error)) return
      end do
      call turn(80, 1.0_wp, 1.0_wp, 64.0_wp/21.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 3, 'nearly three')
      if (allocated(error)) return
      call check(error, recurrence, 2.0_wp*abs(sin(pi*63.0_wp/64.0_wp)), 1.0e-12_wp, 'how nearly')
      if (allocated(error)) return
      call turn(200, 1.0_wp, 1.0_wp, 64.0_wp/21.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 3, 'also later, as long as so many as sixty-four are too many')
      if (allocated(error)) return
      call turn(1000, 1.0_wp, 1.0_wp, 64.0_wp/21.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 64, 'and then sixty-four')
   end subroutine test_shortest

   !> Two periods led to an unstable motion of one: that says nothing of motions of two.
   subroutine test_multiple(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      type(periodic_orbit) :: orbit
      real(wp) :: recurrence
      integer :: periods

      call turn(192, 1.0e-3_wp, 1.001_wp, 2.0_wp, transient)
      orbit = orbit_at([0.0_wp, 0.0_wp], 1)
      call candidate%remember(weight, transient, 2, transient%ring%distance(2), orbit, is_periodic=.true., is_stable=.false.)
      call turn(384, 0.1_wp, 1.001_wp, 2.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 2, 'the motion of two periods')
   end subroutine test_multiple

   !> A stable motion of three periods is followed only at the phase at which it was met.
   subroutine test_phase(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      type(periodic_orbit) :: orbit
      integer :: k

      call turn(12, 1.0_wp, 1.0_wp, 3.0_wp, transient)
      orbit = orbit_at(transient%state, 3)
      call candidate%remember(weight, transient, 3, 0.0_wp, orbit, is_periodic=.true., is_stable=.true.)
      do k = 12, 20
         call turn(k, 1.0_wp, 1.0_wp, 3.0_wp, transient)
         call check(error, candidate%may_follow(transient) .eqv. mod(k, 3) == 0, 'phase')
         if (allocated(error)) return
      end do
      call move_orbit(candidate%orbit, orbit)
      call turn(24, 1.0_wp, 1.0_wp, 3.0_wp, transient)
      call check(error, .not. candidate%may_follow(transient), 'nothing is left to follow')
   end subroutine test_phase

   !> Newton's method led to an unstable motion: the same period is tried again only from where it repeats more nearly.
   subroutine test_unstable(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      type(periodic_orbit) :: orbit
      real(wp) :: recurrence, later
      integer :: periods, again

      call turn(12, 0.02_wp, 1.01_wp, 50.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 1, 'one period at first')
      if (allocated(error)) return
      orbit = orbit_at([0.0_wp, 0.0_wp], 1)
      call candidate%remember(weight, transient, periods, recurrence, orbit, is_periodic=.true., is_stable=.false.)
      call check(error, .not. candidate%may_follow(transient), 'an unstable motion is not followed')
      if (allocated(error)) return
      call turn(24, 0.0225_wp, 1.01_wp, 50.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, again, later)
      call check(error, again, 0, 'leaving slowly')
      if (allocated(error)) return
      ! Far away, on a motion of two periods.
      call turn(48, 1.0_wp, 1.0_wp, 2.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, again, later)
      call check(error, again, 2, 'another motion')
   end subroutine test_unstable

   !> A stable motion was found, and the transient comes nearer to it.
   subroutine test_waits(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      type(periodic_orbit) :: orbit
      real(wp) :: recurrence
      integer :: periods

      call turn(12, 0.5_wp, 0.99_wp, 40.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      orbit = orbit_at([0.0_wp, 0.0_wp], 1)
      call candidate%remember(weight, transient, periods, recurrence, orbit, is_periodic=.true., is_stable=.true.)
      call check(error, candidate%may_follow(transient), 'a stable motion may be followed')
      if (allocated(error)) return
      call check(error, .not. allocated(orbit%state), 'its state has moved')
      if (allocated(error)) return
      call turn(24, 0.5_wp*0.99_wp**12, 0.99_wp, 40.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 0, 'nothing to try meanwhile')
   end subroutine test_waits

   !> A stable motion was found, and the transient has settled on another one far from it.
   subroutine test_leaves(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      type(periodic_orbit) :: orbit
      real(wp) :: recurrence
      integer :: periods

      call turn(12, 1.0_wp, 1.0_wp, 5.3_wp, transient)
      orbit = orbit_at([3.0_wp, 0.0_wp], 1)
      call candidate%remember(weight, transient, 1, 1.0_wp, orbit, is_periodic=.true., is_stable=.true.)
      call turn(24, 1.0_wp, 1.0_wp, 5.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call turn(48, 1.0_wp, 1.0_wp, 5.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 5, 'the other motion is tried')
   end subroutine test_leaves

   !> Motions of more than eight periods.
   subroutine test_long(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(candidate_type) :: candidate
      type(transient_type) :: transient
      real(wp) :: recurrence
      integer :: periods

      ! Eleven sections on a circle: none of up to eight periods comes near.
      call turn(384, 1.0_wp, 1.0_wp, 11.0_wp/4.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods <= 8, 'too early')
      if (allocated(error)) return
      call turn(1536, 1.0_wp, 1.0_wp, 11.0_wp/4.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods, 11, 'late')
      if (allocated(error)) return
      call turn(1536, 1.0_wp, 1.0_wp, 11.02_wp/4.0_wp, transient)
      call candidate%choose(weight, transient, scale, most_periods, periods, recurrence)
      call check(error, periods <= 8, 'not near enough')
      if (allocated(error)) return
      call turn(384, 1.0_wp, 1.0_wp, 11.0_wp/4.0_wp, transient)
      call candidate%choose(weight, transient, scale, 500, periods, recurrence)
      call check(error, periods, 11, 'not too early where there is no later')
   end subroutine test_long

end module test_candidate
