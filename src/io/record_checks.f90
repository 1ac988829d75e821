!> The rules of a deck on what is recorded: only what exists, and not more than anybody could want.
module spurflex_io_record_checks
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: to_text
   use spurflex_io_faults, only: fault_list
   use spurflex_io_values, only: deck_values
   use spurflex_measure_record, only: observable_of, observables
   implicit none
   private

   public :: check_quantities, check_records

   !> Most bytes that are recorded of one point, and of all.
   real(wp), parameter :: most_record_bytes = 64.0e6_wp, most_records_bytes = 1.0e12_wp
   !> Mesh periods of the window of the spectrum, times quantities: their samples are in memory at once, some hundred a period, a
   !> thousand where the speed is low.
   integer, parameter :: most_windows = 40000
   real(wp), parameter :: bytes_of_real = 8.0_wp

contains

   !> The gearbox is recorded only where it moves.
   subroutine check_quantities(table, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      integer :: i

      if (.not. table%known('output', ['quantities']) .or. table%text_of('sweep', 'support') /= 'rigid') return
      associate (words => table%values(table%at('output', 'quantities'))%texts)
         do i = 1, size(words)
            if (.not. observables(observable_of(words(i)%text))%flexible_only) cycle
            call note(table, 'quantities', ''''//words(i)%text//''' needs a flexible support, but support is '// &
               '''rigid''', faults)
         end do
      end associate
   end subroutine check_quantities

   !> What is recorded of one point, and of all, is not larger than anybody could want.
   subroutine check_records(table, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> Faults.
      type(fault_list), intent(inout) :: faults

      real(wp), parameter :: megabyte = 1.0e6_wp
      real(wp) :: numbers, points
      integer :: i
      logical :: with_spectrum

      if (.not. table%known('output', ['products        ', 'quantities      ', 'highest_order   ', 'spectrum_periods', &
                                       'sections        ', 'history_periods ', 'history_samples '])) return
      numbers = 0.0_wp
      with_spectrum = .false.
      associate (products => table%values(table%at('output', 'products'))%texts)
         do i = 1, size(products)
            select case (products(i)%text)
            case ('spectrum')
               with_spectrum = .true.
               numbers = numbers + table%real_of('output', 'highest_order')*table%integer_of('output', 'spectrum_periods') + 1.0_wp
            case ('poincare')
               numbers = numbers + 2.0_wp*table%integer_of('output', 'sections')
            case ('history')
               numbers = numbers + 2.0_wp*table%integer_of('output', 'history_periods') &
                         *table%integer_of('output', 'history_samples') + 2.0_wp
            end select
         end do
      end associate
      associate (quantities => size(table%values(table%at('output', 'quantities'))%texts))
         if (with_spectrum .and. table%integer_of('output', 'spectrum_periods') > most_windows/quantities) then
            call note(table, 'spectrum_periods', to_text(table%integer_of('output', 'spectrum_periods'))//' mesh periods of '// &
               to_text(quantities)//' quantities need too much memory; allowed are at most '//to_text(most_windows/quantities), &
               faults)
            return
         end if
         numbers = numbers*quantities
      end associate
      if (numbers*bytes_of_real > most_record_bytes) then
         call note(table, 'products', 'the records of one point take '//megabytes(numbers)//'; allowed are at most '// &
            megabytes(most_record_bytes/bytes_of_real), faults)
         return
      end if
      points = 0.0_wp
      if (table%known('sweep', ['speed_count'])) points = table%integer_of('sweep', 'speed_count')
      if (table%text_of('sweep', 'support') /= 'rigid' .and. table%known('sweep', ['stiffness_count'])) then
         points = points*(table%integer_of('sweep', 'stiffness_count') + 1)
      end if
      if (points*numbers*bytes_of_real > most_records_bytes) then
         call note(table, 'products', 'the records of all points take '//megabytes(points*numbers)// &
            '; allowed are at most '//megabytes(most_records_bytes/bytes_of_real), faults)
      end if

   contains

      !> The size of some numbers, as text.
      pure function megabytes(count) result(text)
         !> How many numbers.
         real(wp), intent(in) :: count
         !> Text such as `64 MB`.
         character(len=:), allocatable :: text

         text = to_text(nint(count*bytes_of_real/megabyte, i8))//' MB'
      end function megabytes

   end subroutine check_records

   !> Note a fault of a key of the output, at its line.
   subroutine note(table, key, text, faults)
      !> The values.
      type(deck_values), intent(in) :: table
      !> The key.
      character(len=*), intent(in) :: key
      !> What is wrong.
      character(len=*), intent(in) :: text
      !> Faults.
      type(fault_list), intent(inout) :: faults

      call faults%add(table%values(table%at('output', key))%line, '&output: '//key//': '//text)
   end subroutine note

end module spurflex_io_record_checks
