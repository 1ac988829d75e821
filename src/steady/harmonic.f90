!> The motion that keeps contact, by harmonic balance.
!>
!> While the teeth never part the equations are Hill's: linear, with coefficients of the mesh period T. Their steady motion is a
!> Fourier series of that period. In the modes of `spurflex_model_modal`, driven by the one scalar N,
!>
!>     x_k = -H_k N_k,   H_k = sum_j [b_j/(i k w - lambda_j) + conj(b_j)/(i k w - conj(lambda_j))]/2,   x = g.q
!>     N_k = u_k + sum_m kappa_m x_(k-m)
!>
!> with kappa_m the lines of k_m - k_m0 and u_k those of k_m (delta_s + e_m - side b) + c_m e_m' - F. Beyond the highest mode the
!> lines fall off faster than any power, so that some tens of them give the motion to round-off: nothing is integrated.
module spurflex_steady_harmonic
   use spurflex_base_error, only: error_type
   use spurflex_base_kinds, only: wp
   use spurflex_external_lapack, only: solve_banded
   use spurflex_model_equations, only: equations_type
   use spurflex_model_modal, only: modal_system
   implicit none
   private

   public :: harmonic_motion, find_harmonic_motion, section_of, harmonic_displacements, orders

   !> Highest orders that are tried, one after the other.
   integer, parameter :: orders(9) = [12, 16, 24, 32, 48, 64, 96, 192, 384]

   !> Orders beyond the fastest mode and the excitation that are taken at first.
   integer, parameter :: spare_orders = 8

   !> What the lines left out may give to the mesh deflection, beside its largest line.
   real(wp), parameter :: negligible = 1.0e-14_wp

   !> Frequency responses of modes: P = 1/(i k w - lambda_j) and Q = 1/(i k w - conj(lambda_j)) as P + Q and i (P - Q). A real part
   !> of f z_j, driven by N_k, is -N_k [Re f (P + Q) + Im f (i (P - Q))]/2.
   type :: mode_lines
      !> P + Q and i (P - Q), shape (0:order, modes) [s].
      complex(wp), allocatable :: total(:, :), turned(:, :)
   end type mode_lines

   !> The series of one point.
   type :: harmonic_motion
      !> Highest order, in multiples of the mesh frequency; 0 where no series converged.
      integer :: order = 0
      !> Mesh frequency [rad/s].
      real(wp) :: frequency = 0.0_wp
      !> Lines of the mesh deflection delta, the static one included, and of N, shape (0:order); those of negative order are
      !> their conjugates [m], [N].
      complex(wp), allocatable :: deflection(:), force(:)
      !> What the lines left out give to the mesh deflection, beside its largest line [-].
      real(wp) :: left_out = 0.0_wp
      !> Frequency responses of every mode, with those of the lines left out, shape (0:order and more, modes) [s].
      type(mode_lines), private :: modes
   end type harmonic_motion

contains

   !> Find the motion as if contact was never lost on the flank that carries the load.
   subroutine find_harmonic_motion(modal, equations, motion)
      !> Modes of the linear part.
      type(modal_system), intent(in) :: modal
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> The motion; its order is zero where there is none.
      type(harmonic_motion), intent(out) :: motion

      integer :: lowest, i
      logical :: found

      motion%frequency = equations%frequency
      lowest = size(equations%mesh%stiffness_coefficients) + size(equations%mesh%error_amplitudes)
      lowest = max(lowest, ceiling(min(modal%fastest/equations%frequency, real(maxval(orders), wp)))) + spare_orders
      do i = 1, size(orders)
         if (orders(i) < lowest) cycle
         motion%order = orders(i)
         call balance(modal, equations, motion, found)
         if (.not. found) exit
         if (motion%left_out <= negligible) return
      end do
      motion%order = 0
   end subroutine find_harmonic_motion

   !> Balance the harmonics up to some order.
   subroutine balance(modal, equations, motion, found)
      !> Modes of the linear part.
      type(modal_system), intent(in) :: modal
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Order and frequency before, the motion after.
      type(harmonic_motion), intent(inout) :: motion
      !> There is one.
      logical, intent(out) :: found

      complex(wp) :: compliance(0:motion%order + size(equations%mesh%stiffness_coefficients))
      complex(wp), dimension(0:motion%order) :: stiffness, tooth_error, drive
      complex(wp) :: band(3*size(equations%mesh%stiffness_coefficients) + 1, -motion%order:motion%order)
      complex(wp) :: x(-motion%order:motion%order)
      type(error_type), allocatable :: error
      integer :: h, k, m, n

      n = motion%order
      h = size(equations%mesh%stiffness_coefficients)
      call set_modes(modal, motion%frequency, n + h, motion%modes)
      compliance = lines_of(motion%modes, modal%influence, n + h)
      call set_excitation(equations, n, stiffness, tooth_error, drive)
      band = (0.0_wp, 0.0_wp)
      do k = -n, n
         band(2*h + 1, k) = -1.0_wp/compliance(abs(k))
         if (k < 0) band(2*h + 1, k) = conjg(band(2*h + 1, k))
         x(k) = drive(abs(k))
         if (k < 0) x(k) = conjg(x(k))
         do m = 1, h
            ! Order k reaches the orders k + m and k - m.
            if (k + m <= n) band(2*h + 1 + m, k) = -stiffness(m)
            if (k - m >= -n) band(2*h + 1 - m, k) = -conjg(stiffness(m))
         end do
      end do
      call solve_banded(h, band, x, error)
      found = .not. allocated(error)
      if (.not. found) return
      if (allocated(motion%force)) deallocate (motion%force, motion%deflection)
      allocate (motion%force(0:n), motion%deflection(0:n))
      motion%force(:) = -x(0:n)/compliance(0:n)
      motion%left_out = 0.0_wp
      do m = 1, h
         motion%left_out = motion%left_out + abs(compliance(n + m))*sum(abs(stiffness(m:h)))*maxval(abs(x(n - h + 1:n)))
      end do
      motion%left_out = motion%left_out/max(maxval(abs(x(0:n))), tiny(1.0_wp))
      motion%deflection(:) = x(0:n) + tooth_error
      motion%deflection(0) = motion%deflection(0) + equations%static_deflection
      ! Not a number is no motion.
      found = motion%left_out < huge(1.0_wp)
   end subroutine balance

   !> Lines of the excitation by the mesh.
   pure subroutine set_excitation(equations, order, stiffness, tooth_error, drive)
      !> Equations of motion.
      type(equations_type), intent(in) :: equations
      !> Highest order.
      integer, intent(in) :: order
      !> Lines of the mesh stiffness without its mean, of e_m, and of u, shape (0:order) [N/m], [m], [N].
      complex(wp), dimension(0:order), intent(out) :: stiffness, tooth_error, drive

      complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
      complex(wp) :: one, other
      real(wp) :: gap
      integer :: n, m, k

      stiffness = (0.0_wp, 0.0_wp)
      tooth_error = (0.0_wp, 0.0_wp)
      associate (mesh => equations%mesh)
         do n = 1, size(mesh%stiffness_coefficients)
            stiffness(n) = -0.5_wp*i*mesh%mean_stiffness*mesh%stiffness_coefficients(n)*exp(i*mesh%stiffness_phases(n))
         end do
         do n = 1, size(mesh%error_amplitudes)
            tooth_error(n) = -0.5_wp*i*mesh%error_amplitudes(n)*exp(i*mesh%error_phases(n))
         end do
         gap = equations%static_deflection - sign(mesh%half_backlash, equations%static_deflection)
         do k = 0, order
            drive(k) = stiffness(k)*gap + tooth_error(k)*(mesh%mean_stiffness + i*k*equations%frequency*mesh%damping)
         end do
         drive(0) = drive(0) + mesh%mean_stiffness*gap - equations%mean_force
         ! Stiffness times error: orders n + m, and n - m.
         do n = 1, size(mesh%stiffness_coefficients)
            do m = 1, size(mesh%error_amplitudes)
               drive(n + m) = drive(n + m) + stiffness(n)*tooth_error(m)
               one = stiffness(n)*conjg(tooth_error(m))
               other = conjg(one)
               if (n > m) drive(n - m) = drive(n - m) + one
               if (n < m) drive(m - n) = drive(m - n) + other
               if (n == m) drive(0) = drive(0) + one + other
            end do
         end do
      end associate
   end subroutine set_excitation

   !> Find the frequency responses of the modes.
   pure subroutine set_modes(modal, frequency, order, modes)
      !> Modes.
      type(modal_system), intent(in) :: modal
      !> Mesh frequency w [rad/s].
      real(wp), intent(in) :: frequency
      !> Highest order k.
      integer, intent(in) :: order
      !> The responses.
      type(mode_lines), intent(inout) :: modes

      real(wp), dimension(0:order) :: below, above, first, second
      real(wp) :: a
      integer :: j, k

      if (allocated(modes%total)) deallocate (modes%total, modes%turned)
      allocate (modes%total(0:order, modal%modes), modes%turned(0:order, modal%modes))
      do j = 1, modal%modes
         a = -real(modal%rate(j), wp)
         do k = 0, order
            below(k) = real(k, wp)*frequency - aimag(modal%rate(j))
            above(k) = real(k, wp)*frequency + aimag(modal%rate(j))
            first(k) = 1.0_wp/(a*a + below(k)*below(k))
            second(k) = 1.0_wp/(a*a + above(k)*above(k))
         end do
         do k = 0, order
            modes%total(k, j) = cmplx(a*(first(k) + second(k)), -(below(k)*first(k) + above(k)*second(k)), wp)
            modes%turned(k, j) = cmplx(below(k)*first(k) - above(k)*second(k), a*(first(k) - second(k)), wp)
         end do
      end do
   end subroutine set_modes

   !> Frequency response to N of what is the real part of a sum over the modes, without its sign:
   !> sum_j [f_j/(i k w - lambda_j) + conj(f_j)/(i k w - conj(lambda_j))]/2.
   pure function lines_of(modes, factor, order) result(lines)
      !> Responses of the modes.
      type(mode_lines), intent(in) :: modes
      !> f: what a mode is driven with, times what it counts for, shape (modes).
      complex(wp), intent(in) :: factor(:)
      !> Highest order k.
      integer, intent(in) :: order
      !> The response, shape (0:order).
      complex(wp) :: lines(0:order)

      real(wp) :: p, q
      integer :: j

      lines = (0.0_wp, 0.0_wp)
      do j = 1, size(factor)
         p = 0.5_wp*real(factor(j), wp)
         q = 0.5_wp*aimag(factor(j))
         lines = lines + p*modes%total(0:order, j) + q*modes%turned(0:order, j)
      end do
   end function lines_of

   !> State of the modes at the section, where the mesh period begins.
   pure function section_of(modal, motion) result(state)
      !> Modes.
      type(modal_system), intent(in) :: modal
      !> The motion.
      type(harmonic_motion), intent(in) :: motion
      !> Real parts, then imaginary parts, shape (2 modes).
      real(wp) :: state(2*modal%modes)

      complex(wp) :: z
      real(wp) :: re, im
      integer :: j, k

      do j = 1, modal%modes
         ! Orders k and -k together: N_k P + conj(N_k Q).
         re = 0.5_wp*real(motion%force(0)*motion%modes%total(0, j), wp)
         im = -0.5_wp*real(motion%force(0)*motion%modes%turned(0, j), wp)
         do k = 1, motion%order
            re = re + real(motion%force(k)*motion%modes%total(k, j), wp)
            im = im - real(motion%force(k)*motion%modes%turned(k, j), wp)
         end do
         z = -modal%influence(j)*cmplx(re, im, wp)
         state(j) = real(z, wp)
         state(modal%modes + j) = merge(0.0_wp, aimag(z), modal%is_real(j))
      end do
   end function section_of

   !> Lines of y1, d_x1, d_y1, d_x2 and d_y2, as deviations from the static equilibrium.
   pure function harmonic_displacements(modal, motion) result(lines)
      !> Modes.
      type(modal_system), intent(in) :: modal
      !> The motion.
      type(harmonic_motion), intent(in) :: motion
      !> The lines, shape (0:order, 5) [m].
      complex(wp) :: lines(0:motion%order, size(modal%observation, 1))

      integer :: i

      do i = 1, size(modal%observation, 1)
         lines(:, i) = -motion%force*lines_of(motion%modes, modal%observation(i, :)*modal%influence, motion%order)
      end do
   end function harmonic_displacements

end module spurflex_steady_harmonic
