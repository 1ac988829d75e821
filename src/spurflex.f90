!> The library's front door: the public names that a program needs, from the layers where they live.
module spurflex
   use spurflex_base_error, only: error_type, exit_complete
   use spurflex_external_process, only: exit_process, hasten_mpi_end, hasten_mpi_start
   use spurflex_external_signals, only: watch_for_drain
   use spurflex_io_case, only: case_type
   use spurflex_io_command_line, only: action_check, action_help, action_keys, action_run, action_version, command_type, &
      parse_command_line, usage
   use spurflex_io_log, only: logger, new_logger
   use spurflex_io_provenance, only: version_text
   use spurflex_io_faults, only: excerpt
   use spurflex_io_reference, only: key_reference
   use spurflex_sweep_driver, only: run_case, share_case
   use spurflex_sweep_plan, only: describe_plan
   use spurflex_sweep_timekeeper, only: describe_ends
   implicit none
   private

   public :: error_type, exit_complete, exit_process, hasten_mpi_end, hasten_mpi_start, watch_for_drain
   public :: case_type, share_case, describe_plan, describe_ends, run_case
   public :: command_type, parse_command_line, usage
   public :: action_check, action_help, action_keys, action_run, action_version
   public :: logger, new_logger, version_text, key_reference, excerpt

end module spurflex
