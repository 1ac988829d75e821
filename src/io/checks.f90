!> The rules of a deck that tie several keys together, and the keys that are missing.
module spurflex_io_checks
   use spurflex_base_kinds, only: wp, i8, pi
   use spurflex_base_text, only: to_text
   use spurflex_model_mesh, only: smallest_mesh_stiffness
   use spurflex_model_parameters, only: mesh_excitation
   use spurflex_io_convert, only: allowed_text
   use spurflex_io_faults, only: fault_list, excerpt
   use spurflex_io_record_checks, only: check_quantities, check_records
   use spurflex_io_schema, only: need_always, need_flexible, need_never
   use spurflex_io_values, only: deck_values
   implicit none
   private

   public :: check_values, uses_flexible

   !> Most points of a grid.
   integer(i8), parameter :: most_points = 100000000_i8

contains

   !> Check what no key can tell alone.
   subroutine check_values(table, deck, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> File of the deck; empty if it is none.
      character(len=*), intent(in) :: deck
      !> Faults: those found here are added.
      type(fault_list), intent(inout) :: faults

      call check_missing(table, faults)
      call check_phases(table, 'stiffness_phases', 'stiffness_coefficients', faults)
      call check_phases(table, 'error_phases', 'error_amplitudes', faults)
      call check_mesh_stiffness(table, faults)
      call check_axis(table, 'speed', faults)
      call check_axis(table, 'stiffness', faults)
      call check_points(table, faults)
      call check_solver(table, faults)
      call check_output(table, deck, faults)
      call check_repeated(table, 'products', faults)
      call check_repeated(table, 'quantities', faults)
      call check_quantities(table, faults)
      call check_records(table, faults)
   end subroutine check_values

   !> Whether a flexible support is asked for.
   pure function uses_flexible(table) result(flexible)
      !> The values.
      type(deck_values), intent(in) :: table
      !> It is.
      logical :: flexible

      flexible = any(table%text_of('sweep', 'support') == [character(len=8) :: 'flexible', 'both'])
   end function uses_flexible

   !> Note the groups and keys that are missing.
   subroutine check_missing(table, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      character(len=:), allocatable :: group
      logical :: needed(size(table%keys)), mine(size(table%keys))
      integer :: i, j

      needed = table%keys%need == need_always
      if (uses_flexible(table)) needed = table%keys%need /= need_never
      do i = 1, size(table%groups)
         group = trim(table%groups(i)%name)
         mine = needed .and. table%keys%group == group
         if (.not. any(mine)) cycle
         if (table%group_lines(i) == 0) then
            call faults%add(table%last_line, '&'//group//': the group is missing'// &
               condition(table, all(table%keys%need == need_flexible .or. .not. mine)))
            cycle
         end if
         do j = 1, size(table%keys)
            if (.not. mine(j) .or. table%values(j)%line > 0 .or. table%values(j)%excused) cycle
            call faults%add(table%group_lines(i), '&'//group//': key '''//trim(table%keys(j)%key)//''' is missing'// &
               condition(table, table%keys(j)%need == need_flexible)//'; allowed is '//allowed_text(table%keys(j)))
         end do
      end do
   end subroutine check_missing

   !> On what a need depends.
   pure function condition(table, depends) result(text)
      !> The values.
      type(deck_values), intent(in) :: table
      !> The need depends on the support.
      logical, intent(in) :: depends
      !> The condition; empty if there is none.
      character(len=:), allocatable :: text

      text = ''
      if (depends) text = ' with support = '''//table%text_of('sweep', 'support')//''''
   end function condition

   !> There is one phase for each harmonic.
   subroutine check_phases(table, phases, harmonics, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Key of the phases.
      character(len=*), intent(in) :: phases
      !> Key of the amplitudes.
      character(len=*), intent(in) :: harmonics
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer :: phase_count, harmonic_count

      if (.not. table%known('mesh', [phases]) .or. .not. table%known('mesh', [harmonics])) return
      phase_count = size(table%reals_of('mesh', phases))
      harmonic_count = size(table%reals_of('mesh', harmonics))
      if (phase_count == harmonic_count) return
      call note(table, 'mesh', phases, 'has '//to_text(phase_count)//' values, but '//harmonics//' has '// &
         to_text(harmonic_count)//'; write one phase for each harmonic, or none', faults)
   end subroutine check_phases

   !> The mesh stiffness stays positive over the whole mesh period.
   subroutine check_mesh_stiffness(table, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      real(wp), parameter :: shown = 1.0e-3_wp
      type(mesh_excitation) :: mesh
      real(wp) :: smallest

      if (.not. table%known('mesh', ['stiffness_coefficients'])) return
      mesh%mean_stiffness = 1.0_wp
      mesh%stiffness_coefficients = table%reals_of('mesh', 'stiffness_coefficients')
      if (sum(abs(mesh%stiffness_coefficients)) < 1.0_wp) return
      allocate (mesh%stiffness_phases(size(mesh%stiffness_coefficients)), source=0.0_wp)
      if (table%values(table%at('mesh', 'stiffness_phases'))%line > 0) then
         mesh%stiffness_phases = pi/180.0_wp*table%reals_of('mesh', 'stiffness_phases')
         if (size(mesh%stiffness_phases) /= size(mesh%stiffness_coefficients)) return
      end if
      smallest = smallest_mesh_stiffness(mesh)
      if (smallest > 0.0_wp) return
      call note(table, 'mesh', 'stiffness_coefficients', 'the mesh stiffness falls to '// &
         to_text(anint(smallest/shown)*shown)//' times its mean in the mesh period, but must stay above 0', faults)
   end subroutine check_mesh_stiffness

   !> One axis of the grid: first, last and count go together.
   subroutine check_axis(table, axis, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> 'speed' or 'stiffness'.
      character(len=*), intent(in) :: axis
      !> Faults.
      type(fault_list), intent(inout) :: faults

      real(wp) :: first, last
      integer :: points

      if (.not. table%known('sweep', [axis//'_first', axis//'_last '])) return
      first = table%real_of('sweep', axis//'_first')
      last = table%real_of('sweep', axis//'_last')
      if (first > last) then
         call note(table, 'sweep', axis//'_last', to_text(last)//' is below '//axis//'_first = '//to_text(first), faults)
         return
      end if
      if (.not. table%known('sweep', [axis//'_count'])) return
      points = table%integer_of('sweep', axis//'_count')
      if (points == 1 .and. first < last) then
         call note(table, 'sweep', axis//'_count', '1 point cannot reach from '//to_text(first)//' to '//to_text(last)// &
            '; allowed is at least 2, or equal ends', faults)
      else if (points > 1 .and. .not. first < last) then
         call note(table, 'sweep', axis//'_count', to_text(points)//' points between equal ends '//to_text(first)// &
            '; allowed is 1', faults)
      end if
   end subroutine check_axis

   !> The grid is not larger than anybody could want.
   subroutine check_points(table, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer(i8) :: points

      if (.not. uses_flexible(table) .or. .not. table%known('sweep', ['speed_count    ', 'stiffness_count'])) return
      points = int(table%integer_of('sweep', 'speed_count'), i8)*int(table%integer_of('sweep', 'stiffness_count'), i8)
      if (points <= most_points) return
      call note(table, 'sweep', 'stiffness_count', 'speed_count times stiffness_count is '//to_text(points)// &
         '; allowed is at most '//to_text(most_points), faults)
   end subroutine check_points

   !> The steps resolve a mesh period, and Newmark's method is stable whatever they are.
   subroutine check_solver(table, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer, parameter :: fewest_steps = 8
      real(wp) :: beta, gamma
      integer :: i

      if (table%known('solver', ['steps_per_period'])) then
         if (any(table%integer_of('solver', 'steps_per_period') == [(i, i=1, fewest_steps - 1)])) then
            call note(table, 'solver', 'steps_per_period', to_text(table%integer_of('solver', 'steps_per_period'))// &
               ' steps resolve no mesh period; allowed is 0, which chooses them by the tolerance, or at least '// &
               to_text(fewest_steps), faults)
         end if
      end if
      if (.not. table%known('solver', ['newmark_beta ', 'newmark_gamma'])) return
      beta = table%real_of('solver', 'newmark_beta')
      gamma = table%real_of('solver', 'newmark_gamma')
      if (gamma < 0.5_wp) then
         call note(table, 'solver', 'newmark_gamma', to_text(gamma)//' adds negative damping and is unstable; '// &
            'allowed is at least 0.5', faults)
      else if (2.0_wp*beta < gamma) then
         call note(table, 'solver', 'newmark_beta', to_text(beta)//' is stable for small steps only; allowed is at least '// &
            'newmark_gamma/2 = '//to_text(0.5_wp*gamma), faults)
      end if
   end subroutine check_solver

   !> The result file can be written and is not the deck.
   subroutine check_output(table, deck, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> File of the deck; empty if it is none.
      character(len=*), intent(in) :: deck
      !> Faults.
      type(fault_list), intent(inout) :: faults

      character(len=:), allocatable :: file

      file = table%text_of('output', 'file')
      if (table%known('output', ['file'])) then
         if (len_trim(file) == 0) then
            call note(table, 'output', 'file', 'the name of the result file is empty', faults)
         else if (file(1:1) == ' ' .or. file(len(file):) == ' ') then
            call note(table, 'output', 'file', ''''//excerpt(file)//''' begins or ends with a blank', faults)
         else if (any(last_part(file) == [character(len=2) :: '', '.', '..'])) then
            call note(table, 'output', 'file', ''''//excerpt(file)//''' is the name of a folder, not of a file', faults)
         else if (any(plain_path(deck) == [character(len=len(file) + 5) :: plain_path(file), plain_path(file)//'.part', &
            plain_path(file)//'.lock'])) then
            call note(table, 'output', 'file', ''''//excerpt(file)//''' would overwrite the deck', faults)
         end if
      end if
   end subroutine check_output

   !> No word of a list stands there twice.
   subroutine check_repeated(table, key, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> A key of the output.
      character(len=*), intent(in) :: key
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer :: i, j

      if (.not. table%known('output', [key])) return
      associate (words => table%values(table%at('output', key))%texts)
         do i = 2, size(words)
            do j = 1, i - 1
               if (words(i)%text /= words(j)%text) cycle
               call note(table, 'output', key, ''''//words(i)%text//''' is repeated', faults)
               return
            end do
         end do
      end associate
   end subroutine check_repeated

   !> A path behind its last slash.
   pure function last_part(path) result(part)
      !> The path.
      character(len=*), intent(in) :: path
      !> Its last part; empty if it ends with a slash.
      character(len=:), allocatable :: part

      part = path(index(path, '/', back=.true.) + 1:)
   end function last_part

   !> A path without detours through the same folder.
   pure function plain_path(path) result(plain)
      !> The path.
      character(len=*), intent(in) :: path
      !> The same without `./` and doubled slashes.
      character(len=:), allocatable :: plain

      integer :: i

      plain = '/'//path
      do
         i = index(plain, '//')
         if (i == 0) exit
         plain = plain(:i)//plain(i + 2:)
      end do
      do
         i = index(plain, '/./')
         if (i == 0) exit
         plain = plain(:i)//plain(i + 3:)
      end do
      if (path(1:min(1, len(path))) /= '/') plain = plain(2:)
   end function plain_path

   !> Note a fault of a key, at its line.
   subroutine note(table, group, key, text, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Group of the key.
      character(len=*), intent(in) :: group
      !> The key.
      character(len=*), intent(in) :: key
      !> What is wrong.
      character(len=*), intent(in) :: text
      !> Faults.
      type(fault_list), intent(inout) :: faults

      call faults%add(table%values(table%at(group, key))%line, '&'//group//': '//key//': '//text)
   end subroutine note

end module spurflex_io_checks
