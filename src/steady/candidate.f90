!> What the search for a steady motion remembers of the periodic motions that it has met, so that it finds none of them twice.
!>
!> A transient is looked at again and again. A stable motion that was found near it, but that it did not follow yet, needs only
!> be compared with it the next time. Newton's method would lead to the same motion again as long as the transient comes nearer
!> to it; and where it led to nothing stable, it does so again unless the transient repeats itself more nearly
!> since. Of the periods that are left, the shortest one after which the transient nearly repeats itself is tried.
module spurflex_steady_candidate
   use spurflex_base_kinds, only: wp
   use spurflex_steady_outcome, only: longest_named
   use spurflex_steady_sections, only: longest_period, weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit, move_orbit
   use spurflex_steady_transient, only: transient_type
   implicit none
   private

   public :: candidate_type

   !> A transient comes nearer if its distance shrinks to this share from look to look; the second share where it seems to repeat
   !> with another period.
   real(wp), parameter :: nearer = 0.999_wp, much_nearer = 0.9_wp

   !> A transient repeats itself more nearly if what its sections differ by has shrunk to this share.
   real(wp), parameter :: repeats_more_nearly = 0.8_wp

   !> Distance between sections, beside the size of the motion, at which the shortest period is tried; a longer one must come
   !> nearer by a factor, one of more than three mesh periods by another.
   real(wp), parameter :: near_recurrence = 0.1_wp, clearly_nearer = 0.3_wp, much_clearer = 0.1_wp

   !> Distance, beside the size of the motion, that is none: a shorter period is exact.
   real(wp), parameter :: no_distance = 1.0e-12_wp

   !> The same at which a motion of many mesh periods is looked for at all, and mesh periods before: it is dear, and what it is
   !> not told from, a torus, takes longer to be told.
   real(wp), parameter :: long_recurrence = 0.005_wp
   integer, parameter :: long_wait = 768

   !> Near a periodic motion Newton's method leads to it, also with a multiple of its period, unless the transient repeats itself
   !> more nearly than this share of its distance; the second share with a period of more than three mesh periods.
   real(wp), parameter :: lies_apart = 0.2_wp, lies_far_apart = 0.1_wp

   !> Mesh periods up to which a motion is soon told from a spiral or a torus. What winds around a motion about once in four mesh
   !> periods comes back near after four, and with that period Newton's method leads to the motion in the middle.
   integer, parameter :: soon_told = 3

   !> Mesh periods up to which these rules hold: who has waited so long looks again.
   integer, parameter :: trusted = 512

   !> Mesh periods up to which Newton's method may lead nowhere and is tried again: a transient changes fast at first.
   integer, parameter :: always_tried = 96

   !> What is remembered of one point.
   type :: candidate_type
      private
      !> The periodic motion that was met last; zero periods if there is none.
      type(periodic_orbit), public :: orbit
      !> It is stable.
      logical :: is_stable = .false.
      !> Mesh periods of the transient when it was met.
      integer :: met = 0
      !> Distance of the transient at the latest look [m].
      real(wp) :: distance = huge(1.0_wp)
      !> What sections so many periods apart differed by when Newton's method last led to nothing stable [m].
      real(wp) :: missed(longest_period) = huge(1.0_wp)
   contains
      !> A stable motion has been met that the transient may follow now.
      procedure :: may_follow
      !> The period with which Newton's method may lead to another motion.
      procedure :: choose
      !> Remember what Newton's method led to.
      procedure :: remember
   end type candidate_type

contains

   !> A stable motion has been met, and the transient is at the same phase of it as then.
   pure function may_follow(self, transient) result(it_may)
      !> Candidate.
      class(candidate_type), intent(in) :: self
      !> The transient.
      type(transient_type), intent(in) :: transient
      !> It may.
      logical :: it_may

      it_may = self%is_stable .and. in_phase(self, transient)
   end function may_follow

   !> Choose the period with which Newton's method may lead to another motion than before. Takes note of where the transient is.
   pure subroutine choose(self, weight, transient, scale, most_periods, periods, recurrence)
      !> Candidate.
      class(candidate_type), intent(inout) :: self
      !> Weights of the states, shape (size).
      real(wp), intent(in) :: weight(:)
      !> The transient.
      type(transient_type), intent(in) :: transient
      !> Size of the motion [m].
      real(wp), intent(in) :: scale
      !> Mesh periods of transient at most.
      integer, intent(in) :: most_periods
      !> Mesh periods after which it nearly repeats itself; 0 if no period is worth a try.
      integer, intent(out) :: periods
      !> What its sections then differ by [m].
      real(wp), intent(out) :: recurrence

      real(wp) :: distances(longest_period), before
      integer :: k, short

      periods = 1
      recurrence = huge(1.0_wp)
      if (transient%periods == 0) return
      distances = [(transient%ring%distance(k), k=1, longest_period)]
      short = 0
      do k = 1, longest_period
         if (distances(periods) <= no_distance*scale) exit
         if (distances(k) < merge(clearly_nearer, much_clearer, is_told(k))*distances(periods)) periods = k
         if (short > 0 .or. periods > longest_named) cycle
         if (distances(periods) <= near_recurrence*scale .and. is_new(periods)) short = periods
      end do
      ! On a torus sections come back near soon, and much nearer only after many periods.
      if (short > 0) then
         if (transient%periods <= always_tried .or. distances(periods) > much_clearer*distances(short)) periods = short
      end if
      recurrence = distances(periods)
      if (periods > longest_named .and. (recurrence > long_recurrence*scale &
                                         .or. transient%periods < min(long_wait, most_periods/2))) then
         periods = max(short, 1)
         recurrence = distances(periods)
      end if
      if (.not. is_new(periods)) periods = 0
      if (.not. in_phase(self, transient) .or. transient%periods > min(trusted, most_periods/2)) return
      before = self%distance
      self%distance = weighted_norm(weight, transient%state - self%orbit%state)
      if (self%is_stable .and. self%distance <= merge(nearer, much_nearer, periods == self%orbit%periods)*before) periods = 0
      if (periods > 0 .and. mod(periods, self%orbit%periods) == 0 .and. &
          recurrence > merge(lies_apart, lies_far_apart, periods <= soon_told)*self%distance) periods = 0

   contains

      !> A motion of so many mesh periods is told from a spiral or a torus, or there has been time enough.
      pure function is_told(period) result(it_is)
         !> Mesh periods.
         integer, intent(in) :: period
         !> It is.
         logical :: it_is

         it_is = period <= soon_told .or. transient%periods > trusted
      end function is_told

      !> Newton's method has not been tried from so near yet.
      pure function is_new(period) result(it_is)
         !> Mesh periods.
         integer, intent(in) :: period
         !> It has not.
         logical :: it_is

         it_is = distances(period) <= merge(repeats_more_nearly, nearer, period <= longest_named)*self%missed(period)
      end function is_new

   end subroutine choose

   !> The transient is at the same phase of the motion as when it was met.
   pure function in_phase(self, transient) result(it_is)
      !> Candidate.
      class(candidate_type), intent(in) :: self
      !> The transient.
      type(transient_type), intent(in) :: transient
      !> It is.
      logical :: it_is

      it_is = .false.
      if (self%orbit%periods > 0) it_is = mod(transient%periods - self%met, self%orbit%periods) == 0
   end function in_phase

   !> Remember what Newton's method led to.
   pure subroutine remember(self, weight, transient, tried, recurrence, orbit, is_periodic, is_stable)
      !> Candidate.
      class(candidate_type), intent(inout) :: self
      !> Weights of the states, shape (size).
      real(wp), intent(in) :: weight(:)
      !> The transient that it began with.
      type(transient_type), intent(in) :: transient
      !> Mesh periods tried, and what the sections of the transient that far apart differ by [m].
      integer, intent(in) :: tried
      real(wp), intent(in) :: recurrence
      !> The periodic motion; if there is one it becomes the candidate, and its state and monodromy are taken from here.
      type(periodic_orbit), intent(inout) :: orbit
      !> There is one; it is stable.
      logical, intent(in) :: is_periodic, is_stable

      logical :: led_nowhere

      ! A multiple of the period says nothing of the motions that have that multiple.
      led_nowhere = merge(orbit%periods == tried, transient%periods > always_tried, is_periodic)
      if (.not. is_stable .and. led_nowhere) self%missed(tried) = recurrence
      if (.not. is_periodic) return
      self%distance = weighted_norm(weight, transient%state - orbit%state)
      call move_orbit(orbit, self%orbit)
      self%is_stable = is_stable
      self%met = transient%periods
   end subroutine remember

end module spurflex_steady_candidate
