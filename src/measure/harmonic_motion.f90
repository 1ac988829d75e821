!> Motions that keep contact, measured by their Fourier series: extremes to round-off, rms by Parseval's theorem.
module spurflex_measure_harmonic_motion
   use spurflex_base_kinds, only: wp, pi
   use spurflex_measure_response, only: response, contact_of
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system
   use spurflex_steady_harmonic, only: harmonic_motion, harmonic_displacements, orders
   implicit none
   private

   public :: series_sampler, measure_harmonics

   !> Samples a period for each order: enough to tell which peaks may be the highest.
   integer, parameter :: samples_per_order = 4

   !> Share of the range by which a sampled peak may miss its height.
   real(wp), parameter :: peak_margin = 0.05_wp

   !> Newton iterations on a peak at most, and the change of its phase that ends them: a peak is off by the square [rad].
   integer, parameter :: most_iterations = 8
   real(wp), parameter :: near_enough = 1.0e-9_wp

   !> Series: those of `harmonic_displacements` and the mesh deflection.
   integer, parameter :: iy1 = 1, ideflection = 6, series_count = 6
   integer, parameter :: ix(2) = [2, 4], iy(2) = [3, 5]

   !> cos(k theta) and sin(k theta) at the samples of half a period, both ends included; those of the other half mirror them.
   type :: table_type
      !> Shape (0:samples/2, order).
      real(wp), allocatable :: cosine(:, :), sine(:, :)
   end type table_type

   !> Samples series; keeps the tables of the orders met so far.
   type :: series_sampler
      private
      type(table_type) :: table(size(orders))
   end type series_sampler

contains

   !> Measure a motion. Its error estimate is what the lines left out, and round-off, may change.
   subroutine measure_harmonics(sampler, modal, equations, motion, answer)
      !> Sampler.
      type(series_sampler), intent(inout) :: sampler
      !> Modes of the linear part.
      type(modal_system), intent(in) :: modal
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The motion.
      type(harmonic_motion), intent(in) :: motion
      !> Displacements, error estimate and contact are filled in.
      type(response), intent(inout) :: answer

      complex(wp) :: lines(0:motion%order, series_count)
      real(wp) :: seen(samples_per_order*motion%order, series_count), smallest, largest, low, high
      integer :: gear

      lines(:, :ideflection - 1) = harmonic_displacements(modal, motion)
      lines(:, ideflection) = motion%deflection
      ! The bearings are measured with their static deformation, y1 without its own.
      lines(0, 2:5) = lines(0, 2:5) + equations%static_observation(2:5)
      call sample(sampler, lines, seen)
      high = highest(lines(:, iy1:iy1), seen(:, iy1:iy1), 1.0_wp)
      low = -highest(lines(:, iy1:iy1), seen(:, iy1:iy1), -1.0_wp)
      largest = highest(lines(:, ideflection:), seen(:, ideflection:), 1.0_wp)
      smallest = -highest(lines(:, ideflection:), seen(:, ideflection:), -1.0_wp)
      answer%y1_amplitude = 0.5_wp*(high - low)
      answer%y1_rms = sqrt(2.0_wp*sum(abs(lines(1:, iy1))**2))
      answer%y1_max = equations%static_observation(iy1) + high
      answer%y1_min = equations%static_observation(iy1) + low
      do gear = 1, 2
         answer%bearing_deformation_max(gear) = sqrt(max(highest(lines(:, [ix(gear), iy(gear)]), &
                                                                 seen(:, [ix(gear), iy(gear)]), 1.0_wp), 0.0_wp))
      end do
      answer%contact = contact_of(smallest, largest, equations%mesh%half_backlash)
      answer%error_estimate = max(modal%roundoff, motion%left_out)
   end subroutine measure_harmonics

   !> Sample series over a period.
   subroutine sample(sampler, lines, seen)
      !> Sampler.
      type(series_sampler), intent(inout) :: sampler
      !> Lines, shape (0:order, series).
      complex(wp), intent(in) :: lines(0:, :)
      !> Values, shape (samples, series).
      real(wp), intent(out) :: seen(0:, :)

      real(wp) :: even(0:size(seen, 1)/2), odd(0:size(seen, 1)/2)
      integer :: order, half, i, k, s

      order = ubound(lines, 1)
      half = size(seen, 1)/2
      associate (table => sampler%table(findloc(orders, order, dim=1)))
         if (.not. allocated(table%cosine)) call make_table(order, half, table)
         do i = 1, size(lines, 2)
            even = real(lines(0, i), wp)
            odd = 0.0_wp
            do k = 1, order
               even = even + 2.0_wp*real(lines(k, i), wp)*table%cosine(:, k)
               odd = odd - 2.0_wp*aimag(lines(k, i))*table%sine(:, k)
            end do
            do s = 0, half - 1
               seen(s, i) = even(s) + odd(s)
               seen(half + s, i) = even(half - s) - odd(half - s)
            end do
         end do
      end associate
   end subroutine sample

   !> Make the table of an order.
   pure subroutine make_table(order, half, table)
      !> Order, and half the number of samples.
      integer, intent(in) :: order, half
      !> The table.
      type(table_type), intent(inout) :: table

      real(wp) :: phase
      integer :: k, s

      allocate (table%cosine(0:half, order), table%sine(0:half, order))
      do k = 1, order
         do s = 0, half
            phase = pi*real(mod(k*s, 2*half), wp)/real(half, wp)
            table%cosine(s, k) = cos(phase)
            table%sine(s, k) = sin(phase)
         end do
      end do
   end subroutine make_table

   !> The largest value of a series, or of the sum of the squares of two.
   pure function highest(lines, seen, sign_of) result(value)
      !> Lines of the series, shape (0:order, 1 or 2).
      complex(wp), intent(in) :: lines(0:, :)
      !> Samples, shape (samples, 1 or 2).
      real(wp), intent(in) :: seen(:, :)
      !> 1, or -1 for the largest of the negative.
      real(wp), intent(in) :: sign_of
      !> The value.
      real(wp) :: value

      real(wp) :: height(0:size(seen, 1) + 1), left, right, bend, top, margin
      integer :: s, n

      n = size(seen, 1)
      if (size(seen, 2) == 1) then
         height(1:n) = sign_of*seen(:, 1)
      else
         height(1:n) = sign_of*(seen(:, 1)**2 + seen(:, 2)**2)
      end if
      height(0) = height(n)
      height(n + 1) = height(1)
      value = maxval(height)
      margin = value - peak_margin*(value - minval(height))
      do s = 1, n
         left = height(s - 1)
         right = height(s + 1)
         if (height(s) < left .or. height(s) < right) cycle
         bend = 2.0_wp*height(s) - left - right
         if (.not. bend > 0.0_wp) cycle
         ! The parabola through three samples tells how high the peak may be.
         top = 0.5_wp*(right - left)/bend
         if (height(s) + 0.5_wp*bend*top**2 < margin) cycle
         value = max(value, peak(lines, sign_of, 2.0_wp*pi*(real(s - 1, wp) + top)/real(n, wp), 2.0_wp*pi/real(n, wp)))
      end do
   end function highest

   !> The height of a peak near some phase, by Newton's method on the slope.
   pure function peak(lines, sign_of, near, reach) result(value)
      !> Lines of the series, shape (0:order, 1 or 2).
      complex(wp), intent(in) :: lines(0:, :)
      !> 1 or -1.
      real(wp), intent(in) :: sign_of
      !> Where it should be, and how far from there at most [rad].
      real(wp), intent(in) :: near, reach
      !> Its height.
      real(wp) :: value

      real(wp) :: theta, v(2), slope(2), bend(2), f, f_slope, f_bend, step
      integer :: k, series

      theta = near
      value = -huge(1.0_wp)
      do k = 1, most_iterations
         do series = 1, size(lines, 2)
            call evaluate(lines(:, series), theta, v(series), slope(series), bend(series))
         end do
         if (size(lines, 2) == 1) then
            f = v(1)
            f_slope = slope(1)
            f_bend = bend(1)
         else
            f = sum(v**2)
            f_slope = 2.0_wp*sum(v*slope)
            f_bend = 2.0_wp*sum(slope**2 + v*bend)
         end if
         value = max(value, sign_of*f)
         if (.not. sign_of*f_bend < 0.0_wp) exit
         step = -f_slope/f_bend
         theta = theta + step
         if (abs(step) <= near_enough .or. abs(theta - near) > reach) exit
      end do
   end function peak

   !> A series and its first two derivatives by the phase.
   pure subroutine evaluate(lines, theta, value, slope, bend)
      !> Its lines, shape (0:order).
      complex(wp), intent(in) :: lines(0:)
      !> Phase [rad].
      real(wp), intent(in) :: theta
      !> Value and derivatives.
      real(wp), intent(out) :: value, slope, bend

      complex(wp) :: turn, wave, term
      integer :: k

      turn = cmplx(cos(theta), sin(theta), wp)
      wave = (1.0_wp, 0.0_wp)
      value = real(lines(0), wp)
      slope = 0.0_wp
      bend = 0.0_wp
      do k = 1, ubound(lines, 1)
         wave = wave*turn
         term = 2.0_wp*lines(k)*wave
         value = value + real(term, wp)
         slope = slope - real(k, wp)*aimag(term)
         bend = bend - real(k, wp)**2*real(term, wp)
      end do
   end subroutine evaluate

end module spurflex_measure_harmonic_motion
