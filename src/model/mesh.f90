!> Mesh excitation and contact: Eqs. (1), (2), (4) and (5) of the paper.
!>
!> Time enters through the phase w_m t of the mesh frequency w_m, so that every function here has period 2 pi.
module spurflex_model_mesh
   use spurflex_base_kinds, only: wp, pi
   use spurflex_model_parameters, only: mesh_excitation
   implicit none
   private

   public :: mesh_stiffness, mesh_stiffness_rate, transmission_error, transmission_error_rate, transmission_error_curvature
   public :: backlash_deflection, mesh_force, mesh_force_rate, smallest_mesh_stiffness

contains

   !> Mesh stiffness k_m, Eq. (1) [N/m].
   pure function mesh_stiffness(mesh, phase) result(stiffness)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> k_m at that phase [N/m].
      real(wp) :: stiffness

      integer :: n

      stiffness = 1.0_wp
      do n = 1, size(mesh%stiffness_coefficients)
         stiffness = stiffness + mesh%stiffness_coefficients(n)*sin(real(n, wp)*phase + mesh%stiffness_phases(n))
      end do
      stiffness = mesh%mean_stiffness*stiffness
   end function mesh_stiffness

   !> Derivative of the mesh stiffness by the phase, d k_m / d(w_m t) [N/(m rad)].
   pure function mesh_stiffness_rate(mesh, phase) result(rate)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> Derivative at that phase; times w_m it is the rate in time.
      real(wp) :: rate

      integer :: n

      rate = 0.0_wp
      do n = 1, size(mesh%stiffness_coefficients)
         rate = rate + real(n, wp)*mesh%stiffness_coefficients(n)*cos(real(n, wp)*phase + mesh%stiffness_phases(n))
      end do
      rate = mesh%mean_stiffness*rate
   end function mesh_stiffness_rate

   !> Static transmission error e_m, Eq. (2) [m].
   pure function transmission_error(mesh, phase) result(deviation)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> e_m at that phase [m].
      real(wp) :: deviation

      integer :: n

      deviation = 0.0_wp
      do n = 1, size(mesh%error_amplitudes)
         deviation = deviation + mesh%error_amplitudes(n)*sin(real(n, wp)*phase + mesh%error_phases(n))
      end do
   end function transmission_error

   !> Derivative of the static transmission error by the phase, d e_m / d(w_m t) [m/rad].
   pure function transmission_error_rate(mesh, phase) result(rate)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> Derivative at that phase; times w_m it is the rate in time.
      real(wp) :: rate

      integer :: n

      rate = 0.0_wp
      do n = 1, size(mesh%error_amplitudes)
         rate = rate + real(n, wp)*mesh%error_amplitudes(n)*cos(real(n, wp)*phase + mesh%error_phases(n))
      end do
   end function transmission_error_rate

   !> Second derivative of the static transmission error by the phase [m/rad2].
   pure function transmission_error_curvature(mesh, phase) result(curvature)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> Second derivative at that phase; times w_m**2 it is the acceleration.
      real(wp) :: curvature

      integer :: n

      curvature = 0.0_wp
      do n = 1, size(mesh%error_amplitudes)
         curvature = curvature - real(n, wp)**2*mesh%error_amplitudes(n)*sin(real(n, wp)*phase + mesh%error_phases(n))
      end do
   end function transmission_error_curvature

   !> Elastic deflection of the teeth f(delta), Eq. (4) [m].
   elemental function backlash_deflection(delta, half_backlash) result(deflection)
      !> Relative displacement on the line of action [m].
      real(wp), intent(in) :: delta
      !> Half of the backlash b [m].
      real(wp), intent(in) :: half_backlash
      !> delta - b in contact, 0 in the gap, delta + b on the back flank [m].
      real(wp) :: deflection

      if (delta >= half_backlash) then
         deflection = delta - half_backlash
      else if (delta <= -half_backlash) then
         deflection = delta + half_backlash
      else
         deflection = 0.0_wp
      end if
   end function backlash_deflection

   !> Mesh force f_m, Eq. (5) [N]; the damping acts in the gap too.
   pure function mesh_force(mesh, phase, delta, delta_rate) result(force)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> Relative displacement on the line of action, Eq. (3) [m].
      real(wp), intent(in) :: delta
      !> Its rate in time [m/s].
      real(wp), intent(in) :: delta_rate
      !> f_m [N].
      real(wp) :: force

      force = mesh%damping*delta_rate + mesh_stiffness(mesh, phase)*backlash_deflection(delta, mesh%half_backlash)
   end function mesh_force

   !> Rate of the mesh force [N/s]; at a border of the backlash that of the contact.
   pure function mesh_force_rate(mesh, phase, frequency, delta) result(rate)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Phase w_m t [rad].
      real(wp), intent(in) :: phase
      !> Mesh angular frequency w_m [rad/s].
      real(wp), intent(in) :: frequency
      !> Relative displacement on the line of action, its rate and its acceleration in time [m, m/s, m/s2].
      real(wp), intent(in) :: delta(3)
      !> d f_m / dt [N/s].
      real(wp) :: rate

      rate = mesh%damping*delta(3) + frequency*mesh_stiffness_rate(mesh, phase)*backlash_deflection(delta(1), mesh%half_backlash)
      if (abs(delta(1)) >= mesh%half_backlash) rate = rate + mesh_stiffness(mesh, phase)*delta(2)
   end function mesh_force_rate

   !> Smallest mesh stiffness over a mesh period, found among evenly spaced phases [N/m].
   pure function smallest_mesh_stiffness(mesh) result(smallest)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Smallest k_m [N/m].
      real(wp) :: smallest

      integer, parameter :: phases = 4096
      integer :: i

      smallest = huge(smallest)
      do i = 0, phases - 1
         smallest = min(smallest, mesh_stiffness(mesh, 2.0_wp*pi*real(i, wp)/real(phases, wp)))
      end do
   end function smallest_mesh_stiffness

end module spurflex_model_mesh
