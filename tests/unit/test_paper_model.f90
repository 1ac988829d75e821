!> The matrices of the paper against the energies that they come from, Eqs. (3), (6)-(11).
!>
!> Energies are quadratic, so that second differences with unit steps give their matrices but for round-off.
module test_paper_model
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use spurflex_base_kinds, only: wp
   use spurflex_model_paper, only: coordinate_count, coordinate_names, damping_matrix, mass_matrix, mesh_direction, &
      stiffness_matrix, support_damping, torque_vector
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_paper_model

   integer, parameter :: coordinates = 9

   !> Soft, as soft as the bearings, stiff [N/m].
   real(wp), parameter :: stiffnesses(3) = [1.0e3_wp, 2.5e8_wp, 1.0e12_wp]

   !> Round-off of a dozen operations, relative to the largest coefficient of the matrix.
   real(wp), parameter :: roundoff = 1.0e-14_wp

contains

   !> The tests of this suite.
   subroutine collect_paper_model(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('K is the second derivative of U', test_stiffness), &
                  new_unittest('C is the second derivative of R', test_damping), &
                  new_unittest('M is the second derivative of T', test_mass), &
                  new_unittest('g is the derivative of delta', test_direction), &
                  new_unittest('torques do the work T_d th1 - T_l th2', test_torque), &
                  new_unittest('K, C and M are symmetric', test_symmetry), &
                  new_unittest('the rigid model is the first six with the gearbox held', test_rigid), &
                  new_unittest('support damping, Eq. 15', test_support_damping) &
                  ]
   end subroutine collect_paper_model

   !> Gears that differ in everything, so that no entry of a matrix vanishes or is met by another's mistake.
   pure function uneven_gears() result(gears)
      !> The gear pair.
      type(gear_pair) :: gears

      gears = reference_gears()
      gears%bearing_stiffness = [1.7e8_wp, 2.9e8_wp]
      gears%bearing_damping = [1300.0_wp, 2100.0_wp]
   end function uneven_gears

   !> U of Eq. (10) with the deformations of Eqs. (6)-(8); R of Eq. (11) has dampers and rates instead.
   pure function spring_energy(bearing, support, box, q) result(energy)
      !> Coefficient of each bearing, and of the support in x and in y.
      real(wp), intent(in) :: bearing(2), support(2)
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> x1, y1, th1, x2, y2, th2, xM, yM, thM.
      real(wp), intent(in) :: q(coordinates)
      !> Energy.
      real(wp) :: energy

      real(wp) :: d_x(2), d_y(2), x_support(2), y_support(2)

      associate (x1 => q(1), y1 => q(2), x2 => q(4), y2 => q(5), x_m => q(7), y_m => q(8), th_m => q(9))
         d_x = [x1 - x_m, x2 - x_m]
         d_y = [y1 - y_m + box%gear_offset*th_m, y2 - y_m - box%gear_offset*th_m]
         x_support = x_m
         y_support = [y_m - box%support_offset*th_m, y_m + box%support_offset*th_m]
      end associate
      energy = 0.5_wp*(sum(bearing*(d_x**2 + d_y**2)) + 0.5_wp*support(1)*sum(x_support**2) &
                       + 0.5_wp*support(2)*sum(y_support**2))
   end function spring_energy

   !> T of Eq. (9).
   pure function kinetic_energy(gears, box, rate) result(energy)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Rates of x1, y1, th1, x2, y2, th2, xM, yM, thM.
      real(wp), intent(in) :: rate(coordinates)
      !> Energy.
      real(wp) :: energy

      energy = 0.5_wp*(gears%mass(1)*sum(rate(1:2)**2) + gears%inertia(1)*rate(3)**2 &
                       + gears%mass(2)*sum(rate(4:5)**2) + gears%inertia(2)*rate(6)**2 &
                       + box%mass*sum(rate(7:8)**2) + box%inertia*rate(9)**2)
   end function kinetic_energy

   !> delta of Eq. (3), without the transmission error.
   pure function mesh_deflection(gears, q) result(delta)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> x1, y1, th1, x2, y2, th2, ...
      real(wp), intent(in) :: q(coordinates)
      !> delta.
      real(wp) :: delta

      delta = (q(1) - q(4))*sin(gears%pressure_angle) - (q(2) - q(5))*cos(gears%pressure_angle) &
              + q(3)*gears%base_radius(1) - q(6)*gears%base_radius(2)
   end function mesh_deflection

   !> One coordinate is one, the others are zero.
   pure function unit(i) result(q)
      !> Which one.
      integer, intent(in) :: i
      !> The coordinates.
      real(wp) :: q(coordinates)

      q = 0.0_wp
      q(i) = 1.0_wp
   end function unit

   !> Every entry of the stiffness matrix, on supports from soft to stiff.
   subroutine test_stiffness(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(gearbox) :: box
      real(wp) :: k_m
      integer :: s

      gears = uneven_gears()
      box = reference_box()
      do s = 1, size(stiffnesses)
         k_m = stiffnesses(s)
         call check_quadratic(stiffness_matrix(gears, box, flexible_point(1000.0_wp, k_m)), gears%bearing_stiffness, &
                              [k_m, k_m], box, 'K', error)
         if (allocated(error)) return
      end do
   end subroutine test_stiffness

   !> Every entry of the damping matrix, on supports from soft to stiff.
   subroutine test_damping(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(gearbox) :: box
      real(wp) :: c_m
      integer :: s

      gears = uneven_gears()
      box = reference_box()
      do s = 1, size(stiffnesses)
         c_m = 2.0_wp*box%damping_ratio*sqrt(box%mass*stiffnesses(s))
         call check_quadratic(damping_matrix(gears, box, flexible_point(1000.0_wp, stiffnesses(s))), gears%bearing_damping, &
                              [c_m, c_m], box, 'C', error)
         if (allocated(error)) return
      end do
   end subroutine test_damping

   !> Compare a matrix with the second differences of the energy in springs or dampers.
   subroutine check_quadratic(matrix, bearing, support, box, name, error)
      !> The matrix, shape (9, 9).
      real(wp), intent(in) :: matrix(:, :)
      !> Coefficient of each bearing, and of the support in x and in y.
      real(wp), intent(in) :: bearing(2), support(2)
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Name of the matrix.
      character(len=*), intent(in) :: name
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: expected
      integer :: i, j

      do j = 1, coordinates
         do i = 1, coordinates
            expected = 0.25_wp*(spring_energy(bearing, support, box, unit(i) + unit(j)) &
                                - spring_energy(bearing, support, box, unit(i) - unit(j)) &
                                - spring_energy(bearing, support, box, unit(j) - unit(i)) &
                                + spring_energy(bearing, support, box, -unit(i) - unit(j)))
            call check(error, matrix(i, j), expected, roundoff*(sum(bearing) + maxval(support)), &
                       name//'('//trim(coordinate_names(i))//', '//trim(coordinate_names(j))//')')
            if (allocated(error)) return
         end do
      end do
   end subroutine check_quadratic

   !> Every entry of the mass matrix.
   subroutine test_mass(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(gearbox) :: box
      real(wp), allocatable :: mass(:, :)
      real(wp) :: expected
      integer :: i, j

      gears = uneven_gears()
      box = reference_box()
      mass = mass_matrix(gears, box, flexible_point(1000.0_wp, 1.0e8_wp))
      do j = 1, coordinates
         do i = 1, coordinates
            expected = 0.5_wp*(kinetic_energy(gears, box, unit(i) + unit(j)) - kinetic_energy(gears, box, unit(i) - unit(j)))
            call check(error, mass(i, j), expected, roundoff*box%mass, &
                       'M('//trim(coordinate_names(i))//', '//trim(coordinate_names(j))//')')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_mass

   !> Every entry of g: delta is linear in q.
   subroutine test_direction(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      real(wp), allocatable :: direction(:)
      integer :: i

      gears = uneven_gears()
      direction = mesh_direction(gears, flexible_point(1000.0_wp, 1.0e8_wp))
      do i = 1, coordinates
         call check(error, direction(i), 0.5_wp*(mesh_deflection(gears, unit(i)) - mesh_deflection(gears, -unit(i))), &
                    roundoff, 'g('//trim(coordinate_names(i))//')')
         if (allocated(error)) return
      end do
   end subroutine test_direction

   !> The driving torque turns gear 1 forward, the load torque holds gear 2 back.
   subroutine test_torque(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(load_type) :: load
      real(wp), allocatable :: torque(:)
      real(wp) :: expected(coordinates)

      load = reference_load()
      expected = load%driving_torque*unit(3) - load%load_torque*unit(6)
      torque = torque_vector(load, flexible_point(1000.0_wp, 1.0e8_wp))
      call check(error, all(abs(torque - expected) <= 0.0_wp), 'flexible support')
      if (allocated(error)) return
      torque = torque_vector(load, rigid_point(1000.0_wp))
      call check(error, all(abs(torque - expected(:6)) <= 0.0_wp), 'rigid support')
   end subroutine test_torque

   !> The matrices are symmetric to the last bit.
   subroutine test_symmetry(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(operating_point) :: point

      point = flexible_point(1000.0_wp, 3.0e7_wp)
      call check(error, is_symmetric(stiffness_matrix(uneven_gears(), reference_box(), point)), 'K')
      if (allocated(error)) return
      call check(error, is_symmetric(damping_matrix(uneven_gears(), reference_box(), point)), 'C')
      if (allocated(error)) return
      call check(error, is_symmetric(mass_matrix(uneven_gears(), reference_box(), point)), 'M')
   end subroutine test_symmetry

   !> Whether a matrix equals its transpose.
   pure function is_symmetric(matrix) result(symmetric)
      !> The matrix, shape (n, n).
      real(wp), intent(in) :: matrix(:, :)
      !> It does.
      logical :: symmetric

      symmetric = all(abs(matrix - transpose(matrix)) <= 0.0_wp)
   end function is_symmetric

   !> With the gearbox held, the first six rows and columns are the rigid model, Eqs. (22)-(27).
   subroutine test_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: held = 6
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(operating_point) :: flexible, rigid

      gears = uneven_gears()
      box = reference_box()
      flexible = flexible_point(1000.0_wp, 3.0e7_wp)
      rigid = rigid_point(1000.0_wp)
      call check(error, coordinate_count(flexible), coordinates, 'coordinates of the flexible model')
      if (allocated(error)) return
      call check(error, coordinate_count(rigid), held, 'coordinates of the rigid model')
      if (allocated(error)) return
      call check(error, same_block(stiffness_matrix(gears, box, rigid), stiffness_matrix(gears, box, flexible)), 'K')
      if (allocated(error)) return
      call check(error, same_block(damping_matrix(gears, box, rigid), damping_matrix(gears, box, flexible)), 'C')
      if (allocated(error)) return
      call check(error, same_block(mass_matrix(gears, box, rigid), mass_matrix(gears, box, flexible)), 'M')
      if (allocated(error)) return
      associate (small => mesh_direction(gears, rigid), large => mesh_direction(gears, flexible))
         call check(error, size(small), held, 'size of g')
         if (allocated(error)) return
         call check(error, all(abs(small - large(:held)) <= 0.0_wp), 'g')
      end associate
   end subroutine test_rigid

   !> Whether a matrix is the first block of a larger one.
   pure function same_block(small, large) result(same)
      !> The matrix, shape (n, n).
      real(wp), intent(in) :: small(:, :)
      !> The larger one.
      real(wp), intent(in) :: large(:, :)
      !> It is.
      logical :: same

      same = all(abs(small - large(:size(small, 1), :size(small, 2))) <= 0.0_wp)
   end function same_block

   !> c_M = 2 xi sqrt(m_M k_M); nothing on a rigid support.
   subroutine test_support_damping(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gearbox) :: box

      box = reference_box()
      box%mass = 25.0_wp
      box%damping_ratio = 0.2_wp
      call check(error, support_damping(box, flexible_point(1000.0_wp, 4.0e4_wp)), 400.0_wp, roundoff, 'flexible', &
                 relative=.true.)
      if (allocated(error)) return
      call check(error, support_damping(box, rigid_point(1000.0_wp)), 0.0_wp, 0.0_wp, 'rigid')
   end subroutine test_support_damping

end module test_paper_model
