// Entry of every test program: PETSc lives around Catch2's session.
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>

#include <pliant/base/petsc.h>

int main(int argc, char** argv) {
  pliant::PetscSession petsc;
  return Catch::Session().run(argc, argv);
}
