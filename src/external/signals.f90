!> The signal that asks the program to stop early and cleanly: SIGUSR1, which mpirun and batch systems pass on to every rank.
module spurflex_external_signals
   use, intrinsic :: iso_c_binding, only: c_funloc, c_funptr, c_int
   implicit none
   private

   public :: watch_for_drain, drain_is_asked_for

   !> Number of SIGUSR1 on Linux, except on MIPS and Alpha.
   integer(c_int), parameter :: sigusr1 = 10_c_int

   !> Set by the handler, which may do nothing else: the one state of the process that is not passed as an argument.
   logical, volatile :: asked = .false.

   interface
      !> Set what happens at a signal.
      function c_signal(number, handler) bind(c, name='signal') result(previous)
         import :: c_funptr, c_int
         integer(c_int), value :: number
         type(c_funptr), value :: handler
         type(c_funptr) :: previous
      end function c_signal
   end interface

contains

   !> From now on SIGUSR1 asks for a drain instead of ending the process.
   subroutine watch_for_drain()
      type(c_funptr) :: previous

      previous = c_signal(sigusr1, c_funloc(note_signal))
   end subroutine watch_for_drain

   !> The handler.
   subroutine note_signal(number) bind(c)
      !> Number of the signal.
      integer(c_int), value :: number

      if (number == sigusr1) asked = .true.
   end subroutine note_signal

   !> A drain has been asked for.
   function drain_is_asked_for() result(is_asked)
      !> SIGUSR1 has come.
      logical :: is_asked

      is_asked = asked
   end function drain_is_asked_for

end module spurflex_external_signals
