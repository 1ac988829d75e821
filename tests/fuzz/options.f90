!> The command line of the fuzz program, the decks it begins with, and the memory it has used.
module fuzz_options
   use, intrinsic :: iso_fortran_env, only: error_unit
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_io_case, only: case_type
   use spurflex_io_deck, only: parse_deck
   use spurflex_io_faults, only: fault_list
   use spurflex_io_namelist, only: namelist_type, parse_namelist
   implicit none
   private

   public :: options_type, deck_type, read_options, write_file, peak_megabytes

   !> A good deck, or a faulty one, to begin with.
   type :: deck_type
      !> Its text.
      character(len=:), allocatable :: text
      !> What it holds; only where it is accepted.
      type(namelist_type) :: list
      !> The resolved deck; not allocated where it is refused.
      character(len=:), allocatable :: resolved
   end type deck_type

   !> What is asked for.
   type :: options_type
      !> Number of decks.
      integer :: count = 10000
      !> Number of the first one, and the seed of all.
      integer :: first = 1, seed = 1
      !> Longest time for one deck [s].
      real(wp) :: seconds = 1.0_wp
      !> Most memory of the process [MB].
      real(wp) :: megabytes = 400.0_wp
      !> Decks are written to files whose names begin like this.
      character(len=:), allocatable :: save
      !> The decks to begin with, shape (decks).
      type(deck_type), allocatable :: decks(:)
   end type options_type

contains

   !> Read the command line and the decks.
   subroutine read_options(options, usable)
      !> What is asked for.
      type(options_type), intent(out) :: options
      !> The command line is in order and every deck can be read.
      logical, intent(out) :: usable

      character(len=:), allocatable :: word, value
      integer :: i, stat

      options%save = 'fuzz-deck'
      allocate (options%decks(0))
      stat = 0
      i = 1
      do while (i <= command_argument_count() .and. stat == 0)
         word = argument(i)
         value = argument(min(i + 1, command_argument_count()))
         i = i + 2
         select case (word)
         case ('--count')
            read (value, *, iostat=stat) options%count
         case ('--first')
            read (value, *, iostat=stat) options%first
         case ('--seed')
            read (value, *, iostat=stat) options%seed
         case ('--seconds')
            read (value, *, iostat=stat) options%seconds
         case ('--megabytes')
            read (value, *, iostat=stat) options%megabytes
         case ('--save')
            options%save = value
         case default
            i = i - 1
            call add_deck(word, options%decks, stat)
         end select
      end do
      usable = stat == 0 .and. any([(allocated(options%decks(i)%resolved), i=1, size(options%decks))])
      if (.not. usable) write (error_unit, '(a)') 'usage: fuzz_decks [--count N] [--seed N] [--first N] [--seconds S] '// &
         '[--megabytes M] [--save BEGINNING] DECK...; at least one deck must be good'
   end subroutine read_options

   !> Read a deck.
   subroutine add_deck(path, decks, stat)
      !> Its file.
      character(len=*), intent(in) :: path
      !> The decks; it is added.
      type(deck_type), allocatable, intent(inout) :: decks(:)
      !> Not 0 if it cannot be read.
      integer, intent(out) :: stat

      type(deck_type) :: deck
      type(case_type) :: case
      type(error_type), allocatable :: error
      type(fault_list) :: faults
      integer :: unit, bytes

      open (newunit=unit, file=path, status='old', action='read', access='stream', form='unformatted', iostat=stat)
      if (stat /= 0) return
      inquire (unit=unit, size=bytes)
      allocate (character(len=bytes) :: deck%text)
      read (unit, iostat=stat) deck%text
      close (unit)
      if (stat /= 0) return
      call parse_deck(deck%text, 'deck.nml', case, error)
      if (.not. allocated(error)) then
         deck%resolved = case%resolved
         call parse_namelist(deck%text, deck%list, faults)
      end if
      decks = [decks, deck]
   end subroutine add_deck

   !> One word of the command line.
   function argument(number) result(word)
      !> Number of the word, from 1.
      integer, intent(in) :: number
      !> The word.
      character(len=:), allocatable :: word

      integer :: length

      call get_command_argument(number, length=length)
      allocate (character(len=length) :: word)
      if (length > 0) call get_command_argument(number, value=word)
   end function argument

   !> Write a text to a file, byte by byte.
   subroutine write_file(path, text)
      !> The file; replaced if it exists.
      character(len=*), intent(in) :: path
      !> The text.
      character(len=*), intent(in) :: text

      integer :: unit, stat

      open (newunit=unit, file=path, status='replace', action='write', access='stream', form='unformatted', iostat=stat)
      if (stat /= 0) then
         write (error_unit, '(2a)') 'cannot write ', path
         return
      end if
      write (unit, iostat=stat) text
      if (stat /= 0) write (error_unit, '(2a)') 'cannot write all of ', path
      close (unit)
   end subroutine write_file

   !> The most memory that the process has held so far.
   function peak_megabytes() result(megabytes)
      !> The memory [MB]; 0 where the system does not tell.
      real(wp) :: megabytes

      real(wp), parameter :: kilobytes_per_megabyte = 1024.0_wp
      character(len=*), parameter :: label = 'VmHWM:'
      character(len=200) :: line
      integer :: unit, stat, kilobytes

      megabytes = 0.0_wp
      open (newunit=unit, file='/proc/self/status', status='old', action='read', iostat=stat)
      if (stat /= 0) return
      do
         read (unit, '(a)', iostat=stat) line
         if (stat /= 0) exit
         if (index(line, label) /= 1) cycle
         read (line(len(label) + 1:), *, iostat=stat) kilobytes
         if (stat == 0) megabytes = real(kilobytes, wp)/kilobytes_per_megabyte
         exit
      end do
      close (unit)
   end function peak_megabytes

end module fuzz_options
