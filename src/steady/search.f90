!> The steady motion that a start leads to.
!>
!> The transient is integrated; now and then Newton's method looks for a periodic motion near it. One that is found counts
!> only if it is stable and the transient is seen to approach it: either contact is kept on it and what is left of the
!> transient cannot part the teeth any more, or the transient follows the linearised map. Where nothing periodic is found,
!> the largest Lyapunov exponent of the transient tells the class of motion.
module spurflex_steady_search
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_ensemble, only: ensemble, solo_ensemble, new_solo
   use spurflex_integrate_options, only: solver_options
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_candidate, only: candidate_type
   use spurflex_steady_irregular, only: classify, may_decide
   use spurflex_steady_outcome, only: steady_motion, status_missing, status_settled, status_not_settled, status_diverged, &
      reason_non_finite, reason_max_periods, motion_unresolved, motion_of_periods
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit, move_orbit, contact_is_kept
   use spurflex_steady_stability, only: find_stable_orbits, largest_multiplier
   use spurflex_steady_transient, only: transient_type, begin_transient, watch_from_now, end_watch, advance_transients, &
      watches
   implicit none
   private

   public :: find_steady_motion, find_steady_motions, describe_orbit

   !> Mesh periods after which the transient is first searched, if the start itself is no good; doubled each time.
   integer, parameter :: first_look = 12

   !> Mesh periods at which the watches begin, each as long as all before it. The second one ends between two ends of the first:
   !> what had not arrived when that began is told a third of the time earlier.
   integer, parameter :: first_due(watches) = [0, 256]

   !> Mesh periods after which a transient is looked at again that should settle on a motion that keeps contact.
   integer, parameter :: glance = 2

   !> Periods of the motion over which the transient must follow the linearised map.
   integer, parameter :: confirmations = 3

   !> How nearly it must follow, beside its distance to the motion and beside the size of the motion.
   real(wp), parameter :: follows_distance = 0.05_wp, follows_size = 0.02_wp

   !> Distance to a motion, beside its size, that is no distance.
   real(wp), parameter :: arrived = 1.0e-9_wp

   !> Share of the clearance of a motion that the rest of a transient may take and surely never part the teeth.
   real(wp), parameter :: safe_share = 0.5_wp

contains

   !> Find the steady motion that a start leads to at one point.
   subroutine find_steady_motion(map, start, options, visitor, motion)
      !> Period map at an operating point.
      class(period_map), intent(inout), target :: map
      !> State at the first section, shape (size).
      real(wp), intent(in) :: start(:)
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The motion.
      type(steady_motion), intent(out) :: motion

      type(solo_ensemble) :: solo
      type(steady_motion) :: motions(1)
      type(periodic_orbit) :: orbits(1)

      call new_solo(map, solo)
      call find_steady_motions(solo, reshape(start, [size(start), 1]), options, visitor, motions, orbits)
      motion = motions(1)
   end subroutine find_steady_motion

   !> Find the steady motions that starts lead to at several points.
   subroutine find_steady_motions(points, starts, options, visitor, motions, orbits)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> State of each point at the first section, shape (size, points).
      real(wp), intent(in) :: starts(:, :)
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The motions, shape (points).
      type(steady_motion), intent(out) :: motions(:)
      !> The orbits of those that are periodic, shape (points).
      type(periodic_orbit), intent(out) :: orbits(:)

      type(transient_type) :: transients(size(motions))
      type(candidate_type) :: candidates(size(motions))
      integer :: due(watches), i
      integer, allocatable :: left(:)

      do i = 1, size(motions)
         call begin_transient(points%weight(:, i), points%in_use(:, i), starts(:, i), transients(i))
      end do
      left = [(i, i=1, size(motions))]
      due = first_due
      do
         call look_for_orbits(points, left, options, visitor, transients, candidates, motions, orbits)
         do i = 1, size(left)
            if (motions(left(i))%status /= status_missing .or. .not. transients(left(i))%sound) cycle
            call tell_class(transients(left(i)), options%max_periods, motions(left(i)))
         end do
         left = pack(left, motions(left)%status == status_missing .and. transients(left)%sound &
                     .and. transients(left)%periods < options%max_periods)
         if (size(left) == 0) exit
         call begin_watches(options%max_periods, transients, left, due)
         call advance_transients(points, left, spread(min(minval(due), options%max_periods), 1, size(left)), transients, visitor)
      end do
      do i = 1, size(motions)
         motions(i)%periods_integrated = motions(i)%periods_integrated + transients(i)%periods
         if (motions(i)%periods > 0) cycle
         motions(i)%state = transients(i)%state
         if (motions(i)%status /= status_missing) cycle
         motions(i)%motion = motion_unresolved
         motions(i)%status = merge(status_not_settled, status_diverged, transients(i)%sound)
         motions(i)%reason = merge(reason_max_periods, reason_non_finite, transients(i)%sound)
      end do
   end subroutine find_steady_motions

   !> The class of a motion that no periodic one was found for, by the watches over it.
   subroutine tell_class(transient, most_periods, motion)
      !> The transient.
      type(transient_type), intent(in) :: transient
      !> Most periods.
      integer, intent(in) :: most_periods
      !> The motion.
      type(steady_motion), intent(inout) :: motion

      type(steady_motion) :: told
      integer :: w

      do w = 1, watches
         if (motion%status /= status_missing .or. .not. transient%watch(w)%is_on) cycle
         told = motion
         call classify(transient%watch(w), transient%periods, most_periods, last_watch(most_periods), told)
         ! The first watch is the one that goes on to the end.
         if (w == 1 .or. told%status /= status_missing) motion = told
      end do
   end subroutine tell_class

   !> Begin the watches that are due, each as long as all that came before it.
   subroutine begin_watches(most_periods, transients, members, due)
      !> Most periods.
      integer, intent(in) :: most_periods
      !> The transients, shape (points).
      type(transient_type), intent(inout) :: transients(:)
      !> Which of them, shape (n); those with tangents first after.
      integer, intent(inout) :: members(:)
      !> Mesh period at which each watch ends and the next begins, shape (watches).
      integer, intent(inout) :: due(:)

      integer :: now, until, w, i

      now = minval(due)
      do w = 1, watches
         if (due(w) /= now) cycle
         due(w) = merge(first_look, 2*now, now == 0)
         until = due(w)
         ! The first watch lasts to the end if another would not have the time; it is looked at before, too.
         if (w == 1 .and. 2*until > most_periods) until = most_periods
         do i = 1, size(members)
            associate (transient => transients(members(i)))
               if (due(w) <= most_periods) then
                  ! A tangent is worth while in a watch that can decide on the class.
                  call watch_from_now(transient, w, until, grows=may_decide(transient%watch(w), until - now))
               else if (w > 1) then
                  call end_watch(transient, w)
               end if
            end associate
         end do
      end do
      ! Lanes without tangents need not wait for lanes with.
      members = [pack(members, transients(members)%grows), pack(members, .not. transients(members)%grows)]
   end subroutine begin_watches

   !> Look for stable periodic motions that the transients approach: those met before, then others.
   subroutine look_for_orbits(points, members, options, visitor, transients, candidates, motions, orbits)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The transients, shape (points); they go on while they are compared.
      type(transient_type), intent(inout) :: transients(:)
      !> What is remembered of each point, shape (points).
      type(candidate_type), intent(inout) :: candidates(:)
      !> The motions that are found, shape (points).
      type(steady_motion), intent(inout) :: motions(:)
      !> Their orbits, shape (points).
      type(periodic_orbit), intent(inout) :: orbits(:)

      type(periodic_orbit), allocatable :: near(:)
      integer, allocatable :: sound(:), known(:), periods(:)
      real(wp), allocatable :: scale(:), recurrence(:)
      logical, allocatable :: found(:), is_periodic(:)
      integer :: i, n

      sound = pack(members, transients(members)%sound)
      n = size(sound)
      allocate (periods(n), scale(n), recurrence(n))
      do i = 1, n
         associate (p => sound(i))
            scale(i) = max(transients(p)%ring%scale(), points%half_backlash, tiny(1.0_wp))
            call candidates(p)%choose(points%weight(:, p), transients(p), scale(i), options%max_periods, periods(i), &
                                      recurrence(i))
         end associate
      end do
      known = pack([(i, i=1, n)], [(candidates(sound(i))%may_follow(transients(sound(i))), i=1, n)])
      call keep_confirmed(sound(known))
      known = pack([(i, i=1, n)], periods > 0 .and. motions(sound)%status == status_missing .and. transients(sound)%sound)
      sound = sound(known)
      n = size(known)
      if (n == 0) return
      allocate (near(n), found(n), is_periodic(n))
      do i = 1, n
         near(i)%periods = periods(known(i))
         near(i)%state = transients(sound(i))%state
      end do
      call find_stable_orbits(points, sound, scale(known), visitor, near, found, &
                              only_affine=all(transients(sound)%periods == 0), roughly=.not. options%multipliers, &
                              periodic=is_periodic)
      do i = 1, n
         motions(sound(i))%periods_integrated = motions(sound(i))%periods_integrated + near(i)%integrated
         call candidates(sound(i))%remember(points%weight(:, sound(i)), transients(sound(i)), periods(known(i)), &
                                            recurrence(known(i)), near(i), is_periodic(i), found(i))
      end do
      call keep_confirmed(pack(sound, found))

   contains

      !> Keep those candidates that the transients are seen to approach.
      subroutine keep_confirmed(which)
         !> Points with a stable candidate, shape (n).
         integer, intent(in) :: which(:)

         logical :: confirmed(size(which))
         integer :: j

         confirmed = .true.
         call confirm_approach(points, which, candidates, visitor, transients, confirmed)
         do j = 1, size(which)
            if (.not. confirmed(j)) cycle
            call describe_orbit(candidates(which(j))%orbit, options, motions(which(j)))
            call move_orbit(candidates(which(j))%orbit, orbits(which(j)))
         end do
      end subroutine keep_confirmed

   end subroutine look_for_orbits

   !> The motion on a stable orbit.
   subroutine describe_orbit(orbit, options, motion)
      !> The orbit.
      type(periodic_orbit), intent(in) :: orbit
      !> Whether its multipliers are asked for.
      type(solver_options), intent(in) :: options
      !> The motion.
      type(steady_motion), intent(inout) :: motion

      motion%status = status_settled
      motion%periods = orbit%periods
      motion%motion = motion_of_periods(orbit%periods)
      motion%state = orbit%state
      if (.not. options%multipliers) return
      motion%floquet_magnitude = largest_multiplier(orbit)
      motion%lyapunov_exponent = log(max(motion%floquet_magnitude, tiny(1.0_wp)))/real(orbit%periods, wp)
      motion%lyapunov_error = 0.0_wp
   end subroutine describe_orbit

   !> Keep the orbits that the transients are on their way to.
   subroutine confirm_approach(points, members, candidates, visitor, transients, found)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> What is remembered of each point, with its orbit, shape (points).
      type(candidate_type), intent(in) :: candidates(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The transients, shape (points); they go on meanwhile.
      type(transient_type), intent(inout) :: transients(:)
      !> There is a stable orbit before; the transient approaches it after, shape (n).
      logical, intent(inout) :: found(:)

      real(wp) :: predicted(points%size, size(members)), away(points%size)
      integer, allocatable :: open(:)
      logical :: arrives(size(members))
      integer :: k, i

      open = pack([(i, i=1, size(members))], found)
      if (all(transients(members)%periods == 0)) then
         ! Nothing has moved yet: a start near enough, or a transient that comes near enough soon.
         do k = 0, first_look/glance
            if (k > 0) call advance_transients(points, members(open), transients(members(open))%periods + glance, transients, &
                                               visitor)
            do i = 1, size(open)
               associate (p => members(open(i)), orbit => candidates(members(open(i)))%orbit)
                  away = transients(p)%state - orbit%state
                  found(open(i)) = is_there(points, p, orbit, away)
               end associate
            end do
            open = pack(open, .not. found(open))
         end do
         return
      end if
      do i = 1, size(open)
         associate (p => members(open(i)), orbit => candidates(members(open(i)))%orbit)
            away = transients(p)%state - orbit%state
            arrives(i) = is_there(points, p, orbit, away)
         end associate
      end do
      open = pack(open, .not. arrives(:size(open)))
      do k = 1, confirmations
         open = pack(open, found(open))
         do i = 1, size(open)
            associate (orbit => candidates(members(open(i)))%orbit)
               away = transients(members(open(i)))%state - orbit%state
               predicted(:, i) = matmul(orbit%monodromy, away)
            end associate
         end do
         call advance_transients(points, members(open), transients(members(open))%periods &
                                 + candidates(members(open))%orbit%periods, transients, visitor)
         do i = 1, size(open)
            associate (transient => transients(members(open(i))), orbit => candidates(members(open(i)))%orbit)
               found(open(i)) = transient%sound
               if (.not. found(open(i))) cycle
               away = transient%state - orbit%state
               found(open(i)) = follows(points%weight(:, members(open(i))), orbit, away, away - predicted(:, i))
            end associate
         end do
      end do
   end subroutine confirm_approach

   !> A transient surely ends on an orbit: it is there, or contact is kept and cannot be lost any more.
   pure function is_there(points, member, orbit, away) result(it_is)
      !> The points.
      class(ensemble), intent(in) :: points
      !> Which of them.
      integer, intent(in) :: member
      !> The orbit.
      type(periodic_orbit), intent(in) :: orbit
      !> Distance of the transient, shape (size).
      real(wp), intent(in) :: away(:)
      !> It does.
      logical :: it_is

      real(wp) :: clearance

      it_is = weighted_norm(points%weight(:, member), away) <= arrived*weighted_norm(points%weight(:, member), orbit%state)
      if (it_is .or. .not. contact_is_kept(points%half_backlash, orbit)) return
      clearance = merge(orbit%smallest - points%half_backlash, -points%half_backlash - orbit%largest, orbit%smallest > 0.0_wp)
      it_is = points%deflection_bound(away) <= safe_share*clearance .or. .not. points%half_backlash > 0.0_wp
   end function is_there

   !> A transient follows the linearised map.
   pure function follows(weight, orbit, away, miss) result(it_does)
      !> Weights of the states, shape (size).
      real(wp), intent(in) :: weight(:)
      !> The orbit.
      type(periodic_orbit), intent(in) :: orbit
      !> Distance of the transient, and by how much the linearised map misses it, shape (size).
      real(wp), intent(in) :: away(:), miss(:)
      !> It does.
      logical :: it_does

      real(wp) :: size_of_motion, size_of_miss

      size_of_motion = weighted_norm(weight, orbit%state)
      size_of_miss = weighted_norm(weight, miss)
      it_does = size_of_miss <= arrived*size_of_motion .or. &
                (size_of_miss <= follows_distance*weighted_norm(weight, away) .and. size_of_miss <= follows_size*size_of_motion)
   end function follows

   !> Mesh periods over which a motion is watched the last time, if nothing was found before.
   pure function last_watch(most_periods) result(periods)
      !> Most periods.
      integer, intent(in) :: most_periods
      !> The periods.
      integer :: periods

      integer :: look

      look = first_look
      do while (2*look <= most_periods)
         look = 2*look
      end do
      periods = most_periods - look/2
   end function last_watch

end module spurflex_steady_search
