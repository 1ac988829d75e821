!> A lock file held by one process, so that two runs never write one result file.
module spurflex_external_file_lock
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_long, c_null_ptr, c_ptr, c_size_t
   use spurflex_base_error, only: error_type, fatal_error, exit_mismatch
   use spurflex_base_text, only: to_text
   use spurflex_external_posix, only: c_fclose, c_fileno, c_fopen, c_string, errno, failure_reason, remove_file
   implicit none
   private

   public :: file_lock, acquire_lock, release_lock

   !> Ask for the lock of one holder only, and do not wait for it (`LOCK_EX + LOCK_NB`).
   integer(c_int), parameter :: exclusive_at_once = 6_c_int
   !> Somebody else has the lock (`EWOULDBLOCK` on Linux).
   integer(c_int), parameter :: error_would_block = 11_c_int
   !> How often a lock file that vanishes while it is being locked is tried again.
   integer, parameter :: most_attempts = 10
   !> How the line that names a holder begins.
   character(len=*), parameter :: holder_word = 'process '
   !> Longest line that names a holder.
   integer, parameter :: holder_length = 256

   !> A held lock; it goes with the process, however that ends.
   type :: file_lock
      private
      !> Path of the lock file.
      character(len=:), allocatable :: path
      !> Open stream on the lock file, which carries the lock; null where none is held.
      type(c_ptr) :: stream = c_null_ptr
   end type file_lock

   interface
      !> Lock an open file.
      function c_flock(descriptor, operation) bind(c, name='flock') result(status)
         import :: c_int
         !> Open file descriptor.
         integer(c_int), value :: descriptor
         !> What to do.
         integer(c_int), value :: operation
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_flock

      !> Cut an open file to a length.
      function c_ftruncate(descriptor, length) bind(c, name='ftruncate') result(status)
         import :: c_int, c_long
         !> Open file descriptor.
         integer(c_int), value :: descriptor
         !> New length in bytes.
         integer(c_long), value :: length
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_ftruncate

      !> Write text to a stream.
      function c_fputs(text, stream) bind(c, name='fputs') result(status)
         import :: c_char, c_int, c_ptr
         !> Null-terminated text.
         character(kind=c_char), intent(in) :: text(*)
         !> The stream.
         type(c_ptr), value :: stream
         !> Negative on failure.
         integer(c_int) :: status
      end function c_fputs

      !> Hand a stream's text to the system.
      function c_fflush(stream) bind(c, name='fflush') result(status)
         import :: c_int, c_ptr
         !> The stream.
         type(c_ptr), value :: stream
         !> 0, or nonzero on failure.
         integer(c_int) :: status
      end function c_fflush

      !> Number of this process.
      function c_getpid() bind(c, name='getpid') result(process)
         import :: c_int
         !> Process number.
         integer(c_int) :: process
      end function c_getpid

      !> Name of this machine.
      function c_gethostname(name, length) bind(c, name='gethostname') result(status)
         import :: c_char, c_int, c_size_t
         !> Null-terminated name.
         character(kind=c_char), intent(out) :: name(*)
         !> Room in `name`.
         integer(c_size_t), value :: length
         !> 0, or -1 on failure.
         integer(c_int) :: status
      end function c_gethostname
   end interface

contains

   !> Take the lock, or say who has it. On a file system that knows no locks, nothing is locked.
   subroutine acquire_lock(lock, path, error)
      !> The lock, held unless `error` is set.
      type(file_lock), intent(out) :: lock
      !> Path of the lock file, made if it does not exist.
      character(len=*), intent(in) :: path
      !> Set with `exit_mismatch` if another run holds the lock.
      type(error_type), allocatable, intent(out) :: error

      character(len=:), allocatable :: holder, self
      integer(c_int) :: status, reason
      integer :: attempt

      self = this_process()
      do attempt = 1, most_attempts
         lock%stream = c_fopen(c_string(path), c_string('a+'))
         if (.not. c_associated(lock%stream)) then
            call fatal_error(error, "cannot open the lock file '"//path//"': "//failure_reason(errno()))
            return
         end if
         if (c_flock(c_fileno(lock%stream), exclusive_at_once) /= 0) then
            reason = errno()
            holder = line_of(path)
            status = c_fclose(lock%stream)
            lock%stream = c_null_ptr
            if (reason == error_would_block) then
               call fatal_error(error, "another run ("//holder//") holds '"//path//"'", exit_mismatch)
            else if (holder == '') then
               ! No locks here: no lock file either.
               call remove_file(path, error)
            end if
            return
         end if
         holder = line_of(path)
         if (len(holder) > 0 .and. index(holder, holder_word) /= 1) then
            status = c_fclose(lock%stream)
            lock%stream = c_null_ptr
            call fatal_error(error, "'"//path//"' is needed for the lock, but holds something else; remove it", exit_mismatch)
            return
         end if
         call write_holder(lock%stream, self, reason)
         if (reason /= 0_c_int) then
            ! Removed while still locked, so that nobody else's file can be hit.
            call remove_file(path, error)
            status = c_fclose(lock%stream)
            lock%stream = c_null_ptr
            if (allocated(error)) deallocate (error)
            call fatal_error(error, "cannot write the lock file '"//path//"': "//failure_reason(reason))
            return
         end if
         holder = line_of(path)
         if (holder == self) then
            lock%path = path
            return
         end if
         ! The former holder removed the file between opening and locking: what is locked has no name any more.
         status = c_fclose(lock%stream)
         lock%stream = c_null_ptr
      end do
      call fatal_error(error, "cannot write the lock file '"//path//"'")
   end subroutine acquire_lock

   !> Give the lock back and remove its file; does nothing where none is held.
   subroutine release_lock(lock, error)
      !> The lock.
      type(file_lock), intent(inout) :: lock
      !> Set if the lock file cannot be removed.
      type(error_type), allocatable, intent(out) :: error

      integer(c_int) :: status

      if (.not. c_associated(lock%stream)) return
      ! Removed while still locked, so that nobody else's file can be hit.
      call remove_file(lock%path, error)
      status = c_fclose(lock%stream)
      lock%stream = c_null_ptr
      if (status /= 0 .and. .not. allocated(error)) call fatal_error(error, "cannot close '"//lock%path//"'")
   end subroutine release_lock

   !> Put a process down as the holder.
   subroutine write_holder(stream, holder, reason)
      !> Locked stream.
      type(c_ptr), intent(in) :: stream
      !> The process.
      character(len=*), intent(in) :: holder
      !> 0, or the number of the error if it cannot be written.
      integer(c_int), intent(out) :: reason

      reason = 0_c_int
      if (c_ftruncate(c_fileno(stream), 0_c_long) == 0) then
         if (c_fputs(c_string(holder//new_line('a')), stream) >= 0_c_int) then
            if (c_fflush(stream) == 0) return
         end if
      end if
      reason = errno()
   end subroutine write_holder

   !> This process in words.
   function this_process() result(text)
      !> Text such as `process 4711 on node7`.
      character(len=:), allocatable :: text

      character(kind=c_char) :: name(holder_length/2)
      integer :: i

      text = holder_word//to_text(c_getpid())
      if (c_gethostname(name, int(size(name) - 1, c_size_t)) /= 0) return
      name(size(name)) = achar(0)
      text = text//' on '
      do i = 1, size(name)
         if (name(i) == achar(0)) exit
         text = text//name(i)
      end do
   end function this_process

   !> First line of a file.
   function line_of(path) result(text)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> The line, empty if there is none.
      character(len=:), allocatable :: text

      character(len=holder_length) :: line
      integer :: unit, stat

      line = ''
      open (newunit=unit, file=path, action='read', status='old', iostat=stat)
      if (stat == 0) then
         read (unit, '(a)', iostat=stat) line
         if (stat /= 0) line = ''
         close (unit)
      end if
      text = trim(line)
   end function line_of

end module spurflex_external_file_lock
