!> Thin typed wrappers over the HDF5 library: the library itself, datasets and dimension scales.
!> Every status of the library is checked and becomes an `error_type`.
module spurflex_io_hdf5
   use h5ds, only: h5dsattach_scale_f, h5dsset_scale_f
   use hdf5, only: H5D_ALLOC_TIME_EARLY_F, H5D_CONTIGUOUS_F, H5D_FILL_TIME_ALLOC_F, H5F_ACC_TRUNC_F, H5F_LIBVER_V110_F, &
      H5P_DATASET_CREATE_F, H5P_FILE_ACCESS_F, H5P_FILE_CREATE_F, H5P_GROUP_CREATE_F, H5T_IEEE_F64LE, &
      H5T_NATIVE_DOUBLE, H5T_NATIVE_INTEGER, H5T_STD_I32LE, h5dcreate_f, h5eset_auto_f, h5fcreate_f, h5gcreate_f, h5open_f, &
      h5pclose_f, h5pcreate_f, h5pset_alloc_time_f, h5pset_chunk_f, h5pset_fill_time_f, h5pset_fill_value_f, h5pset_layout_f, &
      h5pset_libver_bounds_f, h5pset_obj_track_times_f, h5sclose_f, h5screate_simple_f, hid_t, hsize_t
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_measure_response, only: nan
   implicit none
   private

   public :: start_hdf5, check
   public :: make_file, make_group, create_dataset, make_scale, attach_scale

contains

   !> Make the library ready and keep it from printing. It closes itself when MPI ends.
   subroutine start_hdf5(error)
      !> Set if the library cannot be started.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: silent = 0
      integer :: ierr

      call h5open_f(ierr)
      call check(ierr, 'start', error)
      if (allocated(error)) return
      call h5eset_auto_f(silent, ierr)
      call check(ierr, 'silence its messages', error)
   end subroutine start_hdf5

   !> Turn a status of the library into an error.
   pure subroutine check(ierr, doing, error)
      !> Status of the library, negative on failure.
      integer, intent(in) :: ierr
      !> What was being done, to follow 'HDF5 cannot'.
      character(len=*), intent(in) :: doing
      !> Set on failure; an error that is set already stays.
      type(error_type), allocatable, intent(inout) :: error

      if (ierr >= 0 .or. allocated(error)) return
      call fatal_error(error, 'HDF5 cannot '//doing)
   end subroutine check

   !> Make a file in the format of HDF5 1.10: what the library keeps in it for itself has checksums, and where the columns of a
   !> dataset are follows from one number. Nothing in it tells when it was made.
   subroutine make_file(path, file, error)
      !> Path of the file; replaced if it exists.
      character(len=*), intent(in) :: path
      !> The open file.
      integer(hid_t), intent(out) :: file
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: creation, access
      integer :: ierr(7)

      call h5pcreate_f(H5P_FILE_CREATE_F, creation, ierr(1))
      call h5pset_obj_track_times_f(creation, .false., ierr(2))
      call h5pcreate_f(H5P_FILE_ACCESS_F, access, ierr(3))
      call h5pset_libver_bounds_f(access, H5F_LIBVER_V110_F, H5F_LIBVER_V110_F, ierr(4))
      call h5fcreate_f(path, H5F_ACC_TRUNC_F, file, ierr(5), creation_prp=creation, access_prp=access)
      call h5pclose_f(creation, ierr(6))
      call h5pclose_f(access, ierr(7))
      call check(minval(ierr), "make the file '"//path//"'", error)
   end subroutine make_file

   !> Make an empty group.
   subroutine make_group(parent, name, group, error)
      !> File or group.
      integer(hid_t), intent(in) :: parent
      !> Name of the group.
      character(len=*), intent(in) :: name
      !> The open group.
      integer(hid_t), intent(out) :: group
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: properties
      integer :: ierr(4)

      call h5pcreate_f(H5P_GROUP_CREATE_F, properties, ierr(1))
      call h5pset_obj_track_times_f(properties, .false., ierr(2))
      call h5gcreate_f(parent, name, group, ierr(3), gcpl_id=properties)
      call h5pclose_f(properties, ierr(4))
      call check(minval(ierr), "make the group '"//name//"'", error)
   end subroutine make_group

   !> Make a dataset whose whole extent is on the disk at once: reals filled with NaN, integers with 0.
   subroutine create_dataset(parent, name, extents, real_values, dataset, error, width)
      !> File or group.
      integer(hid_t), intent(in) :: parent
      !> Name of the dataset.
      character(len=*), intent(in) :: name
      !> Extents, fastest first.
      integer, intent(in) :: extents(:)
      !> It holds reals, not integers.
      logical, intent(in) :: real_values
      !> The open dataset.
      integer(hid_t), intent(out) :: dataset
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error
      !> Stored in columns of so many elements of the first dimension and all of the others; in one piece if absent or as wide as
      !> the dataset.
      integer, intent(in), optional :: width

      integer(hid_t) :: properties, space, file_type
      integer :: column, ierr(8)

      call h5pcreate_f(H5P_DATASET_CREATE_F, properties, ierr(1))
      column = extents(1)
      if (present(width)) column = width
      if (column < extents(1)) then
         call h5pset_chunk_f(properties, size(extents), int([column, extents(2:)], hsize_t), ierr(2))
      else
         call h5pset_layout_f(properties, H5D_CONTIGUOUS_F, ierr(2))
      end if
      call h5pset_alloc_time_f(properties, H5D_ALLOC_TIME_EARLY_F, ierr(3))
      call h5pset_fill_time_f(properties, H5D_FILL_TIME_ALLOC_F, ierr(4))
      call h5pset_obj_track_times_f(properties, .false., ierr(5))
      if (real_values) then
         file_type = H5T_IEEE_F64LE
         call h5pset_fill_value_f(properties, H5T_NATIVE_DOUBLE, nan(), ierr(6))
      else
         file_type = H5T_STD_I32LE
         call h5pset_fill_value_f(properties, H5T_NATIVE_INTEGER, 0, ierr(6))
      end if
      call h5screate_simple_f(size(extents), int(extents, hsize_t), space, ierr(7))
      call h5dcreate_f(parent, name, file_type, space, dataset, ierr(8), dcpl_id=properties)
      call check(minval(ierr), "make the dataset '"//name//"'", error)
      if (allocated(error)) return
      call h5pclose_f(properties, ierr(1))
      call h5sclose_f(space, ierr(2))
      call check(minval(ierr(:2)), "finish the dataset '"//name//"'", error)
   end subroutine create_dataset

   !> Make a dataset the scale of a dimension.
   subroutine make_scale(dataset, name, error)
      !> The dataset, of one dimension.
      integer(hid_t), intent(in) :: dataset
      !> Name of the dimension.
      character(len=*), intent(in) :: name
      !> Set if it cannot be done.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      call h5dsset_scale_f(dataset, ierr, name)
      call check(ierr, "make the dimension '"//name//"'", error)
   end subroutine make_scale

   !> Attach a scale to a dimension of a dataset.
   subroutine attach_scale(dataset, scale, dimension, dimensions, error)
      !> The dataset.
      integer(hid_t), intent(in) :: dataset
      !> The scale.
      integer(hid_t), intent(in) :: scale
      !> Which dimension in Fortran's order: 1 is the fastest.
      integer, intent(in) :: dimension
      !> How many dimensions the dataset has.
      integer, intent(in) :: dimensions
      !> Set if it cannot be done.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      ! The library counts from 1 in C's order, even here; the wrong order would give a transposed file.
      call h5dsattach_scale_f(dataset, scale, dimensions - dimension + 1, ierr)
      call check(ierr, 'attach a dimension scale', error)
   end subroutine attach_scale

end module spurflex_io_hdf5
