!> Time the solution of single operating points on a flexible support.
!>
!> usage: time_points DECK REPEATS < POINTS
!>
!> POINTS has a line `speed support_stiffness` [rev/min, N/m] for every point. The list is solved with the deck's solver, each
!> point from its start (`static` or `rest`), and without Floquet multipliers, for which an amplitude has no use. Prints one JSON
!> line a point: `seconds` is the median of the time of 64 copies of the point, which share lanes and modes as the points of a tile
!> do, over 64; `list_seconds` the median time of the whole list at once over the number of points. Both count from the start of a
!> point to its response: equations, modes and tables of the excitation are made in that time. Slow points are solved eight at a
!> time, and what is slow is repeated less than REPEATS times.
program time_points
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: iso_fortran_env, only: error_unit, input_unit, int64, output_unit
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_external_threads, only: use_one_thread
   use spurflex_integrate_options, only: start_rest
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: read_deck
   use spurflex_measure_points, only: new_solver, solver_type, respond
   use spurflex_measure_response, only: response
   use spurflex_model_equations, only: equations_type, new_equations, rest_deviation
   use spurflex_model_parameters, only: operating_point, support_flexible
   implicit none

   !> Copies of a point that are solved side by side for its time: as many as share a tile, or as fill the lanes.
   integer, parameter :: company = 64, lanes = 8

   !> Time for which the copies of a point, and the list, are solved again [s], and the time of a full set of lanes from which on a
   !> point is slow [s].
   real(wp), parameter :: patience = 0.5_wp, slow = 0.05_wp

   character(len=1024) :: deck, word
   type(case_type) :: case
   type(error_type), allocatable :: error
   type(operating_point), allocatable :: points(:)
   type(response), allocatable :: answers(:)
   real(wp), allocatable :: seconds(:)
   real(wp) :: list_seconds
   integer :: repeats, stat, i

   if (command_argument_count() /= 2) call give_up('usage: time_points DECK REPEATS < POINTS')
   call get_command_argument(1, deck)
   call get_command_argument(2, word)
   read (word, *, iostat=stat) repeats
   if (stat /= 0 .or. repeats < 1) call give_up('REPEATS must be a positive integer')
   call read_deck(trim(deck), case, error)
   if (allocated(error)) call give_up(error%message)
   case%solver%multipliers = .false.
   call use_one_thread()
   call read_points(points)

   allocate (answers(size(points)), seconds(size(points)))
   do i = 1, size(points)
      call time_point(case, points(i), repeats, seconds(i))
   end do
   call time_list(case, points, repeats, answers, list_seconds)
   do i = 1, size(points)
      call print_answer(points(i), answers(i), seconds(i), list_seconds/real(size(points), wp))
   end do

contains

   !> Stop with a message.
   subroutine give_up(message)
      !> Message.
      character(len=*), intent(in) :: message

      write (error_unit, '(a)') message
      stop 1
   end subroutine give_up

   !> Read the points on standard input.
   subroutine read_points(list)
      !> Points.
      type(operating_point), allocatable, intent(out) :: list(:)

      type(operating_point) :: point
      real(wp) :: speed, stiffness

      allocate (list(0))
      point%support = support_flexible
      do
         read (input_unit, *, iostat=stat) speed, stiffness
         if (stat /= 0) exit
         point%speed = speed
         point%support_stiffness = stiffness
         list = [list, point]
      end do
   end subroutine read_points

   !> Time a point among copies of itself.
   subroutine time_point(problem, point, most, seconds)
      !> Case.
      type(case_type), intent(in) :: problem
      !> Point.
      type(operating_point), intent(in) :: point
      !> Solutions at most.
      integer, intent(in) :: most
      !> Time of one copy [s].
      real(wp), intent(out) :: seconds

      type(response) :: copies(company)
      real(wp) :: first

      call solve(problem, spread(point, 1, lanes), copies(:lanes), first)
      seconds = first/real(lanes, wp)
      if (first > slow) return
      call time_list(problem, spread(point, 1, company), most, copies, seconds)
      seconds = seconds/real(company, wp)
   end subroutine time_point

   !> Time a list that is solved at once.
   subroutine time_list(problem, list, most, responses, seconds)
      !> Case.
      type(case_type), intent(in) :: problem
      !> Points.
      type(operating_point), intent(in) :: list(:)
      !> Solutions at most.
      integer, intent(in) :: most
      !> What is found, shape (points).
      type(response), intent(out) :: responses(:)
      !> Time [s].
      real(wp), intent(out) :: seconds

      real(wp) :: times(most)
      integer :: k

      do k = 1, most
         call solve(problem, list, responses, times(k))
         if (sum(times(:k)) > patience) exit
      end do
      seconds = median(times(:min(k, most)))
   end subroutine time_list

   !> Solve points side by side.
   subroutine solve(problem, list, responses, seconds)
      !> Case.
      type(case_type), intent(in) :: problem
      !> Points.
      type(operating_point), intent(in) :: list(:)
      !> What is found, shape (points).
      type(response), intent(out) :: responses(:)
      !> Time [s].
      real(wp), intent(out) :: seconds

      type(solver_type), allocatable :: solver
      type(no_attendant) :: nobody
      type(equations_type) :: equations(size(list))
      real(wp), allocatable :: positions(:, :), velocities(:, :)
      real(wp) :: began
      integer :: k

      began = clock()
      allocate (solver)
      call new_solver(problem%solver, solver)
      do k = 1, size(list)
         equations(k) = new_equations(problem%gears, problem%box, problem%load, list(k))
      end do
      call set_starts(problem, equations, positions, velocities)
      call respond(solver, equations, positions, velocities, nobody, responses)
      seconds = clock() - began
   end subroutine solve

   !> Where points start.
   subroutine set_starts(problem, equations, positions, velocities)
      !> Case.
      type(case_type), intent(in) :: problem
      !> Equations of motion of each point, shape (points).
      type(equations_type), intent(in) :: equations(:)
      !> Deviation from the static equilibrium and its rate, shape (n, points).
      real(wp), allocatable, intent(out) :: positions(:, :), velocities(:, :)

      integer :: k

      allocate (positions(equations(1)%n, size(equations)), velocities(equations(1)%n, size(equations)), source=0.0_wp)
      if (problem%solver%start /= start_rest) return
      do k = 1, size(equations)
         positions(:, k) = rest_deviation(equations(k))
      end do
   end subroutine set_starts

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

   !> Print what was found at a point.
   subroutine print_answer(point, answer, point_seconds, share_seconds)
      !> Point.
      type(operating_point), intent(in) :: point
      !> What was found.
      type(response), intent(in) :: answer
      !> Time of the point alone and its share of the time of the list [s].
      real(wp), intent(in) :: point_seconds, share_seconds

      write (output_unit, '(13a, 3(i0, a))') '{"speed": ', json(point%speed), ', "stiffness": ', json(point%support_stiffness), &
         ', "seconds": ', json(point_seconds), ', "list_seconds": ', json(share_seconds), &
         ', "amplitude": ', json(answer%y1_amplitude), ', "error_estimate": ', json(answer%error_estimate), &
         ', "motion": ', answer%motion, ', "status": ', answer%status, ', "periods_integrated": ', answer%periods_integrated, '}'
   end subroutine print_answer

   !> A number in JSON; null if it is none.
   pure function json(value) result(text)
      !> Number.
      real(wp), intent(in) :: value
      !> Text.
      character(len=:), allocatable :: text

      character(len=24) :: buffer

      text = 'null'
      if (.not. ieee_is_finite(value)) return
      write (buffer, '(es24.16e3)') value
      text = trim(adjustl(buffer))
   end function json

end program time_points
