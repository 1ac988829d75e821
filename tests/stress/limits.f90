!> Limits of the model in which the answer is known without integrating: energy, linear response, mirror images, the rigid
!> support, deflections that do not depend on the backlash.
module stress_limits
   use answers, only: asked, check_sound, find_answer, may_not_settle, must_settle
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use period_maps, only: method_names, methods
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_options, only: integrator_collocation, solver_options
   use spurflex_measure_response, only: contact_both_flanks, response, status_settled
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_limits

contains

   !> The tests of this suite.
   subroutine collect_limits(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('energy over 1e5 periods', test_energy), &
                  new_unittest('no excitation, no motion', test_nothing), &
                  new_unittest('no backlash, constant stiffness: linear response', test_linear), &
                  new_unittest('no torque: the gears float in the gap', test_floating), &
                  new_unittest('backlash of a millimetre', test_wide_backlash), &
                  new_unittest('reversed torque mirrors the motion', test_mirror), &
                  new_unittest('stiff supports approach the rigid one', test_rigid), &
                  new_unittest('8 to 8192 steps a period', test_steps) &
                  ]
   end subroutine collect_limits

   !> Average acceleration keeps the energy of the undamped, unexcited system; only round-off adds up.
   subroutine test_energy(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: drift = 1.0e-10_wp
      integer, parameter :: steps = 32, periods = 100000
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(equations_type) :: equations
      type(operating_point) :: points(2)
      type(newmark_map) :: map
      type(library_error), allocatable :: fault
      real(wp), allocatable :: state(:)
      real(wp) :: first, furthest
      integer :: k, i, support

      gears = reference_gears()
      gears%bearing_damping = 0.0_wp
      gears%mesh%damping = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      gears%mesh%error_amplitudes = 0.0_wp
      box = reference_box()
      box%damping_ratio = 0.0_wp
      points = [rigid_point(2000.0_wp), flexible_point(2000.0_wp, 2.5e8_wp)]
      do support = 1, size(points)
         equations = new_equations(gears, box, reference_load(), points(support))
         call map%load(equations, steps, fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
         ! A tenth of a micrometre keeps the teeth in contact.
         state = [(1.0e-7_wp*cos(real(i, wp)), i=1, equations%n), (0.0_wp, i=1, equations%n)]
         first = energy(state)
         furthest = 0.0_wp
         do k = 1, periods
            call map%advance(state)
            if (mod(k, 100) == 0) furthest = max(furthest, abs(energy(state) - first))
         end do
         call check(error, map%smallest_deflection >= map%half_backlash, 'contact is kept')
         if (allocated(error)) return
         call check(error, furthest, 0.0_wp, drift*first, 'drift on support '//to_text(support))
         if (allocated(error)) return
      end do

   contains

      !> Kinetic and potential energy about the static equilibrium.
      function energy(of) result(total)
         !> State.
         real(wp), intent(in) :: of(:)
         !> The energy.
         real(wp) :: total

         associate (q => of(:equations%n), v => of(equations%n + 1:))
            total = 0.5_wp*(dot_product(v, matmul(equations%mass, v)) + sum(equations%stiffness*q**2) &
                            + equations%mesh%mean_stiffness*dot_product(equations%direction, q)**2)
         end associate
      end function energy

   end subroutine test_energy

   !> Without transmission error and with a constant stiffness the static equilibrium stays: zero, settled, by both methods.
   subroutine test_nothing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Far below a micrometre.
      real(wp), parameter :: nothing = 1.0e-18_wp
      type(gear_pair) :: gears
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)
      integer :: k

      gears = reference_gears()
      gears%mesh%error_amplitudes = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      do k = 1, size(methods)
         call find_answer(new_equations(gears, reference_box(), reference_load(), flexible_point(1500.0_wp, 2.5e8_wp)), &
                          solver_options(integrator=methods(k), tolerance=asked), answer, position, velocity, error)
         if (allocated(error)) return
         call check_sound(answer, must_settle, method_names(k), error)
         if (allocated(error)) return
         call check(error, answer%y1_amplitude, 0.0_wp, nothing, 'amplitude with '//method_names(k))
         if (allocated(error)) return
      end do
   end subroutine test_nothing

   !> Amplitude of y1 where the mesh is linear: (K - w^2 M + i w (C + c_m g g^T) + k g g^T) q = -g (k + i w c_m) e.
   function linear_amplitude(equations, stiffness) result(amplitude)
      !> Equations of motion; one harmonic of the transmission error.
      type(equations_type), intent(in) :: equations
      !> Stiffness of the mesh [N/m].
      real(wp), intent(in) :: stiffness
      !> The amplitude [m].
      real(wp) :: amplitude

      complex(wp) :: matrix(equations%n, equations%n), q(equations%n), mesh
      integer :: i

      mesh = cmplx(stiffness, equations%frequency*equations%mesh%damping, wp)
      do i = 1, equations%n
         matrix(:, i) = mesh*equations%direction*equations%direction(i) - equations%frequency**2*equations%mass(:, i)
         matrix(i, i) = matrix(i, i) + cmplx(equations%stiffness(i), equations%frequency*equations%damping(i), wp)
      end do
      q = solve(matrix, -equations%direction*mesh*equations%mesh%error_amplitudes(1))
      amplitude = abs(sum(equations%observation(1, :)*q))
   end function linear_amplitude

   !> Backlash zero: the frequency response, from every decade of support stiffness, whichever flank carries.
   subroutine test_linear(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [480.0_wp, 1500.0_wp, 4000.0_wp]
      type(gear_pair) :: gears
      type(equations_type) :: equations
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: expected
      integer :: decade, i, k

      gears = reference_gears()
      gears%mesh%half_backlash = 0.0_wp
      gears%mesh%stiffness_coefficients = 0.0_wp
      do decade = 3, 12
         do i = 1, size(speed)
            equations = new_equations(gears, reference_box(), reference_load(), flexible_point(speed(i), 10.0_wp**decade))
            expected = linear_amplitude(equations, gears%mesh%mean_stiffness)
            do k = 1, size(methods)
               call find_answer(equations, solver_options(integrator=methods(k), tolerance=asked), answer, position, velocity, &
                                error)
               if (allocated(error)) return
               call check_sound(answer, must_settle, 'k_M = 1e'//to_text(decade), error)
               if (allocated(error)) return
               call check(error, answer%y1_amplitude, expected, 1.1_wp*asked*expected, &
                          'k_M = 1e'//to_text(decade)//' at '//to_text(speed(i))//' with '//method_names(k))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_linear

   !> Without torque the teeth meet only through the damping, if the transmission error is smaller than the gap. The mean of p
   !> is free, so that one multiplier is 1 and the status may say that nothing settles. What is called settled has the amplitude
   !> of the damped response, to the error that is asked for or at least owned up to.
   subroutine test_floating(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(2) = [500.0_wp, 2600.0_wp]
      type(equations_type) :: equations
      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i, k

      do i = 1, size(speed)
         equations = new_equations(reference_gears(), reference_box(), load_type(0.0_wp, 0.0_wp), &
                                   flexible_point(speed(i), 2.5e8_wp))
         do k = 1, size(methods)
            call find_answer(equations, solver_options(integrator=methods(k), tolerance=asked), answer, position, velocity, error)
            if (allocated(error)) return
            call check_sound(answer, may_not_settle, 'no torque', error)
            if (allocated(error)) return
            if (answer%status /= status_settled) cycle
            call check(error, answer%y1_amplitude, linear_amplitude(equations, 0.0_wp), &
                       1.1_wp*max(asked, answer%error_estimate), 'no torque, '//method_names(k), relative=.true.)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_floating

   !> A wider gap moves the front flank and nothing else, unless the back flank is struck.
   subroutine test_wide_backlash(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [480.0_wp, 1500.0_wp, 2600.0_wp]
      type(gear_pair) :: gears, wide
      type(response) :: answer, wider
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i, k

      gears = reference_gears()
      wide = gears
      wide%mesh%half_backlash = 1.0e-3_wp
      do i = 1, size(speed)
         do k = 1, size(methods)
            call find_answer(new_equations(gears, reference_box(), reference_load(), flexible_point(speed(i), 2.5e8_wp)), &
                             solver_options(integrator=methods(k), tolerance=asked), answer, position, velocity, error)
            if (allocated(error)) return
            call find_answer(new_equations(wide, reference_box(), reference_load(), flexible_point(speed(i), 2.5e8_wp)), &
                             solver_options(integrator=methods(k), tolerance=asked), wider, position, velocity, error)
            if (allocated(error)) return
            call check_sound(wider, must_settle, 'a millimetre', error)
            if (allocated(error)) return
            call check(error, wider%y1_amplitude, answer%y1_amplitude, 2.0_wp*asked, &
                       to_text(speed(i))//' rev/min, '//method_names(k), relative=.true.)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_wide_backlash

   !> Torque and transmission error of the other sign: y1 changes sign, contact kept, lost, and with both flanks.
   subroutine test_mirror(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: torque(4) = [110.0_wp, 110.0_wp, 11.0_wp, 1.0_wp]
      real(wp), parameter :: speed(4) = [1500.0_wp, 2600.0_wp, 3000.0_wp, 2600.0_wp]
      !> Crossings round differently.
      real(wp), parameter :: tolerance = 1.0e-7_wp
      type(gear_pair) :: gears, mirrored
      type(response) :: front, back
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i, k, rattling

      gears = reference_gears()
      mirrored = gears
      mirrored%mesh%error_amplitudes = -gears%mesh%error_amplitudes
      rattling = 0
      do i = 1, size(torque)
         do k = 1, size(methods)
            associate (options => solver_options(integrator=methods(k), tolerance=asked), &
                       point => flexible_point(speed(i), 2.5e8_wp), box => reference_box())
               call find_answer(new_equations(gears, box, load_type(torque(i), 1.3637770_wp*torque(i)), point), options, front, &
                                position, velocity, error)
               if (allocated(error)) return
               call find_answer(new_equations(mirrored, box, load_type(-torque(i), -1.3637770_wp*torque(i)), point), options, &
                                back, position, velocity, error)
               if (allocated(error)) return
            end associate
            call check_sound(front, may_not_settle, 'front flank', error)
            if (allocated(error)) return
            call check(error, back%status, front%status, 'status')
            if (allocated(error)) return
            if (front%status /= status_settled) cycle
            if (front%contact == contact_both_flanks) rattling = rattling + 1
            call check(error, back%motion, front%motion, 'class')
            if (allocated(error)) return
            call check(error, back%y1_amplitude, front%y1_amplitude, tolerance, 'amplitude', relative=.true.)
            if (allocated(error)) return
            call check(error, back%y1_max, -front%y1_min, tolerance*abs(front%y1_min), 'largest y1')
            if (allocated(error)) return
         end do
      end do
      call check(error, rattling > 0, 'some of the motions strike both flanks')
   end subroutine test_mirror

   !> The distance to the rigid support falls in proportion to 1/k_M.
   subroutine test_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(2) = [1500.0_wp, 2600.0_wp], stiffness(3) = [1.0e12_wp, 1.0e13_wp, 1.0e14_wp]
      !> At 1e12 N/m; then a tenth for ten times the stiffness.
      real(wp), parameter :: furthest = 5.0e-3_wp, share(2) = [0.07_wp, 0.14_wp], accurate = 1.0e-7_wp
      type(response) :: rigid, flexible
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: distance(3)
      type(solver_options) :: options
      integer :: i, k

      options = solver_options(integrator=integrator_collocation, tolerance=accurate)
      do i = 1, size(speed)
         call find_answer(new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speed(i))), options, &
                          rigid, position, velocity, error)
         if (allocated(error)) return
         do k = 1, size(stiffness)
            call find_answer(new_equations(reference_gears(), reference_box(), reference_load(), &
                                           flexible_point(speed(i), stiffness(k))), options, flexible, position, velocity, error)
            if (allocated(error)) return
            call check_sound(flexible, must_settle, 'stiff support', error)
            if (allocated(error)) return
            distance(k) = abs(flexible%y1_amplitude - rigid%y1_amplitude)/rigid%y1_amplitude
         end do
         call check(error, distance(1), 0.0_wp, furthest, 'distance at 1e12 N/m')
         if (allocated(error)) return
         call check(error, all(distance(2:) > share(1)*distance(:2)) .and. all(distance(2:) < share(2)*distance(:2)), &
                    'distances fall like 1/k_M')
         if (allocated(error)) return
      end do
   end subroutine test_rigid

   !> Steps that are given: what is called settled has the accuracy asked for, and enough steps settle.
   subroutine test_steps(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [480.0_wp, 1500.0_wp, 2600.0_wp], accurate = 1.0e-8_wp, tolerance = 1.0e-3_wp
      !> From here on both methods are good enough at these speeds.
      integer, parameter :: enough(2) = [1024, 32], most = 13
      type(equations_type) :: equations
      type(response) :: answer, exact
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i, k, power, steps

      do i = 1, size(speed)
         equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(speed(i), 2.5e8_wp))
         call find_answer(equations, solver_options(integrator=integrator_collocation, tolerance=accurate), exact, position, &
                          velocity, error)
         if (allocated(error)) return
         do k = 1, size(methods)
            do power = 3, most
               steps = 2**power
               call find_answer(equations, solver_options(integrator=methods(k), steps_per_period=steps, tolerance=tolerance), &
                                answer, position, velocity, error)
               if (allocated(error)) return
               call check_sound(answer, steps >= enough(k), to_text(steps)//' steps of '//method_names(k), error)
               if (allocated(error)) return
               if (answer%status /= status_settled) cycle
               call check(error, answer%y1_amplitude, exact%y1_amplitude, 1.1_wp*tolerance, &
                          to_text(steps)//' steps of '//trim(method_names(k))//' at '//to_text(speed(i)), relative=.true.)
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_steps

end module stress_limits
