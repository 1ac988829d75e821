!> The record of one point: what was found, and how good it is.
module spurflex_measure_response
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use spurflex_base_kinds, only: wp
   use spurflex_steady_outcome, only: status_missing, status_settled, status_not_settled, status_diverged, status_inaccurate, &
      contact_kept, contact_lost, contact_both_flanks, motion_unresolved, motion_quasi_periodic, motion_chaotic
   implicit none
   private

   public :: response, empty_response, nan
   public :: status_missing, status_settled, status_not_settled, status_diverged, status_inaccurate
   public :: contact_kept, contact_lost, contact_both_flanks
   public :: motion_unresolved, motion_quasi_periodic, motion_chaotic

   !> Steady response of one point. Angles in rad, SI units.
   type :: response
      !> Half the peak-to-peak of y1 [m].
      real(wp) :: y1_amplitude
      !> Root mean square of y1 about its mean [m].
      real(wp) :: y1_rms
      !> Largest y1 [m].
      real(wp) :: y1_max
      !> Smallest y1 [m].
      real(wp) :: y1_min
      !> Largest bearing deformation of each gear, Eqs. (16)-(17) [m].
      real(wp) :: bearing_deformation_max(2)
      !> Estimated relative error of the amplitude [-].
      real(wp) :: error_estimate
      !> Largest modulus of the Floquet multipliers over the period of the motion [-].
      real(wp) :: floquet_magnitude
      !> Largest Lyapunov exponent and its standard error [1/mesh period].
      real(wp) :: lyapunov_exponent, lyapunov_error
      !> Mesh periods of the motion, or `motion_...`.
      integer :: motion
      !> `status_...`.
      integer :: status
      !> Mesh periods integrated to find the motion.
      integer :: periods_integrated
      !> `contact_...`.
      integer :: contact
   end type response

contains

   !> A quiet NaN: the value of a quantity that is not known.
   pure function nan() result(value)
      !> Not a number.
      real(wp) :: value

      value = ieee_value(1.0_wp, ieee_quiet_nan)
   end function nan

   !> A response in which nothing is known yet.
   pure function empty_response() result(empty)
      !> Every real is NaN, the status `status_missing`.
      type(response) :: empty

      empty%y1_amplitude = nan()
      empty%y1_rms = nan()
      empty%y1_max = nan()
      empty%y1_min = nan()
      empty%bearing_deformation_max = nan()
      empty%error_estimate = nan()
      empty%floquet_magnitude = nan()
      empty%lyapunov_exponent = nan()
      empty%lyapunov_error = nan()
      empty%motion = motion_unresolved
      empty%status = status_missing
      empty%periods_integrated = 0
      empty%contact = contact_kept
   end function empty_response

end module spurflex_measure_response
