!> Pseudo-random numbers that are the same everywhere: Park and Miller's generator, Comm. ACM 36 (1993) 105.
module pseudo_random
   use spurflex_base_kinds, only: i8, wp
   implicit none
   private

   public :: random_stream

   integer(i8), parameter :: multiplier = 48271_i8, modulus = 2147483647_i8

   !> A sequence of numbers.
   type :: random_stream
      !> State, 1..modulus-1; the seed at first.
      integer(i8) :: state = 1_i8
   contains
      !> The next real of an interval.
      procedure :: uniform
      !> The next reals of an interval.
      procedure :: fill
      !> The next integer of a range.
      procedure :: pick
   end type random_stream

contains

   !> The next real, evenly distributed over an interval.
   subroutine uniform(self, low, high, number)
      !> The sequence.
      class(random_stream), intent(inout) :: self
      !> Ends of the interval.
      real(wp), intent(in) :: low, high
      !> The number.
      real(wp), intent(out) :: number

      self%state = modulo(multiplier*self%state, modulus)
      number = low + (high - low)*real(self%state, wp)/real(modulus, wp)
   end subroutine uniform

   !> The next reals, evenly distributed over an interval.
   subroutine fill(self, low, high, numbers)
      !> The sequence.
      class(random_stream), intent(inout) :: self
      !> Ends of the interval.
      real(wp), intent(in) :: low, high
      !> The numbers, shape (any).
      real(wp), intent(out) :: numbers(:)

      integer :: i

      do i = 1, size(numbers)
         call self%uniform(low, high, numbers(i))
      end do
   end subroutine fill

   !> The next integer of a range.
   subroutine pick(self, first, last, number)
      !> The sequence.
      class(random_stream), intent(inout) :: self
      !> Ends of the range, both of which occur.
      integer, intent(in) :: first, last
      !> The number.
      integer, intent(out) :: number

      real(wp) :: share

      call self%uniform(0.0_wp, 1.0_wp, share)
      number = min(last, first + int(share*real(last - first + 1, wp)))
   end subroutine pick

end module pseudo_random
