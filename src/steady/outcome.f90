!> What the search for the steady motion of a point ends with.
module spurflex_steady_outcome
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: steady_motion
   public :: status_missing, status_settled, status_not_settled, status_diverged, status_inaccurate
   public :: reason_none, reason_non_finite, reason_no_step, reason_max_periods, reason_given_steps, reason_most_steps, &
      reason_not_confirmed
   public :: contact_kept, contact_lost, contact_both_flanks
   public :: motion_unresolved, motion_quasi_periodic, motion_chaotic, motion_of_periods, periods_of_motion, longest_named

   !> The point has not been computed yet.
   integer, parameter :: status_missing = 0
   !> The steady motion is known: a stable periodic motion that the start leads to, or a class of motion that is not periodic.
   integer, parameter :: status_settled = 1
   !> The most periods allowed went by before the motion could be told; measured all the same.
   integer, parameter :: status_not_settled = 2
   !> The state became infinite or not a number.
   integer, parameter :: status_diverged = 3
   !> The steady motion is known, but its estimated error exceeds the tolerance, with the steps given or with the most there are.
   integer, parameter :: status_inaccurate = 4

   !> Why a point is not settled: nothing stands in the way.
   integer, parameter :: reason_none = 0
   !> The state became infinite or not a number.
   integer, parameter :: reason_non_finite = 1
   !> The equations of motion cannot be integrated with the steps tried.
   integer, parameter :: reason_no_step = 2
   !> The motion could not be told within the most periods of transient.
   integer, parameter :: reason_max_periods = 3
   !> The steps that were given miss the tolerance.
   integer, parameter :: reason_given_steps = 4
   !> The most steps there are miss the tolerance.
   integer, parameter :: reason_most_steps = 5
   !> The integrator that judges the motion does not find it.
   integer, parameter :: reason_not_confirmed = 6

   !> The teeth never part.
   integer, parameter :: contact_kept = 0
   !> The teeth part.
   integer, parameter :: contact_lost = 1
   !> The teeth part and strike on the back flank.
   integer, parameter :: contact_both_flanks = 2

   !> The motion class could not be told.
   integer, parameter :: motion_unresolved = 0
   !> Not periodic, without sensitive dependence on the state.
   integer, parameter :: motion_quasi_periodic = 20
   !> Sensitive dependence on the state: the largest Lyapunov exponent is positive.
   integer, parameter :: motion_chaotic = 30

   !> Longest motion whose class is its number of mesh periods; longer ones have `long_period` added to it.
   integer, parameter :: longest_named = 8
   integer, parameter :: long_period = 100

   !> The steady motion of one point.
   type :: steady_motion
      !> Class: mesh periods after which the motion repeats (`motion_of_periods`), or `motion_...`.
      integer :: motion = motion_unresolved
      !> Mesh periods after which the motion repeats, 0 if it does not.
      integer :: periods = 0
      !> `status_...`.
      integer :: status = status_missing
      !> Why it is not settled: `reason_...`.
      integer :: reason = reason_none
      !> Mesh periods integrated to find it.
      integer :: periods_integrated = 0
      !> Largest modulus of the Floquet multipliers over the period of the motion; meaningless where it is not periodic [-].
      real(wp) :: floquet_magnitude = 0.0_wp
      !> Largest Lyapunov exponent and its error [1/mesh period].
      real(wp) :: lyapunov_exponent = 0.0_wp, lyapunov_error = 0.0_wp
      !> State of the period map at a section of the motion, shape (size).
      real(wp), allocatable :: state(:)
   end type steady_motion

contains

   !> Class of a periodic motion: n up to eight mesh periods, 100 + n for longer ones.
   elemental function motion_of_periods(periods) result(motion)
      !> Mesh periods after which it repeats.
      integer, intent(in) :: periods
      !> The class.
      integer :: motion

      motion = periods
      if (periods > longest_named) motion = long_period + periods
   end function motion_of_periods

   !> Mesh periods after which a motion of some class repeats.
   elemental function periods_of_motion(motion) result(periods)
      !> The class.
      integer, intent(in) :: motion
      !> Mesh periods; 0 if it does not repeat, or is not known to.
      integer :: periods

      periods = 0
      if (motion >= 1 .and. motion <= longest_named) periods = motion
      if (motion > long_period) periods = motion - long_period
   end function periods_of_motion

end module spurflex_steady_outcome
