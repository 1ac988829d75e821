!> Motions that keep contact as Fourier series, against integration and against closed forms.
module test_harmonic
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use spurflex_base_kinds, only: wp
   use spurflex_base_error, only: library_error => error_type
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_measure_harmonic_motion, only: measure_harmonics, series_sampler
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: empty_response, relative_difference, response
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_modal, only: from_modes, modal_system, new_modal_system
   use spurflex_model_parameters, only: gear_pair
   use spurflex_steady_harmonic, only: find_harmonic_motion, harmonic_motion, section_of
   use spurflex_steady_outcome, only: contact_kept, contact_lost
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_harmonic

   !> Steps of collocation of order eight that leave round-off only, and what that and the digits lost in a period amount to,
   !> beside the motion. Extremes between the steps are found to order six.
   integer, parameter :: fine_steps = 400
   real(wp), parameter :: fine_error = 1.0e-10_wp, extreme_error = 1.0e-9_wp

   !> Round-off of a small complex system whose modes were found as eigenvalues.
   real(wp), parameter :: roundoff = 1.0e-11_wp

contains

   !> The tests of this suite.
   subroutine collect_harmonic(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('a period of integration leads back to the section', test_section), &
                  new_unittest('displacements are those of an integrated period', test_displacements), &
                  new_unittest('several harmonics, and a load on the back flank', test_harmonics), &
                  new_unittest('constant stiffness: the frequency response', test_frequency_response), &
                  new_unittest('a motion that loses contact is told', test_contact_lost), &
                  new_unittest('no excitation, no motion', test_no_excitation) &
                  ]
   end subroutine collect_harmonic

   !> Equations of points that keep contact: low speed, both supports, soft and stiff.
   subroutine set_points(gears, equations)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> The equations.
      type(equations_type), allocatable, intent(out) :: equations(:)

      equations = [new_equations(gears, reference_box(), reference_load(), rigid_point(700.0_wp)), &
                   new_equations(gears, reference_box(), reference_load(), flexible_point(300.0_wp, 1.0e3_wp)), &
                   new_equations(gears, reference_box(), reference_load(), flexible_point(480.0_wp, 2.5e8_wp)), &
                   new_equations(gears, reference_box(), reference_load(), flexible_point(1500.0_wp, 1.0e12_wp))]
   end subroutine set_points

   !> Integrate a period from the section of the series.
   subroutine integrate_period(equations, error, away, answer, series_answer)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Set where a library call fails.
      type(error_type), allocatable, intent(out) :: error
      !> Distance from the section after a period, beside its size [-].
      real(wp), intent(out) :: away
      !> The period measured by its steps, and by the series.
      type(response), intent(out) :: answer, series_answer

      type(modal_system) :: modal
      type(library_error), allocatable :: failed
      type(harmonic_motion) :: motion
      type(series_sampler) :: sampler
      type(collocation_map) :: map
      type(orbit_type) :: orbit
      type(motion_measure) :: measure
      real(wp), allocatable :: position(:), velocity(:), state(:), section(:)

      away = huge(away)
      answer = empty_response()
      series_answer = empty_response()
      call new_modal_system(equations, modal, failed)
      call check(error, .not. allocated(failed), 'the modes are found')
      if (allocated(error)) return
      call find_harmonic_motion(modal, equations, motion)
      call check(error, motion%order > 0, 'the series converges')
      if (allocated(error)) return
      call measure_harmonics(sampler, modal, equations, motion, series_answer)
      call map%load(equations, fine_steps, failed)
      call check(error, .not. allocated(failed), 'the map is loaded')
      if (allocated(error)) return
      call from_modes(modal, section_of(modal, motion), position, velocity)
      section = map%to_state(position, velocity)
      state = section
      call measure%reset(equations%static_observation)
      call map%advance(state, orbit=orbit)
      call measure%add(orbit)
      call measure%finish(answer)
      away = norm2(map%weight*(state - section))/norm2(map%weight*section)
   end subroutine integrate_period

   !> The section of the series is a fixed point of the map over a period.
   subroutine test_section(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type), allocatable :: equations(:)
      type(response) :: answer, series_answer
      real(wp) :: away
      integer :: i

      call set_points(reference_gears(), equations)
      do i = 1, size(equations)
         call integrate_period(equations(i), error, away, answer, series_answer)
         if (allocated(error)) return
         call check(error, away, 0.0_wp, fine_error, 'the period ends where it began')
         if (allocated(error)) return
      end do
   end subroutine test_section

   !> Amplitude, rms, extremes and bearing deformations agree with those of the steps.
   subroutine test_displacements(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type), allocatable :: equations(:)
      integer :: i

      call set_points(reference_gears(), equations)
      do i = 1, size(equations)
         call compare_measures(equations(i), error)
         if (allocated(error)) return
      end do
   end subroutine test_displacements

   !> Compare the measures of the series with those of an integrated period.
   subroutine compare_measures(equations, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(response) :: answer, series_answer
      real(wp) :: away

      call integrate_period(equations, error, away, answer, series_answer)
      if (allocated(error)) return
      call check(error, relative_difference(equations, series_answer, answer), 0.0_wp, extreme_error, &
                 'amplitude and bearing deformations')
      if (allocated(error)) return
      call check(error, series_answer%y1_rms, answer%y1_rms, extreme_error, 'rms', relative=.true.)
      if (allocated(error)) return
      call check(error, series_answer%y1_max - series_answer%y1_min, answer%y1_max - answer%y1_min, extreme_error, &
                 'extremes', relative=.true.)
      if (allocated(error)) return
      call check(error, series_answer%y1_max, answer%y1_max, extreme_error*abs(answer%y1_max), 'largest y1')
      if (allocated(error)) return
      call check(error, series_answer%contact == contact_kept, 'contact is kept')
      if (allocated(error)) return
      call check(error, series_answer%error_estimate <= extreme_error, 'the estimate is that of round-off')
   end subroutine compare_measures

   !> Several harmonics of stiffness and of transmission error with phases; the load turned round.
   subroutine test_harmonics(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(equations_type), allocatable :: equations(:)
      integer :: i

      gears = reference_gears()
      gears%mesh%stiffness_coefficients = [0.2_wp, 0.1_wp, 0.05_wp]
      gears%mesh%stiffness_phases = [0.3_wp, 1.1_wp, -0.7_wp]
      gears%mesh%error_amplitudes = [2.0e-6_wp, 1.0e-6_wp]
      gears%mesh%error_phases = [0.9_wp, -1.3_wp]
      call set_points(gears, equations)
      do i = 1, size(equations)
         call compare_measures(equations(i), error)
         if (allocated(error)) return
         equations(i)%mean_force = -equations(i)%mean_force
         equations(i)%static_deflection = -equations(i)%static_deflection
         call compare_measures(equations(i), error)
         if (allocated(error)) return
      end do
   end subroutine test_harmonics

   !> With a constant mesh stiffness the line of order one is that of the matrices: (K - w^2 M + i w C)^-1.
   subroutine test_frequency_response(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      type(gear_pair) :: gears
      type(equations_type) :: equations
      type(modal_system) :: modal
      type(library_error), allocatable :: failed
      type(harmonic_motion) :: motion
      complex(wp), allocatable :: dynamic(:, :), answer(:)
      complex(wp) :: line, expected, excitation
      integer :: k

      gears = reference_gears()
      gears%mesh%stiffness_coefficients = [0.0_wp]
      equations = new_equations(gears, reference_box(), reference_load(), flexible_point(900.0_wp, 2.5e8_wp))
      call new_modal_system(equations, modal, failed)
      call check(error, .not. allocated(failed), 'the modes are found')
      if (allocated(error)) return
      call find_harmonic_motion(modal, equations, motion)
      call check(error, motion%order > 0, 'the series converges')
      if (allocated(error)) return
      associate (w => equations%frequency, mesh => gears%mesh, g => equations%direction)
         allocate (dynamic(equations%n, equations%n))
         do k = 1, equations%n
            dynamic(:, k) = -w**2*equations%mass(:, k) + g*g(k)*(mesh%mean_stiffness + i*w*mesh%damping)
            dynamic(k, k) = dynamic(k, k) + equations%stiffness(k) + i*w*equations%damping(k)
         end do
         line = -0.5_wp*i*mesh%error_amplitudes(1)
         excitation = (mesh%mean_stiffness + i*w*mesh%damping)*line
         answer = solve(dynamic, -excitation*g)
         expected = sum(g*answer) + line
      end associate
      call check(error, abs(motion%deflection(1) - expected), 0.0_wp, roundoff*abs(expected), 'first harmonic')
      if (allocated(error)) return
      call check(error, maxval(abs(motion%deflection(2:))), 0.0_wp, roundoff*abs(expected), 'no other')
      if (allocated(error)) return
      call check(error, real(motion%deflection(0), wp), equations%static_deflection, roundoff, 'mean', relative=.true.)
   end subroutine test_frequency_response

   !> In the main resonance the series would leave the flank.
   subroutine test_contact_lost(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type) :: equations
      type(modal_system) :: modal
      type(library_error), allocatable :: failed
      type(harmonic_motion) :: motion
      type(series_sampler) :: sampler
      type(response) :: answer

      equations = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(3200.0_wp))
      call new_modal_system(equations, modal, failed)
      call check(error, .not. allocated(failed), 'the modes are found')
      if (allocated(error)) return
      call find_harmonic_motion(modal, equations, motion)
      call check(error, motion%order > 0, 'the series converges')
      if (allocated(error)) return
      answer = empty_response()
      call measure_harmonics(sampler, modal, equations, motion, answer)
      call check(error, answer%contact >= contact_lost, 'contact is lost')
   end subroutine test_contact_lost

   !> Nothing excites the gears: they stand at their static equilibrium.
   subroutine test_no_excitation(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(equations_type) :: equations
      type(modal_system) :: modal
      type(library_error), allocatable :: failed
      type(harmonic_motion) :: motion
      type(series_sampler) :: sampler
      type(response) :: answer

      gears = reference_gears()
      gears%mesh%stiffness_coefficients = 0.0_wp
      gears%mesh%error_amplitudes = 0.0_wp
      equations = new_equations(gears, reference_box(), reference_load(), flexible_point(900.0_wp, 1.0e6_wp))
      call new_modal_system(equations, modal, failed)
      call check(error, .not. allocated(failed), 'the modes are found')
      if (allocated(error)) return
      call find_harmonic_motion(modal, equations, motion)
      call check(error, motion%order > 0, 'there is a series')
      if (allocated(error)) return
      answer = empty_response()
      call measure_harmonics(sampler, modal, equations, motion, answer)
      call check(error, answer%y1_amplitude, 0.0_wp, roundoff*abs(equations%static_deflection), 'no amplitude')
      if (allocated(error)) return
      call check(error, answer%y1_max, equations%static_observation(1), roundoff, 'static equilibrium', relative=.true.)
   end subroutine test_no_excitation

end module test_harmonic
