!> Whether a motion repeats: sections at the mesh period, compared with earlier ones.
!>
!> The distance of two sections is measured in the energy norm that the diagonals of M and K and the mean mesh stiffness
!> give, so that every coordinate counts by what it does. A transient that decays by a factor r per period and moves the
!> section by d from one period to the next is still d/(1 - r) away from its limit. On a soft support r is close to one
!> and a small d proves little; the decay of the slowest mode of the linear system is therefore taken into account.
module spurflex_steady_section
   use spurflex_base_kinds, only: wp, pi
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: section_monitor, longest_period

   !> Longest motion looked for, in mesh periods.
   integer, parameter :: longest_period = 8

   !> Periods in a row over which a motion must repeat, and repeat no worse, before it is believed.
   integer, parameter :: confirmations = 4

   !> Relative distance that is round-off, whatever the tolerance.
   real(wp), parameter :: roundoff = 1.0e-12_wp

   !> Sections of one point.
   type :: section_monitor
      private
      !> Weights that turn the state into the square root of an energy, shape (2 n + 1).
      real(wp), allocatable :: weight(:)
      !> Gradient of the mesh deflection, shape (n).
      real(wp), allocatable :: direction(:)
      !> Weighted sections, latest last, shape (2 n + 1, 0:longest_period).
      real(wp), allocatable :: sections(:, :)
      !> Distance to each earlier section, now and at the last confirmation, shape (longest_period).
      real(wp) :: distance(longest_period) = 0.0_wp, previous(longest_period) = 0.0_wp
      !> Periods in a row in which the motion repeated, shape (longest_period).
      integer :: repeats(longest_period) = 0
      !> What is left of the slowest mode after a period.
      real(wp) :: slowest_decay = 0.0_wp
      !> Sections seen.
      integer :: seen = 0
   contains
      !> Begin with a point.
      procedure :: reset
      !> Take a section.
      procedure :: add
      !> The shortest period with which the motion repeats.
      procedure :: repeating
      !> Norm of the latest section.
      procedure :: size => latest_norm
   end type section_monitor

contains

   !> Begin with a point.
   pure subroutine reset(self, equations)
      !> Monitor.
      class(section_monitor), intent(inout) :: self
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations

      real(wp) :: inertia
      integer :: n, i

      n = equations%n
      if (allocated(self%weight)) deallocate (self%weight, self%direction, self%sections)
      allocate (self%weight(2*n + 1), self%direction(n))
      allocate (self%sections(2*n + 1, 0:longest_period), source=0.0_wp)
      do i = 1, n
         self%weight(i) = sqrt(equations%stiffness(i))
         self%weight(n + i) = sqrt(equations%mass(i, i))
      end do
      self%weight(2*n + 1) = sqrt(equations%mesh%mean_stiffness)
      self%direction = equations%direction
      self%repeats = 0
      self%distance = 0.0_wp
      self%previous = huge(1.0_wp)
      self%seen = 0
      ! A sprung coordinate alone decays with C/(2 M), or, overdamped, with K/C; the last one, p, has no spring of its own.
      self%slowest_decay = 0.0_wp
      do i = 1, n - 1
         inertia = equations%mass(i, i)
         self%slowest_decay = max(self%slowest_decay, exp(-2.0_wp*pi/equations%frequency &
                                                          *decay_rate(inertia, equations%damping(i), equations%stiffness(i))))
      end do
   end subroutine reset

   !> Decay rate of a damped oscillator [1/s].
   pure function decay_rate(mass, damping, stiffness) result(rate)
      !> Mass [kg], damping [N s/m] and stiffness [N/m].
      real(wp), intent(in) :: mass, damping, stiffness
      !> The smaller real part of its eigenvalues, sign changed; 0 without damping.
      real(wp) :: rate

      real(wp) :: discriminant

      rate = 0.5_wp*damping/mass
      discriminant = rate**2 - stiffness/mass
      if (discriminant > 0.0_wp) rate = (stiffness/mass)/(rate + sqrt(discriminant))
   end function decay_rate

   !> Take a section.
   pure subroutine add(self, position, velocity)
      !> Monitor.
      class(section_monitor), intent(inout) :: self
      !> Deviation from the static equilibrium, shape (n).
      real(wp), intent(in) :: position(:)
      !> Its rate, shape (n).
      real(wp), intent(in) :: velocity(:)

      integer :: n, k

      n = size(position)
      do k = 0, longest_period - 1
         self%sections(:, k) = self%sections(:, k + 1)
      end do
      self%sections(:, longest_period) = self%weight*[position, velocity, dot_product(self%direction, position)]
      self%seen = self%seen + 1
      if (mod(self%seen, confirmations) == 0) self%previous = self%distance
      do k = 1, min(longest_period, self%seen - 1)
         self%distance(k) = norm2(self%sections(:, longest_period) - self%sections(:, longest_period - k))
      end do
   end subroutine add

   !> The shortest period with which the motion repeats, 0 if it does not. Call it once after each section.
   pure subroutine repeating(self, tolerance, period)
      !> Monitor.
      class(section_monitor), intent(inout) :: self
      !> How near to its limit the motion must be, relative to its size.
      real(wp), intent(in) :: tolerance
      !> Period in mesh periods, 1..longest_period, or 0.
      integer, intent(out) :: period

      real(wp) :: scale, left
      integer :: k

      period = 0
      if (self%seen <= longest_period) return
      scale = 0.0_wp
      do k = 0, longest_period
         scale = max(scale, norm2(self%sections(:, k)))
      end do
      do k = 1, longest_period
         left = self%distance(k)/max(1.0_wp - self%slowest_decay**k, epsilon(1.0_wp))
         if ((left <= tolerance*scale .and. self%distance(k) <= self%previous(k)) &
             .or. self%distance(k) <= roundoff*scale) then
            self%repeats(k) = self%repeats(k) + 1
         else
            self%repeats(k) = 0
         end if
      end do
      if (all(self%repeats < confirmations)) return
      ! A motion that repeats after k periods may be on its way to one that repeats sooner: the shortest one counts.
      do k = longest_period, 1, -1
         if (self%distance(k) <= tolerance*scale) period = k
      end do
   end subroutine repeating
   end subroutine repeating

   !> Norm of the latest section [sqrt(J)]; not a number where the state is not.
   pure function latest_norm(self) result(norm)
      !> Monitor.
      class(section_monitor), intent(in) :: self
      !> Its energy norm.
      real(wp) :: norm

      norm = norm2(self%sections(:, longest_period))
   end function latest_norm

end module spurflex_steady_section
