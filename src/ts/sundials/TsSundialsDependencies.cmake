# Libraries of pliant-ts-sundials; for its build, for the build of Pliant, and for programs that use an installed
# package.
find_package(MPI REQUIRED COMPONENTS C CXX)
find_package(PkgConfig REQUIRED)
pkg_check_modules(PETSC REQUIRED IMPORTED_TARGET PETSc>=3.18)
find_package(SUNDIALS 6.4 REQUIRED COMPONENTS cvode arkode nvecpetsc sunlinsolspgmr sunnonlinsolnewton sunnonlinsolfixedpoint)
