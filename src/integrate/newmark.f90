!> Newmark's method with a constant step, many points side by side.
!>
!> With S = M + gamma dt C + beta dt^2 K the acceleration at the end of a step without mesh force is -S^-1 (C v~ + K q~),
!> with v~ and q~ the usual predictors; the mesh force then follows exactly from one scalar equation
!> (`spurflex_integrate_contact`) and enters through S^-1 g alone. S is factorised once per point, no step iterates.
!> Reference: N. M. Newmark, J. Eng. Mech. Div. 85 (1959) 67.
module spurflex_integrate_newmark
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_external_lapack, only: invert_positive_definite
   use spurflex_integrate_contact, only: contact_force
   use spurflex_integrate_lanes, only: integrator_type, trajectory_type, lanes, observables
   use spurflex_integrate_options, only: solver_options
   use spurflex_model_equations, only: equations_type, flexible_dof
   use spurflex_model_mesh, only: mesh_force, mesh_stiffness, transmission_error, transmission_error_rate
   implicit none
   private

   public :: newmark_type, new_newmark

   !> Degrees of freedom in the arrays: a rigid support leaves some idle, at zero, so that one kernel serves both.
   integer, parameter :: padded = flexible_dof

   !> Newmark's method on `lanes` points.
   type, extends(integrator_type) :: newmark_type
      private
      !> Newmark's parameters.
      real(wp) :: beta = 0.0_wp, gamma = 0.0_wp
      !> Mesh stiffness, static transmission error and its derivative by the phase at each step, shape (0:samples).
      real(wp), allocatable :: table_stiffness(:), table_error(:), table_error_rate(:)
      !> Mesh damping and half of the backlash, the same in all lanes.
      real(wp) :: mesh_damping = 0.0_wp, half_backlash = 0.0_wp
      !> Observation rows, the same in all lanes, shape (observables, n).
      real(wp), allocatable :: observation(:, :)
      !> Gradient of the mesh deflection, the same in all lanes, shape (n).
      real(wp), allocatable :: direction(:)
      !> S^-1, shape (lanes, n, n), and S^-1 g, shape (lanes, n).
      real(wp), allocatable :: inverse(:, :, :), response(:, :)
      !> Diagonals of C and K, shape (lanes, n).
      real(wp), allocatable :: damping(:, :), stiffness(:, :)
      !> Acceleration at the section, shape (lanes, n).
      real(wp), allocatable :: acceleration(:, :)
      !> Time step, mesh frequency, mean mesh force, static deflection, what a unit force takes from delta and its rate.
      real(wp), dimension(lanes) :: step = 1.0_wp, frequency = 1.0_wp, mean_force = 0.0_wp, static_deflection = 0.0_wp, &
         taken_deflection = 0.0_wp, taken_rate = 0.0_wp
   contains
      procedure :: load => load_newmark
      procedure :: advance => advance_newmark
   end type newmark_type

contains

   !> An integrator without points: every lane is at rest until it is loaded.
   pure function new_newmark(equations, options) result(integrator)
      !> Equations of any point of the case; degrees of freedom, mesh and observation are the same for all.
      type(equations_type), intent(in) :: equations
      !> Steps per period, beta and gamma.
      type(solver_options), intent(in) :: options
      !> The integrator.
      type(newmark_type) :: integrator

      integer :: n, s, steps
      real(wp) :: phase

      n = equations%n
      steps = options%steps_per_period
      integrator%n = n
      integrator%samples = steps
      integrator%beta = options%newmark_beta
      integrator%gamma = options%newmark_gamma
      integrator%mesh_damping = equations%mesh%damping
      integrator%half_backlash = equations%mesh%half_backlash
      integrator%observation = equations%observation
      allocate (integrator%direction(padded), source=0.0_wp)
      integrator%direction(:n) = equations%direction
      allocate (integrator%table_stiffness(0:steps), integrator%table_error(0:steps), integrator%table_error_rate(0:steps))
      do s = 0, steps
         phase = 2.0_wp*pi*real(s, wp)/real(steps, wp)
         integrator%table_stiffness(s) = mesh_stiffness(equations%mesh, phase)
         integrator%table_error(s) = transmission_error(equations%mesh, phase)
         integrator%table_error_rate(s) = transmission_error_rate(equations%mesh, phase)
      end do
      allocate (integrator%inverse(lanes, padded, padded), source=0.0_wp)
      allocate (integrator%response(lanes, padded), integrator%damping(lanes, padded), integrator%stiffness(lanes, padded), &
         integrator%position(lanes, padded), integrator%velocity(lanes, padded), integrator%acceleration(lanes, padded), &
         source=0.0_wp)
   end function new_newmark

   !> Put a point into a lane: factorise its effective matrix, find its acceleration at the section.
   subroutine load_newmark(self, lane, equations, position, velocity, error)
      !> Integrator.
      class(newmark_type), intent(inout) :: self
      !> Lane, 1..lanes.
      integer, intent(in) :: lane
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium at phase 0, shape (n).
      real(wp), intent(in) :: position(:)
      !> Its rate, shape (n).
      real(wp), intent(in) :: velocity(:)
      !> Set where the mass or the effective matrix is not positive definite.
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: effective(:, :), inverse(:, :), inverse_mass(:, :)
      real(wp) :: dt, delta, rate, force
      integer :: i, n

      n = self%n
      self%period(lane) = 2.0_wp*pi/equations%frequency
      dt = self%period(lane)/real(self%samples, wp)
      effective = equations%mass
      do i = 1, self%n
         effective(i, i) = effective(i, i) + self%gamma*dt*equations%damping(i) + self%beta*dt**2*equations%stiffness(i)
      end do
      call invert_positive_definite(effective, inverse, error)
      if (allocated(error)) return
      call invert_positive_definite(equations%mass, inverse_mass, error)
      if (allocated(error)) return

      self%step(lane) = dt
      self%frequency(lane) = equations%frequency
      self%mean_force(lane) = equations%mean_force
      self%static_deflection(lane) = equations%static_deflection
      self%inverse(lane, :n, :n) = inverse
      self%response(lane, :n) = matmul(inverse, equations%direction)
      self%damping(lane, :n) = equations%damping
      self%stiffness(lane, :n) = equations%stiffness
      self%taken_deflection(lane) = self%beta*dt**2*dot_product(equations%direction, self%response(lane, :n))
      self%taken_rate(lane) = self%gamma*dt*dot_product(equations%direction, self%response(lane, :n))

      self%position(lane, :n) = position
      self%velocity(lane, :n) = velocity
      delta = equations%static_deflection + self%table_error(0) + dot_product(equations%direction, position)
      rate = equations%frequency*self%table_error_rate(0) + dot_product(equations%direction, velocity)
      force = mesh_force(equations%mesh, 0.0_wp, delta, rate)
      self%acceleration(lane, :n) = -matmul(inverse_mass, equations%damping*velocity + equations%stiffness*position &
                                           + equations%direction*(force - equations%mean_force))
   end subroutine load_newmark

   !> Advance every lane by one mesh period.
   subroutine advance_newmark(self, trajectory)
      !> Integrator.
      class(newmark_type), intent(inout) :: self
      !> If present, the period is recorded.
      type(trajectory_type), intent(inout), optional :: trajectory

      integer :: s

      self%smallest_deflection = huge(1.0_wp)
      self%largest_deflection = -huge(1.0_wp)
      if (present(trajectory)) then
         call record(self, 0, trajectory)
         do s = 1, self%samples
            call advance_steps(self, s, s)
            call record(self, s, trajectory)
         end do
      else
         call advance_steps(self, 1, self%samples)
      end if
   end subroutine advance_newmark

   !> Advance every lane over some steps of the period.
   subroutine advance_steps(self, first, last)
      !> Integrator.
      class(newmark_type), intent(inout) :: self
      !> First and last step, 1..samples.
      integer, intent(in) :: first, last

      call run_steps(first, last, self%position, self%velocity, self%acceleration, self%inverse, &
         self%response, self%damping, self%stiffness, self%direction, self%step, self%beta, self%gamma, &
         self%table_stiffness(first:last), self%table_error(first:last), self%table_error_rate(first:last), &
         self%mesh_damping, self%half_backlash, self%static_deflection, self%frequency, self%mean_force, &
         self%taken_deflection, self%taken_rate, self%smallest_deflection, self%largest_deflection)
   end subroutine advance_steps

   !> The steps themselves. The innermost loops run over the lanes, whose number is fixed, so that they become vector
   !> instructions; a row of S^-1 is written out to keep its sum in a register.
   pure subroutine run_steps(first, last, q, v, a, inverse, response, damping, stiffness, direction, dt, beta, gamma, &
                             k_mesh, error, error_rate, c_mesh, half_backlash, static_deflection, frequency, mean_force, &
                             h_d, h_v, smallest, largest)
      !> First and last step.
      integer, intent(in) :: first, last
      !> Deviation, its rate and its acceleration.
      real(wp), intent(inout) :: q(lanes, padded), v(lanes, padded), a(lanes, padded)
      !> S^-1, S^-1 g, diagonals of C and K.
      real(wp), intent(in) :: inverse(lanes, padded, padded), response(lanes, padded), damping(lanes, padded), &
         stiffness(lanes, padded)
      !> Gradient of the mesh deflection.
      real(wp), intent(in) :: direction(padded)
      !> Time step; Newmark's parameters.
      real(wp), intent(in) :: dt(lanes), beta, gamma
      !> Mesh stiffness, e_m and its derivative by the phase at the end of each step.
      real(wp), intent(in) :: k_mesh(first:last), error(first:last), error_rate(first:last)
      !> Mesh damping, half of the backlash.
      real(wp), intent(in) :: c_mesh, half_backlash
      !> Static mesh deflection, mesh frequency, mean mesh force.
      real(wp), intent(in) :: static_deflection(lanes), frequency(lanes), mean_force(lanes)
      !> What a unit mesh force takes from the deflection and its rate.
      real(wp), intent(in) :: h_d(lanes), h_v(lanes)
      !> Extremes of the mesh deflection so far.
      real(wp), intent(inout) :: smallest(lanes), largest(lanes)

      real(wp), dimension(lanes) :: delta, rate, force
      real(wp) :: load(lanes, padded), free(lanes, padded), total
      integer :: i, l, s

      do s = first, last
         do i = 1, padded
            do l = 1, lanes
               q(l, i) = q(l, i) + dt(l)*(v(l, i) + (0.5_wp - beta)*dt(l)*a(l, i))
               v(l, i) = v(l, i) + (1.0_wp - gamma)*dt(l)*a(l, i)
               load(l, i) = -damping(l, i)*v(l, i) - stiffness(l, i)*q(l, i)
            end do
         end do
         do l = 1, lanes
            delta(l) = static_deflection(l) + error(s) + h_d(l)*mean_force(l)
            rate(l) = frequency(l)*error_rate(s) + h_v(l)*mean_force(l)
         end do
         do i = 1, padded
            do l = 1, lanes
               total = inverse(l, 1, i)*load(l, 1)
               total = total + inverse(l, 2, i)*load(l, 2)
               total = total + inverse(l, 3, i)*load(l, 3)
               total = total + inverse(l, 4, i)*load(l, 4)
               total = total + inverse(l, 5, i)*load(l, 5)
               total = total + inverse(l, 6, i)*load(l, 6)
               total = total + inverse(l, 7, i)*load(l, 7)
               total = total + inverse(l, 8, i)*load(l, 8)
               free(l, i) = total
            end do
            do l = 1, lanes
               delta(l) = delta(l) + direction(i)*(q(l, i) + beta*dt(l)*dt(l)*free(l, i))
               rate(l) = rate(l) + direction(i)*(v(l, i) + gamma*dt(l)*free(l, i))
            end do
         end do
         call contact_force(delta, rate, k_mesh(s), c_mesh, half_backlash, h_d, h_v, force)
         do l = 1, lanes
            delta(l) = delta(l) - h_d(l)*force(l)
            smallest(l) = min(smallest(l), delta(l))
            largest(l) = max(largest(l), delta(l))
            force(l) = force(l) - mean_force(l)
         end do
         do i = 1, padded
            do l = 1, lanes
               a(l, i) = free(l, i) - response(l, i)*force(l)
               v(l, i) = v(l, i) + gamma*dt(l)*a(l, i)
               q(l, i) = q(l, i) + beta*dt(l)*dt(l)*a(l, i)
            end do
         end do
      end do
   end subroutine run_steps

   !> Record the observed quantities of every lane.
   pure subroutine record(self, sample, trajectory)
      !> Integrator.
      class(newmark_type), intent(in) :: self
      !> Sample, 0..samples.
      integer, intent(in) :: sample
      !> Where to.
      type(trajectory_type), intent(inout) :: trajectory

      integer :: i, k

      trajectory%value(:, :, sample) = 0.0_wp
      trajectory%rate(:, :, sample) = 0.0_wp
      do i = 1, self%n
         do k = 1, observables
            trajectory%value(:, k, sample) = trajectory%value(:, k, sample) + self%observation(k, i)*self%position(:, i)
            trajectory%rate(:, k, sample) = trajectory%rate(:, k, sample) + self%observation(k, i)*self%velocity(:, i)
         end do
      end do
   end subroutine record

end module spurflex_integrate_newmark
