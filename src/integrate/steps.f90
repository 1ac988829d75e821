!> How many steps a mesh period needs.
module spurflex_integrate_steps
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_options, only: solver_options, integrator_newmark
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system
   implicit none
   private

   public :: first_steps, better_steps, most_steps, aim, judge_share, first_lane_steps, better_lane_steps, &
      newmark_lane_steps, most_lane_steps, most_newmark_steps

   !> Steps per mesh period at most.
   integer, parameter :: most_steps = 65536

   !> Fewest steps per mesh period of collocation, and of Newmark's method.
   integer, parameter :: fewest_collocation = 8, fewest_newmark = 64

   !> Phase of the free vibration of the mesh in a step of collocation [rad], the error that it has then, and the order of that
   !> where contact is lost.
   real(wp), parameter :: collocation_phase = 3.0_wp, collocation_error = 1.0e-7_wp, collocation_order = 6.0_wp

   !> The same for Newmark's method: its error is then about 1e-3 [rad].
   real(wp), parameter :: newmark_phase = 0.15_wp

   !> The same for collocation in lanes: its error is then about 1e-5 where a tolerance of 1e-3 is asked for [rad].
   real(wp), parameter :: lane_phase = 0.7_wp, lane_tolerance = 1.0e-3_wp

   !> Steps that lanes may have: points in one vector have the same.
   integer, parameter :: lane_steps(14) = [16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536]

   !> Most steps to begin with, and most by which a tolerance is met, in lanes.
   integer, parameter :: most_lane_steps = 1024, most_refined_steps = 192, most_newmark_steps = 16384

   !> Order of collocation in lanes.
   real(wp), parameter :: lane_order = 4.0_wp

   !> Aim at this share of the tolerance.
   real(wp), parameter :: aim = 0.5_wp

   !> Share of the tolerance by which the orbit of a judge may be off: it is only to tell how far the other is.
   real(wp), parameter :: judge_share = 0.01_wp

   !> Times by which the number of steps grows at most, and at least, at once.
   real(wp), parameter :: most_growth = 16.0_wp, least_growth = 1.2_wp

contains

   !> Steps to begin with; those of collocation if no options are given.
   pure function first_steps(equations, options) result(steps)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Integrator.
      type(solver_options), intent(in), optional :: options
      !> Steps per mesh period.
      integer :: steps

      real(wp) :: phase, finer
      logical :: is_newmark

      phase = cycle_phase(equations)
      is_newmark = .false.
      if (present(options)) is_newmark = options%integrator == integrator_newmark
      if (is_newmark) then
         steps = max(fewest_newmark, nint(min(phase/newmark_phase, real(most_steps, wp))))
      else
         finer = 1.0_wp
         if (present(options)) finer = max(collocation_error/options%tolerance, 1.0_wp)**(1.0_wp/collocation_order)
         steps = nint(min(finer*max(phase/collocation_phase, real(fewest_collocation, wp)), real(most_steps, wp)))
      end if
   end function first_steps

   !> Phase of the free vibration of the mesh, or of the highest harmonic of the excitation, in a mesh period.
   pure function cycle_phase(equations) result(phase)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The phase [rad].
      real(wp) :: phase

      real(wp) :: inverse_mass
      integer :: i, harmonics

      ! Free vibration of the mesh with every body on its own: near enough to begin with.
      inverse_mass = 0.0_wp
      do i = 1, equations%n
         inverse_mass = inverse_mass + equations%direction(i)**2/equations%mass(i, i)
      end do
      phase = 2.0_wp*pi/equations%frequency*sqrt(equations%mesh%mean_stiffness*inverse_mass)
      harmonics = max(size(equations%mesh%stiffness_coefficients), size(equations%mesh%error_amplitudes))
      phase = max(phase, 2.0_wp*pi*real(harmonics, wp))
   end function cycle_phase

   !> Steps of collocation in lanes to begin with.
   pure function first_lane_steps(equations, modal, tolerance) result(steps)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Modes of their linear part.
      type(modal_system), intent(in) :: modal
      !> Relative error that is asked for.
      real(wp), intent(in) :: tolerance
      !> Steps per mesh period; more than `most_lane_steps` where lanes are no use.
      integer :: steps

      real(wp) :: finer
      integer :: harmonics

      harmonics = max(size(equations%mesh%stiffness_coefficients), size(equations%mesh%error_amplitudes))
      ! The steps that find a motion need not meet the tolerance on it, but who asks for more wants to be surer of it.
      finer = max(lane_tolerance/tolerance, 1.0_wp)**(0.5_wp/lane_order)
      steps = next_lane_steps(finer*max(2.0_wp*pi*max(modal%fastest/equations%frequency, real(harmonics, wp))/lane_phase, &
                                        real(lane_steps(1), wp)))
   end function first_lane_steps

   !> Steps in lanes that should meet the tolerance.
   pure function better_lane_steps(steps, error, options) result(better)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Their relative error.
      real(wp), intent(in) :: error
      !> Integrator and tolerance.
      type(solver_options), intent(in) :: options
      !> More steps per mesh period; zero where lanes are no use.
      integer :: better

      if (options%integrator == integrator_newmark) then
         better = 0
         if (steps < most_newmark_steps) better = next_newmark_steps(better_steps(steps, error, options))
      else
         better = next_lane_steps(real(steps, wp)*max((error/(aim*options%tolerance))**(1.0_wp/lane_order), least_growth))
         if (better > max(most_refined_steps, 2*steps)) better = 0
      end if
      if (better <= steps) better = 0
   end function better_lane_steps

   !> Steps of Newmark's method in lanes to begin with.
   pure function newmark_lane_steps(equations) result(steps)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer :: steps

      steps = next_newmark_steps(max(fewest_newmark, nint(min(cycle_phase(equations)/newmark_phase, real(most_steps, wp)))))
   end function newmark_lane_steps

   !> The next number of steps that Newmark's method may have in lanes: a power of two, or half as many more.
   pure function next_newmark_steps(wanted) result(steps)
      !> Steps wanted.
      integer, intent(in) :: wanted
      !> As many or more, up to `most_newmark_steps`.
      integer :: steps

      steps = fewest_newmark
      do while (steps < min(wanted, most_newmark_steps))
         steps = merge(steps + steps/2, steps + steps/3, iand(steps, steps - 1) == 0)
      end do
   end function next_newmark_steps

   !> The next number of steps that lanes may have.
   pure function next_lane_steps(wanted) result(steps)
      !> Steps wanted.
      real(wp), intent(in) :: wanted
      !> As many or more, if lanes may have as many.
      integer :: steps

      steps = lane_steps(min(count(real(lane_steps, wp) < wanted) + 1, size(lane_steps)))
   end function next_lane_steps

   !> Steps that should meet the tolerance, from the error of the steps there are.
   pure function better_steps(steps, error, options) result(better)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Their relative error.
      real(wp), intent(in) :: error
      !> Integrator and tolerance.
      type(solver_options), intent(in) :: options
      !> More steps per mesh period.
      integer :: better

      real(wp), parameter :: collocation_growth = 2.0_wp
      real(wp) :: growth

      if (options%integrator == integrator_newmark) then
         growth = min(max(sqrt(error/(aim*options%tolerance)), least_growth), most_growth)
      else
         growth = collocation_growth
      end if
      better = nint(min(real(steps, wp)*growth, real(most_steps, wp)))
   end function better_steps

end module spurflex_integrate_steps
