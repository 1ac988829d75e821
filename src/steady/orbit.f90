!> Periodic motions, with what Newton's method leaves beside their state: monodromy and contact.
module spurflex_steady_orbit
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_external_lapack, only: eigenvalues
   implicit none
   private

   public :: periodic_orbit, move_orbit, contact_is_kept, floquet_multipliers

   !> A periodic motion.
   type :: periodic_orbit
      !> Mesh periods after which it repeats.
      integer :: periods = 0
      !> State at the section, shape (size).
      real(wp), allocatable :: state(:)
      !> Derivative of the map over its period, shape (size, size).
      real(wp), allocatable :: monodromy(:, :)
      !> The monodromy is one that was given, of a motion nearby.
      logical :: given = .false.
      !> Weighted length of the last Newton step [m].
      real(wp) :: last_step = 0.0_wp
      !> Extremes of the mesh deflection over its period [m].
      real(wp) :: smallest = 0.0_wp, largest = 0.0_wp
      !> Mesh periods integrated to find it.
      integer :: integrated = 0
   end type periodic_orbit

contains

   !> Move a motion without copying its matrix.
   pure subroutine move_orbit(from, to)
      !> The motion; none afterwards.
      type(periodic_orbit), intent(inout) :: from
      !> Where to.
      type(periodic_orbit), intent(inout) :: to

      to%periods = from%periods
      to%given = from%given
      to%last_step = from%last_step
      to%smallest = from%smallest
      to%largest = from%largest
      to%integrated = from%integrated
      call move_alloc(from%state, to%state)
      call move_alloc(from%monodromy, to%monodromy)
      from%periods = 0
   end subroutine move_orbit

   !> The teeth never part on a motion: the map is affine.
   pure function contact_is_kept(half_backlash, orbit) result(kept)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> The motion, with the extremes of its mesh deflection.
      type(periodic_orbit), intent(in) :: orbit
      !> Contact on one flank all the time.
      logical :: kept

      kept = orbit%smallest >= half_backlash .or. orbit%largest <= -half_backlash
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

end module spurflex_steady_orbit
