# cmake --install: headers, libraries, the program, its Python scripts, documentation and examples, and a package config
# so that find_package(pliant) works. Packages install the components library, program, python, commands, data and
# documentation separately (debian/rules, setup.py).
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY PLIANT_LIBRARIES)
install(TARGETS ${libraries} EXPORT pliantTargets)
install(TARGETS pliant RUNTIME COMPONENT program)
install(EXPORT pliantTargets NAMESPACE pliant:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/src/" DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant FILES_MATCHING PATTERN "*.h")

# Commands find the package in the folder of the file that their link leads to. Links relative to the prefix can be moved.
file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/links")
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME python)
set(share "${CMAKE_INSTALL_DATADIR}/pliant")
set(PLIANT_PYTHON_DIR "" CACHE STRING "Folder below the prefix for the Python package, a folder that Python searches; empty: share/pliant/python, with a link for Python")
set(packages "${PLIANT_PYTHON_DIR}")
if(NOT packages)
  set(packages "${share}/python")
endif()
install(DIRECTORY "${PROJECT_SOURCE_DIR}/python/pliant" DESTINATION ${packages}
        FILES_MATCHING PATTERN "*.py" PATTERN "*.json" PATTERN "*.pyi" PATTERN py.typed
        PATTERN "*.html" PATTERN "*.css" PATTERN "*.js" PATTERN __pycache__ EXCLUDE)
if(TARGET pliant_python)
  install(TARGETS pliant_python LIBRARY DESTINATION ${packages}/pliant)
  if(NOT PLIANT_PYTHON_DIR)
    # A link in the folder that Python searches, if the prefix is /usr/local (Debian) or the prefix of Python.
    cmake_path(GET Python_SITELIB FILENAME kind)  # site-packages, on Debian dist-packages
    set(searched "lib/python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/${kind}")
    cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_DATADIR BASE_DIRECTORY "${CMAKE_INSTALL_PREFIX}/${searched}" OUTPUT_VARIABLE from)
    file(CREATE_LINK "${from}/pliant/python/pliant" "${PROJECT_BINARY_DIR}/links/pliant" SYMBOLIC)
    install(FILES "${PROJECT_BINARY_DIR}/links/pliant" DESTINATION ${searched})
  endif()
endif()

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME commands)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_DATADIR BASE_DIRECTORY "${CMAKE_INSTALL_FULL_BINDIR}" OUTPUT_VARIABLE data)
foreach(command pliant-sweep pliant-plot pliant-report pliant-analyse pliant-reproduce)
  install(PROGRAMS "${PROJECT_SOURCE_DIR}/python/${command}" DESTINATION ${share}/python)
  file(CREATE_LINK "${data}/pliant/python/${command}" "${PROJECT_BINARY_DIR}/links/${command}" SYMBOLIC)
  install(FILES "${PROJECT_BINARY_DIR}/links/${command}" TYPE BIN)
endforeach()

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME data)
file(GLOB plots CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/python/plots/*.py")
install(PROGRAMS ${plots} DESTINATION ${share}/python/plots)
install(DIRECTORY validation DESTINATION ${share} FILES_MATCHING PATTERN "*.csv" PATTERN "*.csv.xz")
set(programs own_term own_scenario bouncing_polygon plain_ode)  # need the component library, and a compiler
foreach(program ${programs})
  list(APPEND without_programs PATTERN ${program} EXCLUDE)
endforeach()
install(DIRECTORY examples/ DESTINATION ${share}/examples
        FILES_MATCHING PATTERN "*.yaml" PATTERN "*.py" PATTERN "*.csv" PATTERN "*_outline.txt" ${without_programs})

# Pages lie to each other as in the sources, so that their links hold.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME documentation)
install(FILES README.md ARCHITECTURE.md CHANGELOG.md CONTRIBUTING.md LICENSE CITATION.cff TYPE DOC)
install(DIRECTORY docs TYPE DOC)

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME library)
foreach(program ${programs})
  install(DIRECTORY examples/${program} DESTINATION ${share}/examples)
endforeach()

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/pliantConfig.cmake.in" "${PROJECT_BINARY_DIR}/pliantConfig.cmake"
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/pliantConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/pliantConfig.cmake" "${PROJECT_BINARY_DIR}/pliantConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/PliantDependencies.cmake"
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)

if(TARGET pliant_python AND NOT PLIANT_PYTHON_DIR)
  configure_file(cmake/PliantPythonPath.cmake.in PliantPythonPath.cmake @ONLY)  # uses `searched`
  install(SCRIPT "${PROJECT_BINARY_DIR}/PliantPythonPath.cmake" COMPONENT python)  # the last line of the output
endif()
