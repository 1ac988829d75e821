!> What the steady-state solution of a point ends with.
module spurflex_steady_outcome
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: steady_outcome
   public :: status_missing, status_settled, status_not_settled, status_diverged
   public :: contact_kept, contact_lost, contact_both_flanks
   public :: motion_unresolved, motion_quasi_periodic, motion_chaotic

   !> The point has not been computed yet.
   integer, parameter :: status_missing = 0
   !> The motion repeats within the tolerance.
   integer, parameter :: status_settled = 1
   !> The most periods allowed went by before the motion settled; measured all the same.
   integer, parameter :: status_not_settled = 2
   !> The state became infinite or not a number.
   integer, parameter :: status_diverged = 3

   !> The teeth never part.
   integer, parameter :: contact_kept = 0
   !> The teeth part.
   integer, parameter :: contact_lost = 1
   !> The teeth part and strike on the back flank.
   integer, parameter :: contact_both_flanks = 2

   !> The motion class could not be told.
   integer, parameter :: motion_unresolved = 0
   !> Two or more incommensurate frequencies.
   integer, parameter :: motion_quasi_periodic = 20
   !> Sensitive dependence on the state.
   integer, parameter :: motion_chaotic = 30

   !> How the search for the steady motion of one point ended.
   type :: steady_outcome
      !> Mesh periods of the motion (1..8), or `motion_...`.
      integer :: motion = motion_unresolved
      !> `status_...`.
      integer :: status = status_missing
      !> Mesh periods integrated before the motion was measured.
      integer :: periods_integrated = 0
      !> `contact_...` over the measured periods.
      integer :: contact = contact_kept
      !> Deviation from the static equilibrium at the last section, shape (n).
      real(wp), allocatable :: position(:)
      !> Its rate, shape (n).
      real(wp), allocatable :: velocity(:)
   end type steady_outcome

end module spurflex_steady_outcome
