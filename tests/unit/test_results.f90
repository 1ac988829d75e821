!> What a result file is made of, without the file: axes, the table of variables, dates, decks compared, the lock.
module test_results
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use spurflex_base_checksum, only: extended, extended_over
   use spurflex_base_error, only: exit_mismatch, fault => error_type
   use spurflex_base_kinds, only: i4, i8, wp
   use spurflex_external_file_lock, only: acquire_lock, file_lock, release_lock
   use spurflex_io_axes, only: speeds, stiffnesses
   use spurflex_io_case, only: sweep_spec
   use spurflex_io_deck_difference, only: deck_difference
   use spurflex_io_provenance, only: iso_date
   use spurflex_io_record_layout, only: get_record, record_axes, record_bytes, record_history, record_section, &
      record_spectrum, record_variables
   use spurflex_io_results_failures, only: reason_sentence
   use spurflex_io_results_layout, only: axes_of, axis_type, checksum_quantity, flags_of, flexible_variables, get_values, &
      real_value, reason_flag, rigid_variables, set_values, variable_type
   use spurflex_measure_record, only: observable_of, record_request, record_type
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
                  new_unittest('every reason has a sentence', test_reasons), &
                  new_unittest('checksums of known bytes', test_checksums), &
                  new_unittest('what is not asked for has no variable', test_no_records), &
                  new_unittest('variables of records', test_record_variables), &
                  new_unittest('axes of records', test_record_axes), &
                  new_unittest('values of records', test_record_values), &
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
      character(len=*), parameter :: behind_eta = 'error_estimate motion periods_integrated contact reason checksum ' &
         //'status '
      character(len=*), parameter :: rigid_names = 'rigid_y1_amplitude rigid_y1_rms rigid_y1_max rigid_y1_min ' &
         //'rigid_bearing1_deformation_max rigid_bearing2_deformation_max rigid_error_estimate rigid_motion ' &
         //'rigid_periods_integrated rigid_contact rigid_reason rigid_checksum rigid_status '

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
            else if (quantity == checksum_quantity) then
               ! It follows from the others.
               call check(error, integers(1), nint(unset), quantity)
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

   !> No two reasons read the same, and none is unknown.
   subroutine test_reasons(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, allocatable :: values(:)
      character(len=:), allocatable :: meanings
      integer :: i, j

      call flags_of(reason_flag, values, meanings)
      do i = 1, size(values)
         do j = 1, i - 1
            call check(error, reason_sentence(values(i)) /= reason_sentence(values(j)), reason_sentence(values(i)))
            if (allocated(error)) return
         end do
      end do
      call check(error, reason_sentence(0), reason_sentence(maxval(values) + 1))
   end subroutine test_reasons

   !> Known answers, by zlib: of '1234', '12345678', the next eight zeros, and 1.0 behind '1234'.
   subroutine test_checksums(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer(i8), parameter :: digits = int(z'3837363534333231', i8)
      integer(i4), parameter :: four = int(z'34333231', i4)
      integer(i4), parameter :: crc_four = not(int(z'641C1F5C', i4)), crc_eight = not(int(z'651F2550', i4))
      real(wp), parameter :: numbers(5) = [1.0_wp, -2.5_wp, 0.0_wp, huge(1.0_wp), tiny(1.0_wp)]
      integer(i4) :: one_by_one
      integer :: n

      call check(error, extended(0_i4, four), crc_four, 'four bytes')
      if (allocated(error)) return
      call check(error, extended(0_i4, transfer(digits, 1.0_wp)), crc_eight, 'eight bytes')
      if (allocated(error)) return
      call check(error, extended(extended(0_i4, four), int(z'38373635', i4)), crc_eight, 'four bytes twice')
      if (allocated(error)) return
      call check(error, extended(crc_eight, 0.0_wp), not(int(z'6BF1AD8E', i4)), 'eight zeros behind them')
      if (allocated(error)) return
      call check(error, extended(crc_four, 1.0_wp), not(int(z'2963D543', i4)), 'a real behind an integer')
      if (allocated(error)) return
      call check(error, extended(0_i4, 1.0_wp) /= extended(0_i4, nearest(1.0_wp, 2.0_wp)), 'the last bit counts')
      if (allocated(error)) return
      one_by_one = crc_four
      call check(error, extended_over(crc_four, numbers(:0)), crc_four, 'nothing more')
      if (allocated(error)) return
      do n = 1, size(numbers)
         one_by_one = extended(one_by_one, numbers(n))
         call check(error, extended_over(crc_four, numbers(:n)), one_by_one, 'several at once')
         if (allocated(error)) return
      end do
   end subroutine test_checksums

   !> Only products that are asked for have axes and variables, and only where the support is there.
   subroutine test_no_records(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer :: kind

      associate (grid => grid_of(rigid=.true., flexible=.true.))
         call check(error, size(record_axes(request_of())), 0, 'axes')
         if (allocated(error)) return
         do kind = record_spectrum, record_history
            call check(error, size(record_variables(grid, request_of(), kind, rigid=.true.)), 0, 'variables')
            if (allocated(error)) return
            call check(error, record_bytes(grid, request_of(), kind) <= 0.0_wp, 'bytes')
            if (allocated(error)) return
         end do
         call check(error, names_of(record_variables(grid, request_of(spectrum=.true.), record_section, rigid=.false.)), '')
         if (allocated(error)) return
      end associate
      call check(error, names_of(record_variables(grid_of(rigid=.false., flexible=.true.), request_of(spectrum=.true.), &
                                                  record_spectrum, rigid=.true.)), '')
   end subroutine test_no_records

   !> The names are those that scripts rely on; a gearbox on a rigid support does not move.
   subroutine test_record_variables(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(variable_type), allocatable :: variables(:)
      type(record_request) :: request

      request = request_of(.true., .true., .true.)
      associate (grid => grid_of(rigid=.true., flexible=.true.))
         call check(error, names_of(record_variables(grid, request, record_spectrum, rigid=.false.)), &
                    'spectrum spectrum_xm spectrum_mesh_force ')
         if (allocated(error)) return
         call check(error, names_of(record_variables(grid, request, record_section, rigid=.false.)), &
                    'poincare poincare_rate poincare_xm poincare_xm_rate poincare_mesh_force poincare_mesh_force_rate ')
         if (allocated(error)) return
         call check(error, names_of(record_variables(grid, request, record_history, rigid=.true.)), &
                    'history/rigid_y1 history/rigid_y1_rate history/rigid_mesh_force history/rigid_mesh_force_rate ')
         if (allocated(error)) return
         allocate (variables, source=record_variables(grid, request, record_section, rigid=.true.))
      end associate
      call check(error, names_of(variables), &
                 'rigid_poincare rigid_poincare_rate rigid_poincare_mesh_force rigid_poincare_mesh_force_rate ')
      if (allocated(error)) return
      call check(error, trim(variables(3)%units)//' '//trim(variables(4)%units), 'N N/s')
      if (allocated(error)) return
      call check(error, trim(variables(3)%axes(1))//' '//trim(variables(3)%axes(2))//trim(variables(3)%axes(3)), 'section speed')
      if (allocated(error)) return
      call check(error, index(variables(4)%long_name, 'rigid support: Poincare section of the rate of the mesh force') == 1, &
                 variables(4)%long_name)
   end subroutine test_record_variables

   !> Orders from the mean to the highest, sections from 1, times in mesh periods with both ends.
   subroutine test_record_axes(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(axis_type), allocatable :: axes(:)

      allocate (axes, source=record_axes(request_of(.true., .true., .true.)))
      call check(error, size(axes), 3)
      if (allocated(error)) return
      call check(error, trim(axes(1)%name)//' '//trim(axes(2)%name)//' '//trim(axes(3)%group)//trim(axes(3)%name), &
                 'order section history/mesh_time')
      if (allocated(error)) return
      call check(error, all(abs(axes(1)%values - [0.0_wp, 0.25_wp, 0.5_wp, 0.75_wp, 1.0_wp, 1.25_wp, 1.5_wp]) <= 0.0_wp), 'order')
      if (allocated(error)) return
      call check(error, all(abs(axes(2)%values - [1.0_wp, 2.0_wp, 3.0_wp]) <= 0.0_wp), 'section')
      if (allocated(error)) return
      call check(error, all(abs(axes(3)%values - [0.0_wp, 0.5_wp, 1.0_wp, 1.5_wp, 2.0_wp]) <= 0.0_wp), 'time')
   end subroutine test_record_axes

   !> Each variable is its part of a record; NaN without one. The bytes are those of all variables.
   subroutine test_record_values(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(record_type) :: record, nothing
      type(variable_type), allocatable :: variables(:)
      type(record_request) :: request
      real(wp) :: values(3)
      integer :: i, k

      request = request_of(.true., .true., .true.)
      associate (grid => grid_of(rigid=.true., flexible=.true.))
         record%section = reshape([(real(i, wp), i=1, 18)], [3, 2, 3])
         allocate (variables, source=[record_variables(grid, request, record_section, rigid=.false.), &
                                      record_variables(grid, request, record_section, rigid=.true.)])
         do k = 1, size(variables)
            call get_record(record, variables(k), values)
            ! The gearbox, second of the quantities, is left out on the rigid support.
            i = 3*(merge(k, merge(k - 6, k - 4, k < 9), k < 7) - 1)
            call check(error, all(abs(values - [i + 1, i + 2, i + 3]) <= 0.0_wp), variables(k)%name)
            if (allocated(error)) return
            call get_record(nothing, variables(k), values)
            call check(error, all(ieee_is_nan(values)), 'nothing recorded')
            if (allocated(error)) return
         end do
         ! 5 speeds; 3 stiffnesses with 3 quantities and the rigid support with 2; 7 lines, 2*3 sections, 2*5 samples.
         call check(error, nint(record_bytes(grid, request, record_spectrum)), 8*5*7*(3*3 + 2), 'spectrum')
         if (allocated(error)) return
         call check(error, nint(record_bytes(grid, request, record_section)), 8*5*6*(3*3 + 2), 'section')
         if (allocated(error)) return
         call check(error, nint(record_bytes(grid, request, record_history)), 8*5*10*(3*3 + 2), 'history')
      end associate
   end subroutine test_record_values

   !> Small records of three quantities.
   pure function request_of(spectrum, section, history) result(request)
      !> Whether each product is asked for; not if absent.
      logical, intent(in), optional :: spectrum, section, history
      !> The request: 7 lines, 3 sections, 5 samples.
      type(record_request) :: request

      request%quantities = [observable_of('y1'), observable_of('xm'), observable_of('mesh_force')]
      request%highest_order = 1.5_wp
      request%spectrum_periods = 4
      request%sections = 3
      request%history_periods = 2
      request%history_samples = 2
      if (present(spectrum)) request%spectrum = spectrum
      if (present(section)) request%section = section
      if (present(history)) request%history = history
   end function request_of

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
