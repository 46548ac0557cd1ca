# cmake --install: headers, libraries, the program, its Python scripts, documentation and examples, and a package config
# so that find_package(pliant) works.
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY PLIANT_LIBRARIES)
install(TARGETS ${libraries} EXPORT pliantTargets)
install(TARGETS pliant RUNTIME)
install(EXPORT pliantTargets NAMESPACE pliant:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/src/" DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant FILES_MATCHING PATTERN "*.h")

# Commands find the package in the folder of the file that their link leads to. Links relative to the prefix can be moved.
set(share "${CMAKE_INSTALL_DATADIR}/pliant")
set(commands pliant-sweep pliant-plot pliant-report pliant-analyse pliant-reproduce)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/python/pliant" DESTINATION ${share}/python
        FILES_MATCHING PATTERN "*.py" PATTERN "*.json" PATTERN "*.pyi" PATTERN py.typed
        PATTERN "*.html" PATTERN "*.css" PATTERN "*.js" PATTERN __pycache__ EXCLUDE)
file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/dist-packages")
if(TARGET pliant_python)
  install(TARGETS pliant_python LIBRARY DESTINATION ${share}/python/pliant)
  # Where the Python of the system looks for packages, if the prefix is /usr/local: a link to the package.
  set(packages "lib/python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/dist-packages")
  cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_DATADIR BASE_DIRECTORY "${CMAKE_INSTALL_PREFIX}/${packages}" OUTPUT_VARIABLE from)
  file(CREATE_LINK "${from}/pliant/python/pliant" "${PROJECT_BINARY_DIR}/dist-packages/pliant" SYMBOLIC)
  install(FILES "${PROJECT_BINARY_DIR}/dist-packages/pliant" DESTINATION ${packages})
endif()
file(GLOB plots CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/python/plots/*.py")
install(PROGRAMS ${plots} DESTINATION ${share}/python/plots)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_DATADIR BASE_DIRECTORY "${CMAKE_INSTALL_FULL_BINDIR}" OUTPUT_VARIABLE data)
foreach(command ${commands})
  install(PROGRAMS "${PROJECT_SOURCE_DIR}/python/${command}" DESTINATION ${share}/python)
  file(CREATE_LINK "${data}/pliant/python/${command}" "${PROJECT_BINARY_DIR}/${command}" SYMBOLIC)
  install(FILES "${PROJECT_BINARY_DIR}/${command}" TYPE BIN)
endforeach()

# Pages lie to each other as in the sources, so that their links hold.
install(FILES README.md ARCHITECTURE.md CHANGELOG.md CONTRIBUTING.md LICENSE CITATION.cff TYPE DOC)
install(DIRECTORY docs TYPE DOC)
install(DIRECTORY validation DESTINATION ${share} FILES_MATCHING PATTERN "*.csv" PATTERN "*.csv.xz")
install(DIRECTORY examples/ DESTINATION ${share}/examples FILES_MATCHING PATTERN "*.yaml" PATTERN "*.py" PATTERN "*.csv" PATTERN "*_outline.txt")
foreach(program own_term own_scenario bouncing_polygon plain_ode)
  install(DIRECTORY examples/${program} DESTINATION ${share}/examples)
endforeach()

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/pliantConfig.cmake.in" "${PROJECT_BINARY_DIR}/pliantConfig.cmake"
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/pliantConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/pliantConfig.cmake" "${PROJECT_BINARY_DIR}/pliantConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/PliantDependencies.cmake"
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
