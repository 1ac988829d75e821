# SPURFLEX_COMMIT: what `git describe` says of the sources, 'unknown' outside a git checkout.
# Taken when CMake configures, which a commit or a checkout triggers; configure_file rewrites
# src/io/build.f90 only when the text changes, so that nothing else is compiled again.

set(SPURFLEX_VERSION ${PROJECT_VERSION})
set(SPURFLEX_COMMIT unknown)

find_package(Git QUIET)
if(GIT_FOUND AND EXISTS ${PROJECT_SOURCE_DIR}/.git)
  execute_process(
    COMMAND ${GIT_EXECUTABLE} describe --always --tags --dirty
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    OUTPUT_VARIABLE spurflex_describe
    RESULT_VARIABLE spurflex_describe_result
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(spurflex_describe_result EQUAL 0)
    set(SPURFLEX_COMMIT ${spurflex_describe})
  endif()

  execute_process(
    COMMAND ${GIT_EXECUTABLE} rev-parse --git-path logs/HEAD
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    OUTPUT_VARIABLE spurflex_head_log
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  cmake_path(ABSOLUTE_PATH spurflex_head_log BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
  if(EXISTS ${spurflex_head_log} AND NOT IS_DIRECTORY ${spurflex_head_log})
    set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND
                 PROPERTY CMAKE_CONFIGURE_DEPENDS ${spurflex_head_log})
  endif()
endif()

message(STATUS "spurflex ${SPURFLEX_VERSION}, commit ${SPURFLEX_COMMIT}")
