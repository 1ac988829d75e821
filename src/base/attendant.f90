!> Someone who must be let in now and then during long work, such as the scheduler that answers other ranks.
!>
!> The layers below the sweep know nothing of ranks; they only call `attend` at least once per millisecond of work.
module spurflex_base_attendant
   implicit none
   private

   public :: attendant, no_attendant

   !> Whom to call.
   type, abstract :: attendant
   contains
      !> Do what waits; returns soon.
      procedure(attend_interface), deferred :: attend
   end type attendant

   !> Nobody waits.
   type, extends(attendant) :: no_attendant
   contains
      !> Nothing.
      procedure :: attend => attend_to_nobody
   end type no_attendant

   abstract interface
      !> Do what waits.
      subroutine attend_interface(self)
         import :: attendant
         !> Whom to call.
         class(attendant), intent(inout) :: self
      end subroutine attend_interface
   end interface

contains

   !> Nothing waits.
   subroutine attend_to_nobody(self)
      !> Nobody.
      class(no_attendant), intent(inout) :: self

      if (same_type_as(self, self)) return
   end subroutine attend_to_nobody

end module spurflex_base_attendant
