!> The steady motions that the starts of several points lead to, searched for in lanes: in the modes that the mesh feels, for these
!> decide which motions there are and which are stable. The other modes follow from the mesh force afterwards.
module spurflex_measure_lane_search
   use spurflex_base_attendant, only: attendant
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_lane_ensemble, only: lane_ensemble, widen
   use spurflex_integrate_options, only: solver_options
   use spurflex_measure_linear_parts, only: linear_parts
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system, to_modes
   use spurflex_model_truncation, only: complete_state, complete_monodromy
   use spurflex_steady_lyapunov, only: smooth_weight
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_outcome, only: steady_motion, status_diverged
   use spurflex_steady_search, only: find_steady_motions
   implicit none
   private

   public :: search_in_lanes

   !> Share of the tolerance below which a share in the mesh deflection is not felt: well below what the steps miss.
   real(wp), parameter :: felt_share = 0.01_wp

   !> Mesh periods over which the mean of the mesh force is taken.
   integer, parameter :: averaged_periods = 64

contains

   !> Find the steady motions.
   subroutine search_in_lanes(seekers, parts, equations, part, steps, options, positions, velocities, visitor, few, motions, &
                              orbits)
      !> The lanes, that know whether they go by Newmark's method.
      type(lane_ensemble), intent(inout) :: seekers
      !> Linear parts.
      type(linear_parts), intent(inout) :: parts
      !> Equations of motion of each point, shape (n).
      type(equations_type), intent(in) :: equations(:)
      !> Linear part of each point, shape (n).
      integer, intent(in) :: part(:)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Most periods.
      type(solver_options), intent(in) :: options
      !> Deviation from the static equilibrium and its rate at the start, shape (coordinates, n).
      real(wp), intent(in) :: positions(:, :), velocities(:, :)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> What the mesh feels of each point: an index into the truncations of the parts, shape (n).
      integer, intent(out) :: few(:)
      !> The motions, shape (n); their states are of all modes. Those that the mesh does not feel are at rest where the motion is
      !> periodic, and where the mean of the mesh force puts them where it is not.
      type(steady_motion), intent(out) :: motions(:)
      !> The orbits of those that are periodic, shape (n); the same, with monodromies that are nearly theirs.
      type(periodic_orbit), intent(out) :: orbits(:)

      type(solver_options) :: seek
      real(wp), allocatable :: starts(:, :)
      real(wp) :: forces(size(part)), least_share
      integer :: few_room, room, i

      ! Newmark's method with given steps answers with all of its modes and multipliers.
      seek = options
      seek%multipliers = options%multipliers .and. seekers%by_newmark
      do i = 1, size(part)
         least_share = merge(-1.0_wp, felt_share*options%tolerance, seekers%by_newmark)
         call parts%find_felt(part(i), equations(i)%frequency, least_share, moving_modes(parts%modal(part(i)), positions(:, i), &
                              velocities(:, i), least_share*equations(i)%mesh%half_backlash), few(i))
      end do
      call seekers%load(equations, parts%few, few, steps)
      few_room = seekers%size/2
      room = maxval(parts%modal(part)%modes)
      allocate (starts(seekers%size, size(part)))
      do i = 1, size(part)
         starts(:, i) = widen(to_modes(parts%few(few(i)), positions(:, i), velocities(:, i)), few_room)
      end do
      call find_steady_motions(seekers, starts, seek, visitor, motions, orbits)
      forces = 0.0_wp
      call average_forces(seekers, pack([(i, i=1, size(part))], motions%periods == 0 .and. motions%status /= status_diverged &
                                        .and. parts%few(few)%modes < parts%modal(part)%modes), motions, visitor, forces)
      do i = 1, size(part)
         associate (felt => parts%truncation(few(i))%felt)
            motions(i)%state = complete_state(motions(i)%state, few_room, felt, parts%modal(part(i)), forces(i), room)
            if (motions(i)%periods == 0) cycle
            orbits(i)%state = motions(i)%state
            orbits(i)%monodromy = complete_monodromy(orbits(i)%monodromy, few_room, felt, parts%modal(part(i)), &
                                                     real(orbits(i)%periods, wp)*2.0_wp*pi/equations(i)%frequency, room)
         end associate
      end do
   end subroutine search_in_lanes

   !> Modes that a start moves: the sway of a support, from rest, which the mesh force would hardly excite.
   pure function moving_modes(modal, position, velocity, least) result(moves)
      !> The linear part.
      type(modal_system), intent(in) :: modal
      !> Deviation from the static equilibrium and its rate at the start, shape (coordinates).
      real(wp), intent(in) :: position(:), velocity(:)
      !> Mesh deflection that counts [m].
      real(wp), intent(in) :: least
      !> They do, shape (modes).
      logical :: moves(modal%modes)

      real(wp) :: state(2*modal%modes), modulus(modal%modes)

      moves = .false.
      if (.not. (any(abs(position) > 0.0_wp) .or. any(abs(velocity) > 0.0_wp))) return
      state = to_modes(modal, position, velocity)
      modulus = sqrt(state(:modal%modes)**2 + state(modal%modes + 1:)**2)
      moves = modulus > least
   end function moving_modes

   !> Mean of what drives the modes, N, over some mesh periods of motions that are not periodic; weighted as that of the growth of a
   !> tangent is, for the same reason.
   subroutine average_forces(seekers, members, motions, visitor, forces)
      !> The lanes.
      type(lane_ensemble), intent(inout) :: seekers
      !> Which of the points, shape (m).
      integer, intent(in) :: members(:)
      !> The motions, shape (n).
      type(steady_motion), intent(in) :: motions(:)
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The means of those points, shape (n) [N].
      real(wp), intent(inout) :: forces(:)

      real(wp) :: states(seekers%seats, seekers%size), sums(seekers%seats), weight, weights
      integer :: first, seated, period, k

      do first = 1, size(members), seekers%seats
         seated = min(seekers%seats, size(members) - first + 1)
         states = 0.0_wp
         do k = 1, seated
            call seekers%seat(k, members(first + k - 1))
            states(k, :) = motions(members(first + k - 1))%state
         end do
         sums = 0.0_wp
         weights = 0.0_wp
         do period = 1, averaged_periods
            call seekers%advance_recorded(states)
            states(seated + 1:, :) = 0.0_wp
            weight = smooth_weight((real(period, wp) - 0.5_wp)/real(averaged_periods, wp))
            sums = sums + weight*sum(seekers%record%force(:, 1:seekers%steps), dim=2)/real(seekers%steps, wp)
            weights = weights + weight
            call visitor%attend()
         end do
         forces(members(first:first + seated - 1)) = sums(:seated)/weights
      end do
   end subroutine average_forces

end module spurflex_measure_lane_search
