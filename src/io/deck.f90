!> Reads the deck: namelist text becomes a case in SI units, or one error that names every fault with its line.
module spurflex_io_deck
   use spurflex_base_error, only: error_type, fatal_error, exit_deck
   use spurflex_base_kinds, only: wp, pi
   use spurflex_base_text, only: to_text
   use spurflex_integrate_options, only: start_rest, start_static, start_up, start_down, integrator_newmark, integrator_collocation
   use spurflex_io_case, only: case_type
   use spurflex_io_checks, only: check_values, uses_flexible
   use spurflex_io_faults, only: fault_list, excerpt, printable
   use spurflex_io_namelist, only: namelist_type, parse_namelist
   use spurflex_io_resolved, only: resolved_deck
   use spurflex_io_values, only: deck_values, collect_values
   use spurflex_measure_record, only: observable_of
   implicit none
   private

   public :: read_deck, parse_deck

   !> Largest deck [bytes].
   integer, parameter :: most_bytes = 1048576

   real(wp), parameter :: seconds_per_minute = 60.0_wp
   !> One degree [rad].
   real(wp), parameter :: degree = pi/180.0_wp

contains

   !> Read a deck from a file.
   subroutine read_deck(file, case, error)
      !> File of the deck.
      character(len=*), intent(in) :: file
      !> The case; meaningless with an error.
      type(case_type), intent(out) :: case
      !> Every fault of the deck, one a line.
      type(error_type), allocatable, intent(out) :: error

      character(len=:), allocatable :: text
      character(len=256) :: message
      integer :: unit, stat, bytes
      logical :: exists

      ! Fortran drops blanks behind a name and would open another file.
      inquire (file=file, exist=exists)
      if (len(file) == 0 .or. len_trim(file) < len(file) .or. .not. exists) then
         call fatal_error(error, excerpt(file)//': no such deck', exit_deck)
         return
      end if
      open (newunit=unit, file=file, status='old', action='read', access='stream', form='unformatted', &
         iostat=stat, iomsg=message)
      if (stat /= 0) then
         call fatal_error(error, excerpt(file)//': the deck cannot be opened: '//trim(message), exit_deck)
         return
      end if
      inquire (unit=unit, size=bytes)
      if (bytes < 0 .or. bytes > most_bytes) then
         message = 'is not a regular file'
         if (bytes > 0) message = 'has '//to_text(bytes)//' bytes, but at most '//to_text(most_bytes)//' are allowed'
         call fatal_error(error, excerpt(file)//': the deck '//trim(message), exit_deck)
         close (unit)
         return
      end if
      allocate (character(len=bytes) :: text)
      stat = 0
      if (bytes > 0) read (unit, iostat=stat, iomsg=message) text
      close (unit)
      if (stat /= 0) then
         call fatal_error(error, excerpt(file)//': the deck cannot be read: '//trim(message), exit_deck)
         return
      end if
      call parse_deck(text, file, case, error)
   end subroutine read_deck

   !> Read a deck from text.
   subroutine parse_deck(text, name, case, error)
      !> The deck.
      character(len=*), intent(in) :: text
      !> Its file: named in messages, and the result file is named after it.
      character(len=*), intent(in) :: name
      !> The case; meaningless with an error.
      type(case_type), intent(out) :: case
      !> Every fault of the deck, one a line.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)
      type(namelist_type) :: list
      type(deck_values) :: table
      type(fault_list) :: faults
      integer :: first

      first = 1
      if (len(text) >= len(byte_order_mark)) then
         if (text(:len(byte_order_mark)) == byte_order_mark) first = len(byte_order_mark) + 1
      end if
      if (len(text) > most_bytes) then
         call fatal_error(error, excerpt(name)//': the deck has '//to_text(len(text))//' bytes, but at most '// &
            to_text(most_bytes)//' are allowed', exit_deck)
      else if (verify(text(first:), ' '//achar(9)//achar(10)//achar(13)) == 0) then
         call fatal_error(error, excerpt(name)//': the deck is empty', exit_deck)
      else if (index(text, achar(0)) > 0) then
         call fatal_error(error, excerpt(name)//': the deck is not plain text: it holds zero bytes', exit_deck)
      end if
      if (allocated(error)) return
      call parse_namelist(text(first:), list, faults)
      call collect_values(list, table, faults)
      call derive_defaults(table, name)
      call check_values(table, name, faults)
      call faults%report(name, error)
      if (allocated(error)) return
      call fill_case(table, case)
      case%resolved = resolved_deck(table)
   end subroutine parse_deck

   !> Set the defaults that follow from other keys or from the name of the deck.
   subroutine derive_defaults(table, name)
      !> The values.
      type(deck_values), intent(inout) :: table
      !> File of the deck.
      character(len=*), intent(in) :: name

      call set_zeros('stiffness_phases', 'stiffness_coefficients')
      call set_zeros('error_phases', 'error_amplitudes')
      associate (value => table%values(table%at('output', 'file')))
         if (value%line == 0) then
            allocate (value%texts(1), value%reals(1))
            value%reals = 0.0_wp
            value%texts(1)%text = default_file(name)
            value%valid = .true.
         end if
      end associate

   contains

      !> Phases that are not given are zero.
      subroutine set_zeros(phases, harmonics)
         !> Key of the phases.
         character(len=*), intent(in) :: phases
         !> Key of the amplitudes.
         character(len=*), intent(in) :: harmonics

         associate (value => table%values(table%at('mesh', phases)))
            if (value%line > 0) return
            allocate (value%reals(size(table%reals_of('mesh', harmonics))), source=0.0_wp)
            value%valid = size(value%reals) > 0
         end associate
      end subroutine set_zeros

   end subroutine derive_defaults

   !> The result file of a deck that names none.
   pure function default_file(name) result(file)
      !> File of the deck.
      character(len=*), intent(in) :: name
      !> Its name without folder and ending, then `.h5`.
      character(len=:), allocatable :: file

      integer, parameter :: longest = 200
      integer :: dot

      file = trim(adjustl(name(index(name, '/', back=.true.) + 1:)))
      dot = index(file, '.', back=.true.)
      if (dot > 0) file = trim(file(:dot - 1))
      ! What is cut may end in the middle of a character.
      file = trim(printable(file(:min(len(file), longest)), '_'))
      if (len(file) == 0) file = 'spurflex'
      file = file//'.h5'
   end function default_file

   !> Fill the case from the values.
   subroutine fill_case(table, case)
      !> The values; without faults.
      type(deck_values), intent(in) :: table
      !> The case.
      type(case_type), intent(inout) :: case

      integer :: i, k

      case%title = table%text_of('case', 'title')
      call fill_gears(table, case)
      case%load%driving_torque = table%real_of('load', 'driving_torque')
      case%load%load_torque = table%real_of('load', 'load_torque')
      case%sweep%rigid = table%text_of('sweep', 'support') /= 'flexible'
      case%sweep%flexible = uses_flexible(table)
      case%sweep%speed_first = table%real_of('sweep', 'speed_first')
      case%sweep%speed_last = table%real_of('sweep', 'speed_last')
      case%sweep%speed_count = table%integer_of('sweep', 'speed_count')
      case%sweep%wall_clock_limit = seconds_per_minute*table%real_of('sweep', 'wall_clock_limit')
      if (case%sweep%flexible) call fill_flexible(table, case)
      select case (table%text_of('sweep', 'start'))
      case ('rest')
         case%solver%start = start_rest
      case ('up')
         case%solver%start = start_up
      case ('down')
         case%solver%start = start_down
      case default
         case%solver%start = start_static
      end select
      case%solver%integrator = merge(integrator_newmark, integrator_collocation, &
                                     table%text_of('solver', 'integrator') == 'newmark')
      case%solver%steps_per_period = table%integer_of('solver', 'steps_per_period')
      case%solver%newmark_beta = table%real_of('solver', 'newmark_beta')
      case%solver%newmark_gamma = table%real_of('solver', 'newmark_gamma')
      case%solver%tolerance = table%real_of('solver', 'tolerance')
      case%solver%max_periods = table%integer_of('solver', 'max_periods')
      case%solver%measured_periods = table%integer_of('solver', 'measured_periods')
      case%output%file = table%text_of('output', 'file')
      associate (products => table%values(table%at('output', 'products'))%texts)
         ! The map is always written.
         allocate (case%output%products(count([(products(i)%text /= 'map', i=1, size(products))])))
         k = 0
         do i = 1, size(products)
            if (products(i)%text == 'map') cycle
            k = k + 1
            case%output%products(k) = products(i)%text
         end do
      end associate
      call fill_record(table, case)
   end subroutine fill_case

   !> Fill what is recorded of each point.
   subroutine fill_record(table, case)
      !> The values; without faults.
      type(deck_values), intent(in) :: table
      !> The case, its products known.
      type(case_type), intent(inout) :: case

      integer :: i

      associate (record => case%output%record, names => table%values(table%at('output', 'quantities'))%texts)
         record%spectrum = any(case%output%products == 'spectrum')
         record%section = any(case%output%products == 'poincare')
         record%history = any(case%output%products == 'history')
         record%quantities = [(observable_of(names(i)%text), i=1, size(names))]
         record%highest_order = table%real_of('output', 'highest_order')
         record%spectrum_periods = table%integer_of('output', 'spectrum_periods')
         record%sections = table%integer_of('output', 'sections')
         record%history_periods = table%integer_of('output', 'history_periods')
         record%history_samples = table%integer_of('output', 'history_samples')
      end associate
   end subroutine fill_record

   !> Fill gear pair, bearings and mesh.
   subroutine fill_gears(table, case)
      !> The values; without faults.
      type(deck_values), intent(in) :: table
      !> The case.
      type(case_type), intent(inout) :: case

      character(len=1) :: gear
      integer :: i

      case%gears%teeth_1 = table%integer_of('gears', 'teeth_1')
      case%gears%pressure_angle = degree*table%real_of('gears', 'pressure_angle')
      do i = 1, 2
         write (gear, '(i0)') i
         case%gears%base_radius(i) = table%real_of('gears', 'base_radius_'//gear)
         case%gears%mass(i) = table%real_of('gears', 'mass_'//gear)
         case%gears%inertia(i) = table%real_of('gears', 'inertia_'//gear)
         case%gears%bearing_stiffness(i) = table%real_of('bearings', 'stiffness_'//gear)
         case%gears%bearing_damping(i) = table%real_of('bearings', 'damping_'//gear)
      end do
      case%gears%mesh%mean_stiffness = table%real_of('mesh', 'mean_stiffness')
      case%gears%mesh%stiffness_coefficients = table%reals_of('mesh', 'stiffness_coefficients')
      case%gears%mesh%stiffness_phases = degree*table%reals_of('mesh', 'stiffness_phases')
      case%gears%mesh%error_amplitudes = table%reals_of('mesh', 'error_amplitudes')
      case%gears%mesh%error_phases = degree*table%reals_of('mesh', 'error_phases')
      case%gears%mesh%damping = table%real_of('mesh', 'damping')
      case%gears%mesh%half_backlash = table%real_of('mesh', 'half_backlash')
   end subroutine fill_gears

   !> Fill the gearbox and the range of support stiffness.
   subroutine fill_flexible(table, case)
      !> The values; without faults.
      type(deck_values), intent(in) :: table
      !> The case.
      type(case_type), intent(inout) :: case

      case%box%mass = table%real_of('gearbox', 'mass')
      case%box%inertia = table%real_of('gearbox', 'inertia')
      case%box%gear_offset = table%real_of('gearbox', 'gear_offset')
      case%box%support_offset = table%real_of('gearbox', 'support_offset')
      case%box%damping_ratio = table%real_of('gearbox', 'damping_ratio')
      case%sweep%stiffness_first = table%real_of('sweep', 'stiffness_first')
      case%sweep%stiffness_last = table%real_of('sweep', 'stiffness_last')
      case%sweep%stiffness_count = table%integer_of('sweep', 'stiffness_count')
   end subroutine fill_flexible

end module spurflex_io_deck
