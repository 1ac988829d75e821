!> The mesh at the points of a step, and the law of the driving scalar N on each branch of the contact.
module spurflex_integrate_mesh_table
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_exponential, only: node, nodes
   use spurflex_model_equations, only: equations_type
   use spurflex_model_mesh, only: mesh_stiffness, transmission_error, transmission_error_rate
   implicit none
   private

   public :: mesh_points, set_mesh_points, branch_law

   !> Mesh at the points of a step.
   type :: mesh_points
      !> Time since the section [s].
      real(wp) :: time(nodes) = 0.0_wp
      !> Mesh stiffness k_m [N/m].
      real(wp) :: stiffness(nodes) = 0.0_wp
      !> delta_s + e_m: the mesh deflection where g.q is zero [m].
      real(wp) :: deflection(nodes) = 0.0_wp
      !> c_m e_m' - F [N].
      real(wp) :: drive(nodes) = 0.0_wp
      !> Mean mesh stiffness k_m0 [N/m] and half of the backlash [m].
      real(wp) :: mean_stiffness = 0.0_wp, half_backlash = 0.0_wp
   end type mesh_points

contains

   !> Evaluate the mesh at the points of a step.
   pure subroutine set_mesh_points(equations, start, length, mesh)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Start of the step since the section, and its length [s].
      real(wp), intent(in) :: start, length
      !> The mesh.
      type(mesh_points), intent(inout) :: mesh

      real(wp) :: phase
      integer :: i

      mesh%mean_stiffness = equations%mesh%mean_stiffness
      mesh%half_backlash = equations%mesh%half_backlash
      mesh%time = start + node*length
      do i = 1, nodes
         phase = equations%frequency*mesh%time(i)
         mesh%stiffness(i) = mesh_stiffness(equations%mesh, phase)
         mesh%deflection(i) = equations%static_deflection + transmission_error(equations%mesh, phase)
         mesh%drive(i) = equations%mesh%damping*equations%frequency*transmission_error_rate(equations%mesh, phase) &
                         - equations%mean_force
      end do
   end subroutine set_mesh_points

   !> On one branch N = alpha x + gamma with x = g.q.
   pure subroutine branch_law(mesh, branch, alpha, gamma)
      !> Mesh at the points.
      type(mesh_points), intent(in) :: mesh
      !> -1 back flank, 0 gap, 1 contact.
      integer, intent(in) :: branch
      !> Derivative of N by x [N/m].
      real(wp), intent(out) :: alpha(nodes)
      !> N where x is zero [N].
      real(wp), intent(out) :: gamma(nodes)

      if (branch == 0) then
         alpha = -mesh%mean_stiffness
         gamma = mesh%drive
      else
         alpha = mesh%stiffness - mesh%mean_stiffness
         gamma = mesh%stiffness*(mesh%deflection - real(branch, wp)*mesh%half_backlash) + mesh%drive
      end if
   end subroutine branch_law

end module spurflex_integrate_mesh_table
