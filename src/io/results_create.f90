!> Makes the result file, complete but for the numbers, in one process.
module spurflex_io_results_create
   use hdf5, only: H5F_SCOPE_GLOBAL_F, H5T_NATIVE_DOUBLE, h5dclose_f, h5dopen_f, h5dwrite_f, h5fclose_f, h5fflush_f, h5gclose_f, &
      h5lcreate_hard_f, hid_t, hsize_t
   use spurflex_base_error, only: error_type, exit_mismatch, fatal_error
   use spurflex_base_kinds, only: wp
   use spurflex_external_posix, only: remove_file, rename_file, sync_file
   use spurflex_io_case, only: case_type
   use spurflex_io_hdf5, only: attach_scale, check, create_dataset, make_file, make_group, make_scale
   use spurflex_io_hdf5_text, only: write_attribute, write_text
   use spurflex_io_provenance, only: provenance_type
   use spurflex_io_record_layout, only: file_axes, file_variables, history_group, record_spectrum, window_text
   use spurflex_io_results_layout, only: axis_type, flags_of, real_value, speed_axis, stiffness_axis, variable_type, &
      width_of
   implicit none
   private

   public :: make_part, put_in_place
   public :: part_ending, provenance_group, deck_name, version_name

   !> Added to the name of the result file: the name under which it is made.
   character(len=*), parameter :: part_ending = '.part'
   !> Group that says where the file comes from.
   character(len=*), parameter :: provenance_group = 'provenance'
   !> Text in it: the resolved deck.
   character(len=*), parameter :: deck_name = 'resolved_deck'
   !> Text in it: the version of the program.
   character(len=*), parameter :: version_name = 'version'
   !> Axes that every group shows.
   character(len=*), parameter :: axes_of_grid(2) = [character(len=17) :: speed_axis, stiffness_axis]
   !> Metadata conventions that the attributes follow.
   character(len=*), parameter :: conventions = 'CF-1.10'

contains

   !> Make the file under another name and bring it to the disk, so that what has the final name is always whole.
   subroutine make_part(path, case, provenance, replace, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> What is computed.
      type(case_type), intent(in) :: case
      !> What computes it.
      type(provenance_type), intent(in) :: provenance
      !> A file of that name may exist: it is to be replaced.
      logical, intent(in) :: replace
      !> Set if the file exists or cannot be made; then nothing is left.
      type(error_type), allocatable, intent(out) :: error

      type(error_type), allocatable :: next
      logical :: exists

      inquire (file=path, exist=exists)
      if (exists .and. .not. replace) then
         call fatal_error(error, "the result file '"//path//"' exists already", exit_mismatch)
         return
      end if
      call create_file(path//part_ending, case, provenance, error)
      if (allocated(error)) return
      call sync_file(path//part_ending, error)
      if (allocated(error)) call remove_file(path//part_ending, next)
   end subroutine make_part

   !> Give the file its name, or remove it after an error.
   subroutine put_in_place(path, error)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> An error before, or set if it cannot be renamed.
      type(error_type), allocatable, intent(inout) :: error

      type(error_type), allocatable :: next

      if (.not. allocated(error)) call rename_file(path//part_ending, path, error)
      if (allocated(error)) call remove_file(path//part_ending, next)
   end subroutine put_in_place

   !> Make the file with every axis, variable and attribute, flush and close it; leave none where that fails.
   subroutine create_file(path, case, provenance, error)
      !> Path of the file; replaced if it exists.
      character(len=*), intent(in) :: path
      !> What is computed.
      type(case_type), intent(in) :: case
      !> What computes it.
      type(provenance_type), intent(in) :: provenance
      !> Set if the file cannot be made.
      type(error_type), allocatable, intent(out) :: error

      type(error_type), allocatable :: close_error, remove_error
      integer(hid_t) :: file
      integer :: ierr

      call make_file(path, file, error)
      if (allocated(error)) return
      call fill_file(file, case, provenance, error)
      if (.not. allocated(error)) then
         call h5fflush_f(file, H5F_SCOPE_GLOBAL_F, ierr)
         call check(ierr, "flush '"//path//"'", error)
      end if
      call h5fclose_f(file, ierr)
      call check(ierr, "close '"//path//"'", close_error)
      if (allocated(close_error) .and. .not. allocated(error)) call move_alloc(close_error, error)
      if (allocated(error)) call remove_file(path, remove_error)
   end subroutine create_file

   !> Write everything that a new file holds.
   subroutine fill_file(file, case, provenance, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> What is computed.
      type(case_type), intent(in) :: case
      !> What computes it.
      type(provenance_type), intent(in) :: provenance
      !> Set if the file cannot be written.
      type(error_type), allocatable, intent(out) :: error

      type(axis_type), allocatable :: axes(:)
      type(variable_type), allocatable :: variables(:)
      integer(hid_t), allocatable :: scales(:)
      integer :: i, ierr

      call write_attribute(file, 'Conventions', conventions, error)
      if (allocated(error)) return
      call write_attribute(file, 'title', trim(case%title), error)
      if (allocated(error)) return
      call write_attribute(file, 'spurflex_version', provenance%version, error)
      if (allocated(error)) return
      call write_provenance(file, case%resolved, provenance, error)
      if (allocated(error)) return

      axes = file_axes(case)
      if (any(axes%group /= '')) then
         call create_group(file, history_group, error)
         if (allocated(error)) return
      end if
      allocate (scales(size(axes)))
      do i = 1, size(axes)
         call create_axis(file, axes(i), scales(i), error)
         if (allocated(error)) return
      end do
      allocate (variables, source=file_variables(case))
      do i = 1, size(variables)
         call create_variable(file, variables(i), axes, scales, error)
         if (allocated(error)) return
         if (variables(i)%record == record_spectrum) then
            call describe_spectrum(file, trim(variables(i)%name), 1.0_wp/real(case%output%record%spectrum_periods, wp), error)
            if (allocated(error)) return
         end if
      end do
      if (any(axes%group /= '')) then
         ! The axes of the grid can be seen in the group too.
         do i = 1, size(axes)
            if (all(axes(i)%name /= axes_of_grid)) cycle
            call h5lcreate_hard_f(file, trim(axes(i)%name), file, history_group//'/'//trim(axes(i)%name), ierr)
            call check(ierr, "show the axis '"//trim(axes(i)%name)//"' in the group '"//history_group//"'", error)
            if (allocated(error)) return
         end do
      end if
      do i = 1, size(scales)
         call h5dclose_f(scales(i), ierr)
         call check(ierr, "close the axis '"//trim(axes(i)%name)//"'", error)
      end do
   end subroutine fill_file

   !> Make an empty group.
   subroutine create_group(file, name, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> Name of the group.
      character(len=*), intent(in) :: name
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: group
      integer :: ierr

      call make_group(file, name, group, error)
      if (allocated(error)) return
      call h5gclose_f(group, ierr)
      call check(ierr, "close the group '"//name//"'", error)
   end subroutine create_group

   !> Say how a spectrum was made.
   subroutine describe_spectrum(file, name, resolution, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> Name of the variable.
      character(len=*), intent(in) :: name
      !> Distance of its lines, in multiples of the mesh frequency.
      real(wp), intent(in) :: resolution
      !> Set if it cannot be written.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: dataset
      integer :: ierr

      call h5dopen_f(file, name, dataset, ierr)
      call check(ierr, "open the variable '"//name//"'", error)
      if (allocated(error)) return
      call write_attribute(dataset, 'resolution', resolution, error)
      if (.not. allocated(error)) call write_attribute(dataset, 'window', window_text, error)
      if (allocated(error)) return
      call h5dclose_f(dataset, ierr)
      call check(ierr, "close the variable '"//name//"'", error)
   end subroutine describe_spectrum

   !> Write the group that says where the file comes from.
   subroutine write_provenance(file, resolved, provenance, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> The resolved deck.
      character(len=*), intent(in) :: resolved
      !> What computes it.
      type(provenance_type), intent(in) :: provenance
      !> Set if it cannot be written.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: group
      integer :: ierr

      call make_group(file, provenance_group, group, error)
      if (.not. allocated(error)) call write_text(group, deck_name, resolved, error)
      if (.not. allocated(error)) call write_text(group, version_name, provenance%version, error)
      if (.not. allocated(error)) call write_text(group, 'commit', provenance%commit, error)
      if (.not. allocated(error)) call write_text(group, 'compiler', provenance%compiler, error)
      if (.not. allocated(error)) call write_text(group, 'flags', provenance%flags, error)
      if (.not. allocated(error)) call write_text(group, 'mpi', provenance%mpi, error)
      if (.not. allocated(error)) call write_text(group, 'hdf5', provenance%hdf5, error)
      if (.not. allocated(error)) call write_text(group, 'date', provenance%date, error)
      if (allocated(error)) return
      call h5gclose_f(group, ierr)
      call check(ierr, "close the group '"//provenance_group//"'", error)
   end subroutine write_provenance

   !> Make an axis with its values.
   subroutine create_axis(file, axis, scale, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> The axis.
      type(axis_type), intent(in) :: axis
      !> Its open scale.
      integer(hid_t), intent(out) :: scale
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer(hsize_t) :: extents(1)
      integer :: ierr

      call create_dataset(file, trim(axis%group)//trim(axis%name), shape(axis%values), .true., scale, error)
      if (allocated(error)) return
      extents = size(axis%values, kind=hsize_t)
      call h5dwrite_f(scale, H5T_NATIVE_DOUBLE, axis%values, extents, ierr)
      call check(ierr, "write the axis '"//trim(axis%name)//"'", error)
      if (allocated(error)) return
      call make_scale(scale, trim(axis%name), error)
      if (allocated(error)) return
      call describe(scale, axis%units, axis%long_name, error)
   end subroutine create_axis

   !> Make a variable, without values.
   subroutine create_variable(file, variable, axes, scales, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> The variable.
      type(variable_type), intent(in) :: variable
      !> Axes of the file, shape (axes).
      type(axis_type), intent(in) :: axes(:)
      !> Their open scales, shape (axes).
      integer(hid_t), intent(in) :: scales(:)
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer :: chosen(count(variable%axes /= '')), extents(count(variable%axes /= ''))
      integer, allocatable :: flag_values(:)
      character(len=:), allocatable :: flag_meanings
      integer(hid_t) :: dataset
      integer :: i, ierr

      do i = 1, size(chosen)
         chosen(i) = position_of(variable%axes(i), axes)
         extents(i) = size(axes(chosen(i))%values)
      end do
      call create_dataset(file, trim(variable%name), extents, variable%kind == real_value, dataset, error, &
                          width_of(variable, extents))
      if (allocated(error)) return
      do i = 1, size(chosen)
         call attach_scale(dataset, scales(chosen(i)), i, size(chosen), error)
         if (allocated(error)) return
      end do
      call describe(dataset, variable%units, variable%long_name, error)
      if (allocated(error)) return
      call flags_of(variable%kind, flag_values, flag_meanings)
      if (size(flag_values) > 0) then
         call write_attribute(dataset, 'flag_values', flag_values, error)
         if (allocated(error)) return
         call write_attribute(dataset, 'flag_meanings', flag_meanings, error)
         if (allocated(error)) return
      end if
      call h5dclose_f(dataset, ierr)
      call check(ierr, "close the variable '"//trim(variable%name)//"'", error)
   end subroutine create_variable

   !> Write unit and description.
   subroutine describe(dataset, units, long_name, error)
      !> Open dataset.
      integer(hid_t), intent(in) :: dataset
      !> Unit.
      character(len=*), intent(in) :: units
      !> Description for people.
      character(len=*), intent(in) :: long_name
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      call write_attribute(dataset, 'units', trim(units), error)
      if (allocated(error)) return
      call write_attribute(dataset, 'long_name', trim(long_name), error)
   end subroutine describe

   !> Where an axis is among the axes of the file.
   pure function position_of(name, axes) result(position)
      !> Name of the axis, which must be there.
      character(len=*), intent(in) :: name
      !> Axes of the file, shape (axes).
      type(axis_type), intent(in) :: axes(:)
      !> Its position.
      integer :: position

      do position = 1, size(axes)
         if (axes(position)%name == name) return
      end do
   end function position_of

end module spurflex_io_results_create
