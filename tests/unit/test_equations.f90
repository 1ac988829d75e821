!> The equations that are integrated against the paper's: static equilibrium, energies, and the same motion.
module test_equations
   use cases, only: balanced_load, flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use paper_newmark, only: paper_motion, start_paper_motion, step_paper_motion
   use pseudo_random, only: random_stream
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, i8
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_options, only: solver_options
   use spurflex_integrate_period_map, only: observables, orbit_type
   use spurflex_model_equations, only: equations_type, mean_mesh_force, new_equations, paper_coordinates, rest_deviation
   use spurflex_model_mesh, only: backlash_deflection
   use spurflex_model_paper, only: damping_matrix, mass_matrix, mesh_direction, stiffness_matrix, torque_vector
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point, support_flexible
   use spurflex_steady_outcome, only: contact_both_flanks, contact_kept, contact_lost
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_equations

   !> Softest and stiffest support of the paper's map, and some between [N/m].
   real(wp), parameter :: stiffnesses(4) = [1.0e3_wp, 1.0e6_wp, 2.5e8_wp, 1.0e12_wp]

contains

   !> The tests of this suite.
   subroutine collect_equations(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('mean mesh force', test_mean_force), &
                  new_unittest('static equilibrium, forward torque', test_static_forward), &
                  new_unittest('static equilibrium, reversed torque', test_static_reversed), &
                  new_unittest('static equilibrium, no torque', test_static_none), &
                  new_unittest('rest is zero displacement', test_rest), &
                  new_unittest('energies and deflection of random states', test_energies), &
                  new_unittest('observed quantities of random states', test_observation), &
                  new_unittest('the same motion as nine coordinates, contact kept', test_motion_flexible_kept), &
                  new_unittest('the same motion as nine coordinates, contact lost', test_motion_flexible_lost), &
                  new_unittest('the same motion as nine coordinates, both flanks', test_motion_flexible_both), &
                  new_unittest('the same motion as six coordinates', test_motion_rigid), &
                  new_unittest('the same motion for gamma above a half', test_motion_gamma) &
                  ]
   end subroutine collect_equations

   !> Torques that balance are held by the force T_d/r1; one torque alone is shared by the inertias.
   subroutine test_mean_force(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: roundoff = 1.0e-14_wp
      type(gear_pair) :: gears

      gears = reference_gears()
      call check(error, mean_mesh_force(gears, balanced_load(gears, 110.0_wp)), 110.0_wp/0.05168_wp, roundoff, 'balanced', &
                 relative=.true.)
      if (allocated(error)) return
      ! Two equal gears pushed by one torque: half of the force speeds up each of them.
      gears%base_radius = 0.05_wp
      gears%inertia = 0.004_wp
      call check(error, mean_mesh_force(gears, load_type(100.0_wp, 0.0_wp)), 1000.0_wp, roundoff, 'one torque', &
                 relative=.true.)
   end subroutine test_mean_force

   !> Front flanks in contact.
   subroutine test_static_forward(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check_static(110.0_wp, error)
   end subroutine test_static_forward

   !> Back flanks in contact.
   subroutine test_static_reversed(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check_static(-110.0_wp, error)
   end subroutine test_static_reversed

   !> No contact.
   subroutine test_static_none(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check_static(0.0_wp, error)
   end subroutine test_static_none

   !> The residual K q + g k_m0 f(delta) - T of the paper's equations vanishes at the static equilibrium.
   subroutine check_static(torque, error)
      !> Torque on gear 1; the other one balances it [N m].
      real(wp), intent(in) :: torque
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> On the softest support springs of 2e8 N/m hold differences of displacements of metres: 1e-16 of 1e9 N, over 2e3 N.
      real(wp), parameter :: tolerance = 1.0e-9_wp
      type(gear_pair) :: gears
      type(load_type) :: load
      type(equations_type) :: equations
      type(operating_point) :: points(size(stiffnesses) + 1)
      real(wp), allocatable :: q(:), residual(:)
      real(wp) :: scale, delta
      integer :: i

      gears = reference_gears()
      load = balanced_load(gears, torque)
      points(1) = rigid_point(1500.0_wp)
      do i = 1, size(stiffnesses)
         points(i + 1) = flexible_point(1500.0_wp, stiffnesses(i))
      end do
      scale = max(abs(torque)/gears%base_radius(1), 1.0_wp)
      do i = 1, size(points)
         equations = new_equations(gears, reference_box(), load, points(i))
         q = paper_coordinates(equations, spread(0.0_wp, 1, equations%n), .true.)
         delta = dot_product(mesh_direction(gears, points(i)), q)
         residual = matmul(stiffness_matrix(gears, reference_box(), points(i)), q) - torque_vector(load, points(i)) &
                    + mesh_direction(gears, points(i))*gears%mesh%mean_stiffness &
                    *backlash_deflection(delta, gears%mesh%half_backlash)
         call check(error, maxval(abs(residual)), 0.0_wp, tolerance*scale, 'residual')
         if (allocated(error)) return
         call check(error, equations%static_deflection*torque >= 0.0_wp, 'flank')
         if (allocated(error)) return
      end do
   end subroutine check_static

   !> The start 'rest' is zero displacement of every coordinate of the paper.
   subroutine test_rest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(equations_type) :: equations
      real(wp), allocatable :: q(:)
      integer :: i

      gears = reference_gears()
      do i = 1, size(stiffnesses)
         equations = new_equations(gears, reference_box(), reference_load(), flexible_point(1500.0_wp, stiffnesses(i)))
         q = paper_coordinates(equations, rest_deviation(equations), .true.)
         call check(error, maxval(abs(q)), 0.0_wp, 0.0_wp)
         if (allocated(error)) return
      end do
   end subroutine test_rest

   !> T, U, R and delta of the small equations are those of the paper.
   subroutine test_energies(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Sums of nine terms with differences of coordinates of the same size.
      real(wp), parameter :: tolerance = 1.0e-13_wp
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(operating_point) :: point
      type(equations_type) :: equations
      type(random_stream) :: random
      real(wp), allocatable :: z(:), rate(:), q(:), v(:)
      integer :: i, n

      gears = reference_gears()
      gears%bearing_stiffness = [1.7e8_wp, 2.9e8_wp]
      gears%bearing_damping = [1300.0_wp, 2100.0_wp]
      box = reference_box()
      random = random_stream(11_i8)
      do i = 1, 100
         point = flexible_point(1500.0_wp, 1.0e8_wp)
         if (mod(i, 4) == 0) point = rigid_point(1500.0_wp)
         ! Without torques a deviation is a displacement.
         equations = new_equations(gears, box, load_type(), point)
         n = equations%n
         if (allocated(z)) deallocate (z, rate)
         allocate (z(n), rate(n))
         call random%fill(-1.0_wp, 1.0_wp, z)
         call random%fill(-1.0_wp, 1.0_wp, rate)
         q = paper_coordinates(equations, z, .true.)
         v = paper_coordinates(equations, rate, .false.)
         call check(error, dot_product(rate, matmul(equations%mass, rate)), &
                    dot_product(v, matmul(mass_matrix(gears, box, point), v)), tolerance, 'T', relative=.true.)
         if (allocated(error)) return
         call check(error, sum(equations%stiffness*z**2), dot_product(q, matmul(stiffness_matrix(gears, box, point), q)), &
                    tolerance, 'U', relative=.true.)
         if (allocated(error)) return
         call check(error, sum(equations%damping*rate**2), dot_product(v, matmul(damping_matrix(gears, box, point), v)), &
                    tolerance, 'R', relative=.true.)
         if (allocated(error)) return
         call check(error, dot_product(equations%direction, z), dot_product(mesh_direction(gears, point), q), tolerance, &
                    'delta')
         if (allocated(error)) return
      end do
   end subroutine test_energies

   !> y1 and the bearing deformations of Eqs. (6)-(7), of positions with the static equilibrium in them.
   subroutine test_observation(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off of displacements of a few metres on the softest support [m].
      real(wp), parameter :: tolerance = 1.0e-14_wp
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(operating_point) :: point
      type(equations_type) :: equations
      type(random_stream) :: random
      real(wp), allocatable :: z(:), q(:)
      real(wp) :: expected(observables), found(observables)
      integer :: i

      gears = reference_gears()
      box = reference_box()
      random = random_stream(13_i8)
      do i = 1, 60
         point = flexible_point(1500.0_wp, stiffnesses(1 + mod(i, size(stiffnesses))))
         if (mod(i, 5) == 0) point = rigid_point(1500.0_wp)
         equations = new_equations(gears, box, reference_load(), point)
         if (allocated(z)) deallocate (z)
         allocate (z(equations%n))
         call random%fill(-1.0e-4_wp, 1.0e-4_wp, z)
         q = paper_coordinates(equations, z, .true.)
         expected = [q(2), q(1), q(2), q(4), q(5)]
         if (point%support == support_flexible) then
            expected(2:) = [q(1) - q(7), q(2) - q(8) + box%gear_offset*q(9), q(4) - q(7), q(5) - q(8) - box%gear_offset*q(9)]
         end if
         found = equations%static_observation + matmul(equations%observation, z)
         call check(error, maxval(abs(found - expected)), 0.0_wp, tolerance)
         if (allocated(error)) return
      end do
   end subroutine test_observation

   !> Flexible support, teeth always in contact.
   subroutine test_motion_flexible_kept(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears

      gears = reference_gears()
      gears%mesh%error_amplitudes = 1.0e-6_wp
      call compare_motions(gears, 110.0_wp, flexible_point(1500.0_wp, 2.5e8_wp), solver_options(steps_per_period=64), &
                           contact_kept, error)
   end subroutine test_motion_flexible_kept

   !> Flexible support, teeth part.
   subroutine test_motion_flexible_lost(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_motions(reference_gears(), 110.0_wp, flexible_point(2600.0_wp, 2.5e8_wp), &
                           solver_options(steps_per_period=64), contact_lost, error)
   end subroutine test_motion_flexible_lost

   !> Flexible support, teeth strike on both flanks, driven by a small reversed torque.
   subroutine test_motion_flexible_both(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_motions(reference_gears(), -5.0_wp, flexible_point(3500.0_wp, 1.0e7_wp), &
                           solver_options(steps_per_period=64), contact_both_flanks, error)
   end subroutine test_motion_flexible_both

   !> Rigid support, teeth part.
   subroutine test_motion_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_motions(reference_gears(), 110.0_wp, rigid_point(2600.0_wp), solver_options(steps_per_period=64), &
                           contact_lost, error)
   end subroutine test_motion_rigid

   !> Newmark's parameters enter both in the same way.
   subroutine test_motion_gamma(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_motions(reference_gears(), 110.0_wp, flexible_point(2600.0_wp, 1.0e10_wp), &
                           solver_options(steps_per_period=64, newmark_beta=0.3025_wp, newmark_gamma=0.6_wp), &
                           contact_lost, error)
   end subroutine test_motion_gamma

   !> Integrate the small equations and the paper's, step by step the same motion.
   subroutine compare_motions(gears, torque, point, options, contact, error)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Torque on gear 1; the other one balances it [N m].
      real(wp), intent(in) :: torque
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Steps and Newmark's parameters.
      type(solver_options), intent(in) :: options
      !> `contact_...` that the motion must have, so that the case is what it is meant to be.
      integer, intent(in) :: contact
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: periods = 100
      !> Roundings of displacements of 1e-5 m are 1e-21 m; over 6400 steps they grow to 1e-18 m where contact is lost [m].
      real(wp), parameter :: tolerance = 1.0e-16_wp
      type(gearbox) :: box
      type(load_type) :: load
      type(equations_type) :: equations
      type(newmark_map) :: map
      type(orbit_type) :: orbit
      type(paper_motion) :: motion
      type(library_error), allocatable :: fault
      real(wp), allocatable :: start(:), rate(:), state(:), position(:), velocity(:), q(:)
      real(wp) :: smallest, largest, deflection
      integer :: p, s, n, found

      box = reference_box()
      load = balanced_load(gears, torque)
      equations = new_equations(gears, box, load, point)
      n = equations%n
      map%beta = options%newmark_beta
      map%gamma = options%newmark_gamma
      call map%load(equations, options%steps_per_period, fault)
      call check(error, .not. allocated(fault), 'load')
      if (allocated(error)) return
      ! A start off the equilibrium and moving, in every coordinate.
      start = 1.0e-7_wp*[(real(s, wp), s=1, n)]
      rate = 1.0e-3_wp*[(real(n - s, wp), s=1, n)]
      state = map%to_state(start, rate)
      call start_paper_motion(motion, gears, box, load, point, paper_coordinates(equations, start, .true.), &
                              paper_coordinates(equations, rate, .false.), options%steps_per_period, &
                              options%newmark_beta, options%newmark_gamma)
      smallest = huge(smallest)
      largest = -huge(largest)
      do p = 1, periods
         call map%advance(state, orbit=orbit)
         do s = 1, options%steps_per_period
            call step_paper_motion(motion)
            call check(error, .not. motion%failed, 'a consistent branch of the contact')
            if (allocated(error)) return
            smallest = min(smallest, motion%delta)
            largest = max(largest, motion%delta)
            call check(error, equations%static_observation(1) + orbit%value(1, s), motion%q(2), tolerance, 'y1')
            if (allocated(error)) return
         end do
         call map%from_state(state, position, velocity)
         q = paper_coordinates(equations, position, .true.)
         deflection = dot_product(mesh_direction(gears, point), q)
         call check(error, deflection, dot_product(mesh_direction(gears, point), motion%q), tolerance, 'g.q')
         if (allocated(error)) return
         ! The common rotation is free: only r1 th1 - r2 th2, which is in g.q, is the same.
         q([3, 6]) = motion%q([3, 6])
         call check(error, maxval(abs(q - motion%q)), 0.0_wp, tolerance, 'displacements')
         if (allocated(error)) return
      end do
      associate (b => gears%mesh%half_backlash)
         found = contact_lost
         if (smallest >= b .or. largest <= -b) found = contact_kept
         if (smallest <= -b .and. largest >= b) found = contact_both_flanks
      end associate
      call check(error, found, contact, 'contact that is meant')
   end subroutine compare_motions

end module test_equations
