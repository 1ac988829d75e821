!> The key reference, `input/README.md`, printed from the table of keys.
module spurflex_io_reference
   use spurflex_base_text, only: to_text
   use spurflex_io_convert, only: allowed_text
   use spurflex_io_schema, only: key_spec, group_spec, deck_keys, deck_groups, range_text, kind_integer, kind_real, kind_text, &
      need_always, need_flexible
   implicit none
   private

   public :: key_reference

   character(len=1), parameter :: newline = achar(10)

contains

   !> The whole key reference.
   pure function key_reference() result(markdown)
      !> Markdown text, with a final newline.
      character(len=:), allocatable :: markdown

      type(key_spec), allocatable :: keys(:)
      type(group_spec), allocatable :: groups(:)
      integer :: i, j

      allocate (keys, source=deck_keys())
      allocate (groups, source=deck_groups())
      markdown = introduction()
      do i = 1, size(groups)
         markdown = markdown//newline//'## &'//trim(groups(i)%name)//newline//newline//trim(groups(i)%meaning)//newline// &
            newline//'| key | unit | type | default | allowed | meaning |'//newline//'|---|---|---|---|---|---|'//newline
         do j = 1, size(keys)
            if (keys(j)%group == groups(i)%name) markdown = markdown//key_row(keys(j))//newline
         end do
      end do
   end function key_reference

   !> How a deck is written.
   pure function introduction() result(text)
      !> Markdown text.
      character(len=:), allocatable :: text

      character(len=*), parameter :: lines(*) = [character(len=125) :: &
         '# Decks', &
         '', &
         'A deck says everything about one run. `build/spurflex deck.nml --check` reads it, prints it with every default', &
         'filled in, and runs nothing; faults are reported all at once, each with its line. This page is printed by', &
         '`build/spurflex --keys` from the table that reads the decks.', &
         '', &
         'A deck is Fortran namelist text: groups that begin with `&name` and end with `/`, and in them lines `key = value`.', &
         '', &
         '    &sweep                      ! a comment reaches to the end of its line', &
         '      support     = ''rigid''     ! text stands in quotes; a quote inside of text is doubled', &
         '      speed_first = 300.0       ! numbers without unit; 1.5e3 and 1.5d3 are the same', &
         '      speed_last  = 6000.0', &
         '      speed_count = 58          ! a whole number has neither point nor exponent', &
         '    /', &
         '', &
         '- A list is written with commas or blanks, `error_amplitudes = 1.0e-5, 2.0e-6`; `3*0.0` stands for three values.', &
         '  The first value belongs to the first harmonic. An index such as `error_phases(2) = 90.0` is not supported.', &
         '- Groups and keys may come in any order, each once, in small or capital letters; words in quotes in small letters.', &
         '- Nothing but comments stands outside of the groups. An unknown key is a fault, not a remark.', &
         '- Units are those below. Angles are in degrees.', &
         '- Keys marked `flexible` are required where `support` is ''flexible'' or ''both''. With ''rigid'' they may stay in the', &
         '  deck; they are checked but not used.']
      integer :: i

      text = ''
      do i = 1, size(lines)
         text = text//trim(lines(i))//newline
      end do
   end function introduction

   !> The row of one key.
   pure function key_row(key) result(row)
      !> The key.
      type(key_spec), intent(in) :: key
      !> Its row of the table.
      character(len=:), allocatable :: row

      character(len=:), allocatable :: default, allowed

      select case (key%need)
      case (need_always)
         default = '**required**'
      case (need_flexible)
         default = '**required**, flexible'
      case default
         default = trim(key%default)
         if (.not. key%derived) default = '`'//default//'`'
      end select
      select case (key%kind)
      case (kind_integer, kind_real)
         allowed = range_text(key)
      case default
         allowed = allowed_text(key)
      end select
      row = '| `'//trim(key%key)//'` | '//trim(key%unit)//' | '//type_text(key)//' | '//default//' | '//allowed//' | '// &
         trim(key%meaning)//' |'
   end function key_row

   !> The type of a key in words.
   pure function type_text(key) result(text)
      !> The key.
      type(key_spec), intent(in) :: key
      !> Its type.
      character(len=:), allocatable :: text

      select case (key%kind)
      case (kind_integer)
         text = 'whole number'
      case (kind_real)
         text = 'number'
      case (kind_text)
         text = 'text'
      case default
         text = 'word'
      end select
      if (key%most > 1) text = 'list of 1 to '//to_text(key%most)//' '//text//'s'
   end function type_text

end module spurflex_io_reference
