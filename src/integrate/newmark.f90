!> Newmark's method with a constant step, for any beta and gamma.
!>
!> With S = M + gamma dt C + beta dt^2 K, factorised once with LAPACK, a step is linear in the state w = [q, q'] and in
!> the mesh force at its two ends,
!>
!>     w_1 = A w_0 - (f_0 - F) b_0 - (f_1 - F) b_1
!>
!> and f_1 follows exactly from one scalar equation (`spurflex_integrate_contact`): no step iterates.
!> Reference: N. M. Newmark, J. Eng. Mech. Div. 85 (1959) 67.
module spurflex_integrate_newmark
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_external_lapack, only: invert_positive_definite
   use spurflex_integrate_contact, only: contact_force
   use spurflex_integrate_period_map, only: period_map, orbit_type, reserve_orbit
   use spurflex_model_equations, only: equations_type
   use spurflex_model_mesh, only: mesh_stiffness, transmission_error, transmission_error_rate
   use spurflex_model_modal, only: modal_system, new_modal_system, same_modes
   implicit none
   private

   public :: newmark_map

   !> Period map by Newmark's method. The state holds the deviation from the static equilibrium, then its rate.
   type, extends(period_map) :: newmark_map
      !> Newmark's parameters.
      real(wp) :: beta = 0.25_wp, gamma = 0.5_wp
      !> Equations of motion of the point.
      type(equations_type), private :: equations
      !> Modes of their linear part.
      type(modal_system), private :: modal
      !> The step: A, b_0, b_1; shapes (size, size) and (size).
      real(wp), allocatable, private :: carry(:, :), before(:), after(:)
      !> Rows that give the mesh deflection and its rate, shape (size, 2).
      real(wp), allocatable, private :: deflection_row(:, :)
      !> Rows that give what is recorded from the coordinates, shape (quantities, n).
      real(wp), allocatable, private :: recorded(:, :)
      !> Recorded accelerations from the state, shape (quantities, size), and from the mesh force, shape (quantities).
      real(wp), allocatable, private :: acceleration(:, :), acceleration_force(:)
      !> Mesh stiffness, delta_s + e_m and its rate at each step, shape (0:steps).
      real(wp), allocatable, private :: stiffness(:), deflection(:), deflection_rate(:)
   contains
      procedure :: load => load_newmark
      procedure :: advance => advance_newmark
      procedure :: to_state => state_from_coordinates
      procedure :: from_state => coordinates_from_state
      procedure :: deflection_bound => sum_of_moduli
   end type newmark_map

contains

   !> Take an operating point and a number of steps per period.
   subroutine load_newmark(self, equations, steps, error)
      !> Map.
      class(newmark_map), intent(inout) :: self
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Set where the mass or the effective matrix is not positive definite.
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: inverse_mass(:, :), inverse(:, :), effective(:, :)
      real(wp) :: dt, phase, reference
      integer :: n, i, s

      n = equations%n
      if (.not. same_modes(self%equations, equations)) then
         self%equations%n = 0
         call new_modal_system(equations, self%modal, error)
         if (allocated(error)) return
      end if
      self%equations = equations
      self%size = 2*n
      self%steps = steps
      self%half_backlash = equations%mesh%half_backlash
      self%period = 2.0_wp*pi/equations%frequency
      dt = self%period/real(steps, wp)
      call invert_positive_definite(equations%mass, inverse_mass, error)
      if (allocated(error)) return
      allocate (effective(n, n), source=equations%mass)
      do i = 1, n
         effective(i, i) = effective(i, i) + self%gamma*dt*equations%damping(i) + self%beta*dt**2*equations%stiffness(i)
      end do
      call invert_positive_definite(effective, inverse, error)
      if (allocated(error)) return
      call assemble_step(self, dt, inverse_mass, inverse)

      self%deflection_row = reshape([equations%direction, 0.0_wp*equations%direction, &
                                     0.0_wp*equations%direction, equations%direction], [2*n, 2])
      if (allocated(equations%recorded)) then
         self%recorded = equations%recorded
      else
         self%recorded = equations%observation
      end if
      self%acceleration_force = -matmul(self%recorded, matmul(inverse_mass, equations%direction))
      self%acceleration = -matmul(self%recorded, matmul(inverse_mass, diagonals(equations)))
      reference = sqrt(equations%mesh%mean_stiffness*dot_product(equations%direction, &
                                                                 matmul(inverse_mass, equations%direction)))
      self%weight = [abs(equations%direction), abs(equations%direction)/reference]
      do i = 1, n
         self%weight(i) = max(self%weight(i), maxval(abs(equations%observation(:, i))))
         self%weight(n + i) = max(self%weight(n + i), maxval(abs(equations%observation(:, i)))/reference)
      end do

      if (allocated(self%stiffness)) deallocate (self%stiffness, self%deflection, self%deflection_rate)
      allocate (self%stiffness(0:steps), self%deflection(0:steps), self%deflection_rate(0:steps))
      do s = 0, steps
         phase = 2.0_wp*pi*real(s, wp)/real(steps, wp)
         self%stiffness(s) = mesh_stiffness(equations%mesh, phase)
         self%deflection(s) = equations%static_deflection + transmission_error(equations%mesh, phase)
         self%deflection_rate(s) = equations%frequency*transmission_error_rate(equations%mesh, phase)
      end do
   end subroutine load_newmark

   !> [K, C] as a matrix that acts on the state.
   pure function diagonals(equations) result(matrix)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Shape (n, 2 n).
      real(wp), allocatable :: matrix(:, :)

      integer :: i

      allocate (matrix(equations%n, 2*equations%n), source=0.0_wp)
      do i = 1, equations%n
         matrix(i, i) = equations%stiffness(i)
         matrix(i, equations%n + i) = equations%damping(i)
      end do
   end function diagonals

   !> The linear map of one step.
   pure subroutine assemble_step(self, dt, inverse_mass, inverse)
      !> Map.
      class(newmark_map), intent(inout) :: self
      !> Time step [s].
      real(wp), intent(in) :: dt
      !> M^-1 and S^-1, shape (n, n).
      real(wp), intent(in) :: inverse_mass(:, :), inverse(:, :)

      real(wp) :: unit(self%size), zero(self%size)
      integer :: i

      if (allocated(self%carry)) deallocate (self%carry, self%before, self%after)
      allocate (self%carry(self%size, self%size), self%before(self%size), self%after(self%size))
      zero = 0.0_wp
      do i = 1, self%size
         unit = 0.0_wp
         unit(i) = 1.0_wp
         self%carry(:, i) = stepped(unit, 0.0_wp)
      end do
      self%before = -stepped(zero, 1.0_wp)
      self%after = [self%beta*dt**2*matmul(inverse, self%equations%direction), &
                    self%gamma*dt*matmul(inverse, self%equations%direction)]

   contains

      !> A state one step later, with a mesh force at the start and none at the end.
      pure function stepped(state, force) result(later)
         !> State at the start.
         real(wp), intent(in) :: state(:)
         !> Mesh force at the start, without its mean.
         real(wp), intent(in) :: force
         !> State at the end.
         real(wp) :: later(size(state))

         real(wp), dimension(size(state)/2) :: q, v, a

         q = state(:size(state)/2)
         v = state(size(state)/2 + 1:)
         associate (c => self%equations%damping, k => self%equations%stiffness, g => self%equations%direction)
            a = -matmul(inverse_mass, c*v + k*q + g*force)
            q = q + dt*v + (0.5_wp - self%beta)*dt**2*a
            v = v + (1.0_wp - self%gamma)*dt*a
            a = -matmul(inverse, c*v + k*q)
         end associate
         later = [q + self%beta*dt**2*a, v + self%gamma*dt*a]
      end function stepped

   end subroutine assemble_step

   !> Advance a state by one mesh period.
   subroutine advance_newmark(self, state, tangents, orbit)
      !> Map.
      class(newmark_map), intent(inout) :: self
      !> State at the section, shape (size).
      real(wp), intent(inout), contiguous :: state(:)
      !> Tangents that see the same contact, one in a row, shape (tangents, size).
      real(wp), intent(inout), optional, contiguous :: tangents(:, :)
      !> If present, the period is recorded.
      type(orbit_type), intent(inout), optional :: orbit

      real(wp) :: force, next, delta, rate, h_d, h_v, by_d, by_v, free(self%size)
      real(wp), allocatable :: tangent_force(:)
      integer :: s

      if (present(orbit)) then
         call reserve_orbit(orbit, self%steps, size(self%recorded, 1))
         orbit%piece = 1
      end if
      h_d = dot_product(self%deflection_row(:, 1), self%after)
      h_v = dot_product(self%deflection_row(:, 2), self%after)
      associate (mesh => self%equations%mesh, mean => self%equations%mean_force, row => self%deflection_row)
         delta = self%deflection(0) + dot_product(row(:, 1), state)
         rate = self%deflection_rate(0) + dot_product(row(:, 2), state)
         self%smallest_deflection = delta
         self%largest_deflection = delta
         call contact_force(delta, rate, self%stiffness(0), mesh%damping, mesh%half_backlash, 0.0_wp, 0.0_wp, force, by_d, by_v)
         if (present(tangents)) tangent_force = matmul(tangents, by_d*row(:, 1) + by_v*row(:, 2))
         if (present(orbit)) call record(self, 0, state, force - mean, orbit)
         do s = 1, self%steps
            free = matmul(self%carry, state) - (force - mean)*self%before
            delta = self%deflection(s) + dot_product(row(:, 1), free) + h_d*mean
            rate = self%deflection_rate(s) + dot_product(row(:, 2), free) + h_v*mean
            call contact_force(delta, rate, self%stiffness(s), mesh%damping, mesh%half_backlash, h_d, h_v, next, by_d, by_v)
            delta = delta - h_d*next
            self%smallest_deflection = min(self%smallest_deflection, delta)
            self%largest_deflection = max(self%largest_deflection, delta)
            state = free - (next - mean)*self%after
            if (present(tangents)) call carry_tangents(self, by_d, by_v, tangent_force, tangents)
            force = next
            if (present(orbit)) call record(self, s, state, force - mean, orbit)
         end do
      end associate
   end subroutine advance_newmark

   !> Carry tangents over a step.
   pure subroutine carry_tangents(self, by_d, by_v, force, tangents)
      !> Map.
      class(newmark_map), intent(in) :: self
      !> Derivatives of the mesh force by the deflection and the rate that the step has without it.
      real(wp), intent(in) :: by_d, by_v
      !> Mesh force of each tangent at the start before, at the end after, shape (tangents).
      real(wp), intent(inout) :: force(:)
      !> Tangents, one in a row, shape (tangents, size).
      real(wp), intent(inout) :: tangents(:, :)

      integer :: j

      tangents = matmul(tangents, transpose(self%carry))
      do j = 1, self%size
         tangents(:, j) = tangents(:, j) - force*self%before(j)
      end do
      force = matmul(tangents, by_d*self%deflection_row(:, 1) + by_v*self%deflection_row(:, 2))
      do j = 1, self%size
         tangents(:, j) = tangents(:, j) - force*self%after(j)
      end do
   end subroutine carry_tangents

   !> Record one sample.
   pure subroutine record(self, sample, state, force, orbit)
      !> Map.
      class(newmark_map), intent(in) :: self
      !> Sample, 0..steps.
      integer, intent(in) :: sample
      !> State, shape (size).
      real(wp), intent(in) :: state(:)
      !> Mesh force without its mean [N].
      real(wp), intent(in) :: force
      !> Where to.
      type(orbit_type), intent(inout) :: orbit

      integer :: n

      n = self%equations%n
      orbit%samples = sample
      orbit%time(sample) = self%period*real(sample, wp)/real(self%steps, wp)
      orbit%weight(sample) = merge(0.5_wp, 1.0_wp, sample == 0 .or. sample == self%steps)/real(self%steps, wp)
      orbit%value(:, sample) = matmul(self%recorded, state(:n))
      orbit%rate(:, sample) = matmul(self%recorded, state(n + 1:))
      orbit%acceleration(:, sample) = matmul(self%acceleration, state) + self%acceleration_force*force
   end subroutine record

   !> The state from the coordinates of the equations of motion.
   pure function state_from_coordinates(self, position, velocity) result(state)
      !> Map.
      class(newmark_map), intent(in) :: self
      !> Deviation from the static equilibrium, shape (n).
      real(wp), intent(in) :: position(:)
      !> Its rate, shape (n).
      real(wp), intent(in) :: velocity(:)
      !> State, shape (size).
      real(wp), allocatable :: state(:)

      allocate (state(self%size))
      state(:size(position)) = position
      state(size(position) + 1:) = velocity
   end function state_from_coordinates

   !> The coordinates of the equations of motion from the state.
   pure subroutine coordinates_from_state(self, state, position, velocity)
      !> Map.
      class(newmark_map), intent(in) :: self
      !> State, shape (size).
      real(wp), intent(in) :: state(:)
      !> Deviation from the static equilibrium, shape (n).
      real(wp), allocatable, intent(out) :: position(:)
      !> Its rate, shape (n).
      real(wp), allocatable, intent(out) :: velocity(:)

      position = state(:self%equations%n)
      velocity = state(self%equations%n + 1:)
   end subroutine coordinates_from_state

   !> Bound of what a difference of states does to the mesh deflection.
   pure function sum_of_moduli(self, difference) result(bound)
      !> Map.
      class(newmark_map), intent(in) :: self
      !> Difference of two states, shape (size).
      real(wp), intent(in) :: difference(:)
      !> Sum of the moduli of its modes [m].
      real(wp) :: bound

      bound = sum(abs(matmul(self%modal%to_modes, cmplx(difference, 0.0_wp, wp))))
   end function sum_of_moduli

end module spurflex_integrate_newmark
