!> Runs the stress tests: every suite, or the one named on the command line.
program stress_tests
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use stress_extremes, only: collect_extremes
   use stress_limits, only: collect_limits
   use test_support, only: new_testsuite, run_testsuite, select_suite, testsuite_type
   implicit none

   type(testsuite_type), allocatable :: suites(:)
   character(len=64) :: name
   logical :: named
   integer :: i, only_one, failures

   suites = [new_testsuite('limits', collect_limits), new_testsuite('extremes', collect_extremes)]
   only_one = 0
   failures = 0
   named = command_argument_count() > 0
   if (named) then
      call get_command_argument(1, name)
      only_one = select_suite(suites, trim(name))
      if (only_one == 0) then
         write (error_unit, '(3a)') "no suite '", trim(name), "'"
         failures = 1
      end if
   end if
   do i = 1, size(suites)
      if (named .and. only_one /= i) cycle
      write (output_unit, '(a)') suites(i)%name
      call run_testsuite(suites(i)%collect, output_unit, failures)
   end do
   if (failures > 0) stop 1
end program stress_tests
