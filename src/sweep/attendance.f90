!> What a rank does now and then during long work: answer other ranks, say how far the sweep is, let MPI go on.
module spurflex_sweep_attendance
   use spurflex_base_attendant, only: attendant
   use spurflex_base_clock, only: steady_seconds
   use spurflex_base_kinds, only: wp, i8
   use spurflex_base_text, only: to_text
   use spurflex_io_log, only: logger
   use spurflex_measure_response, only: status_settled, status_not_settled, status_diverged, status_inaccurate
   use spurflex_sweep_schedule, only: scheduler
   implicit none
   private

   public :: sweep_attendant, outcome_text

   !> Seconds between two looks of rank 0 at the messages: a rank that asks waits for half of it.
   real(wp), parameter :: interval = 0.2e-3_wp
   !> Seconds between two calls of MPI on the other ranks: what all ranks share goes from one to the next meanwhile.
   real(wp), parameter :: side_interval = 0.1_wp

   !> The scheduler and the logger of a rank.
   type, extends(attendant) :: sweep_attendant
      !> Hands out pieces.
      type(scheduler) :: schedule
      !> Hears of the progress.
      type(logger), pointer :: log => null()
      !> Points in all.
      integer(i8) :: points = 0_i8
      !> Time of the last look [s].
      real(wp), private :: last = 0.0_wp
   contains
      !> Answer and report, if the last time is long enough ago.
      procedure :: attend => attend_to_ranks
   end type sweep_attendant

contains

   !> Answer and report, if the last time is long enough ago.
   subroutine attend_to_ranks(self)
      !> Attendant.
      class(sweep_attendant), intent(inout) :: self

      real(wp) :: now

      now = steady_seconds()
      if (now - self%last < merge(interval, side_interval, self%schedule%hands_out())) return
      self%last = now
      call self%schedule%serve()
      if (.not. self%log%is_due(sum(int(self%schedule%total, i8)), self%points)) return
      call self%log%progress(sum(int(self%schedule%total, i8)), self%points, self%schedule%remaining(), &
                             outcome_text(self%schedule%total))
   end subroutine attend_to_ranks

   !> How many points ended how.
   pure function outcome_text(total) result(text)
      !> Points by status, shape (outcomes).
      integer, intent(in) :: total(:)
      !> Text such as `120 settled, 3 not settled`.
      character(len=:), allocatable :: text

      text = to_text(total(status_settled))//' settled, '//to_text(total(status_not_settled))//' not settled, ' &
             //to_text(total(status_diverged))//' diverged, '//to_text(total(status_inaccurate))//' inaccurate'
   end function outcome_text

end module spurflex_sweep_attendance
