!> The few system calls on files that Fortran lacks, with failures as `error_type`.
module spurflex_external_posix
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, c_int64_t, c_long, c_null_char, c_ptr, c_size_t
   use spurflex_base_kinds, only: i8
   use spurflex_base_error, only: error_type, fatal_error
   implicit none
   private

   public :: rename_file, remove_file, sync_file, make_folder, check_writable, check_room, is_link
   public :: c_string, errno, failure_reason
   public :: c_fopen, c_fclose, c_fileno, c_fseek, from_beginning

   !> Read and write for everybody whom the mask of the process allows to.
   integer(c_int), parameter :: everybody = 511_c_int
   !> No room, on the disk or within a quota, or a file larger than is allowed (`ENOSPC`, `EDQUOT`, `EFBIG`).
   integer(c_int), parameter :: errors_of_room(3) = [28_c_int, 122_c_int, 27_c_int]

   !> Count from the beginning of the file (`SEEK_SET`).
   integer(c_int), parameter :: from_beginning = 0_c_int

   interface
      !> Make a folder.
      function c_mkdir(path, mode) bind(c, name='mkdir') result(status)
         import :: c_char, c_int
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: path(*)
         !> Who may use it.
         integer(c_int), value :: mode
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_mkdir

      !> Make and open a file of a new name.
      function c_mkstemp(path) bind(c, name='mkstemp') result(descriptor)
         import :: c_char, c_int
         !> Null-terminated path that ends in six X, which become the new name.
         character(kind=c_char), intent(inout) :: path(*)
         !> Open file descriptor, or -1 on failure.
         integer(c_int) :: descriptor
      end function c_mkstemp

      !> Close a file descriptor.
      function c_close(descriptor) bind(c, name='close') result(status)
         import :: c_int
         !> Open file descriptor.
         integer(c_int), value :: descriptor
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_close

      !> Take room on the disk for an open file.
      function c_fallocate(descriptor, mode, offset, bytes) bind(c, name='fallocate') result(status)
         import :: c_int, c_int64_t
         !> Open file descriptor.
         integer(c_int), value :: descriptor
         !> 0: the file grows.
         integer(c_int), value :: mode
         !> Where the room begins, and how much it is.
         integer(c_int64_t), value :: offset, bytes
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_fallocate

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

      !> Go to a place of a stream.
      function c_fseek(stream, offset, from) bind(c, name='fseek') result(failed)
         import :: c_int, c_long, c_ptr
         !> The stream.
         type(c_ptr), value :: stream
         !> Where to.
         integer(c_long), value :: offset
         !> From where.
         integer(c_int), value :: from
         !> 0, or -1 on failure.
         integer(c_int) :: failed
      end function c_fseek

      !> Where a link leads.
      function c_readlink(path, target, length) bind(c, name='readlink') result(bytes)
         import :: c_char, c_size_t
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: path(*)
         !> What it leads to, not null-terminated.
         character(kind=c_char), intent(out) :: target(*)
         !> Room in `target`.
         integer(c_size_t), value :: length
         !> Bytes of the target, or -1 (as a signed number) if it is no link.
         integer(c_size_t) :: bytes
      end function c_readlink

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

   !> Make a folder, if that can be done.
   subroutine make_folder(path)
      !> Path of the folder.
      character(len=*), intent(in) :: path

      integer(c_int) :: status

      if (len(path) > 0) status = c_mkdir(c_string(path), everybody)
   end subroutine make_folder

   !> Whether a path is a link, wherever it leads.
   function is_link(path)
      !> The path.
      character(len=*), intent(in) :: path
      !> It is.
      logical :: is_link

      character(kind=c_char) :: target(1)

      is_link = c_readlink(c_string(path), target, 1_c_size_t) >= 0_c_size_t
   end function is_link

   !> Whether a file can be opened for writing, at any place of it: a pipe cannot.
   subroutine check_writable(path, error)
      !> Path of the file, which exists.
      character(len=*), intent(in) :: path
      !> Set if it cannot.
      type(error_type), allocatable, intent(out) :: error

      type(c_ptr) :: stream
      integer(c_int) :: status

      stream = c_fopen(c_string(path), c_string('r+'))
      if (c_associated(stream)) then
         if (c_fseek(stream, 0_c_long, from_beginning) /= 0) then
            call fatal_error(error, "cannot write to '"//path//"': "//failure_reason(errno()))
         end if
         status = c_fclose(stream)
      else
         call fatal_error(error, "cannot write to '"//path//"': "//failure_reason(errno()))
      end if
   end subroutine check_writable

   !> Whether there is room for a new file, by taking the room and giving it back. Where the system cannot tell, there is.
   subroutine check_room(path, bytes, error)
      !> Path of the new file; another name beside it is in use for a moment.
      character(len=*), intent(in) :: path
      !> Room that is needed [bytes].
      integer(i8), intent(in) :: bytes
      !> Set if there is no room.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: ending = '.XXXXXX'
      character(kind=c_char) :: name(len(path) + len(ending) + 1)
      integer(c_int) :: descriptor, status, reason

      if (bytes <= 0_i8) return
      name = c_string(path//ending)
      descriptor = c_mkstemp(name)
      if (descriptor < 0) then
         call fatal_error(error, failure_reason(errno()))
         return
      end if
      ! Without its name the file goes with its descriptor, however the program ends.
      status = c_unlink(name)
      reason = 0_c_int
      if (c_fallocate(descriptor, 0_c_int, 0_c_int64_t, int(bytes, c_int64_t)) /= 0) reason = errno()
      status = c_close(descriptor)
      if (any(reason == errors_of_room)) call fatal_error(error, failure_reason(reason))
   end subroutine check_room

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
