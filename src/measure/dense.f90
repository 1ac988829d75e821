!> Recorded motions between their samples.
!>
!> Over a piece of an orbit, in which no derivative jumps, a motion is the polynomial that has the values, rates and
!> accelerations of all samples of the piece: of degree five over a step of Newmark's method, of degree 14 over one of
!> collocation with its five points.
module spurflex_measure_dense
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_period_map, only: orbit_type
   implicit none
   private

   public :: interpolate

   !> Values, rates, accelerations.
   integer, parameter :: orders = 3

   !> Length of a piece, beside the period, over which nothing moves.
   real(wp), parameter :: instant = 1.0e-12_wp

contains

   !> The recorded quantities at some times.
   subroutine interpolate(orbit, time, motion)
      !> The recorded period.
      type(orbit_type), intent(in) :: orbit
      !> Ascending times since its section, shape (times) [s].
      real(wp), intent(in) :: time(:)
      !> Values, and rates and accelerations if there is room for them, shape (quantities, 1 to 3, times).
      real(wp), intent(out) :: motion(:, :, :)

      real(wp) :: node(orders*(orbit%piece + 1)), coefficient(size(motion, 1), orders*(orbit%piece + 1)), length
      integer :: i, first, known

      first = 0
      known = -1
      do i = 1, size(time)
         do while (first + orbit%piece < orbit%samples)
            if (time(i) < orbit%time(first + orbit%piece)) exit
            first = first + orbit%piece
         end do
         length = orbit%time(first + orbit%piece) - orbit%time(first)
         if (time(i) >= orbit%time(orbit%samples)) then
            call take_sample(orbit, orbit%samples, motion(:, :, i))
         else if (length <= instant*orbit%time(orbit%samples) .or. time(i) <= orbit%time(first)) then
            call take_sample(orbit, first, motion(:, :, i))
         else
            if (known /= first) call set_polynomial(orbit, first, node, coefficient)
            known = first
            call evaluate(node, coefficient, (time(i) - orbit%time(first))/length, length, motion(:, :, i))
         end if
      end do
   end subroutine interpolate

   !> One sample as it is.
   pure subroutine take_sample(orbit, sample, motion)
      !> The recorded period.
      type(orbit_type), intent(in) :: orbit
      !> The sample.
      integer, intent(in) :: sample
      !> Values, rates, accelerations, shape (quantities, 1 to 3).
      real(wp), intent(out) :: motion(:, :)

      motion(:, 1) = orbit%value(:, sample)
      if (size(motion, 2) > 1) motion(:, 2) = orbit%rate(:, sample)
      if (size(motion, 2) > 2) motion(:, 3) = orbit%acceleration(:, sample)
   end subroutine take_sample

   !> The polynomials of a piece by divided differences, each of its samples taken three times.
   pure subroutine set_polynomial(orbit, first, node, coefficient)
      !> The recorded period.
      type(orbit_type), intent(in) :: orbit
      !> First sample of the piece.
      integer, intent(in) :: first
      !> Places of the samples as shares of the piece, three times each, shape (3 samples).
      real(wp), intent(out) :: node(:)
      !> Divided differences, shape (quantities, 3 samples).
      real(wp), intent(out) :: coefficient(:, :)

      real(wp) :: length
      integer :: j, order, sample

      length = orbit%time(first + orbit%piece) - orbit%time(first)
      do j = 1, size(node)
         sample = first + (j - 1)/orders
         node(j) = (orbit%time(sample) - orbit%time(first))/length
         coefficient(:, j) = orbit%value(:, sample)
      end do
      do order = 1, size(node) - 1
         do j = size(node), order + 1, -1
            sample = first + (j - 1)/orders
            if ((j - 1)/orders > (j - order - 1)/orders) then
               coefficient(:, j) = (coefficient(:, j) - coefficient(:, j - 1))*(1.0_wp/(node(j) - node(j - order)))
            else if (order == 1) then
               coefficient(:, j) = length*orbit%rate(:, sample)
            else
               coefficient(:, j) = 0.5_wp*length**2*orbit%acceleration(:, sample)
            end if
         end do
      end do
   end subroutine set_polynomial

   !> The polynomials of a piece at one place.
   pure subroutine evaluate(node, coefficient, place, length, motion)
      !> Places of the samples, shape (n).
      real(wp), intent(in) :: node(:)
      !> Divided differences, shape (quantities, n).
      real(wp), intent(in) :: coefficient(:, :)
      !> The place, as a share of the piece.
      real(wp), intent(in) :: place
      !> Length of the piece [s].
      real(wp), intent(in) :: length
      !> Values, rates, accelerations, shape (quantities, 1 to 3).
      real(wp), intent(out) :: motion(:, :)

      real(wp) :: distance(size(node)), value, rate, bend
      integer :: j, q

      distance = place - node
      do q = 1, size(motion, 1)
         value = coefficient(q, size(node))
         rate = 0.0_wp
         bend = 0.0_wp
         if (size(motion, 2) == 1) then
            do j = size(node) - 1, 1, -1
               value = value*distance(j) + coefficient(q, j)
            end do
         else
            do j = size(node) - 1, 1, -1
               bend = bend*distance(j) + rate
               rate = rate*distance(j) + value
               value = value*distance(j) + coefficient(q, j)
            end do
         end if
         motion(q, 1) = value
         if (size(motion, 2) > 1) motion(q, 2) = rate/length
         if (size(motion, 2) > 2) motion(q, 3) = 2.0_wp*bend/length**2
      end do
   end subroutine evaluate

end module spurflex_measure_dense
