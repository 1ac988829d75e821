!> How the equations are integrated and when a motion counts as steady.
module spurflex_integrate_options
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: solver_options
   public :: start_rest, start_static, start_up, start_down
   public :: integrator_newmark, integrator_collocation

   !> Start with every coordinate and velocity zero.
   integer, parameter :: start_rest = 1
   !> Start at the static equilibrium under the mean mesh stiffness.
   integer, parameter :: start_static = 2
   !> Continue from the steady motion at the next lower speed of the grid.
   integer, parameter :: start_up = 3
   !> Continue from the steady motion at the next higher speed of the grid.
   integer, parameter :: start_down = 4

   !> Newmark-beta with constant steps.
   integer, parameter :: integrator_newmark = 1
   !> Exponential collocation of order eight with located crossings.
   integer, parameter :: integrator_collocation = 2

   !> Options of the steady-state solution of one point.
   type :: solver_options
      !> Which integrator.
      integer :: integrator = integrator_newmark
      !> Time steps per mesh period; 0 takes as many as the tolerance needs.
      integer :: steps_per_period = 0
      !> Newmark's beta.
      real(wp) :: newmark_beta = 0.25_wp
      !> Newmark's gamma.
      real(wp) :: newmark_gamma = 0.5_wp
      !> Relative error of the amplitude that is asked for.
      real(wp) :: tolerance = 1.0e-3_wp
      !> Most mesh periods integrated before a point is given up as not settled.
      integer :: max_periods = 4000
      !> Mesh periods over which a motion that is not periodic is measured.
      integer :: measured_periods = 200
      !> The largest Floquet multiplier of periodic motions is asked for.
      logical :: multipliers = .true.
      !> Which start (`start_rest` ...).
      integer :: start = start_static
   end type solver_options

end module spurflex_integrate_options
