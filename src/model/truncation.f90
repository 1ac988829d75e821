!> Which modes of the linear part the mesh feels at a speed, and the linear part without the others.
!>
!> All modes are driven by one scalar and act on the others through one, the mesh deflection. A mode of a soft support gives way
!> to the mesh frequency as a mass does, one of a stiff support hardly at all: what such a mode adds to the mesh deflection is
!> far below what is asked for. Whether a motion is found, and whether it is stable, does not depend on it if it decays, and it
!> follows from the mesh force afterwards, whatever displacements it has of its own. What a start gives it is another matter.
module spurflex_model_truncation
   use spurflex_base_kinds, only: wp, pi
   use spurflex_model_modal, only: modal_system
   implicit none
   private

   public :: mode_shares, new_mode_shares, felt_modes, truncated, complete_state, complete_monodromy

   !> Frequencies at which the shares are taken: so many to a factor of two, up to so many times the rate of the fastest mode, down
   !> to so many below that of the slowest.
   integer, parameter :: per_octave = 16
   real(wp), parameter :: beyond_fastest = 4.0_wp, below_slowest = 16.0_wp

   !> Slowest part of a motion that counts, beside the mesh frequency: it may repeat after eight mesh periods.
   real(wp), parameter :: slowest_part = 1.0_wp/8.0_wp

   !> What a mode may add to the mesh deflection under a steady force, beside its share: it only moves the mean of a motion.
   real(wp), parameter :: steady_allowance = 10.0_wp

   !> Decay over a mesh period, as a logarithm, that is none: such a mode must be seen to be stable.
   real(wp), parameter :: no_decay = 1.0e-9_wp

   !> Shares of the modes of a linear part in what the mesh force does to the mesh deflection.
   type :: mode_shares
      private
      !> The lowest of the frequencies [rad/s].
      real(wp) :: lowest = 1.0_wp
      !> Response of each mode over the largest of all, the most from each of the frequencies on, shape (modes, frequencies).
      real(wp), allocatable :: share(:, :)
      !> The same under a steady force, and the rate at which each mode decays, shape (modes).
      real(wp), allocatable :: steady_share(:), decay(:)
   end type mode_shares

contains

   !> The shares of the modes, whatever the speed.
   pure function new_mode_shares(modal) result(self)
      !> The linear part.
      type(modal_system), intent(in) :: modal
      !> The shares.
      type(mode_shares) :: self

      real(wp), dimension(modal%modes) :: responses, peak
      real(wp) :: highest, step
      integer :: n, i

      self%decay = -real(modal%rate, wp)
      responses = abs(modal%influence/modal%rate)
      self%steady_share = responses/maxval(responses)
      self%lowest = minval(abs(modal%rate))/below_slowest
      highest = maxval(abs(modal%rate))*beyond_fastest
      n = 2 + ceiling(per_octave*log(highest/self%lowest)/log(2.0_wp))
      allocate (self%share(modal%modes, n))
      ! Between two frequencies a mode may be in resonance.
      peak = 0.5_wp*abs(modal%influence)/max(abs(real(modal%rate, wp)), epsilon(1.0_wp)*abs(modal%rate))
      step = 2.0_wp**(1.0_wp/real(per_octave, wp))
      do i = n, 1, -1
         associate (frequency => self%lowest*step**(real(i, wp) - 0.5_wp))
            responses = response_of(modal%influence, modal%rate, modal%is_real, frequency)
            where (abs(aimag(modal%rate)) >= frequency/step .and. abs(aimag(modal%rate)) <= frequency*step)
               responses = max(responses, peak)
            end where
         end associate
         self%share(:, i) = responses/maxval(responses)
         if (i < n) self%share(:, i) = max(self%share(:, i), self%share(:, i + 1))
      end do
   end function new_mode_shares

   !> Modulus of what a mode adds to the mesh deflection under a unit force.
   elemental function response_of(influence, rate, is_real, frequency) result(response)
      !> Of the mode: what the mesh force drives [m/(N s)], eigenvalue [1/s], it is real.
      complex(wp), intent(in) :: influence, rate
      logical, intent(in) :: is_real
      !> Frequency of the force [rad/s].
      real(wp), intent(in) :: frequency
      !> The modulus [m/N].
      real(wp) :: response

      complex(wp) :: at

      at = cmplx(0.0_wp, frequency, wp)
      if (is_real) then
         response = abs(influence/(at - rate))
      else
         ! The real part of the mode is half of the sum of the mode and its conjugate.
         response = abs(influence/(at - rate) + conjg(influence)/(at - conjg(rate)))/2.0_wp
      end if
   end function response_of

   !> Which modes the mesh feels at a speed; those that do not decay are among them, so that they are seen to be stable or not.
   pure function felt_modes(self, frequency, least_share) result(felt)
      !> The shares of the modes.
      type(mode_shares), intent(in) :: self
      !> Mesh frequency [rad/s].
      real(wp), intent(in) :: frequency
      !> Share below which a mode is not felt.
      real(wp), intent(in) :: least_share
      !> They are, shape (modes).
      logical :: felt(size(self%share, 1))

      integer :: i

      i = 1 + int(per_octave*log(max(slowest_part*frequency/self%lowest, 1.0_wp))/log(2.0_wp))
      felt = self%share(:, min(i, size(self%share, 2))) > least_share .or. self%steady_share > steady_allowance*least_share &
             .or. self%decay*2.0_wp*pi <= no_decay*frequency
   end function felt_modes

   !> The linear part with some of its modes.
   pure function truncated(modal, felt) result(few)
      !> The linear part.
      type(modal_system), intent(in) :: modal
      !> Modes that are kept, shape (modes).
      logical, intent(in) :: felt(:)
      !> The linear part that they make.
      type(modal_system) :: few

      integer, allocatable :: place(:)
      integer :: k

      place = pack([(k, k=1, modal%modes)], felt)
      few%modes = size(place)
      few%roundoff = modal%roundoff
      few%fastest = modal%fastest
      few%rate = modal%rate(place)
      few%is_real = modal%is_real(place)
      few%influence = modal%influence(place)
      few%observation = modal%observation(:, place)
      few%weight = modal%weight([place, modal%modes + place])
      few%to_modes = modal%to_modes(place, :)
      few%from_modes = modal%from_modes(:, place)
   end function truncated

   !> A state in all modes from one in those that are felt; the others are where a steady force puts them.
   pure function complete_state(few, few_room, felt, modal, force, room) result(state)
      !> State in the modes that are felt: real parts, then imaginary parts, with room for some modes, shape (2 few_room).
      real(wp), intent(in) :: few(:)
      integer, intent(in) :: few_room
      !> Which these are, shape (modes).
      logical, intent(in) :: felt(:)
      !> The linear part.
      type(modal_system), intent(in) :: modal
      !> The steady force, N [N].
      real(wp), intent(in) :: force
      !> Modes that the state has room for.
      integer, intent(in) :: room
      !> The state, shape (2 room).
      real(wp) :: state(2*room)

      complex(wp) :: steady
      integer :: place, k

      state = 0.0_wp
      place = 0
      do k = 1, modal%modes
         if (felt(k)) then
            place = place + 1
            state(k) = few(place)
            state(room + k) = few(few_room + place)
         else
            steady = modal%influence(k)/modal%rate(k)*force
            state(k) = real(steady, wp)
            state(room + k) = aimag(steady)
         end if
      end do
   end function complete_state

   !> A monodromy in all modes, nearly: the others decay on their own. What they and those that are felt do to each other is left
   !> out.
   pure function complete_monodromy(few, few_room, felt, modal, time, room) result(monodromy)
      !> Monodromy in the modes that are felt, shape (2 few_room, 2 few_room).
      real(wp), intent(in) :: few(:, :)
      integer, intent(in) :: few_room
      !> Which these are, shape (modes).
      logical, intent(in) :: felt(:)
      !> The linear part.
      type(modal_system), intent(in) :: modal
      !> The time over which it goes [s].
      real(wp), intent(in) :: time
      !> Modes that it has room for.
      integer, intent(in) :: room
      !> The monodromy, shape (2 room, 2 room).
      real(wp) :: monodromy(2*room, 2*room)

      complex(wp) :: decay
      integer :: row, column, i, j, k

      monodromy = 0.0_wp
      column = 0
      do j = 1, modal%modes
         if (.not. felt(j)) cycle
         column = column + 1
         row = 0
         do i = 1, modal%modes
            if (.not. felt(i)) cycle
            row = row + 1
            monodromy(i, j) = few(row, column)
            monodromy(room + i, j) = few(few_room + row, column)
            monodromy(i, room + j) = few(row, few_room + column)
            monodromy(room + i, room + j) = few(few_room + row, few_room + column)
         end do
      end do
      do k = 1, modal%modes
         if (felt(k)) cycle
         decay = exp(modal%rate(k)*time)
         monodromy(k, k) = real(decay, wp)
         if (modal%is_real(k)) cycle
         monodromy(k, room + k) = -aimag(decay)
         monodromy(room + k, k) = aimag(decay)
         monodromy(room + k, room + k) = real(decay, wp)
      end do
   end function complete_monodromy

end module spurflex_model_truncation
