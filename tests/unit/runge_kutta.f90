!> The classical Runge-Kutta method on the equations of motion, for results to compare with.
!>
!> It shares nothing with the integrators of the library: dense matrices, small steps, no branches, no modes. Where the
!> teeth part it is of order two to three, because a step knows nothing of the borders of the contact.
module runge_kutta
   use dense_solve, only: solve
   use spurflex_base_kinds, only: wp, pi
   use spurflex_model_equations, only: equations_type
   use spurflex_model_mesh, only: mesh_force, transmission_error, transmission_error_rate
   implicit none
   private

   public :: runge_kutta_type, new_runge_kutta, sampled_amplitude

   !> Stages of the method.
   integer, parameter :: stages = 4

   !> An operating point that is integrated; the state is the deviation from the static equilibrium, then its rate.
   type :: runge_kutta_type
      private
      !> Equations of motion.
      type(equations_type) :: equations
      !> M^-1, shape (n, n).
      real(wp), allocatable :: inverse_mass(:, :)
      !> Steps per mesh period.
      integer :: steps = 0
      !> y1 at the samples of the period last advanced, as a deviation from its static value, shape (0:steps) [m].
      real(wp), allocatable, public :: y1(:)
      !> Extremes of the mesh deflection over the period last advanced [m].
      real(wp), public :: smallest_deflection = 0.0_wp, largest_deflection = 0.0_wp
   contains
      !> Advance a state by one mesh period.
      procedure :: advance
   end type runge_kutta_type

contains

   !> Take an operating point.
   function new_runge_kutta(equations, steps) result(method)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The method.
      type(runge_kutta_type) :: method

      real(wp) :: unit(equations%n)
      integer :: i

      method%equations = equations
      method%steps = steps
      allocate (method%inverse_mass(equations%n, equations%n), method%y1(0:steps), source=0.0_wp)
      do i = 1, equations%n
         unit = 0.0_wp
         unit(i) = 1.0_wp
         method%inverse_mass(:, i) = solve(equations%mass, unit)
      end do
   end function new_runge_kutta

   !> Advance a state by one mesh period.
   subroutine advance(self, state)
      !> The method.
      class(runge_kutta_type), intent(inout) :: self
      !> Deviation and its rate, shape (2 n).
      real(wp), intent(inout) :: state(:)

      real(wp), parameter :: place(stages) = [0.0_wp, 0.5_wp, 0.5_wp, 1.0_wp]
      real(wp), parameter :: weight(stages) = [1.0_wp, 2.0_wp, 2.0_wp, 1.0_wp]/6.0_wp
      real(wp) :: h, deflection
      real(wp), dimension(size(state)) :: total, slope
      integer :: s, i, n

      n = self%equations%n
      h = 2.0_wp*pi/(self%equations%frequency*real(self%steps, wp))
      self%smallest_deflection = huge(1.0_wp)
      self%largest_deflection = -huge(1.0_wp)
      self%y1(0) = dot_product(self%equations%observation(1, :), state(:n))
      do s = 1, self%steps
         total = 0.0_wp
         slope = 0.0_wp
         do i = 1, stages
            slope = rate_of(self, 2.0_wp*pi*(real(s - 1, wp) + place(i))/real(self%steps, wp), &
                            state + place(i)*h*slope)
            total = total + weight(i)*slope
         end do
         state = state + h*total
         self%y1(s) = dot_product(self%equations%observation(1, :), state(:n))
         deflection = self%equations%static_deflection + dot_product(self%equations%direction, state(:n)) &
                      + transmission_error(self%equations%mesh, 2.0_wp*pi*real(s, wp)/real(self%steps, wp))
         self%smallest_deflection = min(self%smallest_deflection, deflection)
         self%largest_deflection = max(self%largest_deflection, deflection)
      end do
   end subroutine advance

   !> Rate of a state.
   pure function rate_of(self, phase, state) result(slope)
      !> The method.
      class(runge_kutta_type), intent(in) :: self
      !> Phase of the mesh [rad].
      real(wp), intent(in) :: phase
      !> Deviation and its rate, shape (2 n).
      real(wp), intent(in) :: state(:)
      !> Their rates.
      real(wp) :: slope(size(state))

      real(wp) :: force
      integer :: n

      n = self%equations%n
      associate (o => self%equations)
         force = mesh_force(o%mesh, phase, &
                            o%static_deflection + dot_product(o%direction, state(:n)) + transmission_error(o%mesh, phase), &
                            dot_product(o%direction, state(n + 1:)) + o%frequency*transmission_error_rate(o%mesh, phase))
         slope(:n) = state(n + 1:)
         slope(n + 1:) = -matmul(self%inverse_mass, o%damping*state(n + 1:) + o%stiffness*state(:n) &
                                 + o%direction*(force - o%mean_force))
      end associate
   end function rate_of

   !> Half the peak-to-peak of samples, with a parabola through the highest and through the lowest three.
   pure function sampled_amplitude(samples) result(amplitude)
      !> Samples over whole periods, the last one equal to the first, shape (samples).
      real(wp), intent(in) :: samples(:)
      !> The amplitude.
      real(wp) :: amplitude

      amplitude = 0.5_wp*(peak(samples) + peak(-samples))
   end function sampled_amplitude

   !> Largest value of samples.
   pure function peak(samples) result(largest)
      !> Samples over whole periods, shape (samples).
      real(wp), intent(in) :: samples(:)
      !> Vertex of the parabola through the largest and its neighbours.
      real(wp) :: largest

      real(wp) :: before, behind, curvature
      integer :: top, last

      last = size(samples)
      top = maxloc(samples, 1)
      before = samples(merge(last - 1, top - 1, top == 1))
      behind = samples(merge(2, top + 1, top == last))
      curvature = before - 2.0_wp*samples(top) + behind
      largest = samples(top)
      if (curvature < 0.0_wp) largest = largest - (behind - before)**2/(8.0_wp*curvature)
   end function peak

end module runge_kutta
