!> The single-degree-of-freedom gear pair of Kahraman and Singh by the period maps: jumps, branches, grazing.
!>
!> The numbers to compare with were computed from the solution in closed form, piece by piece.
module test_kahraman_singh
   use period_maps, only: largest_multiplier, load_map, single_dof_equations, single_dof_type
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: integrator_collocation
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_shooting, only: advance_periods, find_orbit
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_kahraman_singh

   !> Backlash: the size of the motions.
   real(wp), parameter :: motion_size = 1.0_wp

   !> Excitations of the table.
   real(wp), parameter :: excitation(3) = [0.02_wp, 0.05_wp, 0.1_wp]

   !> Steps per mesh period; the extremes of x are read off at their points, to 1e-4 and 1e-6 of the amplitude.
   integer, parameter :: coarse = 64, fine = 1024

   !> Frequencies below the jumps down, where there is the lower branch alone.
   real(wp), parameter :: below(3) = [0.87_wp, 0.69_wp, 0.57_wp]

   !> Mesh periods from the static equilibrium before a first motion is looked for.
   integer, parameter :: settling = 100

contains

   !> The tests of this suite.
   subroutine collect_kahraman_singh(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('1990: linear up to grazing', test_grazing), &
                  new_unittest('1990: jumps up', test_jump_up), &
                  new_unittest('1990: jumps down', test_jump_down), &
                  new_unittest('1990: upper branches', test_upper_branch), &
                  new_unittest('1991: motion with varying stiffness', test_varying_stiffness), &
                  new_unittest('1991: jumps', test_varying_jumps) &
                  ]
   end subroutine collect_kahraman_singh

   !> The case of 1990.
   pure function constant_stiffness(amplitude, frequency) result(single)
      !> Excitation.
      real(wp), intent(in) :: amplitude
      !> Frequency.
      real(wp), intent(in) :: frequency
      !> The case.
      type(single_dof_type) :: single

      single%frequency = frequency
      single%excitation = [amplitude]
   end function constant_stiffness

   !> The case of 1991.
   pure function varying_stiffness(frequency) result(single)
      !> Frequency.
      real(wp), intent(in) :: frequency
      !> The case.
      type(single_dof_type) :: single

      single%frequency = frequency
      single%excitation = [0.01_wp, 0.016_wp, 0.018_wp]
      single%variation = [0.2_wp, 0.1_wp, 0.05_wp]
   end function varying_stiffness

   !> Find 1T near a section at one case.
   subroutine find(single, steps, position, velocity, orbit, found, error)
      !> The case.
      type(single_dof_type), intent(in) :: single
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Section near it before, its own after where it is found; unallocated for a first motion.
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> The motion.
      type(periodic_orbit), intent(out) :: orbit
      !> It is there and stable.
      logical, intent(out) :: found
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      class(period_map), allocatable :: map
      type(no_attendant) :: nobody
      real(wp), allocatable :: state(:)
      real(wp) :: modulus

      found = .false.
      call load_map(integrator_collocation, single_dof_equations(single), steps, map, error)
      if (allocated(error)) return
      if (allocated(position)) then
         state = map%to_state(position, velocity)
      else
         state = spread(0.0_wp, 1, map%size)
         call advance_periods(map, settling, state)
      end if
      call find_orbit(map, state, 1, motion_size, nobody, orbit, found)
      if (.not. found) return
      call largest_multiplier(orbit, modulus, error)
      if (allocated(error)) return
      found = modulus < 1.0_wp
      if (found) call map%from_state(orbit%state, position, velocity)
   end subroutine find

   !> Follow a stable motion from one frequency as far as it goes; its end is the jump.
   !>
   !> Steps of 1e-3, where the motion ends in front of a step a tenth of it, down to 1e-6. A motion much larger or smaller than
   !> the one before is another one.
   subroutine follow(single, towards, position, velocity, last, error)
      !> The case to begin with; frequency of the last motion after.
      type(single_dof_type), intent(inout) :: single
      !> Direction: 1 up, -1 down.
      real(wp), intent(in) :: towards
      !> Section of the motion.
      real(wp), allocatable, intent(inout) :: position(:), velocity(:)
      !> The last motion.
      type(periodic_orbit), intent(out) :: last
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: first_step = 1.0e-3_wp, last_step = 0.5e-6_wp, another = 0.1_wp
      integer, parameter :: most = 2000
      type(single_dof_type) :: next
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: next_position(:), next_velocity(:)
      real(wp) :: step, size_before, size_behind
      integer :: k
      logical :: found

      call find(single, coarse, position, velocity, last, found, error)
      if (allocated(error)) return
      call check(error, found, 'a motion to begin with')
      if (allocated(error)) return
      step = first_step
      do k = 1, most
         next = single
         next%frequency = single%frequency + towards*step
         next_position = position
         next_velocity = velocity
         call find(next, coarse, next_position, next_velocity, orbit, found, error)
         if (allocated(error)) return
         if (found) then
            size_before = last%largest - last%smallest
            size_behind = orbit%largest - orbit%smallest
            found = abs(size_behind - size_before) <= another*size_before
         end if
         if (found) then
            single = next
            position = next_position
            velocity = next_velocity
            last = orbit
         else
            step = 0.1_wp*step
            if (step < last_step) return
         end if
      end do
      call test_failed(error, 'the motion does not end')
   end subroutine follow

   !> The lower branch is F W^2/sqrt((1 - W^2)^2 + (2 z W)^2), and its teeth part where that is the mean load.
   subroutine test_grazing(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: grazing(3) = [0.92518_wp, 0.82063_wp, 0.70888_wp], off = 1.0e-5_wp, step = 1.0e-3_wp
      !> Samples of x, and bearings that give way by 1e-9.
      real(wp), parameter :: sampling = 1.0e-6_wp
      type(single_dof_type) :: single
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: w, response
      integer :: i, k
      logical :: found

      do i = 1, size(excitation)
         if (allocated(position)) deallocate (position, velocity)
         w = below(i)
         do k = 0, nint((grazing(i) - below(i))/step) - 1
            w = below(i) + step*real(k, wp)
            single = constant_stiffness(excitation(i), w)
            call find(single, coarse, position, velocity, orbit, found, error)
            if (allocated(error)) return
            call check(error, found, 'lower branch at W = '//to_text(w))
            if (allocated(error)) return
         end do
         call find(single, fine, position, velocity, orbit, found, error)
         if (allocated(error)) return
         response = excitation(i)*w**2/sqrt((1.0_wp - w**2)**2 + (2.0_wp*single%damping*w)**2)
         call check(error, 0.5_wp*(orbit%largest - orbit%smallest), response, sampling*response, 'linear amplitude')
         if (allocated(error)) return
         do k = -1, 1, 2
            single%frequency = grazing(i) + off*real(k, wp)
            call find(single, fine, position, velocity, orbit, found, error)
            if (allocated(error)) return
            call check(error, found, 'lower branch at W = '//to_text(single%frequency))
            if (allocated(error)) return
            call check(error, orbit%smallest > 1.0_wp .eqv. k < 0, 'contact at W = '//to_text(single%frequency))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_grazing

   !> The lower branch ends in a fold.
   subroutine test_jump_up(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: before(3) = [0.9268_wp, 0.8284_wp, 0.7313_wp], width = 1.0e-4_wp
      type(single_dof_type) :: single
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i

      do i = 1, size(excitation)
         single = constant_stiffness(excitation(i), below(i))
         if (allocated(position)) deallocate (position, velocity)
         call follow(single, 1.0_wp, position, velocity, orbit, error)
         if (allocated(error)) return
         call check(error, single%frequency, before(i) + 0.5_wp*width, 0.5_wp*width, 'jump up of F = '//to_text(excitation(i)))
         if (allocated(error)) return
      end do
   end subroutine test_jump_up

   !> The upper branch ends in a fold further down.
   subroutine test_jump_down(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: before(3) = [0.8872_wp, 0.7080_wp, 0.5853_wp], width = 1.0e-4_wp
      type(single_dof_type) :: single
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i

      do i = 1, size(excitation)
         single = constant_stiffness(excitation(i), 0.95_wp)
         if (allocated(position)) deallocate (position, velocity)
         call follow(single, -1.0_wp, position, velocity, orbit, error)
         if (allocated(error)) return
         call check(error, single%frequency, before(i) + 0.5_wp*width, 0.5_wp*width, 'jump down of F = '//to_text(excitation(i)))
         if (allocated(error)) return
      end do
   end subroutine test_jump_down

   !> Amplitude on the upper branch.
   subroutine test_upper_branch(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: frequency(3) = [0.90_wp, 0.75_wp, 0.60_wp], amplitude(3) = [0.1737_wp, 0.3183_wp, 0.5375_wp]
      real(wp), parameter :: half_a_digit = 0.55e-4_wp, start = 0.95_wp, step = 5.0e-3_wp
      type(single_dof_type) :: single
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i, k
      logical :: found

      do i = 1, size(excitation)
         if (allocated(position)) deallocate (position, velocity)
         do k = 0, nint((start - frequency(i))/step)
            single = constant_stiffness(excitation(i), start - step*real(k, wp))
            call find(single, coarse, position, velocity, orbit, found, error)
            if (allocated(error)) return
            call check(error, found, 'upper branch at W = '//to_text(single%frequency))
            if (allocated(error)) return
         end do
         call check(error, 0.5_wp*(orbit%largest - orbit%smallest), amplitude(i), half_a_digit, &
                    'amplitude at W = '//to_text(frequency(i)))
         if (allocated(error)) return
      end do
   end subroutine test_upper_branch

   !> W = 0.5: 1T, half of the range of x and the middle of it.
   subroutine test_varying_stiffness(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: half_a_digit = 0.6e-5_wp
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:)
      logical :: found

      call find(varying_stiffness(0.5_wp), fine, position, velocity, orbit, found, error)
      if (allocated(error)) return
      call check(error, found, '1T at W = 0.5')
      if (allocated(error)) return
      call check(error, 0.5_wp*(orbit%largest - orbit%smallest), 0.14568_wp, half_a_digit, 'amplitude')
      if (allocated(error)) return
      call check(error, 0.5_wp*(orbit%largest + orbit%smallest), 1.09672_wp, half_a_digit, 'middle')
   end subroutine test_varying_stiffness

   !> Jumps up and down; collocation with 64 and 256 steps a period and Newmark's method with 4096 agree to 1e-6.
   subroutine test_varying_jumps(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: jump(4) = [0.45532_wp, 0.83584_wp, 0.43701_wp, 0.59815_wp], &
         start(4) = [0.40_wp, 0.70_wp, 0.50_wp, 0.95_wp]
      real(wp), parameter :: direction(4) = [1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp], last_digit = 1.0e-5_wp
      type(single_dof_type) :: single
      type(periodic_orbit) :: orbit
      real(wp), allocatable :: position(:), velocity(:)
      integer :: i

      do i = 1, size(jump)
         single = varying_stiffness(start(i))
         if (allocated(position)) deallocate (position, velocity)
         call follow(single, direction(i), position, velocity, orbit, error)
         if (allocated(error)) return
         call check(error, single%frequency, jump(i), last_digit, 'end of the branch from W = '//to_text(start(i)))
         if (allocated(error)) return
      end do
   end subroutine test_varying_jumps

end module test_kahraman_singh
