!> Modes that the mesh does not feel: what is left out is as small as is said, and what is completed follows from the rest.
module test_truncation
   use cases, only: flexible_point, reference_box, reference_gears, reference_load
   use pseudo_random, only: random_stream
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_lane_ensemble, only: lane_ensemble
   use spurflex_integrate_options, only: integrator_collocation, solver_options
   use spurflex_measure_lane_search, only: search_in_lanes
   use spurflex_measure_linear_parts, only: linear_parts
   use spurflex_measure_points, only: new_solver, respond_one, solver_type
   use spurflex_measure_response, only: motion_quasi_periodic, response, status_settled
   use spurflex_model_equations, only: equations_type, new_equations, rest_deviation
   use spurflex_model_modal, only: modal_system, new_modal_system
   use spurflex_model_parameters, only: gear_pair, gearbox
   use spurflex_model_truncation, only: complete_monodromy, complete_state, felt_modes, new_mode_shares, truncated
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_outcome, only: steady_motion
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_truncation

   !> Share below which a mode is not felt.
   real(wp), parameter :: least_share = 1.0e-5_wp

contains

   !> The tests of this suite.
   subroutine collect_truncation(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('what the mesh does not feel is small, soft to stiff', test_receptance), &
                  new_unittest('soft and stiff supports leave few modes', test_few), &
                  new_unittest('all modes, if all are asked for', test_all), &
                  new_unittest('a mode that does not decay is seen to be stable or not', test_undamped), &
                  new_unittest('from rest a soft support sways, and the mesh feels it', test_from_rest), &
                  new_unittest('states and monodromies are completed', test_complete), &
                  new_unittest('a torus on ever softer supports', test_soft_torus) &
                  ]
   end subroutine collect_truncation

   !> The modes of a point.
   subroutine find(speed, stiffness, modal, frequency, error)
      !> Speed [rev/min], support stiffness [N/m].
      real(wp), intent(in) :: speed, stiffness
      !> The modes.
      type(modal_system), intent(out) :: modal
      !> Mesh frequency [rad/s].
      real(wp), intent(out) :: frequency
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type) :: equations
      type(library_error), allocatable :: fault

      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(speed, stiffness))
      call new_modal_system(equations, modal, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      frequency = equations%frequency
   end subroutine find

   !> What each mode adds to the mesh deflection under a unit force.
   elemental function added(influence, rate, is_real, frequency) result(response)
      !> Of the mode.
      complex(wp), intent(in) :: influence, rate
      logical, intent(in) :: is_real
      !> Frequency [rad/s].
      real(wp), intent(in) :: frequency
      !> The response [m/N].
      complex(wp) :: response

      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)

      response = influence/(i*frequency - rate)
      if (.not. is_real) response = 0.5_wp*(response + conjg(influence)/(i*frequency - conjg(rate)))
   end function added

   !> At any frequency of a motion that repeats after at most eight mesh periods, the receptance without the modes left out differs
   !> by no more than the least share of the largest response for each of them, but for what the tabulated frequencies miss.
   subroutine test_receptance(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speeds(3) = [300.0_wp, 1500.0_wp, 6000.0_wp], between = 1.5_wp
      integer, parameter :: draws = 200, decades = 10
      type(modal_system) :: modal, few
      type(random_stream) :: random
      real(wp) :: frequency, at, logarithm(1), missed, allowed
      complex(wp), allocatable :: responses(:)
      logical, allocatable :: felt(:)
      integer :: i, j, k

      do i = 1, size(speeds)
         do j = 0, decades - 1
            call find(speeds(i), 10.0_wp**(3 + j), modal, frequency, error)
            if (allocated(error)) return
            felt = felt_modes(new_mode_shares(modal), frequency, least_share)
            few = truncated(modal, felt)
            do k = 1, draws
               call random%fill(log(frequency/8.0_wp), log(40.0_wp*frequency), logarithm)
               at = exp(logarithm(1))
               responses = added(modal%influence, modal%rate, modal%is_real, at)
               missed = abs(sum(responses) - sum(added(few%influence, few%rate, few%is_real, at)))
               allowed = between*least_share*real(count(.not. felt), wp) + real(modal%modes, wp)*epsilon(1.0_wp)
               call check(error, missed <= allowed*maxval(abs(responses)), 'receptance on '//to_text(10.0_wp**(3 + j)) &
                          //' N/m at '//to_text(speeds(i))//' rev/min: misses '//to_text(missed/maxval(abs(responses))))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_receptance

   !> On soft supports the mesh feels five modes, on the stiffest the three of a rigid one, in between more.
   subroutine test_few(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: stiffness(4) = [1.0e3_wp, 1.0e5_wp, 1.0e8_wp, 1.0e12_wp]
      integer, parameter :: modes(4) = [5, 5, 7, 3]
      type(modal_system) :: modal
      real(wp) :: frequency
      integer :: i

      do i = 1, size(stiffness)
         call find(1500.0_wp, stiffness(i), modal, frequency, error)
         if (allocated(error)) return
         call check(error, count(felt_modes(new_mode_shares(modal), frequency, least_share)), modes(i), &
                    'modes on '//to_text(stiffness(i))//' N/m')
         if (allocated(error)) return
      end do
   end subroutine test_few

   !> A negative share leaves nothing out, whatever the speed.
   subroutine test_all(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: speeds(3) = [1.0e-3_wp, 1500.0_wp, 1.0e9_wp]
      type(modal_system) :: modal, same
      real(wp) :: frequency
      logical, allocatable :: felt(:)
      integer :: i

      do i = 1, size(speeds)
         call find(speeds(i), 1.0e3_wp, modal, frequency, error)
         if (allocated(error)) return
         felt = felt_modes(new_mode_shares(modal), frequency, -1.0_wp)
         call check(error, all(felt), 'all modes')
         if (allocated(error)) return
         same = truncated(modal, felt)
         call check(error, same%modes == modal%modes .and. .not. any(abs(same%from_modes - modal%from_modes) > 0.0_wp) &
                    .and. .not. any(abs(same%weight - modal%weight) > 0.0_wp), 'the same linear part')
         if (allocated(error)) return
      end do
   end subroutine test_all

   !> Without damping no mode is left out; the tables have no frequency at which one would be infinite.
   subroutine test_undamped(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(gear_pair) :: gears
      type(gearbox) :: box
      type(equations_type) :: equations
      type(modal_system) :: modal
      type(library_error), allocatable :: fault

      gears = reference_gears()
      gears%bearing_damping = 0.0_wp
      gears%mesh%damping = 0.0_wp
      box = reference_box()
      box%damping_ratio = 0.0_wp
      equations = new_equations(gears, box, reference_load(), flexible_point(1500.0_wp, 1.0e3_wp))
      call new_modal_system(equations, modal, fault)
      if (allocated(fault)) then
         call test_failed(error, fault%message)
         return
      end if
      ! What is left of the real parts of the eigenvalues is round-off, of either sign.
      modal%rate = cmplx(0.0_wp, aimag(modal%rate), wp)
      call check(error, all(felt_modes(new_mode_shares(modal), equations%frequency, least_share)), 'all modes')
   end subroutine test_undamped

   !> At the static equilibrium the mesh feels fewer modes of a soft support than when the gearbox is let go at rest, far away.
   subroutine test_from_rest(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type) :: equations
      type(linear_parts) :: parts
      type(lane_ensemble) :: seekers
      type(solver_options) :: options
      type(no_attendant) :: nobody
      type(steady_motion) :: motions(1)
      type(periodic_orbit) :: orbits(1)
      real(wp), allocatable :: position(:), velocity(:)
      integer :: few(1), part, at_rest, modes(2)

      options%integrator = integrator_collocation
      equations = new_equations(reference_gears(), reference_box(), reference_load(), flexible_point(2600.0_wp, 1.0e4_wp))
      call parts%find(equations, part)
      do at_rest = 0, 1
         position = spread(0.0_wp, 1, equations%n)
         if (at_rest == 1) position = rest_deviation(equations)
         velocity = spread(0.0_wp, 1, equations%n)
         call search_in_lanes(seekers, parts, [equations], [part], 16, options, reshape(position, [equations%n, 1]), &
                              reshape(velocity, [equations%n, 1]), nobody, few, motions, orbits)
         modes(at_rest + 1) = parts%few(few(1))%modes
         call check(error, motions(1)%status, status_settled, 'a motion is found')
         if (allocated(error)) return
      end do
      call check(error, modes(1) == 5 .and. modes(2) > 5, 'modes from the equilibrium and from rest')
   end subroutine test_from_rest

   !> Modes that are felt keep what they have, whatever room there is; the others balance the steady force and decay on their own.
   subroutine test_complete(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: few_room = 6, room = 9
      real(wp), parameter :: force = 3.0_wp, time = 1.0e-3_wp, roundoff = 1.0e-13_wp
      type(modal_system) :: modal
      type(random_stream) :: random
      real(wp) :: frequency, few(2*few_room), matrix(4*few_room**2), state(2*room), again(2*room), monodromy(2*room, 2*room)
      complex(wp) :: z
      logical, allocatable :: felt(:)
      integer :: k, at

      call find(1500.0_wp, 1.0e3_wp, modal, frequency, error)
      if (allocated(error)) return
      felt = felt_modes(new_mode_shares(modal), frequency, least_share)
      call random%fill(-1.0_wp, 1.0_wp, few)
      call random%fill(-1.0_wp, 1.0_wp, matrix)
      state = complete_state(few, few_room, felt, modal, force, room)
      monodromy = complete_monodromy(reshape(matrix, [2*few_room, 2*few_room]), few_room, felt, modal, time, room)
      again = matmul(monodromy, state)
      at = 0
      do k = 1, modal%modes
         z = cmplx(state(k), state(room + k), wp)
         if (felt(k)) then
            at = at + 1
            call check(error, abs(z - cmplx(few(at), few(few_room + at), wp)), 0.0_wp, 0.0_wp, 'a mode that is felt')
            if (allocated(error)) return
            call check(error, again(k), sum(matrix(at::2*few_room)*few, mask=columns_in_use(count(felt))), roundoff, &
                       'what a mode that is felt becomes')
         else
            call check(error, abs(modal%rate(k)*z - modal%influence(k)*force), 0.0_wp, &
                       roundoff*abs(modal%influence(k)*force), 'balance of a mode that is not felt')
            if (allocated(error)) return
            call check(error, abs(exp(modal%rate(k)*time)*z - cmplx(again(k), again(room + k), wp)), 0.0_wp, roundoff*abs(z), &
                       'its decay')
         end if
         if (allocated(error)) return
      end do
      call check(error, .not. any(abs(state([modal%modes + 1, room, 2*room])) > 0.0_wp), 'room that is not used')

   contains

      !> Components of a state in the modes that are felt that are in use.
      pure function columns_in_use(modes) result(used)
         !> How many modes.
         integer, intent(in) :: modes
         !> They are, shape (2 few_room).
         logical :: used(2*few_room)

         integer :: c

         used = [(mod(c - 1, few_room) < modes, c=1, 2*few_room)]
      end function columns_in_use

   end subroutine test_complete

   !> On ever softer supports a quasi-periodic motion tends to that of a free gearbox. The damper of the support pulls with the root
   !> of the stiffness: from decade to decade the amplitude changes by 1/sqrt(10) of what it changed by before. A gearbox that
   !> still swayed from its start would change it by more, and at random.
   subroutine test_soft_torus(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: stiffness(4) = [1.0e3_wp, 1.0e4_wp, 1.0e5_wp, 1.0e6_wp], speed = 4900.0_wp
      !> Windows of some hundred periods leave this of a ratio.
      real(wp), parameter :: window = 0.12_wp
      type(gearbox) :: box
      type(solver_options) :: options
      type(solver_type), allocatable :: solver
      type(equations_type) :: equations
      type(response) :: answer
      type(no_attendant) :: nobody
      real(wp), allocatable :: position(:), velocity(:)
      real(wp) :: amplitude(size(stiffness))
      integer :: i

      box = reference_box()
      box%gear_offset = 0.081_wp
      box%support_offset = 0.131_wp
      options%integrator = integrator_collocation
      options%multipliers = .false.
      do i = 1, size(stiffness)
         equations = new_equations(reference_gears(), box, reference_load(), flexible_point(speed, stiffness(i)))
         position = spread(0.0_wp, 1, equations%n)
         velocity = position
         allocate (solver)
         call new_solver(options, solver)
         call respond_one(solver, equations, position, velocity, nobody, answer)
         deallocate (solver)
         call check(error, answer%motion == motion_quasi_periodic .and. answer%status == status_settled, &
                    'quasi-periodic on '//to_text(stiffness(i))//' N/m')
         if (allocated(error)) return
         amplitude(i) = answer%y1_amplitude
      end do
      do i = 1, 2
         call check(error, (amplitude(i) - amplitude(i + 1))/(amplitude(i + 1) - amplitude(i + 2)), sqrt(0.1_wp), window, &
                    'change from '//to_text(stiffness(i))//' N/m on')
         if (allocated(error)) return
      end do
   end subroutine test_soft_torus

end module test_truncation
