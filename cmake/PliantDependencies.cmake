# Libraries of Pliant. The libraries of pliant-ts-sundials are found earlier. The build tree includes this file and,
# through the package config, by programs that use an installed Pliant.
find_package(OpenMP REQUIRED COMPONENTS CXX)
pkg_check_modules(YAML REQUIRED IMPORTED_TARGET yaml-0.1)  # the YAML reader of PETSc, too
pkg_check_modules(SLEPC REQUIRED IMPORTED_TARGET SLEPc>=3.18)  # of the same version as PETSc
find_package(Eigen3 3.4 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
set(HDF5_PREFER_PARALLEL ON)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(ZLIB REQUIRED)  # checksums of run.h5 and checkpoints; HDF5 needs it too
