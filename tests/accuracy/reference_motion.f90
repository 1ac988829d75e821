!> The steady motion of single operating points by brute force: the reference that results are judged by.
!>
!> usage: reference_motion DECK POINTS OUTPUT [TOLERANCE]
!>        reference_motion --order DECK SPEED STIFFNESS
!>
!> POINTS has a line `speed,support_stiffness,start,periods` for every point after one of titles; stiffness 0 is the rigid support.
!> Every point becomes a line of OUTPUT. Points do not depend on each other: several processes may share them.
!>
!> A point is integrated for that many mesh periods from its start, or until it repeats to round-off and small differences of it
!> are seen to die out. A motion that repeats after n <= 64 periods is made exact by Newton's method on the map over n periods,
!> derivatives by differences; it counts only if it is stable and the integrated motion comes nearer to it. Everything else is told
!> apart by the growth of the distance of two neighbouring motions.
program reference_motion
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
   use paper_flow, only: flow_type, motion_seen, new_flow, advance_period, fixed_steps, length_of, n_state
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: read_deck
   use spurflex_model_parameters, only: operating_point, support_rigid, support_flexible
   implicit none

   !> Longest motion looked for, in mesh periods.
   integer, parameter :: longest = 64

   !> Classes of motion that are not a number of mesh periods.
   integer, parameter :: unresolved = 0, quasi_periodic = -1, chaotic = -2

   !> Sections this near repeat to round-off; a motion this near to a stable one is on it; one this near may be; in the units of
   !> the state.
   real(wp), parameter :: repeats = 1.0e-10_wp, arrived = 1.0e-6_wp, candidate = 3.0e-2_wp

   !> Share of the distance half of the periods ago that a motion on its way must have fallen below.
   real(wp), parameter :: nearer = 0.8_wp

   !> Share of the distance of sections that a longer period must stay below to be tried.
   real(wp), parameter :: clearly_nearer = 0.5_wp

   !> Mesh periods between two looks whether the motion repeats.
   integer, parameter :: look_every = 128

   !> Difference of the states whose growth is followed, and of those that give derivatives.
   real(wp), parameter :: neighbour = 1.0e-7_wp, small_difference = 1.0e-6_wp

   !> Mesh periods over which growth is followed at most; in a block of it.
   integer, parameter :: most_growth = 12000, block = 100

   !> Growth of a distance in all that says nothing, and standard errors that say something.
   real(wp), parameter :: neutral = 20.0_wp, significance = 4.0_wp

   !> Mesh periods over which a motion that is not periodic is seen.
   integer, parameter :: window = 500

   !> What is found at a point.
   type :: found_type
      integer :: motion = unresolved
      !> Mesh periods integrated from the start.
      integer :: periods = 0
      !> Stable periodic motion: its section.
      real(wp) :: section(n_state) = 0.0_wp
      !> Largest modulus of the multipliers; distances of the integrated motion from it at the end and half of the periods before.
      real(wp) :: multiplier = 0.0_wp, distance = 0.0_wp, distance_before = 0.0_wp
      !> Growth of the distance of neighbours [1/mesh period], its standard error.
      real(wp) :: exponent = 0.0_wp, exponent_error = 0.0_wp
   end type found_type

   type :: request_type
      real(wp) :: speed = 0.0_wp, stiffness = 0.0_wp
      character(len=8) :: start = 'static'
      integer :: periods = 0
   end type request_type

   character(len=512) :: words(4)
   type(case_type) :: case
   integer :: i

   words = ''
   do i = 1, min(command_argument_count(), size(words))
      call get_command_argument(i, words(i))
   end do
   if (words(1) == '--order') then
      call read_case(trim(words(2)))
      call print_order()
   else if (command_argument_count() >= 3) then
      call read_case(trim(words(1)))
      call work_on_points()
   else
      call give_up('usage: reference_motion DECK POINTS OUTPUT [TOLERANCE]')
   end if

contains

   !> Read the deck.
   subroutine read_case(file)
      !> File.
      character(len=*), intent(in) :: file

      type(error_type), allocatable :: error

      call read_deck(file, case, error)
      if (allocated(error)) call give_up(error%message)
   end subroutine read_case

   !> Stop with a message.
   subroutine give_up(message)
      !> Message.
      character(len=*), intent(in) :: message

      write (error_unit, '(a)') message
      stop 1
   end subroutine give_up

   !> The equations of a point.
   function flow_at(speed, stiffness, tolerance) result(flow)
      !> Speed [rev/min] and support stiffness [N/m], 0 for a rigid support.
      real(wp), intent(in) :: speed, stiffness
      !> Local error.
      real(wp), intent(in) :: tolerance
      !> The equations.
      type(flow_type) :: flow

      type(operating_point) :: point

      point%support = merge(support_flexible, support_rigid, stiffness > 0.0_wp)
      point%speed = speed
      point%support_stiffness = stiffness
      flow = new_flow(case, point, tolerance)
   end function flow_at

   !> Take points as long as there are any.
   subroutine work_on_points()
      type(request_type), allocatable :: requests(:)
      real(wp) :: tolerance
      integer :: unit, number, stat

      tolerance = 1.0e-12_wp
      if (len_trim(words(4)) > 0) read (words(4), *) tolerance
      call read_requests(trim(words(2)), requests)
      open (newunit=unit, file=trim(words(3)), status='replace', action='write', iostat=stat)
      if (stat /= 0) call give_up(trim(words(3))//': cannot be written')
      write (unit, '(a)') 'speed,support_stiffness,start,periods_asked,periods,motion,y1_amplitude,y1_rms,y1_max,y1_min,'// &
         'bearing1_deformation_max,bearing2_deformation_max,smallest_deflection,largest_deflection,floquet_magnitude,'// &
         'distance,distance_before,lyapunov_exponent,lyapunov_error,steps,crossings,seconds'
      do number = 1, size(requests)
         call solve_point(requests(number), tolerance, unit)
      end do
      close (unit)
   end subroutine work_on_points

   !> Read the list of points.
   subroutine read_requests(file, requests)
      !> File.
      character(len=*), intent(in) :: file
      !> Points.
      type(request_type), allocatable, intent(out) :: requests(:)

      type(request_type) :: request
      integer :: unit, stat

      allocate (requests(0))
      open (newunit=unit, file=file, status='old', action='read', iostat=stat)
      if (stat /= 0) call give_up(file//': cannot be read')
      read (unit, *, iostat=stat)
      if (stat /= 0) call give_up(file//': no line of titles')
      do
         read (unit, *, iostat=stat) request%speed, request%stiffness, request%start, request%periods
         if (stat /= 0) exit
         if (request%start /= 'static' .and. request%start /= 'rest') call give_up('start '//trim(request%start)//'?')
         requests = [requests, request]
      end do
      close (unit)
   end subroutine read_requests

   !> Find and measure the motion of one point, and write its line.
   subroutine solve_point(request, tolerance, unit)
      !> Point.
      type(request_type), intent(in) :: request
      !> Local error.
      real(wp), intent(in) :: tolerance
      !> Output.
      integer, intent(in) :: unit

      type(flow_type) :: flow
      type(found_type) :: found
      type(motion_seen) :: seen
      real(wp) :: state(n_state), began, ended, mean, nan
      integer :: k

      call cpu_time(began)
      flow = flow_at(request%speed, request%stiffness, tolerance)
      state = 0.0_wp
      if (request%start == 'rest') state(:size(flow%static)) = -flow%static
      call settle(flow, state, request%periods, found)
      nan = ieee_value(1.0_wp, ieee_quiet_nan)
      if (found%motion <= 0) then
         call follow_growth(flow, state, min(most_growth, request%periods/2), found)
         found%multiplier = nan
         do k = 1, window
            call advance_period(flow, state, seen)
         end do
      else
         found%exponent = log(max(found%multiplier, tiny(1.0_wp)))/real(found%motion, wp)
         state = found%section
         do k = 1, found%motion
            call advance_period(flow, state, seen)
         end do
      end if
      mean = seen%integral/seen%time
      call cpu_time(ended)
      write (unit, '(2(es23.16, ","), a, ",", 3(i0, ","), 13(es23.16, ","), 2(i0, ","), f0.3)') request%speed, &
         request%stiffness, trim(request%start), request%periods, found%periods, found%motion, &
         0.5_wp*(seen%y1(2) - seen%y1(1)), sqrt(max(seen%integral_square/seen%time - mean**2, 0.0_wp)), &
         flow%static(2) + seen%y1(2), flow%static(2) + seen%y1(1), sqrt(seen%bearing_square), seen%deflection, &
         found%multiplier, found%distance, found%distance_before, found%exponent, found%exponent_error, &
         flow%steps, flow%crossings, ended - began
      flush (unit)
      if (flow%failed) write (error_unit, '(a, 2es12.5)') 'the integration broke down at ', request%speed, request%stiffness
   end subroutine solve_point

   !> Integrate from the start until the motion repeats, or as long as is asked for; find the periodic motion it is on.
   subroutine settle(flow, state, periods, found)
      !> Equations.
      type(flow_type), intent(inout) :: flow
      !> Start before, last section after.
      real(wp), intent(inout) :: state(n_state)
      !> Mesh periods at most.
      integer, intent(in) :: periods
      !> What is found.
      type(found_type), intent(inout) :: found

      real(wp) :: latest(n_state, 0:longest), halfway(n_state, 0:longest), nearest, distance
      integer :: k, next_look, n

      next_look = look_every
      halfway = 0.0_wp
      latest = 0.0_wp
      latest(:, 0) = state
      do k = 1, periods
         call advance_period(flow, state)
         if (flow%failed) return
         latest(:, 1:) = latest(:, :longest - 1)
         latest(:, 0) = state
         found%periods = k
         if (k == periods/2) halfway = latest
         if (k < next_look) cycle
         next_look = next_look + look_every
         do n = 1, longest
            if (length_of(flow, state - latest(:, n)) > repeats) cycle
            call make_exact(flow, state, n, found)
            if (found%motion > 0) found%distance_before = 0.0_wp
            if (found%motion > 0 .and. found%distance <= arrived) return
            found%motion = unresolved
            next_look = 2*k
            exit
         end do
      end do
      nearest = candidate
      do n = 1, longest
         ! A longer period only where it comes clearly nearer to repeating.
         distance = length_of(flow, state - latest(:, n))
         if (distance > nearest) cycle
         nearest = clearly_nearer*distance
         call make_exact(flow, state, n, found)
         if (found%motion == unresolved) cycle
         ! The section as many whole motions before the end as half of the periods hold.
         found%distance_before = length_of(flow, halfway(:, modulo(periods/2 - periods, found%motion)) - found%section)
         if (found%distance <= arrived) return
         if (found%distance <= candidate .and. found%distance < nearer*found%distance_before) return
         found%motion = unresolved
      end do
   end subroutine settle

   !> The periodic motion next to a section by Newton's method, derivatives by differences; found only if it is stable.
   subroutine make_exact(flow, state, n, found)
      !> Equations.
      type(flow_type), intent(inout) :: flow
      !> Section.
      real(wp), intent(in) :: state(n_state)
      !> Mesh periods after which it repeats.
      integer, intent(in) :: n
      !> What is found: motion, section, multiplier and distance.
      type(found_type), intent(inout) :: found

      integer, parameter :: most_iterations = 20
      real(wp), parameter :: exact = 1.0e-12_wp, at_least = 1.0e-8_wp, slow = 0.1_wp, runaway = 1.0e3_wp, same = 1.0e-7_wp
      real(wp) :: section(n_state), image(n_state), jacobian(size(flow%active), size(flow%active))
      real(wp) :: step(n_state), length, previous
      integer :: iteration, shortest
      logical :: is_new

      found%motion = unresolved
      section = state
      length = huge(1.0_wp)
      is_new = .true.
      do iteration = 1, most_iterations
         image = section
         call advance(flow, image, n)
         if (is_new) call differentiate(flow, section, n, jacobian)
         call newton_step(flow, jacobian, image - section, step)
         previous = length
         length = length_of(flow, step)
         if (.not. length < runaway) return
         section = section + step
         if (length <= exact .or. (length <= at_least .and. length > 0.3_wp*previous)) exit
         is_new = length > slow*previous
         if (iteration == most_iterations) return
      end do
      ! The shortest period, and the derivatives at the motion itself: while a motion dies out turning around its end, a multiple of
      ! the period can be what repeats first.
      image = section
      do shortest = 1, n
         call advance(flow, image, 1)
         if (length_of(flow, image - section) <= same .or. shortest == n) exit
      end do
      call differentiate(flow, section, shortest, jacobian)
      found%multiplier = spectral_radius(jacobian)
      if (.not. found%multiplier < 1.0_wp) return
      found%motion = shortest
      found%section = section
      found%distance = length_of(flow, section - state)
   end subroutine make_exact

   !> Advance a section by some periods.
   subroutine advance(flow, state, n)
      !> Equations.
      type(flow_type), intent(inout) :: flow
      !> Section.
      real(wp), intent(inout) :: state(n_state)
      !> Mesh periods.
      integer, intent(in) :: n

      integer :: k

      do k = 1, n
         call advance_period(flow, state)
      end do
   end subroutine advance

   !> Derivative of the map over some periods, in the units of the state, by differences to both sides.
   subroutine differentiate(flow, section, n, jacobian)
      !> Equations.
      type(flow_type), intent(inout) :: flow
      !> Section.
      real(wp), intent(in) :: section(n_state)
      !> Mesh periods.
      integer, intent(in) :: n
      !> Derivative by the components that move.
      real(wp), intent(out) :: jacobian(:, :)

      real(wp) :: moved(n_state, 2)
      integer :: j, side

      do j = 1, size(flow%active)
         associate (c => flow%active(j))
            do side = 1, 2
               moved(:, side) = section
               moved(c, side) = moved(c, side) + real(3 - 2*side, wp)*small_difference*flow%unit(c)
               call advance(flow, moved(:, side), n)
            end do
            jacobian(:, j) = (moved(flow%active, 1) - moved(flow%active, 2))/(2.0_wp*small_difference*flow%unit(flow%active))
         end associate
      end do
   end subroutine differentiate

   !> Newton's step (1 - J)^-1 (image - section).
   subroutine newton_step(flow, jacobian, residual, step)
      !> Equations.
      type(flow_type), intent(in) :: flow
      !> J.
      real(wp), intent(in) :: jacobian(:, :)
      !> Image less section.
      real(wp), intent(in) :: residual(n_state)
      !> The step.
      real(wp), intent(out) :: step(n_state)

      real(wp) :: a(size(jacobian, 1), size(jacobian, 1) + 1), row(size(jacobian, 1) + 1)
      integer :: i, k, m, pivot

      m = size(jacobian, 1)
      a(:, :m) = -jacobian
      do i = 1, m
         a(i, i) = a(i, i) + 1.0_wp
      end do
      a(:, m + 1) = residual(flow%active)/flow%unit(flow%active)
      do k = 1, m
         pivot = k - 1 + maxloc(abs(a(k:, k)), 1)
         row = a(pivot, :)
         a(pivot, :) = a(k, :)
         a(k, :) = row/sign(max(abs(row(k)), tiny(1.0_wp)), row(k))
         do i = 1, m
            if (i /= k) a(i, k + 1:) = a(i, k + 1:) - a(i, k)*a(k, k + 1:)
         end do
      end do
      step = 0.0_wp
      step(flow%active) = a(:, m + 1)*flow%unit(flow%active)
   end subroutine newton_step

   !> Largest modulus of the eigenvalues, from the growth of the powers 2, 4, 8, ...
   function spectral_radius(matrix) result(radius)
      !> Matrix.
      real(wp), intent(in) :: matrix(:, :)
      !> The radius.
      real(wp) :: radius

      integer, parameter :: squarings = 40
      real(wp) :: power(size(matrix, 1), size(matrix, 1)), norm, logarithm, share
      integer :: k

      power = matrix
      logarithm = 0.0_wp
      share = 1.0_wp
      do k = 0, squarings
         norm = norm2(power)
         radius = 0.0_wp
         if (.not. norm > 0.0_wp) return
         logarithm = logarithm + share*log(norm)
         share = 0.5_wp*share
         power = power/norm
         power = matmul(power, power)
      end do
      radius = exp(logarithm)
   end function spectral_radius

   !> Growth of the distance of two neighbours, its error from blocks of periods; the class that follows from it.
   subroutine follow_growth(flow, state, periods, found)
      !> Equations.
      type(flow_type), intent(inout) :: flow
      !> Section; moves on.
      real(wp), intent(inout) :: state(n_state)
      !> Mesh periods.
      integer, intent(in) :: periods
      !> Exponent, its error and the class.
      type(found_type), intent(inout) :: found

      real(wp) :: other(n_state), away(n_state), mean
      real(wp), allocatable :: growth(:)
      integer :: i, k, blocks

      away = 0.0_wp
      away(flow%active) = flow%unit(flow%active)
      away = neighbour*away/length_of(flow, away)
      ! The difference takes its own direction first.
      blocks = max(periods/block, 2)
      allocate (growth(-3:blocks), source=0.0_wp)
      do i = -3, blocks
         do k = 1, block
            other = state + away
            call advance_period(flow, other)
            call advance_period(flow, state)
            away = other - state
            growth(i) = growth(i) + log(length_of(flow, away)/neighbour)
            away = neighbour*away/length_of(flow, away)
         end do
      end do
      growth = growth(1:)/real(block, wp)
      mean = sum(growth)/real(blocks, wp)
      found%exponent = mean
      found%exponent_error = sqrt(sum((growth - mean)**2)/real(blocks*(blocks - 1), wp))
      found%motion = unresolved
      if (mean > significance*found%exponent_error .and. mean*real(blocks*block, wp) > neutral) then
         found%motion = chaotic
      else if (abs(mean)*real(blocks*block, wp) <= neutral) then
         found%motion = quasi_periodic
      end if
   end subroutine follow_growth

   !> Print errors of a period in contact made with steps of one length, and the order that they show.
   subroutine print_order()
      integer, parameter :: counts(5) = [10, 14, 20, 28, 40], finest = 640
      type(flow_type) :: flow
      real(wp) :: exact(n_state), state(n_state), error, previous, speed, stiffness
      integer :: k, last

      read (words(3), *) speed
      read (words(4), *) stiffness
      flow = flow_at(speed, stiffness, 1.0_wp)
      exact = 0.0_wp
      call fixed_steps(flow, finest, exact)
      write (output_unit, '(a)') 'steps,error,order'
      do k = 1, size(counts)
         state = 0.0_wp
         call fixed_steps(flow, counts(k), state)
         error = length_of(flow, state - exact)
         if (k > 1) write (output_unit, '(i0, ",", es12.5, ",", f0.3)') counts(k), error, &
            log(previous/error)/log(real(counts(k), wp)/real(last, wp))
         previous = error
         last = counts(k)
      end do
   end subroutine print_order

end program reference_motion
