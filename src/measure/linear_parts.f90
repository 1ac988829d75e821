!> The linear parts that points have been found to have, with what follows from each: modes, displacements, and what is left of them
!> at the speeds at which the mesh does not feel all modes. Neighbours on the grid share them.
module spurflex_measure_linear_parts
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_observe, only: point_view, new_point_view
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system, new_modal_system, same_modes
   use spurflex_model_truncation, only: mode_shares, new_mode_shares, felt_modes, truncated
   implicit none
   private

   public :: linear_parts, truncated_part

   !> Linear parts that are kept for tiles to come; some ten kilobytes each.
   integer, parameter :: most_parts = 256

   !> Some of the modes of a linear part.
   type :: truncated_part
      !> The part, and which of its modes, shape (modes).
      integer :: part = 0
      logical, allocatable :: felt(:)
   end type truncated_part

   !> The linear parts met so far.
   type :: linear_parts
      !> How many there are, and how many with some of their modes.
      integer :: parts = 0, truncations = 0
      !> Each part, its modes, the displacements that they make, and their shares in the mesh deflection.
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(point_view), allocatable :: views(:)
      type(mode_shares), allocatable :: shares(:)
      !> Each truncation, and the modes that it leaves.
      type(truncated_part), allocatable :: truncation(:)
      type(modal_system), allocatable :: few(:)
   contains
      !> Forget all if they are many.
      procedure :: forget
      !> The part of a point.
      procedure :: find
      !> What the mesh feels of the part of a point.
      procedure :: find_felt
   end type linear_parts

contains

   !> Forget the linear parts met so far if they are many. To be called between tiles.
   pure subroutine forget(self)
      !> Linear parts.
      class(linear_parts), intent(inout) :: self

      if (max(self%parts, self%truncations) <= most_parts) return
      self%parts = 0
      self%truncations = 0
   end subroutine forget

   !> Which of the linear parts met so far is that of a point; a new one is added to them.
   subroutine find(self, equations, part)
      !> Linear parts.
      class(linear_parts), intent(inout) :: self
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Index of the part; 0 where its modes cannot be found.
      integer, intent(out) :: part

      type(modal_system) :: found
      type(error_type), allocatable :: error

      ! The latest first: neighbours come after each other.
      do part = self%parts, 1, -1
         if (same_modes(self%equations(part), equations)) return
      end do
      part = 0
      call new_modal_system(equations, found, error)
      if (allocated(error)) return
      call reserve_part(self)
      self%parts = self%parts + 1
      part = self%parts
      self%equations(part) = equations
      self%modal(part) = found
      self%views(part) = new_point_view(found)
      self%shares(part) = new_mode_shares(found)
   end subroutine find

   !> What the mesh feels of a linear part at some speed.
   subroutine find_felt(self, part, frequency, least_share, moves, few)
      !> Linear parts.
      class(linear_parts), intent(inout) :: self
      !> The part.
      integer, intent(in) :: part
      !> Mesh frequency [rad/s], and share of the mesh deflection below which a mode is not felt; all are if it is negative.
      real(wp), intent(in) :: frequency, least_share
      !> Modes that move at the start, so that the mesh feels them whatever their share, shape (modes).
      logical, intent(in) :: moves(:)
      !> Index of the truncation.
      integer, intent(out) :: few

      logical :: felt(self%modal(part)%modes)

      felt = felt_modes(self%shares(part), frequency, least_share) .or. moves
      do few = self%truncations, 1, -1
         if (self%truncation(few)%part /= part) cycle
         if (all(self%truncation(few)%felt .eqv. felt)) return
      end do
      call reserve_truncation(self)
      self%truncations = self%truncations + 1
      few = self%truncations
      self%truncation(few) = truncated_part(part, felt)
      self%few(few) = truncated(self%modal(part), felt)
   end subroutine find_felt

   !> Make room for one more part.
   subroutine reserve_part(self)
      !> Linear parts.
      type(linear_parts), intent(inout) :: self

      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(point_view), allocatable :: views(:)
      type(mode_shares), allocatable :: shares(:)
      integer :: n

      if (.not. allocated(self%modal)) allocate (self%equations(0), self%modal(0), self%views(0), self%shares(0))
      n = self%parts
      if (n < size(self%modal)) return
      allocate (equations(2*n + 8), modal(2*n + 8), views(2*n + 8), shares(2*n + 8))
      equations(:n) = self%equations(:n)
      modal(:n) = self%modal(:n)
      views(:n) = self%views(:n)
      shares(:n) = self%shares(:n)
      call move_alloc(equations, self%equations)
      call move_alloc(modal, self%modal)
      call move_alloc(views, self%views)
      call move_alloc(shares, self%shares)
   end subroutine reserve_part

   !> Make room for one more truncation.
   subroutine reserve_truncation(self)
      !> Linear parts.
      type(linear_parts), intent(inout) :: self

      type(truncated_part), allocatable :: truncation(:)
      type(modal_system), allocatable :: few(:)
      integer :: n

      if (.not. allocated(self%few)) allocate (self%truncation(0), self%few(0))
      n = self%truncations
      if (n < size(self%few)) return
      allocate (truncation(2*n + 8), few(2*n + 8))
      truncation(:n) = self%truncation(:n)
      few(:n) = self%few(:n)
      call move_alloc(truncation, self%truncation)
      call move_alloc(few, self%few)
   end subroutine reserve_truncation

end module spurflex_measure_linear_parts
