!> Where a result file comes from: the program, its build and its libraries.
module spurflex_io_provenance
   use hdf5, only: h5get_libversion_f
   use mpi_f08, only: mpi_get_library_version, MPI_MAX_LIBRARY_VERSION_STRING, MPI_SUCCESS
   use spurflex_base_error, only: error_type, fatal_error, exit_deck
   use spurflex_base_kinds, only: i8
   use spurflex_base_text, only: to_text
   use spurflex_io_build, only: version, commit, compiler, compile_flags
   implicit none
   private

   public :: provenance_type, collect_provenance, version_text, iso_date

   !> Environment variable that replaces the date, as in reproducible builds: seconds since 1970 in UTC.
   character(len=*), parameter :: date_variable = 'SOURCE_DATE_EPOCH'
   integer(i8), parameter :: seconds_per_minute = 60_i8, seconds_per_hour = 3600_i8, seconds_per_day = 86400_i8

   !> Everything that /provenance holds beside the resolved deck.
   !> Nothing but the date depends on the run, so that files can be compared byte for byte.
   type :: provenance_type
      !> Version of spurflex.
      character(len=:), allocatable :: version
      !> Commit of the sources.
      character(len=:), allocatable :: commit
      !> Compiler and its version.
      character(len=:), allocatable :: compiler
      !> Compiler options.
      character(len=:), allocatable :: flags
      !> MPI library and its version.
      character(len=:), allocatable :: mpi
      !> Version of the HDF5 library.
      character(len=:), allocatable :: hdf5
      !> When the file was made, ISO 8601 in UTC.
      character(len=:), allocatable :: date
   end type provenance_type

contains

   !> Collect what is known about this program.
   subroutine collect_provenance(provenance, error)
      !> The record.
      type(provenance_type), intent(out) :: provenance
      !> Set if a library does not tell its version, or the replaced date is not a number.
      type(error_type), allocatable, intent(out) :: error

      character(len=MPI_MAX_LIBRARY_VERSION_STRING) :: mpi_version
      integer(i8) :: now
      integer :: length, major, minor, patch, ierr

      provenance%version = version
      provenance%commit = commit
      provenance%compiler = compiler
      provenance%flags = compile_flags
      call mpi_get_library_version(mpi_version, length, ierr)
      if (ierr /= MPI_SUCCESS) then
         call fatal_error(error, 'the MPI library does not tell its version')
         return
      end if
      provenance%mpi = first_line(mpi_version(:length))
      call h5get_libversion_f(major, minor, patch, ierr)
      if (ierr < 0) then
         call fatal_error(error, 'the HDF5 library does not tell its version')
         return
      end if
      provenance%hdf5 = to_text(major)//'.'//to_text(minor)//'.'//to_text(patch)
      call current_time(now, error)
      if (allocated(error)) return
      provenance%date = iso_date(now)
   end subroutine collect_provenance

   !> Name, version, commit and compiler in a line.
   pure function version_text() result(text)
      !> The line.
      character(len=:), allocatable :: text

      text = 'spurflex '//version//' ('//commit//'), '//compiler
   end function version_text

   !> The time now, unless the environment replaces it.
   subroutine current_time(seconds, error)
      !> Seconds since 1970-01-01 in UTC.
      integer(i8), intent(out) :: seconds
      !> Set if the environment variable is not a number.
      type(error_type), allocatable, intent(out) :: error

      character(len=32) :: text
      integer :: values(8), stat

      call get_environment_variable(date_variable, text, status=stat)
      if (stat == 0 .and. len_trim(text) > 0) then
         if (verify(trim(text), '0123456789') == 0) then
            read (text, *, iostat=stat) seconds
         else
            stat = 1
         end if
         if (stat /= 0) then
            seconds = 0_i8
            call fatal_error(error, date_variable//" = '"//trim(text)//"' is not a number of seconds", exit_deck)
         end if
         return
      end if
      call date_and_time(values=values)
      seconds = days_since_1970(values(1), values(2), values(3))*seconds_per_day &
         + int(values(5), i8)*seconds_per_hour + int(values(6) - values(4), i8)*seconds_per_minute + int(values(7), i8)
   end subroutine current_time

   !> Days since 1970-01-01 in the Gregorian calendar (years from March, eras of 400 years).
   pure function days_since_1970(year, month, day) result(days)
      !> Year, from 1970.
      integer, intent(in) :: year
      !> Month, 1 to 12.
      integer, intent(in) :: month
      !> Day of the month.
      integer, intent(in) :: day
      !> Days.
      integer(i8) :: days

      integer(i8), parameter :: days_to_1970 = 719468_i8
      integer(i8) :: y, m

      y = int(year, i8)
      if (month <= 2) y = y - 1_i8
      m = int(modulo(month + 9, 12), i8)
      days = 365_i8*y + y/4_i8 - y/100_i8 + y/400_i8 + (153_i8*m + 2_i8)/5_i8 + int(day, i8) - 1_i8 - days_to_1970
   end function days_since_1970

   !> Date and time as ISO 8601.
   pure function iso_date(seconds) result(text)
      !> Seconds since 1970-01-01 in UTC, not negative.
      integer(i8), intent(in) :: seconds
      !> Text such as `2024-02-29T12:00:00Z`.
      character(len=:), allocatable :: text

      character(len=20) :: buffer
      integer :: year, month
      integer(i8) :: day, rest

      day = seconds/seconds_per_day
      rest = mod(seconds, seconds_per_day)
      year = 1970 + int(day/366_i8)
      do while (days_since_1970(year + 1, 1, 1) <= day)
         year = year + 1
      end do
      month = 12
      do while (days_since_1970(year, month, 1) > day)
         month = month - 1
      end do
      day = day - days_since_1970(year, month, 1) + 1_i8
      write (buffer, '(i4.4, 2("-", i2.2), "T", 2(i2.2, ":"), i2.2, "Z")') year, month, day, &
         rest/seconds_per_hour, mod(rest, seconds_per_hour)/seconds_per_minute, mod(rest, seconds_per_minute)
      text = buffer
   end function iso_date

   !> The first line of a text without trailing blanks and nulls.
   pure function first_line(text) result(line)
      !> The text.
      character(len=*), intent(in) :: text
      !> Its first line.
      character(len=:), allocatable :: line

      integer :: mark

      mark = scan(text, achar(0)//achar(10)//achar(13))
      if (mark == 0) mark = len(text) + 1
      line = trim(text(:mark - 1))
   end function first_line

end module spurflex_io_provenance
