!> Newmark's method on the paper's own equations, for results to compare with: absolute coordinates, torques as the load,
!> a dense system in every step, contact found by trying the three branches.
!>
!> It shares nothing with the integrator of the library but the matrices of `spurflex_model_paper`, which have their own
!> tests, and the excitation.
module paper_newmark
   use dense_solve, only: solve
   use spurflex_base_kinds, only: wp, pi
   use spurflex_model_mesh, only: mesh_force, mesh_stiffness, transmission_error, transmission_error_rate
   use spurflex_model_paper, only: damping_matrix, mass_matrix, mesh_direction, stiffness_matrix, torque_vector
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type, mesh_excitation, mesh_frequency, operating_point
   implicit none
   private

   public :: paper_motion, start_paper_motion, step_paper_motion

   !> A motion that is integrated.
   type :: paper_motion
      !> Coordinates x1, y1, th1, x2, y2, th2 [, xM, yM, thM], their rates and accelerations.
      real(wp), allocatable :: q(:), v(:), a(:)
      !> Mesh deflection.
      real(wp) :: delta = 0.0_wp
      !> No branch of the contact was consistent.
      logical :: failed = .false.
      !> Matrices M, C, K of the paper.
      real(wp), allocatable, private :: mass(:, :), damping(:, :), stiffness(:, :)
      !> g and T.
      real(wp), allocatable, private :: direction(:), torque(:)
      type(mesh_excitation), private :: mesh
      real(wp), private :: frequency = 1.0_wp
      !> Newmark's parameters, steps per mesh period, steps taken.
      real(wp), private :: beta = 0.25_wp, gamma = 0.5_wp
      integer, private :: steps_per_period = 1, steps = 0
   end type paper_motion

contains

   !> Begin at phase 0.
   subroutine start_paper_motion(motion, gears, box, load, point, q, v, steps_per_period, beta, gamma)
      !> The motion.
      type(paper_motion), intent(out) :: motion
      !> Gear pair.
      type(gear_pair), intent(in) :: gears
      !> Gearbox.
      type(gearbox), intent(in) :: box
      !> Torques.
      type(load_type), intent(in) :: load
      !> Operating point.
      type(operating_point), intent(in) :: point
      !> Coordinates and their rates.
      real(wp), intent(in) :: q(:), v(:)
      !> Steps per mesh period.
      integer, intent(in) :: steps_per_period
      !> Newmark's parameters.
      real(wp), intent(in) :: beta, gamma

      real(wp) :: rate

      motion%mass = mass_matrix(gears, box, point)
      motion%damping = damping_matrix(gears, box, point)
      motion%stiffness = stiffness_matrix(gears, box, point)
      motion%direction = mesh_direction(gears, point)
      motion%torque = torque_vector(load, point)
      motion%mesh = gears%mesh
      motion%frequency = mesh_frequency(gears%teeth_1, point%speed)
      motion%steps_per_period = steps_per_period
      motion%beta = beta
      motion%gamma = gamma
      motion%q = q
      motion%v = v
      motion%delta = dot_product(motion%direction, q) + transmission_error(motion%mesh, 0.0_wp)
      rate = dot_product(motion%direction, v) + motion%frequency*transmission_error_rate(motion%mesh, 0.0_wp)
      motion%a = solve(motion%mass, motion%torque - matmul(motion%damping, v) - matmul(motion%stiffness, q) &
                       - motion%direction*mesh_force(motion%mesh, 0.0_wp, motion%delta, rate))
   end subroutine start_paper_motion

   !> One step.
   subroutine step_paper_motion(motion)
      !> The motion.
      type(paper_motion), intent(inout) :: motion

      integer, parameter :: flanks(3) = [0, 1, -1]
      real(wp), allocatable :: system(:, :), right(:), outer(:, :), predicted(:), predicted_rate(:), a(:)
      real(wp) :: h, phase, k, e, e_rate, flank, delta
      integer :: i, n

      n = size(motion%q)
      h = 2.0_wp*pi/motion%frequency/real(motion%steps_per_period, wp)
      motion%steps = motion%steps + 1
      phase = 2.0_wp*pi*real(motion%steps, wp)/real(motion%steps_per_period, wp)
      k = mesh_stiffness(motion%mesh, phase)
      e = transmission_error(motion%mesh, phase)
      e_rate = motion%frequency*transmission_error_rate(motion%mesh, phase)

      associate (g => motion%direction, beta => motion%beta, gamma => motion%gamma, c => motion%mesh%damping, &
                 b => motion%mesh%half_backlash)
         outer = spread(g, 2, n)*spread(g, 1, n)
         predicted = motion%q + h*motion%v + (0.5_wp - beta)*h**2*motion%a
         predicted_rate = motion%v + (1.0_wp - gamma)*h*motion%a
         motion%failed = .true.
         do i = 1, size(flanks)
            flank = real(flanks(i), wp)
            system = motion%mass + gamma*h*(motion%damping + c*outer) &
                     + beta*h**2*(motion%stiffness + abs(flank)*k*outer)
            right = motion%torque - matmul(motion%damping, predicted_rate) - matmul(motion%stiffness, predicted) &
                    - g*(c*(dot_product(g, predicted_rate) + e_rate) &
                         + abs(flank)*k*(dot_product(g, predicted) + e - flank*b))
            a = solve(system, right)
            delta = dot_product(g, predicted + beta*h**2*a) + e
            if ((flanks(i) == 0 .and. abs(delta) > b) .or. (flanks(i) /= 0 .and. flank*delta < b)) cycle
            motion%failed = .false.
            exit
         end do
         motion%delta = delta
         motion%a = a
         motion%v = predicted_rate + gamma*h*a
         motion%q = predicted + beta*h**2*a
      end associate
   end subroutine step_paper_motion

end module paper_newmark
