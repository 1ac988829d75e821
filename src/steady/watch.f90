!> A watch over a transient: what is seen of it from one mesh period on, to tell whether it has arrived and what it is.
module spurflex_steady_watch
   use spurflex_base_kinds, only: wp
   use spurflex_steady_lyapunov, only: lyapunov_sum
   implicit none
   private

   public :: watch_type

   !> What has been seen in a watch.
   type :: watch_type
      !> Growth of the tangent, if it is summed.
      type(lyapunov_sum) :: growth
      logical :: grows = .false.
      !> The watch is on.
      logical :: is_on = .false.
      !> Norms of the sections: extremes over the first and the second half [m].
      real(wp) :: low(2) = huge(1.0_wp), high(2) = -huge(1.0_wp)
      !> Mesh period at which the second half begins.
      integer :: half = 0
      !> Range of the norms over the second half of the watch before; zero if there was none [m].
      real(wp) :: before = 0.0_wp
   contains
      !> Watch anew.
      procedure :: begin
      !> See the next section.
      procedure :: see
      !> How far the motion is still on its way.
      procedure :: drift
      !> It comes to rest.
      procedure :: comes_to_rest
   end type watch_type

contains

   !> Watch anew: what came before was still on its way.
   pure subroutine begin(self, from, until, grows)
      !> Watch.
      class(watch_type), intent(inout) :: self
      !> Mesh periods from which and up to which it lasts.
      integer, intent(in) :: from, until
      !> The growth of a tangent is summed.
      logical, intent(in) :: grows

      real(wp) :: range(2)

      range = ranges(self)
      self%before = range(2)
      self%is_on = .true.
      self%grows = grows
      call self%growth%reset(until - from)
      self%low = huge(1.0_wp)
      self%high = -huge(1.0_wp)
      self%half = (from + until)/2
   end subroutine begin

   !> See the next section.
   pure subroutine see(self, period, norm, growth)
      !> Watch.
      class(watch_type), intent(inout) :: self
      !> Its mesh period.
      integer, intent(in) :: period
      !> Norm of the section [m], and what the tangent has grown by.
      real(wp), intent(in) :: norm, growth

      integer :: which

      if (self%grows) call self%growth%add(growth)
      which = merge(1, 2, period <= self%half)
      self%low(which) = min(self%low(which), norm)
      self%high(which) = max(self%high(which), norm)
   end subroutine see

   !> By how much the sections range over more, or less, in the second half of what has been watched than in the first, beside the
   !> larger range; 1 while only one half has been seen, 0 before.
   pure function drift(self) result(change)
      !> Watch.
      class(watch_type), intent(in) :: self
      !> The change.
      real(wp) :: change

      real(wp) :: range(2)

      range = ranges(self)
      change = change_of(range(1), range(2))
   end function drift

   !> The drift is no more than that into this watch: a motion that arrives slows down, one that leaves for another does not.
   !> Where nothing was seen before, that is 1.
   pure function comes_to_rest(self) result(it_does)
      !> Watch.
      class(watch_type), intent(in) :: self
      !> It does.
      logical :: it_does

      real(wp) :: range(2)

      range = ranges(self)
      it_does = self%drift() <= change_of(self%before, range(1))
   end function comes_to_rest

   !> Ranges of the norms over both halves; zero of one that has not been seen [m].
   pure function ranges(self) result(range)
      !> Watch.
      class(watch_type), intent(in) :: self
      !> The ranges.
      real(wp) :: range(2)

      ! Of what has not been seen, the lowest is huge and the highest is less.
      range = max(self%high, self%low) - self%low
   end function ranges

   !> Change of a range, beside the larger one.
   pure function change_of(first, second) result(change)
      !> Ranges, the later one second [m].
      real(wp), intent(in) :: first, second
      !> The change.
      real(wp) :: change

      change = abs(second - first)/max(first, second, tiny(1.0_wp))
   end function change_of

end module spurflex_steady_watch
