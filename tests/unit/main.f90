!> Runs the unit tests: every suite, or the one named on the command line.
!> Under mpirun every rank runs the tests; the exit code tells whether any failed on any rank.
program unit_tests
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use mpi_f08, only: MPI_Allreduce, MPI_COMM_WORLD, MPI_Finalize, MPI_Init, MPI_INTEGER, MPI_SUM
   use test_twins, only: collect_twins
   use test_chunk, only: collect_chunk
   use test_batch, only: collect_batch
   use test_collocation, only: collect_collocation
   use test_contact, only: collect_contact
   use test_deck, only: collect_deck
   use test_dense, only: collect_dense
   use test_equations, only: collect_equations
   use test_forecast, only: collect_forecast
   use test_mesh, only: collect_mesh
   use test_motion, only: collect_motion
   use test_newmark, only: collect_newmark
   use test_paper_model, only: collect_paper_model
   use test_plan, only: collect_plan
   use test_recorder, only: collect_recorder
   use test_results, only: collect_results
   use test_steady, only: collect_steady
   use test_modal, only: collect_modal
   use test_truncation, only: collect_truncation
   use test_exponential, only: collect_exponential
   use test_crossings, only: collect_crossings
   use test_shooting, only: collect_shooting
   use test_search, only: collect_search
   use test_kahraman_singh, only: collect_kahraman_singh
   use test_candidate, only: collect_candidate
   use test_watch, only: collect_watch
   use test_harmonic, only: collect_harmonic
   use test_lanes, only: collect_lanes
   use test_spectrum, only: collect_spectrum
   use test_support, only: new_testsuite, run_testsuite, select_suite, testsuite_type
   use test_text, only: collect_text
   implicit none

   type(testsuite_type), allocatable :: suites(:)
   character(len=64) :: name
   logical :: named
   integer :: i, only_one, failures, all_failures

   suites = [ &
            new_testsuite('text', collect_text), &
            new_testsuite('results', collect_results), &
            new_testsuite('deck', collect_deck), &
            new_testsuite('paper_model', collect_paper_model), &
            new_testsuite('mesh', collect_mesh), &
            new_testsuite('equations', collect_equations), &
            new_testsuite('contact', collect_contact), &
            new_testsuite('newmark', collect_newmark), &
            new_testsuite('collocation', collect_collocation), &
            new_testsuite('motion', collect_motion), &
            new_testsuite('dense', collect_dense), &
            new_testsuite('spectrum', collect_spectrum), &
            new_testsuite('recorder', collect_recorder), &
            new_testsuite('chunk', collect_chunk), &
            new_testsuite('plan', collect_plan), &
            new_testsuite('forecast', collect_forecast), &
            new_testsuite('twins', collect_twins), &
            new_testsuite('steady', collect_steady), &
            new_testsuite('modal', collect_modal), &
            new_testsuite('truncation', collect_truncation), &
            new_testsuite('exponential', collect_exponential), &
            new_testsuite('crossings', collect_crossings), &
            new_testsuite('harmonic', collect_harmonic), &
            new_testsuite('candidate', collect_candidate), &
            new_testsuite('watch', collect_watch), &
            new_testsuite('shooting', collect_shooting), &
            new_testsuite('search', collect_search), &
            new_testsuite('kahraman_singh', collect_kahraman_singh), &
            new_testsuite('lanes', collect_lanes), &
            new_testsuite('batch', collect_batch) &
            ]

   call MPI_Init()
   only_one = 0
   failures = 0
   named = command_argument_count() > 0
   if (named) then
      call get_command_argument(1, name)
      only_one = select_suite(suites, trim(name))
      if (only_one == 0) then
         write (error_unit, '(3a)') "no suite '", trim(name), "'; there are:"
         write (error_unit, '(2x, a)') (suites(i)%name, i=1, size(suites))
         failures = 1
      end if
   end if

   do i = 1, size(suites)
      if (named .and. only_one /= i) cycle
      write (output_unit, '(a)') suites(i)%name
      call run_testsuite(suites(i)%collect, output_unit, failures)
   end do

   call MPI_Allreduce(failures, all_failures, 1, MPI_INTEGER, MPI_SUM, MPI_COMM_WORLD)
   call MPI_Finalize()
   if (all_failures > 0) stop 1
end program unit_tests
