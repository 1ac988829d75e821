!> Brute force: integrates points for as many mesh periods as asked for, without looking for anything, and says what the motion
!> is at the end. It shows that a motion stays what the search says it is; `reference_motion` shows that the numbers are right.
!>
!> usage: brute_force DECK POINTS PERIODS SOFT_PERIODS PART PARTS
!>
!> POINTS has a line `speed,support_stiffness,...` for every point after one of titles; stiffness 0 is the rigid support. Supports
!> up to 1e5 N/m run for SOFT_PERIODS. The program takes every PARTS-th point from PART on and prints a line
!> `speed,support_stiffness,periods,motion,y1_amplitude` each; motion 0 is not periodic.
program brute_force
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_period_map, only: orbit_type
   use spurflex_integrate_steps, only: first_steps
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: read_deck
   use spurflex_measure_motion, only: motion_measure
   use spurflex_measure_response, only: empty_response, response
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_parameters, only: operating_point, support_flexible, support_rigid
   implicit none

   !> Longest motion told apart, and the relative distance of sections that repeat.
   integer, parameter :: longest = 64
   real(wp), parameter :: repeats = 1.0e-5_wp
   !> Support stiffness up to which the transient is slow [N/m].
   real(wp), parameter :: soft = 1.001e5_wp

   type(case_type) :: case
   type(error_type), allocatable :: error
   type(operating_point) :: point
   character(len=4096) :: word(6), line
   integer :: unit, stat, number, periods, soft_periods, part, parts, i

   do i = 1, size(word)
      call get_command_argument(i, word(i))
   end do
   call read_deck(trim(word(1)), case, error)
   if (allocated(error)) then
      write (error_unit, '(a)') error%message
      stop 2
   end if
   read (word(3:6), *) periods, soft_periods, part, parts
   open (newunit=unit, file=trim(word(2)), status='old', action='read', iostat=stat)
   if (stat /= 0) then
      write (error_unit, '(2a)') 'cannot read ', trim(word(2))
      stop 2
   end if
   read (unit, '(a)', iostat=stat) line
   if (stat /= 0) stop 2
   number = 0
   do
      read (unit, '(a)', iostat=stat) line
      if (stat /= 0) exit
      number = number + 1
      if (modulo(number, parts) /= modulo(part, parts)) cycle
      read (line, *) point%speed, point%support_stiffness
      point%support = merge(support_flexible, support_rigid, point%support_stiffness > 0.0_wp)
      call run_point(new_equations(case%gears, case%box, case%load, point), &
                     merge(soft_periods, periods, point%support_stiffness > 0.0_wp .and. point%support_stiffness < soft))
   end do
   close (unit)

contains

   !> Integrate one point from its static equilibrium and print what it ends on.
   subroutine run_point(equations, periods)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Mesh periods.
      integer, intent(in) :: periods

      type(collocation_map) :: map
      type(orbit_type) :: orbit
      type(motion_measure) :: measure
      type(response) :: answer
      type(error_type), allocatable :: error
      real(wp), allocatable :: state(:), first(:)
      real(wp) :: rest(equations%n)
      integer :: k, motion

      call map%load(equations, 2*first_steps(equations), error)
      if (allocated(error)) stop 1
      rest = 0.0_wp
      allocate (state(map%size))
      state = map%to_state(rest, rest)
      do k = 1, periods
         call map%advance(state)
      end do
      allocate (first, source=state)
      motion = 0
      answer = empty_response()
      call measure%reset(equations%static_observation)
      do k = 1, longest
         call map%advance(state, orbit=orbit)
         call measure%add(orbit)
         if (norm2(map%weight*(state - first)) > repeats*norm2(map%weight*first)) cycle
         motion = k
         exit
      end do
      call measure%finish(answer)
      write (output_unit, '(2(es24.16e3, a), 2(i0, a), es24.16e3)') point%speed, ',', point%support_stiffness, ',', periods, ',', &
         motion, ',', answer%y1_amplitude
      flush (output_unit)
   end subroutine run_point

end program brute_force
