!> A small unit-test framework with the names of test-drive: a test is a subroutine that
!> returns an error if it fails, a suite is a list of tests, a program runs suites.
module test_support
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
   use spurflex_base_kinds, only: i4, i8, wp
   use spurflex_base_text, only: to_text
   implicit none
   private

   public :: error_type, test_failed, check
   public :: unittest_type, new_unittest
   public :: testsuite_type, new_testsuite, run_testsuite, select_suite

   !> Why a test failed.
   type :: error_type
      !> Message for people.
      character(len=:), allocatable :: message
   end type error_type

   abstract interface
      !> A test: leaves the error unallocated if it passes.
      subroutine test_interface(error)
         import :: error_type
         !> Why it failed.
         type(error_type), allocatable, intent(out) :: error
      end subroutine test_interface
   end interface

   !> One test.
   type :: unittest_type
      !> Name, unique in its suite.
      character(len=:), allocatable :: name
      !> The procedure that runs it.
      procedure(test_interface), pointer, nopass :: test => null()
   end type unittest_type

   abstract interface
      !> Lists the tests of a suite.
      subroutine collect_interface(testsuite)
         import :: unittest_type
         !> The tests, shape (tests).
         type(unittest_type), allocatable, intent(out) :: testsuite(:)
      end subroutine collect_interface
   end interface

   !> One suite.
   type :: testsuite_type
      !> Name: the argument of the test program that runs it alone.
      character(len=:), allocatable :: name
      !> The procedure that lists its tests.
      procedure(collect_interface), pointer, nopass :: collect => null()
   end type testsuite_type

   !> Fail the test unless a condition holds, or an actual value is the expected one.
   interface check
      module procedure :: check_condition
      module procedure :: check_real
      module procedure :: check_integer
      module procedure :: check_long
      module procedure :: check_text
   end interface check

contains

   !> Make a test.
   function new_unittest(name, test) result(self)
      !> Name of the test.
      character(len=*), intent(in) :: name
      !> Procedure that runs it.
      procedure(test_interface) :: test
      !> The test.
      type(unittest_type) :: self

      self%name = name
      self%test => test
   end function new_unittest

   !> Make a suite.
   function new_testsuite(name, collect) result(self)
      !> Name of the suite.
      character(len=*), intent(in) :: name
      !> Procedure that lists its tests.
      procedure(collect_interface) :: collect
      !> The suite.
      type(testsuite_type) :: self

      self%name = name
      self%collect => collect
   end function new_testsuite

   !> Index of the suite with a name, 0 if there is none.
   pure function select_suite(suites, name) result(index)
      !> Suites to look in, shape (suites).
      type(testsuite_type), intent(in) :: suites(:)
      !> Name looked for.
      character(len=*), intent(in) :: name
      !> Index in `suites`.
      integer :: index

      do index = 1, size(suites)
         if (suites(index)%name == name) return
      end do
      index = 0
   end function select_suite

   !> Run every test of a suite, one line each.
   subroutine run_testsuite(collect, unit, failures)
      !> Procedure that lists the tests.
      procedure(collect_interface) :: collect
      !> Unit that the lines go to.
      integer, intent(in) :: unit
      !> Number of failed tests so far; the failures of this suite are added.
      integer, intent(inout) :: failures

      type(unittest_type), allocatable :: testsuite(:)
      type(error_type), allocatable :: error
      integer :: i

      call collect(testsuite)
      do i = 1, size(testsuite)
         call testsuite(i)%test(error)
         if (allocated(error)) then
            failures = failures + 1
            write (unit, '(4a)') '  FAIL  ', testsuite(i)%name, ': ', error%message
         else
            write (unit, '(2a)') '  ok    ', testsuite(i)%name
         end if
         flush (unit)
      end do
   end subroutine run_testsuite

   !> Fail the test.
   pure subroutine test_failed(error, message)
      !> The failure.
      type(error_type), allocatable, intent(out) :: error
      !> Why.
      character(len=*), intent(in) :: message

      allocate (error)
      error%message = message
   end subroutine test_failed

   !> Fail the test unless a condition holds.
   pure subroutine check_condition(error, condition, message)
      !> The failure.
      type(error_type), allocatable, intent(out) :: error
      !> What must hold.
      logical, intent(in) :: condition
      !> What was tested.
      character(len=*), intent(in), optional :: message

      if (.not. condition) call test_failed(error, described('condition does not hold', message))
   end subroutine check_condition

   !> Fail the test unless a real is finite and within a tolerance of the expected value.
   pure subroutine check_real(error, actual, expected, tolerance, message, relative)
      !> The failure.
      type(error_type), allocatable, intent(out) :: error
      !> Value found.
      real(wp), intent(in) :: actual
      !> Value wanted; must be finite.
      real(wp), intent(in) :: expected
      !> Largest difference accepted, in the unit of the value.
      real(wp), intent(in) :: tolerance
      !> What was tested.
      character(len=*), intent(in), optional :: message
      !> Take the tolerance as a fraction of the expected value; not so if absent.
      logical, intent(in), optional :: relative

      real(wp) :: allowed

      if (ieee_is_nan(actual)) then
         call test_failed(error, described('NaN where '//to_text(expected)//' is expected', message))
      else if (.not. ieee_is_finite(actual)) then
         call test_failed(error, described('infinite where '//to_text(expected)//' is expected', message))
      else
         allowed = tolerance
         if (present(relative)) then
            if (relative) allowed = tolerance*abs(expected)
         end if
         if (.not. abs(actual - expected) <= allowed) then
            call test_failed(error, described(to_text(actual)//' is not '//to_text(expected) &
                                              //' within '//to_text(allowed), message))
         end if
      end if
   end subroutine check_real

   !> Fail the test unless an integer is the expected one.
   pure subroutine check_integer(error, actual, expected, message)
      !> The failure.
      type(error_type), allocatable, intent(out) :: error
      !> Value found.
      integer(i4), intent(in) :: actual
      !> Value wanted.
      integer(i4), intent(in) :: expected
      !> What was tested.
      character(len=*), intent(in), optional :: message

      call check_long(error, int(actual, i8), int(expected, i8), message)
   end subroutine check_integer

   !> Fail the test unless a long integer is the expected one.
   pure subroutine check_long(error, actual, expected, message)
      !> The failure.
      type(error_type), allocatable, intent(out) :: error
      !> Value found.
      integer(i8), intent(in) :: actual
      !> Value wanted.
      integer(i8), intent(in) :: expected
      !> What was tested.
      character(len=*), intent(in), optional :: message

      if (actual /= expected) then
         call test_failed(error, described(to_text(actual)//' is not '//to_text(expected), message))
      end if
   end subroutine check_long

   !> Fail the test unless a text is the expected one, trailing blanks included.
   pure subroutine check_text(error, actual, expected, message)
      !> The failure.
      type(error_type), allocatable, intent(out) :: error
      !> Text found.
      character(len=*), intent(in) :: actual
      !> Text wanted.
      character(len=*), intent(in) :: expected
      !> What was tested.
      character(len=*), intent(in), optional :: message

      if (len(actual) /= len(expected) .or. actual /= expected) then
         call test_failed(error, described("'"//actual//"' is not '"//expected//"'", message))
      end if
   end subroutine check_text

   !> What went wrong, behind what was tested.
   pure function described(fault, message) result(text)
      !> What went wrong.
      character(len=*), intent(in) :: fault
      !> What was tested.
      character(len=*), intent(in), optional :: message
      !> Both.
      character(len=:), allocatable :: text

      text = fault
      if (present(message)) text = message//': '//fault
   end function described

end module test_support
