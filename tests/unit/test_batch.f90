!> What is done with several seats at once: small linear systems, powers of matrices, Newton's method, transients.
module test_batch
   use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
   use cases, only: flexible_point, reference_box, reference_gears, reference_load, rigid_point
   use floating, only: run_untrapped, same_bits
   use period_maps, only: single_dof_equations, single_dof_type
   use pseudo_random, only: random_stream
   use spurflex_base_attendant, only: no_attendant
   use spurflex_base_error, only: library_error => error_type
   use spurflex_base_kinds, only: wp
   use spurflex_base_text, only: to_text
   use spurflex_external_lapack, only: solve_real
   use spurflex_integrate_collocation, only: collocation_map
   use spurflex_integrate_lane_ensemble, only: lane_ensemble, narrow, widen
   use spurflex_integrate_lane_rule, only: lanes
   use spurflex_model_equations, only: equations_type, new_equations
   use spurflex_model_modal, only: modal_system, new_modal_system
   use spurflex_steady_batch, only: batch, contracting, solve_batch
   use spurflex_steady_sections, only: weighted_norm
   use spurflex_steady_orbit, only: periodic_orbit
   use spurflex_steady_shooting, only: find_orbit, find_orbits
   use spurflex_steady_stability, only: find_stable_orbits, follow_orbits
   use spurflex_steady_transient, only: advance_transients, begin_transient, transient_type, watch_from_now
   use test_support, only: check, error_type, new_unittest, test_failed, unittest_type
   implicit none
   private

   public :: collect_batch

   !> Size of the motions [m].
   real(wp), parameter :: motion_size = 1.0e-5_wp

   !> Points at which Newton's method looks for motions: speeds [rev/min], each on a rigid and on a flexible support, periods of
   !> their motions, and multiples of them that are looked for too.
   integer, parameter :: speeds = 10
   real(wp), parameter :: speed(speeds) = [900.0_wp, 1500.0_wp, 2000.0_wp, 2600.0_wp, 3000.0_wp, 3500.0_wp, 4100.0_wp, 4600.0_wp, &
                                           5500.0_wp, 6000.0_wp]
   integer, parameter :: repeats(speeds) = [1, 1, 1, 1, 1, 1, 1, 1, 2, 2]

contains

   !> The tests of this suite.
   subroutine collect_batch(testsuite)
      !> The tests, shape (tests).
      type(unittest_type), allocatable, intent(out) :: testsuite(:)

      testsuite = [ &
                  new_unittest('random systems as by LAPACK', test_solve_random), &
                  new_unittest('badly scaled systems as by LAPACK', test_solve_scaled), &
                  new_unittest('systems that need pivoting', test_solve_pivots), &
                  new_unittest('no system depends on its neighbours', test_solve_alone), &
                  new_unittest('powers that shrink', test_contracting), &
                  new_unittest('powers that grow before they shrink', test_not_normal), &
                  new_unittest('zero, nilpotent, orthogonal, far out', test_special), &
                  new_unittest('what is not a number does not contract', test_not_finite), &
                  new_unittest('no power depends on its neighbours', test_power_alone), &
                  new_unittest('orbits as by collocation', test_orbits), &
                  new_unittest('no bit of an orbit depends on the others', test_orbits_alone), &
                  new_unittest('a hopeless member disturbs no other', test_hopeless), &
                  new_unittest('a monodromy that is near, or rough', test_near), &
                  new_unittest('shortest periods of stable orbits', test_stable), &
                  new_unittest('stable motions followed to other steps', test_follow), &
                  new_unittest('no bit of a transient depends on the others', test_transients), &
                  new_unittest('latest sections of long transients', test_latest_sections), &
                  new_unittest('a transient that diverges disturbs no other', test_diverging) &
                  ]
   end subroutine collect_batch

   !> A random matrix for each seat.
   subroutine draw(random, n, matrix)
      !> Random numbers.
      type(random_stream), intent(inout) :: random
      !> Rows.
      integer, intent(in) :: n
      !> Entries between -1 and 1.
      real(wp), allocatable, intent(out) :: matrix(:, :, :)

      integer :: i, j

      allocate (matrix(batch, n, n))
      do j = 1, n
         do i = 1, n
            call random%fill(-1.0_wp, 1.0_wp, matrix(:, i, j))
         end do
      end do
   end subroutine draw

   !> Solve systems in seats and by LAPACK.
   subroutine compare_solutions(matrix, right, scale, tolerance, error)
      !> Matrices, shape (batch, n, n).
      real(wp), intent(in) :: matrix(:, :, :)
      !> Right sides, shape (batch, n).
      real(wp), intent(in) :: right(:, :)
      !> Unit of each component of the solution, shape (n).
      real(wp), intent(in) :: scale(:)
      !> Largest difference, beside the largest component in its unit.
      real(wp), intent(in) :: tolerance
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(library_error), allocatable :: fault
      real(wp) :: destroyed(batch, size(right, 2), size(right, 2)), solution(batch, size(right, 2))
      real(wp), allocatable :: single(:, :), expected(:)
      integer :: l

      destroyed = matrix
      solution = right
      call solve_batch(size(right, 2), destroyed, solution)
      do l = 1, batch
         single = matrix(l, :, :)
         expected = right(l, :)
         call solve_real(single, expected, fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
         call check(error, maxval(abs(solution(l, :) - expected)/scale), 0.0_wp, tolerance*maxval(abs(expected)/scale), &
                    to_text(size(right, 2))//' rows, seat '//to_text(l))
         if (allocated(error)) return
      end do
   end subroutine compare_solutions

   !> Matrices of every size up to thirty-two rows.
   subroutine test_solve_random(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off times the condition of a random matrix, a few thousand at worst.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      type(random_stream) :: random
      real(wp), allocatable :: matrix(:, :, :), right(:, :)
      integer :: n, i, times

      do n = 1, 32
         do times = 1, 3
            call draw(random, n, matrix)
            if (allocated(right)) deallocate (right)
            allocate (right(batch, n))
            do i = 1, n
               call random%fill(-1.0_wp, 1.0_wp, right(:, i))
            end do
            call compare_solutions(matrix, right, spread(1.0_wp, 1, n), tolerance, error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_solve_random

   !> Rows and columns of very different size; those of the rows are the same in both methods, which choose the same pivots.
   subroutine test_solve_scaled(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off times the condition of the matrix without the units, and what badly chosen pivots let grow.
      real(wp), parameter :: tolerance = 1.0e-8_wp
      integer, parameter :: n = 16
      real(wp), parameter :: decades(2) = [8.0_wp, 100.0_wp]
      type(random_stream) :: random
      real(wp), allocatable :: matrix(:, :, :)
      real(wp) :: right(batch, n), row(n), column(n)
      integer :: i, j, k, times

      do k = 1, size(decades)
         do times = 1, 10
            call draw(random, n, matrix)
            call random%fill(-decades(k), decades(k), row)
            call random%fill(-decades(k), decades(k), column)
            row = 10.0_wp**row
            column = 10.0_wp**column
            do j = 1, n
               call random%fill(-1.0_wp, 1.0_wp, right(:, j))
               right(:, j) = row(j)*right(:, j)
               do i = 1, n
                  matrix(:, i, j) = row(i)*matrix(:, i, j)*column(j)
               end do
            end do
            call compare_solutions(matrix, right, 1.0_wp/column, tolerance, error)
            if (allocated(error)) return
         end do
      end do
   end subroutine test_solve_scaled

   !> Zeros on the diagonal, in different rows of each seat: permutations, and pivots that appear on the way.
   subroutine test_solve_pivots(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Round-off times the condition of a random matrix.
      real(wp), parameter :: tolerance = 1.0e-10_wp
      integer, parameter :: n = 16
      type(random_stream) :: random
      real(wp), allocatable :: matrix(:, :, :)
      real(wp) :: right(batch, n)
      integer :: i, l, kind

      do kind = 1, 3
         call draw(random, n, matrix)
         do i = 1, n
            call random%fill(-1.0_wp, 1.0_wp, right(:, i))
         end do
         if (kind == 1) matrix = 0.0_wp
         do l = 1, batch
            do i = 1, n
               select case (kind)
               case (1)
                  ! A cyclic permutation, another in each seat; none in the last.
                  matrix(l, i, 1 + mod(i + l - 1 + n - batch, n)) = real(i, wp)
               case (2)
                  matrix(l, i, i) = 0.0_wp
               case (3)
                  ! The second pivot vanishes on the way, but for round-off of a tiny entry, in every second seat.
                  if (mod(l, 2) == 0 .and. i <= 2) matrix(l, i, :2) = [1.0_wp, 1.0_wp + 1.0e-14_wp*real(i, wp)]
               end select
            end do
         end do
         call compare_solutions(matrix, right, spread(1.0_wp, 1, n), tolerance, error)
         if (allocated(error)) return
      end do
   end subroutine test_solve_pivots

   !> A system has the same solution, bit by bit, in every seat and beside any others, singular ones and worse.
   subroutine test_solve_alone(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call run_untrapped(solve_alone, error)
   end subroutine test_solve_alone

   !> The same, where nothing is trapped.
   subroutine solve_alone(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: n = 16
      type(random_stream) :: random
      real(wp), allocatable :: matrix(:, :, :), work(:, :, :)
      real(wp) :: right(batch, n), expected(batch, n), found(batch, n)
      integer :: l, i, kind

      call draw(random, n, matrix)
      do i = 1, n
         call random%fill(-1.0_wp, 1.0_wp, right(:, i))
      end do
      work = matrix
      expected = right
      call solve_batch(n, work, expected)
      do i = 1, batch - 1
         work = matrix
         found = right
         work = cshift(work, i, 1)
         found = cshift(found, i, 1)
         call solve_batch(n, work, found)
         call check(error, all(same_bits(cshift(found, -i, 1), expected)), 'moved by '//to_text(i)//' seats')
         if (allocated(error)) return
      end do
      do l = 1, batch
         do kind = 1, 4
            work = matrix
            found = right
            select case (kind)
            case (1)
               work(l, :, :) = 0.0_wp
            case (2)
               work(l, 3, :) = work(l, 2, :)
            case (3)
               work(l, :, :) = ieee_value(1.0_wp, ieee_quiet_nan)
            case (4)
               work(l, :, 2) = ieee_value(1.0_wp, ieee_positive_inf)
               found(l, :) = huge(1.0_wp)
            end select
            call solve_batch(n, work, found)
            do i = 1, batch
               if (i == l) cycle
               call check(error, all(same_bits(found(i, :), expected(i, :))), 'seat '//to_text(i)//' beside fault ' &
                          //to_text(kind)//' in seat '//to_text(l))
               if (allocated(error)) return
            end do
            if (kind == 2) cycle
            call check(error, .not. all(abs(found(l, :)) < huge(1.0_wp)), 'a singular system has no solution')
            if (allocated(error)) return
         end do
      end do
   end subroutine solve_alone

   !> Matrices of a known spectral radius: a real or a complex pair of that modulus and others below, in random coordinates.
   subroutine draw_spectrum(random, n, radius, matrix)
      !> Random numbers.
      type(random_stream), intent(inout) :: random
      !> Rows, an even number.
      integer, intent(in) :: n
      !> Spectral radius in each seat.
      real(wp), intent(in) :: radius(batch)
      !> The matrices.
      real(wp), allocatable, intent(out) :: matrix(:, :, :)

      type(library_error), allocatable :: fault
      real(wp), allocatable :: vectors(:, :, :), rows(:, :), column(:), work(:, :)
      real(wp) :: diagonal(n, n), angle, modulus
      integer :: l, j

      call draw(random, n, vectors)
      allocate (matrix(batch, n, n))
      do l = 1, batch
         diagonal = 0.0_wp
         do j = 1, n, 2
            call random%uniform(0.0_wp, 6.3_wp, angle)
            call random%uniform(0.0_wp, 0.9_wp*radius(l), modulus)
            if (j == 1) modulus = radius(l)
            diagonal(j:j + 1, j) = modulus*[cos(angle), sin(angle)]
            diagonal(j:j + 1, j + 1) = modulus*[-sin(angle), cos(angle)]
         end do
         ! One of three has real multipliers, of either sign.
         if (mod(l, 3) == 1) then
            diagonal(:2, :2) = 0.0_wp
            diagonal(1, 1) = merge(radius(l), -radius(l), mod(l, 2) == 0)
            diagonal(2, 2) = 0.5_wp*radius(l)
         end if
         ! V D V^-1, row by row.
         rows = matmul(vectors(l, :, :), diagonal)
         do j = 1, n
            work = transpose(vectors(l, :, :))
            column = rows(j, :)
            call solve_real(work, column, fault)
            matrix(l, j, :) = column
         end do
      end do
   end subroutine draw_spectrum

   !> Just inside and just outside the unit circle, and far from it.
   subroutine test_contracting(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Distances from the unit circle; the eigenvalues of random coordinates are good to 1e-12.
      real(wp), parameter :: distances(6) = [0.999_wp, 0.5_wp, 1.0e-2_wp, 1.0e-4_wp, 1.0e-6_wp, 1.0e-7_wp]
      integer, parameter :: rows(6) = [2, 4, 6, 10, 16, 18]
      type(random_stream) :: random
      real(wp), allocatable :: matrix(:, :, :)
      real(wp) :: radius(batch)
      integer :: k, m, n, l, turn
      logical :: expected(batch), found(batch)

      do k = 1, size(distances)
         do m = 1, size(rows)
            n = rows(m)
            do turn = 0, 2
               radius = [(1.0_wp + merge(distances(k), -distances(k), mod(l/(turn + 1), 2) == 0), l=1, batch)]
               expected = radius < 1.0_wp
               call draw_spectrum(random, n, radius, matrix)
               call contracting(n, matrix, found)
               do l = 1, batch
                  call check(error, found(l) .eqv. expected(l), to_text(n)//' rows, radius '//to_text(radius(l)))
                  if (allocated(error)) return
               end do
            end do
         end do
      end do
   end subroutine test_contracting

   !> Triangular matrices with large entries beside small multipliers.
   subroutine test_not_normal(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> What the powers grow to before they shrink, but for a factor.
      real(wp), parameter :: growth(6) = [1.0_wp, 1.0e3_wp, 1.0e6_wp, 1.0e10_wp, 1.0e60_wp, 1.0e120_wp]
      real(wp), parameter :: multipliers(batch) = [0.0_wp, 0.1_wp, 0.9_wp, 0.999_wp, 1.001_wp, 1.1_wp, 2.0_wp, 1.0e3_wp]
      real(wp), allocatable :: matrix(:, :, :)
      real(wp) :: beside
      integer :: k, n, i, j, l
      logical :: found(batch)

      do n = 2, 10, 4
         do k = 1, size(growth)
            if (allocated(matrix)) deallocate (matrix)
            allocate (matrix(batch, n, n), source=0.0_wp)
            ! A chain of n - 1 of them leads from the last row to the first.
            beside = growth(k)**(1.0_wp/real(n - 1, wp))
            do j = 1, n
               do i = 1, j - 1
                  matrix(:, i, j) = beside
               end do
               matrix(:, j, j) = multipliers*merge(1.0_wp, 0.3_wp, j == 1)
            end do
            call contracting(n, matrix, found)
            do l = 1, batch
               call check(error, found(l) .eqv. multipliers(l) < 1.0_wp, to_text(n)//' rows, multiplier '//to_text(multipliers(l)) &
                          //' beside '//to_text(beside))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine test_not_normal

   !> What has no logarithm, or no limit.
   subroutine test_special(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: n = 6
      !> Zero, nilpotent, tiny, subnormal; a rotation, the identity, huge on the diagonal, huge beside zeros.
      logical, parameter :: expected(batch) = [.true., .true., .true., .true., .false., .false., .false., .true.]
      real(wp) :: matrix(batch, n, n)
      integer :: i
      logical :: found(batch)

      matrix = 0.0_wp
      do i = 1, n
         matrix(2, i, i + 1:) = 1.0e6_wp
         matrix(3, i, :) = 1.0e-100_wp
         matrix(4, i, i) = 1.0e-310_wp
         matrix(5, i, 1 + mod(i, n)) = 1.0_wp
         matrix(6, i, i) = 1.0_wp
         matrix(7, i, i) = 1.0e100_wp
         if (i > 1) matrix(8, 1, i) = 1.0e100_wp
      end do
      call contracting(n, matrix, found)
      do i = 1, batch
         call check(error, found(i) .eqv. expected(i), 'seat '//to_text(i))
         if (allocated(error)) return
      end do
   end subroutine test_special

   !> Matrices that are not finite have no powers that shrink.
   subroutine test_not_finite(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call run_untrapped(power_not_finite, error)
   end subroutine test_not_finite

   !> The same, where nothing is trapped.
   subroutine power_not_finite(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: n = 6
      real(wp) :: matrix(batch, n, n)
      integer :: i, l
      logical :: found(batch)

      matrix = 0.0_wp
      do i = 1, n
         matrix(:, i, i) = 0.5_wp
      end do
      matrix(1, :, :) = ieee_value(1.0_wp, ieee_quiet_nan)
      matrix(2, 3, 3) = ieee_value(1.0_wp, ieee_quiet_nan)
      matrix(3, 1, 2) = ieee_value(1.0_wp, ieee_quiet_nan)
      matrix(4, :, :) = ieee_value(1.0_wp, ieee_positive_inf)
      matrix(5, 2, 2) = -ieee_value(1.0_wp, ieee_positive_inf)
      matrix(6, 4, 4) = huge(1.0_wp)
      call contracting(n, matrix, found)
      do l = 1, batch
         call check(error, found(l) .eqv. l > 6, 'seat '//to_text(l))
         if (allocated(error)) return
      end do
   end subroutine power_not_finite

   !> Whether a matrix contracts is the same in every seat and beside any others.
   subroutine test_power_alone(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      call run_untrapped(power_alone, error)
   end subroutine test_power_alone

   !> The same, where nothing is trapped.
   subroutine power_alone(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: n = 10
      !> So near to the circle that round-off decides on some of them.
      real(wp), parameter :: radius(batch) = [1.0_wp - 1.0e-9_wp, 1.0_wp + 1.0e-9_wp, 1.0_wp - 1.0e-10_wp, 1.0_wp, &
                                              1.0_wp + 1.0e-11_wp, 0.5_wp, 2.0_wp, 1.0_wp - 2.0e-10_wp]
      type(random_stream) :: random
      real(wp), allocatable :: matrix(:, :, :), work(:, :, :)
      real(wp) :: beside(5)
      integer :: turn, l, k, times
      logical :: expected(batch), found(batch)

      beside = [0.0_wp, 1.0e-200_wp, 1.0e200_wp, ieee_value(1.0_wp, ieee_positive_inf), ieee_value(1.0_wp, ieee_quiet_nan)]
      do times = 1, 5
         call draw_spectrum(random, n, radius, matrix)
         call contracting(n, matrix, expected)
         do turn = 1, batch - 1
            work = cshift(matrix, turn, 1)
            call contracting(n, work, found)
            call check(error, all(cshift(found, -turn) .eqv. expected), 'moved by '//to_text(turn)//' seats')
            if (allocated(error)) return
         end do
         do k = 1, size(beside)
            do l = 1, batch
               if (allocated(work)) deallocate (work)
               allocate (work(batch, n, n), source=beside(k))
               work(l, :, :) = matrix(l, :, :)
               call contracting(n, work, found)
               call check(error, found(l) .eqv. expected(l), 'seat '//to_text(l)//' beside '//to_text(k))
               if (allocated(error)) return
            end do
         end do
      end do
   end subroutine power_alone

   !> Points of both supports with states near their motions.
   subroutine make_points(steps, points, equations, modal, starts, error)
      !> Steps per mesh period.
      integer, intent(in) :: steps
      !> The points, in lanes.
      type(lane_ensemble), intent(inout) :: points
      !> The same, one by one.
      type(equations_type), allocatable, intent(out) :: equations(:)
      type(modal_system), allocatable, intent(out) :: modal(:)
      !> State of each near its motion, shape (size, points).
      real(wp), allocatable, intent(out) :: starts(:, :)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      real(wp), parameter :: stiffness = 2.5e8_wp
      integer, parameter :: settling = 200, settling_steps = 32
      type(collocation_map) :: map
      type(library_error), allocatable :: fault
      real(wp), allocatable :: state(:)
      integer :: i, k

      allocate (equations(2*speeds), modal(2*speeds))
      do k = 1, speeds
         equations(k) = new_equations(reference_gears(), reference_box(), reference_load(), rigid_point(speed(k)))
         equations(speeds + k) = new_equations(reference_gears(), reference_box(), reference_load(), &
                                               flexible_point(speed(k), stiffness))
      end do
      do k = 1, 2*speeds
         call new_modal_system(equations(k), modal(k), fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
      end do
      call points%load(equations, modal, [(k, k=1, 2*speeds)], steps)
      allocate (starts(points%size, 2*speeds))
      do k = 1, 2*speeds
         call map%load(equations(k), settling_steps, fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
         state = spread(0.0_wp, 1, map%size)
         do i = 1, settling
            call map%advance(state)
         end do
         starts(:, k) = widen(state, points%size/2)
      end do
   end subroutine make_points

   !> More motions than seats: every motion with its period and with twice as many.
   subroutine make_members(starts, members, orbits)
      !> State of each point near its motion, shape (size, points).
      real(wp), intent(in) :: starts(:, :)
      !> Point of each motion.
      integer, allocatable, intent(out) :: members(:)
      !> What Newton's method starts from.
      type(periodic_orbit), allocatable, intent(out) :: orbits(:)

      integer :: i

      members = [(i, i=1, 2*speeds), (i, i=2*speeds, 1, -1)]
      allocate (orbits(size(members)))
      do i = 1, size(members)
         orbits(i)%state = starts(:, members(i))
         orbits(i)%periods = repeats(1 + mod(members(i) - 1, speeds))*merge(1, 2, i <= 2*speeds)
      end do
   end subroutine make_members

   !> The orbits of lanes are those of collocation, which are found one by one.
   subroutine test_orbits(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> The error of 96 steps of order four, beside the motion and its multipliers; measured 2e-5.
      real(wp), parameter :: tolerance = 1.0e-4_wp
      integer, parameter :: steps = 96, fine = 32
      type(lane_ensemble) :: points
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(periodic_orbit), allocatable :: orbits(:)
      type(periodic_orbit) :: expected
      type(collocation_map) :: map
      type(library_error), allocatable :: fault
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :)
      integer, allocatable :: members(:)
      logical, allocatable :: found(:)
      logical :: is_found
      integer :: i, j, m

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      call make_members(starts, members, orbits)
      allocate (found(size(members)))
      call check(error, size(members) > 2*points%seats, 'more motions than seats')
      if (allocated(error)) return
      call find_orbits(points, members, spread(motion_size, 1, size(members)), nobody, orbits, found)
      do i = 1, size(members)
         m = modal(members(i))%modes
         call map%load(equations(members(i)), fine, fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
         call find_orbit(map, narrow(starts(:, members(i)), m), orbits(i)%periods, motion_size, nobody, expected, is_found)
         call check(error, found(i) .and. is_found, 'both find motion '//to_text(i))
         if (allocated(error)) return
         call check(error, weighted_norm(map%weight, narrow(orbits(i)%state, m) - expected%state), 0.0_wp, &
                    tolerance*weighted_norm(map%weight, expected%state), 'state of motion '//to_text(i))
         if (allocated(error)) return
         do j = 1, m
            call check(error, maxval(abs(narrow(orbits(i)%monodromy(:, j), m) - expected%monodromy(:, j))), 0.0_wp, &
                       tolerance*maxval(abs(expected%monodromy)), 'monodromy of motion '//to_text(i))
            if (allocated(error)) return
         end do
         call check(error, orbits(i)%smallest >= points%half_backlash .eqv. expected%smallest >= map%half_backlash, &
                    'contact of motion '//to_text(i))
         if (allocated(error)) return
      end do
   end subroutine test_orbits

   !> Two orbits are the same, bit by bit.
   pure function same_orbit(a, b) result(same)
      !> The orbits.
      type(periodic_orbit), intent(in) :: a, b
      !> They are.
      logical :: same

      same = all(same_bits(a%state, b%state)) .and. same_bits(a%last_step, b%last_step) .and. same_bits(a%smallest, b%smallest) &
             .and. same_bits(a%largest, b%largest) .and. a%integrated == b%integrated .and. a%periods == b%periods &
             .and. (allocated(a%monodromy) .eqv. allocated(b%monodromy))
      if (same .and. allocated(a%monodromy)) same = all(same_bits(a%monodromy, b%monodromy))
   end function same_orbit

   !> The same orbits whole, backwards and one by one.
   subroutine test_orbits_alone(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 24
      type(lane_ensemble) :: points
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(periodic_orbit), allocatable :: orbits(:), again(:), expected(:)
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :)
      integer, allocatable :: members(:)
      logical, allocatable :: found(:), is_expected(:)
      integer :: i, n, way
      logical :: affine, rough

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      call make_members(starts, members, orbits)
      n = size(members)
      allocate (found(n), is_expected(n))
      do way = 1, 3
         affine = way == 2
         rough = way == 3
         expected = orbits
         call find_orbits(points, members, spread(motion_size, 1, n), nobody, expected, is_expected, affine, roughly=rough)
         again = orbits(n:1:-1)
         call find_orbits(points, members(n:1:-1), spread(motion_size, 1, n), nobody, again, found, affine, roughly=rough)
         do i = 1, n
            call check(error, found(n + 1 - i) .eqv. is_expected(i), 'backwards, found '//to_text(i))
            if (allocated(error)) return
            call check(error, same_orbit(again(n + 1 - i), expected(i)), 'backwards, way '//to_text(way)//', motion '//to_text(i))
            if (allocated(error)) return
         end do
         again = orbits
         do i = 1, n
            call find_orbits(points, members(i:i), [motion_size], nobody, again(i:i), found(i:i), affine, roughly=rough)
            call check(error, found(i) .eqv. is_expected(i), 'alone, found '//to_text(i))
            if (allocated(error)) return
            call check(error, same_orbit(again(i), expected(i)), 'alone, way '//to_text(way)//', motion '//to_text(i))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_orbits_alone

   !> Members that start where no motion is, far out, between the others.
   subroutine test_hopeless(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 24
      type(lane_ensemble) :: points
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(periodic_orbit), allocatable :: orbits(:), mixed(:), expected(:)
      type(random_stream) :: random
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :), chaos(:)
      integer, allocatable :: members(:), both(:)
      logical, allocatable :: found(:), is_expected(:)
      integer :: i, n
      real(wp), parameter :: far(3) = [1.0e-3_wp, 1.0_wp, 1.0e30_wp]

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      call make_members(starts, members, orbits)
      n = size(members)
      allocate (found(2*n), is_expected(n), mixed(2*n), both(2*n), chaos(points%size))
      expected = orbits
      call find_orbits(points, members, spread(motion_size, 1, n), nobody, expected, is_expected)
      do i = 1, n
         both(2*i - 1:2*i) = members(i)
         mixed(2*i - 1) = orbits(i)
         mixed(2*i) = orbits(i)
         call random%fill(-1.0_wp, 1.0_wp, chaos)
         mixed(2*i)%state = mixed(2*i)%state + far(1 + mod(i, 3))*chaos
         mixed(2*i)%periods = 1 + mod(i, 5)
      end do
      call find_orbits(points, both, spread(motion_size, 1, 2*n), nobody, mixed, found)
      do i = 1, n
         call check(error, found(2*i - 1) .eqv. is_expected(i), 'found '//to_text(i))
         if (allocated(error)) return
         call check(error, same_orbit(mixed(2*i - 1), expected(i)), 'motion '//to_text(i))
         if (allocated(error)) return
      end do
   end subroutine test_hopeless

   !> Stable motions with some steps and with more, in lanes of which only theirs are loaded.
   subroutine find_twice(points, members, orbits, given, expected, error)
      !> The points, loaded with more steps.
      type(lane_ensemble), intent(inout) :: points
      !> Which of them have a motion, shape (n).
      integer, allocatable, intent(out) :: members(:)
      !> The motions with few steps; the same, the monodromy of every fifth no good at all; the motions with more, shape (n).
      type(periodic_orbit), allocatable, intent(out) :: orbits(:), given(:), expected(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 48, finer = 97
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :)
      logical, allocatable :: found(:)
      integer :: i, n, k

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      call make_members(starts, members, orbits)
      n = size(members)
      allocate (found(n))
      call find_stable_orbits(points, members, spread(motion_size, 1, n), nobody, orbits, found)
      call check(error, all(found), 'motions with few steps')
      if (allocated(error)) return
      call points%load(equations, modal, [(k, k=1, 2*speeds)], finer, members)
      expected = orbits
      call find_stable_orbits(points, members, spread(motion_size, 1, n), nobody, expected, found)
      call check(error, all(found), 'motions with more steps')
      if (allocated(error)) return
      given = orbits
      do i = 1, n, 5
         given(i)%monodromy = -given(i)%monodromy
      end do
   end subroutine find_twice

   !> Motions are those that are expected.
   subroutine compare_motions(points, members, orbits, found, expected, error)
      !> The points.
      type(lane_ensemble), intent(in) :: points
      !> Which of them, shape (n).
      integer, intent(in) :: members(:)
      !> The motions, shape (n).
      type(periodic_orbit), intent(in) :: orbits(:)
      !> They were found, shape (n).
      logical, intent(in) :: found(:)
      !> What they should be, shape (n).
      type(periodic_orbit), intent(in) :: expected(:)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Newton's tolerance and a little more, beside the size of the motion.
      real(wp), parameter :: tolerance = 1.0e-8_wp
      integer :: i

      do i = 1, size(members)
         call check(error, found(i) .and. orbits(i)%periods == expected(i)%periods, 'found '//to_text(i))
         if (allocated(error)) return
         call check(error, weighted_norm(points%weight(:, members(i)), orbits(i)%state - expected(i)%state), 0.0_wp, &
                    tolerance*motion_size, 'motion '//to_text(i))
         if (allocated(error)) return
      end do
   end subroutine compare_motions

   !> A monodromy that comes with the orbit saves tangents where it is good, and does no harm where it is not.
   subroutine test_near(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      type(lane_ensemble) :: points
      type(periodic_orbit), allocatable :: orbits(:), near(:), expected(:)
      type(no_attendant) :: nobody
      integer, allocatable :: members(:)
      logical, allocatable :: found(:)

      call find_twice(points, members, orbits, near, expected, error)
      if (allocated(error)) return
      allocate (found(size(members)))
      call find_orbits(points, members, spread(motion_size, 1, size(members)), nobody, near, found, monodromy_is_near=.true., &
                       roughly=.true.)
      call compare_motions(points, members, near, found, expected, error)
   end subroutine test_near

   !> Orbits that were found with a multiple of their period.
   subroutine test_stable(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 48
      type(lane_ensemble) :: points
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(periodic_orbit), allocatable :: orbits(:), again(:)
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :)
      integer, allocatable :: members(:)
      logical, allocatable :: found(:)
      integer :: i, n

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      call make_members(starts, members, orbits)
      n = size(members)
      allocate (found(n))
      again = orbits
      call find_stable_orbits(points, members, spread(motion_size, 1, n), nobody, again, found)
      do i = 1, n
         call check(error, found(i), 'stable '//to_text(i))
         if (allocated(error)) return
         call check(error, again(i)%periods, repeats(1 + mod(members(i) - 1, speeds)), 'periods of '//to_text(i))
         if (allocated(error)) return
      end do
      ! At 5500 rev/min the motion of one period is unstable.
      i = 9
      again = orbits(i:i)
      again(1)%periods = 1
      call find_orbits(points, members(i:i), [motion_size], nobody, again, found(:1))
      if (.not. found(1)) return
      call find_stable_orbits(points, members(i:i), [motion_size], nobody, again, found(:1))
      call check(error, .not. found(1), 'a motion of one period at 5500 rev/min is not stable')
   end subroutine test_stable

   !> Stable motions are found again with other steps, with their own monodromies and where those are no good, in lanes of which
   !> only theirs are loaded.
   subroutine test_follow(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> What monodromies of sections as near as that may differ by: they change with the crossings.
      real(wp), parameter :: same_monodromy = 1.0e-4_wp
      type(lane_ensemble) :: points
      type(periodic_orbit), allocatable :: orbits(:), followed(:), expected(:)
      type(no_attendant) :: nobody
      integer, allocatable :: members(:)
      logical, allocatable :: found(:)
      integer :: i

      call find_twice(points, members, orbits, followed, expected, error)
      if (allocated(error)) return
      allocate (found(size(members)))
      call follow_orbits(points, members, spread(motion_size, 1, size(members)), nobody, followed, found)
      call compare_motions(points, members, followed, found, expected, error)
      if (allocated(error)) return
      do i = 1, size(members)
         call check(error, maxval(abs(followed(i)%monodromy - expected(i)%monodromy))/maxval(abs(expected(i)%monodromy)), 0.0_wp, &
                    same_monodromy, 'monodromy '//to_text(i))
         if (allocated(error)) return
      end do
      ! The motion of one period at 5500 rev/min is there, but not stable.
      i = 9
      followed = orbits(i:i)
      followed(1)%periods = 1
      call find_orbits(points, members(i:i), [motion_size], nobody, followed, found(:1))
      if (.not. found(1)) return
      call follow_orbits(points, members(i:i), [motion_size], nobody, followed, found(:1))
      call check(error, .not. found(1), 'a motion of one period at 5500 rev/min is not stable')
   end subroutine test_follow

   !> Two transients are the same, bit by bit.
   pure function same_transient(a, b) result(same)
      !> The transients.
      type(transient_type), intent(in) :: a, b
      !> They are.
      logical :: same

      real(wp) :: value(3), other(3)
      integer :: periods(2), w

      same = all(same_bits(a%state, b%state)) .and. all(same_bits(a%tangent, b%tangent)) .and. a%periods == b%periods &
             .and. (a%sound .eqv. b%sound) .and. same_bits(a%ring%scale(), b%ring%scale())
      do w = 1, size(a%watch)
         associate (one => a%watch(w), two => b%watch(w))
            call one%growth%exponent(value(1), value(2), periods(1), value(3))
            call two%growth%exponent(other(1), other(2), periods(2), other(3))
            same = same .and. all(same_bits(value, other)) .and. periods(1) == periods(2) &
                   .and. all(same_bits(one%low, two%low)) .and. all(same_bits(one%high, two%high))
         end associate
      end do
   end function same_transient

   !> Transients of different lengths, some with tangents, more than seats: together and one by one.
   subroutine test_transients(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 24
      type(lane_ensemble) :: points
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(transient_type) :: together(2*speeds), alone(2*speeds)
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :)
      integer :: members(2*speeds), until(2*speeds), i, part

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      members = [(1 + mod(7*i, 2*speeds), i=1, 2*speeds)]
      do i = 1, 2*speeds
         call begin_transient(points%weight(:, i), points%in_use(:, i), 0.5_wp*starts(:, i), together(i))
      end do
      alone = together
      do part = 1, 2
         until = [(part*40 + mod(11*i, 37), i=1, 2*speeds)]
         do i = 1, 2*speeds
            call watch_from_now(together(members(i)), 1, until(i), mod(i, 3) == part)
            call watch_from_now(together(members(i)), 2, until(i) + 9, mod(i, 2) == part)
            call watch_from_now(alone(members(i)), 1, until(i), mod(i, 3) == part)
            call watch_from_now(alone(members(i)), 2, until(i) + 9, mod(i, 2) == part)
         end do
         call advance_transients(points, members, until, together, nobody)
         do i = 2*speeds, 1, -1
            call advance_transients(points, members(i:i), until(i:i), alone, nobody)
         end do
         do i = 1, 2*speeds
            call check(error, together(members(i))%periods, until(i), 'periods of '//to_text(i))
            if (allocated(error)) return
            call check(error, same_transient(together(members(i)), alone(members(i))), 'transient '//to_text(i))
            if (allocated(error)) return
         end do
      end do
   end subroutine test_transients

   !> What is asked of the latest sections does not depend on how many periods were integrated at once.
   subroutine test_latest_sections(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      integer, parameter :: steps = 24, long = 201, longest = 64
      type(lane_ensemble) :: points
      type(equations_type), allocatable :: equations(:)
      type(modal_system), allocatable :: modal(:)
      type(transient_type) :: at_once(1), one_by_one(1)
      type(no_attendant) :: nobody
      real(wp), allocatable :: starts(:, :)
      integer :: k

      call make_points(steps, points, equations, modal, starts, error)
      if (allocated(error)) return
      call begin_transient(points%weight(:, 1), points%in_use(:, 1), 0.5_wp*starts(:, 1), at_once(1))
      one_by_one = at_once
      call advance_transients(points, [1], [long], at_once, nobody)
      do k = 1, long
         call advance_transients(points, [1], [k], one_by_one, nobody)
      end do
      call check(error, at_once(1)%periods, long, 'periods')
      if (allocated(error)) return
      do k = 1, longest
         call check(error, same_bits(at_once(1)%ring%distance(k), one_by_one(1)%ring%distance(k)), 'distance '//to_text(k))
         if (allocated(error)) return
      end do
      call check(error, at_once(1)%ring%distance(longest) < huge(1.0_wp), 'the earliest section is there')
      if (allocated(error)) return
      call check(error, same_bits(at_once(1)%ring%scale(), one_by_one(1)%ring%scale()), 'scale')
      if (allocated(error)) return
      call check(error, all(same_bits(at_once(1)%ring%return_direction(), one_by_one(1)%ring%return_direction())), 'direction')
   end subroutine test_latest_sections

   !> A transient without bounds beside others that go on for long after it has been given up.
   subroutine test_diverging(error)
      !> Why the test failed.
      type(error_type), allocatable, intent(out) :: error

      !> Mesh periods: the state that grows passes the largest number within them.
      integer, parameter :: periods = 6000, steps = 64
      !> Members but the last are stable.
      integer, parameter :: n = 5
      type(lane_ensemble) :: points
      type(single_dof_type) :: single
      type(equations_type) :: equations(n)
      type(modal_system) :: modal(n)
      type(transient_type) :: together(n), alone(n)
      type(library_error), allocatable :: fault
      type(no_attendant) :: nobody
      integer :: i

      ! Parametric resonance without backlash grows for ever: the first instability tongue, at twice the natural frequency.
      single%excitation = [0.0_wp]
      single%variation = [0.5_wp]
      do i = 1, n
         single%frequency = merge(2.0_wp, 0.3_wp + 0.1_wp*real(i, wp), i == n)
         equations(i) = single_dof_equations(single)
         equations(i)%mesh%half_backlash = 0.0_wp
         call new_modal_system(equations(i), modal(i), fault)
         if (allocated(fault)) then
            call test_failed(error, fault%message)
            return
         end if
      end do
      call points%load(equations, modal, [(i, i=1, n)], steps)
      do i = 1, n
         call begin_transient(points%weight(:, i), points%in_use(:, i), spread(0.1_wp, 1, points%size), together(i))
      end do
      alone = together
      do i = n, 1, -1
         call advance_transients(points, [i], [periods], alone, nobody)
         call check(error, alone(i)%sound .eqv. i < n, 'member '//to_text(i)//' is sound')
         if (allocated(error)) return
      end do
      call advance_transients(points, [(i, i=n, 1, -1)], spread(periods, 1, n), together, nobody)
      do i = 1, n
         call check(error, together(i)%periods == alone(i)%periods .and. all(same_bits(together(i)%state, alone(i)%state)), &
                    'member '//to_text(i))
         if (allocated(error)) return
      end do
   end subroutine test_diverging

end module test_batch
