!> Answers of the solver at a point, and whether they may stand.
module answers
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use dense_solve, only: solve
   use period_maps, only: method_names
   use runge_kutta, only: new_runge_kutta, runge_kutta_type, sampled_amplitude
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_kinds, only: wp, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: solver_options
   use spurflex_measure_points, only: new_solver, solver_type, respond_one
   use spurflex_measure_response, only: response, status_diverged, status_missing, status_settled
   use spurflex_model_equations, only: equations_type
   use test_support, only: check, error_type
   implicit none
   private

   public :: find_answer, check_sound, check_orbit, must_settle, may_not_settle, asked

   !> Relative error asked of the solver [-].
   real(wp), parameter :: asked = 1.0e-4_wp

   !> A point has to be settled, or may have a status that says why it is not.
   logical, parameter :: must_settle = .true., may_not_settle = .false.

contains

   !> The answer at a point from the static equilibrium, within a minute.
   subroutine find_answer(equations, options, answer, position, velocity, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Options.
      type(solver_options), intent(in) :: options
      !> The answer.
      type(response), intent(out) :: answer
      !> Section of the motion.
      real(wp), allocatable, intent(out) :: position(:), velocity(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: longest = 60.0_wp
      type(solver_type), allocatable :: solver
      type(no_attendant) :: nobody
      real(wp) :: begin, end

      allocate (position(equations%n), velocity(equations%n), source=0.0_wp)
      call cpu_time(begin)
      allocate (solver)
      call new_solver(options, solver)
      call respond_one(solver, equations, position, velocity, nobody, answer)
      call cpu_time(end)
      call check(error, end - begin < longest, 'a point that takes more than a minute')
   end subroutine find_answer

   !> What every answer promises: a status, finite numbers where it is settled, extremes in their order.
   subroutine check_sound(answer, settles, name, error)
      !> The answer.
      type(response), intent(in) :: answer
      !> `must_settle` or `may_not_settle`.
      logical, intent(in) :: settles
      !> Name of the point.
      character(len=*), intent(in) :: name
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, answer%status /= status_missing, name//' has a status')
      if (allocated(error)) return
      if (settles) call check(error, answer%status, status_settled, name//', status')
      if (allocated(error)) return
      if (answer%status == status_diverged) return
      if (answer%status == status_settled) then
         call check(error, all(ieee_is_finite([answer%y1_amplitude, answer%y1_rms, answer%y1_max, answer%y1_min, &
                                               answer%bearing_deformation_max, answer%error_estimate, answer%lyapunov_exponent, &
                                               answer%lyapunov_error])), name//' has finite numbers')
         if (allocated(error)) return
         call check(error, answer%y1_rms <= answer%y1_amplitude*(1.0_wp + epsilon(1.0_wp)) .or. answer%motion > 1, &
                    name//', the root mean square is no larger than the amplitude')
         if (allocated(error)) return
      end if
      call check(error, answer%y1_max >= answer%y1_min, name//', extremes')
   end subroutine check_sound

   !> A periodic motion that is called settled is one of the equations: Runge-Kutta from its section comes back to it and has
   !> the same amplitude.
   subroutine check_orbit(equations, answer, position, velocity, method, name, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The answer.
      type(response), intent(in) :: answer
      !> Section of the motion.
      real(wp), intent(in) :: position(:), velocity(:)
      !> `integrator_...`, for the message.
      integer, intent(in) :: method
      !> Name of the point.
      character(len=*), intent(in) :: name
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The error asked, and what Runge-Kutta loses in steps over a border; measured 3e-5.
      real(wp), parameter :: tolerance = 1.0e-3_wp
      !> The step resolves the fastest mode, and the period.
      real(wp), parameter :: steps_per_unit = 2.0_wp
      integer, parameter :: fewest = 2048, most = 1000000, longest_orbit = 64, named = 100
      type(runge_kutta_type) :: runge
      real(wp), allocatable :: state(:), samples(:)
      real(wp) :: needed
      integer :: steps, periods, k

      periods = merge(answer%motion - named, answer%motion, answer%motion > named)
      if (answer%status /= status_settled .or. periods < 1 .or. periods > longest_orbit) return
      if (answer%motion > 8 .and. answer%motion < named) return
      needed = steps_per_unit*fastest_rate(equations)*2.0_wp*pi/equations%frequency
      steps = max(fewest, nint(min(needed, real(most, wp))))
      if (needed > real(most, wp)) return
      runge = new_runge_kutta(equations, steps)
      allocate (samples(0:periods*steps))
      state = [position, velocity]
      do k = 1, periods
         call runge%advance(state)
         samples((k - 1)*steps:k*steps) = runge%y1
      end do
      call check(error, answer%y1_amplitude, sampled_amplitude(samples), tolerance*answer%y1_amplitude, &
                 name//' with '//trim(method_names(method))//', '//to_text(periods)//'T')
   end subroutine check_orbit

   !> A bound of the eigenvalues: row sums of M^-1 C and of M^-1 K, mesh included [1/s].
   function fastest_rate(equations) result(rate)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The bound.
      real(wp) :: rate

      real(wp) :: unit(equations%n), damping(equations%n, equations%n), stiffness(equations%n, equations%n)
      integer :: j

      do j = 1, equations%n
         unit = 0.0_wp
         unit(j) = 1.0_wp
         damping(:, j) = solve(equations%mass, unit*equations%damping(j) &
                               + equations%mesh%damping*equations%direction*equations%direction(j))
         stiffness(:, j) = solve(equations%mass, unit*equations%stiffness(j) &
                                 + equations%mesh%mean_stiffness*equations%direction*equations%direction(j))
      end do
      rate = maxval(sum(abs(damping), 2)) + sqrt(maxval(sum(abs(stiffness), 2)))
   end function fastest_rate

end module answers
