!> Newton's method on the map over the period of a motion: its steps, and when it has converged or leads nowhere.
module spurflex_steady_newton
   use spurflex_base_kinds, only: wp
   use spurflex_steady_batch, only: batch, solve_batch
   use spurflex_steady_orbit, only: periodic_orbit, contact_is_kept
   use spurflex_steady_outcome, only: longest_named
   use spurflex_steady_sections, only: weighted_norm
   implicit none
   private

   public :: newton_item, newton_steps, end_pass, pass_none, pass_linear, pass_near, pass_look, converged_step

   !> Newton iterations at most; an affine map needs one, a change of the contact pattern a few more.
   integer, parameter :: most_iterations = 12

   !> Newton has converged when what is left is this small beside the motion: its latest step, or, where the steps shrink fast,
   !> what the next one would be if they went on shrinking by the same factor.
   real(wp), parameter :: converged_step = 1.0e-9_wp

   !> Steps that shrink by this factor or more shrink fast, and one this small beside the motion is near enough to trust in it.
   real(wp), parameter :: fast_shrinkage = 1.0e-2_wp, trusted_step = 1.0e-5_wp

   !> A Newton step this small is accepted where round-off lets it shrink no further.
   real(wp), parameter :: stagnant_step = 1.0e-8_wp

   !> Iterations after which the step must shrink by a factor each, or Newton's method is going nowhere: for motions that take
   !> one mesh period, some, and many. The longer they are, the dearer an iteration and the more often a motion that is not
   !> periodic comes back near to where it was, but nothing is there.
   integer, parameter :: free_iterations = 5, free_some = 3, free_long = 2

   !> Factor by which it must shrink.
   real(wp), parameter :: least_shrinkage = 0.5_wp

   !> A step this many times the size of the motion leads away from it.
   real(wp), parameter :: runaway = 1.0e3_wp

   !> Each step with a monodromy that is only near must shrink by this factor, or the true one is taken.
   real(wp), parameter :: near_shrinkage = 0.1_wp

   !> A step this small beside the motion leaves the monodromy near enough for the next one.
   real(wp), parameter :: near_step = 1.0e-3_wp

   !> What a motion waits for: nothing, it is found or given up; to be advanced with tangents; without them because the monodromy
   !> is near enough; a look at the contact of what should be the motion; a look whether tangents are worth while.
   integer, parameter :: pass_none = 0, pass_linear = 1, pass_near = 2, pass_check = 3, pass_look = 4

   !> Newton's method on one motion.
   type :: newton_item
      !> `pass_...`, mesh periods done in this pass, iterations done.
      integer :: pass = pass_linear, done = 0, iteration = 0
      !> Weighted length of the latest step [m].
      real(wp) :: length = huge(1.0_wp)
      !> Extremes of the mesh deflection in this pass [m].
      real(wp) :: low = 0.0_wp, high = 0.0_wp
   end type newton_item

contains

   !> A period of the motion has passed: take a Newton step, and decide whether the motion is found or given up.
   subroutine end_pass(weight, half_backlash, scale, step, only_affine, roughly, near_enough, item, orbit, found)
      !> Weights of the states, shape (size).
      real(wp), intent(in) :: weight(:)
      !> Half of the backlash [m].
      real(wp), intent(in) :: half_backlash
      !> Size of the motion [m].
      real(wp), intent(in) :: scale
      !> Newton's step, shape (size).
      real(wp), intent(in) :: step(:)
      !> Give up where contact is lost.
      logical, intent(in) :: only_affine
      !> The monodromy may be that of a state nearby.
      logical, intent(in) :: roughly
      !> What may be left of the distance to the motion, beside its size.
      real(wp), intent(in) :: near_enough
      !> Newton's method; it waits for nothing more where the motion is found or given up.
      type(newton_item), intent(inout) :: item
      !> The motion.
      type(periodic_orbit), intent(inout) :: orbit
      !> It is found.
      logical, intent(inout) :: found

      real(wp) :: previous
      integer :: pass, free
      logical :: was_kept

      pass = item%pass
      item%pass = pass_none
      orbit%integrated = orbit%integrated + orbit%periods
      orbit%smallest = item%low
      orbit%largest = item%high
      was_kept = contact_is_kept(half_backlash, orbit)
      if (only_affine .and. .not. was_kept) return
      if (pass == pass_check .or. pass == pass_look) then
         found = was_kept .and. pass == pass_check
         if (.not. found) item%pass = pass_linear
         return
      end if
      previous = item%length
      item%length = weighted_norm(weight, step)
      if (.not. item%length < runaway*scale) return
      if (pass == pass_near .and. item%length > near_shrinkage*previous) then
         ! The monodromy that was given is not near enough.
         item%length = huge(1.0_wp)
         item%pass = pass_linear
         return
      end if
      item%iteration = item%iteration + 1
      free = free_long
      if (orbit%periods <= longest_named) free = merge(free_iterations, free_some, orbit%periods == 1)
      if (item%iteration > free .and. item%length > max(least_shrinkage*previous, stagnant_step*scale)) return
      orbit%state = orbit%state + step
      orbit%last_step = item%length
      found = item%length <= near_enough*scale .or. (item%length <= stagnant_step*scale .and. item%length > 0.25_wp*previous)
      if (previous < huge(1.0_wp) .and. item%length <= min(trusted_step*scale, fast_shrinkage*previous)) then
         found = found .or. item%length*(item%length/previous) <= near_enough*scale
      end if
      ! The next step with a monodromy that is near would have to be smaller by this factor; the first one is trusted to lead there.
      if (pass == pass_near) found = found .or. near_shrinkage*item%length <= near_enough*scale
      if (found .and. pass == pass_near .and. was_kept .and. .not. orbit%given) then
         ! The monodromy may be that of a state that loses contact: here, where the map is affine, it can be had exactly.
         found = .false.
         item%length = huge(1.0_wp)
         item%pass = pass_linear
         return
      end if
      if (found .or. item%iteration == most_iterations) return
      item%pass = pass
      if (roughly .and. pass == pass_linear .and. item%length <= near_step*scale) item%pass = pass_near
      ! Where the map was affine the new state is the fixed point, if the map is affine there too.
      if (was_kept .and. item%pass == pass_linear) item%pass = pass_check
   end subroutine end_pass

   !> Newton's steps towards the fixed points, in the seats that have come to the end of a pass.
   subroutine newton_steps(n, seated, ends, items, orbits, states)
      !> Length of a state.
      integer, intent(in) :: n
      !> Which of the motions is in each seat, shape (seats).
      integer, intent(in) :: seated(:)
      !> Its pass has come to its end, shape (seats).
      logical, intent(in) :: ends(:)
      !> Newton's method on each motion.
      type(newton_item), intent(in) :: items(:)
      !> The motions, with their states and monodromies.
      type(periodic_orbit), intent(in) :: orbits(:)
      !> Where the pass led to before, the step after; not finite where a multiplier is one. Shape (seats, size).
      real(wp), intent(inout) :: states(:, :)

      real(wp) :: matrix(batch, n, n), right(batch, n)
      logical :: steps(size(seated))
      integer :: k, i, first, last

      do k = 1, size(seated)
         steps(k) = ends(k)
         if (ends(k)) steps(k) = items(seated(k))%pass == pass_linear .or. items(seated(k))%pass == pass_near
      end do
      do first = 1, size(seated), batch
         last = min(first + batch - 1, size(seated))
         if (.not. any(steps(first:last))) cycle
         matrix = 0.0_wp
         right = 0.0_wp
         do i = 1, n
            matrix(:, i, i) = 1.0_wp
         end do
         do k = first, last
            if (.not. steps(k)) cycle
            associate (orbit => orbits(seated(k)))
               matrix(k - first + 1, :, :) = matrix(k - first + 1, :, :) - orbit%monodromy
               right(k - first + 1, :) = states(k, :) - orbit%state
            end associate
         end do
         call solve_batch(n, matrix, right)
         do k = first, last
            if (steps(k)) states(k, :) = right(k - first + 1, :)
         end do
      end do
   end subroutine newton_steps

end module spurflex_steady_newton
