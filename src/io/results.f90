!> The result file, which is the checkpoint too: it is complete but for the numbers from the start, every rank writes
!> the points it has finished, the status of a point last, so that a run killed at any time can be continued.
module spurflex_io_results
   use mpi_f08, only: mpi_comm_rank
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: i4, wp
   use spurflex_base_text, only: to_text
   use spurflex_io_case, only: case_type
   use spurflex_io_results_failures, only: failures_text
   use spurflex_io_results_open, only: close_results, create_results, open_results, results_file
   use spurflex_io_results_set, only: read_points, read_states, write_points
   use spurflex_io_results_support, only: is_asked_for, write_support_records => write_records
   use spurflex_measure_record, only: record_type
   use spurflex_measure_response, only: empty_response, nan, response, status_missing
   implicit none
   private

   public :: results_file, create_results, open_results, close_results
   public :: read_status, read_rigid, write_records, write_rigid, write_flexible, describe_damage, describe_failures

contains

   !> Read which points have been computed. Each rank reads for itself.
   subroutine read_status(results, rigid_status, flexible_status, error)
      !> The open file.
      type(results_file), intent(in) :: results
      !> Status on the rigid support, shape (speed), or any shape if it is not asked for.
      integer, intent(out) :: rigid_status(:)
      !> Status on the flexible support, shape (speed, stiffness), or any shape if it is not asked for.
      integer, intent(out) :: flexible_status(:, :)
      !> Set if it cannot be read.
      type(error_type), allocatable, intent(out) :: error

      integer :: rigid_states(size(rigid_status)), flexible_states(size(flexible_status))

      rigid_status = status_missing
      flexible_status = status_missing
      if (is_asked_for(results%rigid)) then
         call require(all(shape(rigid_status) == results%rigid%points%extents), error)
         if (allocated(error)) return
         call read_states(results%rigid%points, rigid_states, error)
         if (allocated(error)) return
         if (size(results%rigid%damaged) > 0) where (results%rigid%damaged) rigid_states = status_missing
         rigid_status = rigid_states
      end if
      if (is_asked_for(results%flexible)) then
         call require(all(shape(flexible_status) == results%flexible%points%extents), error)
         if (allocated(error)) return
         call read_states(results%flexible%points, flexible_states, error)
         if (allocated(error)) return
         if (size(results%flexible%damaged) > 0) where (results%flexible%damaged) flexible_states = status_missing
         flexible_status = reshape(flexible_states, shape(flexible_status))
      end if
   end subroutine read_status

   !> Read the responses on the rigid support. Each rank reads for itself.
   subroutine read_rigid(results, responses, error)
      !> The open file.
      type(results_file), intent(in) :: results
      !> The responses, shape (speed); empty responses where there are none yet.
      type(response), intent(out) :: responses(:)
      !> Set if they cannot be read.
      type(error_type), allocatable, intent(out) :: error

      integer :: i

      do i = 1, size(responses)
         responses(i) = empty_response()
      end do
      if (.not. is_asked_for(results%rigid)) return
      call require(all(shape(responses) == results%rigid%points%extents), error)
      if (allocated(error)) return
      call read_points(results%rigid%points, responses, error)
      do i = 1, size(results%rigid%damaged)
         if (results%rigid%damaged(i)) responses(i) = empty_response()
      end do
   end subroutine read_rigid

   !> Write what was recorded of points; their responses are to follow. Each rank writes for itself.
   subroutine write_records(results, first_stiffness, stiffnesses, first_speed, records, checksums, error)
      !> The open file.
      type(results_file), intent(in) :: results
      !> Index of the first support stiffness, 0 for the rigid support, and number of consecutive ones.
      integer, intent(in) :: first_stiffness, stiffnesses
      !> Index of the first speed, from 1.
      integer, intent(in) :: first_speed
      !> Records at consecutive speeds for one stiffness after the other, shape (points).
      type(record_type), intent(in) :: records(:)
      !> Their checksums, with which the responses are to be written, shape (points).
      integer(i4), intent(out) :: checksums(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error

      if (first_stiffness == 0) then
         call write_support_records(results%rigid, [first_speed], [size(records)], records, checksums, error)
      else
         call write_support_records(results%flexible, [first_speed, first_stiffness], &
                                    [size(records)/stiffnesses, stiffnesses], records, checksums, error)
      end if
   end subroutine write_records

   !> Write responses on the rigid support. Each rank writes for itself.
   subroutine write_rigid(results, first_speed, responses, error, checksums)
      !> The open file.
      type(results_file), intent(in) :: results
      !> Index of the first speed, from 1.
      integer, intent(in) :: first_speed
      !> Responses at consecutive speeds, shape (points).
      type(response), intent(in) :: responses(:)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error
      !> Checksums of what was recorded of them, shape (points); nothing was if absent.
      integer(i4), intent(in), optional :: checksums(:)

      real(wp) :: eta(3, size(responses))
      integer(i4) :: known_checksums(size(responses))

      eta = nan()
      known_checksums = 0_i4
      if (present(checksums)) known_checksums = checksums
      call require(is_asked_for(results%rigid), error)
      if (allocated(error)) return
      call write_points(results%rigid%points, [first_speed], [size(responses)], responses, eta, known_checksums, error)
   end subroutine write_rigid

   !> Write responses on the flexible support. Each rank writes for itself.
   subroutine write_flexible(results, first_stiffness, stiffnesses, first_speed, responses, eta, error, checksums)
      !> The open file.
      type(results_file), intent(in) :: results
      !> Index of the first support stiffness, from 1, and number of consecutive ones.
      integer, intent(in) :: first_stiffness, stiffnesses
      !> Index of the first speed, from 1.
      integer, intent(in) :: first_speed
      !> Responses at consecutive speeds for one stiffness after the other, shape (points).
      type(response), intent(in) :: responses(:)
      !> Change of each bearing's largest deformation by the flexible support and its error [percent], shape (3, points);
      !> not written if the rigid support is not asked for, NaN if absent.
      real(wp), intent(in), optional :: eta(:, :)
      !> Set if they cannot be written.
      type(error_type), allocatable, intent(out) :: error
      !> Checksums of what was recorded of them, shape (points); nothing was if absent.
      integer(i4), intent(in), optional :: checksums(:)

      real(wp) :: known_eta(3, size(responses))
      integer(i4) :: known_checksums(size(responses))

      known_checksums = 0_i4
      if (present(checksums)) known_checksums = checksums
      known_eta = nan()
      if (present(eta)) known_eta = eta
      call require(is_asked_for(results%flexible), error)
      if (allocated(error)) return
      call write_points(results%flexible%points, [first_speed, first_stiffness], [size(responses)/stiffnesses, stiffnesses], &
                        responses, known_eta, known_checksums, error)
   end subroutine write_flexible

   !> How many points of a support did not fit their checksum when the file was opened.
   pure function describe_damage(results, rigid) result(text)
      !> The open file.
      type(results_file), intent(in) :: results
      !> The rigid support, not the flexible one.
      logical, intent(in) :: rigid
      !> One line; empty if all did.
      character(len=:), allocatable :: text

      integer :: damaged

      if (rigid) then
         damaged = count(results%rigid%damaged)
      else
         damaged = count(results%flexible%damaged)
      end if
      text = ''
      if (damaged == 1) text = '1 point was damaged (checksum) and is computed again'
      if (damaged > 1) text = to_text(damaged)//' points were damaged (checksum) and are computed again'
   end function describe_damage

   !> How many points of the file failed and why, the first ones by name. Rank 0 reads alone.
   subroutine describe_failures(results, case, text)
      !> The open file.
      type(results_file), intent(in) :: results
      !> What is computed.
      type(case_type), intent(in) :: case
      !> One or more lines; empty if every point is settled, and on the other ranks.
      character(len=:), allocatable, intent(out) :: text

      type(error_type), allocatable :: error
      integer :: rank

      text = ''
      call mpi_comm_rank(results%comm, rank)
      if (rank /= 0) return
      call failures_text(results%rigid, results%flexible, case%sweep, text, error)
      if (allocated(error)) text = 'why points failed cannot be read: '//error%message
   end subroutine describe_failures

   !> Refuse a call that does not fit the grid.
   pure subroutine require(fits, error)
      !> The call fits.
      logical, intent(in) :: fits
      !> Set if it does not.
      type(error_type), allocatable, intent(inout) :: error

      if (.not. fits) call fatal_error(error, 'the points do not fit the grid of the result file')
   end subroutine require

end module spurflex_io_results
