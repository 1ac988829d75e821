!> What points cost: how many went which way, and the time that each part of the work took.
module spurflex_measure_effort
   use spurflex_base_kinds, only: wp, i8
   use spurflex_base_text, only: to_text, fixed_text
   use spurflex_integrate_lane_ensemble, only: kinds_of_steps, steps_of_motions, steps_of_tangents, steps_recorded
   use spurflex_integrate_lane_rule, only: lanes
   use spurflex_measure_response, only: response, contact_kept
   implicit none
   private

   public :: effort_type, ways, stages, kinds_of_steps, stage_search, stage_measure, stage_alone, stage_write

   !> Ways: no contact loss, so that one monodromy gives the motion; Newton's method on a motion with contact loss; no periodic
   !> motion, so that the transient itself gives the class; alone, by the integrator of high order or dense Newmark steps.
   integer, parameter :: ways = 4
   integer, parameter :: way_linear = 1, way_shooting = 2, way_transient = 3, way_alone = 4

   !> Stages: search for the motions in lanes, their measurement with the judge's, points alone, writing into the result file.
   integer, parameter :: stages = 4
   integer, parameter :: stage_search = 1, stage_measure = 2, stage_alone = 3, stage_write = 4

   !> Effort so far.
   type :: effort_type
      !> Points by way, seconds by stage.
      integer(i8) :: points(ways) = 0
      real(wp) :: seconds(stages) = 0.0_wp
      !> Steps by kind, in all lanes at once, and the modes of all of them together.
      integer(i8), dimension(kinds_of_steps) :: steps = 0, modes = 0
      integer(i8), private :: since = 0
   contains
      !> Begin a stage.
      procedure :: begin
      !> End it.
      procedure :: end => end_stage
      !> Count a point.
      procedure :: count_point
      !> Lines for people.
      procedure :: describe
   end type effort_type

contains

   !> Begin a stage.
   subroutine begin(self)
      !> Effort.
      class(effort_type), intent(inout) :: self

      call system_clock(self%since)
   end subroutine begin

   !> End a stage.
   subroutine end_stage(self, stage)
      !> Effort.
      class(effort_type), intent(inout) :: self
      !> `stage_...`.
      integer, intent(in) :: stage

      integer(i8) :: now, rate

      call system_clock(now, rate)
      self%seconds(stage) = self%seconds(stage) + real(now - self%since, wp)/real(rate, wp)
      self%since = now
   end subroutine end_stage

   !> Count a point.
   pure subroutine count_point(self, answer, periodic, alone)
      !> Effort.
      class(effort_type), intent(inout) :: self
      !> Its response.
      type(response), intent(in) :: answer
      !> Its motion is periodic; it was solved alone.
      logical, intent(in) :: periodic, alone

      integer :: way

      way = way_transient
      if (periodic) way = merge(way_linear, way_shooting, answer%contact == contact_kept)
      if (alone) way = way_alone
      self%points(way) = self%points(way) + 1
   end subroutine count_point

   !> Points by way, time by stage, steps by kind.
   pure function describe(self) result(text)
      !> Effort of all ranks.
      class(effort_type), intent(in) :: self
      !> Three lines.
      character(len=:), allocatable :: text

      text = 'points by path: '//to_text(self%points(way_linear))//' linear (contact kept: Fourier series, one monodromy), ' &
             //to_text(self%points(way_shooting))//' shooting, ' &
             //to_text(self%points(way_transient))//' transient (class by the exponent), ' &
             //to_text(self%points(way_alone))//' alone' &
             //new_line('a')//'time by path, all ranks: search '//fixed_text(self%seconds(stage_search), 2)//' s, measurement ' &
             //fixed_text(self%seconds(stage_measure), 2)//' s, alone '//fixed_text(self%seconds(stage_alone), 2)//' s' &
             //new_line('a')//'steps in '//to_text(lanes)//' lanes at once: '//steps_of(steps_of_motions, 'of motions')//', ' &
             //steps_of(steps_of_tangents, 'of tangents')//', '//steps_of(steps_recorded, 'recorded')

   contains

      !> Steps of a kind, and the modes that they have on average.
      pure function steps_of(kind, name) result(words)
         !> `steps_...`, and what it is called.
         integer, intent(in) :: kind
         character(len=*), intent(in) :: name
         !> The words.
         character(len=:), allocatable :: words

         words = to_text(self%steps(kind))//' '//name//' with ' &
                 //fixed_text(real(self%modes(kind), wp)/real(max(self%steps(kind), 1_i8), wp), 1)//' modes'
      end function steps_of

   end function describe

end module spurflex_measure_effort
