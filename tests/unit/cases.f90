!> The physical problem that the tests share: the gear pair, gearbox and load of the paper as in input/paper/figure2.nml.
module cases
   use spurflex_base_kinds, only: wp, pi
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point, support_flexible, support_rigid
   implicit none
   private

   public :: reference_gears, reference_box, reference_load, balanced_load, rigid_point, flexible_point

contains

   !> Gear pair with its bearings and its mesh.
   pure function reference_gears() result(gears)
      !> The gear pair.
      type(gear_pair) :: gears

      gears%teeth_1 = 55
      gears%pressure_angle = 20.0_wp*pi/180.0_wp
      gears%base_radius = [0.05168_wp, 0.07048_wp]
      gears%mass = [1.53_wp, 3.01_wp]
      gears%inertia = [0.0041_wp, 0.0079_wp]
      gears%bearing_stiffness = 2.0e8_wp
      gears%bearing_damping = 1800.0_wp
      gears%mesh%mean_stiffness = 3.2e8_wp
      gears%mesh%stiffness_coefficients = [0.3_wp]
      gears%mesh%stiffness_phases = [0.0_wp]
      gears%mesh%error_amplitudes = [1.0e-5_wp]
      gears%mesh%error_phases = [0.0_wp]
      gears%mesh%damping = 2000.0_wp
      gears%mesh%half_backlash = 1.0e-5_wp
   end function reference_gears

   !> Gearbox on its support.
   pure function reference_box() result(box)
      !> The gearbox.
      type(gearbox) :: box

      box%mass = 19.87_wp
      box%inertia = 0.35_wp
      box%gear_offset = 0.08_wp
      box%support_offset = 0.11_wp
      box%damping_ratio = 0.15_wp
   end function reference_box

   !> Torques of the paper; they balance but for the rounding of the base radii.
   pure function reference_load() result(load)
      !> The torques.
      type(load_type) :: load

      load = load_type(driving_torque=110.0_wp, load_torque=150.0_wp)
   end function reference_load

   !> Torques that balance exactly, so that the gears do not speed up together.
   pure function balanced_load(gears, driving_torque) result(load)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Torque on gear 1 [N m].
      real(wp), intent(in) :: driving_torque
      !> The torques.
      type(load_type) :: load

      load%driving_torque = driving_torque
      load%load_torque = driving_torque*gears%base_radius(2)/gears%base_radius(1)
   end function balanced_load

   !> A point on a rigid support.
   pure function rigid_point(speed) result(point)
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> The point.
      type(operating_point) :: point

      point = operating_point(support_rigid, speed, 0.0_wp)
   end function rigid_point

   !> A point on a flexible support.
   pure function flexible_point(speed, stiffness) result(point)
      !> Speed [rev/min].
      real(wp), intent(in) :: speed
      !> Support stiffness [N/m].
      real(wp), intent(in) :: stiffness
      !> The point.
      type(operating_point) :: point

      point = operating_point(support_flexible, speed, stiffness)
   end function flexible_point

end module cases
