!> Runs of values into and out of open HDF5 datasets, each rank for itself.
module spurflex_io_hdf5_run
   use hdf5, only: H5S_SELECT_SET_F, H5T_NATIVE_DOUBLE, H5T_NATIVE_INTEGER, h5dread_f, h5dwrite_f, h5sclose_f, &
      h5screate_simple_f, h5sselect_hyperslab_f, hid_t, hsize_t
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_io_hdf5, only: check
   implicit none
   private

   public :: run_type, select_run, end_run, write_run, read_run

   !> A contiguous run of elements, for every dataset of one shape.
   type :: run_type
      private
      !> Space of the file, shared with the owner, with the run selected.
      integer(hid_t) :: file_space
      !> Space of the values in memory.
      integer(hid_t) :: memory_space
      !> How many elements.
      integer(hsize_t) :: extents(1)
   end type run_type

   !> Write the values of a run, reals or integers.
   interface write_run
      module procedure :: write_reals
      module procedure :: write_integers
   end interface write_run

   !> Read the values of a run, reals or integers.
   interface read_run
      module procedure :: read_reals
      module procedure :: read_integers
   end interface read_run

contains

   !> Select a run.
   subroutine select_run(run, space, first, count, error)
      !> The run, to be ended.
      type(run_type), intent(out) :: run
      !> Space of the datasets; its selection changes.
      integer(hid_t), intent(in) :: space
      !> First element from 1, fastest index first, shape (dimensions).
      integer, intent(in) :: first(:)
      !> How many elements along each dimension, shape (dimensions).
      integer, intent(in) :: count(:)
      !> Set if there is no such run.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr(2)

      run%file_space = space
      run%extents = product(int(count, hsize_t))
      call h5sselect_hyperslab_f(space, H5S_SELECT_SET_F, int(first - 1, hsize_t), int(count, hsize_t), ierr(1))
      call h5screate_simple_f(1, run%extents, run%memory_space, ierr(2))
      call check(minval(ierr), 'select a run of points', error)
   end subroutine select_run

   !> End a run.
   subroutine end_run(run, error)
      !> The run.
      type(run_type), intent(in) :: run
      !> Set if it cannot be ended.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      call h5sclose_f(run%memory_space, ierr)
      call check(ierr, 'end a run of points', error)
   end subroutine end_run

   !> Write reals.
   subroutine write_reals(run, dataset, values, error)
      !> The run.
      type(run_type), intent(in) :: run
      !> Open dataset.
      integer(hid_t), intent(in) :: dataset
      !> The values, as many as the run has.
      real(wp), contiguous, intent(in) :: values(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      call h5dwrite_f(dataset, H5T_NATIVE_DOUBLE, values, run%extents, ierr, run%memory_space, run%file_space)
      call check(ierr, 'write the results', error)
   end subroutine write_reals

   !> Write integers.
   subroutine write_integers(run, dataset, values, error)
      !> The run.
      type(run_type), intent(in) :: run
      !> Open dataset.
      integer(hid_t), intent(in) :: dataset
      !> The values, as many as the run has.
      integer, contiguous, intent(in) :: values(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      call h5dwrite_f(dataset, H5T_NATIVE_INTEGER, values, run%extents, ierr, run%memory_space, run%file_space)
      call check(ierr, 'write the results', error)
   end subroutine write_integers

   !> Read reals.
   subroutine read_reals(run, dataset, values, error)
      !> The run.
      type(run_type), intent(in) :: run
      !> Open dataset.
      integer(hid_t), intent(in) :: dataset
      !> The values, as many as the run has.
      real(wp), contiguous, intent(inout) :: values(:)
      !> Set if they cannot be read.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      call h5dread_f(dataset, H5T_NATIVE_DOUBLE, values, run%extents, ierr, run%memory_space, run%file_space)
      call check(ierr, 'read the results', error)
   end subroutine read_reals

   !> Read integers.
   subroutine read_integers(run, dataset, values, error)
      !> The run.
      type(run_type), intent(in) :: run
      !> Open dataset.
      integer(hid_t), intent(in) :: dataset
      !> The values, as many as the run has.
      integer, contiguous, intent(inout) :: values(:)
      !> Set if they cannot be read.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr

      call h5dread_f(dataset, H5T_NATIVE_INTEGER, values, run%extents, ierr, run%memory_space, run%file_space)
      call check(ierr, 'read the results', error)
   end subroutine read_integers

end module spurflex_io_hdf5_run
