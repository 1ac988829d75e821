# Flags of every Fortran target of this project, as the interface target spurflex_flags.
# Results must not depend on the build: no -ffast-math, no -Ofast. Fused multiply-add
# (-ffp-contract=fast, gfortran's default) stays: one binary always rounds the same way.

include(CheckFortranCompilerFlag)

add_library(spurflex_flags INTERFACE)

if(CMAKE_Fortran_COMPILER_ID STREQUAL "GNU")
  set(spurflex_march "")
  if(SPURFLEX_NATIVE)
    set(spurflex_march -march=native)
  elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$" AND SPURFLEX_ARCH)
    check_fortran_compiler_flag(-march=${SPURFLEX_ARCH} SPURFLEX_HAS_ARCH_${SPURFLEX_ARCH})
    if(SPURFLEX_HAS_ARCH_${SPURFLEX_ARCH})
      set(spurflex_march -march=${SPURFLEX_ARCH})
    endif()
  endif()

  target_compile_options(
    spurflex_flags
    INTERFACE
      -std=f2008 -pedantic -fimplicit-none
      -Wall -Wextra -Wimplicit-interface -Wimplicit-procedure
      # Release: nothing here changes a rounding; both only drop the bookkeeping of errno and traps.
      "$<$<CONFIG:Release,RelWithDebInfo>:-fno-trapping-math;-fno-math-errno;${spurflex_march}>"
      # Debug: stop at the first wrong index, unset real or invalid operation.
      "$<$<CONFIG:Debug>:-O0;-fcheck=all,no-array-temps;-ffpe-trap=invalid,zero,overflow;-finit-real=snan>"
      "$<$<CONFIG:Debug>:-fbacktrace;-Werror>"
      # gfortran takes descriptors of allocatables and hidden lengths of characters for unset; without
      # optimization it is right about the variables that are plainly so.
      -Wno-maybe-uninitialized "$<$<NOT:$<CONFIG:Debug>>:-Wno-uninitialized>")

  if(SPURFLEX_SANITIZE)
    target_compile_options(spurflex_flags INTERFACE -fsanitize=address,undefined
                                                    -fno-omit-frame-pointer)
    target_link_options(spurflex_flags INTERFACE -fsanitize=address,undefined)
  endif()
  if(SPURFLEX_COVERAGE)
    target_compile_options(spurflex_flags INTERFACE --coverage)
    target_link_options(spurflex_flags INTERFACE --coverage)
  endif()
else()
  message(WARNING "spurflex is tested with gfortran only; "
                  "${CMAKE_Fortran_COMPILER_ID} gets no warning or checking flags")
endif()
