!> Stable periodic motions with their shortest period: what a transient can settle on.
module spurflex_steady_stability
   use spurflex_base_attendant, only: attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_ensemble, only: ensemble
   use spurflex_steady_batch, only: batch, contracting
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit, floquet_multipliers
   use spurflex_steady_shooting, only: find_orbits
   implicit none
   private

   public :: find_stable_orbits, follow_orbits, reduce_periods, largest_multiplier

   !> Distance of the sections of a motion, beside its size, that is none.
   real(wp), parameter :: same_section = 1.0e-6_wp

contains

   !> Find stable periodic motions of several points, each near a state.
   subroutine find_stable_orbits(points, members, scale, visitor, orbits, found, only_affine, roughly, periodic)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Size of each motion, shape (n) [m].
      real(wp), intent(in) :: scale(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> A state near the motion and its period, which may be a multiple of the shortest, before; the motion with its shortest
      !> period after, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> There is one, and it is stable, shape (n).
      logical, intent(out) :: found(:)
      !> Give up at once where contact is lost.
      logical, intent(in), optional :: only_affine
      !> The monodromy may be that of a state nearby.
      logical, intent(in), optional :: roughly
      !> There is one, stable or not, shape (n).
      logical, intent(out), optional :: periodic(:)

      call find_orbits(points, members, scale, visitor, orbits, found, only_affine, roughly=roughly)
      if (present(periodic)) periodic = found
      call reduce_periods(points, members, found, visitor, orbits)
      call keep_stable(orbits, found)
   end subroutine find_stable_orbits

   !> Find stable motions again with other steps, each near where it was with those before. Newton's method begins with the
   !> monodromies of then and takes no tangents along; where it leads, one pass with tangents tells whether the motion is stable.
   subroutine follow_orbits(points, members, scale, visitor, orbits, found)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> Size of each motion, shape (n) [m].
      real(wp), intent(in) :: scale(:)
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> The stable motions with their monodromies, as they were before, as they are after, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> It is there, and it is stable, shape (n).
      logical, intent(out) :: found(:)

      type(periodic_orbit) :: near(size(orbits))
      integer :: i

      near = orbits
      call find_orbits(points, members, scale, visitor, near, found, monodromy_is_near=.true., roughly=.true.)
      do i = 1, size(orbits)
         ! Where a new monodromy was needed the steps may have led away.
         if (found(i) .and. near(i)%given) orbits(i)%state = near(i)%state
      end do
      call find_stable_orbits(points, members, scale, visitor, orbits, found)
      orbits%integrated = orbits%integrated + near%integrated
   end subroutine follow_orbits

   !> Take the shortest period of motions that were found with a multiple of it.
   subroutine reduce_periods(points, members, found, visitor, orbits)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> There is a motion, shape (n).
      logical, intent(in) :: found(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The motions, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)

      type(periodic_orbit), allocatable :: shorter(:)
      integer, allocatable :: open(:)
      real(wp) :: sizes(size(orbits))
      integer :: repeats(size(orbits)), i
      logical :: is_shorter(size(orbits))

      open = pack([(i, i=1, size(orbits))], found .and. orbits%periods > 1)
      do i = 1, size(open)
         sizes(open(i)) = max(weighted_norm(points%weight(:, members(open(i))), orbits(open(i))%state), points%half_backlash)
      end do
      repeats = 0
      do while (size(open) > 0)
         call find_repeats(points, members, open, sizes, visitor, orbits, repeats)
         open = pack(open, repeats(open) > 0)
         if (size(open) == 0) exit
         shorter = orbits(open)
         shorter%periods = repeats(open)
         call find_orbits(points, members(open), sizes(open), visitor, shorter, is_shorter(:size(open)))
         do i = 1, size(open)
            shorter(i)%integrated = orbits(open(i))%integrated + shorter(i)%integrated
            orbits(open(i))%integrated = shorter(i)%integrated
            if (is_shorter(i)) orbits(open(i)) = shorter(i)
         end do
         open = pack(open, .not. is_shorter(:size(open)))
      end do
   end subroutine reduce_periods

   !> Where motions repeat before their period is over. A seat that becomes free is taken by the next motion at once.
   subroutine find_repeats(points, members, which, sizes, visitor, orbits, repeats)
      !> The points.
      class(ensemble), intent(inout) :: points
      !> Which of them the motions are of, shape (n).
      integer, intent(in) :: members(:)
      !> Which of the motions.
      integer, intent(in) :: which(:)
      !> Their sizes, shape (n) [m].
      real(wp), intent(in) :: sizes(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The motions, shape (n).
      type(periodic_orbit), intent(inout) :: orbits(:)
      !> Mesh periods after which each is known not to repeat before; those after which it does, 0 if it does not, shape (n).
      integer, intent(inout) :: repeats(:)

      real(wp) :: states(points%seats, points%size)
      integer :: seated(points%seats), done(points%seats), next, k
      logical :: same

      states = 0.0_wp
      seated = 0
      next = 1
      do
         do k = 1, points%seats
            if (seated(k) > 0 .or. next > size(which)) cycle
            seated(k) = which(next)
            done(k) = 0
            call points%seat(k, members(seated(k)))
            states(k, :) = orbits(seated(k))%state
            next = next + 1
         end do
         if (all(seated == 0)) exit
         call points%advance(states)
         do k = 1, points%seats
            if (seated(k) > 0) then
               done(k) = done(k) + 1
               associate (p => seated(k), orbit => orbits(seated(k)))
                  orbit%integrated = orbit%integrated + 1
                  same = done(k) > repeats(p) .and. mod(orbit%periods, done(k)) == 0
                  if (same) same = weighted_norm(points%weight(:, members(p)), states(k, :) - orbit%state) &
                                   <= same_section*sizes(p)
                  if (.not. same .and. done(k) < orbit%periods/2) cycle
                  repeats(p) = merge(done(k), 0, same)
               end associate
               seated(k) = 0
            end if
            ! An empty seat is integrated with the others, always from zero, so that nothing can overflow.
            states(k, :) = 0.0_wp
         end do
         call visitor%attend()
      end do
   end subroutine find_repeats

   !> Keep the orbits whose multipliers all lie inside the unit circle.
   subroutine keep_stable(orbits, found)
      !> The orbits, shape (n).
      type(periodic_orbit), intent(in) :: orbits(:)
      !> There is one before; it is stable after, shape (n).
      logical, intent(inout) :: found(:)

      real(wp), allocatable :: matrices(:, :, :)
      logical :: stable(batch)
      integer, allocatable :: members(:)
      integer :: first, i, k, n

      members = pack([(i, i=1, size(orbits))], found)
      do first = 1, size(members), batch
         n = size(orbits(members(first))%state)
         if (.not. allocated(matrices)) allocate (matrices(batch, n, n))
         matrices = 0.0_wp
         do k = 1, min(batch, size(members) - first + 1)
            matrices(k, :, :) = orbits(members(first + k - 1))%monodromy
         end do
         call contracting(n, matrices, stable)
         do k = 1, min(batch, size(members) - first + 1)
            found(members(first + k - 1)) = stable(k)
         end do
      end do
   end subroutine keep_stable

   !> Largest modulus of the Floquet multipliers of a motion.
   function largest_multiplier(orbit) result(magnitude)
      !> The motion.
      type(periodic_orbit), intent(in) :: orbit
      !> The modulus; huge where the multipliers cannot be found.
      real(wp) :: magnitude

      complex(wp), allocatable :: multipliers(:)
      type(error_type), allocatable :: error
      integer, allocatable :: own(:)
      integer :: j

      ! What nothing drives, room for modes that the point has not, has the multiplier zero; it would change the rounding.
      own = pack([(j, j=1, size(orbit%state))], [(any(abs(orbit%monodromy(j, :)) > 0.0_wp), j=1, size(orbit%state))])
      call floquet_multipliers(orbit%monodromy(own, own), multipliers, error)
      magnitude = huge(1.0_wp)
      if (.not. allocated(error)) magnitude = maxval([0.0_wp, abs(multipliers)])
   end function largest_multiplier

end module spurflex_steady_stability
