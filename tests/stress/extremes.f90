!> Parameters far from any gearbox, and at the ends of what decks allow: what is called settled is a motion of the equations by
!> another method, and nothing else is called settled.
module stress_extremes
   use answers, only: asked, check_orbit, check_sound, find_answer, may_not_settle, must_settle
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use period_maps, only: methods
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: solver_options
   use spurflex_measure_response, only: response
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type
   use test_support, only: error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_extremes

   !> Support stiffness where nothing else is said [N/m].
   real(wp), parameter :: reference_stiffness = 2.5e8_wp

contains

   !> The tests of this suite.
   subroutine collect_extremes(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('support stiffness in every decade', test_stiffness), &
                  new_unittest('mesh stiffness that nearly vanishes', test_variation), &
                  new_unittest('no transmission error', test_no_error), &
                  new_unittest('small and reversed torque', test_torque), &
                  new_unittest('one tooth; 1 and 60,000 rev/min', test_speed), &
                  new_unittest('mass ratios of a million', test_masses), &
                  new_unittest('gear axes in the centre of mass', test_offset), &
                  new_unittest('damping of the support: none, critical, above', test_damping), &
                  new_unittest('sixteen harmonics', test_harmonics) &
                  ]
   end subroutine collect_extremes

   !> Both methods at a point, against Runge-Kutta.
   subroutine try(equations, settles, name, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> `must_settle` or `may_not_settle`.
      logical, intent(in) :: settles
      !> Name of the point.
      character(len=*), intent(in) :: name
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(response) :: answer
      real(wp), allocatable :: position(:), velocity(:)
      integer :: k

      do k = 1, size(methods)
         call find_answer(equations, solver_options(integrator=methods(k), tolerance=asked), answer, position, velocity, error)
         if (allocated(error)) return
         call check_sound(answer, settles, name, error)
         if (allocated(error)) return
         call check_orbit(equations, answer, position, velocity, methods(k), name, error)
         if (allocated(error)) return
      end do
   end subroutine try

   !> k_M = 1e3 ... 1e12 N/m, contact kept and lost.
   subroutine test_stiffness(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [480.0_wp, 1500.0_wp, 2600.0_wp]
      integer :: decade, i

      do decade = 3, 12
         do i = 1, size(speed)
            call try(new_equations(reference_gears(), reference_box(), reference_load(), &
                                   flexible_point(speed(i), 10.0_wp**decade)), must_settle, &
                     'k_M = 1e'//to_text(decade)//' at '//to_text(speed(i))//' rev/min', error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_stiffness

   !> k_m1 up to 0.99; such meshes may rattle without end.
   subroutine test_variation(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: variation(3) = [0.6_wp, 0.9_wp, 0.99_wp], speed(3) = [480.0_wp, 1500.0_wp, 2600.0_wp]
      type(gear_pair) :: gears
      integer :: i, k

      gears = reference_gears()
      do k = 1, size(variation)
         gears%mesh%stiffness_coefficients = variation(k)
         do i = 1, size(speed)
            call try(new_equations(gears, reference_box(), reference_load(), flexible_point(speed(i), reference_stiffness)), &
                     may_not_settle, 'k_m1 = '//to_text(variation(k))//' at '//to_text(speed(i)), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_variation

   !> e = 0: the varying stiffness alone shakes the gears.
   subroutine test_no_error(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [480.0_wp, 1500.0_wp, 3200.0_wp]
      type(gear_pair) :: gears
      integer :: i

      gears = reference_gears()
      gears%mesh%error_amplitudes = 0.0_wp
      do i = 1, size(speed)
         call try(new_equations(gears, reference_box(), reference_load(), flexible_point(speed(i), reference_stiffness)), &
                  must_settle, 'e = 0 at '//to_text(speed(i)), error)
         if (allocated(error)) return
      end do
   end subroutine test_no_error

   !> A hundredth of the torque, none with a transmission error wider than the gap, and reversed torque.
   subroutine test_torque(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: torque(4) = [1.1_wp, 0.0_wp, -1.1_wp, -110.0_wp], speed(2) = [1500.0_wp, 2600.0_wp]
      type(gear_pair) :: gears
      integer :: i, k

      gears = reference_gears()
      gears%mesh%error_amplitudes = 3.0e-5_wp
      do k = 1, size(torque)
         do i = 1, size(speed)
            call try(new_equations(gears, reference_box(), load_type(torque(k), 150.0_wp/110.0_wp*torque(k)), &
                                   flexible_point(speed(i), reference_stiffness)), may_not_settle, &
                     'torque '//to_text(torque(k))//' at '//to_text(speed(i)), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_torque

   !> Periods from 20 microseconds to a minute.
   subroutine test_speed(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: slow = 1.0_wp, common = 1500.0_wp, fast = 60000.0_wp
      type(gear_pair) :: gears

      gears = reference_gears()
      call try(new_equations(gears, reference_box(), reference_load(), flexible_point(slow, reference_stiffness)), must_settle, &
               '1 rev/min', error)
      if (allocated(error)) return
      call try(new_equations(gears, reference_box(), reference_load(), flexible_point(fast, reference_stiffness)), must_settle, &
               '60,000 rev/min', error)
      if (allocated(error)) return
      call try(new_equations(gears, reference_box(), reference_load(), rigid_point(fast)), must_settle, &
               '60,000 rev/min on a rigid support', error)
      if (allocated(error)) return
      gears%teeth_1 = 1
      call try(new_equations(gears, reference_box(), reference_load(), flexible_point(common, reference_stiffness)), &
               must_settle, 'one tooth', error)
      if (allocated(error)) return
      call try(new_equations(gears, reference_box(), reference_load(), flexible_point(fast, reference_stiffness)), &
               must_settle, 'one tooth at 60,000 rev/min', error)
   end subroutine test_speed

   !> A million times heavier and lighter housing, gear and shaft.
   subroutine test_masses(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: ratio(2) = [1.0e6_wp, 1.0e-6_wp]
      type(gear_pair) :: gears
      type(gearbox) :: box
      integer :: k, which

      do k = 1, size(ratio)
         do which = 1, 4
            gears = reference_gears()
            box = reference_box()
            select case (which)
            case (1)
               box%mass = ratio(k)*box%mass
            case (2)
               gears%mass(1) = ratio(k)*gears%mass(1)
            case (3)
               gears%inertia(1) = ratio(k)*gears%inertia(1)
            case (4)
               box%inertia = ratio(k)*box%inertia
            end select
            call try(new_equations(gears, box, reference_load(), flexible_point(1500.0_wp, reference_stiffness)), &
                     may_not_settle, 'mass '//to_text(which)//' times '//to_text(ratio(k)), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_masses

   !> l_o = 0, over the speeds, on a soft and on a stiff support.
   subroutine test_offset(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speed(3) = [480.0_wp, 1500.0_wp, 2600.0_wp], stiffness(2) = [1.0e3_wp, 2.5e8_wp]
      type(gearbox) :: box
      integer :: i, k

      box = reference_box()
      box%gear_offset = 0.0_wp
      do k = 1, size(stiffness)
         do i = 1, size(speed)
            call try(new_equations(reference_gears(), box, reference_load(), flexible_point(speed(i), stiffness(k))), &
                     must_settle, 'l_o = 0 at '//to_text(speed(i)), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_offset

   !> xi = 0, 1, 3 on soft and stiff supports.
   subroutine test_damping(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: ratio(3) = [0.0_wp, 1.0_wp, 3.0_wp], stiffness(3) = [1.0e3_wp, 2.5e8_wp, 1.0e12_wp]
      type(gearbox) :: box
      integer :: i, k

      box = reference_box()
      do k = 1, size(ratio)
         box%damping_ratio = ratio(k)
         do i = 1, size(stiffness)
            call try(new_equations(reference_gears(), box, reference_load(), flexible_point(1500.0_wp, stiffness(i))), &
                     may_not_settle, 'xi = '//to_text(ratio(k))//' on '//to_text(stiffness(i)), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_damping

   !> Sixteen harmonics of the stiffness and of the transmission error.
   subroutine test_harmonics(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: harmonics = 16
      real(wp), parameter :: speed(3) = [200.0_wp, 1500.0_wp, 4000.0_wp]
      type(gear_pair) :: gears
      integer :: i, n

      gears = reference_gears()
      gears%mesh%stiffness_coefficients = [(0.25_wp/real(n, wp), n=1, harmonics)]
      gears%mesh%stiffness_phases = [(0.7_wp*real(n, wp), n=1, harmonics)]
      gears%mesh%error_amplitudes = [(1.0e-6_wp/real(n, wp), n=1, harmonics)]
      gears%mesh%error_phases = [(1.1_wp*real(n, wp), n=1, harmonics)]
      do i = 1, size(speed)
         call try(new_equations(gears, reference_box(), reference_load(), flexible_point(speed(i), reference_stiffness)), &
                  may_not_settle, 'sixteen harmonics at '//to_text(speed(i)), error)
         if (allocated(error)) return
      end do
   end subroutine test_harmonics

end module stress_extremes
