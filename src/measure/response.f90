!> The record of one point: what was found, and how good it is.
module spurflex_measure_response
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_finite
   use spurflex_base_kinds, only: wp
   use spurflex_model_equations, only: equations_type
   use spurflex_steady_lyapunov, only: unknown
   use spurflex_steady_outcome, only: status_missing, status_settled, status_not_settled, status_diverged, status_inaccurate, &
      reason_none, reason_non_finite, reason_no_step, reason_max_periods, reason_given_steps, reason_most_steps, &
      reason_not_confirmed, contact_kept, contact_lost, contact_both_flanks, motion_unresolved, motion_quasi_periodic, &
      motion_chaotic, steady_motion
   implicit none
   private

   public :: response, empty_response, nan, contact_of, describe_motion, relative_difference
   public :: status_missing, status_settled, status_not_settled, status_diverged, status_inaccurate
   public :: reason_none, reason_non_finite, reason_no_step, reason_max_periods, reason_given_steps, reason_most_steps, &
      reason_not_confirmed
   public :: contact_kept, contact_lost, contact_both_flanks
   public :: motion_unresolved, motion_quasi_periodic, motion_chaotic

   !> Relative difference of displacements that is round-off.
   real(wp), parameter :: roundoff = 1.0e-14_wp

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
      !> Largest Lyapunov exponent and its error [1/mesh period].
      real(wp) :: lyapunov_exponent, lyapunov_error
      !> Mesh periods of the motion, or `motion_...`.
      integer :: motion
      !> `status_...`.
      integer :: status
      !> Why it is not settled: `reason_...`.
      integer :: reason
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
      empty%reason = reason_none
      empty%periods_integrated = 0
      empty%contact = contact_kept
   end function empty_response

   !> Put what the search found into a response.
   pure subroutine describe_motion(motion, answer)
      !> The motion.
      type(steady_motion), intent(in) :: motion
      !> The response.
      type(response), intent(inout) :: answer

      answer%status = motion%status
      answer%reason = motion%reason
      answer%motion = motion%motion
      answer%periods_integrated = motion%periods_integrated
      if (motion%lyapunov_error < unknown) then
         answer%lyapunov_exponent = motion%lyapunov_exponent
         answer%lyapunov_error = motion%lyapunov_error
      end if
      if (motion%periods > 0) answer%floquet_magnitude = motion%floquet_magnitude
   end subroutine describe_motion

   !> Whether the teeth part.
   pure function contact_of(smallest, largest, half_backlash) result(contact)
      !> Extremes of the mesh deflection [m].
      real(wp), intent(in) :: smallest, largest
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> `contact_...`.
      integer :: contact

      if (smallest >= half_backlash .or. largest <= -half_backlash) then
         contact = contact_kept
      else if (largest >= half_backlash .and. smallest <= -half_backlash) then
         contact = contact_both_flanks
      else
         contact = contact_lost
      end if
   end function contact_of

   !> The largest relative difference of two responses in amplitude and in bearing deformation.
   pure function relative_difference(equations, a, b) result(difference)
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Both responses.
      type(response), intent(in) :: a, b
      !> Relative difference; zero where they differ by round-off of the static displacements, huge where one is not finite.
      real(wp) :: difference

      real(wp) :: noise

      difference = huge(1.0_wp)
      if (.not. all(ieee_is_finite([a%y1_amplitude, a%y1_rms, a%bearing_deformation_max, b%y1_amplitude, b%y1_rms, &
                                    b%bearing_deformation_max]))) return
      noise = roundoff*max(abs(equations%static_deflection), maxval(abs(equations%static_observation(2:))))
      difference = maxval(max(abs([a%y1_amplitude - b%y1_amplitude, a%bearing_deformation_max - b%bearing_deformation_max]) &
                              - noise, 0.0_wp)/max([b%y1_amplitude, b%bearing_deformation_max], tiny(1.0_wp)))
   end function relative_difference

end module spurflex_measure_response
