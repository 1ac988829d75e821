!> Period maps at a point, ready to use, and the single-degree-of-freedom gear pair of the literature.
module period_maps
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_factory, only: make_map
   use spurflex_integrate_options, only: integrator_collocation, integrator_newmark, solver_options
   use spurflex_integrate_period_map, only: period_map
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point, support_rigid
   use spurflex_steady_orbit, only: floquet_multipliers, periodic_orbit
   use test_support, only: error_type, test_failed
   implicit none
   private

   public :: load_map, largest_multiplier, single_dof_type, single_dof_equations, methods, method_names

   !> Both integrators.
   integer, parameter :: methods(2) = [integrator_newmark, integrator_collocation]
   character(len=*), parameter :: method_names(2) = [character(len=11) :: 'newmark', 'collocation']

   !> A gear pair as a single degree of freedom,
   !> x'' + 2 z x' + k(W t) f(x) = F + W^2 sum_n a_n cos(n W t), k = 1 - sum_n k_n cos(n W t), f(x) the backlash of +-1.
   !> References: A. Kahraman, R. Singh, J. Sound Vib. 142 (1990) 49 and 146 (1991) 135.
   type :: single_dof_type
      !> Damping ratio z.
      real(wp) :: damping = 0.05_wp
      !> Mean force F.
      real(wp) :: load = 0.1_wp
      !> Frequency W.
      real(wp) :: frequency = 1.0_wp
      !> Excitation a_n, shape (harmonics).
      real(wp), allocatable :: excitation(:)
      !> Variation of the stiffness k_n, shape (harmonics).
      real(wp), allocatable :: variation(:)
   end type single_dof_type

contains

   !> Make a period map and load a point.
   subroutine load_map(method, equations, steps, map, error)
      !> `integrator_...`.
      integer, intent(in) :: method
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The map.
      class(period_map), allocatable, intent(inout) :: map
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      if (allocated(map)) deallocate (map)
      call make_map(solver_options(integrator=method), map)
      call map%load(equations, steps, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine load_map

   !> Largest modulus of the Floquet multipliers of a motion.
   subroutine largest_multiplier(orbit, modulus, error, multiplier)
      !> The motion.
      type(periodic_orbit), intent(in) :: orbit
      !> The modulus.
      real(wp), intent(out) :: modulus
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error
      !> The multiplier of that modulus.
      complex(wp), intent(out), optional :: multiplier

      complex(wp), allocatable :: multipliers(:)
      type(library_error), allocatable :: fault

      modulus = huge(1.0_wp)
      call floquet_multipliers(orbit%monodromy, multipliers, fault)
      if (allocated(fault)) then
         call test_failed(error, fault%message)
         return
      end if
      modulus = maxval(abs(multipliers))
      if (present(multiplier)) multiplier = multipliers(maxloc(abs(multipliers), 1))
   end subroutine largest_multiplier

   !> The single-degree-of-freedom gear pair as a gear pair on a rigid support.
   !>
   !> Bearings a thousand million times stiffer than the teeth leave p = r1 th1 - r2 th2 alone, delta = p + e_m. With
   !> m_t = 1 kg, k_m0 = 1 N/m and b = 1 m, x is delta and time is in units of 1/w_n. One tooth makes the mesh frequency
   !> 2 pi n/60. e_m of amplitude e_n and phase -90 degrees is -e_n cos(n W t), so that m_t e_m'' = n^2 W^2 e_n cos(n W t) and
   !> e_n = a_n/n^2; k_m likewise.
   function single_dof_equations(single) result(equations)
      !> The single degree of freedom.
      type(single_dof_type), intent(in) :: single
      !> Equations of motion.
      type(equations_type) :: equations

      real(wp), parameter :: stiff = 1.0e9_wp, seconds_per_minute = 60.0_wp
      type(gear_pair) :: gears
      type(gearbox) :: box
      integer :: n

      gears%teeth_1 = 1
      gears%base_radius = 1.0_wp
      gears%mass = 1.0_wp
      gears%inertia = 2.0_wp
      gears%bearing_stiffness = stiff
      gears%bearing_damping = sqrt(stiff)
      gears%mesh%mean_stiffness = 1.0_wp
      gears%mesh%half_backlash = 1.0_wp
      gears%mesh%damping = 2.0_wp*single%damping
      gears%mesh%error_amplitudes = [(single%excitation(n)/real(n, wp)**2, n=1, size(single%excitation))]
      gears%mesh%error_phases = spread(-0.5_wp*pi, 1, size(single%excitation))
      if (allocated(single%variation)) then
         gears%mesh%stiffness_coefficients = single%variation
      else
         gears%mesh%stiffness_coefficients = [0.0_wp]
      end if
      gears%mesh%stiffness_phases = spread(-0.5_wp*pi, 1, size(gears%mesh%stiffness_coefficients))
      equations = new_equations(gears, box, load_type(single%load, single%load), &
                                operating_point(support_rigid, single%frequency/(2.0_wp*pi)*seconds_per_minute, 0.0_wp))
   end function single_dof_equations

end module period_maps
