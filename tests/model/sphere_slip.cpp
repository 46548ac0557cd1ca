// How vectors across a contact in space move with it.
#include <catch2/catch.hpp>

#include <pliant/model/sphere_slip.h>

namespace pliant::test::sphere_slip_test {
using Vector = Vec<3>;

TEST_CASE("a contact that turns by a right angle takes its vectors with it") {
  const SphereSlip slip(Vector(1, 0, 0), Vector(0, 1, 0), Vector::Zero());
  CHECK((slip.arc() - pi / 2 * Vector(-1, 1, 0).normalized()).norm() < 1e-14);
  CHECK((slip.carry(Vector(0, 1, 0)) - Vector(-1, 0, 0)).norm() < 1e-14);
  CHECK((slip.carry(Vector(0, 0, 1)) - Vector(0, 0, 1)).norm() < 1e-14);  // along the axis
  CHECK((slip.carry_on(slip.arc()) - Vector(-pi / 2, 0, 0)).norm() < 1e-14);
  CHECK((slip.along(Vector(3, 1, 2)) - Vector(1, -1, 2)).norm() < 1e-14);
  CHECK((slip.across(Vector(0, 0, 2)) - 2 * Vector(-1, 1, 0).normalized()).norm() < 1e-14);
}

TEST_CASE("a contact twists with the mean of both bodies") {
  const SphereSlip slip(Vector(0, 0, 1), Vector(0, 0, 1), Vector(0.3, 0, pi));
  CHECK((slip.carry(Vector(1, 0, 0)) - Vector(0, 1, 0)).norm() < 1e-14);
  CHECK(slip.arc().norm() == 0);
}

}  // namespace pliant::test::sphere_slip_test
