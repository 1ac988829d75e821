!> The equations of motion in the form that is integrated.
!>
!> Three changes of variable make them small and well conditioned; none of them approximates.
!>
!> 1. The gear rotations enter the mesh through p = r1 th1 - r2 th2 alone, with the equivalent transmission mass
!>    m_t = 1/(r1^2/J1 + r2^2/J2) and the mean mesh force F = m_t (r1 T_d/J1 + r2 T_l/J2); the free common rotation drops out.
!> 2. Gear positions are replaced by bearing deformations, Eqs. (6)-(7). K and C are then diagonal and hold no differences
!>    of large numbers; only M couples, and it does not depend on the support stiffness.
!> 3. The unknown is the deviation from the static equilibrium under the mean mesh stiffness: on a soft support the static
!>    offset is metres, the vibration micrometres.
!>
!> Coordinates, flexible support: [d_x1, d_y1, d_x2, d_y2, xM, yM, thM, p]. On a rigid support the motion stays on the line
!> of action, u_i = x_i sin(a) - y_i cos(a), and the coordinates are [u1, u2, p]. In both
!>
!>     M q'' + C q' + K q = -g (f_m - F),   delta = delta_s + g.q + e_m(t)
module spurflex_model_equations
   use spurflex_base_kinds, only: wp
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point, support_flexible, mesh_excitation, &
      mesh_frequency
   use spurflex_model_paper, only: support_damping
   implicit none
   private

   public :: equations_type, new_equations, rest_deviation, paper_coordinates, coordinate_rows, mean_mesh_force
   public :: rigid_dof, flexible_dof

   !> Degrees of freedom integrated on a rigid and on a flexible support.
   integer, parameter :: rigid_dof = 3, flexible_dof = 8

   integer, parameter :: idx1 = 1, idy1 = 2, idx2 = 3, idy2 = 4, ixm = 5, iym = 6, itm = 7, ip = 8
   integer, parameter :: iu1 = 1, iu2 = 2, irp = 3

   !> Equations of motion at one operating point.
   type :: equations_type
      !> Degrees of freedom.
      integer :: n = 0
      !> Mass matrix, shape (n, n).
      real(wp), allocatable :: mass(:, :)
      !> Diagonal of the damping matrix without the mesh, shape (n).
      real(wp), allocatable :: damping(:)
      !> Diagonal of the stiffness matrix without the mesh, shape (n).
      real(wp), allocatable :: stiffness(:)
      !> Gradient g of the mesh deflection, shape (n).
      real(wp), allocatable :: direction(:)
      !> Mean mesh force F [N].
      real(wp) :: mean_force = 0.0_wp
      !> Mesh deflection delta_s at the static equilibrium [m].
      real(wp) :: static_deflection = 0.0_wp
      !> Mesh angular frequency [rad/s].
      real(wp) :: frequency = 0.0_wp
      !> Mesh excitation.
      type(mesh_excitation) :: mesh
      !> Rows that give [y1, d_x1, d_y1, d_x2, d_y2] from the coordinates, shape (5, n).
      real(wp), allocatable :: observation(:, :)
      !> The same quantities at the static equilibrium, shape (5) [m].
      real(wp) :: static_observation(5) = 0.0_wp
      !> Static equilibrium in these coordinates measured from zero displacement, shape (n).
      real(wp), allocatable :: static_position(:)
      !> Rotation of each gear for a unit of p, the common rotation taken out [1/m].
      real(wp) :: rotation(2) = 0.0_wp
      !> Rows that give what a period map records from the coordinates, shape (quantities, n); `observation` where there are none.
      real(wp), allocatable :: recorded(:, :)
   end type equations_type

contains

   !> Assemble the equations of motion of one operating point.
   pure function new_equations(gears, box, load, point) result(equations)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox; unused on a rigid support.
      type(gearbox), intent(in) :: box
      !> Torques.
      type(load_type), intent(in) :: load
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> The equations.
      type(equations_type) :: equations

      equations%n = merge(flexible_dof, rigid_dof, point%support == support_flexible)
      equations%mesh = gears%mesh
      equations%frequency = mesh_frequency(gears%teeth_1, point%speed)
      equations%mean_force = mean_mesh_force(gears, load)
      equations%static_deflection = static_mesh_deflection(gears%mesh, equations%mean_force)
      equations%rotation = transmission_mass(gears)*gears%base_radius/gears%inertia*[1.0_wp, -1.0_wp]
      if (point%support == support_flexible) then
         call assemble_flexible(equations, gears, box, point)
      else
         call assemble_rigid(equations, gears)
      end if
   end function new_equations

   !> Mass of the gear rotations on the line of action, m_t [kg].
   pure function transmission_mass(gears) result(mass)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> m_t.
      real(wp) :: mass

      mass = 1.0_wp/sum(gears%base_radius**2/gears%inertia)
   end function transmission_mass

   !> Mean mesh force F that the torques hold up [N]; negative where they load the back flank.
   pure function mean_mesh_force(gears, load) result(force)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Torques.
      type(load_type), intent(in) :: load
      !> F.
      real(wp) :: force

      force = transmission_mass(gears)*sum(gears%base_radius*[load%driving_torque, load%load_torque]/gears%inertia)
   end function mean_mesh_force

   !> Mesh deflection under the mean force and the mean stiffness [m]; the middle of the gap where there is no force.
   pure function static_mesh_deflection(mesh, force) result(deflection)
      !> Excitation.
      type(mesh_excitation), intent(in) :: mesh
      !> Mean mesh force [N].
      real(wp), intent(in) :: force
      !> delta_s.
      real(wp) :: deflection

      deflection = force/mesh%mean_stiffness
      if (abs(force) > 0.0_wp) deflection = deflection + sign(mesh%half_backlash, force)
   end function static_mesh_deflection

   !> Rigid support: [u1, u2, p].
   pure subroutine assemble_rigid(equations, gears)
      !> Equations to fill.
      type(equations_type), intent(inout) :: equations
      !> Gear pair.
      type(gear_pair), intent(in) :: gears

      real(wp) :: sine, cosine

      sine = sin(gears%pressure_angle)
      cosine = cos(gears%pressure_angle)
      allocate (equations%mass(rigid_dof, rigid_dof), equations%observation(5, rigid_dof), source=0.0_wp)
      equations%mass(iu1, iu1) = gears%mass(1)
      equations%mass(iu2, iu2) = gears%mass(2)
      equations%mass(irp, irp) = transmission_mass(gears)
      equations%damping = [gears%bearing_damping, 0.0_wp]
      equations%stiffness = [gears%bearing_stiffness, 0.0_wp]
      equations%direction = [1.0_wp, -1.0_wp, 1.0_wp]
      equations%observation(:, iu1) = [-cosine, sine, -cosine, 0.0_wp, 0.0_wp]
      equations%observation(:, iu2) = [0.0_wp, 0.0_wp, 0.0_wp, sine, -cosine]
      equations%static_position = static_equilibrium(equations)
      equations%static_observation = matmul(equations%observation, equations%static_position)
   end subroutine assemble_rigid

   !> Flexible support: [d_x1, d_y1, d_x2, d_y2, xM, yM, thM, p].
   pure subroutine assemble_flexible(equations, gears, box, point)
      !> Equations to fill.
      type(equations_type), intent(inout) :: equations
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Operating point.
      type(operating_point), intent(in) :: point

      real(wp) :: sine, cosine, motion(6, flexible_dof), body_mass(6), c_m, k_m, l_x2
      integer :: i, j

      sine = sin(gears%pressure_angle)
      cosine = cos(gears%pressure_angle)

      ! Rows give the absolute x1, y1, x2, y2, xM, yM; kinetic energy is half the sum of body_mass times their rates squared.
      motion = 0.0_wp
      motion(1, [idx1, ixm]) = 1.0_wp
      motion(2, [idy1, iym]) = 1.0_wp
      motion(2, itm) = -box%gear_offset
      motion(3, [idx2, ixm]) = 1.0_wp
      motion(4, [idy2, iym]) = 1.0_wp
      motion(4, itm) = box%gear_offset
      motion(5, ixm) = 1.0_wp
      motion(6, iym) = 1.0_wp
      body_mass = [gears%mass(1), gears%mass(1), gears%mass(2), gears%mass(2), box%mass, box%mass]
      allocate (equations%mass(flexible_dof, flexible_dof), equations%observation(5, flexible_dof), source=0.0_wp)
      do j = 1, flexible_dof
         do i = 1, flexible_dof
            equations%mass(i, j) = sum(body_mass*motion(:, i)*motion(:, j))
         end do
      end do
      equations%mass(itm, itm) = equations%mass(itm, itm) + box%inertia
      equations%mass(ip, ip) = transmission_mass(gears)

      c_m = support_damping(box, point)
      k_m = point%support_stiffness
      l_x2 = box%support_offset**2
      equations%damping = [gears%bearing_damping([1, 1, 2, 2]), c_m, c_m, l_x2*c_m, 0.0_wp]
      equations%stiffness = [gears%bearing_stiffness([1, 1, 2, 2]), k_m, k_m, l_x2*k_m, 0.0_wp]
      equations%direction = [sine, -cosine, -sine, cosine, 0.0_wp, 0.0_wp, 2.0_wp*box%gear_offset*cosine, 1.0_wp]
      equations%observation(1, :) = motion(2, :)
      do i = 1, 4
         equations%observation(i + 1, i) = 1.0_wp
      end do
      equations%static_position = static_equilibrium(equations)
      equations%static_observation = matmul(equations%observation, equations%static_position)
   end subroutine assemble_flexible

   !> Static equilibrium under the mean mesh stiffness: K q = -g F for the sprung coordinates, delta = delta_s for p.
   pure function static_equilibrium(equations) result(position)
      !> Equations whose stiffness, direction, mean force and static deflection are set; p is the last coordinate.
      type(equations_type), intent(in) :: equations
      !> Position measured from zero displacement, shape (n).
      real(wp), allocatable :: position(:)

      integer :: n

      n = equations%n
      allocate (position(n))
      position(:n - 1) = -equations%direction(:n - 1)*equations%mean_force/equations%stiffness(:n - 1)
      position(n) = equations%static_deflection - sum(equations%direction(:n - 1)*position(:n - 1))
   end function static_equilibrium

   !> Deviation from the static equilibrium when every coordinate is zero: the start 'rest'.
   pure function rest_deviation(equations) result(deviation)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Deviation, shape (n); its rate is zero.
      real(wp), allocatable :: deviation(:)

      deviation = -equations%static_position
   end function rest_deviation

   !> Rows that give the paper's coordinates x1, y1, th1, x2, y2, th2 [, xM, yM, thM].
   !>
   !> The common rotation of the gears, which the mesh does not see, is taken as zero: J1 r2 th1 + J2 r1 th2 = 0. It obeys
   !> (J1 r2 th1 + J2 r1 th2)'' = r2 T_d - r1 T_l, so that what is left out is the uniform rotation, and where the torques do not
   !> balance the uniform acceleration.
   pure function coordinate_rows(equations) result(rows)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Rows, shape (6, n) or (9, n).
      real(wp), allocatable :: rows(:, :)

      if (equations%n == flexible_dof) then
         allocate (rows(9, flexible_dof), source=0.0_wp)
         rows(1, [idx1, ixm]) = 1.0_wp
         rows(2, :) = equations%observation(1, :)
         rows(3, ip) = equations%rotation(1)
         rows(4, [idx2, ixm]) = 1.0_wp
         rows(5, [idy2, iym]) = 1.0_wp
         rows(5, itm) = -rows(2, itm)
         rows(6, ip) = equations%rotation(2)
         rows(7, ixm) = 1.0_wp
         rows(8, iym) = 1.0_wp
         rows(9, itm) = 1.0_wp
      else
         allocate (rows(6, rigid_dof), source=0.0_wp)
         ! Without a support that moves, displacements are bearing deformations.
         rows([1, 2, 4, 5], :) = equations%observation(2:, :)
         rows(3, irp) = equations%rotation(1)
         rows(6, irp) = equations%rotation(2)
      end if
   end function coordinate_rows

   !> The paper's coordinates from the deviation: displacement if `position`, rate otherwise.
   pure function paper_coordinates(equations, deviation, is_position) result(q)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium, or its rate, shape (n).
      real(wp), intent(in) :: deviation(:)
      !> The deviation is a position, not a rate.
      logical, intent(in) :: is_position
      !> x1, y1, th1, x2, y2, th2 [, xM, yM, thM], shape (6) or (9).
      real(wp), allocatable :: q(:)

      if (is_position) then
         q = matmul(coordinate_rows(equations), equations%static_position + deviation)
      else
         q = matmul(coordinate_rows(equations), deviation)
      end if
   end function paper_coordinates

end module spurflex_model_equations
