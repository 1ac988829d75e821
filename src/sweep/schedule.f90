!> Which rank gets which piece of the grid.
!>
!> Rank 0 hands out pieces as its forecast cuts them, which learns from the times of those that are done. It works too and serves
!> the others between its own periods; point-to-point messages only. Nobody asks for a piece before the last one is done: one
!> that is kept ready by a rank at work on a dear piece can be done by no other, and may be dear itself.
module spurflex_sweep_schedule
   use mpi_f08, only: MPI_Comm, MPI_Status, MPI_COMM_NULL, MPI_INTEGER8, MPI_ANY_SOURCE, &
      MPI_ANY_TAG, MPI_STATUS_IGNORE, mpi_comm_rank, mpi_comm_size, mpi_iprobe, mpi_probe, mpi_recv, mpi_send
   use spurflex_base_clock, only: steady_seconds
   use spurflex_base_kinds, only: i8, wp
   use spurflex_sweep_chunk, only: chunk_type, part_of, piece_type
   use spurflex_sweep_forecast, only: forecast_type, new_forecast
   use spurflex_sweep_timekeeper, only: timekeeper, another_stopped
   implicit none
   private

   public :: scheduler, new_scheduler, outcomes

   !> Kinds of outcome that are counted, by status: settled, not settled, diverged, inaccurate.
   integer, parameter :: outcomes = 4

   integer, parameter :: tag_request = 1, tag_stopped = 2, tag_last = 3, tag_assign = 4
   !> A piece as it is sent: chunk, halvings, number.
   integer, parameter :: piece_length = 3
   !> A request tells the piece that was done last, its time, the longest of this rank and the points finished, an answer the piece
   !> to do and the longest one of all ranks.
   integer, parameter :: answer_length = piece_length + 1, request_length = piece_length + 2 + outcomes
   integer, parameter :: last_time = piece_length + 1, longest = piece_length + 2
   !> How times are sent: as whole microseconds.
   real(wp), parameter :: per_second = 1.0e6_wp

   !> One rank's part in handing out pieces.
   type :: scheduler
      private
      type(MPI_Comm) :: comm = MPI_COMM_NULL
      integer :: rank = 0, ranks = 1
      !> The chunks, the same on every rank.
      type(chunk_type), pointer :: chunks(:) => null()
      !> Rank 0: what the chunks cost; moment at which the first piece was handed out [s]; ranks that have ended.
      type(forecast_type) :: forecast
      real(wp) :: begun = 0.0_wp
      integer :: ended = 0
      !> The piece in hand; the one that was done last, as long as rank 0 has not been told, and its time [s].
      type(piece_type) :: in_hand, last
      real(wp) :: last_seconds = 0.0_wp
      !> This rank's time.
      type(timekeeper), pointer :: keeper => null()
      !> Points finished since the last message, by outcome.
      integer :: finished(outcomes) = 0
      !> Rank 0: points finished on all ranks, by outcome.
      integer, public :: total(outcomes) = 0
   contains
      !> Ask for a piece.
      procedure :: take
      !> Count a finished point.
      procedure :: count_point
      !> This is rank 0.
      procedure :: hands_out
      !> Rank 0: answer the requests that have come.
      procedure :: serve
      !> Rank 0: how long the rest will take.
      procedure :: remaining
      !> Wait for all ranks to end.
      procedure :: finish
   end type scheduler

contains

   !> Begin to hand out pieces. All ranks call this together.
   subroutine new_scheduler(self, comm, chunks, keeper)
      !> The scheduler.
      type(scheduler), intent(inout) :: self
      !> The ranks.
      type(MPI_Comm), intent(in) :: comm
      !> The chunks, the same on every rank; stay where they are until `finish`.
      type(chunk_type), intent(in), target :: chunks(:)
      !> This rank's time; stays where it is until `finish`.
      type(timekeeper), intent(inout), target :: keeper

      self%comm = comm
      self%keeper => keeper
      call mpi_comm_rank(comm, self%rank)
      call mpi_comm_size(comm, self%ranks)
      self%chunks => chunks
      if (self%rank == 0) self%forecast = new_forecast(chunks, self%ranks)
      self%begun = steady_seconds()
      self%ended = 0
      self%in_hand = piece_type()
      self%last = piece_type()
      self%finished = 0
      self%total = 0
   end subroutine new_scheduler

   !> Ask for a piece; waits for the answer.
   subroutine take(self, part, available)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> The piece.
      type(chunk_type), intent(out) :: part
      !> There is one.
      logical, intent(out) :: available

      type(piece_type) :: piece
      integer(i8) :: answer(answer_length)

      call self%keeper%end_piece()
      self%last = self%in_hand
      self%last_seconds = self%keeper%latest
      if (self%rank == 0) then
         call self%serve()
         call hand_out(self, piece)
         available = piece%chunk > 0
      else
         call mpi_send(message_of(self), request_length, MPI_INTEGER8, 0, tag_request, self%comm)
         call forget(self)
         call mpi_recv(answer, answer_length, MPI_INTEGER8, 0, tag_assign, self%comm, MPI_STATUS_IGNORE)
         piece = piece_in(answer)
         self%keeper%longest = max(self%keeper%longest, real(answer(answer_length), wp)/per_second)
         available = piece%chunk > 0
         ! A piece that came too late is left for the next run, and rank 0 hears of it at once.
         if (available) available = .not. self%keeper%must_stop()
         if (piece%chunk > 0 .and. .not. available) then
            call mpi_send(message_of(self), request_length, MPI_INTEGER8, 0, tag_stopped, self%comm)
            call forget(self)
         end if
      end if
      self%in_hand = piece_type()
      if (.not. available) return
      self%in_hand = piece
      part = part_of(self%chunks(piece%chunk), piece)
      call self%keeper%begin_piece()
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

   !> This is the rank that hands out.
   pure function hands_out(self) result(it_does)
      !> Scheduler.
      class(scheduler), intent(in) :: self
      !> It does.
      logical :: it_does

      it_does = self%rank == 0
   end function hands_out

   !> Rank 0: answer the requests that have come, count its own points. Every rank: let MPI go on.
   subroutine serve(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      logical :: waiting

      if (self%rank /= 0) then
         ! MPI goes on with what it does on the side when it is called.
         call mpi_iprobe(0, tag_assign, self%comm, waiting, MPI_STATUS_IGNORE)
         return
      end if
      call learn(self, message_of(self))
      call forget(self)
      do
         if (self%ranks == 1) return
         call mpi_iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, self%comm, waiting, MPI_STATUS_IGNORE)
         if (.not. waiting) return
         call answer_one(self)
      end do
   end subroutine serve

   !> Wait until every rank has ended. All ranks call this, after `take` found no piece.
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
      type(piece_type) :: piece
      integer(i8) :: message(request_length)

      call mpi_recv(message, request_length, MPI_INTEGER8, MPI_ANY_SOURCE, MPI_ANY_TAG, self%comm, status)
      call learn(self, message)
      if (status%MPI_TAG == tag_stopped) then
         ! One is told to stop: so are all.
         if (len(self%keeper%reason) == 0) self%keeper%reason = another_stopped
      else if (status%MPI_TAG == tag_last) then
         self%ended = self%ended + 1
      else
         call hand_out(self, piece)
         call mpi_send([numbers_of(piece), microseconds(self%keeper%longest)], answer_length, MPI_INTEGER8, &
                       status%MPI_SOURCE, tag_assign, self%comm)
      end if
   end subroutine answer_one

   !> Rank 0: count what a rank has finished.
   subroutine learn(self, message)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> What the rank tells.
      integer(i8), intent(in) :: message(:)

      type(piece_type) :: piece

      self%total = self%total + int(message(longest + 1:))
      self%keeper%longest = max(self%keeper%longest, real(message(longest), wp)/per_second)
      piece = piece_in(message)
      if (piece%chunk > 0) call self%forecast%note(piece, real(message(last_time), wp)/per_second)
   end subroutine learn

   !> What rank 0 has been told is not told again.
   subroutine forget(self)
      !> Scheduler.
      class(scheduler), intent(inout) :: self

      self%finished = 0
      self%last = piece_type()
   end subroutine forget

   !> Rank 0: how long the rest will take; negative if nobody knows yet.
   function remaining(self) result(seconds)
      !> Scheduler.
      class(scheduler), intent(in) :: self
      !> The time [s].
      real(wp) :: seconds

      seconds = self%forecast%remaining(steady_seconds() - self%begun)
   end function remaining

   !> Rank 0: the next piece of the forecast; none once the run must stop.
   subroutine hand_out(self, piece)
      !> Scheduler.
      class(scheduler), intent(inout) :: self
      !> The piece, or none.
      type(piece_type), intent(out) :: piece

      if (self%forecast%is_exhausted()) return
      if (self%keeper%must_stop()) return
      call self%forecast%next(piece)
   end subroutine hand_out

   !> What a rank tells rank 0.
   pure function message_of(self) result(message)
      !> Scheduler.
      class(scheduler), intent(in) :: self
      !> The last piece and its time [us], the longest [us], points finished, by outcome.
      integer(i8) :: message(request_length)

      message = [numbers_of(self%last), microseconds(self%last_seconds), microseconds(self%keeper%longest), &
                 int(self%finished, i8)]
   end function message_of

   !> A piece as it is sent.
   pure function numbers_of(piece) result(numbers)
      !> The piece.
      type(piece_type), intent(in) :: piece
      !> Its numbers.
      integer(i8) :: numbers(piece_length)

      numbers = [piece%chunk, piece%halvings, piece%number]
   end function numbers_of

   !> The piece in a message.
   pure function piece_in(message) result(piece)
      !> The message, which begins with it.
      integer(i8), intent(in) :: message(:)
      !> The piece.
      type(piece_type) :: piece

      piece = piece_type(chunk=int(message(1)), halvings=int(message(2)), number=int(message(3)))
   end function piece_in

   !> A time as it is sent, rounded up.
   pure function microseconds(seconds) result(whole)
      !> The time [s].
      real(wp), intent(in) :: seconds
      !> The time [us].
      integer(i8) :: whole

      whole = ceiling(min(per_second*seconds, 0.5_wp*real(huge(whole), wp)), i8)
   end function microseconds

end module spurflex_sweep_schedule
