!> The command line.
module spurflex_io_command_line
   use spurflex_base_error, only: error_type, fatal_error, exit_deck
   use spurflex_io_faults, only: excerpt
   implicit none
   private

   public :: command_type, parse_command_line, usage
   public :: action_run, action_check, action_help, action_version, action_keys

   !> Run the deck.
   integer, parameter :: action_run = 1
   !> Validate the deck and say what would be done.
   integer, parameter :: action_check = 2
   !> Print the usage.
   integer, parameter :: action_help = 3
   !> Print the version and what the program was built with.
   integer, parameter :: action_version = 4
   !> Print the reference of all deck keys.
   integer, parameter :: action_keys = 5

   !> What the user asks for.
   type :: command_type
      !> `action_...`.
      integer :: action = action_run
      !> Path of the deck.
      character(len=:), allocatable :: deck
      !> Start over, replacing an existing result file.
      logical :: fresh = .false.
   end type command_type

   !> How to call the program.
   character(len=*), parameter :: usage = &
      'usage: mpirun -n RANKS spurflex [options] DECK'//new_line('a')// &
      '  DECK        namelist deck; its keys: spurflex --keys'//new_line('a')// &
      '  --check     validate the deck, print it resolved and what would be done; run nothing'//new_line('a')// &
      '  --fresh     start over, replacing an existing result file'//new_line('a')// &
      '  --keys      print the reference of all deck keys (Markdown)'//new_line('a')// &
      '  --version   print the version'//new_line('a')// &
      '  --help      print this'//new_line('a')// &
      'Running a deck again continues its result file.'//new_line('a')// &
      'Exit codes: 0 complete, 1 internal error, 2 deck or usage, 3 result file of another deck or version,'//new_line('a')// &
      '            4 complete with failed points, 75 stopped early, run again to continue.'

contains

   !> Read the command line.
   subroutine parse_command_line(command, error)
      !> What the user asks for.
      type(command_type), intent(out) :: command
      !> Set where the command line is wrong.
      type(error_type), allocatable, intent(out) :: error

      character(len=:), allocatable :: argument
      integer :: i

      do i = 1, command_argument_count()
         call get_argument(i, argument)
         select case (argument)
         case ('--check')
            command%action = action_check
         case ('--help', '-h')
            command%action = action_help
         case ('--version')
            command%action = action_version
         case ('--keys')
            command%action = action_keys
         case ('--fresh')
            command%fresh = .true.
         case default
            if (index(argument, '-') == 1) then
               call fatal_error(error, "unknown option '"//excerpt(argument)//"'"//new_line('a')//usage, exit_deck)
               return
            else if (allocated(command%deck)) then
               call fatal_error(error, "more than one deck: '"//excerpt(command%deck)//"' and '"//excerpt(argument)//"'", exit_deck)
               return
            end if
            command%deck = argument
         end select
      end do
      if (.not. allocated(command%deck) .and. (command%action == action_run .or. command%action == action_check)) then
         call fatal_error(error, 'no deck given'//new_line('a')//usage, exit_deck)
      end if
   end subroutine parse_command_line

   !> One argument, whatever its length.
   subroutine get_argument(number, argument)
      !> Number of the argument, from 1.
      integer, intent(in) :: number
      !> The argument.
      character(len=:), allocatable, intent(out) :: argument

      integer :: length

      call get_command_argument(number, length=length)
      allocate (character(len=length) :: argument)
      if (length > 0) call get_command_argument(number, value=argument)
   end subroutine get_argument

end module spurflex_io_command_line
