!> What a rank has found and not written yet: pieces on the flexible support wait here until their rigid twins are known.
module spurflex_sweep_writing
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i4
   use spurflex_io_results, only: results_file, write_rigid, write_flexible
   use spurflex_measure_response, only: response
   use spurflex_sweep_chunk, only: chunk_type
   use spurflex_sweep_schedule, only: scheduler
   use spurflex_sweep_twins, only: twin_table
   implicit none
   private

   public :: finding, outbox, write_finding

   !> What was found of a piece of the grid.
   type :: finding
      !> The piece.
      type(chunk_type) :: chunk
      !> Its responses, shape (count rows).
      type(response), allocatable :: responses(:)
      !> Checksums of what was recorded of it, shape (count rows).
      integer(i4), allocatable :: checksums(:)
   end type finding

   !> Findings on their way into the file.
   type :: outbox
      private
      !> The first so many are there.
      type(finding), allocatable :: waiting(:)
      integer :: filled = 0
   contains
      !> Take a finding.
      procedure :: put
      !> There is more than the latest one.
      procedure :: has_older
      !> Write all findings.
      procedure :: empty
   end type outbox

contains

   !> Take a finding.
   subroutine put(self, found)
      !> Outbox.
      class(outbox), intent(inout) :: self
      !> The finding; empty afterwards.
      type(finding), intent(inout) :: found

      type(finding), allocatable :: larger(:)
      integer :: i

      if (.not. allocated(self%waiting)) allocate (self%waiting(1))
      if (self%filled == size(self%waiting)) then
         allocate (larger(2*self%filled))
         do i = 1, self%filled
            call move(self%waiting(i), larger(i))
         end do
         call move_alloc(larger, self%waiting)
      end if
      self%filled = self%filled + 1
      call move(found, self%waiting(self%filled))
   end subroutine put

   !> Move a finding, without a copy.
   subroutine move(from, to)
      !> Where it is; empty afterwards.
      type(finding), intent(inout) :: from
      !> Where it goes.
      type(finding), intent(inout) :: to

      to%chunk = from%chunk
      call move_alloc(from%responses, to%responses)
      call move_alloc(from%checksums, to%checksums)
   end subroutine move

   !> There is more than the latest one.
   pure function has_older(self) result(it_has)
      !> Outbox.
      class(outbox), intent(in) :: self
      !> There is.
      logical :: it_has

      it_has = self%filled > 1
   end function has_older

   !> Write all findings; what has a twin that no rank knows is left for the next run.
   subroutine empty(self, twins, results, schedule, error)
      !> Outbox.
      class(outbox), intent(inout) :: self
      !> The rigid twins, known.
      type(twin_table), intent(in) :: twins
      !> Open result file.
      type(results_file), intent(in) :: results
      !> Counts the points.
      type(scheduler), intent(inout) :: schedule
      !> Set where a finding cannot be written.
      type(error_type), allocatable, intent(out) :: error

      integer :: i

      do i = 1, self%filled
         call schedule%serve()
         if (twins%cover(self%waiting(i)%chunk)) call write_finding(self%waiting(i), twins, results, schedule, error)
         if (allocated(error)) return
         deallocate (self%waiting(i)%responses, self%waiting(i)%checksums)
      end do
      self%filled = 0
   end subroutine empty

   !> Write a finding and count its points.
   subroutine write_finding(found, twins, results, schedule, error)
      !> The finding.
      type(finding), intent(in) :: found
      !> The rigid twins, known if it is flexible.
      type(twin_table), intent(in) :: twins
      !> Open result file.
      type(results_file), intent(in) :: results
      !> Counts the points.
      type(scheduler), intent(inout) :: schedule
      !> Set where it cannot be written.
      type(error_type), allocatable, intent(out) :: error

      integer :: i

      associate (chunk => found%chunk)
         if (chunk%row == 0) then
            call write_rigid(results, chunk%first, found%responses, error, found%checksums)
         else
            call write_flexible(results, chunk%row, chunk%rows, chunk%first, found%responses, &
                                twins%eta_of(chunk, found%responses), error, found%checksums)
         end if
      end associate
      if (allocated(error)) return
      do i = 1, size(found%responses)
         call schedule%count_point(found%responses(i)%status)
      end do
   end subroutine write_finding

end module spurflex_sweep_writing
