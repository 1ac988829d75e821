!> Largest Lyapunov exponent of a motion from one tangent, with its standard error from the spread over blocks.
!>
!> The mesh force is continuous, so that a tangent crosses the borders of the contact without a jump of its own.
module spurflex_steady_lyapunov
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: lyapunov_sum, unknown

   !> Error of an exponent that is not known; far above any exponent.
   real(wp), parameter :: unknown = 1.0e30_wp

   !> Mesh periods of the first blocks.
   integer, parameter :: first_length = 16

   !> Blocks at most; when they are full, neighbours are joined. Growth that only wanders, as on a torus, then averages out
   !> within the blocks and does not count as an error of the exponent.
   integer, parameter :: most_blocks = 32

   !> Growth of a tangent, block by block.
   type :: lyapunov_sum
      private
      !> Mesh periods of a block; mesh periods in the open one, and growth over it.
      integer :: length = first_length, periods = 0
      real(wp) :: open = 0.0_wp
      !> Closed blocks, and growth over each.
      integer :: blocks = 0
      real(wp) :: growth(most_blocks) = 0.0_wp
   contains
      !> Begin anew.
      procedure :: reset
      !> Take what a tangent has grown by over a period.
      procedure :: add
      !> Exponent and its standard error.
      procedure :: exponent => mean_growth
   end type lyapunov_sum

contains

   !> Begin anew.
   pure subroutine reset(self)
      !> Sum.
      class(lyapunov_sum), intent(inout) :: self

      self%length = first_length
      self%periods = 0
      self%open = 0.0_wp
      self%blocks = 0
   end subroutine reset

   !> Take what a tangent has grown by over a period.
   pure subroutine add(self, growth)
      !> Sum.
      class(lyapunov_sum), intent(inout) :: self
      !> Norm of the tangent over that of a period ago.
      real(wp), intent(in) :: growth

      self%open = self%open + log(max(growth, tiny(1.0_wp)))
      self%periods = self%periods + 1
      if (self%periods < self%length) return
      self%blocks = self%blocks + 1
      self%growth(self%blocks) = self%open
      self%periods = 0
      self%open = 0.0_wp
      if (self%blocks < most_blocks) return
      self%growth(:most_blocks/2) = self%growth(1::2) + self%growth(2::2)
      self%blocks = most_blocks/2
      self%length = 2*self%length
   end subroutine add

   !> Exponent and its standard error; the error is `unknown` before there are two blocks.
   pure subroutine mean_growth(self, exponent, error, periods, wander)
      !> Sum.
      class(lyapunov_sum), intent(in) :: self
      !> Largest Lyapunov exponent [1/mesh period].
      real(wp), intent(out) :: exponent
      !> Its standard error [1/mesh period].
      real(wp), intent(out) :: error
      !> Mesh periods summed over.
      integer, intent(out) :: periods
      !> Range that the logarithm of the tangent covered, block by block.
      real(wp), intent(out) :: wander

      real(wp) :: rate(most_blocks), logarithm, low, high
      integer :: k

      logarithm = 0.0_wp
      low = 0.0_wp
      high = 0.0_wp
      do k = 1, self%blocks
         logarithm = logarithm + self%growth(k)
         low = min(low, logarithm)
         high = max(high, logarithm)
      end do
      wander = high - low
      exponent = 0.0_wp
      error = unknown
      periods = self%blocks*self%length
      if (self%blocks < 1) return
      rate = self%growth/real(self%length, wp)
      exponent = sum(rate(:self%blocks))/real(self%blocks, wp)
      if (self%blocks < 2) return
      ! Blocks of growth that only wanders are not independent: their sum errs by no more than the range.
      error = min(sqrt(sum((rate(:self%blocks) - exponent)**2)/real(self%blocks*(self%blocks - 1), wp)), wander/real(periods, wp))
   end subroutine mean_growth

end module spurflex_steady_lyapunov
