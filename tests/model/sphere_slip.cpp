// How vectors across a contact in space move with it.
#include <catch2/catch.hpp>

#include <pliant/model/sphere_slip.h>

namespace pliant::test::sphere_slip_test {

namespace {

using Vector = Vector3<Real>;

Real difference(const Vector& a, const Vector& b) { return norm(a - b); }

}  // namespace

TEST_CASE("a contact that turns by a right angle takes its vectors with it") {
  const SphereSlip<Real> slip({1, 0, 0}, {0, 1, 0}, {});
  const Real root = std::sqrt(2.0);
  CHECK(difference(slip.arc(), (pi / 2 / root) * Vector{-1, 1, 0}) < 1e-14);
  CHECK(difference(slip.carry({0, 1, 0}), {-1, 0, 0}) < 1e-14);
  CHECK(difference(slip.carry({0, 0, 1}), {0, 0, 1}) < 1e-14);  // along the axis
  CHECK(difference(slip.carry_on(slip.arc()), {-pi / 2, 0, 0}) < 1e-14);
  CHECK(difference(slip.along({3, 1, 2}), {1, -1, 2}) < 1e-14);
  CHECK(difference(slip.across({0, 0, 2}), root * Vector{-1, 1, 0}) < 1e-14);
}

TEST_CASE("a contact twists with the mean of both bodies") {
  const SphereSlip<Real> slip({0, 0, 1}, {0, 0, 1}, {0.3, 0, pi});
  CHECK(difference(slip.carry({1, 0, 0}), {0, 1, 0}) < 1e-14);
  CHECK(norm(slip.arc()) == 0);
}

}  // namespace pliant::test::sphere_slip_test
