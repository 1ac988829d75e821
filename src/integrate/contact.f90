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

   public :: contact_force, lanes

   !> Points advanced side by side: one AVX-512 register or two AVX2 registers of doubles.
   integer, parameter :: lanes = 8

contains

   !> Mesh force at the end of a step, in every lane.
   pure subroutine contact_force(d, v, stiffness, damping, half_backlash, h_d, h_v, force)
      !> Mesh deflection without mesh force [m].
      real(wp), intent(in) :: d(lanes)
      !> Its rate without mesh force [m/s].
      real(wp), intent(in) :: v(lanes)
      !> Mesh stiffness [N/m].
      real(wp), intent(in) :: stiffness
      !> Mesh damping [N s/m].
      real(wp), intent(in) :: damping
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Deflection that a unit force takes away [m/N].
      real(wp), intent(in) :: h_d(lanes)
      !> Rate that a unit force takes away [m/(N s)].
      real(wp), intent(in) :: h_v(lanes)
      !> Mesh force f_m, Eq. (5) [N].
      real(wp), intent(out) :: force(lanes)

      real(wp) :: gap, gap_force, free, beyond
      integer :: l

      do l = 1, lanes
         gap = 1.0_wp + damping*h_v(l)
         gap_force = damping*v(l)/gap
         free = d(l) - h_d(l)*gap_force
         ! How far the free deflection lies beyond the gap, on either side.
         beyond = max(free - half_backlash, 0.0_wp) + min(free + half_backlash, 0.0_wp)
         force(l) = gap_force + stiffness*beyond/(gap + stiffness*h_d(l))
      end do
   end subroutine contact_force

end module spurflex_integrate_contact
