!> The class of a motion in which nothing periodic was found: quasi-periodic, chaotic, or not to be told yet.
module spurflex_steady_irregular
   use spurflex_base_kinds, only: wp
   use spurflex_steady_lyapunov, only: unknown
   use spurflex_steady_outcome, only: steady_motion, status_settled, motion_quasi_periodic, motion_chaotic
   use spurflex_steady_watch, only: watch_type
   implicit none
   private

   public :: classify, may_decide

   !> Standard errors by which an exponent must differ from zero.
   real(wp), parameter :: significance = 4.0_wp

   !> Growth of a tangent, in units of its logarithm, that says nothing however long it is summed: on a torus it wanders by a
   !> few units. Over T periods an exponent below this over T is therefore called zero.
   real(wp), parameter :: neutral_growth = 10.0_wp

   !> Weighted mean of the growth that is none, whatever the periods: on the tori of the paper's gears it is some 1e-4 after 768.
   real(wp), parameter :: no_growth = 2.0e-3_wp

   !> Share of the last watch that counts as all of it: blocks of growth that are not full are left out.
   real(wp), parameter :: whole_watch = 0.9_wp

   !> Mesh periods over which a motion that is called quasi-periodic or chaotic must have been watched; fewer if it is plainly
   !> quasi-periodic.
   integer, parameter :: fewest_periods = 512, fewest_if_plain = 384

   !> Drift of a motion that has arrived; of one that cannot be watched any longer; of one that has been watched over fewer periods.
   real(wp), parameter :: arrived_drift = 0.025_wp, last_drift = 0.05_wp, plain_drift = 0.002_wp

   !> Drift from which a motion hardly arrives within the next few hundred periods.
   real(wp), parameter :: far_drift = 0.1_wp

contains

   !> A watch may decide on the class of a motion, so that a tangent is worth while.
   pure function may_decide(before, periods) result(it_may)
      !> What was seen in the watch before.
      type(watch_type), intent(in) :: before
      !> Mesh periods of the watch.
      integer, intent(in) :: periods
      !> It may.
      logical :: it_may

      it_may = periods >= merge(fewest_periods, fewest_if_plain, before%drift() > far_drift)
   end function may_decide

   !> The class of a motion in which nothing periodic was found; its status remains `status_missing` where it cannot be told.
   !>
   !> Whatever the periods watched, an exponent is called zero to the same resolution, that of the last watch: a tangent whose
   !> growth wanders less than that in a shorter watch need not be watched longer. Nor need one whose weighted growth vanishes.
   !> What still drifts is on its way to this motion only if it drifts less and less; else it is left to a later watch.
   pure subroutine classify(watch, at, most_periods, last_watch, motion)
      !> What has been seen of it.
      type(watch_type), intent(in) :: watch
      !> Mesh periods integrated.
      integer, intent(in) :: at
      !> Most periods; chaos is watched as long, for the sake of its exponent.
      integer, intent(in) :: most_periods
      !> Mesh periods over which it is watched the last time.
      integer, intent(in) :: last_watch
      !> The motion.
      type(steady_motion), intent(inout) :: motion

      real(wp) :: neutral, wander, smooth, smooth_error, drift, still
      integer :: periods
      logical :: at_last, vanishes

      call watch%growth%exponent(motion%lyapunov_exponent, motion%lyapunov_error, periods, wander)
      if (periods < fewest_if_plain) return
      call watch%growth%smooth_exponent(smooth, smooth_error)
      vanishes = smooth_error < unknown .and. abs(smooth) <= no_growth
      at_last = at >= most_periods
      still = plain_drift
      if (periods >= fewest_periods) still = merge(last_drift, arrived_drift, at_last)
      if (periods >= fewest_periods) then
         neutral = neutral_growth/real(periods, wp)
         if (motion%lyapunov_exponent > neutral + significance*motion%lyapunov_error) then
            motion%motion = motion_chaotic
            if (at_last) motion%status = status_settled
            return
         end if
         vanishes = vanishes .or. wander <= neutral_growth*min(real(periods, wp)/(whole_watch*real(last_watch, wp)), 1.0_wp)
      end if
      drift = watch%drift()
      if (.not. vanishes .or. drift > still) return
      ! In the end there is no later watch to be left to.
      if (.not. at_last .and. drift > plain_drift .and. .not. watch%comes_to_rest()) return
      motion%motion = motion_quasi_periodic
      motion%status = status_settled
      if (smooth_error >= unknown) return
      motion%lyapunov_exponent = smooth
      motion%lyapunov_error = smooth_error
   end subroutine classify

end module spurflex_steady_irregular
