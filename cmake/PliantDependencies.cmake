# Everything Pliant links to; shared by the build tree and, through the package config, by programs that use an installed Pliant.
find_package(MPI REQUIRED COMPONENTS C CXX)
find_package(OpenMP REQUIRED COMPONENTS CXX)
find_package(PkgConfig REQUIRED)
pkg_check_modules(PETSC REQUIRED IMPORTED_TARGET PETSc>=3.18)
pkg_check_modules(YAML REQUIRED IMPORTED_TARGET yaml-0.1)  # the YAML reader of PETSc, too
find_package(SUNDIALS 6.4 REQUIRED COMPONENTS cvode arkode nvecpetsc sunlinsolspgmr sunnonlinsolnewton sunnonlinsolfixedpoint)
find_package(Eigen3 3.4 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
set(HDF5_PREFER_PARALLEL ON)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(ZLIB REQUIRED)  # checksums of run.h5 and checkpoints; HDF5 needs it too
