!> What is recorded of a steady motion where a deck asks for it: amplitude spectrum, Poincare section, time history.
module spurflex_measure_record
   use spurflex_base_kinds, only: wp
   implicit none
   private

   public :: record_request, record_type, observable_type, observables, observable_of, lines_of, samples_of, records
   public :: last_coordinate, mesh_deflection_observable, mesh_force_observable, bearing_observables

   !> A quantity that can be recorded.
   type :: observable_type
      !> Name, in a deck and in a file.
      character(len=20) :: name
      !> Unit of the quantity and of its rate.
      character(len=5) :: units, rate_units
      !> It exists on a flexible support only.
      logical :: flexible_only
      !> Description for people.
      character(len=60) :: long_name
   end type observable_type

   !> Every quantity that can be recorded: the nine coordinates, the mesh, the bearings.
   type(observable_type), parameter :: observables(*) = [ &
      observable_type('x1', 'm', 'm/s', .false., 'displacement of the driving gear in x'), &
      observable_type('y1', 'm', 'm/s', .false., 'displacement of the driving gear in y'), &
      observable_type('theta1', 'rad', 'rad/s', .false., 'angular oscillation of the driving gear'), &
      observable_type('x2', 'm', 'm/s', .false., 'displacement of the driven gear in x'), &
      observable_type('y2', 'm', 'm/s', .false., 'displacement of the driven gear in y'), &
      observable_type('theta2', 'rad', 'rad/s', .false., 'angular oscillation of the driven gear'), &
      observable_type('xm', 'm', 'm/s', .true., 'displacement of the gearbox in x'), &
      observable_type('ym', 'm', 'm/s', .true., 'displacement of the gearbox in y'), &
      observable_type('thetam', 'rad', 'rad/s', .true., 'rotation of the gearbox'), &
      observable_type('mesh_deflection', 'm', 'm/s', .false., 'deflection of the mesh along the line of action'), &
      observable_type('mesh_force', 'N', 'N/s', .false., 'mesh force, with its damping'), &
      observable_type('bearing1_deformation', 'm', 'm/s', .false., 'deformation of the driving bearing'), &
      observable_type('bearing2_deformation', 'm', 'm/s', .false., 'deformation of the driven bearing')]

   !> Positions in `observables`: the last coordinate, what belongs to the mesh, the bearing of each gear.
   integer, parameter :: last_coordinate = 9, mesh_deflection_observable = 10, mesh_force_observable = 11, &
      bearing_observables(2) = [12, 13]

   !> What a deck asks to be recorded of each point.
   type :: record_request
      !> Whether each product is asked for.
      logical :: spectrum = .false., section = .false., history = .false.
      !> Quantities, as positions in `observables`, shape (quantities).
      integer, allocatable :: quantities(:)
      !> Highest order of the spectrum, in multiples of the mesh frequency.
      real(wp) :: highest_order = 4.0_wp
      !> Mesh periods of the window of the spectrum: its resolution is one over them.
      integer :: spectrum_periods = 840
      !> Points of the Poincare section, one a mesh period.
      integer :: sections = 240
      !> Mesh periods of the history, and samples in each.
      integer :: history_periods = 8, history_samples = 256
   end type record_request

   !> What was recorded of one point; what was not asked for is not allocated.
   type :: record_type
      !> Amplitudes, shape (lines, quantities).
      real(wp), allocatable :: spectrum(:, :)
      !> Values and rates, shape (sections, 2, quantities).
      real(wp), allocatable :: section(:, :, :)
      !> Values and rates, shape (samples, 2, quantities).
      real(wp), allocatable :: history(:, :, :)
   end type record_type

contains

   !> Position of a quantity by its name.
   pure function observable_of(name) result(position)
      !> Name.
      character(len=*), intent(in) :: name
      !> Position in `observables`; 0 if there is no such quantity.
      integer :: position

      do position = 1, size(observables)
         if (observables(position)%name == name) return
      end do
      position = 0
   end function observable_of

   !> Lines of the spectrum that a deck asks for, the mean included.
   pure function lines_of(request) result(lines)
      !> The request.
      type(record_request), intent(in) :: request
      !> Number of lines.
      integer :: lines

      ! The product of a decimal fraction may come out a little less than whole.
      lines = floor(request%highest_order*request%spectrum_periods*(1.0_wp + 4.0_wp*epsilon(1.0_wp))) + 1
   end function lines_of

   !> Samples of the history that a deck asks for, both ends included.
   pure function samples_of(request) result(samples)
      !> The request.
      type(record_request), intent(in) :: request
      !> Number of samples.
      integer :: samples

      samples = request%history_periods*request%history_samples + 1
   end function samples_of

   !> Whether anything is asked for.
   pure function records(request) result(it_does)
      !> The request.
      type(record_request), intent(in) :: request
      !> It is.
      logical :: it_does

      it_does = request%spectrum .or. request%section .or. request%history
   end function records

end module spurflex_measure_record
