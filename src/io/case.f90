!> The case that a deck describes: the problem, the grid, the solver options and the output.
module spurflex_io_case
   use spurflex_base_kinds, only: wp
   use spurflex_integrate_options, only: solver_options
   use spurflex_measure_record, only: record_request
   use spurflex_model_parameters, only: gear_pair, gearbox, load_type
   implicit none
   private

   public :: case_type, sweep_spec, output_spec

   !> Grid of rotating speed and support stiffness.
   type :: sweep_spec
      !> The six-degree-of-freedom model on a rigid support is asked for.
      logical :: rigid = .false.
      !> The nine-degree-of-freedom model on a flexible support is asked for.
      logical :: flexible = .false.
      !> First and last speed of the driving gear [rev/min].
      real(wp) :: speed_first = 0.0_wp, speed_last = 0.0_wp
      !> Number of speeds, evenly spaced.
      integer :: speed_count = 1
      !> First and last support stiffness [N/m].
      real(wp) :: stiffness_first = 0.0_wp, stiffness_last = 0.0_wp
      !> Time within which a run is to end [s], 0 for none. It concerns one run only.
      real(wp) :: wall_clock_limit = 0.0_wp
      !> Number of support stiffnesses, evenly spaced in their logarithm; 0 without a flexible support.
      integer :: stiffness_count = 0
   end type sweep_spec

   !> What is written, and where.
   type :: output_spec
      !> Result file, relative to the working folder.
      character(len=:), allocatable :: file
      !> Products asked for beside the map, shape (products), e.g. 'history'.
      character(len=16), allocatable :: products(:)
      !> What is recorded of each point.
      type(record_request) :: record
   end type output_spec

   !> Everything that one deck says.
   type :: case_type
      !> Title for people.
      character(len=:), allocatable :: title
      !> Gear pair, bearings and mesh.
      type(gear_pair) :: gears
      !> Gearbox housing and support.
      type(gearbox) :: box
      !> Torques.
      type(load_type) :: load
      !> Grid.
      type(sweep_spec) :: sweep
      !> Solver options, the start included.
      type(solver_options) :: solver
      !> Output.
      type(output_spec) :: output
      !> The deck with every default filled in, as namelist text with newlines; it reads back to the same case,
      !> but for what concerns one run only.
      character(len=:), allocatable :: resolved
   end type case_type

end module spurflex_io_case
