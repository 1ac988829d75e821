!> The open variables of one support: one write a variable, or one for each of its columns, the status last.
module spurflex_io_results_set
   use hdf5, only: h5dclose_f, h5dget_space_f, h5dopen_f, h5sclose_f, h5sget_simple_extent_dims_f, &
      h5sget_simple_extent_ndims_f, hid_t, hsize_t
   use spurflex_base_checksum, only: extended
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: i4, wp
   use spurflex_io_hdf5, only: check
   use spurflex_io_hdf5_run, only: end_run, read_run, run_type, select_run, write_run
   use spurflex_io_results_layout, only: checksum_quantity, get_values, real_value, set_values, variable_type, width_of
   use spurflex_measure_response, only: nan, response, status_missing
   implicit none
   private

   public :: variable_set, open_set, close_set, write_points, read_points, read_states, read_flags

   !> Open variables on the same axes.
   type :: variable_set
      !> What they are, in the order of writing, shape (variables).
      type(variable_type), allocatable :: variables(:)
      !> Their datasets, shape (variables).
      integer(hid_t), allocatable :: datasets(:)
      !> Their common space in the file; only valid where there are variables.
      integer(hid_t) :: space = -1_hid_t
      !> Their extents, fastest first, shape (dimensions).
      integer, allocatable :: extents(:)
      !> How many elements of the first dimension they have side by side in the file; only valid where there are variables.
      integer :: width = 0
   end type variable_set

contains

   !> Open the variables. All ranks that share the file call this together.
   subroutine open_set(set, file, variables, extents, error)
      !> The set; without variables it is valid and empty.
      type(variable_set), intent(out) :: set
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> What to open, shape (variables).
      type(variable_type), intent(in) :: variables(:)
      !> Extents that they must have, fastest first, shape (dimensions).
      integer, intent(in) :: extents(:)
      !> Set if a variable is missing or has another shape.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: space
      integer(hsize_t) :: found(size(extents)), most(size(extents))
      integer :: i, dimensions, ierr(3)

      set%variables = variables
      set%extents = extents
      if (size(variables) > 0) set%width = width_of(variables(1), extents)
      allocate (set%datasets(0))
      do i = 1, size(variables)
         call h5dopen_f(file, trim(variables(i)%name), space, ierr(1))
         call check(ierr(1), "open the variable '"//trim(variables(i)%name)//"'", error)
         if (allocated(error)) return
         set%datasets = [set%datasets, space]
         call h5dget_space_f(set%datasets(i), space, ierr(1))
         call h5sget_simple_extent_ndims_f(space, dimensions, ierr(2))
         ierr(3) = -1
         if (dimensions == size(extents)) call h5sget_simple_extent_dims_f(space, found, most, ierr(3))
         if (minval(ierr) < 0) found = -1_hsize_t
         if (any(found /= extents)) then
            call fatal_error(error, "the variable '"//trim(variables(i)%name)//"' does not have the extents of the grid")
            return
         end if
         if (i == 1) then
            set%space = space
         else
            call h5sclose_f(space, ierr(1))
            call check(ierr(1), 'close a dataspace', error)
         end if
      end do
   end subroutine open_set

   !> Close the variables; does nothing if they are not open.
   subroutine close_set(set, error)
      !> The set.
      type(variable_set), intent(inout) :: set
      !> Set if they cannot be closed.
      type(error_type), allocatable, intent(out) :: error

      integer :: i, ierr

      if (.not. allocated(set%datasets)) return
      do i = 1, size(set%datasets)
         call h5dclose_f(set%datasets(i), ierr)
         call check(ierr, "close the variable '"//trim(set%variables(i)%name)//"'", error)
      end do
      deallocate (set%datasets)
      if (set%space < 0) return
      call h5sclose_f(set%space, ierr)
      call check(ierr, 'close a dataspace', error)
      set%space = -1_hid_t
   end subroutine close_set

   !> Write a block of points, the checksum and then the status last. Each rank writes for itself.
   subroutine write_points(set, first, extent, responses, eta, checksums, error)
      !> The set.
      type(variable_set), intent(in) :: set
      !> First point from 1, fastest index first, shape (dimensions).
      integer, intent(in) :: first(:)
      !> Extents of the block, fastest index first, shape (dimensions).
      integer, intent(in) :: extent(:)
      !> Responses in the order of the file, shape (points).
      type(response), intent(in) :: responses(:)
      !> Changes by the flexible support [percent] and their error, shape (3, points); NaN where unknown.
      real(wp), intent(in) :: eta(:, :)
      !> Checksum of what was recorded of each point before, shape (points); 0 where nothing was.
      integer(i4), intent(in) :: checksums(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      type(run_type) :: run
      real(wp) :: reals(size(responses))
      integer(i4) :: sums(size(responses))
      integer :: integers(size(responses)), i

      if (size(responses) == 0) return
      call select_run(run, set%space, first, extent, set%width, error)
      if (allocated(error)) return
      reals = nan()
      integers = 0
      sums = checksums
      ! The checksum covers the status, which is written behind it.
      do i = 1, size(set%datasets)
         if (set%variables(i)%quantity == checksum_quantity) cycle
         call get_values(set%variables(i)%quantity, responses, eta, reals, integers)
         if (set%variables(i)%kind == real_value) then
            sums = extended(sums, reals)
         else
            sums = extended(sums, integers)
         end if
      end do
      ! A missing point has none.
      where (responses%status == status_missing) sums = 0_i4
      do i = 1, size(set%datasets)
         integers = sums
         call get_values(set%variables(i)%quantity, responses, eta, reals, integers)
         if (set%variables(i)%kind == real_value) then
            call write_run(run, set%datasets(i), reals, error)
         else
            call write_run(run, set%datasets(i), integers, error)
         end if
         if (allocated(error)) then
            error%message = error%message//": variable '"//trim(set%variables(i)%name)//"'"
            return
         end if
      end do
      call end_run(run, error)
   end subroutine write_points

   !> Read every point of a set of one dimension.
   subroutine read_points(set, responses, error)
      !> The set.
      type(variable_set), intent(in) :: set
      !> Responses, shape (points); what the file does not hold stays as it is.
      type(response), intent(inout) :: responses(:)
      !> Set if they cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(run_type) :: run
      real(wp) :: reals(size(responses))
      integer :: integers(size(responses)), i

      call select_run(run, set%space, [1], set%extents, set%width, error)
      if (allocated(error)) return
      reals = nan()
      integers = 0
      do i = 1, size(set%datasets)
         if (set%variables(i)%kind == real_value) then
            call read_run(run, set%datasets(i), reals, error)
         else
            call read_run(run, set%datasets(i), integers, error)
         end if
         if (allocated(error)) return
         call set_values(set%variables(i)%quantity, responses, reals, integers)
      end do
      call end_run(run, error)
   end subroutine read_points

   !> Read the status of every point.
   subroutine read_states(set, states, error)
      !> The set.
      type(variable_set), intent(in) :: set
      !> Status of each point in the order of the file, shape (points).
      integer, contiguous, intent(inout) :: states(:)
      !> Set if they cannot be read.
      type(error_type), allocatable, intent(out) :: error

      states = status_missing
      call read_flags(set, 'status', spread(1, 1, size(set%extents)), set%extents, states, error)
   end subroutine read_states

   !> Read an integer quantity of a block of points.
   subroutine read_flags(set, quantity, first, extent, flags, error)
      !> The set.
      type(variable_set), intent(in) :: set
      !> Name of the quantity.
      character(len=*), intent(in) :: quantity
      !> First point from 1 and extents of the block, fastest index first, shape (dimensions).
      integer, intent(in) :: first(:), extent(:)
      !> Its values in the order of the file, shape (points); left alone if there is no such quantity.
      integer, contiguous, intent(inout) :: flags(:)
      !> Set if they cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(run_type) :: run
      integer :: i

      call select_run(run, set%space, first, extent, set%width, error)
      if (allocated(error)) return
      do i = 1, size(set%datasets)
         if (set%variables(i)%quantity /= quantity) cycle
         call read_run(run, set%datasets(i), flags, error)
         if (allocated(error)) return
      end do
      call end_run(run, error)
   end subroutine read_flags

end module spurflex_io_results_set
