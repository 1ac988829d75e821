!> Finds the points of a result file whose values are not those that were written: each carries a checksum.
module spurflex_io_results_verify
   use mpi_f08, only: MPI_Comm, MPI_IN_PLACE, MPI_INTEGER, MPI_LOGICAL, MPI_LOR, MPI_SUM, mpi_allreduce, mpi_comm_rank, &
      mpi_comm_size
   use spurflex_base_checksum, only: extended, extended_over
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i4, wp
   use spurflex_io_agreement, only: share_error
   use spurflex_io_hdf5_run, only: end_run, read_run, run_type, select_run
   use spurflex_io_record_layout, only: record_kinds
   use spurflex_io_results_layout, only: checksum_quantity, real_value
   use spurflex_io_results_set, only: read_states, variable_set, write_points
   use spurflex_io_results_support, only: block_type, blocks_of, is_asked_for, support_set, write_records
   use spurflex_measure_record, only: record_type
   use spurflex_measure_response, only: empty_response, nan, status_missing
   implicit none
   private

   public :: verify_support

contains

   !> Find the damaged points of a support and empty them. The ranks share the work; all of them call this together.
   subroutine verify_support(set, comm, error)
      !> The support; its damaged points are noted on every rank.
      type(support_set), intent(inout) :: set
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Set on every rank if one cannot read or write.
      type(error_type), allocatable, intent(out) :: error

      type(block_type), allocatable :: blocks(:)
      logical, allocatable :: damaged(:)
      integer, allocatable :: states(:)
      integer :: i, rank, ranks, found(1)

      if (.not. is_asked_for(set)) return
      call mpi_comm_rank(comm, rank)
      call mpi_comm_size(comm, ranks)
      allocate (states(product(set%points%extents)), damaged(product(set%points%extents)))
      damaged = .false.
      call read_states(set%points, states, error)
      ! Nothing may be emptied while a rank still reads what is there.
      call share_error(comm, error)
      if (allocated(error)) return
      blocks = blocks_of(set)
      do i = 1 + rank, size(blocks), ranks
         associate (block => blocks(i))
            if (all(states(block%begin:block%end) == status_missing)) cycle
            call verify_block(set, block, states(block%begin:block%end), damaged(block%begin:block%end), error)
            if (.not. allocated(error)) call empty_points(set, block, damaged(block%begin:block%end), error)
            if (allocated(error)) exit
         end associate
      end do
      call share_error(comm, error)
      if (allocated(error)) return
      found = count(damaged)
      call mpi_allreduce(MPI_IN_PLACE, found, 1, MPI_INTEGER, MPI_SUM, comm)
      if (found(1) == 0) return
      call mpi_allreduce(MPI_IN_PLACE, damaged, size(damaged), MPI_LOGICAL, MPI_LOR, comm)
      call move_alloc(damaged, set%damaged)
   end subroutine verify_support

   !> Compare the checksums of a block with what stands in the file.
   subroutine verify_block(set, block, states, damaged, error)
      !> The support.
      type(support_set), intent(in) :: set
      !> The block.
      type(block_type), intent(in) :: block
      !> Status of its points, shape (points).
      integer, intent(in) :: states(:)
      !> The points that are there, but not as they were written, shape (points).
      logical, intent(out) :: damaged(:)
      !> Set if it cannot be read.
      type(error_type), allocatable, intent(out) :: error

      integer(i4) :: checksums(size(states)), written(size(states))
      integer :: kind

      checksums = 0_i4
      do kind = 1, record_kinds
         call add_values(set%records(kind), [1, block%first], [set%lengths(kind), block%extent], states /= status_missing, &
                         checksums, written, error)
         if (allocated(error)) return
      end do
      call add_values(set%points, block%first, block%extent, states /= status_missing, checksums, written, error)
      if (allocated(error)) return
      damaged = states /= status_missing .and. checksums /= written
   end subroutine verify_block

   !> Extend checksums by the values of a block, variable by variable.
   subroutine add_values(set, first, extent, present_points, checksums, written, error)
      !> The variables.
      type(variable_set), intent(in) :: set
      !> First element from 1 and extents, fastest index first, shape (dimensions).
      integer, intent(in) :: first(:), extent(:)
      !> Points that count, shape (points).
      logical, intent(in) :: present_points(:)
      !> The checksums, shape (points).
      integer(i4), intent(inout) :: checksums(:)
      !> Where the variables have a checksum among them: what it is, shape (points).
      integer(i4), intent(inout) :: written(:)
      !> Set if it cannot be read.
      type(error_type), allocatable, intent(out) :: error

      type(run_type) :: run
      real(wp), allocatable :: reals(:)
      integer :: integers(size(checksums)), v, i, length

      if (size(set%datasets) == 0) return
      allocate (reals(product(extent)))
      length = size(reals)/size(checksums)
      integers = 0
      call select_run(run, set%space, first, extent, set%width, error)
      do v = 1, size(set%datasets)
         if (allocated(error)) return
         if (set%variables(v)%kind == real_value) then
            call read_run(run, set%datasets(v), reals, error)
            do i = 1, size(checksums)
               if (.not. present_points(i)) cycle
               checksums(i) = extended_over(checksums(i), reals((i - 1)*length + 1:i*length))
            end do
         else
            call read_run(run, set%datasets(v), integers, error)
            if (set%variables(v)%quantity == checksum_quantity) then
               written = integers
            else
               checksums = extended(checksums, integers)
            end if
         end if
      end do
      if (.not. allocated(error)) call end_run(run, error)
   end subroutine add_values

   !> Make damaged points missing in the file.
   subroutine empty_points(set, block, damaged, error)
      !> The support.
      type(support_set), intent(in) :: set
      !> The block.
      type(block_type), intent(in) :: block
      !> Its points that are damaged, shape (points).
      logical, intent(in) :: damaged(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      type(record_type) :: nothing(1)
      integer(i4) :: checksums(1)
      real(wp) :: eta(3, 1)
      integer :: i, first(size(block%first)), one(size(block%first))

      eta = nan()
      one = 1
      do i = 1, size(damaged)
         if (.not. damaged(i)) cycle
         first = block%first
         first(1) = first(1) + mod(i - 1, block%extent(1))
         if (size(first) > 1) first(2) = first(2) + (i - 1)/block%extent(1)
         ! The response first: from then on the point is missing.
         call write_points(set%points, first, one, [empty_response()], eta, [0_i4], error)
         if (allocated(error)) return
         call write_records(set, first, one, nothing, checksums, error)
         if (allocated(error)) return
      end do
   end subroutine empty_points

end module spurflex_io_results_verify
