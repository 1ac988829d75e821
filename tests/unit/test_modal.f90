!> The linear part in its modes: it reproduces the equations of motion, and nothing that is felt is left out.
module test_modal
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use pseudo_random, only: random_stream
   use runge_kutta, only: new_runge_kutta, runge_kutta_type
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_modal, only: modal_system, new_modal_system
   use spurflex_model_parameters, only: gear_pair, gearbox, mesh_frequency
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_modal

   !> Teeth of the driving gear.
   integer, parameter :: reference_teeth = 55

   !> Round-off of the eigenvectors.
   real(wp), parameter :: roundoff = 1.0e-11_wp

   !> What the response may lose with modes that are left out: they are those whose share is below 1e-14, times what a weak
   !> mode does to a coordinate that hardly moves otherwise; measured 2e-8, on a support of 1e12 N/m.
   real(wp), parameter :: left_out = 1.0e-7_wp

contains

   !> The tests of this suite.
   subroutine collect_modal(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('to the modes and back', test_inverse), &
                  new_unittest('modes solve the linear equations', test_residual), &
                  new_unittest('response to the mesh force, soft to stiff', test_response), &
                  new_unittest('critical and over-damped supports', test_damping), &
                  new_unittest('two modes that meet', test_meeting_modes), &
                  new_unittest('undriven modes are left out', test_undriven), &
                  new_unittest('the motion without the undriven modes', test_motion_without), &
                  new_unittest('equal gears: modes that occur twice', test_equal_gears) &
                  ]
   end subroutine collect_modal

   !> Points on both kinds of support, soft to stiff.
   pure function some_points() result(equations)
      !> Equations of motion, shape (points).
      type(equations_type) :: equations(5)

      real(wp), parameter :: stiffness(4) = [1.0e3_wp, 1.0e6_wp, 2.5e8_wp, 1.0e12_wp], speed = 1500.0_wp
      integer :: i

      equations(1) = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speed))
      do i = 1, size(stiffness)
         equations(i + 1) = new_equations(reference_gears(), reference_box(), reference_load(), &
                                          flexible_point(speed, stiffness(i)))
      end do
   end function some_points

   !> The modes of a point.
   subroutine find(equations, modal, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The modes.
      type(modal_system), intent(out) :: modal
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault

      call new_modal_system(equations, modal, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
   end subroutine find

   !> Modes come back from the coordinates, and so does every state where no mode is left out; what is felt is the same.
   subroutine test_inverse(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type) :: equations(5)
      type(modal_system) :: modal
      type(random_stream) :: random
      real(wp), allocatable :: re(:), im(:), state(:), back(:)
      complex(wp), allocatable :: z(:)
      integer :: k, n

      equations = some_points()
      do k = 1, size(equations)
         call find(equations(k), modal, error)
         if (allocated(error)) return
         n = equations(k)%n
         allocate (re(modal%modes), im(modal%modes), state(2*n))
         call random%fill(-1.0_wp, 1.0_wp, re)
         call random%fill(-1.0_wp, 1.0_wp, im)
         z = cmplx(re, merge(0.0_wp, im, modal%is_real), wp)
         state = real(matmul(modal%from_modes, z), wp)
         call check(error, maxval(abs(matmul(modal%to_modes, cmplx(state, 0.0_wp, wp)) - z)), 0.0_wp, &
                    roundoff*maxval(abs(modal%from_modes(:n, :))), 'modes of point '//to_text(k))
         if (allocated(error)) return
         call check(error, dot_product(equations(k)%direction, state(:n)), sum(real(z, wp)), &
                    roundoff*maxval(abs(modal%from_modes(:n, :))), 'mesh deflection of point '//to_text(k))
         if (allocated(error)) return
         call check(error, maxval(abs(real(matmul(modal%observation, z), wp) &
                                      - matmul(equations(k)%observation, state(:n)))), 0.0_wp, &
                    roundoff*maxval(abs(modal%observation)), 'observation of point '//to_text(k))
         if (allocated(error)) return
         if (count(modal%is_real) + 2*count(.not. modal%is_real) == 2*n) then
            call random%fill(-1.0_wp, 1.0_wp, state)
            state(n + 1:) = state(n + 1:)*minval(abs(modal%rate))
            back = real(matmul(modal%from_modes, matmul(modal%to_modes, cmplx(state, 0.0_wp, wp))), wp)
            call check(error, maxval(abs(back(:n) - state(:n))), 0.0_wp, roundoff, 'position of point '//to_text(k))
            if (allocated(error)) return
         end if
         deallocate (re, im, state)
      end do
   end subroutine test_inverse

   !> z exp(lambda t) satisfies M q'' + (C + c_m g g^T) q' + (K + k_m0 g g^T) q = 0.
   subroutine test_residual(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type) :: equations(5)
      type(modal_system) :: modal
      integer :: k

      equations = some_points()
      do k = 1, size(equations)
         call find(equations(k), modal, error)
         if (allocated(error)) return
         call check_residual(equations(k), modal, 'point '//to_text(k), error)
         if (allocated(error)) return
      end do
   end subroutine test_residual

   !> Every mode solves the linear equations, and its rate is lambda times its position.
   !>
   !> Eigenvalues are known to round-off beside the largest one.
   subroutine check_residual(equations, modal, name, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Their modes.
      type(modal_system), intent(in) :: modal
      !> Name of the point.
      character(len=*), intent(in) :: name
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      complex(wp) :: q(equations%n), v(equations%n), term(equations%n, 3)
      !> Units of round-off.
      real(wp), parameter :: operations = 1.0e5_wp
      real(wp) :: scale, tolerance
      integer :: j, n

      n = equations%n
      do j = 1, modal%modes
         tolerance = operations*epsilon(1.0_wp)*maxval(abs(modal%rate))/abs(modal%rate(j))
         q = modal%from_modes(:n, j)
         v = modal%from_modes(n + 1:, j)
         call check(error, maxval(abs(v - modal%rate(j)*q))/maxval(abs(v)), 0.0_wp, tolerance, name//', rate of a mode')
         if (allocated(error)) return
         term(:, 1) = matmul(equations%mass, modal%rate(j)*v)
         term(:, 2) = equations%damping*v + equations%direction*equations%mesh%damping*sum(equations%direction*v)
         term(:, 3) = equations%stiffness*q + equations%direction*equations%mesh%mean_stiffness*sum(equations%direction*q)
         scale = maxval(abs(term))
         call check(error, maxval(abs(sum(term, 2)))/scale, 0.0_wp, tolerance, name//', residual of a mode')
         if (allocated(error)) return
      end do
   end subroutine check_residual

   !> Harmonic response of the mesh deflection, y1 and the bearing deformations to N, by the modes and by a dense system.
   subroutine test_response(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer :: decade

      call check_response(new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(1500.0_wp)), &
                          left_out, 'rigid support', error)
      do decade = 3, 12
         if (allocated(error)) return
         call check_response(new_equations(reference_gears(), reference_box(), reference_load(), &
                                           flexible_point(1500.0_wp, 10.0_wp**decade)), left_out, &
                             'support of 1e'//to_text(decade), error)
      end do
   end subroutine test_response

   !> Compare the harmonic response at the first three harmonics of 300 to 6000 rev/min.
   subroutine check_response(equations, tolerance, name, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Accepted relative difference of each quantity.
      real(wp), intent(in) :: tolerance
      !> Name of the point.
      character(len=*), intent(in) :: name
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [300.0_wp, 1500.0_wp, 6000.0_wp]
      integer, parameter :: harmonics = 3
      type(modal_system) :: modal
      complex(wp) :: matrix(equations%n, equations%n), q(equations%n), exact(6), found(6), s
      integer :: i, k, m, n

      call find(equations, modal, error)
      if (allocated(error)) return
      n = equations%n
      do k = 1, size(speed)
         do m = 1, harmonics
            s = cmplx(0.0_wp, real(m, wp)*mesh_frequency(reference_teeth, speed(k)), wp)
            matrix = s**2*equations%mass + (s*equations%mesh%damping + equations%mesh%mean_stiffness) &
                     *spread(equations%direction, 2, n)*spread(equations%direction, 1, n)
            do i = 1, n
               matrix(i, i) = matrix(i, i) + s*equations%damping(i) + equations%stiffness(i)
            end do
            q = solve(matrix, cmplx(-equations%direction, 0.0_wp, wp))
            exact = [sum(equations%direction*q), matmul(equations%observation, q)]
            found(1) = -0.5_wp*sum(modal%influence/(s - modal%rate) + conjg(modal%influence)/(s - conjg(modal%rate)))
            found(2:) = -0.5_wp*(matmul(modal%observation, modal%influence/(s - modal%rate)) &
                                 + matmul(conjg(modal%observation), conjg(modal%influence)/(s - conjg(modal%rate))))
            call check(error, maxval(abs(found - exact)/max(abs(exact), tiny(1.0_wp))), 0.0_wp, tolerance, &
                       name//', harmonic '//to_text(m)//' at '//to_text(speed(k))//' rev/min')
            if (allocated(error)) return
         end do
      end do
   end subroutine check_response

   !> Damping ratios of the support of one and of three: real modes take the place of pairs.
   subroutine test_damping(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Modes of a critically damped support of 1e12 N/m nearly meet and are left out; measured 2e-7.
      real(wp), parameter :: weak = 1.0e-6_wp
      real(wp), parameter :: ratio(2) = [1.0_wp, 3.0_wp], stiffness(3) = [1.0e3_wp, 2.5e8_wp, 1.0e12_wp]
      type(equations_type) :: equations
      type(modal_system) :: modal
      type(gearbox) :: box
      integer :: i, k

      do k = 1, size(ratio)
         do i = 1, size(stiffness)
            box = reference_box()
            box%damping_ratio = ratio(k)
            equations = new_equations(reference_gears(), box, reference_load(), flexible_point(1500.0_wp, stiffness(i)))
            call find(equations, modal, error)
            if (allocated(error)) return
            call check_residual(equations, modal, 'damping ratio '//to_text(ratio(k)), error)
            if (allocated(error)) return
            call check_response(equations, weak, 'damping ratio '//to_text(ratio(k)), error)
            if (allocated(error)) return
            call check(error, maxval(real(modal%rate, wp)) < 0.0_wp, 'every mode decays')
            if (allocated(error)) return
            if (k == 2) call check(error, any(modal%is_real), 'modes without oscillation')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_damping

   !> Where a pair of modes becomes two real ones the eigenvectors are nearly parallel and cancel in the response; a millionth
   !> beside that damping ratio only a few digits are lost.
   subroutine test_meeting_modes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Eigenvectors of two modes 1e-3 apart; measured 1e-8.
      real(wp), parameter :: tolerance = 1.0e-6_wp
      real(wp), parameter :: beside = 1.0e-6_wp
      integer, parameter :: bisections = 40
      type(modal_system) :: modal
      real(wp) :: low, high, middle, stiffness
      integer :: k, pairs, decade

      do decade = 6, 11
         stiffness = 2.5_wp*10.0_wp**decade
         low = 0.15_wp
         high = 5.0_wp
         call find(of_ratio(low), modal, error)
         if (allocated(error)) return
         pairs = count(.not. modal%is_real)
         do k = 1, bisections
            middle = 0.5_wp*(low + high)
            call find(of_ratio(middle), modal, error)
            if (allocated(error)) return
            if (count(.not. modal%is_real) == pairs) then
               low = middle
            else
               high = middle
            end if
         end do
         call check(error, high < 5.0_wp, 'modes meet within the range of damping ratios')
         if (allocated(error)) return
         call check_response(of_ratio(low*(1.0_wp - beside)), tolerance, 'just before modes meet', error)
         if (allocated(error)) return
         call check_response(of_ratio(low*(1.0_wp + beside)), tolerance, 'just behind', error)
         if (allocated(error)) return
      end do

   contains

      !> The reference case with another damping ratio of the support.
      pure function of_ratio(ratio) result(equations)
         !> The damping ratio.
         real(wp), intent(in) :: ratio
         !> Equations of motion.
         type(equations_type) :: equations

         type(gearbox) :: box

         box = reference_box()
         box%damping_ratio = ratio
         equations = new_equations(reference_gears(), box, reference_load(), flexible_point(1500.0_wp, stiffness))
      end function of_ratio

   end subroutine test_meeting_modes

   !> Gear axes in the centre of mass: the mesh drives the line of action alone, four pairs of modes.
   subroutine test_undriven(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> u1, u2, uM on the line of action, and p.
      integer, parameter :: driven = 4
      type(equations_type) :: equations
      type(modal_system) :: modal

      equations = centred()
      call find(equations, modal, error)
      if (allocated(error)) return
      call check(error, modal%modes, driven, 'pairs of modes')
      if (allocated(error)) return
      call check_residual(equations, modal, 'gear axes in the centre', error)
      if (allocated(error)) return
      call check_response(equations, left_out, 'gear axes in the centre', error)
   end subroutine test_undriven

   !> Gears whose axes lie in the centre of mass of the gearbox.
   pure function centred() result(equations)
      !> Equations of motion.
      type(equations_type) :: equations

      type(gearbox) :: box

      box = reference_box()
      box%gear_offset = 0.0_wp
      equations = new_equations(reference_gears(), box, reference_load(), flexible_point(1500.0_wp, 2.5e8_wp))
   end function centred

   !> From the static equilibrium the left out modes stay at rest: the motion is that of all coordinates.
   subroutine test_motion_without(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_motion(centred(), error)
   end subroutine test_motion_without

   !> Gears that are alike have symmetric modes on the line of action and across it, with the same eigenvalues.
   subroutine test_equal_gears(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(gearbox) :: box

      gears = reference_gears()
      gears%mass = gears%mass(1)
      gears%inertia = gears%inertia(1)
      gears%base_radius = gears%base_radius(1)
      call compare_motion(new_equations(gears, reference_box(), reference_load(), flexible_point(1500.0_wp, 2.5e8_wp)), error)
      if (allocated(error)) return
      box = reference_box()
      box%gear_offset = 0.0_wp
      call compare_motion(new_equations(gears, box, reference_load(), flexible_point(1500.0_wp, 2.5e8_wp)), error)
   end subroutine test_equal_gears

   !> Some periods from the static equilibrium in the modes and by Runge-Kutta in all coordinates.
   subroutine compare_motion(equations, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: periods = 5, coarse = 64, fine = 2048
      !> Runge-Kutta of order four with 2048 steps a period.
      real(wp), parameter :: tolerance = 1.0e-7_wp
      type(collocation_map) :: map
      type(runge_kutta_type) :: method
      type(library_error), allocatable :: fault
      real(wp), allocatable :: position(:), velocity(:), state(:), exact(:)
      integer :: k

      call map%load(equations, coarse, fault)
      if (allocated(fault)) then
         call test_failed(error, fault%message)
         return
      end if
      allocate (exact(2*equations%n), source=0.0_wp)
      method = new_runge_kutta(equations, fine)
      state = map%to_state(exact(:equations%n), exact(:equations%n))
      do k = 1, periods
         call map%advance(state)
         call method%advance(exact)
      end do
      call map%from_state(state, position, velocity)
      call check(error, maxval(abs(position - exact(:equations%n))), 0.0_wp, tolerance*maxval(abs(exact(:equations%n))), &
                 'position')
      if (allocated(error)) return
      call check(error, maxval(abs(velocity - exact(equations%n + 1:))), 0.0_wp, &
                 tolerance*maxval(abs(exact(equations%n + 1:))), 'velocity')
   end subroutine compare_motion

end module test_modal
