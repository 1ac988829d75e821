!> The program: read the command line and the deck, run, report, exit.
program spurflex_main
   use mpi_f08, only: MPI_COMM_WORLD, mpi_abort, mpi_comm_rank, mpi_finalize, mpi_init
   use spurflex, only: action_check, action_help, action_keys, action_run, action_version, case_type, command_type, &
      describe_ends, describe_plan, error_type, excerpt, exit_complete, exit_process, hasten_mpi_end, hasten_mpi_start, &
      key_reference, logger, new_logger, parse_command_line, run_case, share_case, usage, version_text, watch_for_drain
   implicit none

   type(command_type) :: command
   type(case_type) :: case
   type(logger) :: log
   type(error_type), allocatable :: error
   integer :: rank, code

   code = exit_complete
   ! Whoever asks for a drain may do so while MPI starts, which can take long on a cluster.
   call watch_for_drain()
   call hasten_mpi_start()
   call mpi_init()
   call mpi_comm_rank(MPI_COMM_WORLD, rank)
   log = new_logger(active=rank == 0)
   call parse_command_line(command, error)
   if (.not. allocated(error)) then
      select case (command%action)
      case (action_help)
         call log%say(usage)
      case (action_version)
         call log%say(version_text())
      case (action_keys)
         call log%say(key_reference())
      case (action_check, action_run)
         call share_case(command%deck, MPI_COMM_WORLD, case, error)
         if (.not. allocated(error) .and. command%action == action_check) then
            call log%say(case%resolved//new_line('a')//describe_plan(case)//new_line('a')//describe_ends(case))
         else if (.not. allocated(error)) then
            call log%say(version_text()//new_line('a')//'deck: '//excerpt(command%deck))
            call run_case(case, MPI_COMM_WORLD, command%fresh, log, code, error)
         end if
      end select
   end if
   if (allocated(error)) then
      code = error%code
      if (rank == 0 .or. error%alone) call log%complain(error%message)
      if (error%alone) call mpi_abort(MPI_COMM_WORLD, code)
   end if
   call hasten_mpi_end()
   call mpi_finalize()
   if (rank == 0) call exit_process(code)
end program spurflex_main
