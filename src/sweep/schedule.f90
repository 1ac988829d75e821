!> Which rank gets which chunk.
!>
!> Rank 0 hands out the chunks in the order of its forecast, which learns from the times of those that are done. It works too
!> and serves the others between its own periods; point-to-point messages only. Nobody asks for a chunk before the last one is
!> done: one that is kept ready by a rank at work on a dear chunk can be done by no other, and may be dear itself.
module spurflex_sweep_schedule
   use mpi_f08, only: MPI_Comm, MPI_Status, MPI_COMM_NULL, MPI_INTEGER8, MPI_ANY_SOURCE, &
      MPI_ANY_TAG, MPI_STATUS_IGNORE, mpi_comm_rank, mpi_comm_size, mpi_iprobe, mpi_probe, mpi_recv, mpi_send
   use spurflex_base_clock, only: steady_seconds
   use spurflex_base_kinds, only: i8, wp
   use spurflex_sweep_forecast, only: forecast_type, new_forecast
   use spurflex_sweep_plan, only: chunk_type
   use spurflex_sweep_timekeeper, only: timekeeper, another_stopped
   implicit none
   private

   public :: scheduler, new_scheduler, outcomes

   !> Kinds of outcome that are counted, by status: settled, not settled, diverged, inaccurate.
   integer, parameter :: outcomes = 4

   integer, parameter :: tag_request = 1, tag_last = 2, tag_assign = 3
   integer, parameter :: no_chunk = 0
   !> A request tells the points finished, the longest chunk, the chunk that was done last and its time, an answer the chunk and
   !> the longest one of all ranks.
   integer, parameter :: request_length = outcomes + 3, answer_length = 2
   integer, parameter :: longest = outcomes + 1, last = outcomes + 2, last_time = outcomes + 3
   !> How times are sent: as whole microseconds.
   real(wp), parameter :: per_second = 1.0e6_wp

   !> One rank's part in handing out chunks.
   type :: scheduler
      private
      type(MPI_Comm) :: comm = MPI_COMM_NULL
      integer :: rank = 0, ranks = 1
      !> Rank 0: what the chunks cost; moment at which the first one was handed out [s]; ranks that have ended.
      type(forecast_type) :: forecast
      real(wp) :: begun = 0.0_wp
      integer :: ended = 0
      !> The chunk in hand; the chunk that was done last, as long as rank 0 has not been told, and its time [s].
      integer :: in_hand = no_chunk, last = no_chunk
      real(wp) :: last_seconds = 0.0_wp
      !> This rank's time.
      type(timekeeper), pointer :: keeper => null()
      !> Points finished since the last message, by outcome.
      integer :: finished(outcomes) = 0
      !> Rank 0: points finished on all ranks, by outcome.
      integer, public :: total(outcomes) = 0
   contains
      !> Ask for a chunk.
      procedure :: take
      !> Count a finished point.
      procedure :: count_point
      !> Rank 0: answer the requests that have come.
      procedure :: serve
      !> Rank 0: how long the rest will take.
      procedure :: remaining
      !> Wait for all ranks to end.
      procedure :: finish
   end type scheduler

contains

   !> Begin to hand out chunks. All ranks call this together.
   subroutine new_scheduler(self, comm, chunks, keeper)
      !> The scheduler.
      type(scheduler), intent(inout) :: self
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> The chunks, the same on every rank.
      type(chunk_type), intent(in) :: chunks(:)
      !> This rank's time; stays where it is until `finish`.
      type(timekeeper), intent(inout), target :: keeper

      self%comm = comm
      self%keeper => keeper
      call mpi_comm_rank(comm, self%rank)
      call mpi_comm_size(comm, self%ranks)
      if (self%rank == 0) self%forecast = new_forecast(chunks)
      self%begun = steady_seconds()
      self%ended = 0
      self%in_hand = no_chunk
      self%last = no_chunk
      self%finished = 0
      self%total = 0
   end subroutine new_scheduler

   !> Ask for a chunk; waits for the answer.
   subroutine take(self, chunk, available)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> The chunk.
      integer, intent(out) :: chunk
      !> There is one.
      logical, intent(out) :: available

      integer(i8) :: answer(answer_length)

      call self%keeper%end_chunk()
      self%last = self%in_hand
      self%last_seconds = self%keeper%latest
      chunk = no_chunk
      available = .false.
      if (self%rank == 0) then
         call self%serve()
         call hand_out(self, chunk)
         available = chunk /= no_chunk
      else
         call mpi_send(message_of(self), request_length, MPI_INTEGER8, 0, tag_request, self%comm)
         call forget(self)
         call mpi_recv(answer, answer_length, MPI_INTEGER8, 0, tag_assign, self%comm, MPI_STATUS_IGNORE)
         chunk = int(answer(1))
         self%keeper%longest = max(self%keeper%longest, real(answer(2), wp)/per_second)
         available = chunk /= no_chunk
         ! A chunk that came too late is left for the next run.
         if (available) available = .not. self%keeper%must_stop()
      end if
      self%in_hand = merge(chunk, no_chunk, available)
      if (available) call self%keeper%begin_chunk()
   end subroutine take

   !> Count a finished point.
   pure subroutine count_point(self, outcome)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> 1..outcomes.
      integer, intent(in) :: outcome

      self%finished(outcome) = self%finished(outcome) + 1
      self%keeper%points = self%keeper%points + 1
   end subroutine count_point

   !> Rank 0: answer the requests that have come, count its own points. Other ranks: nothing.
   subroutine serve(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      logical :: waiting

      if (self%rank /= 0) return
      call learn(self, message_of(self))
      call forget(self)
      do
         if (self%ranks == 1) return
         call mpi_iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, self%comm, waiting, MPI_STATUS_IGNORE)
         if (.not. waiting) return
         call answer_one(self)
      end do
   end subroutine serve

   !> Wait until every rank has ended. All ranks call this, after `take` found no chunk.
   subroutine finish(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      if (self%rank == 0) then
         do while (self%ended < self%ranks - 1)
            call mpi_probe(MPI_ANY_SOURCE, MPI_ANY_TAG, self%comm, MPI_STATUS_IGNORE)
            call answer_one(self)
         end do
         call self%serve()
      else
         call mpi_send(message_of(self), request_length, MPI_INTEGER8, 0, tag_last, self%comm)
      end if
   end subroutine finish

   !> Rank 0: receive one message and answer it.
   subroutine answer_one(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      type(MPI_Status) :: status
      integer(i8) :: message(request_length), answer(answer_length)
      integer :: chunk

      call mpi_recv(message, request_length, MPI_INTEGER8, MPI_ANY_SOURCE, MPI_ANY_TAG, self%comm, status)
      call learn(self, message)
      if (status%MPI_TAG == tag_last) then
         self%ended = self%ended + 1
         ! A rank that ends while there are chunks was told to stop: so are all.
         if (.not. self%forecast%is_exhausted() .and. len(self%keeper%reason) == 0) self%keeper%reason = another_stopped
      else
         call hand_out(self, chunk)
         answer = [int(chunk, i8), microseconds(self%keeper%longest)]
         call mpi_send(answer, answer_length, MPI_INTEGER8, status%MPI_SOURCE, tag_assign, self%comm)
      end if
   end subroutine answer_one

   !> Rank 0: count what a rank has finished.
   subroutine learn(self, message)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> What the rank tells.
      integer(i8), intent(in) :: message(:)

      self%total = self%total + int(message(:outcomes))
      self%keeper%longest = max(self%keeper%longest, real(message(longest), wp)/per_second)
      if (message(last) /= no_chunk) call self%forecast%note(int(message(last)), real(message(last_time), wp)/per_second)
   end subroutine learn

   !> What rank 0 has been told is not told again.
   subroutine forget(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      self%finished = 0
      self%last = no_chunk
   end subroutine forget

   !> Rank 0: how long the rest will take; negative if nobody knows yet.
   function remaining(self) result(seconds)
      !> Scheduler.
      class(scheduler), intent(in) :: self
      !> The time [s].
      real(wp) :: seconds

      seconds = self%forecast%remaining(self%ranks, steady_seconds() - self%begun)
   end function remaining

   !> Rank 0: the next chunk of the forecast; none once the run must stop.
   subroutine hand_out(self, chunk)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> The chunk, or `no_chunk`.
      integer, intent(out) :: chunk

      chunk = no_chunk
      if (self%forecast%is_exhausted()) return
      if (self%keeper%must_stop()) return
      call self%forecast%next(chunk)
   end subroutine hand_out

   !> What a rank tells rank 0.
   pure function message_of(self) result(message)
      !> Scheduler.
      class(scheduler), intent(in) :: self
      !> Points finished, by outcome, the longest chunk [us], the last one and its time [us].
      integer(i8) :: message(request_length)

      message(:outcomes) = self%finished
      message(longest) = microseconds(self%keeper%longest)
      message(last) = self%last
      message(last_time) = microseconds(self%last_seconds)
   end function message_of

   !> A time as it is sent, rounded up.
   pure function microseconds(seconds) result(whole)
      !> The time [s].
      real(wp), intent(in) :: seconds
      !> The time [us].
      integer(i8) :: whole

      whole = ceiling(min(per_second*seconds, 0.5_wp*real(huge(whole), wp)), i8)
   end function microseconds

end module spurflex_sweep_schedule
