#include <pliant/base/petsc.h>
#include <pliant/base/version.h>

#include <catch2/catch.hpp>
#include <stdexcept>

namespace pliant::test::petsc_test {
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

PetscErrorCode failing_rhs(TS, PetscReal t, ::Vec, ::Vec, void*) {
  return petsc_callback([&] { throw InputError("the right-hand side does not like t = {}", t); });
}

PetscVec vector(PetscInt n) {
  PetscVec v;
  petsc_check(VecCreateSeq(PETSC_COMM_SELF, n, v.out()));
  return v;
}

}  // namespace

TEST_CASE("an exception in a callback comes out of the PETSc call as itself") {
  const PetscVec y = vector(2);
  PetscTs ts;
  petsc_check(TSCreate(PETSC_COMM_SELF, ts.out()));
  petsc_check(TSSetRHSFunction(ts, nullptr, failing_rhs, nullptr));
  petsc_check(TSSetType(ts, TSRK));
  petsc_check(TSSetTimeStep(ts, 0.1));
  petsc_check(TSSetMaxSteps(ts, 3));
  petsc_check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  CHECK_THROWS_MATCHES(petsc_check(TSSolve(ts, y)), InputError,
                       Catch::Matchers::Message("the right-hand side does not like t = 0"));
}

TEST_CASE("exceptions that are not ours pass through PETSc too") {
  const auto code = petsc_callback([] { throw std::out_of_range("elsewhere"); });
  CHECK(code != 0);
  CHECK_THROWS_AS(petsc_check(code), std::out_of_range);
  CHECK(petsc_callback([] {}) == 0);
  CHECK_NOTHROW(petsc_check(0));
}

TEST_CASE("PETSc errors become NumericalErrors with PETSc's message") {
  const PetscVec a = vector(3), b = vector(4);
  CHECK_THROWS_WITH(petsc_check(VecCopy(a, b)), StartsWith("PETSc error") && Contains("3") && Contains("4"));
  CHECK_THROWS_AS(petsc_check(VecCopy(a, b)), NumericalError);
}

TEST_CASE("an exception that PETSc has swallowed does not surface with a later error") {
  (void)petsc_callback([] { throw InputError("long ago"); });
  const PetscVec a = vector(3), b = vector(4);
  CHECK_THROWS_AS(petsc_check(VecCopy(a, b)), NumericalError);
  CHECK_THROWS_WITH(petsc_check(PETSC_ERR_USER), StartsWith("PETSc error") && Contains("no message"));
}

TEST_CASE("a handle destroys what it owns, once") {
  PetscVec a = vector(3);
  ::Vec raw = a;
  petsc_check(PetscObjectReference(reinterpret_cast<PetscObject>(raw)));
  const auto references = [&] {
    PetscInt count = 0;
    petsc_check(PetscObjectGetReference(reinterpret_cast<PetscObject>(raw), &count));
    return count;
  };
  CHECK(references() == 2);
  {
    PetscVec moved = std::move(a);
    CHECK(moved.get() == raw);
    CHECK(references() == 2);
  }
  CHECK(references() == 1);
  PetscVec owner(raw);
  petsc_check(PetscObjectReference(reinterpret_cast<PetscObject>(raw)));
  petsc_check(VecCreateSeq(PETSC_COMM_SELF, 2, owner.out()));  // used again: releases the first object
  CHECK(references() == 1);
  petsc_check(VecDestroy(&raw));
}

TEST_CASE("a session inside a running PETSc leaves PETSc running") {
  { const PetscSession inner; }
  CHECK_NOTHROW(vector(2));
}

TEST_CASE("build information is complete") {
  const BuildInfo info = build_info();
  CHECK(info.petsc == fmt::format("{}.{}.{}", PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR));
  CHECK_FALSE(info.version.empty());
  CHECK_FALSE(info.commit.empty());
  CHECK_THAT(info.compiler, Contains("."));
  CHECK_THAT(info.hdf5, StartsWith("1."));
  CHECK_THAT(info.text(), StartsWith("pliant " + info.version + "\n") && Contains("PETSc " + info.petsc));
}

}  // namespace pliant::test::petsc_test
