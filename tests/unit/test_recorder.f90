!> Spectra, sections and histories of steady motions: against closed forms, balances of forces and the maps themselves.
module test_recorder
   use cases, only: balanced_load, flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use dense_solve, only: solve
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_newmark, only: newmark_map
   use spurflex_integrate_options, only: integrator_collocation, integrator_newmark, solver_options
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_integrate_steps, only: first_steps
   use spurflex_measure_points, only: new_solver, respond_one, solver_type
   use spurflex_measure_record, only: bearing_observables, last_coordinate, mesh_deflection_observable, &
      mesh_force_observable, observable_of, observables, record_request, record_type, samples_of
   use spurflex_measure_recorder, only: new_recorder, recorder_type, release_recorder
   use spurflex_measure_response, only: contact_kept, contact_lost, empty_response, motion_chaotic, motion_quasi_periodic, &
      motion_unresolved, response, status_diverged, status_missing, status_settled
   use spurflex_model_equations, only: equations_type, mean_mesh_force, new_equations
   use spurflex_model_paper, only: damping_matrix, mass_matrix, mesh_direction, stiffness_matrix
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, operating_point, support_flexible
   use spurflex_steady_outcome, only: motion_of_periods, periods_of_motion
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_recorder

   integer, parameter :: y1 = 2, theta1 = 3, theta2 = 6

contains

   !> The tests of this suite.
   subroutine collect_recorder(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('names and positions of the quantities', test_names), &
                  new_unittest('periods of the classes of motion', test_periods), &
                  new_unittest('linear response in closed form, rigid', test_linear_rigid), &
                  new_unittest('linear response in closed form, flexible', test_linear_flexible), &
                  new_unittest('extremes of y1 and of the bearings are those of the response', test_extremes), &
                  new_unittest('rates are derivatives', test_rates), &
                  new_unittest('sections are the history at whole mesh times', test_sections), &
                  new_unittest('the mesh force carries the torque', test_balance), &
                  new_unittest('motions of two and three mesh periods', test_subharmonics), &
                  new_unittest('a period that does not fit the window', test_misfit), &
                  new_unittest('aliasing of a smooth motion', test_aliasing), &
                  new_unittest('a motion that is not periodic', test_irregular), &
                  new_unittest('given steps are those of the deck''s integrator', test_newmark), &
                  new_unittest('a section that is only near is closed', test_closing), &
                  new_unittest('what cannot be recorded is not a number', test_missing), &
                  new_unittest('only what is asked for', test_products), &
                  new_unittest('no bit depends on the points before', test_neighbours) &
                  ]
   end subroutine collect_recorder

   !> Every product of every quantity.
   pure function whole_request() result(request)
      !> The request.
      type(record_request) :: request

      integer :: i

      request%spectrum = .true.
      request%section = .true.
      request%history = .true.
      request%quantities = [(i, i=1, size(observables))]
   end function whole_request

   !> The reference case at a point.
   pure function reference_at(point) result(equations)
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Equations of motion.
      type(equations_type) :: equations

      equations = new_equations(reference_gears(), reference_box(), reference_load(), point)
   end function reference_at

   !> Free steps of collocation.
   pure function free_options() result(options)
      !> The options.
      type(solver_options) :: options

      options = solver_options(integrator=integrator_collocation, tolerance=1.0e-6_wp, measured_periods=100)
   end function free_options

   !> Find a motion from the static equilibrium and record it.
   subroutine record_point(options, request, equations, answer, record, is_motion)
      !> Options.
      type(solver_options), intent(in) :: options
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The response.
      type(response), intent(out) :: answer
      !> The record.
      type(record_type), intent(out) :: record
      !> Class to record it as, if not that of the response.
      integer, intent(in), optional :: is_motion

      type(solver_type) :: solver
      type(recorder_type) :: recorder
      type(library_error), allocatable :: fault
      type(no_attendant) :: nobody
      real(wp) :: position(equations%n), velocity(equations%n)

      position = 0.0_wp
      velocity = 0.0_wp
      call new_solver(options, solver)
      call respond_one(solver, equations, position, velocity, nobody, answer)
      if (present(is_motion)) answer%motion = is_motion
      call new_recorder(options, request, recorder)
      call recorder%record(equations, position, velocity, answer, record, fault, nobody)
      if (allocated(fault)) error stop 'a motion cannot be recorded'
      call release_recorder(recorder)
   end subroutine record_point

   !> The list of the quantities and what is said about it.
   subroutine test_names(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=6), parameter :: names(9) = [character(len=6) :: 'x1', 'y1', 'theta1', 'x2', 'y2', 'theta2', 'xm', 'ym', &
                                                 'thetam']
      integer :: i

      do i = 1, size(names)
         call check(error, observable_of(trim(names(i))), i, 'coordinate')
         if (allocated(error)) return
         call check(error, observables(i)%flexible_only .eqv. i > 6, 'on a flexible support only')
         if (allocated(error)) return
      end do
      call check(error, last_coordinate, size(names), 'coordinates')
      if (allocated(error)) return
      call check(error, observable_of('mesh_deflection'), mesh_deflection_observable, 'mesh deflection')
      if (allocated(error)) return
      call check(error, observable_of('mesh_force'), mesh_force_observable, 'mesh force')
      if (allocated(error)) return
      call check(error, observable_of('bearing1_deformation'), bearing_observables(1), 'driving bearing')
      if (allocated(error)) return
      call check(error, observable_of('bearing2_deformation'), bearing_observables(2), 'driven bearing')
      if (allocated(error)) return
      call check(error, observable_of('z1'), 0, 'no such quantity')
   end subroutine test_names

   !> Periods from classes are those that the classes were made of.
   subroutine test_periods(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer :: n

      do n = 1, 300
         call check(error, periods_of_motion(motion_of_periods(n)), n, 'periodic')
         if (allocated(error)) return
      end do
      call check(error, all(periods_of_motion([motion_unresolved, motion_quasi_periodic, motion_chaotic]) == 0), 'not periodic')
   end subroutine test_periods

   !> Three coordinates that are integrated, six that are recorded.
   subroutine test_linear_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_linear(rigid_point(1500.0_wp), error)
      if (allocated(error)) return
      call compare_linear(rigid_point(3900.0_wp), error)
   end subroutine test_linear_rigid

   !> All nine, on soft and stiff supports.
   subroutine test_linear_flexible(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call compare_linear(flexible_point(480.0_wp, 2.5e8_wp), error)
      if (allocated(error)) return
      call compare_linear(flexible_point(1500.0_wp, 1.0e4_wp), error)
      if (allocated(error)) return
      call compare_linear(flexible_point(3900.0_wp, 1.0e11_wp), error)
   end subroutine test_linear_flexible

   !> Constant mesh stiffness, no backlash, two harmonics of the transmission error: the response in the paper's own matrices.
   subroutine compare_linear(point, error)
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Of the collocation at its points and between them, beside the largest vibration of each quantity.
      real(wp), parameter :: tolerance = 2.0e-6_wp
      !> Round-off of metres, for the static offsets.
      real(wp), parameter :: roundoff = 1.0e-14_wp
      complex(wp), parameter :: im = (0.0_wp, 1.0_wp)
      type(gear_pair) :: gears
      type(gearbox) :: box
      type(load_type) :: load
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      real(wp), allocatable :: mass(:, :), damping(:, :), stiffness(:, :), g(:), mean(:), size_of(:)
      complex(wp), allocatable :: dynamic(:, :), line(:, :)
      complex(wp) :: excitation(2), oscillation
      real(wp) :: frequency, phase, value, rate, difference(2), modulus
      integer :: n, i, q, h, s

      gears = reference_gears()
      gears%mesh%half_backlash = 0.0_wp
      gears%mesh%stiffness_coefficients = [0.0_wp]
      gears%mesh%error_amplitudes = [1.0e-5_wp, 3.0e-6_wp]
      gears%mesh%error_phases = [0.4_wp, -1.3_wp]
      box = reference_box()
      load = balanced_load(gears, 110.0_wp)
      equations = new_equations(gears, box, load, point)
      request = whole_request()
      request%sections = 5
      request%history_periods = 2
      request%history_samples = 48
      call record_point(free_options(), request, equations, answer, record)
      call check(error, answer%motion, 1, 'the motion')
      if (allocated(error)) return

      mass = mass_matrix(gears, box, point)
      damping = damping_matrix(gears, box, point)
      stiffness = stiffness_matrix(gears, box, point)
      g = mesh_direction(gears, point)
      n = size(g)
      frequency = equations%frequency
      ! Complex amplitudes, harmonics in columns: the coordinates, the mesh deflection, the mesh force.
      allocate (line(n + 2, 2), dynamic(n, n), size_of(n + 2), mean(n + 2))
      do h = 1, 2
         excitation(h) = gears%mesh%error_amplitudes(h)*exp(im*gears%mesh%error_phases(h))
         associate (w => real(h, wp)*frequency, k => gears%mesh%mean_stiffness, c => gears%mesh%damping)
            do i = 1, n
               dynamic(:, i) = stiffness(:, i) + im*w*damping(:, i) - w**2*mass(:, i) + (k + im*w*c)*g*g(i)
            end do
            line(:n, h) = solve(dynamic, -g*(k + im*w*c)*excitation(h))
            line(n + 1, h) = sum(g*line(:n, h)) + excitation(h)
            line(n + 2, h) = (k + im*w*c)*line(n + 1, h)
         end associate
      end do
      size_of = abs(line(:, 1)) + abs(line(:, 2))
      mean = static_coordinates(gears, load, stiffness, g)

      do q = 1, n + 2
         i = q
         if (q > n) i = mesh_deflection_observable + q - n - 1
         ! Values and rates.
         difference = 0.0_wp
         do s = 0, 2*48
            phase = 2.0_wp*pi*real(s, wp)/48.0_wp
            value = mean(q)
            rate = 0.0_wp
            do h = 1, 2
               oscillation = line(q, h)*exp(im*real(h, wp)*phase)
               value = value + aimag(oscillation)
               rate = rate + aimag(im*real(h, wp)*frequency*oscillation)
            end do
            difference = max(difference, abs(record%history(s + 1, :, i) - [value, rate]))
         end do
         call check(error, difference(1), 0.0_wp, tolerance*size_of(q) + roundoff*maxval(abs(mean(:n))), &
                    'value of '//observables(i)%name)
         if (allocated(error)) return
         ! The rate of a force is that of two derivatives more.
         call check(error, difference(2), 0.0_wp, 10.0_wp*tolerance*size_of(q)*2.0_wp*frequency, 'rate of '//observables(i)%name)
         if (allocated(error)) return
         ! Lines.
         call check(error, record%spectrum(1, i), mean(q), tolerance*size_of(q) + roundoff*maxval(abs(mean(:n))), &
                    'mean of '//observables(i)%name)
         if (allocated(error)) return
         do h = 1, 4
            modulus = 0.0_wp
            if (h <= 2) modulus = abs(line(q, h))
            call check(error, record%spectrum(1 + 840*h, i), modulus, tolerance*size_of(q), 'line of '//observables(i)%name)
            if (allocated(error)) return
         end do
         record%spectrum([1, 841, 1681, 2521, 3361], i) = 0.0_wp
         call check(error, .not. any(abs(record%spectrum(:, i)) > 0.0_wp), 'nothing between the lines')
         if (allocated(error)) return
         ! The section is phase 0.
         call check(error, maxval(abs(record%section(:, 1, i) - record%history(1, 1, i))), 0.0_wp, 0.0_wp, 'section')
         if (allocated(error)) return
      end do
      ! Bearing deformations are those of the coordinates, Eqs. (16) and (17).
      do s = 1, size(record%history, 1)
         associate (z => record%history(s, 1, :))
            if (point%support == support_flexible) then
               value = norm2([z(1) - z(7), z(2) - z(8) + box%gear_offset*z(9)])
               rate = norm2([z(4) - z(7), z(5) - z(8) - box%gear_offset*z(9)])
            else
               value = norm2(z([1, 2]))
               rate = norm2(z([4, 5]))
            end if
         end associate
         call check(error, maxval(abs(record%history(s, 1, bearing_observables) - [value, rate])), 0.0_wp, &
                    1.0e-14_wp*maxval(abs(mean(:n))), 'bearing deformations')
         if (allocated(error)) return
      end do
   end subroutine compare_linear

   !> The static equilibrium in the paper's coordinates, the mesh deflection and the mesh force.
   function static_coordinates(gears, load, stiffness, g) result(mean)
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Torques.
      type(load_type), intent(in) :: load
      !> Stiffness matrix without the mesh, shape (n, n).
      real(wp), intent(in) :: stiffness(:, :)
      !> Gradient of the mesh deflection, shape (n).
      real(wp), intent(in) :: g(:)
      !> Means, shape (n + 2).
      real(wp) :: mean(size(g) + 2)

      real(wp) :: matrix(size(g), size(g)), right(size(g)), force
      integer :: n

      n = size(g)
      force = mean_mesh_force(gears, load)
      matrix = stiffness
      right = -g*force
      ! The rows of the rotations: the deflection under the force, and no common rotation.
      matrix(theta1, :) = g
      right(theta1) = force/gears%mesh%mean_stiffness
      matrix(theta2, :) = 0.0_wp
      matrix(theta2, [theta1, theta2]) = gears%inertia*gears%base_radius([2, 1])
      right(theta2) = 0.0_wp
      mean = [solve(matrix, right), force/gears%mesh%mean_stiffness, force]
   end function static_coordinates

   !> Points whose teeth stay in contact and part, on both supports.
   subroutine test_extremes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> A sample misses an extreme by half a step at most: the square of the phase of the 30th order, which is far below the first.
      real(wp), parameter :: tolerance = 1.0e-5_wp
      integer, parameter :: samples = 4096
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations(4)
      real(wp) :: amplitude
      integer :: i, gear

      equations = [reference_at(rigid_point(1500.0_wp)), &
                   reference_at(rigid_point(2600.0_wp)), &
                   reference_at(flexible_point(480.0_wp, 2.5e8_wp)), &
                   reference_at(flexible_point(3500.0_wp, 2.5e8_wp))]
      request = whole_request()
      request%spectrum = .false.
      request%history_periods = 1
      request%history_samples = samples
      do i = 1, size(equations)
         call record_point(free_options(), request, equations(i), answer, record)
         call check(error, (answer%contact /= contact_kept) .eqv. mod(i, 2) == 0, 'the contact')
         if (allocated(error)) return
         amplitude = 0.5_wp*(maxval(record%history(:, 1, y1)) - minval(record%history(:, 1, y1)))
         call check(error, amplitude, answer%y1_amplitude, tolerance, 'amplitude', relative=.true.)
         if (allocated(error)) return
         call check(error, maxval(record%history(:, 1, y1)), answer%y1_max, tolerance*amplitude, 'largest')
         if (allocated(error)) return
         call check(error, minval(record%history(:, 1, y1)), answer%y1_min, tolerance*amplitude, 'smallest')
         if (allocated(error)) return
         do gear = 1, 2
            call check(error, maxval(record%history(:, 1, bearing_observables(gear))), answer%bearing_deformation_max(gear), &
                       tolerance, 'bearing deformation', relative=.true.)
            if (allocated(error)) return
         end do
         ! Teeth lose contact where the deflection lies in the gap, and nowhere else.
         call check(error, (minval(record%history(:, 1, mesh_deflection_observable)) < 1.0e-5_wp) .eqv. mod(i, 2) == 0, 'the gap')
         if (allocated(error)) return
      end do
   end subroutine test_extremes

   !> Differences of the values over five samples, of a smooth motion.
   subroutine test_rates(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Of the differences, fourth order in the step, and of the rates themselves, beside the largest rate.
      real(wp), parameter :: tolerance = 1.0e-5_wp
      integer, parameter :: samples = 1024
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      real(wp), allocatable :: slope(:)
      real(wp) :: step
      integer :: i, q, n

      request = whole_request()
      request%spectrum = .false.
      request%history_periods = 2
      request%history_samples = samples
      n = 2*samples + 1
      do i = 1, 2
         if (i == 1) equations = reference_at(flexible_point(700.0_wp, 2.5e8_wp))
         if (i == 2) equations = reference_at(rigid_point(700.0_wp))
         call record_point(free_options(), request, equations, answer, record)
         call check(error, answer%contact, contact_kept, 'a smooth motion')
         if (allocated(error)) return
         step = 2.0_wp*pi/equations%frequency/real(samples, wp)
         do q = 1, size(observables)
            if (i == 2 .and. observables(q)%flexible_only) cycle
            associate (value => record%history(:, 1, q), rate => record%history(:, 2, q))
               slope = (8.0_wp*(value(4:n - 1) - value(2:n - 3)) - value(5:n) + value(1:n - 4))/(12.0_wp*step)
               call check(error, maxval(abs(slope - rate(3:n - 2))), 0.0_wp, tolerance*maxval(abs(rate)), observables(q)%name)
            end associate
            if (allocated(error)) return
         end do
      end do
   end subroutine test_rates

   !> To the bit, for periodic and other motions; sections go on where the history has ended.
   subroutine test_sections(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [2600.0_wp, 5500.0_wp, 4900.0_wp]
      integer, parameter :: expected(3) = [1, 2, motion_quasi_periodic]
      real(wp), parameter :: roundoff = 1.0e-12_wp
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      integer :: i

      request = whole_request()
      request%spectrum = .false.
      request%sections = 12
      request%history_periods = 7
      request%history_samples = 10
      do i = 1, size(speed)
         equations = reference_at(rigid_point(speed(i)))
         call record_point(free_options(), request, equations, answer, record)
         call check(error, answer%motion, expected(i), 'the motion')
         if (allocated(error)) return
         associate (quantities => [1, 2, 3, 4, 5, 6, 10, 11, 12, 13])
            call check(error, .not. any(abs(record%section(:7, :, quantities) - record%history(:61:10, :, quantities)) > 0.0_wp), &
                       'the same bits')
            if (allocated(error)) return
            ! The end of a period and the beginning of the next one are two ways to the same.
            call check(error, all(abs(record%section(8, :, quantities) - record%history(71, :, quantities)) &
                                  <= roundoff*maxval(abs(record%history(:, :, quantities)), 1)), 'the end')
         end associate
         if (allocated(error)) return
         call check(error, (maxval(record%section(:, 1, y1)) - minval(record%section(:, 1, y1)) > 1.0e-8_wp) .eqv. i > 1, &
                    'sections that differ')
         if (allocated(error)) return
      end do
   end subroutine test_sections

   !> Both gears obey J1 th1'' = T_d - r1 f_m and J2 th2'' = r2 f_m - T_l, integrated from sample to sample, and the mean mesh force
   !> holds the driving torque; teeth that part included.
   subroutine test_balance(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> What the collocation leaves open between its points, and the integral where the teeth part or meet, beside the largest
      !> impulse from sample to sample.
      real(wp), parameter :: kept_tolerance = 5.0e-5_wp, lost_tolerance = 1.0e-3_wp
      !> What is left of it over two periods, beside the largest spin; of the mean of 256 samples of a force whose rate jumps,
      !> relative.
      real(wp), parameter :: tolerance = 1.0e-6_wp, mean_tolerance = 5.0e-6_wp
      real(wp), parameter :: torque = 110.0_wp
      integer, parameter :: samples = 2048
      type(gear_pair) :: gears
      type(load_type) :: load
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      real(wp), allocatable :: impulse(:), torques(:), torque_rates(:)
      real(wp) :: step
      integer :: i, gear, n

      gears = reference_gears()
      load = balanced_load(gears, torque)
      request = whole_request()
      request%history_periods = 2
      request%history_samples = samples
      n = 2*samples + 1
      do i = 1, 3
         if (i == 1) equations = new_equations(gears, reference_box(), load, flexible_point(1500.0_wp, 2.5e8_wp))
         if (i == 2) equations = new_equations(gears, reference_box(), load, flexible_point(2600.0_wp, 2.5e8_wp))
         if (i == 3) equations = new_equations(gears, reference_box(), load, rigid_point(5500.0_wp))
         call record_point(free_options(), request, equations, answer, record)
         call check(error, (answer%contact == contact_kept) .eqv. i == 1, 'the contact')
         if (allocated(error)) return
         call check(error, record%spectrum(1, mesh_force_observable)*gears%base_radius(1), torque, mean_tolerance, 'mean force', &
                    relative=.true.)
         if (allocated(error)) return
         step = 2.0_wp*pi/equations%frequency/real(samples, wp)
         do gear = 1, 2
            associate (force => record%history(:, 1, mesh_force_observable), rate => record%history(:, 2, mesh_force_observable), &
                       spin => record%history(:, 2, merge(theta1, theta2, gear == 1)), &
                       arm => merge(-1.0_wp, 1.0_wp, gear == 1)*gears%base_radius(gear))
               torques = merge(load%driving_torque, -load%load_torque, gear == 1) + arm*force
               torque_rates = arm*rate
               impulse = 0.5_wp*step*(torques(2:) + torques(:n - 1)) + step**2/12.0_wp*(torque_rates(:n - 1) - torque_rates(2:))
               call check(error, maxval(abs(gears%inertia(gear)*(spin(2:) - spin(:n - 1)) - impulse)), 0.0_wp, &
                          merge(kept_tolerance, lost_tolerance, i == 1)*maxval(abs(impulse)), 'from sample to sample '//to_text(i))
               if (allocated(error)) return
               call check(error, abs(sum(impulse) - gears%inertia(gear)*(spin(n) - spin(1))), 0.0_wp, &
                          tolerance*gears%inertia(gear)*maxval(abs(spin)), 'over two periods '//to_text(i))
            end associate
            if (allocated(error)) return
         end do
      end do
   end subroutine test_balance

   !> They repeat after so many mesh periods and not before, and have lines at halves and thirds only.
   subroutine test_subharmonics(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: samples = 32
      real(wp), parameter :: speed(2) = [5500.0_wp, 5100.0_wp]
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      real(wp) :: variance, scale
      integer :: i, n, k

      request = whole_request()
      request%quantities = [y1, mesh_deflection_observable]
      request%sections = 50
      request%history_periods = 12
      request%history_samples = samples
      request%highest_order = 30.0_wp
      do i = 1, 2
         n = i + 1
         equations = reference_at(rigid_point(speed(i)))
         call record_point(free_options(), request, equations, answer, record)
         call check(error, answer%motion, n, 'the motion')
         if (allocated(error)) return
         associate (value => record%history(:, 1, 1), last => size(record%history, 1))
            scale = answer%y1_amplitude
            call check(error, maxval(abs(value(1 + n*samples:) - value(:last - n*samples))), 0.0_wp, 1.0e-8_wp*scale, 'repeats')
            if (allocated(error)) return
            call check(error, maxval(abs(value(1 + samples:) - value(:last - samples))) > 1.0e-2_wp*scale, 'not before')
            if (allocated(error)) return
            call check(error, maxval(abs(record%section(1 + n:, :, :) - record%section(:50 - n, :, :))), 0.0_wp, 0.0_wp, 'sections')
            if (allocated(error)) return
            ! Mean square of the history against the lines.
            variance = sum((value(:last - 1) - record%spectrum(1, 1))**2)/real(last - 1, wp)
            call check(error, 0.5_wp*sum(record%spectrum(2:, 1)**2), variance, 1.0e-5_wp, 'variance', relative=.true.)
         end associate
         if (allocated(error)) return
         call check(error, 0.5_wp*sum(record%spectrum(2:, 1)**2), answer%y1_rms**2, 1.0e-5_wp, 'rms', relative=.true.)
         if (allocated(error)) return
         call check(error, record%spectrum(1 + 840/n, 1) > 1.0e-3_wp*scale, 'a subharmonic')
         if (allocated(error)) return
         do k = 1, size(record%spectrum, 1) - 1
            if (mod(k, 840/n) > 0) call check(error, abs(record%spectrum(1 + k, 1)), 0.0_wp, 0.0_wp, 'nothing between')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_subharmonics

   !> Three mesh periods and a window of 100: the line at the mesh frequency is the same, one between the places reads less, by
   !> what Hann's window loses a third of a place away.
   subroutine test_misfit(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Neighbouring lines, 33 places away, leak the third power of that.
      real(wp), parameter :: tolerance = 1.0e-4_wp, third = 1.0_wp/3.0_wp
      type(record_request) :: request
      type(record_type) :: record, fitting
      type(response) :: answer
      type(equations_type) :: equations
      real(wp) :: loss
      integer :: k

      request%spectrum = .true.
      request%quantities = [y1]
      equations = reference_at(rigid_point(5100.0_wp))
      call record_point(free_options(), request, equations, answer, fitting)
      request%spectrum_periods = 100
      call record_point(free_options(), request, equations, answer, record)
      call check(error, size(record%spectrum, 1), 401, 'places')
      if (allocated(error)) return
      associate (scale => fitting%spectrum(841, 1))
         call check(error, record%spectrum(1, 1), fitting%spectrum(1, 1), tolerance*scale, 'mean')
         if (allocated(error)) return
         call check(error, record%spectrum(101, 1), scale, tolerance*scale, 'at the mesh frequency')
         if (allocated(error)) return
         loss = sin(pi*third)/(pi*third*(1.0_wp - third**2))
         do k = 1, 2
            call check(error, record%spectrum(1 + nint(100.0_wp*real(k, wp)*third), 1), loss*fitting%spectrum(1 + 280*k, 1), &
                       tolerance*scale, 'between')
            if (allocated(error)) return
         end do
      end associate
   end subroutine test_misfit

   !> With a higher order asked for there are more samples: the lines stay.
   subroutine test_aliasing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Beside the largest line: where teeth stay in contact, and where they part and the displacement has a jump in its third
      !> derivative, the mesh force in its first.
      real(wp), parameter :: smooth = 1.0e-10_wp, kinked = 1.0e-7_wp, kinked_force = 1.0e-5_wp
      type(record_request) :: request
      type(record_type) :: record, finer
      type(response) :: answer
      type(equations_type) :: equations
      real(wp) :: difference
      integer :: i, q

      request%spectrum = .true.
      do i = 1, 3
         if (i == 1) equations = reference_at(flexible_point(1500.0_wp, 2.5e8_wp))
         if (i == 2) equations = reference_at(flexible_point(310.0_wp, 2.5e8_wp))
         if (i == 3) equations = reference_at(flexible_point(2600.0_wp, 2.5e8_wp))
         do q = 1, 2
            request%quantities = [merge(y1, mesh_force_observable, q == 1)]
            request%highest_order = 4.0_wp
            call record_point(free_options(), request, equations, answer, record)
            call check(error, answer%contact, merge(contact_lost, contact_kept, i == 3), 'the contact')
            if (allocated(error)) return
            request%highest_order = 100.0_wp
            call record_point(free_options(), request, equations, answer, finer)
            difference = maxval(abs(record%spectrum(2:, 1) - finer%spectrum(2:size(record%spectrum, 1), 1))) &
                         /maxval(finer%spectrum(2:, 1))
            call check(error, difference, 0.0_wp, merge(merge(kinked, kinked_force, q == 1), smooth, i == 3), &
                       observables(request%quantities(1))%name)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_aliasing

   !> The record is the motion that the map has from the section that was given; the highest line is that of the mesh frequency.
   subroutine test_irregular(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: window = 60
      type(record_request) :: request
      type(record_type) :: record
      type(recorder_type) :: recorder
      type(response) :: answer
      type(equations_type) :: equations
      type(collocation_map) :: map
      type(library_error), allocatable :: fault
      real(wp), allocatable :: state(:), position(:), velocity(:)
      real(wp) :: start(3), rate(3)
      integer :: k

      request = whole_request()
      request%quantities = [y1]
      request%spectrum_periods = window
      request%sections = 80
      request%history_periods = 3
      equations = reference_at(rigid_point(4900.0_wp))
      answer = empty_response()
      answer%status = status_settled
      answer%motion = motion_quasi_periodic
      start = [-3.0e-6_wp, 2.0e-6_wp, 5.0e-6_wp]
      rate = [0.01_wp, 0.0_wp, -0.02_wp]
      call new_recorder(free_options(), request, recorder)
      call recorder%record(equations, start, rate, answer, record, fault)
      call check(error, .not. allocated(fault), 'recorded')
      if (allocated(error)) return
      call release_recorder(recorder)
      call map%load(equations, 2*first_steps(equations), fault)
      call check(error, .not. allocated(fault), 'loaded')
      if (allocated(error)) return
      state = map%to_state(start, rate)
      do k = 1, request%sections
         call map%from_state(state, position, velocity)
         call check(error, record%section(k, 1, 1), equations%static_observation(1) + dot_product(equations%observation(1, :), &
                                                                                                  position), &
                    1.0e-18_wp, 'section')
         if (allocated(error)) return
         call check(error, record%section(k, 2, 1), dot_product(equations%observation(1, :), velocity), 1.0e-13_wp, 'its rate')
         if (allocated(error)) return
         call map%advance(state)
      end do
      call check(error, maxloc(record%spectrum(2:, 1), 1), window, 'the highest line')
      if (allocated(error)) return
      call check(error, .not. any(record%spectrum(2:, 1) <= 0.0_wp), 'a line everywhere')
      if (allocated(error)) return
      call check(error, size(record%history, 1), samples_of(request), 'samples')
   end subroutine test_irregular

   !> With Newmark's method and given steps the samples of the history at the steps are those of its map.
   subroutine test_newmark(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 128
      !> Of the Newton iteration that closes the motion, beside the vibration.
      real(wp), parameter :: tolerance = 1.0e-7_wp
      type(solver_options) :: options
      type(solver_type) :: solver
      type(recorder_type) :: recorder
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      type(newmark_map) :: map
      type(orbit_type) :: orbit
      type(no_attendant) :: nobody
      type(library_error), allocatable :: fault
      real(wp), allocatable :: state(:)
      real(wp) :: position(8), velocity(8), difference
      integer :: s

      options = solver_options(integrator=integrator_newmark, steps_per_period=steps, tolerance=1.0e-3_wp)
      request = whole_request()
      request%quantities = [y1]
      request%history_samples = steps
      request%history_periods = 1
      equations = reference_at(flexible_point(2600.0_wp, 2.5e8_wp))
      position = 0.0_wp
      velocity = 0.0_wp
      call new_solver(options, solver)
      call respond_one(solver, equations, position, velocity, nobody, answer)
      call check(error, answer%motion, 1, 'the motion')
      if (allocated(error)) return
      call new_recorder(options, request, recorder)
      call recorder%record(equations, position, velocity, answer, record, fault)
      call check(error, .not. allocated(fault), 'recorded')
      if (allocated(error)) return
      call release_recorder(recorder)
      call map%load(equations, steps, fault)
      call check(error, .not. allocated(fault), 'loaded')
      if (allocated(error)) return
      state = map%to_state(position, velocity)
      call map%advance(state, orbit=orbit)
      difference = 0.0_wp
      do s = 0, steps
         difference = max(difference, abs(record%history(s + 1, 1, 1) - equations%static_observation(1) - orbit%value(1, s)))
      end do
      call check(error, difference, 0.0_wp, tolerance*answer%y1_amplitude, 'history')
      if (allocated(error)) return
      call check(error, 0.5_wp*(maxval(record%history(:, 1, 1)) - minval(record%history(:, 1, 1))), answer%y1_amplitude, &
                 1.0e-3_wp, 'amplitude', relative=.true.)
      if (allocated(error)) return
      ! Collocation would have it elsewhere.
      call record_point(free_options(), request, equations, answer, record)
      difference = maxval([(abs(record%history(s + 1, 1, 1) - equations%static_observation(1) - orbit%value(1, s)), s=0, steps)])
      call check(error, difference > 1.0e2_wp*tolerance*answer%y1_amplitude, 'another method')
   end subroutine test_newmark

   !> A section that is off by a thousandth gives the same record; one far away is taken as it is.
   subroutine test_closing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(solver_type) :: solver
      type(recorder_type) :: recorder
      type(library_error), allocatable :: fault
      type(record_request) :: request
      type(record_type) :: record, shaken, far
      type(response) :: answer
      type(equations_type) :: equations
      type(no_attendant) :: nobody
      real(wp) :: position(8), velocity(8)

      request = whole_request()
      request%quantities = [y1]
      equations = reference_at(flexible_point(2600.0_wp, 2.5e8_wp))
      position = 0.0_wp
      velocity = 0.0_wp
      call new_solver(free_options(), solver)
      call respond_one(solver, equations, position, velocity, nobody, answer)
      call new_recorder(free_options(), request, recorder)
      call recorder%record(equations, position, velocity, answer, record, fault)
      call check(error, .not. allocated(fault), 'recorded')
      if (allocated(error)) return
      call recorder%record(equations, 1.001_wp*position, 0.999_wp*velocity, answer, shaken, fault)
      call check(error, .not. allocated(fault), 'recorded')
      if (allocated(error)) return
      call check(error, maxval(abs(shaken%history(:, 1, 1) - record%history(:, 1, 1))), 0.0_wp, 1.0e-7_wp*answer%y1_amplitude, &
                 'closed')
      if (allocated(error)) return
      call recorder%record(equations, 3.0_wp*position, -velocity, answer, far, fault)
      call check(error, .not. allocated(fault), 'recorded')
      if (allocated(error)) return
      call release_recorder(recorder)
      call check(error, far%section(1, 1, 1), equations%static_observation(1) &
                 + 3.0_wp*dot_product(equations%observation(1, :), position), 1.0e-10_wp*answer%y1_amplitude, 'not closed')
   end subroutine test_closing

   !> Points without a motion, and quantities that a rigid support lacks.
   subroutine test_missing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(recorder_type) :: recorder
      type(library_error), allocatable :: fault
      type(record_request) :: request
      type(record_type) :: record
      type(response) :: answer
      type(equations_type) :: equations
      real(wp) :: zero(3)
      integer :: i

      request = whole_request()
      equations = reference_at(rigid_point(1500.0_wp))
      zero = 0.0_wp
      answer = empty_response()
      call new_recorder(free_options(), request, recorder)
      do i = 1, 2
         answer%motion = 1
         answer%status = merge(status_missing, status_diverged, i == 1)
         call recorder%record(equations, zero, zero, answer, record, fault)
         call check(error, .not. allocated(fault), 'recorded')
         if (allocated(error)) return
         call check(error, all(not_a_number(record%spectrum)), 'spectrum')
         if (allocated(error)) return
         call check(error, all(not_a_number(record%section)), 'section')
         if (allocated(error)) return
         call check(error, all(not_a_number(record%history)), 'history')
         if (allocated(error)) return
      end do
      call release_recorder(recorder)
      call record_point(free_options(), request, equations, answer, record)
      do i = 1, size(observables)
         call check(error, all(not_a_number(record%spectrum(:, i)) .eqv. observables(i)%flexible_only), 'spectrum, rigid')
         if (allocated(error)) return
         call check(error, all(not_a_number(record%section(:, :, i)) .eqv. observables(i)%flexible_only), 'section, rigid')
         if (allocated(error)) return
         call check(error, all(not_a_number(record%history(:, :, i)) .eqv. observables(i)%flexible_only), 'history, rigid')
         if (allocated(error)) return
      end do
   end subroutine test_missing

   !> Values that are not numbers.
   elemental function not_a_number(value) result(it_is)
      use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
      !> A value.
      real(wp), intent(in) :: value
      !> It is none.
      logical :: it_is

      it_is = ieee_is_nan(value)
   end function not_a_number

   !> Each product alone is what it is among the others.
   subroutine test_products(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(record_request) :: request
      type(record_type) :: whole, part
      type(response) :: answer
      type(equations_type) :: equations
      integer :: i, k

      do k = 1, 2
         equations = reference_at(rigid_point(merge(5500.0_wp, 4900.0_wp, k == 1)))
         request = whole_request()
         request%quantities = [y1, mesh_force_observable]
         request%spectrum_periods = 30
         request%sections = 17
         call record_point(free_options(), request, equations, answer, whole)
         do i = 0, 3
            request%spectrum = i == 1
            request%section = i == 2
            request%history = i == 3
            call record_point(free_options(), request, equations, answer, part)
            call check(error, (allocated(part%spectrum) .eqv. i == 1) .and. (allocated(part%section) .eqv. i == 2) &
                       .and. (allocated(part%history) .eqv. i == 3), 'allocated')
            if (allocated(error)) return
            if (i == 1) call check(error, .not. any(abs(part%spectrum - whole%spectrum) > 0.0_wp), 'spectrum')
            if (i == 2) call check(error, .not. any(abs(part%section - whole%section) > 0.0_wp), 'section')
            if (i == 3) call check(error, .not. any(abs(part%history - whole%history) > 0.0_wp), 'history')
            if (allocated(error)) return
         end do
      end do
   end subroutine test_products

   !> A recorder that has seen other supports, speeds and motions gives the same bits as a new one.
   subroutine test_neighbours(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(recorder_type) :: recorder
      type(library_error), allocatable :: fault
      type(solver_type) :: solver
      type(record_request) :: request
      type(record_type) :: record, fresh
      type(response) :: answer
      type(equations_type) :: equations(5)
      type(no_attendant) :: nobody
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i, k

      request = whole_request()
      request%quantities = [9, y1, mesh_force_observable, bearing_observables(2)]
      request%spectrum_periods = 60
      equations = [reference_at(rigid_point(5500.0_wp)), &
                   reference_at(flexible_point(310.0_wp, 2.5e8_wp)), &
                   reference_at(flexible_point(5500.0_wp, 2.5e8_wp)), &
                   reference_at(flexible_point(5500.0_wp, 1.0e6_wp)), &
                   reference_at(rigid_point(4900.0_wp))]
      call new_solver(free_options(), solver)
      call new_recorder(free_options(), request, recorder)
      do k = 1, 2
         do i = 1, size(equations)
            position = spread(0.0_wp, 1, equations(i)%n)
            velocity = position
            call respond_one(solver, equations(i), position, velocity, nobody, answer)
            call recorder%record(equations(i), position, velocity, answer, record, fault)
            call check(error, .not. allocated(fault), 'recorded')
            if (allocated(error)) return
            call record_fresh()
            call check(error, all(same(record%spectrum, fresh%spectrum)), &
                       'spectrum of point '//to_text(i))
            if (allocated(error)) return
            call check(error, all(same(record%section, fresh%section)), &
                       'section of point '//to_text(i))
            if (allocated(error)) return
            call check(error, all(same(record%history, fresh%history)), &
                       'history of point '//to_text(i))
            if (allocated(error)) return
         end do
      end do
      call release_recorder(recorder)

   contains

      !> The record of the point by a new recorder.
      subroutine record_fresh()
         type(recorder_type) :: new
         type(library_error), allocatable :: fault

         call new_recorder(free_options(), request, new)
         call new%record(equations(i), position, velocity, answer, fresh, fault)
         if (allocated(fault)) error stop 'a motion cannot be recorded'
         call release_recorder(new)
      end subroutine record_fresh

      !> The same bits.
      elemental function same(a, b) result(they_are)
         !> Values.
         real(wp), intent(in) :: a, b
         !> They are.
         logical :: they_are

         they_are = transfer(a, 0_i8) == transfer(b, 0_i8)
      end function same

   end subroutine test_neighbours

end module test_recorder
