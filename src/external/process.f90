!> Leaving the process with an exit code that is known only at run time, which Fortran 2008 cannot do.
module spurflex_external_process
   use, intrinsic :: iso_c_binding, only: c_int
   implicit none
   private

   public :: exit_process

   interface
      subroutine c_exit(status) bind(c, name='exit')
         import :: c_int
         integer(c_int), value :: status
      end subroutine c_exit
   end interface

contains

   !> End the process; flushes what is open. Does not return.
   subroutine exit_process(code)
      !> Exit code, 0..255.
      integer, intent(in) :: code

      call c_exit(int(code, c_int))
   end subroutine exit_process

end module spurflex_external_process
