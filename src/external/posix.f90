!> The few system calls on files that Fortran lacks, with failures as `error_type`.
module spurflex_external_posix
   use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_null_char, c_ptr, c_associated, c_size_t
   use spurflex_base_error, only: error_type, fatal_error
   implicit none
   private

   public :: rename_file, remove_file, sync_file
   public :: c_string, errno, failure_reason
   public :: c_fopen, c_fclose, c_fileno

   interface
      !> Rename a file; replaces `new` in one step.
      function c_rename(old, new) bind(c, name='rename') result(status)
         import :: c_char, c_int
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: old(*)
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: new(*)
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_rename

      !> Remove a file.
      function c_unlink(path) bind(c, name='unlink') result(status)
         import :: c_char, c_int
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: path(*)
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_unlink

      !> Bring a file's contents to the disk.
      function c_fsync(descriptor) bind(c, name='fsync') result(status)
         import :: c_int
         !> Open file descriptor.
         integer(c_int), value :: descriptor
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_fsync

      !> Open a stream. Unlike `open` it takes a fixed number of arguments, as an interface needs.
      function c_fopen(path, mode) bind(c, name='fopen') result(stream)
         import :: c_char, c_ptr
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: path(*)
         !> Null-terminated mode, such as `a+`.
         character(kind=c_char), intent(in) :: mode(*)
         !> The stream, or a null pointer on failure.
         type(c_ptr) :: stream
      end function c_fopen

      !> Close a stream.
      function c_fclose(stream) bind(c, name='fclose') result(status)
         import :: c_int, c_ptr
         !> The stream.
         type(c_ptr), value :: stream
         !> 0, or nonzero on failure.
         integer(c_int) :: status
      end function c_fclose

      !> The file descriptor of a stream.
      function c_fileno(stream) bind(c, name='fileno') result(descriptor)
         import :: c_int, c_ptr
         !> The stream.
         type(c_ptr), value :: stream
         !> Its file descriptor.
         integer(c_int) :: descriptor
      end function c_fileno

      !> Where the C library keeps `errno` (glibc and musl).
      function c_errno_location() bind(c, name='__errno_location') result(location)
         import :: c_ptr
         !> Address of an int.
         type(c_ptr) :: location
      end function c_errno_location

      !> The words for an `errno`.
      function c_strerror(number) bind(c, name='strerror') result(text)
         import :: c_int, c_ptr
         !> Error number.
         integer(c_int), value :: number
         !> Null-terminated text that must not be freed.
         type(c_ptr) :: text
      end function c_strerror

      !> Length of a C string.
      pure function c_strlen(text) bind(c, name='strlen') result(length)
         import :: c_ptr, c_size_t
         !> Null-terminated text.
         type(c_ptr), value, intent(in) :: text
         !> Characters before the null.
         integer(c_size_t) :: length
      end function c_strlen
   end interface

contains

   !> Rename a file in one step, replacing the target if it exists.
   subroutine rename_file(old, new, error)
      !> Path of the file.
      character(len=*), intent(in) :: old
      !> Path it shall have.
      character(len=*), intent(in) :: new
      !> Set if the file cannot be renamed.
      type(error_type), allocatable, intent(out) :: error

      if (c_rename(c_string(old), c_string(new)) /= 0) then
         call fatal_error(error, "cannot rename '"//old//"' to '"//new//"': "//failure_reason(errno()))
      end if
   end subroutine rename_file

   !> Remove a file.
   subroutine remove_file(path, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Set if the file cannot be removed.
      type(error_type), allocatable, intent(out) :: error

      if (c_unlink(c_string(path)) /= 0) then
         call fatal_error(error, "cannot remove '"//path//"': "//failure_reason(errno()))
      end if
   end subroutine remove_file

   !> Bring a closed file's contents to the disk, so that a rename that follows never shows an empty file after a crash.
   subroutine sync_file(path, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Set if the contents cannot be brought to the disk.
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: stream
      integer(c_int) :: status, reason, close_status

      stream = c_fopen(c_string(path), c_string('r+'))
      if (c_associated(stream)) then
         status = c_fsync(c_fileno(stream))
         reason = errno()
         close_status = c_fclose(stream)
         if (status == 0 .and. close_status == 0) return
      else
         reason = errno()
      end if
      call fatal_error(error, "cannot bring '"//path//"' to the disk: "//failure_reason(reason))
   end subroutine sync_file

   !> A Fortran string as C takes it.
   pure function c_string(text) result(characters)
      !> Text; trailing blanks are part of it.
      character(len=*), intent(in) :: text
      !> The characters and a null.
      character(kind=c_char) :: characters(len(text) + 1)

      integer :: i

      do i = 1, len(text)
         characters(i) = text(i:i)
      end do
      characters(len(text) + 1) = c_null_char
   end function c_string

   !> Number of the last failure of a system call in this thread.
   function errno() result(number)
      !> The error number.
      integer(c_int) :: number

      integer(c_int), pointer :: location

      call c_f_pointer(c_errno_location(), location)
      number = location
   end function errno

   !> What an error number means.
   function failure_reason(number) result(text)
      !> The error number.
      integer(c_int), intent(in) :: number
      !> Text such as `No such file or directory`.
      character(len=:), allocatable :: text

      type(c_ptr) :: address
      character(kind=c_char), pointer :: characters(:)
      integer :: i

      address = c_strerror(number)
      call c_f_pointer(address, characters, [c_strlen(address)])
      allocate (character(len=size(characters)) :: text)
      do i = 1, size(characters)
         text(i:i) = characters(i)
      end do
   end function failure_reason

end module spurflex_external_posix
