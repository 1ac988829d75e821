!> Signals: SIGUSR1, which mpirun and batch systems pass on to every rank, asks the program to stop early and cleanly; SIGXFSZ,
!> which tells of a file at its largest allowed size, must not end it.
module spurflex_external_signals
   use, intrinsic :: iso_c_binding, only: c_funloc, c_funptr, c_int, c_intptr_t, c_null_funptr
   implicit none
   private

   public :: watch_for_drain, drain_is_asked_for, survive_size_limit

   !> Number of SIGUSR1 on Linux, except on MIPS and Alpha.
   integer(c_int), parameter :: sigusr1 = 10_c_int
   !> Number of SIGXFSZ on Linux, except on MIPS.
   integer(c_int), parameter :: sigxfsz = 25_c_int
   !> Instead of a handler: nothing happens (`SIG_IGN`).
   integer(c_intptr_t), parameter :: nothing = 1_c_intptr_t

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

   !> From now on a write beyond the largest allowed size fails, as it does on a full disk, instead of ending the process.
   subroutine survive_size_limit()
      type(c_funptr) :: previous

      previous = c_signal(sigxfsz, transfer(nothing, c_null_funptr))
   end subroutine survive_size_limit

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
