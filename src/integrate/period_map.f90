!> What every integrator offers to the steady-state solver: the map of the state over one mesh period.
!>
!> The state is a real vector in the integrator's own coordinates, at the section, phase 0 of the mesh. To add an
!> integrator, extend `period_map` in a module beside this one and name it in `spurflex_integrate_factory`.
module spurflex_integrate_period_map
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: period_map, orbit_type, observables, reserve_orbit

   !> Quantities recorded along an orbit where the equations name no others: y1, d_x1, d_y1, d_x2, d_y2.
   integer, parameter :: observables = 5

   !> Observed quantities over one mesh period, as deviations from the static equilibrium.
   type :: orbit_type
      !> Samples after the first.
      integer :: samples = 0
      !> Samples from one place where derivatives may jump to the next.
      integer :: piece = 1
      !> Time since the section, shape (0:) [s].
      real(wp), allocatable :: time(:)
      !> Weight of each sample in the mean over the period, shape (0:); they add up to one.
      real(wp), allocatable :: weight(:)
      !> Quantities, their rates and accelerations in time, shape (quantities, 0:) [m, m/s, m/s2].
      real(wp), allocatable :: value(:, :), rate(:, :), acceleration(:, :)
   end type orbit_type

   !> Map of the state over one mesh period at one operating point.
   type, abstract :: period_map
      !> Length of the state.
      integer :: size = 0
      !> Steps per mesh period.
      integer :: steps = 0
      !> Mesh period [s].
      real(wp) :: period = 1.0_wp
      !> Relative error that round-off may leave in a motion [-].
      real(wp) :: roundoff = 0.0_wp
      !> Half of the backlash [m].
      real(wp) :: half_backlash = 0.0_wp
      !> Smallest and largest mesh deflection over the period last advanced [m].
      real(wp) :: smallest_deflection = 0.0_wp, largest_deflection = 0.0_wp
      !> Bound of what a unit of each component of the state does to y1, to a bearing deformation and to the mesh deflection,
      !> shape (size).
      real(wp), allocatable :: weight(:)
   contains
      !> Take an operating point and a number of steps per period.
      procedure(load_interface), deferred :: load
      !> Advance a state, and tangents with it, by one mesh period.
      procedure(advance_interface), deferred :: advance
      !> The state from the coordinates of the equations of motion.
      procedure(to_state_interface), deferred :: to_state
      !> The coordinates of the equations of motion from the state.
      procedure(from_state_interface), deferred :: from_state
      !> How far a difference of states can move the mesh deflection, now and later.
      procedure(bound_interface), deferred :: deflection_bound
   end type period_map

   abstract interface
      !> Take an operating point and a number of steps per period.
      subroutine load_interface(self, equations, steps, error)
         import :: period_map, equations_type, error_type
         !> Map.
         class(period_map), intent(inout) :: self
         !> Equations of motion of the point.
         type(equations_type), intent(in) :: equations
         !> Steps per mesh period.
         integer, intent(in) :: steps
         !> Set where the equations cannot be integrated.
         type(error_type), allocatable, intent(out) :: error
      end subroutine load_interface

      !> Advance a state by one mesh period, from section to section.
      subroutine advance_interface(self, state, tangents, orbit)
         import :: period_map, orbit_type, wp
         !> Map.
         class(period_map), intent(inout) :: self
         !> State at the section, shape (size).
         real(wp), intent(inout), contiguous :: state(:)
         !> Tangents that see the same contact, one in a row, shape (tangents, size).
         real(wp), intent(inout), optional, contiguous :: tangents(:, :)
         !> If present, the period is recorded.
         type(orbit_type), intent(inout), optional :: orbit
      end subroutine advance_interface

      !> The state from the coordinates of the equations of motion.
      pure function to_state_interface(self, position, velocity) result(state)
         import :: period_map, wp
         !> Map.
         class(period_map), intent(in) :: self
         !> Deviation from the static equilibrium, shape (n).
         real(wp), intent(in) :: position(:)
         !> Its rate, shape (n).
         real(wp), intent(in) :: velocity(:)
         !> State, shape (size).
         real(wp), allocatable :: state(:)
      end function to_state_interface

      !> The coordinates of the equations of motion from the state.
      pure subroutine from_state_interface(self, state, position, velocity)
         import :: period_map, wp
         !> Map.
         class(period_map), intent(in) :: self
         !> State, shape (size).
         real(wp), intent(in) :: state(:)
         !> Deviation from the static equilibrium, shape (n).
         real(wp), allocatable, intent(out) :: position(:)
         !> Its rate, shape (n).
         real(wp), allocatable, intent(out) :: velocity(:)
      end subroutine from_state_interface

      !> Bound of what a difference of states does to the mesh deflection, now and later, while contact is kept: the sum of the
      !> moduli of the modes, which decay one by one under the mean mesh stiffness.
      pure function bound_interface(self, difference) result(bound)
         import :: period_map, wp
         !> Map.
         class(period_map), intent(in) :: self
         !> Difference of two states, shape (size).
         real(wp), intent(in) :: difference(:)
         !> The bound [m].
         real(wp) :: bound
      end function bound_interface
   end interface

contains

   !> Make room for some samples.
   pure subroutine reserve_orbit(orbit, samples, quantities)
      !> Orbit.
      type(orbit_type), intent(inout) :: orbit
      !> Samples after the first that will be recorded at most.
      integer, intent(in) :: samples
      !> Quantities; `observables` if absent.
      integer, intent(in), optional :: quantities

      integer :: rows

      rows = observables
      if (present(quantities)) rows = quantities
      if (allocated(orbit%time)) then
         if (ubound(orbit%time, 1) >= samples .and. size(orbit%value, 1) == rows) return
         deallocate (orbit%time, orbit%weight, orbit%value, orbit%rate, orbit%acceleration)
      end if
      allocate (orbit%time(0:samples), orbit%weight(0:samples), source=0.0_wp)
      allocate (orbit%value(rows, 0:samples), orbit%rate(rows, 0:samples), orbit%acceleration(rows, 0:samples), source=0.0_wp)
   end subroutine reserve_orbit

end module spurflex_integrate_period_map
