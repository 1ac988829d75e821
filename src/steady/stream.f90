!> Where points come from and where their steady motions go.
!>
!> The solver asks a stream for the next point whenever a lane is free and hands back what it finds; it knows neither
!> the grid nor the ranks. The sweep extends this type.
module spurflex_steady_stream
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lanes, only: trajectory_type
   use spurflex_model_equations, only: equations_type
   use spurflex_steady_outcome, only: steady_outcome
   implicit none
   private

   public :: point_stream, point_job

   !> A point to be solved.
   type :: point_job
      !> Equations of motion.
      type(equations_type) :: equations
      !> Deviation from the static equilibrium at the start, shape (n).
      real(wp), allocatable :: position(:)
      !> Its rate, shape (n).
      real(wp), allocatable :: velocity(:)
   end type point_job

   !> Source of points and sink of their steady motions.
   type, abstract :: point_stream
   contains
      !> Hand out a point for a free lane.
      procedure(next_interface), deferred :: next
      !> See one measured period of a lane.
      procedure(observe_interface), deferred :: observe
      !> Take the outcome of a lane's point.
      procedure(deliver_interface), deferred :: deliver
      !> Do what has to be done now and then, such as answering other ranks.
      procedure(poll_interface), deferred :: poll
   end type point_stream

   abstract interface
      !> Hand out a point for a free lane.
      subroutine next_interface(self, lane, may_wait, job, available, error)
         import :: point_stream, point_job, error_type
         !> Stream.
         class(point_stream), intent(inout) :: self
         !> The free lane.
         integer, intent(in) :: lane
         !> No lane is busy: wait until there is a point or the stream has ended.
         logical, intent(in) :: may_wait
         !> The point.
         type(point_job), intent(inout) :: job
         !> There is a point; where not, ask again later, or, with `may_wait`, the stream has ended.
         logical, intent(out) :: available
         !> Set where the stream fails.
         type(error_type), allocatable, intent(out) :: error
      end subroutine next_interface

      !> See one measured period of a lane.
      subroutine observe_interface(self, lane, trajectory)
         import :: point_stream, trajectory_type
         !> Stream.
         class(point_stream), intent(inout) :: self
         !> The lane.
         integer, intent(in) :: lane
         !> One mesh period of every lane.
         type(trajectory_type), intent(in) :: trajectory
      end subroutine observe_interface

      !> Take the outcome of a lane's point; the lane is free afterwards.
      subroutine deliver_interface(self, lane, outcome, error)
         import :: point_stream, steady_outcome, error_type
         !> Stream.
         class(point_stream), intent(inout) :: self
         !> The lane.
         integer, intent(in) :: lane
         !> How the search ended.
         type(steady_outcome), intent(in) :: outcome
         !> Set where the outcome cannot be kept.
         type(error_type), allocatable, intent(out) :: error
      end subroutine deliver_interface

      !> Do what has to be done now and then.
      subroutine poll_interface(self, error)
         import :: point_stream, error_type
         !> Stream.
         class(point_stream), intent(inout) :: self
         !> Set where that fails.
         type(error_type), allocatable, intent(out) :: error
      end subroutine poll_interface
   end interface

end module spurflex_steady_stream
