!> Reading decks: values and units, defaults, the resolved deck, spelling, faults and the key reference.
module test_deck
   use spurflex_base_error, only: library_error => error_type, exit_deck
   use spurflex_base_kinds, only: i8, pi, wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: integrator_newmark, solver_options, start_static, start_up
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: parse_deck, read_deck
   use spurflex_io_number, only: read_integer, read_real
   use spurflex_io_reference, only: key_reference
   use spurflex_io_schema, only: deck_groups, deck_keys, find_key, group_spec, key_spec, words_of
   use spurflex_io_suggest, only: did_you_mean, nearest_name
   use spurflex_measure_record, only: lines_of, observable_of, observables, record_request, records, samples_of
   use test_support, only: check, error_type, new_unittest, unittest_type
   implicit none
   private

   public :: collect_deck

   character(len=1), parameter :: newline = achar(10), tab = achar(9)
   character(len=2), parameter :: dos_end = achar(13)//achar(10)

   !> The groups that every deck has, but for &sweep.
   character(len=*), parameter :: problem = &
      '&gears teeth_1 = 55, pressure_angle = 20.0, base_radius_1 = 0.05, base_radius_2 = 0.07,'//newline// &
      'mass_1 = 1.5, mass_2 = 3.0, inertia_1 = 0.004, inertia_2 = 0.008 /'//newline// &
      '&bearings stiffness_1 = 2.0e8, stiffness_2 = 1.0e8, damping_1 = 1800.0, damping_2 = 900.0 /'//newline// &
      '&mesh mean_stiffness = 3.2e8, stiffness_coefficients = 0.3, 0.1, error_amplitudes = 1.0e-5'//newline// &
      'damping = 2000.0, half_backlash = 1.0e-5 /'//newline// &
      '&load driving_torque = 110.0, load_torque = -150.0 /'//newline
   character(len=*), parameter :: rigid_sweep = &
      '&sweep support = ''rigid'', speed_first = 300.0, speed_last = 6000.0, speed_count = 58 /'//newline
   character(len=*), parameter :: flexible_sweep = &
      '&sweep support = ''both'', speed_first = 300.0, speed_last = 6000.0, speed_count = 58,'//newline// &
      'stiffness_first = 1.0e3, stiffness_last = 1.0e12, stiffness_count = 10, start = ''up'' /'//newline// &
      '&gearbox mass = 19.87, inertia = 0.35, gear_offset = 0.08, support_offset = 0.11, damping_ratio = 0.15 /'//newline

contains

   !> The tests of this suite.
   subroutine collect_deck(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('values in SI units', test_values), &
                  new_unittest('defaults', test_defaults), &
                  new_unittest('what is recorded', test_records), &
                  new_unittest('nothing is recorded unasked', test_no_records), &
                  new_unittest('a rigid support uses no gearbox', test_rigid), &
                  new_unittest('the resolved deck reads back to the same bits', test_resolved), &
                  new_unittest('ways to write a deck', test_spelling), &
                  new_unittest('name of the result file', test_default_file), &
                  new_unittest('all faults at once', test_faults), &
                  new_unittest('a file that is not there', test_absent_file), &
                  new_unittest('real numbers', test_reals), &
                  new_unittest('whole numbers', test_integers), &
                  new_unittest('suggestions', test_suggestions), &
                  new_unittest('the table of keys', test_table), &
                  new_unittest('the key reference names every key', test_reference) &
                  ]
   end subroutine collect_deck

   !> Every key arrives in its component; degrees become radians.
   subroutine test_values(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(library_error), allocatable :: fault

      call parse_deck('&case title = ''a pair'' /'//problem//flexible_sweep// &
         '&solver steps_per_period = 512, tolerance = 1.0e-3 / &output file = ''runs/map.h5'' /', 'deck.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, case%title, 'a pair')
      if (allocated(error)) return
      call check(error, case%gears%teeth_1, 55)
      if (allocated(error)) return
      call check(error, case%gears%pressure_angle, pi/9.0_wp, epsilon(1.0_wp), 'pressure angle')
      if (allocated(error)) return
      call same_bits(error, [case%gears%base_radius, case%gears%mass, case%gears%inertia, case%gears%bearing_stiffness, &
                             case%gears%bearing_damping], [0.05_wp, 0.07_wp, 1.5_wp, 3.0_wp, 0.004_wp, 0.008_wp, &
                                                           2.0e8_wp, 1.0e8_wp, 1800.0_wp, 900.0_wp], 'gears')
      if (allocated(error)) return
      call same_bits(error, [case%gears%mesh%mean_stiffness, case%gears%mesh%stiffness_coefficients, &
                             case%gears%mesh%error_amplitudes, case%gears%mesh%damping, case%gears%mesh%half_backlash], &
                     [3.2e8_wp, 0.3_wp, 0.1_wp, 1.0e-5_wp, 2000.0_wp, 1.0e-5_wp], 'mesh')
      if (allocated(error)) return
      call same_bits(error, [case%box%mass, case%box%inertia, case%box%gear_offset, case%box%support_offset, &
                             case%box%damping_ratio, case%load%driving_torque, case%load%load_torque], &
                     [19.87_wp, 0.35_wp, 0.08_wp, 0.11_wp, 0.15_wp, 110.0_wp, -150.0_wp], 'gearbox and load')
      if (allocated(error)) return
      call same_bits(error, [case%sweep%speed_first, case%sweep%speed_last, case%sweep%stiffness_first, &
                             case%sweep%stiffness_last], [300.0_wp, 6000.0_wp, 1.0e3_wp, 1.0e12_wp], 'sweep')
      if (allocated(error)) return
      call check(error, case%sweep%rigid .and. case%sweep%flexible .and. case%sweep%speed_count == 58 &
                 .and. case%sweep%stiffness_count == 10, 'grid')
      if (allocated(error)) return
      call check(error, case%solver%start == start_up .and. case%solver%steps_per_period == 512, 'solver')
      if (allocated(error)) return
      call same_bits(error, [case%solver%tolerance], [1.0e-3_wp], 'tolerance')
      if (allocated(error)) return
      call check(error, case%output%file, 'runs/map.h5')
   end subroutine test_values

   !> What is not given is the default of the solver options, no phase, and a file named after the deck.
   subroutine test_defaults(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(library_error), allocatable :: fault
      type(solver_options) :: default

      call parse_deck(problem//rigid_sweep, 'input/fig5.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, case%solver%integrator == integrator_newmark .and. case%solver%start == start_static &
                 .and. case%solver%steps_per_period == default%steps_per_period .and. &
                 case%solver%max_periods == default%max_periods .and. &
                 case%solver%measured_periods == default%measured_periods, 'whole numbers')
      if (allocated(error)) return
      call same_bits(error, [case%solver%newmark_beta, case%solver%newmark_gamma, case%solver%tolerance], &
                     [default%newmark_beta, default%newmark_gamma, default%tolerance], 'numbers')
      if (allocated(error)) return
      call same_bits(error, case%gears%mesh%stiffness_phases, [0.0_wp, 0.0_wp], 'stiffness phases')
      if (allocated(error)) return
      call same_bits(error, case%gears%mesh%error_phases, [0.0_wp], 'error phases')
      if (allocated(error)) return
      call check(error, case%title, '')
      if (allocated(error)) return
      call check(error, case%output%file, 'fig5.h5')
      if (allocated(error)) return
      call check(error, size(case%output%products), 0, 'products beside the map')
   end subroutine test_defaults

   !> Products, quantities and extents, and all of it again from the resolved deck.
   subroutine test_records(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: output = '&output products = ''history'' ''spectrum'', quantities = ''thetam'', ''x2'''// &
         newline//'highest_order = 2.5 spectrum_periods = 30, sections = 7 history_periods = 3 history_samples = 11 /'
      type(case_type) :: case, again
      type(library_error), allocatable :: fault

      call parse_deck(problem//flexible_sweep//output, 'x.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      associate (record => case%output%record)
         call check(error, record%spectrum .and. record%history .and. .not. record%section, 'products')
         if (allocated(error)) return
         call check(error, all(record%quantities == [observable_of('thetam'), observable_of('x2')]), 'quantities')
         if (allocated(error)) return
         call check(error, lines_of(record) == 76 .and. record%sections == 7 .and. samples_of(record) == 34, 'extents')
         if (allocated(error)) return
      end associate
      call parse_deck(case%resolved, 'y.nml', again, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, again%resolved, case%resolved)
      if (allocated(error)) return
      call check(error, all(again%output%record%quantities == case%output%record%quantities) &
                 .and. lines_of(again%output%record) == 76, 'resolved deck')
   end subroutine test_records

   !> The defaults are those of the request, and record nothing. Every observable quantity is a word of the deck.
   subroutine test_no_records(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(library_error), allocatable :: fault
      type(record_request) :: default
      type(key_spec), allocatable :: keys(:)

      call parse_deck(problem//rigid_sweep, 'x.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      associate (record => case%output%record)
         call check(error, .not. records(record), 'nothing is recorded')
         if (allocated(error)) return
         call check(error, size(record%quantities) == 1 .and. record%quantities(1) == observable_of('y1'), 'y1')
         if (allocated(error)) return
         call check(error, lines_of(record) == lines_of(default) .and. record%sections == default%sections &
                    .and. record%spectrum_periods == default%spectrum_periods .and. samples_of(record) == samples_of(default), &
                    'extents')
         if (allocated(error)) return
      end associate
      allocate (keys, source=deck_keys())
      associate (words => words_of(keys(find_key(keys, 'output', 'quantities'))))
         call check(error, size(words), size(observables))
         if (allocated(error)) return
         call check(error, all(words == observables%name), 'words')
      end associate
   end subroutine test_no_records

   !> A rigid support needs neither a gearbox nor support stiffnesses; if they are there they are checked but not used.
   subroutine test_rigid(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: box = '&gearbox mass = 19.87 /'
      type(case_type) :: case, plain
      type(library_error), allocatable :: fault

      call parse_deck(problem//rigid_sweep, 'x.nml', plain, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, plain%sweep%rigid .and. .not. plain%sweep%flexible .and. plain%sweep%stiffness_count == 0, 'grid')
      if (allocated(error)) return
      call parse_deck(box//problem//rigid_sweep, 'x.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, case%resolved, plain%resolved, 'resolved deck')
      if (allocated(error)) return
      call parse_deck('&gearbox mass = -1.0 /'//problem//rigid_sweep, 'x.nml', case, fault)
      call check(error, allocated(fault), 'a wrong gearbox is a fault')
   end subroutine test_rigid

   !> Reading the resolved deck under another name gives the same case, awkward values included.
   subroutine test_resolved(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: awkward = &
         '&case title = "it''s ""new"" '//char(206)//char(188)//' / & ! " /'//newline// &
         '&gears teeth_1 = 55, pressure_angle = 20.000000000000004, base_radius_1 = 0.1, base_radius_2 = .3333333333333333,'// &
         'mass_1 = 1d-300, mass_2 = 1.7976931348623157, inertia_1 = 4.35e-3, inertia_2 = 0.3 /'//newline
      character(len=*), parameter :: rest = &
         '&bearings stiffness_1 = 2.0e8, stiffness_2 = 1.0e18, damping_1 = 0.0, damping_2 = -0.0 /'//newline// &
         '&mesh mean_stiffness = 3.2e8, stiffness_coefficients = 0.1 10*0.01, stiffness_phases = 10*33.3 -0.1'//newline// &
         'error_amplitudes = 64*1.1e-6, error_phases = 63*7.7, 1.0e-17, damping = 2000.0, half_backlash = 0 /'//newline// &
         '&load driving_torque = 9.999999999999999e307, load_torque = -1.0e-307 / &output file = ''a ''''b''''.h5'' /'
      type(case_type) :: case, again
      type(library_error), allocatable :: fault

      call parse_deck(awkward//rest//flexible_sweep, 'x.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call parse_deck(case%resolved, 'other.nml', again, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, again%resolved, case%resolved, 'resolved deck')
      if (allocated(error)) return
      call check(error, again%title == case%title .and. again%output%file == case%output%file, 'texts')
      if (allocated(error)) return
      call check(error, case%title, 'it''s "new" '//char(206)//char(188)//' / & ! ')
      if (allocated(error)) return
      call same_bits(error, numbers(again), numbers(case), 'numbers')
      if (allocated(error)) return
      call check(error, again%gears%teeth_1 == case%gears%teeth_1 .and. again%solver%start == case%solver%start &
                 .and. again%sweep%stiffness_count == case%sweep%stiffness_count, 'whole numbers')
   end subroutine test_resolved

   !> The numbers of a case.
   pure function numbers(case) result(values)
      !> The case.
      type(case_type), intent(in) :: case
      !> Its reals, shape (reals).
      real(wp), allocatable :: values(:)

      allocate (values, source=[case%gears%pressure_angle, case%gears%base_radius, case%gears%mass, case%gears%inertia, &
                                case%gears%bearing_stiffness, case%gears%bearing_damping, case%gears%mesh%mean_stiffness, &
                                case%gears%mesh%stiffness_coefficients, case%gears%mesh%stiffness_phases, &
                                case%gears%mesh%error_amplitudes, case%gears%mesh%error_phases, case%gears%mesh%damping, &
                                case%gears%mesh%half_backlash, case%box%mass, case%box%inertia, case%box%gear_offset, &
                                case%box%support_offset, case%box%damping_ratio, case%load%driving_torque, &
                                case%load%load_torque, case%sweep%speed_first, case%sweep%speed_last, &
                                case%sweep%stiffness_first, case%sweep%stiffness_last, case%solver%newmark_beta, &
                                case%solver%newmark_gamma, case%solver%tolerance])
   end function numbers

   !> Line ends, tabs, capitals, comments and the end of a group may be written in several ways.
   subroutine test_spelling(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: mark = char(239)//char(187)//char(191)
      character(len=:), allocatable :: rewritten
      type(case_type) :: case, plain
      type(library_error), allocatable :: fault
      integer :: i

      call parse_deck(problem//rigid_sweep, 'x.nml', plain, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      rewritten = mark//'! caf'//char(233)//' '' " & /'//dos_end
      do i = 1, len(problem)
         select case (problem(i:i))
         case (newline)
            rewritten = rewritten//' ! a comment'//dos_end
         case (' ')
            rewritten = rewritten//tab
         case ('/')
            rewritten = rewritten//'&END'
         case ('e')
            ! An exponent stands behind a digit.
            rewritten = rewritten//merge('D', 'E', scan(problem(i - 1:i - 1), '0123456789') > 0)
         case default
            rewritten = rewritten//problem(i:i)
         end select
      end do
      rewritten = rewritten//'&Sweep support="rigid"'//dos_end//'SPEED_FIRST=+3.D2 speed_last=6000,speed_count=058/'
      call parse_deck(rewritten, 'x.nml', case, fault)
      call no_fault(error, fault)
      if (allocated(error)) return
      call check(error, case%resolved, plain%resolved)
   end subroutine test_spelling

   !> The result file is named after the deck.
   subroutine test_default_file(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=16), parameter :: decks(*) = [character(len=16) :: 'a.nml', 'dir.d/b', '/x/y/c.d.nml', '', '.nml', 'dir/']
      character(len=16), parameter :: files(*) = [character(len=16) :: 'a.h5', 'b.h5', 'c.d.h5', 'spurflex.h5', 'spurflex.h5', &
                                                  'spurflex.h5']
      type(case_type) :: case
      type(library_error), allocatable :: fault
      integer :: i

      do i = 1, size(decks)
         call parse_deck(problem//rigid_sweep, trim(decks(i)), case, fault)
         call no_fault(error, fault)
         if (allocated(error)) return
         call check(error, case%output%file, trim(files(i)))
         if (allocated(error)) return
      end do
      call parse_deck(problem//rigid_sweep, 'a.h5', case, fault)
      call check(error, allocated(fault), 'a result file never overwrites its deck')
   end subroutine test_default_file

   !> Faults of every stage come in one message, in the order of their lines.
   subroutine test_faults(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: expected = &
         'd.nml:1: &sweep: unknown key ''sped_first'' (did you mean ''speed_first''?)'//newline// &
         'd.nml:2: &sweep: speed_count = 2.0: a whole number has neither point nor exponent (did you mean 2?); '// &
         'allowed is at least 1, at most 1000000'//newline// &
         'd.nml:3: text outside of groups: x; a group begins with &name and ends with ''/'', a comment begins with ''!'''
      type(case_type) :: case
      type(library_error), allocatable :: fault

      call parse_deck('&sweep support = ''rigid'', sped_first = 300.0'//newline//'speed_last = 6000.0, speed_count = 2.0 /' &
                      //newline//'x'//newline//problem, 'd.nml', case, fault)
      call check(error, allocated(fault), 'there are faults')
      if (allocated(error)) return
      call check(error, fault%message, expected)
      if (allocated(error)) return
      call check(error, fault%code, exit_deck)
   end subroutine test_faults

   !> A deck that does not exist is an error of the deck.
   subroutine test_absent_file(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(case_type) :: case
      type(library_error), allocatable :: fault

      call read_deck('no/such/deck.nml', case, fault)
      call check(error, allocated(fault), 'there is an error')
      if (allocated(error)) return
      call check(error, fault%code, exit_deck)
      if (allocated(error)) return
      call check(error, fault%message, 'no/such/deck.nml: no such deck')
   end subroutine test_absent_file

   !> Reals: what is accepted, what is refused, and no trap on the way.
   subroutine test_reals(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=24), parameter :: good(*) = [character(len=24) :: '1', '-1.5', '+.5', '5.', '1d-5', '1.0E+05', '0e999999', &
                                                 '-0.0', '000001e-000002', '9.999e307', '1e-307', '0.00001e312']
      real(wp), parameter :: values(*) = [1.0_wp, -1.5_wp, 0.5_wp, 5.0_wp, 1.0e-5_wp, 1.0e5_wp, 0.0_wp, &
                                          -0.0_wp, 0.01_wp, 9.999e307_wp, 1.0e-307_wp, 1.0e307_wp]
      character(len=24), parameter :: bad(*) = [character(len=24) :: '', '.', '+', '-.e5', 'e5', '1e', '1e+', '1.2.3', '1,5', &
                                                'nan', 'inf', '1e400', '-1e400', '1e-400', '1e99999999999', '0x10', '1_8', &
                                                '1 2', '.true.', '100000e303']
      character(len=:), allocatable :: reason
      real(wp) :: number
      integer :: i

      do i = 1, size(good)
         call read_real(trim(good(i)), number, reason)
         call check(error, reason, '', trim(good(i)))
         if (allocated(error)) return
         call same_bits(error, [number], [values(i)], trim(good(i)))
         if (allocated(error)) return
      end do
      do i = 1, size(bad)
         call read_real(trim(bad(i)), number, reason)
         call check(error, len(reason) > 0, '"'//trim(bad(i))//'" is refused')
         if (allocated(error)) return
      end do
      call read_real(repeat('1', 1000), number, reason)
      call check(error, len(reason) > 0, 'a very long number is refused')
   end subroutine test_reals

   !> Whole numbers: no point, no exponent, and no overflow.
   subroutine test_integers(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=:), allocatable :: reason
      integer(i8) :: number

      call read_integer('-0042', number, reason)
      call check(error, number, -42_i8)
      if (allocated(error)) return
      call read_integer('99999999999999999999', number, reason)
      call check(error, number, huge(number))
      if (allocated(error)) return
      call read_integer('12.0', number, reason)
      call check(error, index(reason, 'did you mean 12?') > 0, reason)
      if (allocated(error)) return
      call read_integer('12.5', number, reason)
      call check(error, reason, 'not a whole number')
      if (allocated(error)) return
      call read_integer('twelve', number, reason)
      call check(error, len(reason) > 0, 'a word is refused')
   end subroutine test_integers

   !> The nearest name is found, and none for words that resemble nothing.
   subroutine test_suggestions(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      character(len=12), parameter :: names(*) = [character(len=12) :: 'mass_1', 'mass_2', 'speed_first', 'speed_last']

      call check(error, nearest_name('Speed_Lsat', names), 4)
      if (allocated(error)) return
      call check(error, nearest_name('first', names), 3)
      if (allocated(error)) return
      call check(error, nearest_name('qqq', names), 0)
      if (allocated(error)) return
      call check(error, nearest_name(repeat('mass_1', 1000), names), 0)
      if (allocated(error)) return
      call check(error, did_you_mean('mas_2', names), ' (did you mean ''mass_2''?)')
      if (allocated(error)) return
      call check(error, did_you_mean('', names), '')
   end subroutine test_suggestions

   !> The table is in order: each key once, in a group that exists, with an ordered range and a meaning.
   subroutine test_table(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(key_spec), allocatable :: keys(:)
      type(group_spec), allocatable :: groups(:)
      character(len=:), allocatable :: name
      integer :: i

      allocate (keys, source=deck_keys())
      allocate (groups, source=deck_groups())
      do i = 1, size(keys)
         name = trim(keys(i)%group)//'/'//trim(keys(i)%key)
         call check(error, find_key(keys, keys(i)%group, keys(i)%key), i, name//' stands once')
         if (allocated(error)) return
         call check(error, any(groups%name == keys(i)%group), name//' has a group')
         if (allocated(error)) return
         call check(error, keys(i)%range%lower < keys(i)%range%upper, name//' has a range')
         if (allocated(error)) return
         call check(error, keys(i)%meaning /= '' .and. keys(i)%meaning(len(keys(i)%meaning):) == ' ', name//' has a meaning')
         if (allocated(error)) return
      end do
   end subroutine test_table

   !> Every group and key stands in the key reference.
   subroutine test_reference(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(key_spec), allocatable :: keys(:)
      character(len=:), allocatable :: text
      integer :: i

      allocate (keys, source=deck_keys())
      text = key_reference()
      do i = 1, size(keys)
         call check(error, index(text, newline//'## &'//trim(keys(i)%group)//newline) > 0, trim(keys(i)%group))
         if (allocated(error)) return
         call check(error, index(text, newline//'| `'//trim(keys(i)%key)//'` |') > 0, trim(keys(i)%key))
         if (allocated(error)) return
      end do
   end subroutine test_reference

   !> Fail the test if there is an error of the library.
   subroutine no_fault(error, fault)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error
      !> The error of the library.
      type(library_error), allocatable, intent(in) :: fault

      if (allocated(fault)) call check(error, .false., fault%message)
   end subroutine no_fault

   !> Fail the test unless two lists of reals agree in every bit.
   subroutine same_bits(error, actual, expected, message)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error
      !> Values found, shape (values).
      real(wp), intent(in) :: actual(:)
      !> Values wanted, shape (values).
      real(wp), intent(in) :: expected(:)
      !> What was tested.
      character(len=*), intent(in) :: message

      integer :: i

      call check(error, size(actual), size(expected), message)
      if (allocated(error)) return
      do i = 1, size(actual)
         call check(error, transfer(actual(i), 0_i8) == transfer(expected(i), 0_i8), &
                    message//': '//to_text(actual(i))//' is not '//to_text(expected(i)))
         if (allocated(error)) return
      end do
   end subroutine same_bits

end module test_deck
