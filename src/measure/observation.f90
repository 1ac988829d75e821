!> How the quantities that a deck wants recorded follow from the coordinates of the equations of motion.
module spurflex_measure_observation
   use spurflex_base_kinds, only: wp
   use spurflex_measure_record, only: last_coordinate, mesh_deflection_observable, mesh_force_observable, bearing_observables
   use spurflex_measure_response, only: nan
   use spurflex_model_equations, only: equations_type, coordinate_rows
   use spurflex_model_mesh, only: mesh_force, mesh_force_rate, transmission_error, transmission_error_rate, &
      transmission_error_curvature
   use spurflex_model_parameters, only: mesh_excitation
   implicit none
   private

   public :: observation_type, observed_equations, observe

   !> Rows of `observation` of the equations that give the bearing deformations of a gear.
   integer, parameter :: bearing_rows(2, 2) = reshape([2, 3, 4, 5], [2, 2])

   !> Some quantities at one operating point.
   type :: observation_type
      !> Quantities, as positions in `observables`, shape (quantities).
      integer, allocatable :: quantities(:)
      !> There is such a quantity on this support, shape (quantities).
      logical, allocatable :: exists(:)
      !> What is to be added to the values that `observe` gives, so that a static offset costs no digits, shape (quantities).
      real(wp), allocatable :: offset(:)
      !> First of the recorded rows of each, shape (quantities).
      integer, allocatable, private :: row(:)
      !> Deformations of the bearings at the static equilibrium, shape (2, gears) [m].
      real(wp), private :: deformation(2, 2) = 0.0_wp
      !> Mesh deflection at the static equilibrium [m].
      real(wp), private :: deflection = 0.0_wp
      !> Mesh angular frequency [rad/s].
      real(wp), private :: frequency = 0.0_wp
      !> Mesh excitation.
      type(mesh_excitation), private :: mesh
   end type observation_type

contains

   !> The equations of motion with the rows that the quantities need.
   pure subroutine observed_equations(equations, quantities, observed, observation)
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Quantities, as positions in `observables`, shape (quantities).
      integer, intent(in) :: quantities(:)
      !> The same, to be recorded for `observe`.
      type(equations_type), intent(out) :: observed
      !> How the quantities follow from what is recorded.
      type(observation_type), intent(out) :: observation

      real(wp) :: rows(2*size(quantities), equations%n)
      real(wp), allocatable :: coordinates(:, :)
      integer :: i, gear, next

      observation%quantities = quantities
      observation%mesh = equations%mesh
      observation%frequency = equations%frequency
      observation%deflection = equations%static_deflection
      do gear = 1, 2
         observation%deformation(:, gear) = equations%static_observation(bearing_rows(:, gear))
      end do
      allocate (observation%offset(size(quantities)), source=0.0_wp)
      allocate (observation%row(size(quantities)), source=0)
      allocate (observation%exists(size(quantities)), source=.true.)
      coordinates = coordinate_rows(equations)
      next = 1
      do i = 1, size(quantities)
         observation%row(i) = next
         select case (quantities(i))
         case (:last_coordinate)
            if (quantities(i) > size(coordinates, 1)) then
               observation%exists(i) = .false.
               cycle
            end if
            rows(next, :) = coordinates(quantities(i), :)
            observation%offset(i) = dot_product(rows(next, :), equations%static_position)
            next = next + 1
         case (mesh_deflection_observable, mesh_force_observable)
            rows(next, :) = equations%direction
            if (quantities(i) == mesh_deflection_observable) observation%offset(i) = equations%static_deflection
            next = next + 1
         case default
            gear = gear_of(quantities(i))
            rows(next:next + 1, :) = equations%observation(bearing_rows(:, gear), :)
            next = next + 2
         end select
      end do
      observed = equations
      observed%recorded = rows(:next - 1, :)
   end subroutine observed_equations

   !> Gear of a bearing deformation.
   pure function gear_of(quantity) result(gear)
      !> Position in `observables`.
      integer, intent(in) :: quantity
      !> 1 or 2.
      integer :: gear

      gear = merge(1, 2, quantity == bearing_observables(1))
   end function gear_of

   !> The quantities from what was recorded.
   pure subroutine observe(observation, phase, motion, seen)
      !> What is observed.
      type(observation_type), intent(in) :: observation
      !> Phase of the mesh at each time, shape (times) [rad].
      real(wp), intent(in) :: phase(:)
      !> Recorded rows; with their rates if the mesh force or rates are wanted, with accelerations if both are, shape
      !> (rows, 1 to 3, times).
      real(wp), intent(in) :: motion(:, :, :)
      !> Values without their offsets, and rates if there is room for them, shape (times, 1 or 2, quantities).
      real(wp), intent(out) :: seen(:, :, :)

      real(wp) :: delta(3), pair(2)
      integer :: i, j, orders
      logical :: with_rates

      orders = size(motion, 2)
      with_rates = size(seen, 2) > 1
      do i = 1, size(observation%quantities)
         associate (row => observation%row(i))
            if (.not. observation%exists(i)) then
               seen(:, :, i) = nan()
               cycle
            end if
            select case (observation%quantities(i))
            case (:last_coordinate)
               seen(:, 1, i) = motion(row, 1, :)
               if (with_rates) seen(:, 2, i) = motion(row, 2, :)
            case (mesh_deflection_observable)
               do j = 1, size(phase)
                  delta = excitation(observation, phase(j), orders)
                  seen(j, :, i) = motion(row, :size(seen, 2), j) + delta(:size(seen, 2))
               end do
            case (mesh_force_observable)
               do j = 1, size(phase)
                  delta = excitation(observation, phase(j), orders)
                  delta(:orders) = motion(row, :, j) + delta(:orders)
                  delta(1) = delta(1) + observation%deflection
                  seen(j, 1, i) = mesh_force(observation%mesh, phase(j), delta(1), delta(2))
                  if (with_rates) seen(j, 2, i) = mesh_force_rate(observation%mesh, phase(j), observation%frequency, delta)
               end do
            case default
               do j = 1, size(phase)
                  pair = observation%deformation(:, gear_of(observation%quantities(i))) + motion(row:row + 1, 1, j)
                  seen(j, 1, i) = norm2(pair)
                  if (with_rates) seen(j, 2, i) = modulus_rate(pair, motion(row:row + 1, 2, j))
               end do
            end select
         end associate
      end do
   end subroutine observe

   !> The transmission error with its rate and acceleration.
   pure function excitation(observation, phase, orders) result(motion)
      !> What is observed.
      type(observation_type), intent(in) :: observation
      !> Phase of the mesh [rad].
      real(wp), intent(in) :: phase
      !> How many of its values, rate and acceleration are wanted; the others are zero.
      integer, intent(in) :: orders
      !> e_m and its derivatives in time [m, m/s, m/s2].
      real(wp) :: motion(3)

      motion = 0.0_wp
      associate (mesh => observation%mesh, frequency => observation%frequency)
         motion(1) = transmission_error(mesh, phase)
         if (orders > 1) motion(2) = frequency*transmission_error_rate(mesh, phase)
         if (orders > 2) motion(3) = frequency**2*transmission_error_curvature(mesh, phase)
      end associate
   end function excitation

   !> Rate of the modulus of a vector.
   pure function modulus_rate(vector, rate) result(change)
      !> The vector and its rate.
      real(wp), intent(in) :: vector(2), rate(2)
      !> Rate of its modulus; zero where it vanishes.
      real(wp) :: change

      change = 0.0_wp
      if (any(abs(vector) > 0.0_wp)) change = dot_product(vector, rate)/norm2(vector)
   end function modulus_rate

end module spurflex_measure_observation
