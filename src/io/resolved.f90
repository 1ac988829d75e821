!> Prints a deck with every default filled in.
module spurflex_io_resolved
   use spurflex_base_text, only: to_text
   use spurflex_io_checks, only: uses_flexible
   use spurflex_io_schema, only: key_spec, kind_integer, kind_real, need_flexible
   use spurflex_io_values, only: deck_values
   use spurflex_io_convert, only: deck_value
   implicit none
   private

   public :: resolved_deck

   character(len=1), parameter :: newline = achar(10)

contains

   !> The deck with every default filled in. What the asked-for support does not use is left out.
   pure function resolved_deck(table) result(text)
      !> The values; without faults.
      type(deck_values), intent(in) :: table
      !> Namelist text that reads back to the same values.
      character(len=:), allocatable :: text

      logical :: printed(size(table%keys))
      integer :: i, j

      printed = table%values%valid .and. .not. table%keys%of_run
      if (.not. uses_flexible(table)) printed = printed .and. table%keys%need /= need_flexible
      text = ''
      do i = 1, size(table%groups)
         if (.not. any(printed .and. table%keys%group == table%groups(i)%name)) cycle
         text = text//'&'//trim(table%groups(i)%name)//newline
         do j = 1, size(table%keys)
            if (.not. printed(j) .or. table%keys(j)%group /= table%groups(i)%name) cycle
            text = text//'  '//trim(table%keys(j)%key)//' = '//value_text(table%keys(j), table%values(j))//newline
         end do
         text = text//'/'//newline
      end do
   end function resolved_deck

   !> The value of a key as it is written in a deck.
   pure function value_text(spec, value) result(text)
      !> The key.
      type(key_spec), intent(in) :: spec
      !> Its value.
      type(deck_value), intent(in) :: value
      !> Text that reads back to the same value.
      character(len=:), allocatable :: text

      integer, parameter :: values_per_line = 4
      integer :: i

      text = ''
      do i = 1, size(value%reals)
         if (i > 1) then
            text = text//','
            if (mod(i, values_per_line) == 1) text = text//newline//'   '
            text = text//' '
         end if
         select case (spec%kind)
         case (kind_integer)
            text = text//to_text(value%whole)
         case (kind_real)
            text = text//to_text(value%reals(i))
         case default
            text = text//quoted(value%texts(i)%text)
         end select
      end do
   end function value_text

   !> Text in quotes.
   pure function quoted(text) result(literal)
      !> The text.
      character(len=*), intent(in) :: text
      !> It in quotes, quotes inside doubled.
      character(len=:), allocatable :: literal

      integer :: i

      literal = ''''
      do i = 1, len(text)
         literal = literal//text(i:i)
         if (text(i:i) == '''') literal = literal//''''
      end do
      literal = literal//''''
   end function quoted

end module spurflex_io_resolved
