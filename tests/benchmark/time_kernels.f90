!> Time the innermost loops: eight points in the lanes of the processor's vectors over one mesh period.
!>
!> usage: time_kernels DECK REPEATS SECONDS
!>
!> Every loop is repeated REPEATS times for about SECONDS each, all of them in turn. Prints one JSON line a loop: `items` that a
!> repetition does, point-steps or tangent-steps, with the least and the median time of one; `operations` are floating-point
!> operations instead, of a loop of independent fused multiply-adds in registers, which shows what the processor can do.
program time_kernels
   use, intrinsic :: iso_fortran_env, only: error_unit, int64, output_unit
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_newmark, only: new_newmark_rule, advance_newmark, carry_newmark
   use spurflex_integrate_lane_rule, only: lanes, most_modes, points, lane_rule, mesh_cycle, lane_gain, lane_record, &
      point_rule, new_point_rule, new_mesh_cycle, load_rule
   use spurflex_integrate_lane_step, only: advance_lanes
   use spurflex_integrate_lane_tangents, only: carry_lane_tangents
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: read_deck
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_modal, only: modal_system, new_modal_system
   use spurflex_model_parameters, only: operating_point, support_flexible, support_rigid
   implicit none

   !> Steps per mesh period, mesh periods until a motion is steady.
   integer, parameter :: steps = 200, settling = 2000

   !> What is timed.
   integer, parameter :: period_newmark = 1, period_collocation = 2, gain_newmark = 3, gain_collocation = 4, &
                         tangents_newmark = 5, tangents_collocation = 6, peak_few = 7, peak_many = 8

   !> Registers' worth of sums that do not wait for each other, each of one number a lane; turns of the loop at a time.
   integer, parameter :: few = 5, many = 10, turns = 2000

   !> A loop with its data.
   type :: kernel_type
      character(len=:), allocatable :: name
      integer :: what = 0, modes = 0
      !> Mesh periods a repetition; times of a repetition [s].
      integer(int64) :: rounds = 1
      real(wp), allocatable :: seconds(:)
      type(lane_rule) :: rule
      type(mesh_cycle) :: pitch
      type(lane_gain) :: gain
      real(wp), allocatable :: states(:, :), tangents(:, :, :)
      !> Share of the steps in which a border is crossed in at least one lane, and of the point-steps that cross one.
      real(wp) :: crossing_steps = 0.0_wp, crossing_points = 0.0_wp
   end type kernel_type

   character(len=1024) :: deck, word
   type(case_type) :: case
   type(error_type), allocatable :: error
   type(kernel_type), allocatable :: kernels(:)
   real(wp) :: wanted, dust
   integer :: repeats, repeat, stat, i

   if (command_argument_count() /= 3) call give_up('usage: time_kernels DECK REPEATS SECONDS')
   call get_command_argument(1, deck)
   call get_command_argument(2, word)
   read (word, *, iostat=stat) repeats
   if (stat /= 0 .or. repeats < 1) call give_up('REPEATS must be a positive integer')
   call get_command_argument(3, word)
   read (word, *, iostat=stat) wanted
   if (stat /= 0 .or. .not. wanted > 0.0_wp) call give_up('SECONDS must be a positive number')
   call read_deck(trim(deck), case, error)
   if (allocated(error)) call give_up(error%message)

   dust = 0.0_wp
   allocate (kernels(18))
   kernels(1)%what = peak_few
   kernels(1)%name = 'peak, few sums'
   kernels(2)%what = peak_many
   kernels(2)%name = 'peak, many sums'
   call new_kernel(kernels(3), 'Newmark, flexible', period_newmark, support_flexible, 1500.0_wp, 10.0_wp**7.7_wp)
   call new_kernel(kernels(4), 'Newmark, flexible, contact lost', period_newmark, support_flexible, 3500.0_wp, 1.0e9_wp)
   call new_kernel(kernels(5), 'Newmark, rigid', period_newmark, support_rigid, 1500.0_wp, 0.0_wp)
   call new_kernel(kernels(6), 'Newmark, flexible, with derivatives', gain_newmark, support_flexible, 1500.0_wp, 10.0_wp**7.7_wp)
   call new_kernel(kernels(7), 'Newmark, tangents', tangents_newmark, support_flexible, 1500.0_wp, 10.0_wp**7.7_wp)
   call new_kernel(kernels(8), 'collocation, flexible', period_collocation, support_flexible, 1500.0_wp, 10.0_wp**7.7_wp)
   call new_kernel(kernels(9), 'collocation, flexible, contact lost', period_collocation, support_flexible, 3500.0_wp, 1.0e9_wp)
   call new_kernel(kernels(10), 'collocation, flexible, both flanks', period_collocation, support_flexible, 5700.0_wp, 1.0e9_wp)
   call new_kernel(kernels(11), 'collocation, flexible, both flanks, 25 steps', period_collocation, support_flexible, &
                   5700.0_wp, 1.0e9_wp, 25)
   call new_kernel(kernels(12), 'collocation, rigid', period_collocation, support_rigid, 1500.0_wp, 0.0_wp)
   call new_kernel(kernels(13), 'collocation, flexible, with derivatives', gain_collocation, support_flexible, 1500.0_wp, &
                   10.0_wp**7.7_wp)
   call new_kernel(kernels(14), 'collocation, flexible, with derivatives, both flanks', gain_collocation, support_flexible, &
                   5700.0_wp, 1.0e9_wp)
   call new_kernel(kernels(15), 'collocation, tangents', tangents_collocation, support_flexible, 1500.0_wp, 10.0_wp**7.7_wp)
   call new_kernel(kernels(16), 'collocation, tangents, rigid', tangents_collocation, support_rigid, 1500.0_wp, 0.0_wp)
   call new_kernel(kernels(17), 'collocation, flexible, quasi-periodic, 16 steps', period_collocation, support_flexible, &
                   4885.0_wp, 1.0e5_wp, 16)
   call new_kernel(kernels(18), 'collocation, flexible, with derivatives, quasi-periodic, 16 steps', gain_collocation, &
                   support_flexible, 4885.0_wp, 1.0e5_wp, 16)
   do i = 1, size(kernels)
      call choose_rounds(kernels(i), wanted)
      allocate (kernels(i)%seconds(repeats))
   end do
   do repeat = 1, repeats
      do i = 1, size(kernels)
         kernels(i)%seconds(repeat) = time_of(kernels(i))
      end do
   end do
   do i = 1, size(kernels)
      call print_kernel(kernels(i))
   end do
   write (error_unit, '(a, es9.1)') 'sum of everything, so that nothing is left out:', dust

contains

   !> Stop with a message.
   subroutine give_up(message)
      !> Message.
      character(len=*), intent(in) :: message

      write (error_unit, '(a)') message
      stop 1
   end subroutine give_up

   !> Prepare a loop: eight neighbouring points on their steady motions.
   subroutine new_kernel(kernel, name, what, support, speed, stiffness, own_steps)
      !> The loop.
      type(kernel_type), intent(inout) :: kernel
      !> Its name.
      character(len=*), intent(in) :: name
      !> What is timed, kind of support.
      integer, intent(in) :: what, support
      !> Speed [rev/min], support stiffness [N/m].
      real(wp), intent(in) :: speed, stiffness
      !> Steps per mesh period if not the usual ones.
      integer, intent(in), optional :: own_steps

      type(operating_point) :: point
      type(equations_type) :: equations
      type(modal_system) :: modal
      type(point_rule) :: own(lanes)
      real(wp), dimension(lanes) :: smallest, largest
      integer :: lane, period, here

      here = steps
      if (present(own_steps)) here = own_steps
      kernel%name = name
      kernel%what = what
      kernel%modes = 0
      do lane = 1, lanes
         point%support = support
         point%speed = speed*(1.0_wp + 0.005_wp*real(mod(lane - 1, 4), wp))
         point%support_stiffness = stiffness*(1.0_wp + 0.05_wp*real((lane - 1)/4, wp))
         equations = new_equations(case%gears, case%box, case%load, point)
         call new_modal_system(equations, modal, error)
         if (allocated(error)) call give_up(error%message)
         if (is_newmark(what)) then
            call new_newmark_rule(modal, equations, here, own(lane))
         else
            call new_point_rule(modal, equations, here, own(lane))
         end if
         kernel%modes = max(kernel%modes, modal%modes)
      end do
      kernel%rule%modes = kernel%modes
      do lane = 1, lanes
         call load_rule(kernel%rule, lane, own(lane))
      end do
      call new_mesh_cycle(equations%mesh, here, kernel%pitch)
      allocate (kernel%states(lanes, 2*kernel%modes), kernel%gain%n(lanes, points, points, here), source=0.0_wp)
      do period = 1, settling
         if (is_newmark(what)) then
            call advance_newmark(kernel%rule, kernel%pitch, kernel%states, smallest, largest, kernel%gain)
         else
            call advance_lanes(kernel%rule, kernel%pitch, kernel%states, smallest, largest, kernel%gain)
         end if
      end do
      allocate (kernel%tangents(lanes, 2*kernel%modes, 2*kernel%modes))
      call set_tangents(kernel%tangents)
      call count_crossings(kernel)
   end subroutine new_kernel

   !> Newmark's method, not collocation.
   pure function is_newmark(what) result(yes)
      !> What is timed.
      integer, intent(in) :: what
      !> It is.
      logical :: yes

      yes = what == period_newmark .or. what == gain_newmark .or. what == tangents_newmark
   end function is_newmark

   !> One tangent along each component of a state.
   pure subroutine set_tangents(tangents)
      !> The tangents, shape (lanes, count, count).
      real(wp), intent(out) :: tangents(:, :, :)

      integer :: c

      tangents = 0.0_wp
      do c = 1, size(tangents, 2)
         tangents(:, c, c) = 1.0_wp
      end do
   end subroutine set_tangents

   !> Steps at whose ends the deflection is on different branches.
   subroutine count_crossings(kernel)
      !> The loop.
      type(kernel_type), intent(inout) :: kernel

      type(lane_record) :: record
      real(wp), dimension(lanes) :: smallest, largest
      real(wp) :: deflection
      integer, dimension(lanes) :: before, after
      integer :: s, lane, in_steps, in_points

      associate (all_steps => kernel%pitch%steps)
         allocate (record%re(lanes, most_modes, 0:all_steps), record%im(lanes, most_modes, 0:all_steps), &
                   record%force(lanes, 0:all_steps), source=0.0_wp)
         if (is_newmark(kernel%what)) then
            call advance_newmark(kernel%rule, kernel%pitch, kernel%states, smallest, largest, record=record)
         else
            call advance_lanes(kernel%rule, kernel%pitch, kernel%states, smallest, largest, record=record)
         end if
         in_steps = 0
         in_points = 0
         do s = 0, all_steps
            do lane = 1, lanes
               deflection = kernel%rule%static(lane) + kernel%pitch%error(2*s) + sum(record%re(lane, :kernel%modes, s))
               after(lane) = 0
               if (abs(deflection) >= kernel%pitch%half_backlash) after(lane) = nint(sign(1.0_wp, deflection))
            end do
            if (s > 0) then
               if (any(before /= after)) in_steps = in_steps + 1
               in_points = in_points + count(before /= after)
            end if
            before = after
         end do
         kernel%crossing_steps = real(in_steps, wp)/real(all_steps, wp)
         kernel%crossing_points = real(in_points, wp)/real(all_steps*lanes, wp)
      end associate
   end subroutine count_crossings

   !> So many rounds that a repetition takes a given time.
   subroutine choose_rounds(kernel, seconds)
      !> The loop.
      type(kernel_type), intent(inout) :: kernel
      !> The time [s].
      real(wp), intent(in) :: seconds

      real(wp) :: spent

      do
         ! The shorter of two: the first call after others is a slow one.
         spent = time_of(kernel)
         spent = min(spent, time_of(kernel))
         if (spent > 0.2_wp*seconds) exit
         kernel%rounds = 4_int64*kernel%rounds
      end do
      kernel%rounds = max(1_int64, int(seconds/spent*real(kernel%rounds, wp), int64))
   end subroutine choose_rounds

   !> Time of a repetition [s].
   function time_of(kernel) result(seconds)
      !> The loop.
      type(kernel_type), intent(inout) :: kernel
      !> The time.
      real(wp) :: seconds

      real(wp), dimension(lanes) :: smallest, largest
      integer(int64) :: round
      integer :: carried

      if (kernel%what == tangents_newmark .or. kernel%what == tangents_collocation) call set_tangents(kernel%tangents)
      smallest = 0.0_wp
      seconds = clock()
      do round = 1, kernel%rounds
         select case (kernel%what)
         case (period_newmark)
            call advance_newmark(kernel%rule, kernel%pitch, kernel%states, smallest, largest)
         case (period_collocation)
            call advance_lanes(kernel%rule, kernel%pitch, kernel%states, smallest, largest)
         case (gain_newmark)
            call advance_newmark(kernel%rule, kernel%pitch, kernel%states, smallest, largest, kernel%gain)
         case (gain_collocation)
            call advance_lanes(kernel%rule, kernel%pitch, kernel%states, smallest, largest, kernel%gain)
         case (tangents_newmark)
            ! They decay over the periods; numbers too small for the processor's fast path would be another kernel.
            if (mod(round, 8_int64) == 0) call set_tangents(kernel%tangents)
            call carry_newmark(kernel%rule, kernel%pitch%steps, kernel%gain, 2*kernel%modes, kernel%tangents)
         case (tangents_collocation)
            if (mod(round, 8_int64) == 0) call set_tangents(kernel%tangents)
            call carry_lane_tangents(kernel%rule, kernel%pitch%steps, kernel%gain, 2*kernel%modes, kernel%tangents, carried)
         case (peak_few)
            call add_few(smallest)
         case (peak_many)
            call add_many(smallest)
         end select
      end do
      seconds = clock() - seconds
      dust = dust + smallest(1)
      if (allocated(kernel%tangents)) dust = dust + kernel%tangents(1, 1, 1)
   end function time_of

   !> Fused multiply-adds that do not wait for each other, few at a time.
   pure subroutine add_few(total)
      !> Something to add to.
      real(wp), intent(inout) :: total(lanes)

      real(wp), dimension(lanes) :: a, b, c, d, e, factor
      integer :: k, l

      factor = 0.999_wp
      a = total
      b = total + 1.0_wp
      c = total + 2.0_wp
      d = total + 3.0_wp
      e = total + 4.0_wp
      do k = 1, turns
         do l = 1, lanes
            a(l) = a(l)*factor(l) + 0.001_wp
            b(l) = b(l)*factor(l) + 0.001_wp
            c(l) = c(l)*factor(l) + 0.001_wp
            d(l) = d(l)*factor(l) + 0.001_wp
            e(l) = e(l)*factor(l) + 0.001_wp
         end do
      end do
      total = 0.1_wp*(a + b + c + d + e)
   end subroutine add_few

   !> The same, many at a time.
   pure subroutine add_many(total)
      !> Something to add to.
      real(wp), intent(inout) :: total(lanes)

      real(wp), dimension(lanes) :: a, b, c, d, e, f, g, h, i_, j_, factor
      integer :: k, l

      factor = 0.999_wp
      a = total
      b = total + 1.0_wp
      c = total + 2.0_wp
      d = total + 3.0_wp
      e = total + 4.0_wp
      f = total + 5.0_wp
      g = total + 6.0_wp
      h = total + 7.0_wp
      i_ = total + 8.0_wp
      j_ = total + 9.0_wp
      do k = 1, turns
         do l = 1, lanes
            a(l) = a(l)*factor(l) + 0.001_wp
            b(l) = b(l)*factor(l) + 0.001_wp
            c(l) = c(l)*factor(l) + 0.001_wp
            d(l) = d(l)*factor(l) + 0.001_wp
            e(l) = e(l)*factor(l) + 0.001_wp
            f(l) = f(l)*factor(l) + 0.001_wp
            g(l) = g(l)*factor(l) + 0.001_wp
            h(l) = h(l)*factor(l) + 0.001_wp
            i_(l) = i_(l)*factor(l) + 0.001_wp
            j_(l) = j_(l)*factor(l) + 0.001_wp
         end do
      end do
      total = 0.1_wp*(a + b + c + d + e + f + g + h + i_ + j_)
   end subroutine add_many

   !> Time since some moment [s].
   function clock() result(now)
      !> Time.
      real(wp) :: now

      integer(int64) :: count, rate

      call system_clock(count, rate)
      now = real(count, wp)/real(rate, wp)
   end function clock

   !> Median.
   pure function median(values) result(middle)
      !> Values, at least one.
      real(wp), intent(in) :: values(:)
      !> Their median.
      real(wp) :: middle

      real(wp) :: sorted(size(values)), value
      integer :: k, place, n

      n = size(values)
      do k = 1, n
         value = values(k)
         place = count(values(:k - 1) <= value) + 1
         sorted(place + 1:k) = sorted(place:k - 1)
         sorted(place) = value
      end do
      middle = 0.5_wp*(sorted((n + 1)/2) + sorted(n/2 + 1))
   end function median

   !> Print what was found of a loop.
   subroutine print_kernel(kernel)
      !> The loop.
      type(kernel_type), intent(in) :: kernel

      character(len=*), parameter :: form = '(3a, i0, a, i0, 3a, i0, 4(a, es13.6), a)'
      character(len=:), allocatable :: unit
      integer(int64) :: items

      unit = 'point-steps'
      items = kernel%rounds*int(lanes, int64)
      select case (kernel%what)
      case (peak_few)
         unit = 'operations'
         items = items*2_int64*int(few*turns, int64)
      case (peak_many)
         unit = 'operations'
         items = items*2_int64*int(many*turns, int64)
      case (tangents_newmark, tangents_collocation)
         unit = 'tangent-steps'
         items = items*int(kernel%pitch%steps, int64)*int(2*kernel%modes, int64)
      case default
         items = items*int(kernel%pitch%steps, int64)
      end select
      write (output_unit, form) '{"kernel": "', kernel%name, '", "modes": ', kernel%modes, ', "steps": ', kernel%pitch%steps, &
         ', "unit": "', unit, '", "items": ', items, ', "best_seconds": ', minval(kernel%seconds), &
         ', "median_seconds": ', median(kernel%seconds), ', "crossing_steps": ', kernel%crossing_steps, &
         ', "crossing_points": ', kernel%crossing_points, '}'
   end subroutine print_kernel

end program time_kernels
