!> The steady motion that a start leads to.
!>
!> The transient is integrated; now and then Newton's method looks for a periodic motion near it. One that is found counts
!> only if it is stable and the transient is seen to approach it: either contact is kept on it and what is left of the
!> transient cannot part the teeth any more, or the transient follows the linearised map. Where nothing periodic is found,
!> the largest Lyapunov exponent of the transient tells the class of motion.
module spurflex_steady_search
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_options, only: solver_options
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_lyapunov, only: lyapunov_sum
   use spurflex_steady_outcome, only: steady_motion, status_settled, status_not_settled, status_diverged, &
      motion_unresolved, motion_quasi_periodic, motion_chaotic, motion_of_periods
   use spurflex_steady_sections, only: section_ring, weighted_norm, longest_period
   use spurflex_steady_shooting, only: periodic_orbit, contact_is_kept
   use spurflex_steady_stability, only: find_stable_orbit
   implicit none
   private

   public :: find_steady_motion

   !> Mesh periods after which the transient is first searched, if the start itself is no good; doubled each time.
   integer, parameter :: first_look = 12

   !> Mesh periods from which on the growth of a tangent is summed: the transient has taken its own direction by then.
   integer, parameter :: exponent_from = 64

   !> Periods of the motion over which the transient must follow the linearised map.
   integer, parameter :: confirmations = 3

   !> How nearly it must follow, beside its distance to the motion and beside the size of the motion.
   real(wp), parameter :: follows_distance = 0.05_wp, follows_size = 0.02_wp

   !> Distance to a motion, beside its size, that is no distance.
   real(wp), parameter :: arrived = 1.0e-9_wp

   !> Share of the clearance of a motion that the rest of a transient may take and surely never part the teeth.
   real(wp), parameter :: safe_share = 0.5_wp

   !> Standard errors by which an exponent must differ from zero.
   real(wp), parameter :: significance = 4.0_wp

   !> Growth of a tangent, in units of its logarithm, that says nothing however long it is summed: on a torus it wanders by a
   !> few units. Over T periods an exponent below this over T is therefore called zero.
   real(wp), parameter :: neutral_growth = 10.0_wp

   !> Mesh periods over which a motion that is called quasi-periodic must have been watched.
   integer, parameter :: fewest_periods = 512

   !> Relative difference of the ranges of two halves of a motion that has arrived.
   real(wp), parameter :: same_range = 0.05_wp

   !> A state of this norm has left every physical range; far below overflow [m].
   real(wp), parameter :: diverged_norm = 1.0e100_wp

   !> A transient under way.
   type :: transient_type
      !> State at the latest section, tangent, shape (1, size).
      real(wp), allocatable :: state(:), tangent(:, :)
      !> Latest sections.
      type(section_ring) :: ring
      !> Growth of the tangent.
      type(lyapunov_sum) :: growth
      !> Mesh periods integrated.
      integer :: periods = 0
      !> The state is finite.
      logical :: sound = .true.
      !> Norms of the sections while the growth is summed: extremes over the first and the second half [m].
      real(wp) :: low(2) = huge(1.0_wp), high(2) = -huge(1.0_wp)
      !> Mesh period at which the second half begins.
      integer :: half = 0
   end type transient_type

contains

   !> Find the steady motion that a start leads to.
   subroutine find_steady_motion(map, start, options, visitor, motion)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> State at the first section, shape (size).
      real(wp), intent(in) :: start(:)
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The motion.
      type(steady_motion), intent(out) :: motion

      type(transient_type) :: transient
      integer :: next_look, spent
      logical :: found

      transient%state = start
      allocate (transient%tangent(1, size(start)), source=1.0_wp)
      transient%tangent = transient%tangent/weighted_norm(map%weight, transient%tangent(1, :))
      call transient%ring%reset(map%weight)
      call transient%ring%add(start)
      next_look = first_look
      spent = 0
      do
         call look_for_orbit(map, transient, options, visitor, spent, motion, found)
         if (found .or. .not. transient%sound .or. transient%periods >= options%max_periods) exit
         ! The exponent is that of the latest half or more: what came before was still on its way.
         if (next_look <= options%max_periods) then
            call transient%growth%reset()
            transient%low = huge(1.0_wp)
            transient%high = -huge(1.0_wp)
            transient%half = (transient%periods + min(2*next_look - 1, options%max_periods))/2
         end if
         call advance_transient(map, transient, min(next_look, options%max_periods), visitor)
         if (.not. transient%sound) exit
         next_look = 2*next_look
      end do
      motion%periods_integrated = transient%periods + spent
      if (found) return
      motion%state = transient%state
      if (transient%sound) then
         call classify(transient, motion)
      else
         motion%status = status_diverged
         motion%motion = motion_unresolved
      end if
   end subroutine find_steady_motion

   !> Integrate the transient up to some period.
   subroutine advance_transient(map, transient, until, visitor)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> The transient.
      type(transient_type), intent(inout) :: transient
      !> Mesh periods in all.
      integer, intent(in) :: until
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor

      real(wp) :: norm
      integer :: which

      do while (transient%periods < until)
         if (transient%periods < exponent_from) then
            call map%advance(transient%state)
         else
            call map%advance(transient%state, transient%tangent)
            call transient%growth%add(map%weight, transient%tangent(1, :))
         end if
         call transient%ring%add(transient%state)
         transient%periods = transient%periods + 1
         norm = weighted_norm(map%weight, transient%state)
         transient%sound = norm < diverged_norm
         which = merge(1, 2, transient%periods <= transient%half)
         transient%low(which) = min(transient%low(which), norm)
         transient%high(which) = max(transient%high(which), norm)
         if (.not. transient%sound) return
         call visitor%attend()
      end do
   end subroutine advance_transient

   !> Look for a stable periodic motion that the transient approaches.
   subroutine look_for_orbit(map, transient, options, visitor, spent, motion, found)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> The transient; goes on while it is compared.
      type(transient_type), intent(inout) :: transient
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> Mesh periods spent on Newton's method, counted up.
      integer, intent(inout) :: spent
      !> The motion, if there is one.
      type(steady_motion), intent(inout) :: motion
      !> There is one.
      logical, intent(out) :: found

      type(periodic_orbit) :: orbit
      real(wp) :: distance, magnitude
      integer :: n

      call transient%ring%nearest(n, distance)
      call find_stable_orbit(map, transient%state, n, max(transient%ring%scale(), abs(map%half_backlash)), visitor, orbit, &
                             magnitude, spent, found, only_affine=transient%periods == 0)
      if (.not. found) return
      call approaches(map, orbit, transient, options, visitor, found)
      if (.not. found) return
      motion%status = status_settled
      motion%periods = orbit%periods
      motion%motion = motion_of_periods(orbit%periods)
      motion%floquet_magnitude = magnitude
      motion%lyapunov_exponent = log(max(motion%floquet_magnitude, tiny(1.0_wp)))/real(orbit%periods, wp)
      motion%lyapunov_error = 0.0_wp
      motion%state = orbit%state
   end subroutine look_for_orbit

   !> The transient is on its way to a stable motion.
   subroutine approaches(map, orbit, transient, options, visitor, it_does)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> The motion.
      type(periodic_orbit), intent(in) :: orbit
      !> The transient; goes on meanwhile.
      type(transient_type), intent(inout) :: transient
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> It is.
      logical, intent(out) :: it_does

      real(wp), dimension(size(orbit%state)) :: away, predicted
      real(wp) :: size_of_motion, miss, clearance
      integer :: k

      size_of_motion = max(weighted_norm(map%weight, orbit%state), 0.0_wp)
      away = transient%state - orbit%state
      if (contact_is_kept(map, orbit)) then
         clearance = merge(orbit%smallest - map%half_backlash, -map%half_backlash - orbit%largest, orbit%smallest > 0.0_wp)
         it_does = map%deflection_bound(away) <= safe_share*clearance
         if (it_does .or. .not. map%half_backlash > 0.0_wp) then
            it_does = .true.
            return
         end if
      end if
      it_does = weighted_norm(map%weight, away) <= arrived*size_of_motion
      if (it_does .or. transient%periods == 0) return
      do k = 1, confirmations
         predicted = matmul(orbit%monodromy, away)
         call advance_transient(map, transient, transient%periods + orbit%periods, visitor)
         if (.not. transient%sound) return
         away = transient%state - orbit%state
         miss = weighted_norm(map%weight, away - predicted)
         if (miss > arrived*size_of_motion) then
            if (miss > follows_distance*weighted_norm(map%weight, away) .or. miss > follows_size*size_of_motion) return
         end if
         if (transient%periods > options%max_periods + confirmations*longest_period) return
      end do
      it_does = .true.
   end subroutine approaches

   !> The class of a motion in which nothing periodic was found.
   pure subroutine classify(transient, motion)
      !> The transient.
      type(transient_type), intent(in) :: transient
      !> The motion.
      type(steady_motion), intent(inout) :: motion

      real(wp) :: neutral, wander
      integer :: periods

      call transient%growth%exponent(motion%lyapunov_exponent, motion%lyapunov_error, periods, wander)
      neutral = neutral_growth/real(max(periods, 1), wp)
      motion%status = status_settled
      if (motion%lyapunov_exponent > neutral + significance*motion%lyapunov_error) then
         motion%motion = motion_chaotic
      else if (wander <= neutral_growth .and. periods >= fewest_periods .and. .not. drifts(transient)) then
         motion%motion = motion_quasi_periodic
      else
         motion%motion = motion_unresolved
         motion%status = status_not_settled
      end if
   end subroutine classify

   !> A motion is still on its way: its sections range over more, or less, in the second half than in the first.
   pure function drifts(transient) result(it_does)
      !> The transient.
      type(transient_type), intent(in) :: transient
      !> It is.
      logical :: it_does

      real(wp) :: range(2)

      range = max(transient%high - transient%low, 0.0_wp)
      it_does = abs(range(2) - range(1)) > same_range*maxval(range)
   end function drifts

end module spurflex_steady_search
