!> The one table of what may stand in a deck. Reading, checking, the resolved deck and the key reference all follow it.
!>
!> How to add a key: add its row to `deck_keys`, a component to the type that holds it, and its line to `fill_case` in
!> `spurflex_io_deck`. A rule that ties several keys together goes to `spurflex_io_checks`. Print the key reference anew.
module spurflex_io_schema
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: solver_options
   use spurflex_measure_record, only: observables, record_request
   implicit none
   private

   public :: key_spec, group_spec, range_type, deck_keys, deck_groups, find_key, words_of, in_range, range_text
   public :: kind_integer, kind_real, kind_text, kind_word
   public :: need_always, need_flexible, need_never
   public :: most_characters, most_harmonics, word_length

   !> A whole number.
   integer, parameter :: kind_integer = 1
   !> A number.
   integer, parameter :: kind_real = 2
   !> Any text.
   integer, parameter :: kind_text = 3
   !> Text out of a few words.
   integer, parameter :: kind_word = 4

   !> The key must be given.
   integer, parameter :: need_always = 1
   !> The key must be given where a flexible support is asked for; elsewhere it is not used.
   integer, parameter :: need_flexible = 2
   !> The key has a default.
   integer, parameter :: need_never = 3

   !> Most characters of a text.
   integer, parameter :: most_characters = 1000
   !> Most harmonics of the mesh excitation.
   integer, parameter :: most_harmonics = 64
   !> Longest allowed word.
   integer, parameter :: word_length = 24
   !> Most words in the list of products.
   integer, parameter :: most_products = 16

   !> An interval of allowed numbers; the whole axis unless set.
   type :: range_type
      !> Its ends.
      real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
      !> Whether each end itself is left out.
      logical :: above = .false., below = .false.
   end type range_type

   !> One group of the deck.
   type :: group_spec
      !> Name, without the ampersand.
      character(len=8) :: name
      !> What it describes.
      character(len=100) :: meaning
   end type group_spec

   !> One key of the deck.
   type :: key_spec
      !> Its group.
      character(len=8) :: group
      !> Its name.
      character(len=22) :: key
      !> `kind_...`.
      integer :: kind
      !> Unit in the deck; empty for none.
      character(len=7) :: unit = ''
      !> `need_...`.
      integer :: need = need_always
      !> Default as it is written in a deck, or in words where it follows from something else.
      character(len=24) :: default = ''
      !> The default follows from something else.
      logical :: derived = .false.
      !> Most values; 1 for a key that is no list.
      integer :: most = 1
      !> Allowed numbers.
      type(range_type) :: range = range_type()
      !> It concerns one run only: no part of the resolved deck, by which a result file knows its deck again.
      logical :: of_run = .false.
      !> Allowed words, one blank between them and at least one behind them.
      character(len=128) :: words = ''
      !> What it means.
      character(len=180) :: meaning = ''
   end type key_spec

   type(range_type), parameter :: masses = range_type(0.0_wp, 1.0e12_wp, above=.true.)
   type(range_type), parameter :: lengths = range_type(0.0_wp, 1.0e6_wp, above=.true.)
   type(range_type), parameter :: offsets = range_type(0.0_wp, 1.0e6_wp)
   type(range_type), parameter :: stiffnesses = range_type(0.0_wp, 1.0e18_wp, above=.true.)
   type(range_type), parameter :: dampings = range_type(0.0_wp, 1.0e18_wp)
   type(range_type), parameter :: speeds = range_type(0.0_wp, 1.0e6_wp, above=.true.)
   type(range_type), parameter :: counts = range_type(1.0_wp, 1.0e6_wp)
   type(range_type), parameter :: angles = range_type(-360.0_wp, 360.0_wp)

contains

   !> The groups, in the order in which they are printed.
   pure function deck_groups() result(groups)
      !> The groups, shape (groups).
      type(group_spec), allocatable :: groups(:)

      groups = [ &
         group_spec('case', 'What the run is about.'), &
         group_spec('gears', 'The two gears; 1 drives, 2 is driven.'), &
         group_spec('bearings', 'The bearing of each gear, the same in both directions.'), &
         group_spec('mesh', 'Mesh stiffness, static transmission error, damping and backlash.'), &
         group_spec('gearbox', 'The housing on its flexible support. Not used on a rigid support.'), &
         group_spec('load', 'Constant torques.'), &
         group_spec('sweep', 'The grid of operating points, and how each of them starts.'), &
         group_spec('solver', 'How the equations are integrated, and when a motion counts as steady.'), &
         group_spec('output', 'What is written, and where.')]
   end function deck_groups

   !> The keys, group by group in the order in which they are printed.
   pure function deck_keys() result(keys)
      !> The keys, shape (keys).
      type(key_spec), allocatable :: keys(:)

      keys = [problem_keys(), run_keys()]
   end function deck_keys

   !> Keys of the physical problem.
   pure function problem_keys() result(keys)
      !> The keys, shape (keys).
      type(key_spec), allocatable :: keys(:)

      keys = [ &
         key_spec('case', 'title', kind_text, need=need_never, default='''''', meaning='Title for people.'), &
         key_spec('gears', 'teeth_1', kind_integer, range=range_type(1.0_wp, 1.0e4_wp), &
         meaning='Number of teeth z1 of gear 1; it sets the mesh frequency.'), &
         key_spec('gears', 'pressure_angle', kind_real, 'deg', range=range_type(0.0_wp, 90.0_wp, below=.true.), &
         meaning='Pressure angle.'), &
         key_spec('gears', 'base_radius_1', kind_real, 'm', range=lengths, meaning='Base radius r1.'), &
         key_spec('gears', 'base_radius_2', kind_real, 'm', range=lengths, meaning='Base radius r2.'), &
         key_spec('gears', 'mass_1', kind_real, 'kg', range=masses, meaning='Mass m1.'), &
         key_spec('gears', 'mass_2', kind_real, 'kg', range=masses, meaning='Mass m2.'), &
         key_spec('gears', 'inertia_1', kind_real, 'kg m2', range=masses, meaning='Moment of inertia J1.'), &
         key_spec('gears', 'inertia_2', kind_real, 'kg m2', range=masses, meaning='Moment of inertia J2.'), &
         key_spec('bearings', 'stiffness_1', kind_real, 'N/m', range=stiffnesses, meaning='Bearing stiffness k1.'), &
         key_spec('bearings', 'stiffness_2', kind_real, 'N/m', range=stiffnesses, meaning='Bearing stiffness k2.'), &
         key_spec('bearings', 'damping_1', kind_real, 'N s/m', range=dampings, meaning='Bearing damping c1.'), &
         key_spec('bearings', 'damping_2', kind_real, 'N s/m', range=dampings, meaning='Bearing damping c2.'), &
         key_spec('mesh', 'mean_stiffness', kind_real, 'N/m', range=stiffnesses, meaning='Mean mesh stiffness k_m0.'), &
         key_spec('mesh', 'stiffness_coefficients', kind_real, most=most_harmonics, range=range_type(-2.0_wp, 2.0_wp), &
         meaning='Amplitude of each harmonic of the mesh stiffness over its mean, k_m1, k_m2, ...; 0.0 for none. '// &
         'The sum must stay positive.'), &
         key_spec('mesh', 'stiffness_phases', kind_real, 'deg', need_never, '0.0 for each', .true., most_harmonics, &
         angles, meaning='Phase of each harmonic of the mesh stiffness, as many as there are coefficients.'), &
         key_spec('mesh', 'error_amplitudes', kind_real, 'm', most=most_harmonics, range=range_type(-1.0e3_wp, 1.0e3_wp), &
         meaning='Amplitude of each harmonic of the static transmission error, e_m1, e_m2, ...; 0.0 for none.'), &
         key_spec('mesh', 'error_phases', kind_real, 'deg', need_never, '0.0 for each', .true., most_harmonics, &
         angles, meaning='Phase of each harmonic of the static transmission error, as many as there are amplitudes.'), &
         key_spec('mesh', 'damping', kind_real, 'N s/m', range=dampings, &
         meaning='Mesh damping c_m; it acts in the backlash gap too.'), &
         key_spec('mesh', 'half_backlash', kind_real, 'm', range=range_type(0.0_wp, 1.0e3_wp), &
         meaning='Half of the backlash b.'), &
         key_spec('gearbox', 'mass', kind_real, 'kg', need_flexible, range=masses, meaning='Mass m_M.'), &
         key_spec('gearbox', 'inertia', kind_real, 'kg m2', need_flexible, range=masses, meaning='Moment of inertia J_M.'), &
         key_spec('gearbox', 'gear_offset', kind_real, 'm', need_flexible, range=offsets, &
         meaning='Distance l_o of each gear axis from the centre of mass.'), &
         key_spec('gearbox', 'support_offset', kind_real, 'm', need_flexible, range=lengths, &
         meaning='Distance l_x of each support from the centre of mass.'), &
         key_spec('gearbox', 'damping_ratio', kind_real, need=need_flexible, range=range_type(0.0_wp, 1.0e3_wp), &
         meaning='Damping ratio xi of the support; 0.15 means 15 percent.'), &
         key_spec('load', 'driving_torque', kind_real, 'N m', meaning='Torque T_d on gear 1.'), &
         key_spec('load', 'load_torque', kind_real, 'N m', meaning='Torque T_l on gear 2, positive against the rotation.')]
   end function problem_keys

   !> Keys of the grid, the solution and the output.
   pure function run_keys() result(keys)
      !> The keys, shape (keys).
      type(key_spec), allocatable :: keys(:)

      type(solver_options) :: solver
      type(record_request) :: record

      keys = [ &
         key_spec('sweep', 'support', kind_word, words='rigid flexible both', &
         meaning='Model: gears on a rigid support, the gearbox on a flexible one, or both and their comparison eta.'), &
         key_spec('sweep', 'speed_first', kind_real, 'rev/min', range=speeds, meaning='First speed of gear 1.'), &
         key_spec('sweep', 'speed_last', kind_real, 'rev/min', range=speeds, meaning='Last speed of gear 1.'), &
         key_spec('sweep', 'speed_count', kind_integer, range=counts, meaning='Number of speeds, evenly spaced.'), &
         key_spec('sweep', 'stiffness_first', kind_real, 'N/m', need_flexible, range=stiffnesses, &
         meaning='First support stiffness, the same in both directions.'), &
         key_spec('sweep', 'stiffness_last', kind_real, 'N/m', need_flexible, range=stiffnesses, &
         meaning='Last support stiffness.'), &
         key_spec('sweep', 'stiffness_count', kind_integer, need=need_flexible, range=counts, &
         meaning='Number of support stiffnesses, evenly spaced in their logarithm.'), &
         key_spec('sweep', 'start', kind_word, need=need_never, default='''static''', words='rest static up down', &
         meaning='Start: zero state, static equilibrium, or on from the next lower (up) or higher (down) speed.'), &
         key_spec('sweep', 'wall_clock_limit', kind_real, 'min', need_never, '0.0', range=range_type(0.0_wp, 1.0e6_wp), &
         of_run=.true., meaning='Time from the start of the program within which it stops by itself, to be gone on with; '// &
         '0.0: no limit. May change between runs.'), &
         key_spec('solver', 'integrator', kind_word, need=need_never, default='''newmark''', words='newmark collocation', &
         meaning='Time integration: Newmark-beta, or exponential collocation of order eight with located crossings.'), &
         key_spec('solver', 'steps_per_period', kind_integer, need=need_never, default=to_text(solver%steps_per_period), &
         range=range_type(0.0_wp, 1048576.0_wp), &
         meaning='Time steps per mesh period, 8 or more; 0: as many as the tolerance needs, point by point.'), &
         key_spec('solver', 'newmark_beta', kind_real, need=need_never, default=to_text(solver%newmark_beta), &
         range=range_type(0.0_wp, 1.0_wp, above=.true.), meaning='Newmark''s beta; stable for 2 beta >= gamma.'), &
         key_spec('solver', 'newmark_gamma', kind_real, need=need_never, default=to_text(solver%newmark_gamma), &
         range=range_type(0.0_wp, 1.0_wp), meaning='Newmark''s gamma; stable from 0.5, above which it damps.'), &
         key_spec('solver', 'tolerance', kind_real, need=need_never, default=to_text(solver%tolerance), &
         range=range_type(1.0e-12_wp, 0.1_wp), &
         meaning='Relative error of amplitude and bearing deformation that is promised, unless steps_per_period is given.'), &
         key_spec('solver', 'max_periods', kind_integer, need=need_never, default=to_text(solver%max_periods), &
         range=range_type(16.0_wp, 1.0e9_wp), &
         meaning='Most mesh periods of transient; what is not periodic by then is told apart by its Lyapunov exponent.'), &
         key_spec('solver', 'measured_periods', kind_integer, need=need_never, default=to_text(solver%measured_periods), &
         range=range_type(1.0_wp, 1.0e7_wp), meaning='Mesh periods over which a motion that is not periodic is measured.'), &
         key_spec('output', 'file', kind_text, need=need_never, default='name of the deck + .h5', derived=.true., &
         meaning='Result file, relative to the working folder.'), &
         key_spec('output', 'products', kind_word, need=need_never, default='''map''', most=most_products, &
         words='map floquet lyapunov spectrum poincare history', &
         meaning='What is written: map, the steady response, always; floquet, lyapunov: multipliers and exponents; '// &
         'spectrum, poincare, history: records of the steady motion.'), &
         key_spec('output', 'quantities', kind_word, need=need_never, default='''y1''', most=size(observables), &
         words=observable_words(), meaning='Quantities recorded by the products spectrum, poincare and history; '// &
         'xm, ym and thetam need a flexible support.'), &
         key_spec('output', 'highest_order', kind_real, need=need_never, default=to_text(record%highest_order), &
         range=range_type(0.0_wp, 1.0e3_wp, above=.true.), &
         meaning='Multiple of the mesh frequency up to which the spectrum goes.'), &
         key_spec('output', 'spectrum_periods', kind_integer, need=need_never, default=to_text(record%spectrum_periods), &
         range=range_type(1.0_wp, 1.0e4_wp), &
         meaning='Mesh periods of the window of the spectrum; its resolution is 1/spectrum_periods of the mesh frequency.'), &
         key_spec('output', 'sections', kind_integer, need=need_never, default=to_text(record%sections), &
         range=range_type(1.0_wp, 1.0e6_wp), meaning='Points of the Poincare section, one a mesh period.'), &
         key_spec('output', 'history_periods', kind_integer, need=need_never, default=to_text(record%history_periods), &
         range=range_type(1.0_wp, 1.0e5_wp), meaning='Mesh periods of the time history.'), &
         key_spec('output', 'history_samples', kind_integer, need=need_never, default=to_text(record%history_samples), &
         range=range_type(1.0_wp, 1.0e4_wp), meaning='Samples of the time history in each mesh period.')]
   end function run_keys

   !> The quantities that can be recorded, as words.
   pure function observable_words() result(words)
      !> Their names, one blank behind each.
      character(len=128) :: words

      integer :: i

      words = observables(1)%name
      do i = 2, size(observables)
         words = trim(words)//' '//observables(i)%name
      end do
   end function observable_words

   !> Position of a key in the table.
   pure function find_key(keys, group, key) result(position)
      !> The table, shape (keys).
      type(key_spec), intent(in) :: keys(:)
      !> Name of the group.
      character(len=*), intent(in) :: group
      !> Name of the key.
      character(len=*), intent(in) :: key
      !> Position; 0 if there is no such key.
      integer :: position

      do position = 1, size(keys)
         if (keys(position)%group == group .and. keys(position)%key == key) return
      end do
      position = 0
   end function find_key

   !> The allowed words of a key.
   pure function words_of(spec) result(words)
      !> The key.
      type(key_spec), intent(in) :: spec
      !> Its words, shape (words); none for a key that takes no words.
      character(len=word_length), allocatable :: words(:)

      integer :: first, blank, i

      ! As many words as there are blanks behind a letter.
      allocate (words(count([(spec%words(i:i) /= ' ' .and. spec%words(i + 1:i + 1) == ' ', i=1, len(spec%words) - 1)])))
      first = 1
      do i = 1, size(words)
         blank = first + index(spec%words(first:), ' ') - 1
         words(i) = spec%words(first:blank - 1)
         first = blank + 1
      end do
   end function words_of

   !> Whether a number lies in a range.
   elemental function in_range(range, number) result(inside)
      !> The range.
      type(range_type), intent(in) :: range
      !> The number.
      real(wp), intent(in) :: number
      !> It does.
      logical :: inside

      inside = number >= range%lower .and. number <= range%upper
      if (range%above) inside = inside .and. number > range%lower
      if (range%below) inside = inside .and. number < range%upper
   end function in_range

   !> The range of a key in words.
   pure function range_text(spec) result(text)
      !> The key.
      type(key_spec), intent(in) :: spec
      !> Such as `above 0, at most 1e18`.
      character(len=:), allocatable :: text

      character(len=:), allocatable :: lower, upper

      text = 'any finite number'
      if (spec%range%upper >= huge(spec%range%upper)) return
      if (spec%kind == kind_integer) then
         lower = to_text(nint(spec%range%lower))
         upper = to_text(nint(spec%range%upper))
      else
         lower = short_text(spec%range%lower)
         upper = short_text(spec%range%upper)
      end if
      text = trim(merge('above   ', 'at least', spec%range%above))//' '//lower//', '// &
         trim(merge('below  ', 'at most', spec%range%below))//' '//upper
   end function range_text

   !> A number without `.0`.
   pure function short_text(number) result(text)
      !> The number.
      real(wp), intent(in) :: number
      !> Its text.
      character(len=:), allocatable :: text

      integer, parameter :: long = 7
      integer :: zero

      text = to_text(number)
      zero = index(text, '.0e')
      if (zero == 0 .and. len(text) > 2) then
         if (text(len(text) - 1:) == '.0') zero = len(text) - 1
      end if
      if (zero > 0) text = text(:zero - 1)//text(zero + 2:)
      if (len(text) >= long .and. verify(text(2:), '0') == 0) text = text(1:1)//'e'//to_text(len(text) - 1)
   end function short_text

end module spurflex_io_schema
