!> What the program says while it runs: one logger, lines to standard output, from rank 0 only.
module spurflex_io_log
   use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
   use spurflex_base_clock, only: steady_seconds
   use spurflex_base_kinds, only: wp, i8
   use spurflex_base_text, only: to_text, fixed_text
   implicit none
   private

   public :: logger, new_logger

   !> Seconds between progress lines.
   real(wp), parameter :: progress_interval = 5.0_wp
   !> A phase shorter than this says nothing of its estimated time [s].
   real(wp), parameter :: shortest_judged = 1.0_wp

   !> Where lines go and when the next progress line is due.
   type :: logger
      private
      !> This logger writes.
      logical :: active = .false.
      !> Moment of the start [s].
      real(wp) :: start = 0.0_wp
      !> Elapsed seconds at the last progress line and at the start of the phase.
      real(wp) :: last = 0.0_wp, phase_start = 0.0_wp
      !> When half of the points of the phase were done, and the time that then seemed to be left [s]; negative before.
      real(wp) :: half = -1.0_wp, estimate = -1.0_wp
   contains
      !> Say something.
      procedure :: say
      !> Say what is wrong, on standard error.
      procedure :: complain
      !> Begin a phase of work.
      procedure :: begin
      !> Say how far the phase is, if it is time to.
      procedure :: progress
      !> Whether it would do anything.
      procedure :: is_due
      !> End a phase of work.
      procedure :: finish
      !> Seconds since the logger was made.
      procedure :: elapsed
   end type logger

contains

   !> A logger that starts its clock now.
   function new_logger(active) result(self)
      !> It writes; false on every rank but one.
      logical, intent(in) :: active
      !> The logger.
      type(logger) :: self

      self%active = active
      self%start = steady_seconds()
   end function new_logger

   !> Seconds since the logger was made.
   function elapsed(self) result(seconds)
      !> Logger.
      class(logger), intent(in) :: self
      !> Seconds.
      real(wp) :: seconds

      seconds = steady_seconds() - self%start
   end function elapsed

   !> Say something.
   subroutine say(self, text)
      !> Logger.
      class(logger), intent(in) :: self
      !> One or more lines.
      character(len=*), intent(in) :: text

      if (.not. self%active) return
      write (output_unit, '(a)') text
      flush (output_unit)
   end subroutine say

   !> Say what is wrong, on standard error, from whichever rank.
   subroutine complain(self, text)
      !> Logger.
      class(logger), intent(in) :: self
      !> One or more lines.
      character(len=*), intent(in) :: text

      if (self%start < 0.0_wp) return
      write (error_unit, '(a)') text
      flush (error_unit)
   end subroutine complain

   !> Begin a phase of work.
   subroutine begin(self, text)
      !> Logger.
      class(logger), intent(inout) :: self
      !> What begins.
      character(len=*), intent(in) :: text

      self%phase_start = self%elapsed()
      self%last = self%phase_start
      self%half = -1.0_wp
      call self%say(text)
   end subroutine begin

   !> Whether `progress` would do anything: what it is told costs time to find.
   function is_due(self, done, total) result(due)
      !> Logger.
      class(logger), intent(in) :: self
      !> Points done, and all of them.
      integer(i8), intent(in) :: done, total
      !> It would.
      logical :: due

      due = .false.
      if (.not. self%active) return
      due = is_half(self, done, total) .or. self%elapsed() - self%last >= progress_interval
   end function is_due

   !> Half of the points are done for the first time.
   pure function is_half(self, done, total) result(half)
      !> Logger.
      class(logger), intent(in) :: self
      !> Points done, and all of them.
      integer(i8), intent(in) :: done, total
      !> They are.
      logical :: half

      half = self%half < 0.0_wp .and. 2_i8*done >= total
   end function is_half

   !> Say how far the phase is, if the last time is long enough ago.
   subroutine progress(self, done, total, remaining, remark)
      !> Logger.
      class(logger), intent(inout) :: self
      !> Points done and points in all.
      integer(i8), intent(in) :: done, total
      !> Time that the rest will take [s]; negative if nobody knows yet.
      real(wp), intent(in) :: remaining
      !> What came out so far.
      character(len=*), intent(in) :: remark

      real(wp) :: now
      character(len=:), allocatable :: left

      if (.not. self%is_due(done, total)) return
      now = self%elapsed()
      if (is_half(self, done, total)) then
         self%half = now
         self%estimate = remaining
      end if
      if (now - self%last < progress_interval) return
      self%last = now
      left = 'unknown'
      if (remaining >= 0.0_wp) left = fixed_text(remaining, 0)//' s'
      call self%say('  '//to_text(done)//' of '//to_text(total)//' points ('// &
                    fixed_text(100.0_wp*real(done, wp)/real(max(total, 1_i8), wp), 1)//' %), '//remark// &
                    '; elapsed '//fixed_text(now, 0)//' s, remaining about '//left)
   end subroutine progress

   !> End a phase of work that was not stopped: say how wrong the estimate of its time was.
   subroutine finish(self)
      !> Logger.
      class(logger), intent(in) :: self

      real(wp) :: now, taken

      now = self%elapsed()
      taken = now - self%half
      if (self%half < 0.0_wp .or. self%estimate < 0.0_wp .or. now - self%phase_start < shortest_judged .or. taken <= 0.0_wp) return
      call self%say('remaining time as estimated at half of the points: '//fixed_text(self%estimate, 1)//' s; it took ' &
                    //fixed_text(taken, 1)//' s (error '//to_text(nint(100.0_wp*(self%estimate - taken)/taken))//' %)')
   end subroutine finish

end module spurflex_io_log
