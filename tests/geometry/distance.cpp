#include <catch2/catch.hpp>

#include <pliant/geometry/distance.h>

#include "support/random.h"
#include "support/taylor.h"

namespace pliant::test::distance_test {

namespace {

Functional distance_functional() {
  const auto at = [](const VectorXd& x) {
    return segment_distance(point<2>(x.data(), 0), point<2>(x.data(), 1), point<2>(x.data(), 2));
  };
  return {[=](const VectorXd& x) { return at(x).d; },
          [=](const VectorXd& x) {
            VectorXd g(6);
            for (int k = 0; k < 3; ++k) g.segment<2>(2 * k) = at(x).gradient[k];
            return g;
          },
          [=](const VectorXd& x) {
            MatrixXd h(6, 6);
            for (int k = 0; k < 3; ++k)
              for (int l = 0; l < 3; ++l) h.block<2, 2>(2 * k, 2 * l) = at(x).hessian[k][l];
            return h;
          }};
}

}  // namespace

TEST_CASE("nearest point of a segment") {
  const Vec<2> a(1, 1), b(5, 1);
  const SegmentFoot above = segment_foot({2, 4}, a, b);
  CHECK(above.t == 0.25);
  CHECK(above.d2 == 9);
  CHECK(above.offset == Vec<2>(0, 3));
  CHECK(above.interior());
  const SegmentFoot before = segment_foot({-2, 5}, a, b);
  CHECK(before.t == 0);
  CHECK(before.d2 == 25);
  CHECK(!before.interior());
  const SegmentFoot behind = segment_foot({6, 1}, a, b);
  CHECK(behind.t == 1);
  CHECK(behind.d2 == 1);
  const SegmentFoot degenerate = segment_foot({4, 5}, a, a);
  CHECK(degenerate.t == 0);
  CHECK(degenerate.d2 == 25);
  CHECK(segment_foot({3, 1}, a, b).d2 == 0);
}

TEST_CASE("directions and curvatures vanish at zero distance instead of becoming NaN") {
  CHECK(direction<3>(Vec<3>::Zero(), 0) == Vec<3>::Zero());
  CHECK(distance_curvature<2>(Vec<2>::Zero(), 0) == Mat<2>::Zero());
  const SegmentDistance on = segment_distance({3, 1}, {1, 1}, {5, 1});
  CHECK(on.d == 0);
  CHECK(on.gradient[0].allFinite());
  CHECK(on.hessian[0][1].allFinite());
}

TEST_CASE("derivatives of the distance to a segment: inside, at its ends, and across the boundary") {
  const Functional f = distance_functional();
  for (int k = 0; k < 60; ++k) {
    INFO("state " << k);
    Random random(k);
    const Vec<2> a = 2 * random.unit<2>(), u = random.unit<2>(), n(-u[1], u[0]);
    const Real length = random(0.5, 2), h = random(0.2, 1);
    const Real along = k % 3 == 0 ? random(0.1, 0.9) : k % 3 == 1 ? random(1.1, 1.5) : 1;  // in units of the length
    VectorXd x(6);
    x << a + along * length * u + h * n, a, a + length * u;
    const VectorXd p = random_direction(random, 6);
    REQUIRE(f.energy(x) > 0.1);
    CHECK((f.hessian(x) - f.hessian(x).transpose()).norm() < 1e-13);
    CHECK(gradient_order(f, x, p, 1e-4) > 1.9);
    if (along != 1) {
      CHECK(hessian_order(f, x, p, 1e-4) > 1.9);
    } else {
      CHECK(gradient_order(f, x, -p, 1e-4) > 1.9);
      const Sides sides = compare_sides(f, x, p, 1e-5);
      REQUIRE(sides.hessian_jump > 1e-3);
      CHECK(sides.gradient_jump_order > 0.9);
      CHECK(sides.forward < 1e-6);
      CHECK(sides.backward < 1e-6);
    }
  }
}

}  // namespace pliant::test::distance_test
