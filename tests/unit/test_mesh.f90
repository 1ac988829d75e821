!> Mesh stiffness, transmission error, backlash and mesh force, Eqs. (1), (2), (4) and (5).
module test_mesh
   use cases, only: reference_gears
   use pseudo_random, only: random_stream
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_model_mesh, only: backlash_deflection, mesh_force, mesh_force_rate, mesh_stiffness, mesh_stiffness_rate, &
      smallest_mesh_stiffness, transmission_error, transmission_error_curvature, transmission_error_rate
   use spurflex_model_parameters, only: gear_pair, mesh_excitation
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_mesh

   !> Round-off of a few operations, relative.
   real(wp), parameter :: roundoff = 1.0e-14_wp

   integer, parameter :: phases = 97

contains

   !> The tests of this suite.
   subroutine collect_mesh(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('mesh stiffness, Eq. 1', test_stiffness), &
                  new_unittest('transmission error, Eq. 2', test_error), &
                  new_unittest('derivative of the transmission error', test_error_rate), &
                  new_unittest('further derivatives by the phase', test_derivatives), &
                  new_unittest('rate of the mesh force', test_force_rate), &
                  new_unittest('period of 2 pi', test_period), &
                  new_unittest('backlash function, Eq. 4', test_backlash), &
                  new_unittest('backlash function is continuous', test_continuity), &
                  new_unittest('no backlash', test_no_backlash), &
                  new_unittest('mesh force, Eq. 5', test_force), &
                  new_unittest('smallest mesh stiffness', test_smallest) &
                  ]
   end subroutine collect_mesh

   !> Rate of the stiffness and curvature of the transmission error against differences of fourth order.
   subroutine test_derivatives(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: step = 1.0e-3_wp
      !> Fourth power of the step, of the third harmonic, and round-off over the step; relative.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      real(wp) :: phase, slope
      integer :: i

      do i = 0, phases
         phase = 0.3_wp*real(i, wp)
         slope = (8.0_wp*(mesh_stiffness(rich_mesh(), phase + step) - mesh_stiffness(rich_mesh(), phase - step)) &
                  - mesh_stiffness(rich_mesh(), phase + 2.0_wp*step) + mesh_stiffness(rich_mesh(), phase - 2.0_wp*step)) &
                 /(12.0_wp*step)
         call check(error, mesh_stiffness_rate(rich_mesh(), phase), slope, tolerance*3.2e8_wp, 'stiffness')
         if (allocated(error)) return
         slope = (8.0_wp*(transmission_error_rate(rich_mesh(), phase + step) - transmission_error_rate(rich_mesh(), phase - step)) &
                  - transmission_error_rate(rich_mesh(), phase + 2.0_wp*step) &
                  + transmission_error_rate(rich_mesh(), phase - 2.0_wp*step))/(12.0_wp*step)
         call check(error, transmission_error_curvature(rich_mesh(), phase), slope, tolerance*1.0e-5_wp, 'transmission error')
         if (allocated(error)) return
      end do
   end subroutine test_derivatives

   !> Along a motion through contact, gap and back flank, against differences where no border is near.
   subroutine test_force_rate(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: frequency = 5.0e3_wp, step = 1.0e-3_wp/frequency
      !> Fourth power of the step and round-off over it, relative.
      real(wp), parameter :: tolerance = 1.0e-9_wp
      real(wp) :: time, slope, largest
      integer :: i, branches(-1:1)

      branches = 0
      largest = 3.2e8_wp*frequency*2.0e-5_wp
      do i = 0, phases
         time = 0.11_wp*real(i, wp)/frequency
         if (abs(abs(deflection(time, 0)) - 1.0e-5_wp) < 1.0e-7_wp) cycle
         slope = (8.0_wp*(force(time + step) - force(time - step)) - force(time + 2.0_wp*step) + force(time - 2.0_wp*step)) &
                 /(12.0_wp*step)
         call check(error, mesh_force_rate(rich_mesh(), frequency*time, frequency, [deflection(time, 0), deflection(time, 1), &
                                                                                    deflection(time, 2)]), &
                    slope, tolerance*largest, 'rate')
         if (allocated(error)) return
         branches(max(-1, min(1, int(deflection(time, 0)*1.0e5_wp)))) = 1
      end do
      call check(error, sum(branches), 3, 'branches met')

   contains

      !> A mesh deflection and its derivatives in time.
      pure function deflection(time, order) result(value)
         !> Time [s].
         real(wp), intent(in) :: time
         !> Which derivative.
         integer, intent(in) :: order
         !> Its value.
         real(wp) :: value

         value = 2.0e-5_wp*(1.3_wp*frequency)**order*sin(1.3_wp*frequency*time + 0.5_wp*pi*real(order, wp))
      end function deflection

      !> The mesh force on the way.
      pure function force(time) result(value)
         !> Time [s].
         real(wp), intent(in) :: time
         !> The force [N].
         real(wp) :: value

         value = mesh_force(rich_mesh(), frequency*time, deflection(time, 0), deflection(time, 1))
      end function force

   end subroutine test_force_rate

   !> An excitation of two stiffness and three error harmonics with phases.
   pure function rich_mesh() result(mesh)
      !> The excitation.
      type(mesh_excitation) :: mesh

      type(gear_pair) :: gears

      gears = reference_gears()
      mesh = gears%mesh
      mesh%stiffness_coefficients = [0.3_wp, -0.1_wp]
      mesh%stiffness_phases = [0.4_wp, -1.1_wp]
      mesh%error_amplitudes = [1.0e-5_wp, 0.0_wp, 2.0e-6_wp]
      mesh%error_phases = [0.2_wp, 0.0_wp, 2.5_wp]
   end function rich_mesh

   !> The sum of harmonics, and its values at the quarters of the period for the paper's one harmonic.
   subroutine test_stiffness(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      real(wp) :: phase, expected
      integer :: i

      do i = 0, phases
         phase = 0.3_wp*real(i, wp)
         expected = 3.2e8_wp*(1.0_wp + 0.3_wp*sin(phase + 0.4_wp) - 0.1_wp*sin(2.0_wp*phase - 1.1_wp))
         call check(error, mesh_stiffness(rich_mesh(), phase), expected, roundoff, 'two harmonics', relative=.true.)
         if (allocated(error)) return
      end do
      gears = reference_gears()
      call check(error, mesh_stiffness(gears%mesh, 0.0_wp), 3.2e8_wp, roundoff, 'at 0', relative=.true.)
      if (allocated(error)) return
      call check(error, mesh_stiffness(gears%mesh, 0.5_wp*pi), 1.3_wp*3.2e8_wp, roundoff, 'at pi/2', relative=.true.)
      if (allocated(error)) return
      call check(error, mesh_stiffness(gears%mesh, 1.5_wp*pi), 0.7_wp*3.2e8_wp, roundoff, 'at 3 pi/2', relative=.true.)
   end subroutine test_stiffness

   !> The sum of harmonics.
   subroutine test_error(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: phase, expected
      integer :: i

      do i = 0, phases
         phase = 0.3_wp*real(i, wp)
         expected = 1.0e-5_wp*sin(phase + 0.2_wp) + 2.0e-6_wp*sin(3.0_wp*phase + 2.5_wp)
         call check(error, transmission_error(rich_mesh(), phase), expected, roundoff*1.0e-5_wp)
         if (allocated(error)) return
      end do
   end subroutine test_error

   !> The derivative equals central differences, whose error is a sixth of the step squared of the third derivative.
   subroutine test_error_rate(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: h = 1.0e-4_wp
      real(wp), parameter :: third_derivative = 1.0e-5_wp + 27.0_wp*2.0e-6_wp
      !> Truncation of the difference and round-off of the values, 1e-5 m, over the step.
      real(wp), parameter :: tolerance = third_derivative*h**2/6.0_wp + 1.0e-5_wp*roundoff/h
      real(wp) :: phase, difference
      integer :: i

      do i = 0, phases
         phase = 0.3_wp*real(i, wp)
         difference = (transmission_error(rich_mesh(), phase + h) - transmission_error(rich_mesh(), phase - h))/(2.0_wp*h)
         call check(error, transmission_error_rate(rich_mesh(), phase), difference, tolerance)
         if (allocated(error)) return
      end do
   end subroutine test_error_rate

   !> Everything repeats after a mesh period.
   subroutine test_period(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(mesh_excitation) :: mesh
      real(wp) :: phase
      integer :: i

      mesh = rich_mesh()
      do i = 0, phases
         phase = 0.07_wp*real(i, wp)
         call check(error, mesh_stiffness(mesh, phase + 2.0_wp*pi), mesh_stiffness(mesh, phase), roundoff, 'k_m', &
                    relative=.true.)
         if (allocated(error)) return
         call check(error, transmission_error(mesh, phase + 2.0_wp*pi), transmission_error(mesh, phase), &
                    roundoff*1.0e-5_wp, 'e_m')
         if (allocated(error)) return
         call check(error, transmission_error_rate(mesh, phase + 2.0_wp*pi), transmission_error_rate(mesh, phase), &
                    roundoff*1.0e-5_wp, 'derivative of e_m')
         if (allocated(error)) return
      end do
   end subroutine test_period

   !> Contact, gap and contact of the back flank; the function is odd.
   subroutine test_backlash(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: b = 1.0e-5_wp
      real(wp), parameter :: delta(7) = [-4.0e-5_wp, -1.0e-5_wp, -0.4e-5_wp, 0.0_wp, 0.9e-5_wp, 1.0e-5_wp, 3.0e-5_wp]
      real(wp), parameter :: expected(7) = [-3.0e-5_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 2.0e-5_wp]

      call check(error, maxval(abs(backlash_deflection(delta, b) - expected)), 0.0_wp, roundoff*b)
      if (allocated(error)) return
      call check(error, all(abs(backlash_deflection(delta, b) + backlash_deflection(-delta, b)) <= 0.0_wp), 'odd')
   end subroutine test_backlash

   !> No jump at the ends of the gap: the slope is never above one.
   subroutine test_continuity(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: b = 1.0e-5_wp
      real(wp) :: side(2), jump
      integer :: i, s

      do s = 1, 2
         do i = 1, 40
            side = real(2*s - 3, wp)*b + b*2.0_wp**(-i)*[-1.0_wp, 1.0_wp]
            jump = backlash_deflection(side(2), b) - backlash_deflection(side(1), b)
            call check(error, jump >= 0.0_wp .and. jump <= (side(2) - side(1))*(1.0_wp + roundoff) + roundoff*b)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_continuity

   !> Without backlash the teeth are a plain spring.
   subroutine test_no_backlash(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: delta(5) = [-1.0_wp, -1.0e-9_wp, 0.0_wp, 1.0e-9_wp, 1.0_wp]

      call check(error, all(abs(backlash_deflection(delta, 0.0_wp) - delta) <= 0.0_wp))
   end subroutine test_no_backlash

   !> Spring and damper in contact, the damper alone in the gap.
   subroutine test_force(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(mesh_excitation) :: mesh
      type(random_stream) :: random
      real(wp) :: phase, delta, rate, elastic
      integer :: i

      mesh = rich_mesh()
      random = random_stream(7_i8)
      do i = 1, 300
         call random%uniform(0.0_wp, 2.0_wp*pi, phase)
         call random%uniform(-4.0e-5_wp, 4.0e-5_wp, delta)
         call random%uniform(-1.0_wp, 1.0_wp, rate)
         elastic = 0.0_wp
         if (abs(delta) > mesh%half_backlash) elastic = mesh_stiffness(mesh, phase)*(delta - sign(mesh%half_backlash, delta))
         call check(error, mesh_force(mesh, phase, delta, rate), 2000.0_wp*rate + elastic, roundoff*1.0e4_wp)
         if (allocated(error)) return
      end do
   end subroutine test_force

   !> Closed forms: 1 - k_m1 for one harmonic; with a second one that is largest where the first is smallest, 1 - k_m1 - k_m2.
   subroutine test_smallest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(mesh_excitation) :: mesh

      mesh = rich_mesh()
      mesh%stiffness_coefficients = [0.3_wp]
      mesh%stiffness_phases = [0.0_wp]
      call check(error, smallest_mesh_stiffness(mesh), 0.7_wp*3.2e8_wp, roundoff, 'one harmonic', relative=.true.)
      if (allocated(error)) return
      mesh%stiffness_coefficients = [0.3_wp, 0.1_wp]
      mesh%stiffness_phases = [0.0_wp, 0.5_wp*pi]
      call check(error, smallest_mesh_stiffness(mesh), 0.6_wp*3.2e8_wp, roundoff, 'two harmonics', relative=.true.)
   end subroutine test_smallest

end module test_mesh
