!> Periodic motions by Newton's method on the map over n mesh periods, and their Floquet multipliers.
!>
!> The monodromy comes from tangents that are carried along and see the same contact. While the contact pattern does not
!> change the map is affine and one iteration is exact.
module spurflex_steady_shooting
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_external_lapack, only: eigenvalues, solve_real
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_sections, only: weighted_norm
   implicit none
   private

   public :: periodic_orbit, find_orbit, floquet_multipliers, advance_periods, contact_is_kept

   !> Newton iterations at most; an affine map needs one, a change of the contact pattern a few more.
   integer, parameter :: most_iterations = 12

   !> Newton has converged when its step is this small beside the motion: near round-off of the map.
   real(wp), parameter :: converged_step = 1.0e-11_wp

   !> A Newton step this small is accepted where round-off lets it shrink no further.
   real(wp), parameter :: stagnant_step = 1.0e-8_wp

   !> Iterations after which the step must shrink by this factor each, or Newton's method is going nowhere.
   integer, parameter :: free_iterations = 5
   real(wp), parameter :: least_shrinkage = 0.5_wp

   !> A step this many times the size of the motion leads away from it.
   real(wp), parameter :: runaway = 1.0e3_wp

   !> A periodic motion.
   type :: periodic_orbit
      !> Mesh periods after which it repeats.
      integer :: periods = 0
      !> State at the section, shape (size).
      real(wp), allocatable :: state(:)
      !> Derivative of the map over its period, shape (size, size).
      real(wp), allocatable :: monodromy(:, :)
      !> Weighted length of the last Newton step [m].
      real(wp) :: last_step = 0.0_wp
      !> Extremes of the mesh deflection over its period [m].
      real(wp) :: smallest = 0.0_wp, largest = 0.0_wp
      !> Mesh periods integrated to find it.
      integer :: integrated = 0
   end type periodic_orbit

contains

   !> Advance a state, and tangents with it, by some mesh periods.
   subroutine advance_periods(map, periods, state, tangents, smallest, largest)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> Mesh periods.
      integer, intent(in) :: periods
      !> State at the section, shape (size).
      real(wp), intent(inout), contiguous :: state(:)
      !> Tangents, one in a row, shape (tangents, size).
      real(wp), intent(inout), optional, contiguous :: tangents(:, :)
      !> Extremes of the mesh deflection [m].
      real(wp), intent(out), optional :: smallest, largest

      real(wp) :: low, high
      integer :: k

      low = huge(1.0_wp)
      high = -huge(1.0_wp)
      do k = 1, periods
         call map%advance(state, tangents)
         low = min(low, map%smallest_deflection)
         high = max(high, map%largest_deflection)
      end do
      if (present(smallest)) smallest = low
      if (present(largest)) largest = high
   end subroutine advance_periods

   !> Find a periodic motion near a state.
   subroutine find_orbit(map, start, periods, scale, visitor, orbit, found, only_affine)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> State near the motion, shape (size).
      real(wp), intent(in) :: start(:)
      !> Mesh periods after which the motion repeats.
      integer, intent(in) :: periods
      !> Size of the motion [m].
      real(wp), intent(in) :: scale
      !> Let in between the iterations.
      class(attendant), intent(inout) :: visitor
      !> The motion.
      type(periodic_orbit), intent(out) :: orbit
      !> There is one.
      logical, intent(out) :: found
      !> Give up at once where contact is lost.
      logical, intent(in), optional :: only_affine

      type(error_type), allocatable :: error
      real(wp) :: end_state(size(start)), matrix(size(start), size(start)), step(size(start))
      real(wp) :: previous, length
      integer :: iteration, i
      logical :: was_kept

      found = .false.
      allocate (orbit%state(size(start)), source=start)
      allocate (orbit%monodromy(size(start), size(start)), source=0.0_wp)
      orbit%periods = periods
      length = huge(1.0_wp)
      do iteration = 1, most_iterations
         matrix = 0.0_wp
         do i = 1, size(start)
            matrix(i, i) = 1.0_wp
         end do
         end_state = orbit%state
         call advance_periods(map, periods, end_state, matrix, orbit%smallest, orbit%largest)
         orbit%integrated = orbit%integrated + periods
         was_kept = contact_is_kept(map, orbit)
         if (present(only_affine)) then
            if (only_affine .and. .not. was_kept) return
         end if
         ! Row i of the tangents is what a unit of component i becomes: the monodromy is their transpose.
         orbit%monodromy = transpose(matrix)
         matrix = -orbit%monodromy
         do i = 1, size(start)
            matrix(i, i) = matrix(i, i) + 1.0_wp
         end do
         step = end_state - orbit%state
         call solve_real(matrix, step, error)
         if (allocated(error)) return
         previous = length
         length = weighted_norm(map%weight, step)
         if (.not. length < runaway*scale) return
         if (iteration > free_iterations .and. length > max(least_shrinkage*previous, stagnant_step*scale)) return
         orbit%state = orbit%state + step
         orbit%last_step = length
         call visitor%attend()
         found = length <= converged_step*scale .or. (length <= stagnant_step*scale .and. length > 0.25_wp*previous)
         if (.not. found .and. was_kept) then
            ! The map was affine; if it is so at the new state too, that state is the fixed point and the monodromy its own.
            end_state = orbit%state
            call advance_periods(map, periods, end_state, smallest=orbit%smallest, largest=orbit%largest)
            orbit%integrated = orbit%integrated + periods
            found = contact_is_kept(map, orbit)
         end if
         if (found) return
      end do
   end subroutine find_orbit

   !> The teeth never part on a motion: the map is affine.
   pure function contact_is_kept(map, orbit) result(kept)
      !> Period map at an operating point.
      class(period_map), intent(in) :: map
      !> The motion, with the extremes of its mesh deflection.
      type(periodic_orbit), intent(in) :: orbit
      !> Contact on one flank all the time.
      logical :: kept

      kept = orbit%smallest >= map%half_backlash .or. orbit%largest <= -map%half_backlash
   end function contact_is_kept

   !> Floquet multipliers: eigenvalues of the monodromy.
   subroutine floquet_multipliers(monodromy, multipliers, error)
      !> Derivative of the map over the period of the motion, shape (size, size).
      real(wp), intent(in) :: monodromy(:, :)
      !> The multipliers, shape (size).
      complex(wp), allocatable, intent(out) :: multipliers(:)
      !> Set where the eigenvalues do not converge.
      type(error_type), allocatable, intent(out) :: error

      call eigenvalues(monodromy, multipliers, error)
   end subroutine floquet_multipliers

end module spurflex_steady_shooting
