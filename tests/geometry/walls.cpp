#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

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
  // On the axis, where a ring seems nearer.
  CHECK(walls.distance({0, 0, 0}, 1, 0) == Approx(2 - 0.375 * axis_width));
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

TEST_CASE(
    "near the axis the distance to a surface of revolution is smooth, and far from it that to the nearest point") {
  // A cone with an orifice, a ring, a floor, and a sphere on the axis.
  const Walls<3> walls({WallSegment::between({0.8, 0}, {2, 1.5}), WallSegment::disk({0.7, 0.2}, 0.1),
                        WallSegment::between({0, -1}, {2, -1}), WallSegment::disk({0, -1}, 0.4)});
  Random random(3);
  for (const Real rho : {0.0, 1e-6, 0.01, 0.03, 0.049, 0.051, 0.2})
    for (Index s = 0; s < walls.size(); ++s) {
      CAPTURE(rho, s);
      const VectorXd x = Vec<3>(0.6 * rho, -0.8 * rho, 0.9), p = random_direction(random, 3);
      const Functional f = wall_functional(walls, s);
      CHECK(gradient_order(f, x, p, 1e-3) > 1.9);
      CHECK(hessian_order(f, x, p, 1e-3) > 1.9);
      const WallFoot<3> foot = walls.foot(Vec<3>(x), s, 0);
      Real d;
      Vec<3> n;
      walls.nearest(Vec<3>(x), s, 0, d, n);
      CHECK(d == foot.d);
      CHECK(d == walls.distance(Vec<3>(x), s, 0));
      CHECK((n - foot.n).norm() < 1e-15);
    }
  const auto at = [&](Real rho, Index s) { return walls.foot({rho, 0, 0.9}, s, 0); };
  for (Index s = 0; s < walls.size(); ++s) {
    CHECK(at(0, s).n.head<2>().norm() == 0);
    const WallFoot<3> inside = at(axis_width * (1 - 1e-9), s), outside = at(axis_width, s);
    CHECK(inside.d == Approx(outside.d));
    CHECK((inside.n - outside.n).norm() < 1e-7);
    CHECK((inside.curvature - outside.curvature).norm() < 1e-6);
  }
  CHECK(at(axis_width, 1).d == std::hypot(axis_width - 0.7, 0.9 - 0.2) - 0.1);
  CHECK(at(0, 2).d == Approx(1.9));  // level: no kink at the axis
  CHECK(at(0.02, 3).d == Approx(std::hypot(0.02, 1.9) - 0.4));
  // By how much a ring comes nearer on the axis.
  CHECK(std::hypot(0.7, 0.7) - 0.1 - at(0, 1).d == Approx(0.375 * axis_width * std::sqrt(0.5)).epsilon(0.02));
  // Nothing moves faster than the point: lists with a skin hold every contact.
  for (Real rho = 0; rho < 0.06; rho += 1e-3) CHECK(at(rho, 0).n.norm() < 1 + 1e-12);
}

TEST_CASE("what touches a ring near the axis is found") {
  const Walls<3> walls({WallSegment::disk({0.7, 0.2}, 0.1), WallSegment::between({0.8, 0}, {2, 1.5})});
  std::vector<Index> near;
  for (Real rho = 0; rho < 0.06; rho += 0.005)
    for (Index s = 0; s < 2; ++s) {
      const Vec<3> r(0, rho, 0.9);
      const Real d = walls.distance(r, s, 0);
      walls.find_near(r, d + 1e-6, 0, near);
      CHECK(std::count(near.begin(), near.end(), s) == 1);
      walls.find_near(r, d - 1e-6, 0, near);
      CHECK(std::count(near.begin(), near.end(), s) == 0);
    }
}

}  // namespace pliant::test::walls_test
