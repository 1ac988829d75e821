!> The latest sections of a motion at the mesh period, and how nearly they repeat.
module spurflex_steady_sections
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: section_ring, longest_period, weighted_norm, find_norms

   !> Longest motion looked for, in mesh periods.
   integer, parameter :: longest_period = 64

   !> Sections that there is room for at first: most motions are found before there are more.
   integer, parameter :: first_room = 16

   !> The latest sections.
   type :: section_ring
      private
      !> Weight of each component, shape (size).
      real(wp), allocatable :: weight(:)
      !> Sections, the k-th that was taken in column mod(k - 1, room), shape (size, 0:room - 1). Those that are asked for were taken
      !> one mesh period after the other.
      real(wp), allocatable :: sections(:, :)
      !> Norm of each of them [m].
      real(wp) :: norms(0:longest_period) = 0.0_wp
      !> Sections taken.
      integer :: seen = 0
   contains
      !> Begin with a motion.
      procedure :: reset
      !> Take a section.
      procedure :: add
      !> How nearly the motion repeats after some periods.
      procedure :: distance
      !> Where the motion goes from return to return.
      procedure :: return_direction
      !> How large the motion is.
      procedure :: scale => largest_norm
   end type section_ring

contains

   !> Begin with a motion.
   pure subroutine reset(self, weight)
      !> Ring.
      class(section_ring), intent(inout) :: self
      !> Weight of each component of the state, shape (size).
      real(wp), intent(in) :: weight(:)

      self%weight = weight
      if (allocated(self%sections)) deallocate (self%sections)
      allocate (self%sections(size(weight), 0:first_room - 1))
      self%seen = 0
   end subroutine reset

   !> Take a section.
   pure subroutine add(self, state, norm)
      !> Ring.
      class(section_ring), intent(inout) :: self
      !> State at the section, shape (size).
      real(wp), intent(in) :: state(:)
      !> Its norm, if it is known [m].
      real(wp), intent(in), optional :: norm

      integer :: place

      if (self%seen == size(self%sections, 2) .and. self%seen <= longest_period) call make_room(self)
      place = mod(self%seen, size(self%sections, 2))
      self%sections(:, place) = state
      if (present(norm)) then
         self%norms(place) = norm
      else
         self%norms(place) = weighted_norm(self%weight, state)
      end if
      self%seen = self%seen + 1
   end subroutine add

   !> Make room for as many sections as are ever asked for.
   pure subroutine make_room(self)
      !> Ring, full for the first time.
      type(section_ring), intent(inout) :: self

      real(wp), allocatable :: sections(:, :)

      call move_alloc(self%sections, sections)
      allocate (self%sections(size(self%weight), 0:longest_period))
      self%sections(:, 0:self%seen - 1) = sections
   end subroutine make_room

   !> Weighted distance of the latest section from the one some periods ago [m].
   pure function distance(self, periods)
      !> Ring.
      class(section_ring), intent(in) :: self
      !> Mesh periods.
      integer, intent(in) :: periods
      !> The distance; huge if there is no such section yet.
      real(wp) :: distance

      distance = huge(1.0_wp)
      if (periods > min(longest_period, self%seen - 1)) return
      distance = weighted_norm(self%weight, self%sections(:, column(self, 0)) - self%sections(:, column(self, periods)))
   end function distance

   !> Unit vector from the nearest of the earlier sections to the latest one, shape (size): on a torus nearly a tangent of it, near
   !> a periodic motion nearly the direction in which the transient decays last. Zero where there is no earlier one, or the same.
   pure function return_direction(self) result(direction)
      !> Ring.
      class(section_ring), intent(in) :: self
      !> The direction.
      real(wp) :: direction(size(self%weight))

      integer :: nearest, k

      direction = 0.0_wp
      if (self%seen < 2) return
      nearest = 1
      do k = 2, longest_period
         if (self%distance(k) < self%distance(nearest)) nearest = k
      end do
      direction = self%sections(:, column(self, 0)) - self%sections(:, column(self, nearest))
      direction = direction/max(weighted_norm(self%weight, direction), tiny(1.0_wp))
   end function return_direction

   !> Largest norm among the sections [m].
   pure function largest_norm(self) result(norm)
      !> Ring.
      class(section_ring), intent(in) :: self
      !> The norm.
      real(wp) :: norm

      norm = 0.0_wp
      if (self%seen > 0) norm = maxval(self%norms(:min(longest_period, self%seen - 1)))
   end function largest_norm

   !> Column of the section some periods ago.
   pure function column(self, ago) result(place)
      !> Ring.
      class(section_ring), intent(in) :: self
      !> Mesh periods ago, less than the sections seen.
      integer, intent(in) :: ago
      !> The column.
      integer :: place

      place = mod(self%seen - 1 - ago, size(self%sections, 2))
   end function column

   !> Norm of a state: a bound of what it does to y1, to a bearing deformation or to the mesh deflection [m].
   pure function weighted_norm(weight, state) result(norm)
      !> Weight of each component, shape (size).
      real(wp), intent(in) :: weight(:)
      !> State, shape (size).
      real(wp), intent(in) :: state(:)
      !> Euclidean norm of the weighted components.
      real(wp) :: norm

      ! Displacements are far from where squares overflow; what has diverged is infinite, and may be so.
      norm = sqrt(sum((weight*state)**2))
   end function weighted_norm

   !> The same of a state in each seat, or of the only tangent in each.
   pure subroutine find_norms(seats, length, weights, states, norms)
      !> Seats, and length of a state.
      integer, intent(in) :: seats, length
      !> Weight of each component, and states.
      real(wp), intent(in) :: weights(seats, length), states(seats, length)
      !> Norm of each state.
      real(wp), intent(out) :: norms(seats)

      integer :: i, k

      norms = 0.0_wp
      do i = 1, length
         do k = 1, seats
            norms(k) = norms(k) + (weights(k, i)*states(k, i))**2
         end do
      end do
      norms = sqrt(norms)
   end subroutine find_norms

end module spurflex_steady_sections
