!> The physical problem: gear pair, gearbox, load and operating point, in SI units.
module spurflex_model_parameters
   use spurflex_base_kinds, only: wp, pi
   implicit none
   private

   public :: mesh_excitation, gear_pair, gearbox, load_type, operating_point
   public :: mesh_frequency, support_rigid, support_flexible

   !> Gears on a rigid support: the six-degree-of-freedom model, Eqs. (22)-(27).
   integer, parameter :: support_rigid = 1
   !> Gearbox on springs: the nine-degree-of-freedom model, Eqs. (12)-(21).
   integer, parameter :: support_flexible = 2

   !> Mesh stiffness, Eq. (1), static transmission error, Eq. (2), damping and backlash, Eqs. (4)-(5).
   type :: mesh_excitation
      !> Mean mesh stiffness k_m0 [N/m].
      real(wp) :: mean_stiffness = 0.0_wp
      !> Relative amplitude k_mn of each harmonic of the mesh stiffness, shape (harmonics) [-].
      real(wp), allocatable :: stiffness_coefficients(:)
      !> Phase phi_kn of each harmonic of the mesh stiffness, shape (harmonics) [rad].
      real(wp), allocatable :: stiffness_phases(:)
      !> Amplitude e_mn of each harmonic of the static transmission error, shape (harmonics) [m].
      real(wp), allocatable :: error_amplitudes(:)
      !> Phase phi_en of each harmonic of the static transmission error, shape (harmonics) [rad].
      real(wp), allocatable :: error_phases(:)
      !> Mesh damping c_m, acting in the backlash gap too [N s/m].
      real(wp) :: damping = 0.0_wp
      !> Half of the backlash b [m].
      real(wp) :: half_backlash = 0.0_wp
   end type mesh_excitation

   !> The two gears with their bearings and their mesh; index 1 drives, index 2 is driven.
   type :: gear_pair
      !> Number of teeth of the driving gear z1 [-].
      integer :: teeth_1 = 0
      !> Pressure angle [rad].
      real(wp) :: pressure_angle = 0.0_wp
      !> Base radii r1, r2 [m].
      real(wp) :: base_radius(2) = 0.0_wp
      !> Masses m1, m2 [kg].
      real(wp) :: mass(2) = 0.0_wp
      !> Moments of inertia J1, J2 [kg m2].
      real(wp) :: inertia(2) = 0.0_wp
      !> Bearing stiffnesses k1, k2, the same in x and y [N/m].
      real(wp) :: bearing_stiffness(2) = 0.0_wp
      !> Bearing damping c1, c2 [N s/m].
      real(wp) :: bearing_damping(2) = 0.0_wp
      !> The mesh.
      type(mesh_excitation) :: mesh
   end type gear_pair

   !> The gearbox housing on its support.
   type :: gearbox
      !> Mass m_M [kg].
      real(wp) :: mass = 0.0_wp
      !> Moment of inertia J_M [kg m2].
      real(wp) :: inertia = 0.0_wp
      !> Distance l_o of each gear axis from the centre of mass [m].
      real(wp) :: gear_offset = 0.0_wp
      !> Distance l_x of each support from the centre of mass [m].
      real(wp) :: support_offset = 0.0_wp
      !> Damping ratio xi of the support, Eq. (15) [-].
      real(wp) :: damping_ratio = 0.0_wp
   end type gearbox

   !> Constant torques on the two gears.
   type :: load_type
      !> Driving torque T_d on gear 1 [N m].
      real(wp) :: driving_torque = 0.0_wp
      !> Load torque T_l on gear 2 [N m].
      real(wp) :: load_torque = 0.0_wp
   end type load_type

   !> One point of the sweep.
   type :: operating_point
      !> `support_rigid` or `support_flexible`.
      integer :: support = support_rigid
      !> Speed of the driving gear n [rev/min].
      real(wp) :: speed = 0.0_wp
      !> Support stiffness k_Mx = k_My [N/m]; unused on a rigid support.
      real(wp) :: support_stiffness = 0.0_wp
   end type operating_point

contains

   !> Mesh angular frequency w_m = 2 pi z1 n / 60 [rad/s].
   elemental function mesh_frequency(teeth_1, speed) result(frequency)
      !> Number of teeth of the driving gear.
      integer, intent(in) :: teeth_1
      !> Speed of the driving gear [rev/min].
      real(wp), intent(in) :: speed
      !> Mesh angular frequency [rad/s].
      real(wp) :: frequency

      real(wp), parameter :: seconds_per_minute = 60.0_wp

      frequency = 2.0_wp*pi*real(teeth_1, wp)*speed/seconds_per_minute
   end function mesh_frequency

end module spurflex_model_parameters
