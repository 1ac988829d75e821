!> Points whose teeth never part: the motion that the lanes have found is replaced by its Fourier series, and measured there.
module spurflex_measure_linear_points
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_ensemble, only: widen, narrow
   use spurflex_integrate_options, only: solver_options, integrator_collocation
   use spurflex_integrate_steps, only: aim
   use spurflex_measure_harmonic_motion, only: series_sampler, measure_harmonics
   use spurflex_measure_response, only: response, empty_response, describe_motion, contact_kept
   use spurflex_model_equations, only: equations_type
   use spurflex_measure_linear_parts, only: linear_parts
   use spurflex_steady_harmonic, only: harmonic_motion, find_harmonic_motion, section_of
   use spurflex_steady_orbit, only: periodic_orbit, contact_is_kept
   use spurflex_steady_outcome, only: steady_motion
   use spurflex_steady_search, only: describe_orbit
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
   subroutine measure_linear(parts, sampler, options, equations, part, few, members, motions, orbits, answers, complete)
      !> Linear parts.
      type(linear_parts), intent(in) :: parts
      !> Samples their series.
      type(series_sampler), intent(inout) :: sampler
      !> Tolerance, and whether multipliers are asked for.
      type(solver_options), intent(in) :: options
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, and what the mesh was taken to feel of it in the search, shape (n).
      integer, intent(in) :: part(:), few(:)
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
      real(wp), allocatable :: section(:), known(:)
      integer :: room, i

      do i = 1, size(members)
         associate (p => members(i), modal => parts%modal(part(members(i))), felt => parts%truncation(few(members(i)))%felt)
            if (motions(p)%periods /= 1 .or. .not. contact_is_kept(equations(p)%mesh%half_backlash, orbits(p))) cycle
            call find_harmonic_motion(modal, equations(p), series)
            if (series%order == 0) cycle
            section = section_of(modal, series)
            room = size(motions(p)%state)/2
            ! The search knows nothing of the modes that the mesh does not feel.
            known = merge(modal%weight, 0.0_wp, [felt, felt])
            if (weighted_norm(known, section - narrow(motions(p)%state, modal%modes)) > &
                same_motion*weighted_norm(known, section)) cycle
            measured = empty_response()
            call measure_harmonics(sampler, modal, equations(p), series, measured)
            if (measured%contact /= contact_kept) cycle
            if (options%multipliers) call describe_orbit(orbits(p), options, motions(p))
            motions(p)%state = widen(section, room)
            call describe_motion(motions(p), measured)
            answers(p) = measured
            complete(p) = measured%error_estimate <= aim*options%tolerance
         end associate
      end do
   end subroutine measure_linear

end module spurflex_measure_linear_points
