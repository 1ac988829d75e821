!> What a result file is made of, without the file: axes, the table of variables, dates, decks compared, the lock.
module test_results
   use spurflex_base_error, only: exit_mismatch, fault => error_type
   use spurflex_base_kinds, only: i8, wp
   use spurflex_external_file_lock, only: acquire_lock, file_lock, release_lock
   use spurflex_io_axes, only: speeds, stiffnesses
   use spurflex_io_case, only: sweep_spec
   use spurflex_io_deck_difference, only: deck_difference
   use spurflex_io_provenance, only: iso_date
   use spurflex_io_results_layout, only: axes_of, axis_type, flags_of, flexible_variables, get_values, real_value, &
      rigid_variables, set_values, variable_type
   use spurflex_measure_response, only: empty_response, response
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_results

   character(len=1), parameter :: newline = new_line('a')

contains

   !> The tests of this suite.
   subroutine collect_results(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('round speeds are exact', test_round_speeds), &
                  new_unittest('end points are exact', test_end_points), &
                  new_unittest('decades are exact', test_decades), &
                  new_unittest('decades of other starts are exact', test_other_decades), &
                  new_unittest('stiffnesses are even in their logarithm', test_even), &
                  new_unittest('axes follow the support', test_axes), &
                  new_unittest('variables follow the support', test_variables), &
                  new_unittest('the status is written last', test_status_last), &
                  new_unittest('every quantity has its values', test_values), &
                  new_unittest('every flag has a word', test_flags), &
                  new_unittest('dates', test_dates), &
                  new_unittest('equal decks do not differ', test_equal_decks), &
                  new_unittest('differing decks are told apart by key', test_differing_decks), &
                  new_unittest('a lock has one holder', test_lock) &
                  ]
   end subroutine collect_results

   !> A spacing of a whole number of rev/min gives whole speeds.
   subroutine test_round_speeds(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer :: i

      associate (values => speeds(sweep_spec(speed_first=500.0_wp, speed_last=7000.0_wp, speed_count=651)))
         call check(error, size(values), 651)
         if (allocated(error)) return
         call check(error, all(abs(values - [(500.0_wp + 10.0_wp*real(i, wp), i=0, 650)]) <= 0.0_wp))
      end associate
   end subroutine test_round_speeds

   !> The ends are what the deck says to the last bit, also for one point and downwards.
   subroutine test_end_points(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: low = 0.1_wp, high = 7.3e5_wp
      integer :: count

      do count = 1, 100, 3
         associate (rising => speeds(sweep_spec(speed_first=low, speed_last=high, speed_count=count)), &
                    falling => stiffnesses(sweep_spec(stiffness_first=high, stiffness_last=low, stiffness_count=count)))
            call check(error, abs(rising(1) - low) <= 0.0_wp .and. abs(falling(1) - high) <= 0.0_wp)
            if (allocated(error)) return
            if (count == 1) cycle
            call check(error, abs(rising(count) - high) <= 0.0_wp .and. abs(falling(count) - low) <= 0.0_wp)
            if (allocated(error)) return
         end associate
      end do
      call check(error, size(stiffnesses(sweep_spec())), 0)
   end subroutine test_end_points

   !> Nine decades with ten points each pass through every power of ten.
   subroutine test_decades(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: powers(*) = [1.0e3_wp, 1.0e4_wp, 1.0e5_wp, 1.0e6_wp, 1.0e7_wp, 1.0e8_wp, 1.0e9_wp, &
         1.0e10_wp, 1.0e11_wp, 1.0e12_wp]

      associate (values => stiffnesses(sweep_spec(stiffness_first=1.0e3_wp, stiffness_last=1.0e12_wp, &
                                                 stiffness_count=91)))
         call check(error, all(abs(values(1:91:10) - powers) <= 0.0_wp))
      end associate
      if (allocated(error)) return
      associate (values => stiffnesses(sweep_spec(stiffness_first=1.0e12_wp, stiffness_last=1.0e3_wp, &
                                                 stiffness_count=91)))
         call check(error, all(abs(values(91:1:-10) - powers) <= 0.0_wp))
      end associate
   end subroutine test_decades

   !> Whole decades from any start differ by a power of ten exactly.
   subroutine test_other_decades(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      associate (values => stiffnesses(sweep_spec(stiffness_first=2.0e3_wp, stiffness_last=2.0e6_wp, stiffness_count=7)))
         call check(error, all(abs(values(1:7:2) - [2.0e3_wp, 2.0e4_wp, 2.0e5_wp, 2.0e6_wp]) <= 0.0_wp))
      end associate
   end subroutine test_other_decades

   !> The ratio of neighbours is the same everywhere, whole decades or not.
   subroutine test_even(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      ! A few roundings of the power and the quotient.
      real(wp), parameter :: tolerance = 16.0_wp*epsilon(1.0_wp)
      integer, parameter :: count = 38

      associate (whole => stiffnesses(sweep_spec(stiffness_first=1.0e3_wp, stiffness_last=1.0e8_wp, &
                                                stiffness_count=count)), &
                 other => stiffnesses(sweep_spec(stiffness_first=3.0e3_wp, stiffness_last=7.0e7_wp, &
                                                stiffness_count=count)))
         call check(error, maxval(abs(whole(2:)/whole(:count - 1)/(1.0e5_wp**(1.0_wp/real(count - 1, wp))) - 1.0_wp)) &
            <= tolerance)
         if (allocated(error)) return
         call check(error, maxval(abs(other(2:)/other(:count - 1)/((7.0e4_wp/3.0_wp)**(1.0_wp/real(count - 1, wp))) &
            - 1.0_wp)) <= tolerance)
      end associate
   end subroutine test_even

   !> There is no stiffness axis on a rigid support.
   subroutine test_axes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(axis_type), allocatable :: axes(:)

      allocate (axes, source=axes_of(grid_of(rigid=.true., flexible=.false.)))
      call check(error, size(axes), 1)
      if (allocated(error)) return
      call check(error, trim(axes(1)%name)//' '//trim(axes(1)%units), 'speed rpm')
      if (allocated(error)) return
      deallocate (axes)
      allocate (axes, source=axes_of(grid_of(rigid=.false., flexible=.true.)))
      call check(error, size(axes), 2)
      if (allocated(error)) return
      call check(error, trim(axes(2)%name)//' '//trim(axes(2)%units), 'support_stiffness N/m')
      if (allocated(error)) return
      call check(error, size(axes(1)%values) == 5 .and. size(axes(2)%values) == 3)
   end subroutine test_axes

   !> The names are those that scripts rely on; eta needs both supports.
   subroutine test_variables(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: before_eta = 'y1_amplitude y1_rms y1_max y1_min bearing1_deformation_max ' &
         //'bearing2_deformation_max '
      character(len=*), parameter :: behind_eta = 'error_estimate motion periods_integrated contact status '
      character(len=*), parameter :: rigid_names = 'rigid_y1_amplitude rigid_y1_rms rigid_y1_max rigid_y1_min ' &
         //'rigid_bearing1_deformation_max rigid_bearing2_deformation_max rigid_error_estimate rigid_motion ' &
         //'rigid_periods_integrated rigid_contact rigid_status '

      call check(error, names_of(flexible_variables(grid_of(rigid=.true., flexible=.true.))), &
         before_eta//'eta1 eta2 eta_error '//behind_eta)
      if (allocated(error)) return
      call check(error, names_of(flexible_variables(grid_of(rigid=.false., flexible=.true.))), before_eta//behind_eta)
      if (allocated(error)) return
      call check(error, names_of(flexible_variables(grid_of(rigid=.true., flexible=.false.))), '')
      if (allocated(error)) return
      call check(error, names_of(rigid_variables(grid_of(rigid=.true., flexible=.false.))), rigid_names)
      if (allocated(error)) return
      call check(error, names_of(rigid_variables(grid_of(rigid=.false., flexible=.true.))), '')
   end subroutine test_variables

   !> A point that was half written when a run was killed must not count as done.
   subroutine test_status_last(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(variable_type), allocatable :: variables(:)

      allocate (variables, source=flexible_variables(grid_of(rigid=.true., flexible=.true.)))
      call check(error, trim(variables(size(variables))%quantity), 'status')
   end subroutine test_status_last

   !> Each quantity of the table is taken from a response and, unless it compares two, put back.
   subroutine test_values(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(variable_type), allocatable :: variables(:)
      type(response) :: responses(1)
      real(wp), parameter :: eta(3, 1) = 0.0_wp, unset = -1.0_wp
      real(wp) :: reals(1)
      integer :: integers(1), i

      allocate (variables, source=flexible_variables(grid_of(rigid=.true., flexible=.true.)))
      responses = empty_response()
      do i = 1, size(variables)
         associate (quantity => variables(i)%quantity)
            call set_values(quantity, responses, [real(i, wp)], [i])
            reals = unset
            integers = nint(unset)
            call get_values(quantity, responses, eta, reals, integers)
            if (index(quantity, 'eta') == 1) then
               call check(error, reals(1) >= 0.0_wp, quantity)
            else if (variables(i)%kind == real_value) then
               call check(error, nint(reals(1)), i, quantity)
            else
               call check(error, integers(1), i, quantity)
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine test_values

   !> Values and words of a set of flags are as many.
   subroutine test_flags(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(variable_type), allocatable :: variables(:)
      integer, allocatable :: values(:)
      character(len=:), allocatable :: meanings
      integer :: i, j, words

      allocate (variables, source=rigid_variables(grid_of(rigid=.true., flexible=.false.)))
      do i = 1, size(variables)
         call flags_of(variables(i)%kind, values, meanings)
         words = count([(meanings(j:j) == ' ', j=1, len(meanings))]) + merge(1, 0, len(meanings) > 0)
         call check(error, words, size(values), variables(i)%name)
         if (allocated(error)) return
      end do
   end subroutine test_flags

   !> Leap days, ends of years, the start of the count.
   subroutine test_dates(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call check(error, iso_date(0_i8), '1970-01-01T00:00:00Z')
      if (allocated(error)) return
      call check(error, iso_date(951782399_i8), '2000-02-28T23:59:59Z')
      if (allocated(error)) return
      call check(error, iso_date(951782400_i8), '2000-02-29T00:00:00Z')
      if (allocated(error)) return
      call check(error, iso_date(1735689599_i8), '2024-12-31T23:59:59Z')
      if (allocated(error)) return
      call check(error, iso_date(4107542400_i8), '2100-03-01T00:00:00Z')
   end subroutine test_dates

   !> A deck does not differ from itself, but blanks are told.
   subroutine test_equal_decks(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: deck = '&case'//newline//"  title = 'x'"//newline//'/'//newline

      call check(error, deck_difference(deck, deck, 'file', 'deck'), '')
      if (allocated(error)) return
      call check(error, deck_difference(deck, deck//newline, 'file', 'deck') /= '')
   end subroutine test_equal_decks

   !> Changed, dropped and added keys, each with its group; the same key in another group is not meant.
   subroutine test_differing_decks(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: old = '&mesh'//newline//'  damping = 1.0'//newline//'/'//newline &
         //'&box'//newline//'  damping = 1.0'//newline//'  mass = 2.0'//newline//'/'
      character(len=*), parameter :: new = '&mesh'//newline//'  damping = 1.0'//newline//'/'//newline &
         //'&box'//newline//'  damping = 3.0'//newline//'  inertia = 4.0'//newline//'/'//newline

      call check(error, deck_difference(old, new, 'file', 'deck'), newline//'  file: &box damping = 1.0'//newline &
         //'  deck: &box damping = 3.0'//newline//'  file: &box mass = 2.0'//newline//'  deck: &box inertia = 4.0')
   end subroutine test_differing_decks

   !> A held lock is refused with the name of the holder, a released one is free and leaves no file.
   subroutine test_lock(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: path = 'test_results.lock'
      type(file_lock) :: first, second
      type(fault), allocatable :: refusal
      logical :: exists

      call acquire_lock(first, path, refusal)
      call check(error,.not. allocated(refusal), 'a free lock is taken')
      if (allocated(error)) return
      call acquire_lock(second, path, refusal)
      call check(error, allocated(refusal), 'a held lock is refused')
      if (allocated(error)) return
      call check(error, refusal%code, exit_mismatch)
      if (allocated(error)) return
      call check(error, index(refusal%message, 'another run (process ') == 1, refusal%message)
      if (allocated(error)) return
      call release_lock(second, refusal)
      inquire (file=path, exist=exists)
      call check(error, exists .and. .not. allocated(refusal), 'releasing what is not held does nothing')
      if (allocated(error)) return
      call release_lock(first, refusal)
      inquire (file=path, exist=exists)
      call check(error,.not. (exists .or. allocated(refusal)), 'a released lock leaves no file')
      if (allocated(error)) return
      call acquire_lock(second, path, refusal)
      call check(error,.not. allocated(refusal), 'a released lock is free')
      call release_lock(second, refusal)
   end subroutine test_lock

   !> A small grid.
   pure function grid_of(rigid, flexible) result(sweep)
      !> With the rigid support.
      logical, intent(in) :: rigid
      !> With the flexible support.
      logical, intent(in) :: flexible
      !> The grid: 5 speeds, 3 stiffnesses.
      type(sweep_spec) :: sweep

      sweep = sweep_spec(rigid=rigid, flexible=flexible, speed_first=1000.0_wp, speed_last=5000.0_wp, speed_count=5, &
         stiffness_first=1.0e3_wp, stiffness_last=1.0e5_wp, stiffness_count=merge(3, 0, flexible))
   end function grid_of

   !> The names of variables, each with a blank behind it.
   pure function names_of(variables) result(names)
      !> The variables.
      type(variable_type), intent(in) :: variables(:)
      !> Their names.
      character(len=:), allocatable :: names

      integer :: i

      names = ''
      do i = 1, size(variables)
         names = names//trim(variables(i)%name)//' '
      end do
   end function names_of

end module test_results
