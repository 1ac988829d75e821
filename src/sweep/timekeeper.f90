!> One rank's time: how long it was busy with how many points, and whether it may begin another piece before the run must end.
!>
!> A run ends early when SIGUSR1 comes, when its stop file appears, or when the longest piece seen on any rank would not be done
!> within the wall-clock limit of the deck; the first piece is begun whatever the limit, so that no run is in vain. It also ends
!> early when somebody takes its result file away.
module spurflex_sweep_timekeeper
   use mpi_f08, only: MPI_Comm, MPI_DOUBLE_PRECISION, MPI_LOGICAL, MPI_LOR, mpi_allreduce, mpi_comm_rank, mpi_comm_size, mpi_gather
   use spurflex_base_clock, only: steady_seconds
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text, fixed_text
   use spurflex_external_file_watch, only: file_watch
   use spurflex_external_signals, only: drain_is_asked_for
   use spurflex_io_case, only: case_type
   implicit none
   private

   public :: timekeeper, new_timekeeper, load_text, describe_ends, stop_file, another_stopped

   !> Reason of a rank that a signal came to.
   character(len=*), parameter :: by_signal = 'by SIGUSR1'
   !> Reason of a rank that only knows that another one stopped.
   character(len=*), parameter :: another_stopped = 'as another rank was asked to stop'
   !> Added to the name of the result file: the name of the stop file.
   character(len=*), parameter :: stop_ending = '.stop'
   !> Seconds between two looks at the stop file and the result file.
   real(wp), parameter :: look_interval = 0.25_wp
   !> Time kept free of pieces before the limit: this many times the longest piece, for the next may be longer ...
   real(wp), parameter :: reserve_factor = 1.2_wp
   !> ... and the time to close the file and leave MPI [s].
   real(wp), parameter :: reserve_to_close = 1.0_wp
   real(wp), parameter :: seconds_per_minute = 60.0_wp
   !> Up to this many ranks the load of each is listed.
   integer, parameter :: most_listed = 16

   !> One rank's time.
   type :: timekeeper
      !> Why no further piece may begin; empty as long as one may.
      character(len=:), allocatable :: reason
      !> What stands at the path of the result file; rank 0 only.
      type(file_watch) :: file
      !> Points done.
      integer :: points = 0
      !> Longest piece of any rank, as far as is known here [s].
      real(wp) :: longest = 0.0_wp
      !> The piece that was done last [s].
      real(wp) :: latest = 0.0_wp
      !> Moment the piece in hand began, negative without one; moment of the next look [s].
      real(wp), private :: begun = -1.0_wp, next_look = 0.0_wp
      !> Time in pieces [s].
      real(wp), private :: busy = 0.0_wp
      !> Moment by which the run must have ended [s]; the limit of the deck [s], 0 for none.
      real(wp), private :: deadline = huge(1.0_wp), limit = 0.0_wp
      !> This rank looks at files; path of the stop file.
      logical, private :: looks = .false.
      character(len=:), allocatable, private :: stop_path
   contains
      !> A piece begins.
      procedure :: begin_piece
      !> The piece in hand, if any, is done.
      procedure :: end_piece
      !> No further piece may begin.
      procedure :: must_stop
      !> Every rank knows of a signal that came to any.
      procedure :: share_signal
   end type timekeeper

contains

   !> A keeper of a rank's time for a run.
   subroutine new_timekeeper(self, case, comm, spent)
      !> The keeper.
      type(timekeeper), intent(out) :: self
      !> Case.
      type(case_type), intent(in) :: case
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Time since the start of the program [s].
      real(wp), intent(in) :: spent

      integer :: rank

      call mpi_comm_rank(comm, rank)
      self%looks = rank == 0
      self%reason = ''
      self%stop_path = stop_file(case)
      self%limit = case%sweep%wall_clock_limit
      if (self%limit > 0.0_wp) self%deadline = steady_seconds() - spent + self%limit
   end subroutine new_timekeeper

   !> Path of the file that ends a run.
   pure function stop_file(case) result(path)
      !> Case.
      type(case_type), intent(in) :: case
      !> Path.
      character(len=:), allocatable :: path

      path = case%output%file//stop_ending
   end function stop_file

   !> A piece begins.
   subroutine begin_piece(self)
      !> Keeper.
      class(timekeeper), intent(inout) :: self

      self%begun = steady_seconds()
   end subroutine begin_piece

   !> The piece in hand, if any, is done.
   subroutine end_piece(self)
      !> Keeper.
      class(timekeeper), intent(inout) :: self

      real(wp) :: seconds

      if (self%begun < 0.0_wp) return
      seconds = steady_seconds() - self%begun
      self%begun = -1.0_wp
      self%latest = seconds
      self%busy = self%busy + seconds
      self%longest = max(self%longest, seconds)
   end subroutine end_piece

   !> No further piece may begin, and `reason` tells why.
   function must_stop(self) result(stops)
      !> Keeper.
      class(timekeeper), intent(inout) :: self
      !> None may.
      logical :: stops

      real(wp) :: now
      logical :: exists

      stops = len(self%reason) > 0
      if (stops) return
      now = steady_seconds()
      if (drain_is_asked_for()) then
         self%reason = by_signal
      else if (self%longest > 0.0_wp .and. now + reserve_factor*self%longest + reserve_to_close > self%deadline) then
         self%reason = 'by the wall-clock limit of '//limit_text(self%limit)
      else if (self%looks .and. now >= self%next_look) then
         self%next_look = now + look_interval
         inquire (file=self%stop_path, exist=exists)
         if (exists) self%reason = "by the stop file '"//self%stop_path//"'"
         if (.not. self%file%in_place()) self%reason = 'because the result file is gone'
      end if
      stops = len(self%reason) > 0
   end function must_stop

   !> Every rank knows of a signal that came to any: to the others it may be on its way still. All ranks call this together.
   subroutine share_signal(self, comm)
      !> Keeper.
      class(timekeeper), intent(inout) :: self
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm

      logical :: mine, anybodys

      mine = drain_is_asked_for()
      call mpi_allreduce(mine, anybodys, 1, MPI_LOGICAL, MPI_LOR, comm)
      if (anybodys .and. (len(self%reason) == 0 .or. self%reason == another_stopped)) self%reason = by_signal
   end subroutine share_signal

   !> A limit in words.
   pure function limit_text(limit) result(text)
      !> The limit [s].
      real(wp), intent(in) :: limit
      !> Such as `240.0 min`.
      character(len=:), allocatable :: text

      text = to_text(limit/seconds_per_minute)//' min'
   end function limit_text

   !> What ends a run early, for people.
   pure function describe_ends(case) result(text)
      !> Case.
      type(case_type), intent(in) :: case
      !> A line.
      character(len=:), allocatable :: text

      text = "ends early, to go on later: at SIGUSR1, or when '"//stop_file(case)//"' appears"
      if (case%sweep%wall_clock_limit > 0.0_wp) text = text//', or before '//limit_text(case%sweep%wall_clock_limit)
   end function describe_ends

   !> How the work was spread over the ranks. All ranks call this together.
   subroutine load_text(self, comm, window, text)
      !> Keeper.
      type(timekeeper), intent(in) :: self
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Time during which there was work [s].
      real(wp), intent(in) :: window
      !> One or more lines on rank 0, empty elsewhere.
      character(len=:), allocatable, intent(out) :: text

      real(wp), allocatable :: all_ranks(:, :)
      real(wp) :: mine(2)
      integer :: rank, ranks, i

      call mpi_comm_rank(comm, rank)
      call mpi_comm_size(comm, ranks)
      mine = [real(self%points, wp), self%busy]
      allocate (all_ranks(size(mine), ranks))
      call mpi_gather(mine, size(mine), MPI_DOUBLE_PRECISION, all_ranks, size(mine), MPI_DOUBLE_PRECISION, 0, comm)
      text = ''
      if (rank /= 0) return
      associate (points => all_ranks(1, :), busy => all_ranks(2, :))
         text = 'load of '//to_text(ranks)//' ranks, least, mean, most: points '//spread_text(points)//'; busy ' &
                //spread_text(busy)//' s; efficiency '// &
                fixed_text(100.0_wp*sum(busy)/max(real(ranks, wp)*window, tiny(window)), 1)//' %'
         if (ranks == 1 .or. ranks > most_listed) return
         do i = 1, ranks
            text = text//new_line('a')//'  rank '//to_text(i - 1)//': '//to_text(nint(points(i)))//' points, busy ' &
                   //fixed_text(busy(i), 2)//' s'
         end do
      end associate
   end subroutine load_text

   !> Least, mean and most of some numbers.
   pure function spread_text(numbers) result(text)
      !> The numbers, at least one.
      real(wp), intent(in) :: numbers(:)
      !> The three numbers.
      character(len=:), allocatable :: text

      text = fixed_text(minval(numbers), 1)//', '//fixed_text(sum(numbers)/real(size(numbers), wp), 1)//', ' &
             //fixed_text(maxval(numbers), 1)
   end function spread_text

end module spurflex_sweep_timekeeper
