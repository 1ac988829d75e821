!> Keeps the linear algebra library to one thread: the ranks are the parallelism, and for matrices as small as ours more threads
!> only wait for each other.
module spurflex_external_threads
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_procpointer, c_funptr, c_int, c_null_char, c_null_ptr, c_ptr
   implicit none
   private

   public :: use_one_thread

   abstract interface
      !> Set the number of threads.
      subroutine set_threads(threads) bind(c)
         import :: c_int
         integer(c_int), value :: threads
      end subroutine set_threads
   end interface

   interface
      !> Address of a symbol of the running program.
      function c_dlsym(handle, symbol) bind(c, name='dlsym') result(address)
         import :: c_char, c_funptr, c_ptr
         type(c_ptr), value :: handle
         character(kind=c_char), intent(in) :: symbol(*)
         type(c_funptr) :: address
      end function c_dlsym
   end interface

contains

   !> Tell the library, if it is one that asks: OpenBLAS. Others read their environment or have no threads.
   subroutine use_one_thread()
      procedure(set_threads), pointer :: tell
      type(c_funptr) :: address

      address = c_dlsym(c_null_ptr, 'openblas_set_num_threads'//c_null_char)
      if (.not. c_associated(address)) return
      call c_f_procpointer(address, tell)
      call tell(1_c_int)
   end subroutine use_one_thread

end module spurflex_external_threads
