// A sphere that plugs an orifice in 3D, moved only by the gradient of its overlap energy with the walls.
#include <catch2/catch.hpp>
#include <cmath>

#include <pliant/geometry/walls.h>

namespace pliant::test::plugs_test {

namespace {

/// A sphere of radius 2 and mass 1 with the overlap energy k/2 (2 − d)² and weight 1.
struct Plug {
  static constexpr Real radius = 2, stiffness = 300, dt = 2e-3;
  const Walls<3>& walls;
  Vec<3> r, v = Vec<3>::Zero();
  Real drag = 0;

  Real energy() const {
    const Real depth = std::max(0.0, radius - walls.distance(r, 0, 0));
    return v.squaredNorm() / 2 + r[2] + stiffness / 2 * depth * depth;
  }
  Vec<3> acceleration() const {
    Real d;
    Vec<3> n;
    walls.nearest(r, 0, 0, d, n);
    return stiffness * std::max(0.0, radius - d) * n - Vec<3>::UnitZ() - drag * v;
  }
  void step() {
    v += dt / 2 * acceleration();
    r += dt * v;
    v += dt / 2 * acceleration();
  }
};

}  // namespace

TEST_CASE("a sphere that plugs a ring, a cone or a lip conserves energy, and comes to rest on the axis with drag") {
  struct Case {
    const char* name;
    WallSegment wall;
    Real height;
  };
  for (const Case& of : {Case{"ring", WallSegment::disk({1.5, 0}, 0.1), 1.48},
                         Case{"cone", WallSegment::between({1.2, -0.3}, {4, 2.5}), 1.34},
                         Case{"lip", WallSegment::between({1.5, 0}, {6, 0}), 1.33}}) {
    INFO(of.name);
    const Walls<3> walls({of.wall});
    Plug free{walls, {0.03, -0.02, of.height}};
    const Real before = free.energy();
    Real drift = 0;
    for (int k = 0; k < 100000; ++k) {
      free.step();
      drift = std::max(drift, std::abs(free.energy() - before));
    }
    CHECK(drift < 2e-4);
    Plug damped{walls, {0.03, -0.02, of.height}};
    damped.drag = 1;
    for (int k = 0; k < 50000; ++k) damped.step();
    CHECK(damped.v.norm() < 1e-9);
    CHECK(damped.r.head<2>().norm() < 1e-9);
  }
}

}  // namespace pliant::test::plugs_test
