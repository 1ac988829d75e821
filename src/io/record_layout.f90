!> The variables and axes of what is recorded of each point: amplitude spectra, Poincare sections, time histories.
module spurflex_io_record_layout
   use spurflex_base_kinds, only: wp
   use spurflex_io_case, only: case_type, sweep_spec
   use spurflex_io_results_layout, only: axes_of, axis_type, flexible_variables, name_length, real_value, rigid_description, &
      rigid_prefix, rigid_variables, speed_axis, stiffness_axis, variable_type
   use spurflex_measure_record, only: lines_of, observables, record_request, record_type, samples_of
   use spurflex_measure_response, only: nan
   implicit none
   private

   public :: record_spectrum, record_section, record_history, record_kinds, history_group, window_text
   public :: is_recorded, record_length, record_axes, record_variables, get_record, record_bytes
   public :: file_axes, file_variables

   !> The kinds of record.
   integer, parameter :: record_spectrum = 1, record_section = 2, record_history = 3, record_kinds = 3

   !> Group of the histories, whose names are those of the quantities.
   character(len=*), parameter :: history_group = 'history'

   !> What was done to make a spectrum.
   character(len=*), parameter :: window_text = 'a motion of n mesh periods: n periods, rectangular, where n divides the ' &
      //'window; any other motion: the whole window, Hann, divided by its coherent gain'

   !> The axis along each kind of record.
   character(len=*), parameter :: axis_names(record_kinds) = [character(len=9) :: 'order', 'section', 'mesh_time']
   !> Names of the kinds in front of that of the quantity, which `y1` goes without but in the group of histories.
   character(len=*), parameter :: prefixes(record_kinds) = [character(len=8) :: 'spectrum', 'poincare', '']
   !> Parts of each kind: values alone, or rates too.
   integer, parameter :: parts(record_kinds) = [1, 2, 2]
   !> Descriptions of each kind of record, and of the rates in it.
   character(len=*), parameter :: descriptions(2, record_kinds) = reshape([character(len=40) :: &
      'amplitude spectrum of the ', '', 'Poincare section of the ', 'Poincare section of the rate of the ', &
      'history of the ', 'history of the rate of the '], [2, record_kinds])

contains

   !> Every axis of a result file.
   pure function file_axes(case) result(axes)
      !> What is computed.
      type(case_type), intent(in) :: case
      !> The axes, shape (axes).
      type(axis_type), allocatable :: axes(:)

      allocate (axes, source=[axes_of(case%sweep), record_axes(case%output%record)])
   end function file_axes

   !> Every variable of a result file.
   pure function file_variables(case) result(variables)
      !> What is computed.
      type(case_type), intent(in) :: case
      !> The variables, shape (variables).
      type(variable_type), allocatable :: variables(:)

      integer :: kind

      allocate (variables, source=[flexible_variables(case%sweep, case%output%products), &
                                   rigid_variables(case%sweep, case%output%products)])
      do kind = 1, record_kinds
         variables = [variables, record_variables(case%sweep, case%output%record, kind, rigid=.false.), &
                      record_variables(case%sweep, case%output%record, kind, rigid=.true.)]
      end do
   end function file_variables

   !> Whether a deck asks for a kind of record.
   pure function is_recorded(request, kind) result(it_is)
      !> What a deck asks for.
      type(record_request), intent(in) :: request
      !> `record_...`.
      integer, intent(in) :: kind
      !> It is.
      logical :: it_is

      logical :: asked(record_kinds)

      asked = [request%spectrum, request%section, request%history]
      it_is = asked(kind) .and. allocated(request%quantities)
   end function is_recorded

   !> Numbers along the axis of a kind of record.
   pure function record_length(request, kind) result(length)
      !> What a deck asks for.
      type(record_request), intent(in) :: request
      !> `record_...`.
      integer, intent(in) :: kind
      !> How many.
      integer :: length

      integer :: lengths(record_kinds)

      lengths = [lines_of(request), request%sections, samples_of(request)]
      length = lengths(kind)
   end function record_length

   !> The axes along what is recorded.
   pure function record_axes(request) result(axes)
      !> What a deck asks for.
      type(record_request), intent(in) :: request
      !> The axes, shape (axes); none if nothing is recorded.
      type(axis_type), allocatable :: axes(:)

      integer :: i

      allocate (axes(0))
      if (is_recorded(request, record_spectrum)) then
         axes = [axes, axis_type(axis_names(record_spectrum), '1', 'multiple of the mesh frequency', &
                                 [(real(i, wp)/real(request%spectrum_periods, wp), i=0, lines_of(request) - 1)])]
      end if
      if (is_recorded(request, record_section)) then
         axes = [axes, axis_type(axis_names(record_section), '1', 'number of the section, one each mesh period at its phase 0', &
                                 [(real(i, wp), i=1, request%sections)])]
      end if
      if (is_recorded(request, record_history)) then
         axes = [axes, axis_type(axis_names(record_history), '1', 'time since the first section in mesh periods', &
                                 [(real(i, wp)/real(request%history_samples, wp), i=0, samples_of(request) - 1)], &
                                 history_group//'/')]
      end if
   end function record_axes

   !> The variables of a kind of record on one support, in the order of writing.
   pure function record_variables(sweep, request, kind, rigid) result(variables)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> What a deck asks for.
      type(record_request), intent(in) :: request
      !> `record_...`.
      integer, intent(in) :: kind
      !> On the rigid support, not on the flexible one.
      logical, intent(in) :: rigid
      !> The variables, shape (variables); none if they are not asked for.
      type(variable_type), allocatable :: variables(:)

      type(variable_type) :: variable
      integer :: item, part

      allocate (variables(0))
      if (.not. is_recorded(request, kind) .or. .not. merge(sweep%rigid, sweep%flexible, rigid)) return
      variable%kind = real_value
      variable%record = kind
      variable%axes = [character(len=name_length) :: axis_names(kind), speed_axis, stiffness_axis]
      if (rigid) variable%axes(3) = ''
      do item = 1, size(request%quantities)
         associate (observable => observables(request%quantities(item)))
            if (rigid .and. observable%flexible_only) cycle
            do part = 1, parts(kind)
               variable%item = item
               variable%part = part
               variable%name = name_of(kind, trim(observable%name), part, rigid)
               variable%quantity = variable%name
               variable%units = merge(observable%units, observable%rate_units, part == 1)
               variable%long_name = trim(descriptions(part, kind))//' '//observable%long_name
               if (rigid) variable%long_name = rigid_description//trim(variable%long_name)
               variables = [variables, variable]
            end do
         end associate
      end do
   end function record_variables

   !> Name of a variable in the file.
   pure function name_of(kind, quantity, part, rigid) result(name)
      !> `record_...`.
      integer, intent(in) :: kind
      !> Name of the quantity.
      character(len=*), intent(in) :: quantity
      !> 1 values, 2 rates.
      integer, intent(in) :: part
      !> On the rigid support.
      logical, intent(in) :: rigid
      !> Its path.
      character(len=:), allocatable :: name

      name = quantity
      if (kind /= record_history) then
         name = trim(prefixes(kind))
         if (quantity /= 'y1') name = name//'_'//quantity
      end if
      if (part == 2) name = name//'_rate'
      if (rigid) name = rigid_prefix//name
      if (kind == record_history) name = history_group//'/'//name
   end function name_of

   !> The values of a variable, out of a record.
   pure subroutine get_record(record, variable, values)
      !> What was recorded of a point.
      type(record_type), intent(in) :: record
      !> The variable.
      type(variable_type), intent(in) :: variable
      !> Its values; NaN where nothing was recorded.
      real(wp), intent(out) :: values(:)

      values = nan()
      select case (variable%record)
      case (record_spectrum)
         if (allocated(record%spectrum)) values = record%spectrum(:, variable%item)
      case (record_section)
         if (allocated(record%section)) values = record%section(:, variable%part, variable%item)
      case (record_history)
         if (allocated(record%history)) values = record%history(:, variable%part, variable%item)
      end select
   end subroutine get_record

   !> Bytes that a kind of record takes in the file.
   pure function record_bytes(sweep, request, kind) result(bytes)
      !> Grid asked for.
      type(sweep_spec), intent(in) :: sweep
      !> What a deck asks for.
      type(record_request), intent(in) :: request
      !> `record_...`.
      integer, intent(in) :: kind
      !> The bytes.
      real(wp) :: bytes

      real(wp), parameter :: bytes_of_real = 8.0_wp

      bytes = bytes_of_real*real(record_length(request, kind), wp)*real(sweep%speed_count, wp) &
              *(real(size(record_variables(sweep, request, kind, rigid=.true.)), wp) &
                + real(sweep%stiffness_count, wp)*real(size(record_variables(sweep, request, kind, rigid=.false.)), wp))
   end function record_bytes

end module spurflex_io_record_layout
