!> Exponential collocation: order eight, with every crossing of the contact borders located.
!>
!> The modes of the linear part are carried exactly; the one scalar that drives them is collocated at five Lobatto points a
!> step (`spurflex_integrate_exponential`). Between two crossings the mesh is on one branch, N_i = alpha_i x_i + gamma_i at
!> every point, so that a step is one small linear system and nothing iterates. A step in which the deflection leaves its
!> branch is cut at the crossing.
module spurflex_integrate_collocation
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_branch, only: branch_of, first_crossing, refine_crossing, most_crossings
   use spurflex_integrate_collocation_step, only: carry_state, carry_tangents, solve_step
   use spurflex_integrate_exponential, only: step_coefficients, set_step, nodes
   use spurflex_integrate_mesh_table, only: mesh_points, set_mesh_points
   use spurflex_integrate_period_map, only: period_map, orbit_type, reserve_orbit
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system, new_modal_system, same_modes, to_modes, from_modes, &
      sum_of_moduli
   implicit none
   private

   public :: collocation_map

   !> Weights of the Lobatto points in an integral over the step.
   real(wp), parameter :: quadrature(nodes) = [0.05_wp, 49.0_wp/180.0_wp, 16.0_wp/45.0_wp, 49.0_wp/180.0_wp, 0.05_wp]

   !> Distance from the border, beside the static deflection, at which a crossing counts as located: the mesh force is continuous
   !> there, so that its error is the square of this.
   real(wp), parameter :: tolerated_miss = 1.0e-6_wp

   !> Period map by exponential collocation. The state holds the real parts of the modes, then the imaginary parts.
   type, extends(period_map) :: collocation_map
      private
      !> Equations of motion of the point.
      type(equations_type) :: equations
      !> Their modes.
      type(modal_system), public :: modal
      !> A whole step, the two parts of a step that is cut.
      type(step_coefficients) :: whole, part
      !> Mesh at the points of every whole step, shape (steps).
      type(mesh_points), allocatable :: table(:)
      !> What is recorded is the real part of this times the modes, shape (modes, quantities).
      complex(wp), allocatable :: recorded(:, :)
   contains
      procedure :: load => load_collocation
      procedure :: advance => advance_collocation
      procedure :: to_state => modes_from_coordinates
      procedure :: from_state => coordinates_from_modes
      procedure :: deflection_bound => bound_of_modes
   end type collocation_map

contains

   !> Take an operating point and a number of steps per period.
   subroutine load_collocation(self, equations, steps, error)
      !> Map.
      class(collocation_map), intent(inout) :: self
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Set where the modes cannot be found.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: h
      integer :: s

      if (.not. same_modes(self%equations, equations)) then
         self%equations%n = 0
         call new_modal_system(equations, self%modal, error)
         if (allocated(error)) return
         self%roundoff = self%modal%roundoff
         self%whole = step_coefficients()
         self%part = step_coefficients()
         self%size = 2*self%modal%modes
         self%weight = self%modal%weight
      end if
      self%equations = equations
      if (allocated(equations%recorded)) then
         self%recorded = transpose(matmul(equations%recorded, self%modal%from_modes(:equations%n, :)))
      else
         self%recorded = transpose(self%modal%observation)
      end if
      self%half_backlash = equations%mesh%half_backlash
      self%period = 2.0_wp*pi/equations%frequency
      h = self%period/real(steps, wp)
      call set_step(self%modal, h, self%whole, inner=.true.)
      if (steps /= self%steps .or. .not. allocated(self%table)) then
         if (allocated(self%table)) deallocate (self%table)
         allocate (self%table(steps))
      end if
      self%steps = steps
      do s = 1, steps
         call set_mesh_points(equations, h*real(s - 1, wp), h, self%table(s))
      end do
   end subroutine load_collocation

   !> Advance a state by one mesh period.
   subroutine advance_collocation(self, state, tangents, orbit)
      !> Map.
      class(collocation_map), intent(inout) :: self
      !> State at the section, shape (size).
      real(wp), intent(inout), contiguous :: state(:)
      !> Tangents that see the same contact, one in a row, shape (tangents, size).
      real(wp), intent(inout), optional, contiguous :: tangents(:, :)
      !> If present, the period is recorded.
      type(orbit_type), intent(inout), optional :: orbit

      type(mesh_points) :: mesh
      real(wp) :: force(nodes), shift(nodes), alpha(nodes), start, h, cut
      integer :: branch, next, s, crossings
      logical :: is_cut

      h = self%whole%length
      self%smallest_deflection = huge(1.0_wp)
      self%largest_deflection = -huge(1.0_wp)
      if (present(orbit)) then
         call reserve_orbit(orbit, self%steps*(most_crossings + 1)*(nodes - 1), size(self%recorded, 2))
         orbit%samples = 0
         orbit%piece = nodes - 1
         orbit%weight = 0.0_wp
      end if
      branch = branch_of(self%table(1)%deflection(1) + sum(state(:self%modal%modes)), self%half_backlash)
      do s = 1, self%steps
         call solve_step(self%whole, self%table(s), branch, state, alpha, force, shift)
         is_cut = .false.
         if (leaves(branch)) then
            is_cut = .true.
            start = 0.0_wp
            mesh = self%table(s)
            do crossings = 1, most_crossings
               call first_crossing(branch, mesh%deflection + shift, self%half_backlash, cut, next)
               if (next == branch) exit
               call cut_at_crossing()
               branch = next
               start = start + self%part%length
               if (start >= h*(1.0_wp - epsilon(1.0_wp))) exit
               call set_step(self%modal, h - start, self%part, inner=present(orbit))
               call set_mesh_points(self%equations, h*real(s - 1, wp) + start, h - start, mesh)
               call solve_step(self%part, mesh, branch, state, alpha, force, shift)
            end do
            if (start < h*(1.0_wp - epsilon(1.0_wp))) call commit(self%part, mesh)
         end if
         if (.not. is_cut) call commit(self%whole, self%table(s))
      end do

   contains

      !> The deflection may leave its branch within the step that was just solved.
      logical function leaves(branch)
         !> Branch.
         integer, intent(in) :: branch

         real(wp) :: where_left
         integer :: reached

         call first_crossing(branch, self%table(s)%deflection + shift, self%half_backlash, where_left, reached)
         leaves = reached /= branch
      end function leaves

      !> Find the crossing exactly, commit the part of the step before it.
      subroutine cut_at_crossing()
         real(wp) :: whole_length, miss
         integer :: tries
         integer, parameter :: most_tries = 3

         whole_length = merge(h, h - start, start <= 0.0_wp)
         cut = cut*whole_length
         do tries = 1, most_tries
            call set_step(self%modal, cut, self%part, inner=present(orbit))
            call set_mesh_points(self%equations, h*real(s - 1, wp) + start, cut, mesh)
            call solve_step(self%part, mesh, branch, state, alpha, force, shift)
            call refine_crossing(branch, next, mesh%deflection + shift, self%half_backlash, whole_length, cut, miss)
            if (abs(miss) <= tolerated_miss*max(abs(self%equations%static_deflection), self%half_backlash)) exit
         end do
         call commit(self%part, mesh)
      end subroutine cut_at_crossing

      !> Carry the state, and the tangents, over the step that was just solved.
      subroutine commit(step, mesh)
         !> Coefficients.
         type(step_coefficients), intent(in) :: step
         !> Mesh at its points.
         type(mesh_points), intent(in) :: mesh

         self%smallest_deflection = min(self%smallest_deflection, minval(mesh%deflection + shift))
         self%largest_deflection = max(self%largest_deflection, maxval(mesh%deflection + shift))
         if (present(tangents)) call carry_tangents(step, alpha, tangents)
         if (present(orbit)) call record(self%modal, self%recorded, step, mesh%time, self%period, state, force, orbit)
         call carry_state(step, force, nodes, state)
      end subroutine commit

   end subroutine advance_collocation

   !> Record the points of a step; the first one of the period too.
   pure subroutine record(modal, recorded, step, time, period, state, force, orbit)
      !> The modes.
      type(modal_system), intent(in) :: modal
      !> What is recorded of them, shape (modes, quantities).
      complex(wp), intent(in), contiguous :: recorded(:, :)
      !> Coefficients.
      type(step_coefficients), intent(in) :: step
      !> Time of each point since the section [s].
      real(wp), intent(in) :: time(nodes)
      !> Mesh period [s].
      real(wp), intent(in) :: period
      !> State at the start of the step.
      real(wp), intent(in), contiguous :: state(:)
      !> N at each point.
      real(wp), intent(in) :: force(nodes)
      !> Where to.
      type(orbit_type), intent(inout) :: orbit

      real(wp) :: at_point(size(state))
      complex(wp) :: z(modal%modes), dz(modal%modes), d2z(modal%modes)
      integer :: i, q, last, m

      m = modal%modes
      do i = merge(1, 2, orbit%samples == 0), nodes
         at_point = state
         if (i > 1) then
            call carry_state(step, force, i, at_point)
            orbit%samples = orbit%samples + 1
         end if
         last = orbit%samples
         z = cmplx(at_point(:m), at_point(m + 1:), wp)
         dz = modal%rate*z - modal%influence*force(i)
         orbit%time(last) = time(i)
         ! The rate of N does not reach the acceleration of a position.
         d2z = modal%rate*dz
         do q = 1, size(recorded, 2)
            orbit%value(q, last) = sum(real(recorded(:, q), wp)*real(z, wp) - aimag(recorded(:, q))*aimag(z))
            orbit%rate(q, last) = sum(real(recorded(:, q), wp)*real(dz, wp) - aimag(recorded(:, q))*aimag(dz))
            orbit%acceleration(q, last) = sum(real(recorded(:, q), wp)*real(d2z, wp) - aimag(recorded(:, q))*aimag(d2z))
         end do
      end do
      last = orbit%samples
      orbit%weight(last - nodes + 1:last) = orbit%weight(last - nodes + 1:last) + quadrature*step%length/period
   end subroutine record

   !> The modes from the coordinates of the equations of motion.
   pure function modes_from_coordinates(self, position, velocity) result(state)
      !> Map.
      class(collocation_map), intent(in) :: self
      !> Deviation from the static equilibrium, shape (n).
      real(wp), intent(in) :: position(:)
      !> Its rate, shape (n).
      real(wp), intent(in) :: velocity(:)
      !> State, shape (size).
      real(wp), allocatable :: state(:)

      state = to_modes(self%modal, position, velocity)
   end function modes_from_coordinates

   !> The coordinates of the equations of motion from the modes.
   pure subroutine coordinates_from_modes(self, state, position, velocity)
      !> Map.
      class(collocation_map), intent(in) :: self
      !> State, shape (size).
      real(wp), intent(in) :: state(:)
      !> Deviation from the static equilibrium, shape (n).
      real(wp), allocatable, intent(out) :: position(:)
      !> Its rate, shape (n).
      real(wp), allocatable, intent(out) :: velocity(:)

      call from_modes(self%modal, state, position, velocity)
   end subroutine coordinates_from_modes

   !> Bound of what a difference of states does to the mesh deflection.
   pure function bound_of_modes(self, difference) result(bound)
      !> Map.
      class(collocation_map), intent(in) :: self
      !> Difference of two states, shape (size).
      real(wp), intent(in) :: difference(:)
      !> Sum of the moduli of its modes [m].
      real(wp) :: bound

      bound = sum_of_moduli(difference(:self%size))
   end function bound_of_modes

end module spurflex_integrate_collocation
