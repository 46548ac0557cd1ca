// Trial steps that leave the domain of a formula, and the views of PETSc's objects.
#include <catch2/catch.hpp>
#include <cstdio>
#include <fstream>
#include <sstream>

#include <pliant/base/errors.h>
#include <pliant/ts/ts_integrator.h>

#include "support/problems.h"

namespace pliant::test::domain_test {

namespace {

/// A body thrown at a wall that repels it as 1/x; behind the wall there is no force. Without inertia the force pushes.
FunctionSystem wall() {
  return {1, [](Real, const Real* x, const Real*, Real* a) {
            if (!(x[0] > 0)) throw NumericalError("the body is behind the wall, at {}", x[0]);
            a[0] = 1 / x[0];
          }};
}

State thrown(Real speed) {
  State s(1, 1);
  s.x()[0] = 1;
  s.v()[0] = -speed;
  return s;
}

std::string read_and_remove(const std::string& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  std::remove(file.c_str());
  return text.str();
}

}  // namespace

TEST_CASE("a trial step that leaves the domain of a formula is tried again, shorter") {
  for (const std::string type :
       {"-ts_type rk -ts_rk_type 5dp", "-ts_type rk -ts_rk_type 3bs", "-ts_type cvode", "-ts_type arkode"}) {
    INFO(type);
    const PetscOptionScope options(type);
    TsIntegrator integrator({.rtol = 1e-6, .atol_x = 1e-6, .atol_v = 1e-6, .dt = 5});
    FunctionSystem system = wall();
    State s = thrown(1);
    integrator.run(system, s, 3, true, {});
    CHECK(s.t == 3);
    // v²/2 − ln x is conserved.
    CHECK(s.v()[0] * s.v()[0] / 2 - std::log(s.x()[0]) == Approx(0.5).margin(1e-3));
  }
}

TEST_CASE("where there is no force at the start, or steps are fixed, the error arrives as it was") {
  FunctionSystem system = wall();
  const PetscOptionScope options("");
  State behind = thrown(1);
  behind.x()[0] = -1;
  CHECK_THROWS_WITH(TsIntegrator().run(system, behind, 1, true, {}), Catch::Contains("behind the wall, at -1"));
  const PetscOptionScope fixed("-ts_rk_type 4");
  State s = thrown(1);
  CHECK_THROWS_WITH(TsIntegrator({.dt = 2.5}).run(system, s, 3, true, {}), Catch::Contains("behind the wall"));
}

TEST_CASE("views of PETSc's objects are read before the run, and written") {
  const PetscOptionScope options("-ts_view ascii:domain_view.txt -ts_converged_reason ascii:domain_reason.txt");
  FunctionSystem system = wall();
  TsIntegrator integrator;
  PetscInt left = 0;
  char **names = nullptr, **values = nullptr;
  petsc_check(PetscOptionsLeftGet(nullptr, &left, &names, &values));
  petsc_check(PetscOptionsLeftRestore(nullptr, &left, &names, &values));
  CHECK(left == 0);
  State s = thrown(1);
  integrator.run(system, s, 1, true, {});
  CHECK_THAT(read_and_remove("domain_view.txt"), Catch::Contains("TS Object"));
  CHECK_THAT(read_and_remove("domain_reason.txt"), Catch::Contains("TS converged due to CONVERGED_"));
}

TEST_CASE("views of solvers are read where a method has them") {
  const PetscOptionScope options("-snes_view");
  const auto left = [] {
    PetscInt count = 0;
    char **names = nullptr, **values = nullptr;
    petsc_check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
    petsc_check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
    return count;
  };
  const TsIntegrator implicit_method({.type = "bdf"});
  CHECK(left() == 0);
}

}  // namespace pliant::test::domain_test
