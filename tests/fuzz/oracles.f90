!> What must hold of every deck that is read: it is refused in good order, or accepted and sound.
module fuzz_oracles
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use spurflex_base_error, only: error_type, exit_deck
   use spurflex_base_kinds, only: wp, pi
   use spurflex_base_text, only: to_text
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: parse_deck
   use spurflex_io_faults, only: fault_list, excerpt, is_utf8
   use spurflex_io_namelist, only: namelist_type, parse_namelist
   use spurflex_io_schema, only: deck_keys, find_key, key_spec, kind_integer, kind_real
   implicit none
   private

   public :: fault_of_refusal, fault_of_case, names_line

   character(len=1), parameter :: line_feed = achar(10), carriage_return = achar(13)

contains

   !> What is wrong with the message of a refused deck; nothing if it is in order.
   function fault_of_refusal(text, name, error) result(reason)
      !> The deck.
      character(len=*), intent(in) :: text
      !> Its name.
      character(len=*), intent(in) :: name
      !> The error.
      type(error_type), intent(in) :: error
      !> The fault; empty if there is none.
      character(len=:), allocatable :: reason

      integer, parameter :: most_lines = 51, longest_line = 3000
      integer :: first, last, lines, line, before

      reason = ''
      if (error%code /= exit_deck) reason = 'exit code '//to_text(error%code)
      if (error%alone) reason = 'the error is one of this rank alone'
      if (len(error%message) == 0) reason = 'the message is empty'
      if (.not. is_utf8(error%message)) reason = 'the message is not UTF-8'
      if (has_control(error%message)) reason = 'a control character in the message'
      lines = 0
      before = 0
      first = 1
      do while (first <= len(error%message) .and. len(reason) == 0)
         last = index(error%message(first:), line_feed) + first - 2
         if (last < first - 1) last = len(error%message)
         lines = lines + 1
         if (last - first + 1 > longest_line) reason = 'a line of the message has '//to_text(last - first + 1)//' characters'
         if (lines > most_lines) reason = 'the message has too many lines'
         call read_place(error%message(first:last), name, line, reason)
         if (line > 0 .and. line < before) reason = 'the lines are not in order'
         if (line > lines_of(text)) reason = 'line '//to_text(line)//' is behind the end of the deck'
         before = max(line, before)
         first = last + 2
      end do
   end function fault_of_refusal

   !> What is wrong with an accepted case; nothing if it is sound.
   function fault_of_case(case, name) result(reason)
      !> The case.
      type(case_type), intent(in) :: case
      !> Name of its deck.
      character(len=*), intent(in) :: name
      !> The fault; empty if there is none.
      character(len=:), allocatable :: reason

      type(case_type) :: again
      type(error_type), allocatable :: error

      reason = fault_of_keys(case%resolved)
      if (len(reason) == 0) reason = fault_of_components(case)
      if (len(reason) > 0) return
      call parse_deck(case%resolved, name, again, error)
      if (allocated(error)) then
         reason = 'the resolved deck is refused: '//error%message
      else if (again%resolved /= case%resolved .or. len(again%resolved) /= len(case%resolved)) then
         reason = 'the resolved deck resolves to another one'
      end if
   end function fault_of_case

   !> What is wrong with the values of a resolved deck, each read by Fortran itself and held against the table of keys.
   function fault_of_keys(resolved) result(reason)
      !> The resolved deck.
      character(len=*), intent(in) :: resolved
      !> The fault; empty if there is none.
      character(len=:), allocatable :: reason

      type(namelist_type) :: list
      type(fault_list) :: faults
      type(key_spec), allocatable :: keys(:)
      real(wp) :: number
      integer :: i, j, key, stat

      reason = ''
      keys = deck_keys()
      call parse_namelist(resolved, list, faults)
      if (faults%count() > 0) reason = 'the resolved deck has faults of form'
      do i = 1, size(list%entries)
         key = find_key(keys, list%groups(list%entries(i)%group)%name, list%entries(i)%key)
         if (key == 0) then
            reason = 'the resolved deck has the unknown key '//list%entries(i)%key
            return
         end if
         if (list%entries(i)%total > keys(key)%most) reason = list%entries(i)%key//' has too many values'
         if (keys(key)%kind /= kind_integer .and. keys(key)%kind /= kind_real) cycle
         do j = 1, size(list%entries(i)%values)
            read (list%entries(i)%values(j)%text, *, iostat=stat) number
            if (stat /= 0) then
               reason = list%entries(i)%key//' is no number'
            else if (.not. (ieee_is_finite(number) .and. number >= keys(key)%range%lower .and. &
                            number <= keys(key)%range%upper)) then
               reason = list%entries(i)%key//' = '//to_text(number)//' is out of range'
            end if
         end do
      end do
   end function fault_of_keys

   !> What is wrong with a case by what its components mean.
   function fault_of_components(case) result(reason)
      !> The case.
      type(case_type), intent(in) :: case
      !> The fault; empty if there is none.
      character(len=:), allocatable :: reason

      integer, parameter :: samples = 1000
      integer :: i, j

      reason = ''
      associate (gears => case%gears, mesh => case%gears%mesh, sweep => case%sweep, solver => case%solver)
         if (.not. all(ieee_is_finite([gears%base_radius, gears%mass, gears%inertia, gears%bearing_stiffness, &
            gears%bearing_damping, gears%pressure_angle, mesh%mean_stiffness, mesh%stiffness_coefficients, &
            mesh%stiffness_phases, mesh%error_amplitudes, mesh%error_phases, mesh%damping, mesh%half_backlash, &
            case%load%driving_torque, case%load%load_torque, sweep%speed_first, sweep%speed_last, sweep%stiffness_first, &
            sweep%stiffness_last, solver%tolerance, solver%newmark_beta, solver%newmark_gamma]))) reason = 'not finite'
         if (any([gears%base_radius, gears%mass, gears%inertia, gears%bearing_stiffness, mesh%mean_stiffness, &
            sweep%speed_first, solver%tolerance] <= 0.0_wp)) reason = 'not positive'
         if (gears%pressure_angle < 0.0_wp .or. gears%pressure_angle >= 0.5_wp*pi) reason = 'pressure angle'
         if (gears%teeth_1 < 1) reason = 'no teeth'
         if (size(mesh%stiffness_phases) /= size(mesh%stiffness_coefficients) .or. &
            size(mesh%error_phases) /= size(mesh%error_amplitudes)) reason = 'not one phase for each harmonic'
         if (len(reason) > 0) return
         do i = 1, samples
            if (1.0_wp + sum(mesh%stiffness_coefficients*cos([(real(i*j, wp), j=1, size(mesh%stiffness_phases))]* &
               2.0_wp*pi/real(samples, wp) + mesh%stiffness_phases)) <= 0.0_wp) reason = 'mesh stiffness'
         end do
         if (.not. (sweep%rigid .or. sweep%flexible)) reason = 'no support'
         if (sweep%speed_first > sweep%speed_last .or. sweep%speed_count < 1) reason = 'speeds'
         if ((sweep%speed_count == 1) .neqv. .not. sweep%speed_first < sweep%speed_last) reason = 'number of speeds'
         if (sweep%flexible) then
            if (sweep%stiffness_first <= 0.0_wp .or. sweep%stiffness_first > sweep%stiffness_last .or. &
               sweep%stiffness_count < 1) reason = 'support stiffnesses'
            if ((sweep%stiffness_count == 1) .neqv. .not. sweep%stiffness_first < sweep%stiffness_last) then
               reason = 'number of support stiffnesses'
            end if
            if (case%box%mass <= 0.0_wp .or. case%box%inertia <= 0.0_wp .or. case%box%damping_ratio < 0.0_wp) then
               reason = 'gearbox'
            end if
         end if
         if (solver%newmark_gamma < 0.5_wp .or. 2.0_wp*solver%newmark_beta < solver%newmark_gamma) reason = 'unstable'
         if (solver%steps_per_period < 0) reason = 'steps'
      end associate
      if (len_trim(case%output%file) == 0) reason = 'no result file'
      if (has_control(case%output%file//case%title) .or. index(case%output%file//case%title, line_feed) > 0 .or. &
         .not. is_utf8(case%output%file//case%title)) reason = 'text that cannot be printed'
   end function fault_of_components

   !> Whether some line of a message names a place and holds a word.
   pure function names_line(message, place, word) result(named)
      !> The message.
      character(len=*), intent(in) :: message
      !> Name and line, such as `deck.nml:3:`.
      character(len=*), intent(in) :: place
      !> The word.
      character(len=*), intent(in) :: word
      !> There is such a line.
      logical :: named

      integer :: first, last

      named = .false.
      first = 1
      do while (first <= len(message) .and. .not. named)
         last = index(message(first:), line_feed) + first - 2
         if (last < first - 1) last = len(message)
         named = index(message(first:last), place) == 1 .and. index(message(first:last), word) > 0
         first = last + 2
      end do
   end function names_line

   !> The line of the deck that a line of the message names. Only faults of the whole deck have none.
   subroutine read_place(message, name, line, reason)
      !> The line of the message.
      character(len=*), intent(in) :: message
      !> Name of the deck.
      character(len=*), intent(in) :: name
      !> Line of the deck; 0 for none.
      integer, intent(out) :: line
      !> Set where the message has another form.
      character(len=:), allocatable, intent(inout) :: reason

      character(len=:), allocatable :: rest
      integer :: colon, stat

      line = 0
      if (index(message, excerpt(name)//':') /= 1) then
         reason = 'the deck is not named: '//message
         return
      end if
      rest = message(len(excerpt(name)) + 2:)
      if (index(rest, ' the deck ') == 1 .or. index(rest, ' and ') == 1 .or. index(rest, ' &output: file') == 1) return
      colon = index(rest, ':')
      stat = 1
      if (colon > 1) then
         if (verify(rest(:colon - 1), '0123456789') == 0) read (rest(:colon - 1), *, iostat=stat) line
      end if
      if (stat /= 0 .or. line < 1) reason = 'no line is named: '//message
   end subroutine read_place

   !> Number of lines, whatever ends them.
   pure function lines_of(text) result(lines)
      !> The text.
      character(len=*), intent(in) :: text
      !> Their number, at least 1.
      integer :: lines

      integer :: i

      lines = 1
      do i = 1, len(text)
         if (text(i:i) == carriage_return) then
            lines = lines + 1
         else if (text(i:i) == line_feed) then
            if (text(max(i - 1, 1):max(i - 1, 1)) /= carriage_return) lines = lines + 1
         end if
      end do
   end function lines_of

   !> Whether a text holds control characters other than line ends, those of Unicode's second page included.
   pure function has_control(text) result(has)
      !> The text, in UTF-8.
      character(len=*), intent(in) :: text
      !> It does.
      logical :: has

      integer :: i

      has = .false.
      do i = 1, len(text)
         select case (iachar(text(i:i)))
         case (0:9, 11:31, 127)
            has = .true.
         case (194)
            if (i < len(text)) has = has .or. (iachar(text(i + 1:i + 1)) >= 128 .and. iachar(text(i + 1:i + 1)) < 160)
         end select
      end do
   end function has_control

end module fuzz_oracles
