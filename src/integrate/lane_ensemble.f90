!> An ensemble in the lanes of the processor's vectors.
module spurflex_integrate_lane_ensemble
   use spurflex_base_kinds, only: wp, i8
   use spurflex_integrate_ensemble, only: ensemble
   use spurflex_integrate_lane_newmark, only: new_newmark_rule, advance_newmark, carry_newmark
   use spurflex_integrate_lane_rule, only: lanes, most_modes, points, abreast, lane_rule, mesh_cycle, lane_gain, lane_record, &
      point_rule, new_point_rule, new_mesh_cycle, load_rule
   use spurflex_integrate_lane_step, only: advance_lanes
   use spurflex_integrate_lane_tangents, only: carry_lane_tangents
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system, sum_of_moduli
   implicit none
   private

   public :: lane_ensemble, widen, narrow, kinds_of_steps, steps_of_motions, steps_of_tangents, steps_recorded

   !> Kinds of steps that are counted: of motions, of tangents that go with them, of motions that are recorded.
   integer, parameter :: kinds_of_steps = 3
   integer, parameter :: steps_of_motions = 1, steps_of_tangents = 2, steps_recorded = 3

   !> Points in lanes. A state holds the real parts of the modes, then the imaginary parts; a point with fewer modes than the
   !> others has zeros behind its own.
   type, extends(ensemble) :: lane_ensemble
      !> Steps done so far, in all lanes at once, by kind, and the modes of all of them together.
      integer(i8), dimension(kinds_of_steps) :: steps_done = 0, modes_done = 0
      !> By Newmark's method of average acceleration, not by collocation.
      logical :: by_newmark = .false.
      !> Steps per mesh period.
      integer :: steps = 0
      !> The latest period of each seat, if it was recorded.
      type(lane_record) :: record
      !> Coefficients of each point, of the seats, and the mesh.
      type(point_rule), allocatable, private :: rules(:)
      type(lane_rule), allocatable, private :: rule
      type(mesh_cycle), private :: pitch
      !> Derivatives over the latest period.
      type(lane_gain), private :: gain
   contains
      procedure :: load => load_points
      procedure :: seat => seat_in_lane
      procedure :: advance => advance_seats
      procedure :: advance_recorded
      procedure :: deflection_bound => bound_of_modes
   end type lane_ensemble

contains

   !> Take points.
   subroutine load_points(self, equations, modal, part, steps, members)
      !> Ensemble.
      class(lane_ensemble), intent(inout) :: self
      !> Equations of motion of each point, shape (points); all have the same mesh.
      type(equations_type), intent(in) :: equations(:)
      !> Modes of the linear parts that there are.
      type(modal_system), intent(in) :: modal(:)
      !> Which of them is that of each point, shape (points).
      integer, intent(in) :: part(:)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> Which of them will be seated, one at least; all if not given.
      integer, intent(in), optional :: members(:)

      integer, allocatable :: seated(:)
      integer :: k, i, modes

      seated = [(i, i=1, size(equations))]
      if (present(members)) seated = members
      modes = maxval(modal(part)%modes)
      self%seats = lanes
      self%size = 2*modes
      self%half_backlash = equations(1)%mesh%half_backlash
      if (.not. allocated(self%smallest)) allocate (self%smallest(lanes), self%largest(lanes), source=0.0_wp)
      if (.not. allocated(self%rule)) allocate (self%rule)
      call reserve(self, steps)
      self%steps = steps
      call new_mesh_cycle(equations(1)%mesh, steps, self%pitch)
      if (allocated(self%rules)) deallocate (self%rules)
      if (allocated(self%weight)) deallocate (self%weight)
      allocate (self%rules(size(equations)))
      allocate (self%weight(self%size, size(equations)), source=0.0_wp)
      do k = 1, size(seated)
         i = seated(k)
         if (self%by_newmark) then
            call new_newmark_rule(modal(part(i)), equations(i), steps, self%rules(i))
         else
            call new_point_rule(modal(part(i)), equations(i), steps, self%rules(i))
         end if
         self%weight(:, i) = widen(modal(part(i))%weight, modes)
      end do
      self%in_use = self%weight > 0.0_wp
      ! An empty lane follows the first point that may be seated.
      self%rule%modes = modes
      do i = 1, lanes
         call load_rule(self%rule, i, self%rules(seated(1)))
      end do
   end subroutine load_points

   !> Make room for some steps; what there is remains for fewer.
   subroutine reserve(self, steps)
      !> Ensemble.
      class(lane_ensemble), intent(inout) :: self
      !> Steps per mesh period.
      integer, intent(in) :: steps

      integer :: last

      if (allocated(self%gain%n)) then
         if (size(self%gain%n, 4) >= steps) return
         deallocate (self%gain%n, self%record%re, self%record%im, self%record%force)
      end if
      last = steps + abreast - 1
      allocate (self%gain%n(lanes, points, points, steps), self%record%re(lanes, most_modes, 0:last), &
                self%record%im(lanes, most_modes, 0:last), self%record%force(lanes, 0:last), source=0.0_wp)
   end subroutine reserve

   !> Put a point into a lane.
   subroutine seat_in_lane(self, number, point)
      !> Ensemble.
      class(lane_ensemble), intent(inout) :: self
      !> Lane, and index of the point.
      integer, intent(in) :: number, point

      call load_rule(self%rule, number, self%rules(point))
   end subroutine seat_in_lane

   !> Advance all lanes by one mesh period.
   subroutine advance_seats(self, states, tangents)
      !> Ensemble.
      class(lane_ensemble), intent(inout) :: self
      !> States at the section, shape (seats, size).
      real(wp), intent(inout), contiguous :: states(:, :)
      !> Tangents that see the same contact, shape (seats, tangents, size).
      real(wp), intent(inout), optional, contiguous :: tangents(:, :, :)

      integer :: rounds

      call count_steps(self, steps_of_motions, 1)
      if (self%by_newmark .and. present(tangents)) then
         call advance_newmark(self%rule, self%pitch, states, self%smallest, self%largest, self%gain)
         call carry_newmark(self%rule, self%steps, self%gain, size(tangents, 2), tangents)
         rounds = size(tangents, 2)
      else if (self%by_newmark) then
         call advance_newmark(self%rule, self%pitch, states, self%smallest, self%largest)
      else if (.not. present(tangents)) then
         call advance_lanes(self%rule, self%pitch, states, self%smallest, self%largest)
      else
         call advance_lanes(self%rule, self%pitch, states, self%smallest, self%largest, self%gain)
         call carry_lane_tangents(self%rule, self%steps, self%gain, size(tangents, 2), tangents, rounds)
      end if
      if (present(tangents)) call count_steps(self, steps_of_tangents, rounds)
   end subroutine advance_seats

   !> Count the steps of a mesh period.
   pure subroutine count_steps(self, kind, rounds)
      !> Ensemble.
      class(lane_ensemble), intent(inout) :: self
      !> `steps_...`, and how often the lanes took them.
      integer, intent(in) :: kind, rounds

      integer(i8) :: steps

      steps = int(self%steps, i8)*rounds
      self%steps_done(kind) = self%steps_done(kind) + steps
      self%modes_done(kind) = self%modes_done(kind) + steps*(self%size/2)
   end subroutine count_steps

   !> Advance all lanes by one mesh period and record it.
   subroutine advance_recorded(self, states)
      !> Ensemble.
      class(lane_ensemble), intent(inout) :: self
      !> States at the section, shape (seats, size).
      real(wp), intent(inout), contiguous :: states(:, :)

      call count_steps(self, steps_recorded, 1)
      if (self%by_newmark) then
         call advance_newmark(self%rule, self%pitch, states, self%smallest, self%largest, record=self%record)
      else
         call advance_lanes(self%rule, self%pitch, states, self%smallest, self%largest, record=self%record)
      end if
   end subroutine advance_recorded

   !> Bound of what a difference of states does to the mesh deflection.
   pure function bound_of_modes(self, difference) result(bound)
      !> Ensemble.
      class(lane_ensemble), intent(in) :: self
      !> Difference of two states, shape (size).
      real(wp), intent(in) :: difference(:)
      !> Sum of the moduli of its modes [m].
      real(wp) :: bound

      bound = sum_of_moduli(difference(:self%size))
   end function bound_of_modes

   !> A state with room for more modes.
   pure function widen(state, modes) result(wide)
      !> Real parts, then imaginary parts, of its own modes.
      real(wp), intent(in) :: state(:)
      !> Modes there is room for.
      integer, intent(in) :: modes
      !> The same with zeros behind, shape (2 modes).
      real(wp) :: wide(2*modes)

      integer :: m

      m = size(state)/2
      wide = 0.0_wp
      wide(:m) = state(:m)
      wide(modes + 1:modes + m) = state(m + 1:)
   end function widen

   !> A state without the zeros behind.
   pure function narrow(wide, modes) result(state)
      !> Real parts, then imaginary parts, with zeros behind.
      real(wp), intent(in) :: wide(:)
      !> Its own modes.
      integer, intent(in) :: modes
      !> Real parts, then imaginary parts, of its own modes, shape (2 modes).
      real(wp) :: state(2*modes)

      state(:modes) = wide(:modes)
      state(modes + 1:) = wide(size(wide)/2 + 1:size(wide)/2 + modes)
   end function narrow

end module spurflex_integrate_lane_ensemble
