!> Reads many spoiled decks, and says what is wrong with the reader.
!>
!> A deck is made from the seed and its number alone: `--seed S --first N --count 1` makes one again. Each deck is written to
!> the file `...-running.nml` before it is read, so that one that ends the process is found there; one that breaks a
!> promise is kept as `...-N.nml`.
program fuzz_decks
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use pseudo_random, only: random_stream
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i8, wp
   use spurflex_base_text, only: fixed_text, to_text
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: parse_deck
   use spurflex_io_faults, only: excerpt
   use fuzz_mutations, only: change_number, spoil, strange_name
   use fuzz_options, only: options_type, read_options, write_file, peak_megabytes
   use fuzz_oracles, only: fault_of_case, fault_of_refusal, names_line
   use fuzz_pieces, only: pick
   use fuzz_spelling, only: fault_type, respelled
   implicit none

   !> The largest number of broken promises after which nothing more is tried.
   integer, parameter :: most_failures = 10

   type(options_type) :: options
   type(random_stream) :: stream
   character(len=:), allocatable :: reason, text, name
   real(wp) :: longest, began, ended
   integer :: i, unit, failures, accepted, refused, worst
   logical :: usable

   call read_options(options, usable)
   if (.not. usable) stop 2
   failures = 0
   accepted = 0
   refused = 0
   longest = 0.0_wp
   worst = 0
   do i = options%first, options%first + options%count - 1
      stream = stream_of(options%seed, i)
      call cpu_time(began)
      call try_deck(reason)
      call cpu_time(ended)
      if (ended - began > longest) then
         longest = ended - began
         worst = i
      end if
      if (ended - began > options%seconds) reason = 'it takes '//fixed_text(ended - began, 3)//' s'
      if (len(reason) == 0) cycle
      failures = failures + 1
      call write_file(options%save//'-'//to_text(i)//'.nml', text)
      write (error_unit, '(a)') 'deck '//to_text(i)//' of seed '//to_text(options%seed)//', kept as '//options%save//'-'// &
         to_text(i)//'.nml, read as '''//excerpt(name)//''': '//reason
      if (failures == most_failures) exit
   end do
   open (newunit=unit, file=options%save//'-running.nml', status='old')
   close (unit, status='delete')
   write (output_unit, '(a)') to_text(options%count)//' decks of seed '//to_text(options%seed)//': '// &
      to_text(accepted)//' accepted, '//to_text(refused)//' refused, '//to_text(failures)//' failures; the longest took '// &
      fixed_text(longest, 3)//' s (deck '//to_text(worst)//'), at most '//fixed_text(peak_megabytes(), 0)//' MB'
   if (peak_megabytes() > options%megabytes) then
      write (error_unit, '(a)') 'more memory than '//fixed_text(options%megabytes, 0)//' MB'
      failures = failures + 1
   end if
   flush (output_unit)
   ! What the main program holds would count as leaked.
   deallocate (options%decks, options%save, reason, text, name)
   if (failures > 0) stop 1

contains

   !> Make a deck and read it.
   subroutine try_deck(reason)
      !> Which promise is broken; empty if none is.
      character(len=:), allocatable, intent(out) :: reason

      integer, parameter :: shares = 10, most_numbers = 3
      integer :: at, other, share, i

      share = pick(stream, 1, shares)
      name = strange_name(stream)
      at = any_deck(good=share <= 8)
      select case (share)
      case (1:2)
         call try_faulty(at, reason)
      case (3)
         name = 'deck.nml'
         call respelled(options%decks(at)%list, stream, text)
         call expect_same(options%decks(at)%resolved, reason)
      case (4:5)
         text = options%decks(at)%text
         do i = 1, pick(stream, 1, most_numbers)
            call change_number(stream, text)
         end do
         call expect_order(reason)
      case default
         other = any_deck(good=.false.)
         text = options%decks(at)%text
         call spoil(stream, options%decks(other)%text, text)
         call expect_order(reason)
      end select
   end subroutine try_deck

   !> A deck to begin with.
   function any_deck(good) result(at)
      !> It must be one that is accepted.
      logical, intent(in) :: good
      !> Its position.
      integer :: at

      at = pick(stream, 1, size(options%decks))
      if (.not. good) return
      do while (.not. allocated(options%decks(at)%resolved))
         at = pick(stream, 1, size(options%decks))
      end do
   end function any_deck

   !> A deck with one fault at a known line is refused, and the line named.
   subroutine try_faulty(at, reason)
      !> The deck to begin with.
      integer, intent(in) :: at
      !> Which promise is broken; empty if none is.
      character(len=:), allocatable, intent(out) :: reason

      type(fault_type) :: fault
      type(case_type) :: case
      type(error_type), allocatable :: error

      name = 'deck.nml'
      call respelled(options%decks(at)%list, stream, text, fault)
      if (fault%line == 0) then
         call expect_same(options%decks(at)%resolved, reason)
         return
      end if
      call read_text(case, error)
      if (.not. allocated(error)) then
         reason = 'it is accepted, but has a fault in line '//to_text(fault%line)//': '//fault%word
         return
      end if
      reason = fault_of_refusal(text, name, error)
      if (len(reason) == 0 .and. .not. names_line(error%message, name//':'//to_text(fault%line)//':', fault%word)) then
         reason = 'line '//to_text(fault%line)//' with '//fault%word//' is not named: '//error%message
      end if
   end subroutine try_faulty

   !> A deck in another form means the same.
   subroutine expect_same(resolved, reason)
      !> The resolved deck.
      character(len=*), intent(in) :: resolved
      !> Which promise is broken; empty if none is.
      character(len=:), allocatable, intent(out) :: reason

      type(case_type) :: case
      type(error_type), allocatable :: error

      reason = ''
      call read_text(case, error)
      if (allocated(error)) then
         reason = 'in another form it is refused: '//error%message
      else if (case%resolved /= resolved .or. len(case%resolved) /= len(resolved)) then
         reason = 'in another form it resolves to another deck'
      end if
   end subroutine expect_same

   !> A deck is refused in good order, or accepted and sound; then it also means the same in another form.
   subroutine expect_order(reason)
      !> Which promise is broken; empty if none is.
      character(len=:), allocatable, intent(out) :: reason

      type(case_type) :: case
      type(error_type), allocatable :: error

      call read_text(case, error)
      if (allocated(error)) then
         reason = fault_of_refusal(text, name, error)
      else
         reason = fault_of_case(case, name)
      end if
   end subroutine expect_order

   !> Read the deck at hand, written to a file before.
   subroutine read_text(case, error)
      !> The case.
      type(case_type), intent(out) :: case
      !> The faults.
      type(error_type), allocatable, intent(out) :: error

      call write_file(options%save//'-running.nml', text)
      call parse_deck(text, name, case, error)
      if (allocated(error)) then
         refused = refused + 1
      else
         accepted = accepted + 1
      end if
   end subroutine read_text

   !> Random numbers of one deck.
   function stream_of(seed, number) result(numbers)
      !> The seed.
      integer, intent(in) :: seed
      !> Number of the deck.
      integer, intent(in) :: number
      !> The sequence.
      type(random_stream) :: numbers

      integer(i8), parameter :: modulus = 2147483646_i8, spread = 7368787_i8, apart = 1299709_i8
      integer, parameter :: rounds = 3, half = 15
      integer :: i
      real(wp) :: unused

      numbers%state = 1_i8 + modulo(int(seed, i8)*spread + int(number, i8)*apart, modulus)
      ! Without the mixing of halves, neighbouring decks would be alike.
      do i = 1, rounds
         numbers%state = 1_i8 + modulo(ieor(numbers%state, shiftr(numbers%state, half)), modulus)
         call numbers%uniform(0.0_wp, 1.0_wp, unused)
      end do
   end function stream_of

end program fuzz_decks
