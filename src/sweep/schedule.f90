!> Which rank gets which chunk.
!>
!> Rank 0 works too and serves the others between its own periods; point-to-point messages only. Every other rank always
!> has one request on its way, so that the answer is there when it is needed.
module spurflex_sweep_schedule
   use mpi_f08, only: MPI_Comm, MPI_Request, MPI_Status, MPI_COMM_NULL, MPI_REQUEST_NULL, MPI_INTEGER, MPI_ANY_SOURCE, &
      MPI_ANY_TAG, MPI_STATUS_IGNORE, mpi_comm_rank, mpi_comm_size, mpi_iprobe, mpi_probe, mpi_irecv, mpi_recv, mpi_send, &
      mpi_wait
   use spurflex_base_kinds, only: wp
   use spurflex_sweep_timekeeper, only: timekeeper
   implicit none
   private

   public :: scheduler, new_scheduler, outcomes

   !> Kinds of outcome that are counted, by status: settled, not settled, diverged, inaccurate.
   integer, parameter :: outcomes = 4

   integer, parameter :: tag_request = 1, tag_last = 2, tag_assign = 3
   integer, parameter :: no_chunk = 0
   !> A request tells the points finished and the longest chunk, an answer the chunk and the longest one of all ranks.
   integer, parameter :: request_length = outcomes + 1, answer_length = 2
   !> How times are sent: as whole milliseconds.
   real(wp), parameter :: per_second = 1000.0_wp

   !> One rank's part in handing out chunks.
   type :: scheduler
      private
      type(MPI_Comm) :: comm = MPI_COMM_NULL
      integer :: rank = 0, ranks = 1
      !> Rank 0: chunks in all, the last one handed out, ranks that have ended.
      integer :: chunks = 0, handed_out = 0, ended = 0
      !> Other ranks: no chunk is left; the answer on its way.
      logical :: exhausted = .false.
      type(MPI_Request) :: pending = MPI_REQUEST_NULL
      integer, allocatable :: answer(:)
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
      !> Wait for all ranks to end.
      procedure :: finish
   end type scheduler

contains

   !> Begin to hand out chunks. All ranks call this together.
   subroutine new_scheduler(self, comm, chunks, keeper)
      !> The scheduler; stays where it is until `finish`, for a message may be on its way to it.
      type(scheduler), intent(inout) :: self
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> Number of chunks, the same on every rank.
      integer, intent(in) :: chunks
      !> This rank's time; stays where it is until `finish`.
      type(timekeeper), intent(inout), target :: keeper

      self%comm = comm
      self%keeper => keeper
      call mpi_comm_rank(comm, self%rank)
      call mpi_comm_size(comm, self%ranks)
      self%chunks = chunks
      self%handed_out = 0
      self%ended = 0
      self%exhausted = .false.
      self%finished = 0
      self%total = 0
      if (.not. allocated(self%answer)) allocate (self%answer(answer_length))
      if (self%rank /= 0) call request(self)
   end subroutine new_scheduler

   !> Ask for a chunk; waits for the answer.
   subroutine take(self, chunk, available)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> The chunk.
      integer, intent(out) :: chunk
      !> There is one.
      logical, intent(out) :: available

      call self%keeper%end_chunk()
      chunk = no_chunk
      available = .false.
      if (self%rank == 0) then
         call self%serve()
         call hand_out(self, chunk)
         available = chunk /= no_chunk
      else if (.not. self%exhausted) then
         call mpi_wait(self%pending, MPI_STATUS_IGNORE)
         chunk = self%answer(1)
         self%keeper%longest = max(self%keeper%longest, real(self%answer(2), wp)/per_second)
         available = chunk /= no_chunk
         ! A chunk that came too late is left for the next run.
         if (available) available = .not. self%keeper%must_stop()
         self%exhausted = .not. available
         if (available) call request(self)
      end if
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
      self%total = self%total + self%finished
      self%finished = 0
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
         call mpi_send(message_of(self), request_length, MPI_INTEGER, 0, tag_last, self%comm)
      end if
   end subroutine finish

   !> Rank 0: receive one message and answer it.
   subroutine answer_one(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      type(MPI_Status) :: status
      integer :: message(request_length), answer(answer_length)

      call mpi_recv(message, request_length, MPI_INTEGER, MPI_ANY_SOURCE, MPI_ANY_TAG, self%comm, status)
      self%total = self%total + message(:outcomes)
      self%keeper%longest = max(self%keeper%longest, real(message(request_length), wp)/per_second)
      if (status%MPI_TAG == tag_last) then
         self%ended = self%ended + 1
      else
         call hand_out(self, answer(1))
         answer(2) = milliseconds(self%keeper%longest)
         call mpi_send(answer, answer_length, MPI_INTEGER, status%MPI_SOURCE, tag_assign, self%comm)
      end if
   end subroutine answer_one

   !> Rank 0: the next chunk of the list; none once the run must stop.
   subroutine hand_out(self, chunk)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> The chunk, or `no_chunk`.
      integer, intent(out) :: chunk

      chunk = no_chunk
      if (self%handed_out == self%chunks) return
      if (self%keeper%must_stop()) return
      self%handed_out = self%handed_out + 1
      chunk = self%handed_out
   end subroutine hand_out

   !> Other ranks: send a request, with what was finished since the last one, and be ready for the answer.
   subroutine request(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      call mpi_irecv(self%answer, answer_length, MPI_INTEGER, 0, tag_assign, self%comm, self%pending)
      call mpi_send(message_of(self), request_length, MPI_INTEGER, 0, tag_request, self%comm)
      self%finished = 0
   end subroutine request

   !> What a rank tells rank 0.
   pure function message_of(self) result(message)
      !> Scheduler.
      class(scheduler), intent(in) :: self
      !> Points finished, by outcome, and the longest chunk [ms].
      integer :: message(request_length)

      message(:outcomes) = self%finished
      message(request_length) = milliseconds(self%keeper%longest)
   end function message_of

   !> A time as it is sent, rounded up.
   pure function milliseconds(seconds) result(whole)
      !> The time [s].
      real(wp), intent(in) :: seconds
      !> The time [ms].
      integer :: whole

      whole = ceiling(min(per_second*seconds, 0.5_wp*real(huge(whole), wp)))
   end function milliseconds

end module spurflex_sweep_schedule
