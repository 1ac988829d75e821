!> How much room on the disk a result file takes, and whether it is there.
!>
!> A result file takes all its room as it is made. What is wrong with the room is said before anything is made.
module spurflex_io_results_room
   use spurflex_base_error, only: error_type, exit_deck
   use spurflex_base_kinds, only: wp, i8
   use spurflex_base_text, only: fixed_text
   use spurflex_external_posix, only: check_room
   use spurflex_io_case, only: case_type
   use spurflex_io_record_layout, only: file_axes, file_variables
   use spurflex_io_results_layout, only: axis_type, real_value, variable_type, width_of
   implicit none
   private

   public :: check_results_room

   !> Bytes of a real and of an integer in the file.
   integer(i8), parameter :: real_bytes = 8_i8, integer_bytes = 4_i8
   !> Bytes of a megabyte.
   real(wp), parameter :: megabyte = 1.0e6_wp

contains

   !> Whether there is room for a new result file; one process alone calls this.
   subroutine check_results_room(case, error)
      !> Case.
      type(case_type), intent(in) :: case
      !> Set if there is not.
      type(error_type), allocatable, intent(out) :: error

      integer(i8) :: bytes
      logical :: there

      bytes = array_bytes(case)
      call check_room(case%output%file, bytes, error)
      if (.not. allocated(error)) return
      error%message = "cannot make the result file '"//case%output%file//"' of " &
                      //fixed_text(real(bytes, wp)/megabyte, 3)//' MB: '//error%message
      inquire (file=folder_of(case%output%file), exist=there)
      if (there) return
      error%message = error%message//'; make its folder first, or change file in &output'
      error%code = exit_deck
   end subroutine check_results_room

   !> The folder of a file.
   pure function folder_of(path) result(folder)
      !> Path of the file.
      character(len=*), intent(in) :: path
      !> Path of something that is there if the folder is.
      character(len=:), allocatable :: folder

      folder = path(:index(path, '/', back=.true.))//'.'
   end function folder_of

   !> Bytes of all variables: what is stored in columns takes whole ones.
   pure function array_bytes(case) result(bytes)
      !> Case.
      type(case_type), intent(in) :: case
      !> Bytes.
      integer(i8) :: bytes

      type(axis_type), allocatable :: axes(:)
      type(variable_type), allocatable :: variables(:)
      integer, allocatable :: extents(:)
      integer :: i, j, k, width

      allocate (axes, source=file_axes(case))
      allocate (variables, source=file_variables(case))
      bytes = 0_i8
      do i = 1, size(variables)
         extents = [((pack([size(axes(j)%values)], variables(i)%axes(k) == axes(j)%name), j=1, size(axes)), &
                     k=1, size(variables(i)%axes))]
         width = width_of(variables(i), extents)
         extents(1) = ((extents(1) - 1)/width + 1)*width
         bytes = bytes + product(int(extents, i8))*merge(real_bytes, integer_bytes, variables(i)%kind == real_value)
      end do
   end function array_bytes

end module spurflex_io_results_room
