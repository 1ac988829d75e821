!> The linear part of the equations in its own modes.
!>
!> With the mean mesh stiffness and the mesh damping moved to the linear side, the equations of `spurflex_model_equations`
!> become, in complex modes scaled so that each gives its real part to the mesh deflection,
!>
!>     z_j' = lambda_j z_j - b_j N,   g.q = sum_j Re z_j,   N = k_m f(delta) + c_m e_m' - F - k_m0 g.q
!>
!> so that one scalar, N, drives everything. A pair of complex conjugate modes takes one place, a real mode too. Modes
!> that the mesh neither drives nor feels are left out: no steady motion holds them.
module spurflex_model_modal
   use spurflex_base_error, only: error_type, fatal_error
   use spurflex_base_kinds, only: wp
   use spurflex_external_lapack, only: invert_positive_definite, invert_complex, eigenvectors
   use spurflex_model_equations, only: equations_type
   implicit none
   private

   public :: modal_system, new_modal_system, same_modes
   public :: to_modes, from_modes, sum_of_moduli

   !> Share of the largest mode below which the mesh does not drive a mode: the square of round-off, for the mesh must neither
   !> drive it nor feel it.
   real(wp), parameter :: undriven = 1.0e-26_wp

   !> Round-off of a well-conditioned mode after a mesh period, in units of the machine's.
   real(wp), parameter :: roundoff_units = 64.0_wp

   !> Share of what gives way to the mesh force from which on a mode is felt.
   real(wp), parameter :: felt_share = 0.02_wp

   !> The linear part in its modes.
   type :: modal_system
      !> Places: pairs of complex modes and real modes.
      integer :: modes = 0
      !> Relative error that round-off may leave in a motion: grows where modes nearly meet, as at critical damping [-].
      real(wp) :: roundoff = 0.0_wp
      !> Eigenvalues lambda_j, shape (modes) [1/s].
      complex(wp), allocatable :: rate(:)
      !> The mode is real: its imaginary part stays zero, shape (modes).
      logical, allocatable :: is_real(:)
      !> What the mesh force drives, b_j, shape (modes) [m/(N s)].
      complex(wp), allocatable :: influence(:)
      !> y1, d_x1, d_y1, d_x2, d_y2 are the real part of this times z, shape (5, modes).
      complex(wp), allocatable :: observation(:, :)
      !> What a component of a state, real parts of the modes and then imaginary parts, counts for in a norm in metres: the
      !> largest displacement of its mode, the mesh deflection included; nothing for the imaginary part of a real mode,
      !> shape (2 modes).
      real(wp), allocatable :: weight(:)
      !> Rate of the fastest mode that the mesh feels: of those that give way to it, the others follow at once [1/s].
      real(wp) :: fastest = 0.0_wp
      !> z = this times [q, q'], shape (modes, 2 n).
      complex(wp), allocatable :: to_modes(:, :)
      !> [q, q'] is the real part of this times z, shape (2 n, modes).
      complex(wp), allocatable :: from_modes(:, :)
   end type modal_system

contains

   !> Find the modes. They do not depend on the speed.
   subroutine new_modal_system(equations, modal, error)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The modes.
      type(modal_system), intent(out) :: modal
      !> Set where the modes cannot be found, or do not span the motion.
      type(error_type), allocatable, intent(out) :: error

      real(wp), allocatable :: state_matrix(:, :), inverse_mass(:, :), drive(:)
      complex(wp), allocatable :: values(:), vectors(:, :), inverse(:, :), gain(:)
      logical, allocatable :: kept(:)
      integer, allocatable :: place(:)
      integer :: n, i, j

      n = equations%n
      call invert_positive_definite(equations%mass, inverse_mass, error)
      if (allocated(error)) return
      allocate (state_matrix(2*n, 2*n), source=0.0_wp)
      do i = 1, n
         state_matrix(i, n + i) = 1.0_wp
         do j = 1, n
            state_matrix(n + i, j) = -inverse_mass(i, j)*equations%stiffness(j)
            state_matrix(n + i, n + j) = -inverse_mass(i, j)*equations%damping(j)
         end do
      end do
      drive = matmul(inverse_mass, equations%direction)
      do j = 1, n
         state_matrix(n + 1:, j) = state_matrix(n + 1:, j) - drive*equations%direction(j)*equations%mesh%mean_stiffness
         state_matrix(n + 1:, n + j) = state_matrix(n + 1:, n + j) - drive*equations%direction(j)*equations%mesh%damping
      end do

      call eigenvectors(state_matrix, values, vectors, error)
      if (allocated(error)) return
      call invert_complex(vectors, inverse, error)
      if (allocated(error)) then
         call fatal_error(error, 'the modes of the linear system do not span its motion: '//error%message)
         return
      end if

      allocate (gain(2*n))
      allocate (kept(2*n))
      do j = 1, 2*n
         gain(j) = sum(equations%direction*vectors(:n, j))
         if (aimag(values(j)) > 0.0_wp) gain(j) = 2.0_wp*gain(j)
         kept(j) = aimag(values(j)) >= 0.0_wp
      end do
      call leave_out_undriven(gain, matmul(inverse(:, n + 1:), drive), values, kept)

      place = pack([(j, j=1, 2*n)], kept)
      modal%modes = size(place)
      modal%rate = values(place)
      modal%is_real = .not. abs(aimag(modal%rate)) > 0.0_wp
      allocate (modal%to_modes(modal%modes, 2*n), modal%from_modes(2*n, modal%modes), modal%observation(5, modal%modes))
      do j = 1, modal%modes
         modal%to_modes(j, :) = gain(place(j))*inverse(place(j), :)
         modal%from_modes(:, j) = merge(1.0_wp, 2.0_wp, modal%is_real(j))*vectors(:, place(j))/gain(place(j))
      end do
      modal%roundoff = roundoff_units*epsilon(1.0_wp)*maxval([(sum(abs(inverse(place(j), :)*vectors(:, place(j)))), &
                                                               j=1, modal%modes)])
      modal%influence = matmul(modal%to_modes(:, n + 1:), drive)
      modal%observation = matmul(equations%observation, modal%from_modes(:n, :))
      allocate (modal%weight(2*modal%modes))
      do j = 1, modal%modes
         modal%weight([j, modal%modes + j]) = max(1.0_wp, maxval(abs(modal%observation(:, j))))
         if (modal%is_real(j)) modal%weight(modal%modes + j) = 0.0_wp
      end do
      associate (give => abs(modal%influence/modal%rate))
         modal%fastest = maxval(abs(modal%rate), mask=give >= felt_share*sum(give))
      end associate
   end subroutine new_modal_system

   !> Leave out what the mesh does not drive.
   pure subroutine leave_out_undriven(gain, drive, values, kept)
      !> Share of each mode in the mesh deflection, shape (modes).
      complex(wp), intent(in) :: gain(:)
      !> What the mesh force gives to each mode, shape (modes).
      complex(wp), intent(in) :: drive(:)
      !> Eigenvalues, shape (modes).
      complex(wp), intent(in) :: values(:)
      !> The mode is kept, shape (modes).
      logical, intent(inout) :: kept(:)

      real(wp) :: share(size(gain))

      share = abs(gain*drive/max(abs(values), tiny(1.0_wp)))
      kept = kept .and. share > undriven*maxval(share)
   end subroutine leave_out_undriven

   !> Two points have the same linear part, whatever their speeds.
   pure function same_modes(a, b) result(same)
      !> Equations of motion of both.
      type(equations_type), intent(in) :: a, b
      !> The modes of one are those of the other.
      logical :: same

      ! Neighbours on the grid differ in the stiffness, if at all.
      same = a%n == b%n
      if (same) same = .not. any(abs(a%stiffness - b%stiffness) > 0.0_wp)
      if (same) same = .not. (any(abs(a%damping - b%damping) > 0.0_wp) &
                              .or. any(abs(a%mass - b%mass) > 0.0_wp) .or. any(abs(a%direction - b%direction) > 0.0_wp) &
                              .or. abs(a%mesh%mean_stiffness - b%mesh%mean_stiffness) > 0.0_wp &
                              .or. abs(a%mesh%damping - b%mesh%damping) > 0.0_wp)
   end function same_modes

   !> The modes from the coordinates of the equations of motion.
   pure function to_modes(modal, position, velocity) result(state)
      !> Modes.
      type(modal_system), intent(in) :: modal
      !> Deviation from the static equilibrium and its rate, shape (n).
      real(wp), intent(in) :: position(:), velocity(:)
      !> Real parts, then imaginary parts, shape (2 modes).
      real(wp) :: state(2*modal%modes)

      complex(wp) :: z(modal%modes)

      z = matmul(modal%to_modes, cmplx([position, velocity], 0.0_wp, wp))
      state(:modal%modes) = real(z, wp)
      state(modal%modes + 1:) = merge(0.0_wp, aimag(z), modal%is_real)
   end function to_modes

   !> The coordinates of the equations of motion from the modes.
   pure subroutine from_modes(modal, state, position, velocity)
      !> Modes.
      type(modal_system), intent(in) :: modal
      !> Real parts, then imaginary parts, shape (2 modes).
      real(wp), intent(in) :: state(:)
      !> Deviation from the static equilibrium and its rate, shape (n).
      real(wp), allocatable, intent(out) :: position(:), velocity(:)

      real(wp) :: w(size(modal%from_modes, 1))

      w = real(matmul(modal%from_modes, cmplx(state(:modal%modes), state(modal%modes + 1:), wp)), wp)
      position = w(:size(w)/2)
      velocity = w(size(w)/2 + 1:)
   end subroutine from_modes

   !> Bound of what a difference of states does to the mesh deflection at any later time, while contact is kept and the mesh
   !> stiffness is the mean one.
   pure function sum_of_moduli(difference) result(bound)
      !> Difference of two states: real parts of the modes, then imaginary parts.
      real(wp), intent(in) :: difference(:)
      !> Sum of the moduli of its modes [m].
      real(wp) :: bound

      integer :: m

      m = size(difference)/2
      bound = sum(sqrt(difference(:m)**2 + difference(m + 1:)**2))
   end function sum_of_moduli

end module spurflex_model_modal
