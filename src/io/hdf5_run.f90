!> Blocks of values into and out of open HDF5 datasets, each rank for itself.
!>
!> A dataset may be stored in columns: the whole block of some neighbouring elements of the first dimension, column after
!> column. What lies in one column is moved in one piece if it has the width of the column; so a block is cut into those of each
!> column. Of other datasets it is a block too, only slower.
module spurflex_io_hdf5_run
   use hdf5, only: H5S_SELECT_SET_F, H5T_NATIVE_DOUBLE, H5T_NATIVE_INTEGER, h5dread_f, h5dwrite_f, h5sclose_f, &
      h5screate_simple_f, h5sselect_hyperslab_f, hid_t, hsize_t
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_io_hdf5, only: check
   implicit none
   private

   public :: run_type, select_run, end_run, write_run, read_run

   !> What of a run is moved at once.
   type :: piece_type
      !> First element from 0 in the file and in the run, and extents, fastest index first, shape (dimensions).
      integer(hsize_t), allocatable :: first(:), place(:), extents(:)
   end type piece_type

   !> A block of elements, for every dataset of one shape.
   type :: run_type
      private
      !> Space of the file, shared with the owner, and of the values in memory, both with a piece selected. They have the same
      !> dimensions: the library compares other shapes element by element.
      integer(hid_t) :: file_space, memory_space
      !> Extents, fastest index first, shape (dimensions).
      integer(hsize_t), allocatable :: extents(:)
      !> The pieces, side by side along the first dimension.
      type(piece_type), allocatable :: pieces(:)
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
   subroutine select_run(run, space, first, count, width, error)
      !> The run, to be ended.
      type(run_type), intent(out) :: run
      !> Space of the datasets; its selection changes.
      integer(hid_t), intent(in) :: space
      !> First element from 1, fastest index first, shape (dimensions).
      integer, intent(in) :: first(:)
      !> How many elements along each dimension, shape (dimensions).
      integer, intent(in) :: count(:)
      !> Width of the columns in which the datasets are stored.
      integer, intent(in) :: width
      !> Set if there is no such run.
      type(error_type), allocatable, intent(out) :: error

      integer :: i, begin, end, ierr

      run%file_space = space
      run%extents = int(count, hsize_t)
      call h5screate_simple_f(size(count), run%extents, run%memory_space, ierr)
      call check(ierr, 'select a run of points', error)
      if (allocated(error)) return
      associate (before => (first(1) - 1)/width)
         allocate (run%pieces((first(1) + count(1) - 2)/width - before + 1))
         do i = 1, size(run%pieces)
            associate (piece => run%pieces(i))
               ! Of the first dimension, as counted in the run.
               begin = max(1, (before + i - 1)*width - first(1) + 2)
               end = count(1)
               if (i < size(run%pieces)) end = (before + i)*width - first(1) + 1
               piece%place = spread(0_hsize_t, 1, size(count))
               piece%place(1) = begin - 1
               piece%first = int(first - 1, hsize_t) + piece%place
               piece%extents = run%extents
               piece%extents(1) = end - begin + 1
            end associate
         end do
      end associate
      call select_piece(run, 1, error)
   end subroutine select_run

   !> Select a piece of a run.
   subroutine select_piece(run, number, error)
      !> The run.
      type(run_type), intent(in) :: run
      !> Which piece.
      integer, intent(in) :: number
      !> Set if there is no such piece.
      type(error_type), allocatable, intent(inout) :: error

      integer :: ierr(2)

      associate (piece => run%pieces(number))
         call h5sselect_hyperslab_f(run%file_space, H5S_SELECT_SET_F, piece%first, piece%extents, ierr(1))
         call h5sselect_hyperslab_f(run%memory_space, H5S_SELECT_SET_F, piece%place, piece%extents, ierr(2))
      end associate
      call check(minval(ierr), 'select a run of points', error)
   end subroutine select_piece

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

      integer :: i, ierr

      do i = 1, size(run%pieces)
         if (size(run%pieces) > 1) call select_piece(run, i, error)
         if (allocated(error)) return
         call h5dwrite_f(dataset, H5T_NATIVE_DOUBLE, values, run%extents, ierr, run%memory_space, run%file_space)
         call check(ierr, 'write the results', error)
         if (allocated(error)) return
      end do
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

      integer :: i, ierr

      do i = 1, size(run%pieces)
         if (size(run%pieces) > 1) call select_piece(run, i, error)
         if (allocated(error)) return
         call h5dwrite_f(dataset, H5T_NATIVE_INTEGER, values, run%extents, ierr, run%memory_space, run%file_space)
         call check(ierr, 'write the results', error)
         if (allocated(error)) return
      end do
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

      integer :: i, ierr

      do i = 1, size(run%pieces)
         if (size(run%pieces) > 1) call select_piece(run, i, error)
         if (allocated(error)) return
         call h5dread_f(dataset, H5T_NATIVE_DOUBLE, values, run%extents, ierr, run%memory_space, run%file_space)
         call check(ierr, 'read the results', error)
         if (allocated(error)) return
      end do
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

      integer :: i, ierr

      do i = 1, size(run%pieces)
         if (size(run%pieces) > 1) call select_piece(run, i, error)
         if (allocated(error)) return
         call h5dread_f(dataset, H5T_NATIVE_INTEGER, values, run%extents, ierr, run%memory_space, run%file_space)
         call check(ierr, 'read the results', error)
         if (allocated(error)) return
      end do
   end subroutine read_integers

end module spurflex_io_hdf5_run
