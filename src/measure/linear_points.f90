!> Points whose teeth never part: the motion that the lanes have found is replaced by its Fourier series, and measured there.
module spurflex_measure_linear_points
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_ensemble, only: lane_ensemble, widen
   use spurflex_integrate_options, only: solver_options, integrator_collocation
   use spurflex_integrate_steps, only: aim
   use spurflex_measure_harmonic_motion, only: series_sampler, measure_harmonics
   use spurflex_measure_response, only: response, empty_response, describe_motion, contact_kept
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system
   use spurflex_steady_harmonic, only: harmonic_motion, find_harmonic_motion, section_of
   use spurflex_steady_orbit, only: periodic_orbit, contact_is_kept
   use spurflex_steady_outcome, only: steady_motion
   use spurflex_steady_sections, only: weighted_norm
   implicit none
   private

   public :: harmonics_do, measure_linear

   !> Distance, beside its size, of the series of a motion that keeps contact from what the lanes found: the error of their steps.
   real(wp), parameter :: same_motion = 1.0e-2_wp

contains

   !> Motions that keep contact need not be integrated: the steps are free, and no method is asked for that has errors of its own.
   pure function harmonics_do(options) result(they_do)
      !> Options.
      type(solver_options), intent(in) :: options
      !> They need not.
      logical :: they_do

      they_do = options%integrator == integrator_collocation .and. options%steps_per_period == 0
   end function harmonics_do

   !> Measure the motions that keep contact by their Fourier series.
   subroutine measure_linear(points, sampler, modals, tolerance, equations, part, members, motions, orbits, answers, complete)
      !> The points.
      type(lane_ensemble), intent(in) :: points
      !> Samples their series.
      type(series_sampler), intent(inout) :: sampler
      !> Modes of the linear parts that there are.
      type(modal_system), intent(in) :: modals(:)
      !> Relative error of the amplitude that is asked for.
      real(wp), intent(in) :: tolerance
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, shape (n).
      integer, intent(in) :: part(:)
      !> Which of them.
      integer, intent(in) :: members(:)
      !> The motions; those measured move to the section of the series, shape (n).
      type(steady_motion), intent(inout) :: motions(:)
      !> Their orbits, shape (n).
      type(periodic_orbit), intent(in) :: orbits(:)
      !> The responses, shape (n).
      type(response), intent(inout) :: answers(:)
      !> The response meets the tolerance, shape (n).
      logical, intent(inout) :: complete(:)

      type(harmonic_motion) :: series
      type(response) :: measured
      real(wp) :: section(points%size)
      integer :: i

      do i = 1, size(members)
         associate (p => members(i), modal => modals(part(members(i))))
            if (motions(p)%periods /= 1 .or. .not. contact_is_kept(points%half_backlash, orbits(p))) cycle
            call find_harmonic_motion(modal, equations(p), series)
            if (series%order == 0) cycle
            section = widen(section_of(modal, series), points%size/2)
            if (weighted_norm(points%weight(:, p), section - motions(p)%state) > &
                same_motion*weighted_norm(points%weight(:, p), section)) cycle
            measured = empty_response()
            call measure_harmonics(sampler, modal, equations(p), series, measured)
            if (measured%contact /= contact_kept) cycle
            motions(p)%state = section
            call describe_motion(motions(p), measured)
            answers(p) = measured
            complete(p) = measured%error_estimate <= aim*tolerance
         end associate
      end do
   end subroutine measure_linear

end module spurflex_measure_linear_points
