!> Texts and attributes in HDF5 files.
module spurflex_io_hdf5_text
   use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_ptr
   use hdf5, only: H5P_DATASET_CREATE_F, H5S_SCALAR_F, H5T_C_S1, H5T_CSET_UTF8_F, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &
      H5T_NATIVE_INTEGER, H5T_STD_I32LE, &
      H5T_STRING_F, H5T_STR_NULLPAD_F, h5aclose_f, h5acreate_f, h5awrite_f, h5dclose_f, h5dcreate_f, h5dget_space_f, &
      h5dget_type_f, h5dopen_f, h5dread_f, h5dwrite_f, h5pclose_f, h5pcreate_f, h5pset_obj_track_times_f, &
      h5sclose_f, h5screate_f, h5screate_simple_f, h5sget_simple_extent_npoints_f, h5tclose_f, h5tcopy_f, &
      h5tget_class_f, h5tget_size_f, h5tis_variable_str_f, h5tset_cset_f, h5tset_size_f, h5tset_strpad_f, hid_t, &
      hsize_t, size_t
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_io_hdf5, only: check
   implicit none
   private

   public :: write_attribute, write_text, read_text

   !> Give an object an attribute: a text, a real, or a list of integers.
   interface write_attribute
      module procedure :: write_text_attribute
      module procedure :: write_integers_attribute
      module procedure :: write_real_attribute
   end interface write_attribute

contains

   !> Give an object a text as attribute.
   subroutine write_text_attribute(object, name, text, error)
      !> File, group or dataset.
      integer(hid_t), intent(in) :: object
      !> Name of the attribute.
      character(len=*), intent(in) :: name
      !> The text.
      character(len=*), intent(in) :: text
      !> Set if it cannot be done.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: text_type, space, attribute
      integer :: ierr(4)
      character(kind=c_char), allocatable, target :: characters(:)
      type(c_ptr) :: address

      call describe_text(text, characters, text_type, error)
      if (allocated(error)) return
      call h5screate_f(H5S_SCALAR_F, space, ierr(1))
      call h5acreate_f(object, name, text_type, space, attribute, ierr(2))
      call check(minval(ierr(:2)), "make the attribute '"//name//"'", error)
      if (allocated(error)) return
      address = c_loc(characters)
      call h5awrite_f(attribute, text_type, address, ierr(1))
      call h5aclose_f(attribute, ierr(2))
      call h5sclose_f(space, ierr(3))
      call h5tclose_f(text_type, ierr(4))
      call check(minval(ierr), "write the attribute '"//name//"'", error)
   end subroutine write_text_attribute

   !> Give an object a list of integers as attribute.
   subroutine write_integers_attribute(object, name, values, error)
      !> File, group or dataset.
      integer(hid_t), intent(in) :: object
      !> Name of the attribute.
      character(len=*), intent(in) :: name
      !> The integers.
      integer, intent(in) :: values(:)
      !> Set if it cannot be done.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: space, attribute
      integer(hsize_t) :: extents(1)
      integer :: ierr(3)

      extents = size(values, kind=hsize_t)
      call h5screate_simple_f(1, extents, space, ierr(1))
      call h5acreate_f(object, name, H5T_STD_I32LE, space, attribute, ierr(2))
      call check(minval(ierr(:2)), "make the attribute '"//name//"'", error)
      if (allocated(error)) return
      call h5awrite_f(attribute, H5T_NATIVE_INTEGER, values, extents, ierr(1))
      call h5aclose_f(attribute, ierr(2))
      call h5sclose_f(space, ierr(3))
      call check(minval(ierr), "write the attribute '"//name//"'", error)
   end subroutine write_integers_attribute

   !> Give an object a real as attribute.
   subroutine write_real_attribute(object, name, value, error)
      !> File, group or dataset.
      integer(hid_t), intent(in) :: object
      !> Name of the attribute.
      character(len=*), intent(in) :: name
      !> The real.
      real(wp), intent(in) :: value
      !> Set if it cannot be done.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: space, attribute
      integer(hsize_t), parameter :: one(1) = 1_hsize_t
      integer :: ierr(3)

      call h5screate_f(H5S_SCALAR_F, space, ierr(1))
      call h5acreate_f(object, name, H5T_IEEE_F64LE, space, attribute, ierr(2))
      call check(minval(ierr(:2)), "make the attribute '"//name//"'", error)
      if (allocated(error)) return
      call h5awrite_f(attribute, H5T_NATIVE_DOUBLE, value, one, ierr(1))
      call h5aclose_f(attribute, ierr(2))
      call h5sclose_f(space, ierr(3))
      call check(minval(ierr), "write the attribute '"//name//"'", error)
   end subroutine write_real_attribute

   !> Write a text as a dataset of its own.
   subroutine write_text(parent, name, text, error)
      !> File or group.
      integer(hid_t), intent(in) :: parent
      !> Name of the dataset.
      character(len=*), intent(in) :: name
      !> The text.
      character(len=*), intent(in) :: text
      !> Set if it cannot be done.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: text_type, space, dataset, properties
      integer :: ierr(5)
      character(kind=c_char), allocatable, target :: characters(:)
      type(c_ptr) :: address

      call describe_text(text, characters, text_type, error)
      if (allocated(error)) return
      call h5pcreate_f(H5P_DATASET_CREATE_F, properties, ierr(1))
      call h5pset_obj_track_times_f(properties, .false., ierr(2))
      call h5screate_f(H5S_SCALAR_F, space, ierr(3))
      call h5dcreate_f(parent, name, text_type, space, dataset, ierr(4), dcpl_id=properties)
      call check(minval(ierr(:4)), "make the text '"//name//"'", error)
      if (allocated(error)) return
      address = c_loc(characters)
      call h5dwrite_f(dataset, text_type, address, ierr(1))
      call h5dclose_f(dataset, ierr(2))
      call h5sclose_f(space, ierr(3))
      call h5pclose_f(properties, ierr(4))
      call h5tclose_f(text_type, ierr(5))
      call check(minval(ierr), "write the text '"//name//"'", error)
   end subroutine write_text

   !> Read a text that is a dataset of its own.
   subroutine read_text(parent, name, text, error)
      !> File or group.
      integer(hid_t), intent(in) :: parent
      !> Name of the dataset.
      character(len=*), intent(in) :: name
      !> The text.
      character(len=:), allocatable, intent(out) :: text
      !> Set if it cannot be read.
      type(error_type), allocatable, intent(out) :: error

      integer(hid_t) :: text_type, dataset, space
      integer(size_t) :: length
      integer(hsize_t) :: elements
      integer :: ierr(3), i, class
      logical :: variable_length
      character(kind=c_char), allocatable, target :: characters(:)
      type(c_ptr) :: address

      call h5dopen_f(parent, name, dataset, ierr(1))
      call check(ierr(1), "open the text '"//name//"'", error)
      if (allocated(error)) return
      call h5dget_type_f(dataset, text_type, ierr(1))
      call h5tget_size_f(text_type, length, ierr(2))
      call h5dget_space_f(dataset, space, ierr(3))
      call check(minval(ierr), "tell the length of the text '"//name//"'", error)
      if (allocated(error)) return
      ! In a file from elsewhere it may be anything.
      call h5tget_class_f(text_type, class, ierr(1))
      call h5sget_simple_extent_npoints_f(space, elements, ierr(2))
      call h5sclose_f(space, ierr(3))
      if (class /= H5T_STRING_F .or. elements /= 1_hsize_t) ierr(1) = -1
      if (ierr(1) >= 0) then
         call h5tis_variable_str_f(text_type, variable_length, ierr(3))
         if (variable_length) ierr(3) = -1
      end if
      call check(minval(ierr), "find a text of fixed length in '"//name//"'", error)
      if (allocated(error)) return
      allocate (characters(length))
      address = c_loc(characters)
      call h5dread_f(dataset, text_type, address, ierr(1))
      call h5tclose_f(text_type, ierr(2))
      call h5dclose_f(dataset, ierr(3))
      call check(minval(ierr), "read the text '"//name//"'", error)
      if (allocated(error)) return
      length = first_null(characters) - 1
      allocate (character(len=length) :: text)
      do i = 1, int(length)
         text(i:i) = characters(i)
      end do
   end subroutine read_text

   !> The characters of a text and the type that describes them: of fixed length, UTF-8, padded with nulls.
   subroutine describe_text(text, characters, text_type, error)
      !> The text.
      character(len=*), intent(in) :: text
      !> Its characters; a null if there are none, as a type must have a size.
      character(kind=c_char), allocatable, intent(out) :: characters(:)
      !> The type, to be closed.
      integer(hid_t), intent(out) :: text_type
      !> Set if it cannot be made.
      type(error_type), allocatable, intent(out) :: error

      integer :: ierr(4), i

      allocate (characters(max(len(text), 1)))
      characters = achar(0)
      do i = 1, len(text)
         characters(i) = text(i:i)
      end do
      call h5tcopy_f(H5T_C_S1, text_type, ierr(1))
      call h5tset_size_f(text_type, size(characters, kind=size_t), ierr(2))
      call h5tset_strpad_f(text_type, H5T_STR_NULLPAD_F, ierr(3))
      call h5tset_cset_f(text_type, H5T_CSET_UTF8_F, ierr(4))
      call check(minval(ierr), 'describe a text', error)
   end subroutine describe_text

   !> Where the first null is.
   pure function first_null(characters) result(position)
      !> Characters.
      character(kind=c_char), intent(in) :: characters(:)
      !> Position of the first null, one behind the end if there is none.
      integer :: position

      do position = 1, size(characters)
         if (characters(position) == achar(0)) return
      end do
   end function first_null

end module spurflex_io_hdf5_text
