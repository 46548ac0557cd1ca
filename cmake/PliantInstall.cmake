# cmake --install: headers, libraries, the program, and a package config so that find_package(pliant) works.
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY PLIANT_LIBRARIES)
install(TARGETS ${libraries} EXPORT pliantTargets)
install(TARGETS pliant RUNTIME)
install(EXPORT pliantTargets NAMESPACE pliant:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/src/" DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pliant FILES_MATCHING PATTERN "*.h")

# The command finds the package beside the file that its link leads to. Links relative to the prefix can be moved.
install(DIRECTORY "${PROJECT_SOURCE_DIR}/python/pliant" DESTINATION ${CMAKE_INSTALL_DATADIR}/pliant/python
        FILES_MATCHING PATTERN "*.py" PATTERN __pycache__ EXCLUDE)
install(PROGRAMS "${PROJECT_SOURCE_DIR}/python/pliant-sweep" DESTINATION ${CMAKE_INSTALL_DATADIR}/pliant/python)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_DATADIR BASE_DIRECTORY "${CMAKE_INSTALL_FULL_BINDIR}" OUTPUT_VARIABLE share)
file(CREATE_LINK "${share}/pliant/python/pliant-sweep" "${PROJECT_BINARY_DIR}/pliant-sweep" SYMBOLIC)
install(FILES "${PROJECT_BINARY_DIR}/pliant-sweep" TYPE BIN)

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/pliantConfig.cmake.in" "${PROJECT_BINARY_DIR}/pliantConfig.cmake"
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/pliantConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/pliantConfig.cmake" "${PROJECT_BINARY_DIR}/pliantConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/PliantDependencies.cmake"
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pliant)
