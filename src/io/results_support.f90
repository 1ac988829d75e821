!> The open variables of one support: the responses of its points, and what is recorded of each.
module spurflex_io_results_support
   use hdf5, only: hid_t
   use spurflex_base_checksum, only: extended_over
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i4, wp
   use spurflex_io_case, only: case_type
   use spurflex_io_hdf5_run, only: end_run, run_type, select_run, write_run
   use spurflex_io_record_layout, only: get_record, is_recorded, record_kinds, record_length, record_variables
   use spurflex_io_results_layout, only: flexible_variables, rigid_variables
   use spurflex_io_results_set, only: close_set, open_set, variable_set
   use spurflex_measure_record, only: record_type
   implicit none
   private

   public :: support_set, open_support, close_support, is_asked_for, write_records
   public :: block_type, blocks_of

   !> Open variables of one support.
   type :: support_set
      !> The responses, on (speed) or (speed, stiffness); empty if the support is not asked for.
      type(variable_set) :: points
      !> Each kind of record, with its own axis in front; empty if it is not asked for.
      type(variable_set) :: records(record_kinds)
      !> Numbers along the axis of each kind of record.
      integer :: lengths(record_kinds) = 0
      !> Points whose checksum did not fit when the file was opened, in the order of the file, shape (points); none if all did.
      logical, allocatable :: damaged(:)
   end type support_set

   !> A block of neighbouring points.
   type :: block_type
      !> First point from 1 and extents, fastest index first, shape (dimensions).
      integer, allocatable :: first(:), extent(:)
      !> The same points in the order of the file.
      integer :: begin = 1, end = 0
   end type block_type

contains

   !> Open the variables of a support. All ranks that share the file call this together.
   subroutine open_support(set, file, case, rigid, error)
      !> The set; empty if the support is not asked for.
      type(support_set), intent(out) :: set
      !> Open file.
      integer(hid_t), intent(in) :: file
      !> What is computed.
      type(case_type), intent(in) :: case
      !> The rigid support, not the flexible one.
      logical, intent(in) :: rigid
      !> Set if a variable is missing or has another shape.
      type(error_type), allocatable, intent(out) :: error

      integer, allocatable :: extents(:)
      integer :: kind

      allocate (set%damaged(0))
      if (rigid) then
         extents = [case%sweep%speed_count]
         call open_set(set%points, file, rigid_variables(case%sweep, case%output%products), extents, error)
      else
         extents = [case%sweep%speed_count, case%sweep%stiffness_count]
         call open_set(set%points, file, flexible_variables(case%sweep, case%output%products), extents, error)
      end if
      do kind = 1, record_kinds
         if (allocated(error)) return
         if (is_recorded(case%output%record, kind)) set%lengths(kind) = record_length(case%output%record, kind)
         call open_set(set%records(kind), file, record_variables(case%sweep, case%output%record, kind, rigid), &
                       [set%lengths(kind), extents], error)
      end do
   end subroutine open_support

   !> Close the variables; does nothing if they are not open.
   subroutine close_support(set, error)
      !> The set.
      type(support_set), intent(inout) :: set
      !> Set if they cannot be closed.
      type(error_type), allocatable, intent(out) :: error

      type(error_type), allocatable :: next
      integer :: kind

      call close_set(set%points, error)
      do kind = 1, record_kinds
         call close_set(set%records(kind), next)
         if (allocated(next) .and. .not. allocated(error)) call move_alloc(next, error)
      end do
   end subroutine close_support

   !> Whether the support is there at all.
   pure function is_asked_for(set) result(it_is)
      !> The set.
      type(support_set), intent(in) :: set
      !> It is.
      logical :: it_is

      it_is = size(set%points%variables) > 0
   end function is_asked_for

   !> Write what was recorded of a block of points; their responses are to follow. Each rank writes for itself.
   subroutine write_records(set, first, extent, records, checksums, error)
      !> The set.
      type(support_set), intent(in) :: set
      !> First point from 1 and extents of the block, fastest index first, shape (dimensions).
      integer, intent(in) :: first(:), extent(:)
      !> The records in the order of the file, shape (points).
      type(record_type), intent(in) :: records(:)
      !> Checksums of the records, shape (points).
      integer(i4), intent(out) :: checksums(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      type(run_type) :: run
      real(wp), allocatable :: values(:)
      integer :: kind, v, i

      checksums = 0_i4
      if (size(records) == 0) return
      do kind = 1, record_kinds
         associate (pieces => set%records(kind), length => set%lengths(kind))
            if (size(pieces%datasets) == 0) cycle
            allocate (values(length*size(records)))
            call select_run(run, pieces%space, [1, first], [length, extent], pieces%width, error)
            if (allocated(error)) return
            do v = 1, size(pieces%datasets)
               do i = 1, size(records)
                  associate (mine => values((i - 1)*length + 1:i*length))
                     call get_record(records(i), pieces%variables(v), mine)
                     checksums(i) = extended_over(checksums(i), mine)
                  end associate
               end do
               call write_run(run, pieces%datasets(v), values, error)
               if (allocated(error)) then
                  error%message = error%message//": variable '"//trim(pieces%variables(v)%name)//"'"
                  return
               end if
            end do
            call end_run(run, error)
            if (allocated(error)) return
            deallocate (values)
         end associate
      end do
   end subroutine write_records

   !> Cut the points of a support into blocks that are read at once.
   pure function blocks_of(set) result(blocks)
      !> The set.
      type(support_set), intent(in) :: set
      !> The blocks, in the order of the file.
      type(block_type), allocatable :: blocks(:)

      !> Numbers of a variable, and points, that are read at once; at least one point.
      integer, parameter :: most_numbers = 2000000, most_points = 16384
      integer :: points, width, height, row, speed, n

      if (.not. is_asked_for(set)) then
         allocate (blocks(0))
         return
      end if
      points = max(1, min(most_points, most_numbers/max(1, maxval(set%lengths))))
      associate (speeds => set%points%extents(1), rows => product(set%points%extents(2:)))
         width = min(points, speeds)
         height = max(1, points/speeds)
         allocate (blocks(((speeds - 1)/width + 1)*((rows - 1)/height + 1)))
         n = 0
         do row = 1, rows, height
            do speed = 1, speeds, width
               n = n + 1
               blocks(n)%first = [speed, row]
               blocks(n)%extent = [min(width, speeds - speed + 1), min(height, rows - row + 1)]
               blocks(n)%begin = (row - 1)*speeds + speed
               blocks(n)%end = blocks(n)%begin + product(blocks(n)%extent) - 1
               blocks(n)%first = blocks(n)%first(:size(set%points%extents))
               blocks(n)%extent = blocks(n)%extent(:size(set%points%extents))
            end do
         end do
      end associate
   end function blocks_of

end module spurflex_io_results_support
