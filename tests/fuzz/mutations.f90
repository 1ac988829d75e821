!> Spoils decks: bytes, words, numbers, lines and groups are changed at random, most of them towards what breaks readers.
module fuzz_mutations
   use pseudo_random, only: random_stream
   use fuzz_pieces, only: pick, chance, any_place, word_at, number_at, line_at, replaced
   implicit none
   private

   public :: spoil, change_number, strange_name

   character(len=1), parameter :: tab = achar(9), line_feed = achar(10), carriage_return = achar(13)

   !> One entry of a list of texts.
   integer, parameter :: longest = 48

   !> What stands where a number is expected: the extremes of doubles, of integers and of the ranges of keys, what other
   !> languages take for numbers, and ordinary numbers.
   character(len=longest), parameter :: numbers(*) = [character(len=longest) :: &
      '1e999', '-1e999', '1e-400', '-0', '-0.0', '0', '0.0', 'nan', 'NaN', '-nan', 'nan(0x1)', 'inf', '-inf', '+Infinity', &
      '1000000000*1.0', '9999999999999999999', '99999999999999999999*0', '2147483647', '2147483648', '-2147483648', &
      '9223372036854775807', '9223372036854775808', '-9223372036854775808', '1.7976931348623157e308', '1.8e308', &
      '2.2250738585072014e-308', '4.9e-324', '1e307', '9.9999999999999999e307', '1e-307', '0e999999999999', '0.0e-99999', &
      '1e+', '1e', 'e5', '.', '+', '-', '.5', '5.', '+.5d+2', '1d3', '1D-3', '1q3', '1.0_dp', '0x1p4', '1,5', '1.5.2', '1e5e5', &
      '--5', '+-5', '1_000', '3*', '3*1.0', '2*', '0*1.0', '2*''a''', '(1.0,2.0)', '.true.', 'T', '1.0rpm', '12 000', '1e3e', &
      '1.0000000000000002e12', '1e12', '1e18', '1.0000000000000002e18', '1e6', '1000001', '0.5', '1e-12', '9.99e-13', '0.1', &
      '0.10000000000000002', '90.0', '89.99999999999999', '360', '-360', '-360.00000000000006', '1', '2', '7', '8', '16', '64', &
      '1.5', '1e-5', '3000', '1048576', '1048577', '10000000', '100000000', '5e-5', '-2.0', '-2.0000000000000004', &
      '00000000000000000000000000000000000000000000001', '0.00000000000000000000000000000000000000000001', '1.e0', &
      '123456789012345678901234567890.0e-20', '1e2147483648', '1e-2147483649', '1e99999999999999999999']

   !> Words of the language and of this deck, and what is none of either.
   character(len=longest), parameter :: words(*) = [character(len=longest) :: &
      '/', '&end', '&', '&&', '$end', '=', '==', ',', ',,', '''', '"', '''''', '!', '!''', '(', ')', '(1)', '(1:2)', '%x', ';', &
      '&sweep', '&SWEEP', '&sweeep', '&nothing', '&case /', '/ /', '////', '& sweep', '&sweep/', '/&sweep', &
      'speed_first', 'speed_first = 1.0', 'speed_first(1) =', 'sped_first = 1', 'SPEED_LAST=', 'zzz = 1', 'title = ''x''', &
      'title =', '= 1.0', 'support = ''both''', 'support = rigid', 'products = 16*''map''', 'products = ''map'', ''map''', &
      'file = ''''', 'file = ''../x''', 'file = ''/''', 'file = ''deck.nml''', 'file = ''a''''b.h5''', &
      'stiffness_coefficients = 64*0.01', 'stiffness_coefficients = 65*0.0', 'stiffness_coefficients = -2.0, 2.0', &
      'stiffness_phases = 3*360', 'error_phases = 1.0', 'error_amplitudes = 10000*0', 'error_amplitudes = 10001*0', &
      'speed_count = 1', 'stiffness_count = 1000000', 'speed_count = 1000000', 'steps_per_period = 7', 'newmark_beta = 0.1', &
      'newmark_gamma = 0.4', 'integrator = ''newmark''', 'start = ''up''', 'null()', '.false.', '''rigid''', '"flexible"', &
      '''both', '~', '\', '\n', '%s%n', '$(id)', '`id`', '{}', '[1]', '*', '3*', '**', '<!--', '#', '//', '/'//'*']

   !> Bytes that are no plain text.
   character(len=8), parameter :: bytes(*) = [character(len=8) :: &
      achar(0), char(239)//char(187)//char(191), char(254)//char(255), char(195)//char(188), char(195), &
      char(192)//char(175), char(237)//char(160)//char(128), char(244)//char(144)//char(128)//char(128), &
      char(240)//char(159)//char(154)//char(130), char(194)//char(155)//'31m', char(226)//char(128)//char(174), &
      achar(27)//'[2J', achar(7), achar(8), achar(127), char(128), char(255), tab, carriage_return, line_feed, &
      carriage_return//line_feed, achar(12), achar(26), char(194)//char(160)]

   !> Names under which a deck is read.
   character(len=longest), parameter :: names(*) = [character(len=longest) :: &
      'deck.nml', 'folder/deck.nml', '../deck', '/deck.nml', './x.h5', 'it''s.nml', 'a"b.nml', ' a b .nml', '.nml', 'deck.', &
      'b'//char(195)//char(188)//'.nml', 'b'//char(195)//'.nml', char(255)//char(254), 'a'//achar(10)//'b.nml', &
      'a'//achar(27)//'[2J.nml', 'a'//char(194)//char(155)//'m.nml', '!x.nml', '&x /.nml', '..', 'x.h5.part.nml', '...nml']

contains

   !> Change a deck at one to eight places.
   subroutine spoil(stream, other, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> Another deck, pieces of which may be taken over.
      character(len=*), intent(in) :: other
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      integer, parameter :: most_changes = 8, rare = 400
      integer :: i, changes

      changes = 1
      do while (chance(stream, 2) .and. changes < most_changes)
         changes = changes + 1
      end do
      do i = 1, changes
         select case (pick(stream, 1, 5))
         case (1)
            call change_bytes(stream, text)
         case (2)
            call change_words(stream, text)
         case (3)
            call change_number(stream, text)
         case (4)
            call change_lines(stream, other, text)
         case default
            call change_form(stream, text)
         end select
      end do
      if (chance(stream, rare)) call swell(stream, text)
   end subroutine spoil

   !> The name of the deck: in most cases an ordinary one.
   function strange_name(stream) result(name)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The name.
      character(len=:), allocatable :: name

      integer, parameter :: ordinary = 4, long_name = 300

      name = 'deck.nml'
      if (.not. chance(stream, ordinary)) return
      name = trim(names(pick(stream, 1, size(names))))
      if (chance(stream, ordinary)) name = repeat(char(195)//char(188), pick(stream, 1, long_name))//name
   end function strange_name

   !> Flip, delete, insert and double bytes.
   subroutine change_bytes(stream, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      integer, parameter :: most = 40
      integer :: at, last

      at = any_place(stream, text)
      last = min(at + pick(stream, 0, most), len(text))
      select case (pick(stream, 1, 8))
      case (1)
         if (len(text) > 0) text(at:at) = char(ieor(ichar(text(at:at)), 2**pick(stream, 0, 7)))
      case (2)
         if (len(text) > 0) text(at:at) = char(pick(stream, 0, 255))
      case (3)
         text = replaced(text, [at, min(at, len(text))], '')
      case (4)
         text = replaced(text, [at, at - 1], char(pick(stream, 1, 255)))
      case (5)
         text = replaced(text, [at, last], '')
      case (6)
         text = replaced(text, [at, at - 1], text(at:last))
      case (7)
         text = replaced(text, [at, at - 1], trim(bytes(pick(stream, 1, size(bytes)))))
      case default
         text = text(:at - 1)
      end select
   end subroutine change_bytes

   !> Swap, delete, insert, double and replace words.
   subroutine change_words(stream, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      character(len=:), allocatable :: first, second
      integer :: one(2), two(2), swap(2)

      one = word_at(text, any_place(stream, text))
      select case (pick(stream, 1, 5))
      case (1)
         two = word_at(text, any_place(stream, text))
         if (two(1) < one(1)) then
            swap = one
            one = two
            two = swap
         end if
         if (two(1) <= one(2)) return
         first = text(one(1):one(2))
         second = text(two(1):two(2))
         text = replaced(replaced(text, two, first), one, second)
      case (2)
         text = replaced(text, one, '')
      case (3)
         text = replaced(text, one, text(one(1):one(2))//' '//text(one(1):one(2)))
      case (4)
         text = replaced(text, one, trim(words(pick(stream, 1, size(words)))))
      case default
         text = replaced(text, [one(1), one(1) - 1], ' '//trim(words(pick(stream, 1, size(words))))//' ')
      end select
   end subroutine change_words

   !> Put an extreme in the place of a number, or several numbers in the place of one.
   subroutine change_number(stream, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      integer, parameter :: most_copies = 80
      character(len=:), allocatable :: number
      integer :: ends(2)

      ends = number_at(text, any_place(stream, text))
      number = trim(numbers(pick(stream, 1, size(numbers))))
      select case (pick(stream, 1, 8))
      case (1)
         number = repeat(number//', ', pick(stream, 0, most_copies))//number
      case (2)
         number = text(ends(1):ends(2))//', '//number
      case (3)
         number = ''''//number//''''
      end select
      text = replaced(text, ends, number)
   end subroutine change_number

   !> Double, delete, move, join and split lines; take groups twice; take over lines of another deck.
   subroutine change_lines(stream, other, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> Another deck.
      character(len=*), intent(in) :: other
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      character(len=:), allocatable :: line
      integer :: one(2), two(2), at

      one = line_at(text, any_place(stream, text))
      line = text(one(1):one(2))
      at = any_place(stream, text)
      select case (pick(stream, 1, 8))
      case (1)
         text = replaced(text, one, line//line)
      case (2)
         text = replaced(text, one, '')
      case (3)
         text = replaced(text, one, '')
         two = line_at(text, any_place(stream, text))
         text = replaced(text, [two(1), two(1) - 1], line)
      case (4)
         text = replaced(text, one, line(:len(line) - 1))
      case (5)
         text = replaced(text, [at, at - 1], line_feed)
      case (6)
         two = line_at(other, any_place(stream, other))
         text = replaced(text, [one(1), one(1) - 1], other(two(1):two(2)))
      case (7)
         at = index(text(:at), '&', back=.true.)
         if (at > 0) text = text//text(at:min(at + index(text(at:), '/') - 1, len(text)))//line_feed
      case default
         if (at < one(1)) text = text(one(1):)//text(:at)
      end select
   end subroutine change_lines

   !> Change line ends, quotes and brackets everywhere, or nest what must not be nested.
   subroutine change_form(stream, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      integer, parameter :: deep = 300
      integer :: at

      at = any_place(stream, text)
      select case (pick(stream, 1, 8))
      case (1)
         text = exchanged(text, line_feed, carriage_return//line_feed)
      case (2)
         text = exchanged(text, line_feed, carriage_return)
      case (3)
         text = exchanged(text, '''', '"')
      case (4)
         at = index(text(:min(at, len(text))), '''', back=.true.)
         if (at > 0) text = replaced(text, [at, at], '')
      case (5)
         text = replaced(text, [at, at - 1], repeat('/', pick(stream, 1, deep)))
      case (6)
         text = replaced(text, [at, at - 1], repeat('&sweep ', pick(stream, 1, deep)))
      case (7)
         text = replaced(text, [at, at - 1], repeat('(', pick(stream, 1, deep)))
      case default
         text = replaced(text, [at, at - 1], repeat('''', pick(stream, 1, deep)))
      end select
   end subroutine change_form

   !> Make a deck very large: a line, a number, a text, keys, groups or values without end.
   subroutine swell(stream, text)
      !> Random numbers.
      type(random_stream), intent(inout) :: stream
      !> The deck.
      character(len=:), allocatable, intent(inout) :: text

      ! Some are beyond the largest deck.
      integer, parameter :: most = 1200000
      character(len=:), allocatable :: piece
      integer :: at

      at = any_place(stream, text)
      select case (pick(stream, 1, 10))
      case (1)
         piece = ' '
      case (2)
         piece = '1'
      case (3)
         piece = 'a'
      case (4)
         piece = ' a = 1'//line_feed
      case (5)
         piece = '&b /'
      case (6)
         piece = '1.0, '
      case (7)
         piece = '/ '
      case (8)
         piece = '''x'' '
      case (9)
         piece = line_feed
      case default
         piece = char(pick(stream, 1, 255))
      end select
      text = replaced(text, [at, at - 1], repeat(piece, pick(stream, 1, most)/len(piece)))
   end subroutine swell

   !> A text with every occurrence of a piece exchanged.
   pure function exchanged(text, old, new) result(changed)
      !> The text.
      character(len=*), intent(in) :: text
      !> The piece.
      character(len=1), intent(in) :: old
      !> What takes its place.
      character(len=*), intent(in) :: new
      !> The new text.
      character(len=:), allocatable :: changed

      character(len=len(text)*len(new)) :: buffer
      integer :: i, length

      length = 0
      do i = 1, len(text)
         if (text(i:i) == old) then
            buffer(length + 1:length + len(new)) = new
            length = length + len(new)
         else
            length = length + 1
            buffer(length:length) = text(i:i)
         end if
      end do
      changed = buffer(:length)
   end function exchanged

end module fuzz_mutations
