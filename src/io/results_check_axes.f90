!> Decides whether the axes of an existing result file are those of the deck: no checksum of a point covers them.
module spurflex_io_results_check_axes
   use hdf5, only: H5T_NATIVE_DOUBLE, h5dclose_f, h5dget_space_f, h5dopen_f, h5dread_f, h5sclose_f, &
      h5sget_simple_extent_npoints_f, hid_t, hsize_t
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: wp
   use spurflex_io_case, only: case_type
   use spurflex_io_hdf5, only: check
   use spurflex_io_record_layout, only: file_axes
   use spurflex_io_results_layout, only: axis_type
   implicit none
   private

   public :: check_axes

   !> Relative difference that another processor's powers may make, far below the distance of two points.
   real(wp), parameter :: rounding = 1.0e-12_wp

contains

   !> Check every axis.
   subroutine check_axes(file, case, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> What is to be computed.
      type(case_type), intent(in) :: case
      !> Set if an axis is missing or holds other values.
      type(error_type), allocatable, intent(out) :: error

      type(axis_type), allocatable :: axes(:)
      integer :: i

      allocate (axes, source=file_axes(case))
      do i = 1, size(axes)
         call check_axis(file, axes(i), error)
         if (allocated(error)) return
      end do
   end subroutine check_axes

   !> Check one axis.
   subroutine check_axis(file, axis, error)
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> The axis, with the values that it should have.
      type(axis_type), intent(in) :: axis
      !> Set if it is missing or holds other values.
      type(error_type), allocatable, intent(out) :: error

      real(wp) :: found(size(axis%values))
      integer(hid_t) :: dataset, space
      integer(hsize_t) :: extents(1), elements
      integer :: ierr(4)

      extents = size(axis%values, kind=hsize_t)
      call h5dopen_f(file, trim(axis%group)//trim(axis%name), dataset, ierr(1))
      call check(ierr(1), "open the axis '"//trim(axis%name)//"'", error)
      if (allocated(error)) return
      elements = -1_hsize_t
      call h5dget_space_f(dataset, space, ierr(1))
      call h5sget_simple_extent_npoints_f(space, elements, ierr(2))
      call h5sclose_f(space, ierr(3))
      ierr(4) = -1
      if (elements == extents(1)) call h5dread_f(dataset, H5T_NATIVE_DOUBLE, found, extents, ierr(4))
      call h5dclose_f(dataset, ierr(1))
      if (ierr(4) >= 0) then
         ! As a negation, so that a NaN is found too.
         if (all(abs(found - axis%values) <= rounding*abs(axis%values))) return
      end if
      call fatal_error(error, "the axis '"//trim(axis%name)//"' does not hold the values of the deck")
   end subroutine check_axis

end module spurflex_io_results_check_axes
