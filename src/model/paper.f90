!> The model as the paper writes it: mass, damping and stiffness matrices of Eqs. (12)-(27) in the coordinates
!>
!>     q = [x1, y1, th1, x2, y2, th2, xM, yM, thM]      flexible support
!>     q = [x1, y1, th1, x2, y2, th2]                   rigid support
!>
!> It is what results are reported in and what the tests compare with. The form that is integrated has fewer
!> coordinates, see `spurflex_model_equations`.
module spurflex_model_paper
   use spurflex_base_kinds, only: wp
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point, support_flexible
   implicit none
   private

   public :: coordinate_count, mass_matrix, stiffness_matrix, damping_matrix
   public :: mesh_direction, torque_vector, support_damping
   public :: coordinate_names

   !> Names of the coordinates in their order.
   character(len=3), parameter :: coordinate_names(9) = ['x1 ', 'y1 ', 'th1', 'x2 ', 'y2 ', 'th2', 'xM ', 'yM ', 'thM']

   integer, parameter :: ix1 = 1, iy1 = 2, it1 = 3, ix2 = 4, iy2 = 5, it2 = 6, ixm = 7, iym = 8, itm = 9
   integer, parameter :: rigid_count = 6, flexible_count = 9

contains

   !> Number of coordinates: 6 on a rigid, 9 on a flexible support.
   pure function coordinate_count(point) result(count)
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Number of coordinates.
      integer :: count

      count = merge(flexible_count, rigid_count, point%support == support_flexible)
   end function coordinate_count

   !> Diagonal mass matrix M, Eqs. (19) and (22) [kg, kg m2].
   pure function mass_matrix(gears, box, point) result(mass)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> M, shape (n, n).
      real(wp), allocatable :: mass(:, :)

      real(wp) :: diagonal(flexible_count)
      integer :: n, i

      n = coordinate_count(point)
      diagonal = [gears%mass(1), gears%mass(1), gears%inertia(1), gears%mass(2), gears%mass(2), gears%inertia(2), &
         box%mass, box%mass, box%inertia]
      allocate (mass(n, n), source=0.0_wp)
      do i = 1, n
         mass(i, i) = diagonal(i)
      end do
   end function mass_matrix

   !> Stiffness matrix K without the mesh, Eqs. (20) and (23) [N/m, N, N m].
   pure function stiffness_matrix(gears, box, point) result(stiffness)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> K, shape (n, n).
      real(wp), allocatable :: stiffness(:, :)

      stiffness = bearing_and_support(gears%bearing_stiffness, point%support_stiffness, box, coordinate_count(point))
   end function stiffness_matrix

   !> Damping matrix C without the mesh, Eqs. (21) and (24) [N s/m, N s, N m s].
   pure function damping_matrix(gears, box, point) result(damping)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> C, shape (n, n).
      real(wp), allocatable :: damping(:, :)

      damping = bearing_and_support(gears%bearing_damping, support_damping(box, point), box, coordinate_count(point))
   end function damping_matrix

   !> Damping of the support c_M = 2 xi sqrt(m_M k_M), Eq. (15) [N s/m].
   pure function support_damping(box, point) result(damping)
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> c_M, the same in x and y; 0 on a rigid support.
      real(wp) :: damping

      damping = 0.0_wp
      if (point%support == support_flexible) then
         damping = 2.0_wp*box%damping_ratio*sqrt(box%mass*point%support_stiffness)
      end if
   end function support_damping

   !> Gradient g of the mesh deflection, Eq. (14) [-, m].
   pure function mesh_direction(gears, point) result(direction)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> g, shape (n).
      real(wp), allocatable :: direction(:)

      allocate (direction(coordinate_count(point)), source=0.0_wp)
      direction(ix1) = sin(gears%pressure_angle)
      direction(iy1) = -cos(gears%pressure_angle)
      direction(it1) = gears%base_radius(1)
      direction(ix2) = -sin(gears%pressure_angle)
      direction(iy2) = cos(gears%pressure_angle)
      direction(it2) = -gears%base_radius(2)
   end function mesh_direction

   !> External torques T, Eq. (14) [N m].
   pure function torque_vector(load, point) result(torque)
      !> Torques.
      type(load_type), intent(in) :: load
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> T, shape (n).
      real(wp), allocatable :: torque(:)

      allocate (torque(coordinate_count(point)), source=0.0_wp)
      torque(it1) = load%driving_torque
      torque(it2) = -load%load_torque
   end function torque_vector

   !> The common form of K and C: springs or dampers of two bearings and of the support.
   pure function bearing_and_support(bearing, support, box, n) result(matrix)
      !> Coefficient of each bearing.
      real(wp), intent(in) :: bearing(2)
      !> Coefficient of the support in x and in y.
      real(wp), intent(in) :: support
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Number of coordinates.
      integer, intent(in) :: n
      !> The symmetric matrix, shape (n, n).
      real(wp), allocatable :: matrix(:, :)

      real(wp) :: full(flexible_count, flexible_count), offset

      offset = box%gear_offset
      full = 0.0_wp
      full(ix1, ix1) = bearing(1)
      full(iy1, iy1) = bearing(1)
      full(ix2, ix2) = bearing(2)
      full(iy2, iy2) = bearing(2)
      if (n == flexible_count) then
         full(ixm, ixm) = bearing(1) + bearing(2) + support
         full(iym, iym) = bearing(1) + bearing(2) + support
         full(itm, itm) = offset**2*(bearing(1) + bearing(2)) + box%support_offset**2*support
         full(ix1, ixm) = -bearing(1)
         full(ix2, ixm) = -bearing(2)
         full(iy1, iym) = -bearing(1)
         full(iy2, iym) = -bearing(2)
         full(iy1, itm) = offset*bearing(1)
         full(iy2, itm) = -offset*bearing(2)
         full(iym, itm) = offset*(bearing(2) - bearing(1))
         full(ixm, [ix1, ix2]) = full([ix1, ix2], ixm)
         full(iym, [iy1, iy2]) = full([iy1, iy2], iym)
         full(itm, [iy1, iy2, iym]) = full([iy1, iy2, iym], itm)
      end if
      matrix = full(:n, :n)
   end function bearing_and_support

end module spurflex_model_paper
