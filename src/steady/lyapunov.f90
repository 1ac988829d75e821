!> Largest Lyapunov exponent of a motion from one tangent: as a mean with its standard error from the spread over blocks, and as a
!> weighted mean with weights that vanish smoothly at both ends. Of a growth that only wanders, as on a torus, the weighted mean
!> comes to zero faster than any power of the periods but for the smoothness of the weights (Das, Saiki, Sander, Yorke:
!> Quantitative quasiperiodicity, Nonlinearity 30 (2017) 4111); of a chaotic one it is no better than the other.
!>
!> The mesh force is continuous, so that a tangent crosses the borders of the contact without a jump of its own.
module spurflex_steady_lyapunov
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: lyapunov_sum, unknown, smooth_weight

   !> Error of an exponent that is not known; far above any exponent.
   real(wp), parameter :: unknown = 1.0e30_wp

   !> Mesh periods of the first blocks.
   integer, parameter :: first_length = 16

   !> Blocks at most; when they are full, neighbours are joined. Growth that only wanders, as on a torus, then averages out
   !> within the blocks and does not count as an error of the exponent.
   integer, parameter :: most_blocks = 32

   !> Weighted means: over all that is planned, over its first and over its second half.
   integer, parameter :: spans = 3

   !> Growth of a tangent, block by block.
   type :: lyapunov_sum
      private
      !> Mesh periods of a block; mesh periods in the open one, and growth over it.
      integer :: length = first_length, periods = 0
      real(wp) :: open = 0.0_wp
      !> Closed blocks, and growth over each.
      integer :: blocks = 0
      real(wp) :: growth(most_blocks) = 0.0_wp
      !> Mesh periods planned, and seen so far.
      integer :: planned = 0, seen = 0
      !> Sums of the weights and of the weighted growth: all, first half, second half.
      real(wp), dimension(spans) :: weights = 0.0_wp, weighted = 0.0_wp
   contains
      !> Begin anew.
      procedure :: reset
      !> Take what a tangent has grown by over a period.
      procedure :: add
      !> Exponent and its standard error.
      procedure :: exponent => mean_growth
      !> The same as a weighted mean.
      procedure :: smooth_exponent => weighted_growth
   end type lyapunov_sum

contains

   !> Begin anew.
   pure subroutine reset(self, planned)
      !> Sum.
      class(lyapunov_sum), intent(inout) :: self
      !> Mesh periods over which the growth will be summed.
      integer, intent(in) :: planned

      self%planned = planned
      self%seen = 0
      self%weights = 0.0_wp
      self%weighted = 0.0_wp
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

      real(wp) :: logarithm, place
      integer :: half

      logarithm = log(max(growth, tiny(1.0_wp)))
      place = (real(self%seen, wp) + 0.5_wp)/real(max(self%planned, 1), wp)
      self%seen = self%seen + 1
      call weigh(place, logarithm, self%weights(1), self%weighted(1))
      half = merge(2, 3, place < 0.5_wp)
      call weigh(2.0_wp*place - merge(0.0_wp, 1.0_wp, place < 0.5_wp), logarithm, self%weights(half), self%weighted(half))
      self%open = self%open + logarithm
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

   !> Add the growth over a period to a weighted mean.
   pure subroutine weigh(place, logarithm, weight, weighted)
      !> Place of the period in what the mean is over, from 0 to 1.
      real(wp), intent(in) :: place
      !> Logarithm of the growth.
      real(wp), intent(in) :: logarithm
      !> Sum of the weights, and of the weighted growth.
      real(wp), intent(inout) :: weight, weighted

      real(wp) :: here

      here = smooth_weight(place)
      weight = weight + here
      weighted = weighted + here*logarithm
   end subroutine weigh

   !> A weight that vanishes smoothly at both ends of what is averaged.
   elemental function smooth_weight(place) result(weight)
      !> Place in it, from 0 to 1.
      real(wp), intent(in) :: place
      !> The weight; zero outside.
      real(wp) :: weight

      weight = max(place*(1.0_wp - place), 0.0_wp)**4
   end function smooth_weight

   !> Exponent as a weighted mean, and half of what those of the two halves differ by; unknown before all that
   !> was planned is seen. What comes after does not count.
   pure subroutine weighted_growth(self, exponent, error)
      !> Sum.
      class(lyapunov_sum), intent(in) :: self
      !> Largest Lyapunov exponent [1/mesh period], and its error.
      real(wp), intent(out) :: exponent, error

      real(wp) :: means(spans)

      exponent = 0.0_wp
      error = unknown
      if (self%planned < 2 .or. self%seen < self%planned) return
      means = self%weighted/self%weights
      exponent = means(1)
      error = 0.5_wp*abs(means(3) - means(2))
   end subroutine weighted_growth

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
