!> Stable periodic motions with their shortest period: what a transient can settle on.
module spurflex_steady_stability
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_period_map, only: period_map
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_shooting, only: periodic_orbit, find_orbit, floquet_multipliers
   implicit none
   private

   public :: find_stable_orbit

   !> Distance of the sections of a motion, beside its size, that is none.
   real(wp), parameter :: same_section = 1.0e-6_wp

contains

   !> Find a stable periodic motion near a state.
   subroutine find_stable_orbit(map, start, periods, scale, visitor, orbit, magnitude, spent, found, only_affine)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> State near the motion, shape (size).
      real(wp), intent(in) :: start(:)
      !> Mesh periods after which the motion repeats; it may repeat sooner.
      integer, intent(in) :: periods
      !> Size of the motion [m].
      real(wp), intent(in) :: scale
      !> Let in between the iterations.
      class(attendant), intent(inout) :: visitor
      !> The motion, with its shortest period.
      type(periodic_orbit), intent(out) :: orbit
      !> Largest modulus of its Floquet multipliers.
      real(wp), intent(out) :: magnitude
      !> Mesh periods integrated, counted up.
      integer, intent(inout) :: spent
      !> There is one, and it is stable.
      logical, intent(out) :: found
      !> Give up at once where contact is lost.
      logical, intent(in), optional :: only_affine

      complex(wp), allocatable :: multipliers(:)
      type(error_type), allocatable :: error

      magnitude = 0.0_wp
      call find_orbit(map, start, periods, scale, visitor, orbit, found, only_affine)
      spent = spent + orbit%integrated
      if (.not. found) return
      call reduce_period(map, visitor, spent, orbit)
      call floquet_multipliers(orbit%monodromy, multipliers, error)
      found = .not. allocated(error)
      if (.not. found) return
      magnitude = maxval(abs(multipliers))
      found = magnitude < 1.0_wp
   end subroutine find_stable_orbit

   !> Take the shortest period of a motion that was found with a multiple of it.
   subroutine reduce_period(map, visitor, spent, orbit)
      !> Period map at an operating point.
      class(period_map), intent(inout) :: map
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> Mesh periods spent on Newton's method, counted up.
      integer, intent(inout) :: spent
      !> The motion.
      type(periodic_orbit), intent(inout) :: orbit

      type(periodic_orbit) :: shorter
      real(wp) :: moving(size(orbit%state)), scale
      integer :: k
      logical :: found

      moving = orbit%state
      scale = max(weighted_norm(map%weight, orbit%state), map%half_backlash)
      do k = 1, orbit%periods/2
         call map%advance(moving)
         spent = spent + 1
         if (mod(orbit%periods, k) /= 0) cycle
         if (weighted_norm(map%weight, moving - orbit%state) > same_section*scale) cycle
         call find_orbit(map, orbit%state, k, scale, visitor, shorter, found)
         spent = spent + shorter%integrated
         if (found) orbit = shorter
         if (found) return
      end do
   end subroutine reduce_period

end module spurflex_steady_stability
