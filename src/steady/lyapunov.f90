!> Largest Lyapunov exponent of a motion from one tangent, with its standard error from the spread over blocks.
!>
!> The mesh force is continuous, so that a tangent crosses the borders of the contact without a jump of its own.
module spurflex_steady_lyapunov
   use spurflex_base_kinds, only: wp
   use spurflex_steady_sections, only: weighted_norm
   implicit none
   private

   public :: lyapunov_sum

   !> Mesh periods of a block: longer than the memory of the motion.
   integer, parameter :: block = 32

   !> Growth of a tangent, block by block.
   type :: lyapunov_sum
      private
      !> Mesh periods in the open block, growth over it.
      integer :: periods = 0
      real(wp) :: growth = 0.0_wp
      !> Blocks closed; sums of the growth per period and of its square.
      integer :: blocks = 0
      real(wp) :: total = 0.0_wp, total_square = 0.0_wp
   contains
      !> Begin anew.
      procedure :: reset
      !> Take the tangent after a period and make it a unit again.
      procedure :: add
      !> Exponent and its standard error.
      procedure :: exponent => mean_growth
   end type lyapunov_sum

contains

   !> Begin anew.
   pure subroutine reset(self)
      !> Sum.
      class(lyapunov_sum), intent(inout) :: self

      self%periods = 0
      self%growth = 0.0_wp
      self%blocks = 0
      self%total = 0.0_wp
      self%total_square = 0.0_wp
   end subroutine reset

   !> Take the tangent after a period and make it a unit again.
   pure subroutine add(self, weight, tangent)
      !> Sum.
      class(lyapunov_sum), intent(inout) :: self
      !> Weight of each component of the state, shape (size).
      real(wp), intent(in) :: weight(:)
      !> Tangent of unit norm a period ago; of unit norm again afterwards, shape (size).
      real(wp), intent(inout) :: tangent(:)

      real(wp) :: norm, rate

      norm = max(weighted_norm(weight, tangent), tiny(1.0_wp))
      tangent = tangent/norm
      self%growth = self%growth + log(norm)
      self%periods = self%periods + 1
      if (self%periods < block) return
      rate = self%growth/real(block, wp)
      self%blocks = self%blocks + 1
      self%total = self%total + rate
      self%total_square = self%total_square + rate**2
      self%periods = 0
      self%growth = 0.0_wp
   end subroutine add

   !> Exponent and its standard error; the error is infinite before there are two blocks.
   pure subroutine mean_growth(self, exponent, error, periods)
      !> Sum.
      class(lyapunov_sum), intent(in) :: self
      !> Largest Lyapunov exponent [1/mesh period].
      real(wp), intent(out) :: exponent
      !> Its standard error [1/mesh period].
      real(wp), intent(out) :: error
      !> Mesh periods summed over.
      integer, intent(out) :: periods

      real(wp) :: variance

      exponent = 0.0_wp
      error = huge(1.0_wp)
      periods = self%blocks*block
      if (self%blocks < 1) return
      exponent = self%total/real(self%blocks, wp)
      if (self%blocks < 2) return
      variance = max(self%total_square/real(self%blocks, wp) - exponent**2, 0.0_wp)
      error = sqrt(variance/real(self%blocks - 1, wp))
   end subroutine mean_growth

end module spurflex_steady_lyapunov
