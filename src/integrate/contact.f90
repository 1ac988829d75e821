!> The exact mesh force of an implicit step.
!>
!> Every implicit step that is linear apart from the mesh ends in one scalar equation for the mesh force f,
!>
!>     f = c_m (v - h_v f) + k phi(d - h_d f),   phi = the backlash function of Eq. (4),
!>
!> where d and v are the mesh deflection and its rate without mesh force and h_d, h_v >= 0 what a unit force takes from
!> them. The right side falls with f and is piecewise linear, so that there is exactly one solution and it is on one of
!> three branches: no iteration is needed.
module spurflex_integrate_contact
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: contact_force

contains

   !> Mesh force at the end of a step.
   elemental subroutine contact_force(d, v, stiffness, damping, half_backlash, h_d, h_v, force, by_d, by_v)
      !> Mesh deflection without mesh force [m].
      real(wp), intent(in) :: d
      !> Its rate without mesh force [m/s].
      real(wp), intent(in) :: v
      !> Mesh stiffness [N/m].
      real(wp), intent(in) :: stiffness
      !> Mesh damping [N s/m].
      real(wp), intent(in) :: damping
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Deflection that a unit force takes away [m/N].
      real(wp), intent(in) :: h_d
      !> Rate that a unit force takes away [m/(N s)].
      real(wp), intent(in) :: h_v
      !> Mesh force f_m, Eq. (5) [N].
      real(wp), intent(out) :: force
      !> Derivatives of the force by d and by v [N/m, N s/m].
      real(wp), intent(out) :: by_d, by_v

      real(wp) :: gap, gap_force, free, beyond, divisor

      gap = 1.0_wp + damping*h_v
      gap_force = damping*v/gap
      free = d - h_d*gap_force
      ! How far the free deflection lies beyond the gap, on either side.
      beyond = max(free - half_backlash, 0.0_wp) + min(free + half_backlash, 0.0_wp)
      divisor = gap + stiffness*h_d
      force = gap_force + stiffness*beyond/divisor
      if (free >= half_backlash .or. free <= -half_backlash) then
         by_d = stiffness/divisor
         by_v = damping/divisor
      else
         by_d = 0.0_wp
         by_v = damping/gap
      end if
   end subroutine contact_force

end module spurflex_integrate_contact
