# include()d: pliant_version_header(<target>) gives a target the generated header with version, commit, compiler and flags.
# Run by each build (cmake -P): writes that header again, touching it only if its content has changed.
if(NOT CMAKE_SCRIPT_MODE_FILE)
  function(pliant_version_header target)
    set(folder "${PROJECT_BINARY_DIR}/version")
    string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
    string(STRIP "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${type}}" flags)
    add_custom_target(pliant_version BYPRODUCTS "${folder}/pliant_version_generated.h" VERBATIM
      COMMAND "${CMAKE_COMMAND}"
        -D "TEMPLATE=${PROJECT_SOURCE_DIR}/cmake/pliant_version_generated.h.in"
        -D "OUTPUT=${folder}/pliant_version_generated.h"
        -D "PLIANT_SOURCE_DIR=${PROJECT_SOURCE_DIR}"
        -D "PLIANT_VERSION=${PROJECT_VERSION}"
        -D "PLIANT_COMPILER=${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}"
        -D "PLIANT_BUILD_TYPE=${CMAKE_BUILD_TYPE}"
        -D "PLIANT_FLAGS=${flags}"
        -D "PLIANT_HDF5_VERSION=${HDF5_VERSION}"
        -P "${PROJECT_SOURCE_DIR}/cmake/PliantVersion.cmake")
    add_dependencies(${target} pliant_version)
    target_include_directories(${target} PRIVATE "${folder}")
  endfunction()
  return()
endif()

set(PLIANT_COMMIT unknown)
find_package(Git QUIET)
if(GIT_FOUND)
  execute_process(COMMAND "${GIT_EXECUTABLE}" --no-optional-locks describe --always --dirty --abbrev=12 --exclude=*
                  WORKING_DIRECTORY "${PLIANT_SOURCE_DIR}" OUTPUT_VARIABLE commit RESULT_VARIABLE result
                  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(result EQUAL 0)
    set(PLIANT_COMMIT "${commit}")
  endif()
endif()
configure_file("${TEMPLATE}" "${OUTPUT}" @ONLY ESCAPE_QUOTES)
