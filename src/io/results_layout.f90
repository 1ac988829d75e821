!> The variables and axes of a result file. This table drives creating, writing and reading.
!>
!> To add a variable of one number per point: give `response` a component, `quantities` a line,
!> and `get_values` and `set_values` a case of the same name. An axis is one more entry in `axes_of`. What is recorded
!> of a point, several numbers each, stands in `record_layout`.
module spurflex_io_results_layout
   use spurflex_base_checksum, only: checksum_name
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_io_axes, only: speeds, stiffnesses
   use spurflex_io_case, only: sweep_spec
   use spurflex_measure_response, only: contact_both_flanks, contact_kept, contact_lost, motion_chaotic, &
      motion_quasi_periodic, motion_unresolved, reason_given_steps, reason_max_periods, reason_most_steps, reason_no_step, &
      reason_non_finite, reason_none, reason_not_confirmed, response, status_diverged, status_inaccurate, status_missing, &
      status_not_settled, status_settled
   use spurflex_steady_outcome, only: motion_of_periods
   use spurflex_steady_sections, only: longest_period
   implicit none
   private

   public :: axis_type, variable_type
   public :: axes_of, flags_of, rigid_variables, flexible_variables, get_values, set_values
   public :: real_value, reason_flag, checksum_quantity, name_length, units_length, long_name_length
   public :: most_dimensions, speed_axis, stiffness_axis, rigid_prefix, rigid_description
   public :: width_of

   !> Longest name of a variable.
   integer, parameter :: name_length = 48
   !> Longest unit.
   integer, parameter :: units_length = 8
   !> Longest description.
   integer, parameter :: long_name_length = 120
   !> Longest word for a product.
   integer, parameter :: product_length = 16
   !> Most dimensions of a variable.
   integer, parameter :: most_dimensions = 3

   !> Speeds of a column. What stands on the grid is stored in columns of so many speeds and every support stiffness: what is
   !> found out about neighbouring points, as wide as a column, is one piece of the file then, not one for each stiffness. A
   !> single row is one piece anyway.
   integer, parameter :: column_speeds = 32

   !> What a variable holds: reals, plain integers, or one of the sets of flags.
   integer, parameter :: real_value = 0, plain_integer = 1, motion_flag = 2, status_flag = 3, contact_flag = 4, &
      reason_flag = 5

   character(len=*), parameter :: speed_axis = 'speed', stiffness_axis = 'support_stiffness', rigid_prefix = 'rigid_'
   character(len=*), parameter :: rigid_description = 'rigid support: '
   !> The quantity that guards the others of its point, in the order of writing, and what was recorded of it before them.
   character(len=*), parameter :: checksum_quantity = 'checksum'

   !> An axis of the grid.
   type :: axis_type
      !> Name of the dimension and of its scale.
      character(len=name_length) :: name
      !> Unit of the values.
      character(len=units_length) :: units
      !> Description for people.
      character(len=long_name_length) :: long_name
      !> Values along the axis.
      real(wp), allocatable :: values(:)
      !> Group that holds the scale, with a slash behind it; blank for the root.
      character(len=name_length) :: group = ''
   end type axis_type

   !> A quantity that is known at every point.
   type :: quantity_type
      !> Name, without a prefix.
      character(len=name_length) :: name
      !> Unit, `1` for a number without.
      character(len=units_length) :: units
      !> What the numbers are (`real_value` ...).
      integer :: kind
      !> Needs both the rigid and the flexible support.
      logical :: compares
      !> Product that a deck must ask for, blank if it is always there.
      character(len=product_length) :: product
      !> Description for people.
      character(len=long_name_length) :: long_name
   end type quantity_type

   !> A variable of the file.
   type :: variable_type
      !> Name in the file.
      character(len=name_length) :: name
      !> Name of the quantity in it, by which its values are found.
      character(len=name_length) :: quantity
      !> Unit, `1` for a number without.
      character(len=units_length) :: units
      !> Description for people.
      character(len=long_name_length) :: long_name
      !> What the numbers are (`real_value` ...).
      integer :: kind
      !> Names of its axes, fastest first, blank where unused.
      character(len=name_length) :: axes(most_dimensions)
      !> Record that it is a piece of (`record_...` of `record_layout`), the quantity in it as position in the request of the
      !> deck, and its part: 1 values, 2 rates. 0 where it is no piece of a record.
      integer :: record = 0, item = 0, part = 0
   end type variable_type

   !> Every quantity, in the order of writing: the status goes last, as it says that the others are there.
   type(quantity_type), parameter :: quantities(*) = [ &
      quantity_type('y1_amplitude', 'm', real_value, .false., '', 'half the peak-to-peak of the driving gear in y'), &
      quantity_type('y1_rms', 'm', real_value, .false., '', 'root mean square of y1 about its mean'), &
      quantity_type('y1_max', 'm', real_value, .false., '', 'largest displacement of the driving gear in y'), &
      quantity_type('y1_min', 'm', real_value, .false., '', 'smallest displacement of the driving gear in y'), &
      quantity_type('bearing1_deformation_max', 'm', real_value, .false., '', 'largest deformation of the driving bearing'), &
      quantity_type('bearing2_deformation_max', 'm', real_value, .false., '', 'largest deformation of the driven bearing'), &
      quantity_type('eta1', 'percent', real_value, .true., '', 'change of bearing1_deformation_max by the flexible support'), &
      quantity_type('eta2', 'percent', real_value, .true., '', 'change of bearing2_deformation_max by the flexible support'), &
      quantity_type('eta_error', 'percent', real_value, .true., '', &
                    'estimated error of eta; large where its maxima depend on the window'), &
      quantity_type('error_estimate', '1', real_value, .false., '', &
                    'estimated relative error of the amplitude and of the bearing deformations'), &
      quantity_type('floquet_magnitude', '1', real_value, .false., 'floquet', &
                    'largest modulus of the Floquet multipliers over the period of the motion'), &
      quantity_type('lyapunov_exponent', '1', real_value, .false., 'lyapunov', &
                    'largest Lyapunov exponent per mesh period'), &
      quantity_type('lyapunov_error', '1', real_value, .false., 'lyapunov', &
                    'estimated error of lyapunov_exponent per mesh period'), &
      quantity_type('motion', '1', motion_flag, .false., '', 'class of the steady motion'), &
      quantity_type('periods_integrated', '1', plain_integer, .false., '', 'mesh periods integrated'), &
      quantity_type('contact', '1', contact_flag, .false., '', 'contact of the teeth'), &
      quantity_type('reason', '1', reason_flag, .false., '', 'why the point is not settled'), &
      quantity_type(checksum_quantity, '1', plain_integer, .false., '', checksum_name//' of the other values of the point'), &
      quantity_type('status', '1', status_flag, .false., '', 'state of the computation')]

contains

   !> The axes of the file.
   pure function axes_of(sweep) result(axes)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> The axes, shape (axes).
      type(axis_type), allocatable :: axes(:)

      axes = [axis_type(speed_axis, 'rpm', 'rotating speed of the driving gear', speeds(sweep))]
      if (sweep%flexible) then
         axes = [axes, axis_type(stiffness_axis, 'N/m', 'stiffness of the gearbox support in x and y', stiffnesses(sweep))]
      end if
   end function axes_of

   !> The variables of the rigid support, on (speed), in the order of writing.
   pure function rigid_variables(sweep, products) result(variables)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> Products asked for, shape (products); none if absent.
      character(len=*), intent(in), optional :: products(:)
      !> The variables, shape (variables); none if the rigid support is not asked for.
      type(variable_type), allocatable :: variables(:)

      character(len=name_length) :: axes(most_dimensions)

      axes = [character(len=name_length) :: speed_axis, '', '']
      variables = variables_of(pack(quantities, sweep%rigid .and. .not. quantities%compares &
                                    .and. asked_for(quantities, products)), &
         rigid_prefix, rigid_description, axes)
   end function rigid_variables

   !> The variables of the flexible support, on (support_stiffness, speed) in C order, in the order of writing.
   pure function flexible_variables(sweep, products) result(variables)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> Products asked for, shape (products); none if absent.
      character(len=*), intent(in), optional :: products(:)
      !> The variables, shape (variables); none if the flexible support is not asked for.
      type(variable_type), allocatable :: variables(:)

      character(len=name_length) :: axes(most_dimensions)

      axes = [character(len=name_length) :: speed_axis, stiffness_axis, '']
      variables = variables_of(pack(quantities, sweep%flexible .and. (sweep%rigid .or. .not. quantities%compares) &
                                      .and. asked_for(quantities, products)), '', '', axes)
   end function flexible_variables

   !> A quantity is always there, or belongs to a product that is asked for.
   elemental function is_product(quantity, product) result(it_is)
      !> The quantity.
      type(quantity_type), intent(in) :: quantity
      !> The product, or blank.
      character(len=*), intent(in) :: product
      !> The quantity belongs to it.
      logical :: it_is

      it_is = quantity%product == product
   end function is_product

   !> Which quantities are asked for.
   pure function asked_for(chosen, products) result(asked)
      !> Quantities, shape (n).
      type(quantity_type), intent(in) :: chosen(:)
      !> Products asked for, shape (products); none if absent.
      character(len=*), intent(in), optional :: products(:)
      !> Shape (n).
      logical :: asked(size(chosen))

      integer :: i

      asked = is_product(chosen, '')
      if (.not. present(products)) return
      do i = 1, size(products)
         asked = asked .or. is_product(chosen, products(i))
      end do
   end function asked_for

   !> Variables for quantities.
   pure function variables_of(chosen, prefix, description, axes) result(variables)
      !> The quantities, shape (variables).
      type(quantity_type), intent(in) :: chosen(:)
      !> Prefix of the names.
      character(len=*), intent(in) :: prefix
      !> Prefix of the descriptions.
      character(len=*), intent(in) :: description
      !> Names of the axes, fastest first.
      character(len=name_length), intent(in) :: axes(most_dimensions)
      !> The variables, shape (variables).
      type(variable_type) :: variables(size(chosen))

      integer :: i

      do i = 1, size(chosen)
         variables(i)%name = prefix//chosen(i)%name
         variables(i)%quantity = chosen(i)%name
         variables(i)%units = chosen(i)%units
         variables(i)%long_name = description//chosen(i)%long_name
         variables(i)%kind = chosen(i)%kind
         variables(i)%axes = axes
      end do
   end function variables_of

   !> How many elements of its first dimension a variable has side by side in the file: the speeds of a column where it has one
   !> number for each point of the grid, else all.
   pure function width_of(variable, extents) result(width)
      !> The variable.
      type(variable_type), intent(in) :: variable
      !> Its extents, fastest first, shape (dimensions).
      integer, intent(in) :: extents(:)
      !> The width; it is stored in columns where that is less than the extent.
      integer :: width

      width = extents(1)
      if (any(variable%axes /= [character(len=name_length) :: speed_axis, stiffness_axis, ''])) return
      if (extents(2) > 1) width = min(width, column_speeds)
   end function width_of

   !> The flags of an integer variable, as CF has them.
   pure subroutine flags_of(kind, values, meanings)
      !> What the numbers are (`real_value` ...).
      integer, intent(in) :: kind
      !> Values that occur, shape (flags); none if they are no flags.
      integer, allocatable, intent(out) :: values(:)
      !> One word for each, separated by blanks.
      character(len=:), allocatable, intent(out) :: meanings

      integer :: i

      select case (kind)
      case (motion_flag)
         values = [motion_unresolved, motion_of_periods([(i, i=1, longest_period)]), motion_quasi_periodic, motion_chaotic]
         meanings = 'unresolved'
         do i = 1, longest_period
            meanings = meanings//' period_'//to_text(i)
         end do
         meanings = meanings//' quasi_periodic chaotic'
      case (status_flag)
         values = [status_missing, status_settled, status_not_settled, status_diverged, status_inaccurate]
         meanings = 'missing settled not_settled diverged inaccurate'
      case (contact_flag)
         values = [contact_kept, contact_lost, contact_both_flanks]
         meanings = 'never_lost lost both_flanks'
      case (reason_flag)
         values = [reason_none, reason_non_finite, reason_no_step, reason_max_periods, reason_given_steps, reason_most_steps, &
                   reason_not_confirmed]
         meanings = 'none non_finite no_step max_periods given_steps most_steps not_confirmed'
      case default
         values = [integer ::]
         meanings = ''
      end select
   end subroutine flags_of

   !> The values of a quantity, out of responses.
   pure subroutine get_values(quantity, responses, eta, reals, integers)
      !> Name of the quantity.
      character(len=*), intent(in) :: quantity
      !> Responses, shape (points).
      type(response), intent(in) :: responses(:)
      !> Changes by the flexible support and their error [percent], shape (3, points).
      real(wp), intent(in) :: eta(:, :)
      !> Values of a real quantity, shape (points); else left alone.
      real(wp), intent(inout) :: reals(:)
      !> Values of an integer quantity, shape (points); else left alone.
      integer, intent(inout) :: integers(:)

      select case (quantity)
      case ('y1_amplitude')
         reals = responses%y1_amplitude
      case ('y1_rms')
         reals = responses%y1_rms
      case ('y1_max')
         reals = responses%y1_max
      case ('y1_min')
         reals = responses%y1_min
      case ('bearing1_deformation_max')
         reals = responses%bearing_deformation_max(1)
      case ('bearing2_deformation_max')
         reals = responses%bearing_deformation_max(2)
      case ('eta1')
         reals = eta(1, :)
      case ('eta2')
         reals = eta(2, :)
      case ('eta_error')
         reals = eta(3, :)
      case ('error_estimate')
         reals = responses%error_estimate
      case ('floquet_magnitude')
         reals = responses%floquet_magnitude
      case ('lyapunov_exponent')
         reals = responses%lyapunov_exponent
      case ('lyapunov_error')
         reals = responses%lyapunov_error
      case ('motion')
         integers = responses%motion
      case ('periods_integrated')
         integers = responses%periods_integrated
      case ('contact')
         integers = responses%contact
      case ('reason')
         integers = responses%reason
      case ('status')
         integers = responses%status
      end select
   end subroutine get_values

   !> Put the values of a quantity into responses; quantities that compare belong to no response.
   pure subroutine set_values(quantity, responses, reals, integers)
      !> Name of the quantity.
      character(len=*), intent(in) :: quantity
      !> Responses, shape (points).
      type(response), intent(inout) :: responses(:)
      !> Values of a real quantity, shape (points).
      real(wp), intent(in) :: reals(:)
      !> Values of an integer quantity, shape (points).
      integer, intent(in) :: integers(:)

      select case (quantity)
      case ('y1_amplitude')
         responses%y1_amplitude = reals
      case ('y1_rms')
         responses%y1_rms = reals
      case ('y1_max')
         responses%y1_max = reals
      case ('y1_min')
         responses%y1_min = reals
      case ('bearing1_deformation_max')
         responses%bearing_deformation_max(1) = reals
      case ('bearing2_deformation_max')
         responses%bearing_deformation_max(2) = reals
      case ('error_estimate')
         responses%error_estimate = reals
      case ('floquet_magnitude')
         responses%floquet_magnitude = reals
      case ('lyapunov_exponent')
         responses%lyapunov_exponent = reals
      case ('lyapunov_error')
         responses%lyapunov_error = reals
      case ('motion')
         responses%motion = integers
      case ('periods_integrated')
         responses%periods_integrated = integers
      case ('contact')
         responses%contact = integers
      case ('reason')
         responses%reason = integers
      case ('status')
         responses%status = integers
      end select
   end subroutine set_values

end module spurflex_io_results_layout
