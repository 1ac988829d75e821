!> Decides whether an existing result file belongs to this deck and this program.
module spurflex_io_results_check
   use hdf5, only: H5F_ACC_RDONLY_F, h5fclose_f, h5fis_hdf5_f, h5fopen_f, h5gclose_f, h5gopen_f, hid_t
   use spurflex_base_error, only: error_type, exit_mismatch, fatal_error
   use spurflex_io_build, only: version
   use spurflex_io_case, only: case_type
   use spurflex_io_deck_difference, only: deck_difference
   use spurflex_io_hdf5, only: check
   use spurflex_io_hdf5_text, only: read_text
   use spurflex_io_results_check_axes, only: check_axes
   use spurflex_io_results_create, only: deck_name, part_ending, provenance_group, version_name
   implicit none
   private

   public :: check_file, check_part

   !> What to do about a file that does not fit.
   character(len=*), parameter :: advice = new_line('a')//'Remove the file, or name another one in the deck.'

contains

   !> Check a file that nobody has open for writing.
   subroutine check_file(path, case, error)
      !> Path of the file, which exists.
      character(len=*), intent(in) :: path
      !> What is to be computed.
      type(case_type), intent(in) :: case
      !> Set with `exit_mismatch` and what differs if the file does not belong to the case.
      type(error_type), allocatable, intent(out) :: error

      type(error_type), allocatable :: read_error, axes_error
      character(len=:), allocatable :: deck, file_version
      integer(hid_t) :: file
      logical :: is_hdf5, exists
      integer :: ierr

      inquire (file=path, exist=exists)
      if (.not. exists) then
         call fatal_error(error, "the result file '"//path//"' does not exist", exit_mismatch)
         return
      end if
      call h5fis_hdf5_f(path, is_hdf5, ierr)
      if (ierr < 0 .or. .not. is_hdf5) then
         call fatal_error(error, "'"//path//"' is not an HDF5 file."//advice, exit_mismatch)
         return
      end if
      call h5fopen_f(path, H5F_ACC_RDONLY_F, file, ierr)
      if (ierr < 0) then
         call fatal_error(error, "the result file '"//path//"' is truncated or damaged, or another program has it " &
            //'open.'//advice, exit_mismatch)
         return
      end if
      call read_identity(file, deck, file_version, read_error)
      call check_axes(file, case, axes_error)
      call h5fclose_f(file, ierr)
      if (allocated(read_error)) then
         call fatal_error(error, "'"//path//"' is not a result file of spurflex ("//read_error%message//').'//advice, &
            exit_mismatch)
      else if (file_version /= version) then
         call fatal_error(error, "the result file '"//path//"' was computed by spurflex "//file_version//', this is ' &
            //version//'.'//advice, exit_mismatch)
      else if (deck /= case%resolved .or. len(deck) /= len(case%resolved)) then
         call fatal_error(error, "the result file '"//path//"' was computed from another deck:" &
            //deck_difference(deck, case%resolved, 'file', 'deck')//advice, exit_mismatch)
      else if (allocated(axes_error)) then
         call fatal_error(error, "the result file '"//path//"' is damaged: "//axes_error%message//advice, exit_mismatch)
      end if
   end subroutine check_file

   !> What has the name under which a result file is made may be what a killed run left of one, and nothing else: how HDF5 files
   !> begin, zeros where the beginning was not yet written, or nothing at all.
   subroutine check_part(path, error)
      !> Path of the result file.
      character(len=*), intent(in) :: path
      !> Set with `exit_mismatch` if it is something else.
      type(error_type), allocatable, intent(out) :: error

      character(len=*), parameter :: signature = char(137)//'HDF'
      character(len=len(signature)) :: begin
      integer :: unit, stat, bytes
      logical :: exists

      inquire (file=path//part_ending, exist=exists)
      if (.not. exists) return
      open (newunit=unit, file=path//part_ending, action='read', status='old', access='stream', iostat=stat)
      ! What cannot be read cannot be written either, which is told better then.
      if (stat /= 0) return
      inquire (unit=unit, size=bytes)
      bytes = min(bytes, len(begin))
      read (unit, iostat=stat) begin(:bytes)
      close (unit)
      if (stat /= 0) return
      if (begin(:bytes) == signature(:bytes) .or. begin(:bytes) == repeat(achar(0), bytes)) return
      call fatal_error(error, "'"//path//part_ending//"' is needed to make the result file, but is something else; remove it", &
                       exit_mismatch)
   end subroutine check_part

   !> Read what tells whose a file is.
   subroutine read_identity(file, deck, file_version, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> Its resolved deck.
      character(len=:), allocatable, intent(out) :: deck
      !> Version of the program that made it.
      character(len=:), allocatable, intent(out) :: file_version
      !> Set if it does not tell.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: group
      integer :: ierr

      call h5gopen_f(file, provenance_group, group, ierr)
      call check(ierr, "open the group '"//provenance_group//"'", error)
      if (allocated(error)) return
      call read_text(group, deck_name, deck, error)
      if (.not. allocated(error)) call read_text(group, version_name, file_version, error)
      call h5gclose_f(group, ierr)
   end subroutine read_identity

end module spurflex_io_results_check
