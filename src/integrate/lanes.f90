!> What every integrator offers: many points side by side, one in each lane, advanced by whole mesh periods.
!>
!> Lanes are independent and are loaded one by one, so that no point waits for another. To add an integrator, extend
!> `integrator_type` in a module beside this one and name it in `spurflex_integrate_factory`.
module spurflex_integrate_lanes
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_contact, only: lanes
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: integrator_type, trajectory_type, lanes, observables

   !> Quantities recorded along a trajectory: y1, d_x1, d_y1, d_x2, d_y2.
   integer, parameter :: observables = 5

   !> One mesh period of every lane, as deviations from the static equilibrium.
   type :: trajectory_type
      !> Observed quantities, shape (lanes, observables, 0:samples) [m].
      real(wp), allocatable :: value(:, :, :)
      !> Their rates in time, same shape [m/s].
      real(wp), allocatable :: rate(:, :, :)
   end type trajectory_type

   !> State of all lanes at the section, phase 0 of the mesh.
   type, abstract :: integrator_type
      !> Degrees of freedom of every point.
      integer :: n = 0
      !> Samples that a recorded period has.
      integer :: samples = 0
      !> Deviation from the static equilibrium, shape (lanes, n or more); what lies behind n is padding.
      real(wp), allocatable :: position(:, :)
      !> Its rate, same shape.
      real(wp), allocatable :: velocity(:, :)
      !> Smallest and largest mesh deflection over the period last advanced, shape (lanes) [m].
      real(wp) :: smallest_deflection(lanes) = 0.0_wp, largest_deflection(lanes) = 0.0_wp
      !> Mesh period of each lane, shape (lanes) [s].
      real(wp) :: period(lanes) = 1.0_wp
   contains
      !> Put a point into a lane.
      procedure(load_interface), deferred :: load
      !> Advance every lane by one mesh period.
      procedure(advance_interface), deferred :: advance
   end type integrator_type

   abstract interface
      !> Put a point into a lane, at the section.
      subroutine load_interface(self, lane, equations, position, velocity, error)
         import :: integrator_type, equations_type, error_type, wp
         !> Integrator.
         class(integrator_type), intent(inout) :: self
         !> Lane, 1..lanes.
         integer, intent(in) :: lane
         !> Equations of motion of the point.
         type(equations_type), intent(in) :: equations
         !> Deviation from the static equilibrium at phase 0, shape (n).
         real(wp), intent(in) :: position(:)
         !> Its rate, shape (n).
         real(wp), intent(in) :: velocity(:)
         !> Set where the equations cannot be integrated.
         type(error_type), allocatable, intent(out) :: error
      end subroutine load_interface

      !> Advance every lane by one mesh period, from section to section.
      subroutine advance_interface(self, trajectory)
         import :: integrator_type, trajectory_type
         !> Integrator.
         class(integrator_type), intent(inout) :: self
         !> If present, the period is recorded.
         type(trajectory_type), intent(inout), optional :: trajectory
      end subroutine advance_interface
   end interface

end module spurflex_integrate_lanes
