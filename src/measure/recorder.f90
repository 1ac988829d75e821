!> Spectrum, Poincare section and history of steady motions.
!>
!> A motion is integrated once more from its section. A periodic one is closed first and integrated over its period, which is
!> then repeated; another one is integrated over as many mesh periods as the longest product asks for.
module spurflex_measure_recorder
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use spurflex_base_attendant, only: attendant, no_attendant
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp, pi
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_factory, only: make_map
   use spurflex_integrate_options, only: solver_options
   use spurflex_integrate_period_map, only: period_map, orbit_type
   use spurflex_integrate_steps, only: first_steps
   use spurflex_measure_dense, only: interpolate
   use spurflex_measure_observation, only: observation_type, observed_equations, observe
   use spurflex_measure_record, only: record_request, record_type, lines_of, samples_of, records, mesh_force_observable
   use spurflex_measure_response, only: response, nan, status_missing, status_diverged
   use spurflex_measure_spectrum, only: spectrum_maker, series_type, samples_of_spectrum, strides_of, make_spectra, release_spectra
   use spurflex_model_equations, only: equations_type
   use spurflex_steady_outcome, only: periods_of_motion
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_shooting, only: find_orbit
   implicit none
   private

   public :: recorder_type, new_recorder, release_recorder

   !> Steps of the record, in units of those that collocation begins with.
   integer, parameter :: finer = 2

   !> How far beside its size a motion may lie from the section that was given; farther away it is another one.
   real(wp), parameter :: near = 0.1_wp

   !> What records motions one after the other; keeps what the next one can use again.
   type :: recorder_type
      private
      !> Options, and what is asked for.
      type(solver_options) :: options
      type(record_request) :: request
      !> The integrator.
      class(period_map), allocatable :: map
      !> The period last recorded.
      type(orbit_type) :: orbit
      !> What makes the spectra.
      type(spectrum_maker) :: spectra
   contains
      !> Record a motion.
      procedure :: record => record_motion
   end type recorder_type

   !> A grid of samples in a mesh period.
   type :: grid_type
      !> Phases [rad] and times since the section [s], shape (samples).
      real(wp), allocatable :: phase(:), time(:)
      !> Recorded rows, with as many derivatives as are needed, shape (rows, 1 to 3, samples).
      real(wp), allocatable :: motion(:, :, :)
      !> Quantities without their offsets, and their rates if those are wanted, shape (samples, 1 or 2, quantities).
      real(wp), allocatable :: seen(:, :, :)
   end type grid_type

contains

   !> Make a recorder.
   subroutine new_recorder(options, request, recorder)
      !> Options; with free steps the record is made by collocation, with given ones by the integrator they are for.
      type(solver_options), intent(in) :: options
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> The recorder.
      type(recorder_type), intent(out) :: recorder

      recorder%options = options
      recorder%request = request
      if (.not. allocated(request%quantities)) allocate (recorder%request%quantities(0))
      if (options%steps_per_period == 0) then
         allocate (collocation_map :: recorder%map)
      else
         call make_map(options, recorder%map)
      end if
   end subroutine new_recorder

   !> Give up what is kept for the next motion.
   subroutine release_recorder(recorder)
      !> The recorder.
      type(recorder_type), intent(inout) :: recorder

      call release_spectra(recorder%spectra)
   end subroutine release_recorder

   !> Record the motion of one point. What cannot be recorded is NaN: a point that diverged, a quantity that the support lacks.
   subroutine record_motion(self, equations, position, velocity, answer, record, error, visitor)
      !> The recorder.
      class(recorder_type), intent(inout) :: self
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Deviation from the static equilibrium and its rate at a section of the motion, shape (n).
      real(wp), intent(in) :: position(:), velocity(:)
      !> Its response.
      type(response), intent(in) :: answer
      !> The record.
      type(record_type), intent(out) :: record
      !> Set where the motion cannot be integrated or transformed, though it was found.
      type(error_type), allocatable, intent(out) :: error
      !> Let in between the periods.
      class(attendant), intent(inout), optional :: visitor

      type(no_attendant) :: nobody

      call empty_record(self%request, record)
      if (.not. records(self%request) .or. answer%status == status_missing .or. answer%status == status_diverged) return
      if (present(visitor)) then
         call follow_motion(self, equations, position, velocity, periods_of_motion(answer%motion), visitor, record, error)
      else
         call follow_motion(self, equations, position, velocity, periods_of_motion(answer%motion), nobody, record, error)
      end if
   end subroutine record_motion

   !> A record in which nothing is known.
   subroutine empty_record(request, record)
      !> What is asked for.
      type(record_request), intent(in) :: request
      !> The record.
      type(record_type), intent(out) :: record

      associate (quantities => size(request%quantities))
         if (request%spectrum) allocate (record%spectrum(lines_of(request), quantities), source=nan())
         if (request%section) allocate (record%section(request%sections, 2, quantities), source=nan())
         if (request%history) allocate (record%history(samples_of(request), 2, quantities), source=nan())
      end associate
   end subroutine empty_record

   !> Integrate the motion and take from it what is asked for.
   subroutine follow_motion(self, equations, position, velocity, periods, visitor, record, error)
      !> The recorder.
      class(recorder_type), intent(inout) :: self
      !> Equations of motion of the point.
      type(equations_type), intent(in) :: equations
      !> Section of the motion, shape (n).
      real(wp), intent(in) :: position(:), velocity(:)
      !> Mesh periods after which it repeats; 0 if it does not.
      integer, intent(in) :: periods
      !> Let in between the periods.
      class(attendant), intent(inout) :: visitor
      !> The record, filled in.
      type(record_type), intent(inout) :: record
      !> Set where the motion cannot be integrated or transformed.
      type(error_type), allocatable, intent(out) :: error

      type(equations_type) :: observed
      type(observation_type) :: observation
      type(grid_type) :: sections, samples, history
      type(series_type) :: signal(size(self%request%quantities))
      real(wp), allocatable :: state(:), past(:, :, :), section(:, :, :)
      integer :: stride(size(self%request%quantities))
      integer :: span, spectrum_span, section_span, history_span, coarse, steps, p, i

      call observed_equations(equations, self%request%quantities, observed, observation)
      coarse = first_steps(equations)
      steps = self%options%steps_per_period
      if (steps == 0) steps = finer*coarse
      call self%map%load(observed, steps, error)
      if (allocated(error)) return
      state = self%map%to_state(position, velocity)
      if (periods > 0) call close_motion(self%map, periods, visitor, state)

      associate (request => self%request)
         section_span = span_of(request%section, periods, request%sections)
         spectrum_span = span_of(request%spectrum, periods, request%spectrum_periods)
         history_span = span_of(request%history, periods, request%history_periods)
         call set_grid(1, self%map%period, observed, request%quantities, .true., sections)
         call set_grid(samples_of_spectrum(request, coarse), self%map%period, observed, request%quantities, .false., samples)
         call set_grid(request%history_samples, self%map%period, observed, request%quantities, .true., history)
         allocate (section(section_span, 2, size(request%quantities)))
         stride = strides_of(request)
         do i = 1, size(signal)
            allocate (signal(i)%value(spectrum_span*(size(samples%time)/stride(i))))
         end do
         allocate (past(history_span*size(history%time) + 1, 2, size(request%quantities)), source=0.0_wp)
      end associate
      span = max(section_span, spectrum_span, history_span)
      do p = 1, span
         call self%map%advance(state, orbit=self%orbit)
         if (.not. all(ieee_is_finite(state))) return
         if (p <= section_span) then
            call look(self%orbit, observation, sections)
            section(p, :, :) = sections%seen(1, :, :)
         end if
         if (p <= spectrum_span) then
            call look(self%orbit, observation, samples)
            do i = 1, size(signal)
               associate (n => size(samples%time)/stride(i))
                  signal(i)%value((p - 1)*n + 1:p*n) = samples%seen(::stride(i), 1, i)
               end associate
            end do
         end if
         if (p <= history_span) then
            call look(self%orbit, observation, history)
            associate (n => size(history%time))
               past((p - 1)*n + 1:p*n, :, :) = history%seen
            end associate
            if (p == history_span) then
               ! The end of the last period is the section of the next one, which may not come.
               sections%time = self%map%period
               call look(self%orbit, observation, sections)
               past(size(past, 1), :, :) = sections%seen(1, :, :)
               sections%time = 0.0_wp
            end if
         end if
         call visitor%attend()
      end do
      call add_offsets(observation, section)
      call add_offsets(observation, past)
      if (self%request%section) call repeat_series(section, record%section)
      if (self%request%history) then
         if (periods > 0) then
            call repeat_series(past(:history_span*size(history%time), :, :), record%history)
         else
            record%history = past
         end if
      end if
      if (self%request%spectrum) call make_spectra(self%spectra, self%request, observation, signal, periods, record%spectrum, error)
   end subroutine follow_motion

   !> Mesh periods that must be integrated for a product.
   pure function span_of(wanted, periods, longest) result(span)
      !> The product is asked for.
      logical, intent(in) :: wanted
      !> Mesh periods after which the motion repeats; 0 if it does not.
      integer, intent(in) :: periods
      !> Mesh periods that the product shows.
      integer, intent(in) :: longest
      !> Mesh periods to be integrated.
      integer :: span

      span = 0
      if (wanted) span = merge(periods, longest, periods > 0)
   end function span_of

   !> Find the motion again, as the map of the record has it; where that fails the section remains as it was given.
   subroutine close_motion(map, periods, visitor, state)
      !> The map.
      class(period_map), intent(inout), target :: map
      !> Mesh periods after which the motion repeats.
      integer, intent(in) :: periods
      !> Let in now and then.
      class(attendant), intent(inout) :: visitor
      !> Section of the motion, shape (size).
      real(wp), intent(inout) :: state(:)

      type(periodic_orbit) :: orbit
      real(wp) :: scale
      logical :: found

      scale = max(weighted_norm(map%weight, state), map%half_backlash, tiny(1.0_wp))
      call find_orbit(map, state, periods, scale, visitor, orbit, found)
      if (.not. found) return
      if (weighted_norm(map%weight, orbit%state - state) <= near*scale) state = orbit%state
   end subroutine close_motion

   !> Prepare a grid of samples.
   pure subroutine set_grid(samples, period, observed, quantities, with_rates, grid)
      !> Samples in a mesh period.
      integer, intent(in) :: samples
      !> Mesh period [s].
      real(wp), intent(in) :: period
      !> Equations of motion with what is recorded.
      type(equations_type), intent(in) :: observed
      !> Quantities, as positions in `observables`.
      integer, intent(in) :: quantities(:)
      !> Their rates are wanted too.
      logical, intent(in) :: with_rates
      !> The grid.
      type(grid_type), intent(out) :: grid

      integer :: i, rates

      grid%phase = [(2.0_wp*pi*real(i, wp)/real(samples, wp), i=0, samples - 1)]
      grid%time = grid%phase*(period/(2.0_wp*pi))
      rates = merge(1, 0, with_rates)
      ! The mesh force has a rate in it.
      allocate (grid%motion(size(observed%recorded, 1), 1 + rates + count([any(quantities == mesh_force_observable)]), samples))
      allocate (grid%seen(samples, 1 + rates, size(quantities)))
   end subroutine set_grid

   !> Look at the period last recorded.
   subroutine look(orbit, observation, grid)
      !> The period.
      type(orbit_type), intent(in) :: orbit
      !> What is observed.
      type(observation_type), intent(in) :: observation
      !> Grid whose samples are filled in.
      type(grid_type), intent(inout) :: grid

      call interpolate(orbit, grid%time, grid%motion)
      call observe(observation, grid%phase, grid%motion, grid%seen)
   end subroutine look

   !> Put the static offsets back.
   pure subroutine add_offsets(observation, series)
      !> What is observed.
      type(observation_type), intent(in) :: observation
      !> Values and rates, shape (samples, 2, quantities).
      real(wp), intent(inout) :: series(:, :, :)

      integer :: i

      do i = 1, size(series, 3)
         series(:, 1, i) = series(:, 1, i) + observation%offset(i)
      end do
   end subroutine add_offsets

   !> Repeat a series as often as it takes.
   pure subroutine repeat_series(series, repeated)
      !> Samples, shape (length, 2, quantities).
      real(wp), intent(in) :: series(:, :, :)
      !> The same over and over, shape (samples, 2, quantities).
      real(wp), intent(out) :: repeated(:, :, :)

      integer :: i

      do i = 1, size(repeated, 1)
         repeated(i, :, :) = series(1 + mod(i - 1, size(series, 1)), :, :)
      end do
   end subroutine repeat_series

end module spurflex_measure_recorder
