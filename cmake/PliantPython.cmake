# The Python module pliant._core, from src/python. It lies in build/python/pliant, with links to the files of the package
# next to it: PYTHONPATH=build/python finds both.
find_program(PLIANT_PYTHON_PROGRAM python3 PATHS /usr/bin NO_DEFAULT_PATH)  # the one with Debian's numpy and h5py
find_program(PLIANT_PYTHON_PROGRAM python3)
if(PLIANT_PYTHON_PROGRAM)
  set(Python_EXECUTABLE "${PLIANT_PYTHON_PROGRAM}")
  set(PYBIND11_FINDPYTHON ON)
  find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module)
  if(Python_Development.Module_FOUND)
    find_package(pybind11 2.10 CONFIG QUIET)
  endif()
endif()
set(found OFF)
if(pybind11_FOUND)
  set(found ON)
endif()
option(PLIANT_PYTHON "Build the Python module pliant._core" ${found})

if(PLIANT_PYTHON AND NOT pybind11_FOUND)
  message(FATAL_ERROR "PLIANT_PYTHON is ON, but pybind11 2.10 or the headers of Python were not found; install pybind11-dev and python3-dev (scripts/setup.sh), or configure with -D PLIANT_PYTHON=OFF")
elseif(NOT PLIANT_PYTHON)
  if(NOT found)
    message(STATUS "Python module: not built, as pybind11-dev or python3-dev is missing; Python reads runs, but starts none")
  endif()
  return()
endif()

file(GLOB sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/python/*.cpp")
pybind11_add_module(pliant_python MODULE NO_EXTRAS ${sources})
target_link_libraries(pliant_python PRIVATE pliant_scenarios pliant_warnings)
target_compile_options(pliant_python PRIVATE ${pliant_optimise_less})
# Its libraries share the process with others, as those of petsc4py: it exports nothing but its start.
target_link_options(pliant_python PRIVATE -Wl,--exclude-libs,ALL)
set(package "${PROJECT_BINARY_DIR}/python/pliant")
set_target_properties(pliant_python PROPERTIES OUTPUT_NAME _core LIBRARY_OUTPUT_DIRECTORY "${package}"
  UNITY_BUILD_BATCH_SIZE 0)  # one for each of two cores
file(GLOB files CONFIGURE_DEPENDS LIST_DIRECTORIES true "${PROJECT_SOURCE_DIR}/python/pliant/*")
file(MAKE_DIRECTORY "${package}")
foreach(file ${files})
  cmake_path(GET file FILENAME name)
  if(NOT name STREQUAL __pycache__)
    file(CREATE_LINK "${file}" "${package}/${name}" SYMBOLIC)
  endif()
endforeach()
