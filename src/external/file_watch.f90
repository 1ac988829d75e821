!> Keeps an eye on a file that is being written: notices if somebody removes or replaces it, and can then save what it held.
!>
!> A file that has lost its name lives on as long as it is open; what is written to it goes with the last who closes it.
module spurflex_external_file_watch
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_int64_t, c_loc, c_long, c_null_ptr, c_ptr, c_size_t
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_text, only: to_text
   use spurflex_external_posix, only: c_fclose, c_fileno, c_fopen, c_fseek, c_string, errno, failure_reason, &
      from_beginning, make_folder, sync_file
   implicit none
   private

   public :: file_watch, watch_file, save_contents, end_watch

   !> Relative to the working folder (`AT_FDCWD`).
   integer(c_int), parameter :: working_folder = -100_c_int
   !> The descriptor itself is meant, not a path under it (`AT_EMPTY_PATH`).
   integer(c_int), parameter :: itself = 4096_c_int
   !> Ask for the number of the file (`STATX_INO`).
   integer(c_int), parameter :: want_number = 256_c_int
   !> `struct statx` in words of eight bytes, and where in it the number of the file and its device are.
   integer, parameter :: status_words = 32, number_word = 5, device_word = 18
   !> There is no such file, or no such folder (`ENOENT`, `ENOTDIR`).
   integer(c_int), parameter :: error_no_file = 2_c_int, error_no_folder = 20_c_int
   !> There is a file of that name (`EEXIST`).
   integer(c_int), parameter :: error_exists = 17_c_int
   !> How many names are tried for a copy.
   integer, parameter :: most_attempts = 100
   !> Bytes copied at once.
   integer, parameter :: buffer_bytes = 1048576

   !> A file that is watched.
   type :: file_watch
      private
      !> Its path.
      character(len=:), allocatable :: path
      !> Open stream on it; null while nothing is watched.
      type(c_ptr) :: stream = c_null_ptr
   contains
      !> Whether the path still leads to the file.
      procedure :: in_place
   end type file_watch

   interface
      !> What is known of a file; the layout is the same on every processor.
      function c_statx(folder, path, flags, wanted, status) bind(c, name='statx') result(failed)
         import :: c_char, c_int, c_int64_t
         !> Descriptor that the path starts from.
         integer(c_int), value :: folder
         !> Null-terminated path.
         character(kind=c_char), intent(in) :: path(*)
         !> How to look, and what is wanted.
         integer(c_int), value :: flags, wanted
         !> What is known.
         integer(c_int64_t), intent(out) :: status(*)
         !> 0, or -1 on failure.
         integer(c_int) :: failed
      end function c_statx

      !> Read from a stream.
      function c_fread(buffer, bytes, count, stream) bind(c, name='fread') result(done)
         import :: c_ptr, c_size_t
         !> Room for what is read.
         type(c_ptr), value :: buffer
         !> Bytes of an item, and number of items.
         integer(c_size_t), value :: bytes, count
         !> The stream.
         type(c_ptr), value :: stream
         !> Items read.
         integer(c_size_t) :: done
      end function c_fread

      !> Write to a stream.
      function c_fwrite(buffer, bytes, count, stream) bind(c, name='fwrite') result(done)
         import :: c_ptr, c_size_t
         !> What is written.
         type(c_ptr), value :: buffer
         !> Bytes of an item, and number of items.
         integer(c_size_t), value :: bytes, count
         !> The stream.
         type(c_ptr), value :: stream
         !> Items written.
         integer(c_size_t) :: done
      end function c_fwrite
   end interface

contains

   !> Watch a file from now on.
   subroutine watch_file(watch, path, error)
      !> The watch.
      type(file_watch), intent(inout) :: watch
      !> Path of the file, which exists.
      character(len=*), intent(in) :: path
      !> Set if the file cannot be opened.
      type(error_type), allocatable, intent(out) :: error

      watch%path = path
      watch%stream = c_fopen(c_string(path), c_string('r'))
      if (.not. c_associated(watch%stream)) then
         call fatal_error(error, "cannot read '"//path//"': "//failure_reason(errno()))
      end if
   end subroutine watch_file

   !> Whether the path still leads to the file. In doubt it does: only what is sure to be gone or another file counts.
   function in_place(self) result(is_there)
      !> The watch; without a file nothing is missed.
      class(file_watch), intent(in) :: self
      !> It does.
      logical :: is_there

      integer(c_int64_t) :: mine(status_words), found(status_words)
      integer(c_int) :: reason

      is_there = .true.
      if (.not. c_associated(self%stream)) return
      if (c_statx(c_fileno(self%stream), c_string(''), itself, want_number, mine) /= 0) return
      if (c_statx(working_folder, c_string(self%path), 0_c_int, want_number, found) == 0) then
         is_there = mine(number_word) == found(number_word) .and. mine(device_word) == found(device_word)
      else
         reason = errno()
         is_there = reason /= error_no_file .and. reason /= error_no_folder
      end if
   end function in_place

   !> Copy what the file holds to another path; its folder is made again if that is gone too.
   subroutine save_contents(watch, path, saved, error)
      !> The watch.
      type(file_watch), intent(in) :: watch
      !> Where to; a number is added as long as there is a file of that name.
      character(len=*), intent(in) :: path
      !> Where it went.
      character(len=:), allocatable, intent(out) :: saved
      !> Set if the contents cannot be saved.
      type(error_type), allocatable, intent(out) :: error

      character(kind=c_char), allocatable, target :: buffer(:)
      type(c_ptr) :: copy
      integer(c_size_t) :: bytes
      integer(c_int) :: status
      integer :: attempt

      saved = path
      do attempt = 1, most_attempts
         if (attempt > 1) saved = path//'.'//to_text(attempt)
         copy = c_fopen(c_string(saved), c_string('wx'))
         if (c_associated(copy)) exit
         if (errno() == error_no_file) then
            call make_folder(path(:index(path, '/', back=.true.)))
            copy = c_fopen(c_string(saved), c_string('wx'))
            exit
         end if
         if (errno() /= error_exists) exit
      end do
      if (.not. c_associated(copy)) then
         call fatal_error(error, "cannot make '"//saved//"': "//failure_reason(errno()))
         return
      end if
      allocate (buffer(buffer_bytes))
      status = c_fseek(watch%stream, 0_c_long, from_beginning)
      do while (status == 0)
         bytes = c_fread(c_loc(buffer), 1_c_size_t, int(buffer_bytes, c_size_t), watch%stream)
         if (bytes == 0) exit
         if (c_fwrite(c_loc(buffer), 1_c_size_t, bytes, copy) /= bytes) status = 1
      end do
      if (c_fclose(copy) /= 0) status = 1
      if (status /= 0) then
         call fatal_error(error, "cannot write '"//saved//"': "//failure_reason(errno()))
         return
      end if
      call sync_file(saved, error)
   end subroutine save_contents

   !> Stop watching.
   subroutine end_watch(watch)
      !> The watch; may have no file.
      type(file_watch), intent(inout) :: watch

      integer(c_int) :: status

      if (c_associated(watch%stream)) status = c_fclose(watch%stream)
      watch%stream = c_null_ptr
   end subroutine end_watch

end module spurflex_external_file_watch
