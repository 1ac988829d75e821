!> The rigid twins: the largest bearing deformations on the rigid support, with which those on the flexible one are compared.
!>
!> Each rank knows those that it has found. They are shared while the ranks work on: as soon as a rank gets no more of them to
!> find it hands in its own, and once all ranks have every one knows them all.
module spurflex_sweep_twins
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use mpi_f08, only: MPI_Comm, MPI_Request, MPI_REQUEST_NULL, MPI_DOUBLE_PRECISION, MPI_IN_PLACE, MPI_MIN, MPI_STATUS_IGNORE, &
      mpi_iallreduce, mpi_test
   use spurflex_base_kinds, only: wp
   use spurflex_measure_response, only: response, nan, status_diverged, status_missing
   use spurflex_sweep_chunk, only: chunk_type
   implicit none
   private

   public :: twin_table, new_twin_table

   !> Larger than every deformation: a twin that is not known, and, less, what is known to be unknown of one. NaN would be lost
   !> among others when twins are shared.
   real(wp), parameter :: no_twin = huge(1.0_wp), failed_twin = 0.5_wp*no_twin
   real(wp), parameter :: percent = 100.0_wp

   !> The twins of all speeds.
   type :: twin_table
      private
      !> Largest deformation of each bearing [m], its relative error; shape (3, speed). Unallocated if they are not asked for.
      real(wp), allocatable :: found(:, :)
      !> They are being shared; they need not be, or are.
      logical :: is_shared = .false., is_complete = .true.
      type(MPI_Request) :: request = MPI_REQUEST_NULL
   contains
      !> Keep what was found on the rigid support.
      procedure :: keep
      !> Begin to share.
      procedure :: share
      !> Every rank has handed in its own.
      procedure :: are_known
      !> Those of a chunk are known.
      procedure :: cover
      !> How much the flexible support changes the bearing deformation.
      procedure :: eta_of
   end type twin_table

contains

   !> A table of what a result file has.
   pure function new_twin_table(rigid, as_a_whole) result(self)
      !> Responses on the rigid support, shape (speed).
      type(response), intent(in) :: rigid(:)
      !> All of them are found again if any is missing.
      logical, intent(in) :: as_a_whole
      !> The table.
      type(twin_table) :: self

      allocate (self%found(3, size(rigid)), source=no_twin)
      self%is_complete = all(rigid%status /= status_missing)
      if (self%is_complete .or. .not. as_a_whole) call self%keep(1, rigid)
   end function new_twin_table

   !> Keep what was found on the rigid support.
   pure subroutine keep(self, first, rigid)
      !> Table.
      class(twin_table), intent(inout) :: self
      !> Index of the first speed.
      integer, intent(in) :: first
      !> Responses at consecutive speeds.
      type(response), intent(in) :: rigid(:)

      integer :: i

      do i = 1, size(rigid)
         select case (rigid(i)%status)
         case (status_missing)
            cycle
         case (status_diverged)
            self%found(:, first + i - 1) = failed_twin
         case default
            associate (twin => self%found(:, first + i - 1))
               twin = [rigid(i)%bearing_deformation_max, rigid(i)%error_estimate]
               where (ieee_is_nan(twin)) twin = failed_twin
            end associate
         end select
      end do
   end subroutine keep

   !> Begin to share, unless that is done already or need not be. Every rank calls this once it gets no more rigid points; until all
   !> are known the table stays where it is.
   subroutine share(self, comm)
      !> Table.
      class(twin_table), intent(inout), asynchronous :: self
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm

      if (self%is_shared .or. self%is_complete) return
      self%is_shared = .true.
      call mpi_iallreduce(MPI_IN_PLACE, self%found, size(self%found), MPI_DOUBLE_PRECISION, MPI_MIN, comm, self%request)
   end subroutine share

   !> Every rank has handed in its own, or there are none.
   function are_known(self) result(known)
      !> Table.
      class(twin_table), intent(inout), asynchronous :: self
      !> They have.
      logical :: known

      known = self%is_complete
      if (known .or. .not. self%is_shared) return
      call mpi_test(self%request, known, MPI_STATUS_IGNORE)
      self%is_complete = known
   end function are_known

   !> The twins of a chunk are known: a run that is stopped may leave some for the next one.
   pure function cover(self, chunk) result(covered)
      !> Table, shared.
      class(twin_table), intent(in) :: self
      !> Chunk on the flexible support.
      type(chunk_type), intent(in) :: chunk
      !> They are, or are not asked for.
      logical :: covered

      covered = .true.
      if (allocated(self%found)) covered = all(self%found(1, chunk%first:chunk%first + chunk%count - 1) < no_twin)
   end function cover

   !> How much the flexible support changes the largest bearing deformations.
   pure function eta_of(self, chunk, flexible) result(eta)
      !> Table, shared.
      class(twin_table), intent(in) :: self
      !> Chunk on the flexible support.
      type(chunk_type), intent(in) :: chunk
      !> Its responses, shape (count rows).
      type(response), intent(in) :: flexible(:)
      !> Eta of each bearing and its error [percent], shape (3, count rows); NaN where one of both has no deformation.
      real(wp) :: eta(3, size(flexible))

      real(wp) :: ratio(2)
      integer :: i

      eta = nan()
      if (.not. allocated(self%found)) return
      do i = 1, size(flexible)
         associate (twin => self%found(:, chunk%first + mod(i - 1, chunk%count)))
            if (any(twin(:2) >= failed_twin) .or. any(twin(:2) <= 0.0_wp) .or. flexible(i)%status == status_diverged) cycle
            ratio = flexible(i)%bearing_deformation_max/twin(:2)
            eta(:2, i) = percent*(ratio - 1.0_wp)
            if (twin(3) < failed_twin) eta(3, i) = percent*maxval(ratio)*(flexible(i)%error_estimate + twin(3))
         end associate
      end do
   end function eta_of

end module spurflex_sweep_twins
