!> Records the steady motions of the points of a chunk and writes them, piece by piece, before their responses.
module spurflex_sweep_recording
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: i4, wp
   use spurflex_io_case, only: sweep_spec
   use spurflex_io_record_layout, only: record_bytes, record_kinds
   use spurflex_io_results, only: results_file, write_records
   use spurflex_measure_record, only: record_request, record_type
   use spurflex_measure_recorder, only: recorder_type
   use spurflex_measure_response, only: response
   use spurflex_model_equations, only: equations_type
   use spurflex_sweep_chunk, only: chunk_type
   implicit none
   private

   public :: record_points

   !> Bytes of records that a rank keeps at most, those of one point apart.
   real(wp), parameter :: most_bytes = 32.0e6_wp

contains

   !> Record points and write what was recorded.
   subroutine record_points(request, recorder, tile, equations, positions, velocities, answers, results, visitor, checksums, error)
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> Records motions.
      type(recorder_type), intent(inout) :: recorder
      !> The points: a chunk, or one speed of it.
      type(chunk_type), intent(in) :: tile
      !> Equations of motion of each point, shape (points).
      type(equations_type), intent(in) :: equations(:)
      !> Section of each steady motion: deviation from the static equilibrium and its rate, shape (n, points).
      real(wp), intent(in) :: positions(:, :), velocities(:, :)
      !> Their responses, shape (points).
      type(response), intent(in) :: answers(:)
      !> Open result file.
      type(results_file), intent(in) :: results
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> Checksum of what was recorded of each point, shape (points).
      integer(i4), intent(out) :: checksums(:)
      !> Set where a motion cannot be recorded or written.
      type(error_type), allocatable, intent(out) :: error

      type(record_type), allocatable :: records(:)
      integer :: row, first, next, width, most, i

      most = most_points(request)
      ! A single speed is a column of rows, in which neighbours can be written together too.
      width = tile%count
      if (tile%count == 1) width = tile%rows
      do row = 1, size(answers)/width
         do first = 1, width, most
            next = (row - 1)*width + first
            allocate (records(min(most, width - first + 1)))
            do i = 1, size(records)
               call recorder%record(equations(next), positions(:, next), velocities(:, next), answers(next), records(i), error, &
                                    visitor)
               if (allocated(error)) return
               next = next + 1
            end do
            associate (sums => checksums(next - size(records):next - 1))
               if (tile%count > 1 .or. tile%row == 0) then
                  call write_records(results, merge(tile%row + row - 1, 0, tile%row > 0), 1, tile%first + first - 1, records, &
                                     sums, error)
               else
                  call write_records(results, tile%row + first - 1, size(records), tile%first, records, sums, error)
               end if
            end associate
            if (allocated(error)) return
            deallocate (records)
         end do
      end do
   end subroutine record_points

   !> Points whose records are kept at once.
   pure function most_points(request) result(points)
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> At least one.
      integer :: points

      type(sweep_spec) :: one
      integer :: kind

      one%flexible = .true.
      one%speed_count = 1
      one%stiffness_count = 1
      points = max(1, int(most_bytes/sum([(record_bytes(one, request, kind), kind=1, record_kinds)])))
   end function most_points

end module spurflex_sweep_recording
