#include <catch2/catch.hpp>

#include <pliant/geometry/walls.h>

#include "support/random.h"
#include "support/taylor.h"

namespace pliant::test::walls_test {

namespace {

template <int D>
Functional wall_functional(const Walls<D>& walls, Index s) {
  return {[&walls, s](const VectorXd& x) { return walls.distance(Vec<D>(x), s, 0); },
          [&walls, s](const VectorXd& x) { return VectorXd(walls.foot(Vec<D>(x), s, 0).n); },
          [&walls, s](const VectorXd& x) { return MatrixXd(walls.foot(Vec<D>(x), s, 0).curvature); }};
}

template <int D>
void check_derivatives(const Walls<D>& walls, Index s, const Vec<D>& r, Random& random) {
  const Functional f = wall_functional(walls, s);
  const VectorXd x = r, p = random_direction(random, D);
  const WallFoot<D> foot = walls.foot(r, s, 0);
  REQUIRE(foot.d > 0.05);
  CHECK(foot.d == walls.distance(r, s, 0));
  CHECK(foot.n.norm() == Approx(1));
  CHECK((foot.curvature - foot.curvature.transpose()).norm() < 1e-13 * (1 + foot.curvature.norm()));
  CHECK(gradient_order(f, x, p, 1e-5) > 1.9);
  CHECK(hessian_order(f, x, p, 1e-5) > 1.9);
  Real d;
  Vec<D> n;
  walls.nearest(r, s, 0, d, n);
  CHECK(d == foot.d);
  CHECK(n == foot.n);
}

// A sloped segment, an upright ray, a level segment that ends on the axis.
const std::vector<WallSegment> segments{WallSegment::between({2, 0}, {4, 3}), WallSegment::ray({4, 3}, {0, 1}),
                                        WallSegment::between({0, -1}, {2, -1})};

}  // namespace

TEST_CASE("distances to wall segments, their ends and endless walls") {
  const Walls<2> walls({WallSegment::between({1, 0}, {5, 0}), WallSegment::ray({5, 0}, {0, 1})});
  CHECK(walls.size() == 2);
  CHECK(walls.distance({3, 2}, 0, 0) == 2);
  CHECK(walls.distance({3, -2}, 0, 0) == 2);  // both sides
  CHECK(walls.distance({-2, 4}, 0, 0) == 5);
  CHECK(walls.distance({4, 1e6}, 1, 0) == 1);
  CHECK(walls.distance({2, -4}, 1, 0) == 5);
}

TEST_CASE("in 3D walls are figures of revolution about z") {
  const Walls<3> walls({WallSegment::ray({5, 0}, {0, 1}), WallSegment::between({2, 0}, {5, 0})});
  CHECK(walls.distance({3, 0, 7}, 0, 0) == Approx(2));  // cylinder, from inside
  CHECK(walls.distance({0, -4, 7}, 0, 0) == Approx(1));
  CHECK(walls.distance({3, 3, 2}, 1, 0) == Approx(2));      // base
  CHECK(walls.distance({0.6, 0.8, 0}, 1, 0) == Approx(1));  // circular lip
  CHECK(walls.distance({0, 0, 0}, 1, 0) == Approx(2));      // on the axis
  CHECK(walls.foot({0, 0, 1}, 1, 0).n.allFinite());
  CHECK(walls.foot({0, 0, 1}, 1, 0).curvature.allFinite());
  const WallFoot<3> lip = walls.foot({0, 1, 0}, 1, 0);
  CHECK((lip.n - Vec<3>(0, -1, 0)).norm() < 1e-15);
  // A circle of radius 2 seen from ρ = 1: ∂²d/∂φ² = −1/ρ along e_φ.
  CHECK(lip.curvature(0, 0) == Approx(-1));
}

/// Of walls in the plane and of their revolution, seen from random places.
void check_derivatives(const Walls<2>& flat, const Walls<3>& revolved, int places) {
  for (int k = 0; k < places; ++k) {
    INFO("state " << k);
    Random random(k);
    const Vec<2> p(random(0.2, 6), random(-3, 6));
    const Real phi = random(0, 2 * pi);
    for (Index s = 0; s < flat.size(); ++s) {
      if (flat.distance(p, s, 0) < 0.06) continue;
      INFO("wall " << s);
      check_derivatives<2>(flat, s, p, random);
      check_derivatives<3>(revolved, s, {p[0] * std::cos(phi), p[0] * std::sin(phi), p[1]}, random);
    }
  }
}

TEST_CASE("derivatives of wall distances") { check_derivatives(Walls<2>(segments), Walls<3>(segments), 200); }

TEST_CASE("derivatives of distances to disks, spheres on the axis and rings") {
  const std::vector<WallSegment> disks{WallSegment::disk({0, 1}, 0.8), WallSegment::disk({3, 2}, 0.5)};
  const Walls<2> flat(disks);
  const Walls<3> revolved(disks);
  check_derivatives(flat, revolved, 100);
  CHECK(flat.distance({0, 3}, 0, 0) == Approx(1.2));
  CHECK(flat.distance({0, 1.5}, 0, 0) == Approx(-0.3));  // inside, it is negative
  CHECK(revolved.distance({0, 3, 2.5}, 1, 0) == Approx(0));
  // From the axis a sphere on it is a sphere.
  const WallFoot<3> top = revolved.foot({0, 0, 3}, 0, 0);
  CHECK((top.n - Vec<3>(0, 0, 1)).norm() < 1e-15);
  CHECK((top.curvature - Vec<3>(0.5, 0.5, 0).asDiagonal().toDenseMatrix()).norm() < 1e-15);
}

}  // namespace pliant::test::walls_test
