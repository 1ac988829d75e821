!> What a recorded period of the lanes looks like: displacements, rates and accelerations at the ends of its steps.
!> The polynomials of degree five between them miss some 1e-5 of a motion with 16 steps, and less by the sixth power with more.
module spurflex_integrate_lane_observe
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_lane_rule, only: lanes, most_modes, abreast, lane_record
   use spurflex_integrate_period_map, only: observables
   use spurflex_model_modal, only: modal_system
   implicit none
   private

   public :: point_view, new_point_view, lane_view, seat_view, observe

   !> Values, rates and accelerations.
   integer, parameter :: orders = 3

   !> How the displacements of a point follow from its modes.
   type :: point_view
      !> Value, rate and acceleration of each displacement are the real part of these times z, plus these times N, shapes
      !> (most_modes, displacements, orders) and (displacements, orders).
      real(wp), dimension(most_modes, observables, orders) :: re = 0.0_wp, im = 0.0_wp
      real(wp) :: force(observables, orders) = 0.0_wp
   end type point_view

   !> The same of all seats, and what is seen.
   type :: lane_view
      real(wp), allocatable, private :: re(:, :, :, :), im(:, :, :, :), force(:, :, :)
      !> Values, rates and accelerations, shape (lanes, displacements, orders,
      !> 0:steps + abreast - 1).
      real(wp), allocatable :: seen(:, :, :, :)
   end type lane_view

contains

   !> How the displacements follow from the modes.
   pure function new_point_view(modal) result(view)
      !> Modes of the linear part.
      type(modal_system), intent(in) :: modal
      !> The view.
      type(point_view) :: view

      complex(wp) :: factor(modal%modes)
      integer :: i, order

      do i = 1, observables
         ! What the mesh force does to the rate and to the acceleration; its own rate does not reach those of a position.
         factor = modal%observation(i, :)
         do order = 2, orders
            view%force(i, order) = -real(sum(factor*modal%influence), wp)
            factor = factor*modal%rate
         end do
         factor = modal%observation(i, :)
         do order = 1, orders
            view%re(:modal%modes, i, order) = real(factor, wp)
            view%im(:modal%modes, i, order) = aimag(factor)
            factor = factor*modal%rate
         end do
      end do
   end function new_point_view

   !> Put a point into a lane.
   pure subroutine seat_view(self, lane, view)
      !> View of all lanes.
      type(lane_view), intent(inout) :: self
      !> Lane.
      integer, intent(in) :: lane
      !> View of the point.
      type(point_view), intent(in) :: view

      if (.not. allocated(self%re)) allocate (self%re(lanes, most_modes, observables, orders), &
                                              self%im(lanes, most_modes, observables, orders), &
                                              self%force(lanes, observables, orders), source=0.0_wp)
      self%re(lane, :, :, :) = view%re
      self%im(lane, :, :, :) = view%im
      self%force(lane, :, :) = view%force
   end subroutine seat_view

   !> Look at the latest period of all lanes.
   subroutine observe(self, modes, record, steps)
      !> View.
      type(lane_view), intent(inout) :: self
      !> Modes in use.
      integer, intent(in) :: modes
      !> The period.
      type(lane_record), intent(in) :: record
      !> Steps per mesh period.
      integer, intent(in) :: steps

      integer :: s, last

      last = steps + abreast - 1
      if (allocated(self%seen)) then
         if (ubound(self%seen, 4) < last) deallocate (self%seen)
      end if
      if (.not. allocated(self%seen)) allocate (self%seen(lanes, observables, orders, 0:last))
      ! What lies behind the last step means nothing.
      do s = 0, steps, abreast
         call see(modes, self%re, self%im, self%force, record%re(:, :, s:s + 3), record%im(:, :, s:s + 3), &
                  record%force(:, s:s + 3), self%seen(:, :, :, s:s + 3))
      end do
   end subroutine observe

   !> Look at four steps abreast, which read the coefficients once.
   pure subroutine see(modes, re, im, force, z_re, z_im, n, seen)
      !> Modes in use.
      integer, intent(in) :: modes
      !> Coefficients of all lanes.
      real(wp), dimension(lanes, most_modes, observables, orders), intent(in) :: re, im
      real(wp), intent(in) :: force(lanes, observables, orders)
      !> Modes and N at the end of each step.
      real(wp), intent(in) :: z_re(lanes, most_modes, abreast), z_im(lanes, most_modes, abreast), n(lanes, abreast)
      !> What is seen.
      real(wp), intent(out) :: seen(lanes, observables, orders, abreast)

      real(wp), dimension(lanes) :: first, second, third, fourth
      integer :: order, i, j, l

      do order = 1, orders
         do i = 1, observables
            do l = 1, lanes
               first(l) = force(l, i, order)*n(l, 1)
               second(l) = force(l, i, order)*n(l, 2)
               third(l) = force(l, i, order)*n(l, 3)
               fourth(l) = force(l, i, order)*n(l, 4)
            end do
            do j = 1, modes
               do l = 1, lanes
                  first(l) = first(l) + re(l, j, i, order)*z_re(l, j, 1) - im(l, j, i, order)*z_im(l, j, 1)
                  second(l) = second(l) + re(l, j, i, order)*z_re(l, j, 2) - im(l, j, i, order)*z_im(l, j, 2)
                  third(l) = third(l) + re(l, j, i, order)*z_re(l, j, 3) - im(l, j, i, order)*z_im(l, j, 3)
                  fourth(l) = fourth(l) + re(l, j, i, order)*z_re(l, j, 4) - im(l, j, i, order)*z_im(l, j, 4)
               end do
            end do
            do l = 1, lanes
               seen(l, i, order, 1) = first(l)
               seen(l, i, order, 2) = second(l)
               seen(l, i, order, 3) = third(l)
               seen(l, i, order, 4) = fourth(l)
            end do
         end do
      end do
   end subroutine see

end module spurflex_integrate_lane_observe
