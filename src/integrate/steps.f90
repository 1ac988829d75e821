!> How many steps a mesh period needs.
module spurflex_integrate_steps
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_options, only: solver_options, integrator_newmark
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: first_steps, better_steps, most_steps

   !> Steps per mesh period at most.
   integer, parameter :: most_steps = 65536

   !> Fewest steps per mesh period of collocation, and of Newmark's method.
   integer, parameter :: fewest_collocation = 8, fewest_newmark = 64

   !> Phase of the free vibration of the mesh in a step of collocation: its error is then about 1e-7 [rad].
   real(wp), parameter :: collocation_phase = 3.0_wp

   !> The same for Newmark's method: its error is then about 1e-3 [rad].
   real(wp), parameter :: newmark_phase = 0.15_wp

   !> Aim at this share of the tolerance.
   real(wp), parameter :: aim = 0.5_wp

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

      real(wp) :: cycle, inverse_mass
      integer :: i, harmonics
      logical :: is_newmark

      ! Free vibration of the mesh with every body on its own: near enough to begin with.
      inverse_mass = 0.0_wp
      do i = 1, equations%n
         inverse_mass = inverse_mass + equations%direction(i)**2/equations%mass(i, i)
      end do
      cycle = 2.0_wp*pi/equations%frequency*sqrt(equations%mesh%mean_stiffness*inverse_mass)
      harmonics = max(size(equations%mesh%stiffness_coefficients), size(equations%mesh%error_amplitudes))
      cycle = max(cycle, 2.0_wp*pi*real(harmonics, wp))
      is_newmark = .false.
      if (present(options)) is_newmark = options%integrator == integrator_newmark
      if (is_newmark) then
         steps = max(fewest_newmark, nint(min(cycle/newmark_phase, real(most_steps, wp))))
      else
         steps = max(fewest_collocation, nint(min(cycle/collocation_phase, real(most_steps, wp))))
      end if
   end function first_steps

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
