!> The error that fallible procedures return, and the exit codes that the program maps it to.
module spurflex_base_error
   implicit none
   private

   public :: error_type, fatal_error
   public :: exit_complete, exit_internal, exit_deck, exit_mismatch, exit_failed_points, exit_stopped

   !> Every point was computed.
   integer, parameter :: exit_complete = 0
   !> A defect or a failing system call inside the program.
   integer, parameter :: exit_internal = 1
   !> The deck or the command line is wrong; nothing was written.
   integer, parameter :: exit_deck = 2
   !> The existing result file belongs to another deck or program version.
   integer, parameter :: exit_mismatch = 3
   !> The sweep is complete, but at least one point failed.
   integer, parameter :: exit_failed_points = 4
   !> The sweep stopped early and can be resumed by running it again.
   integer, parameter :: exit_stopped = 75

   !> What went wrong: one message for the user and the exit code it leads to.
   type :: error_type
      !> Exit code of the program if the error reaches it.
      integer :: code = exit_internal
      !> Only this rank knows of it: the others are at work and must be ended.
      logical :: alone = .false.
      !> Message; may hold several lines, one per fault.
      character(len=:), allocatable :: message
   end type error_type

contains

   !> Make an error.
   pure subroutine fatal_error(error, message, code)
      !> The error made.
      type(error_type), allocatable, intent(out) :: error
      !> Message for the user, without a trailing newline.
      character(len=*), intent(in) :: message
      !> Exit code; an internal error if absent.
      integer, intent(in), optional :: code

      allocate (error)
      error%message = message
      if (present(code)) error%code = code
   end subroutine fatal_error

end module spurflex_base_error
