!> The integrator that the options name.
module spurflex_integrate_factory
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_options, only: solver_options, integrator_newmark
   use spurflex_integrate_period_map, only: period_map
   implicit none
   private

   public :: make_map

contains

   !> Make the period map that the options name, without an operating point.
   subroutine make_map(options, map)
      !> Integrator, and Newmark's beta and gamma.
      type(solver_options), intent(in) :: options
      !> The map.
      class(period_map), allocatable, intent(out) :: map

      type(newmark_map) :: newmark

      if (options%integrator == integrator_newmark) then
         newmark%beta = options%newmark_beta
         newmark%gamma = options%newmark_gamma
         allocate (map, source=newmark)
      else
         allocate (collocation_map :: map)
      end if
   end subroutine make_map

end module spurflex_integrate_factory
