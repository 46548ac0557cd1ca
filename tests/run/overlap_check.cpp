// Particles inside walls, and steps too long to notice an obstacle. On any number of ranks.
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include <pliant/model/wall_contact.h>
#include <pliant/run/overlap_check.h>
#include <pliant/ts/verlet.h>

#include "support/disks.h"

namespace pliant::test::overlap_check_test {

namespace {

/// A disk of diameter 1 (and a second, distant disk) at r, with velocity v, checked for a step of 0.1; optionally its
/// overlap.
std::string verdict(const Walls<2>& walls, const pliant::Vec<2>& r, const pliant::Vec<2>& v = {0, 0},
                    Real* overlap = nullptr) {
  Configuration<2> c;
  c.add_soft(1, {50, 50});
  c.add_soft(1, r);
  c.walls = walls;
  auto s = simulation_of<2>(c, Sorting::never, Ranks(PETSC_COMM_WORLD), std::make_unique<FixedStepVerlet>(1e-3),
                            WallContact<2>{100});
  s->place(c.x);
  for (Index m = 0; m < s->topology().owned(); ++m)
    if (s->topology().id[m] == 1)
      for (int k = 0; k < 2; ++k) s->state().v()[2 * m + k] = v[k];
  try {
    const Real largest = check_walls_hold(s->view(), 0.1, s->ranks(), "do this");
    if (overlap) *overlap = largest;
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("more than a radius inside a wall, which may move, is through it", "[ranks]") {
  Walls<2> walls(WallParts{{WallSegment::disk({5, 5}, 2)}});
  walls.add(Solid<2>::half_space({0, 0}, {0, 1}), {.velocity = {0, 1}});
  CHECK(verdict(walls, {0, 0.4}).empty());
  CHECK(verdict(walls, {0, 0.001}).empty());  // the centre is outside
  const std::string through = verdict(walls, {0, -0.35});
  CHECK(through.find("particle 1 went through wall 1: it overlaps by 1.7 radii; do this") == 0);
  CHECK(verdict(walls, {0, -30}).find("went through") != std::string::npos);
  CHECK(verdict(walls, {5, 2.9}).empty());
  CHECK(verdict(walls, {5, 3.5}).find("particle 1 went through wall 0") == 0);
}

TEST_CASE("an overlap with a thin wall is found before the centre is on its other side", "[ranks]") {
  const Walls<2> walls(WallParts{{WallSegment::between({-1, 0}, {1, 0})}});
  for (const Real y : {0.4, 0.01, -0.02}) {  // a thin wall pushes to both sides
    Real overlap = -1;
    CHECK(verdict(walls, {0.2, y}, {0, 0}, &overlap).empty());
    CHECK(overlap == Approx(1 - 2 * std::abs(y)));
  }
  Real overlap = -1;
  verdict(walls, {0.2, 0.6}, {0, 0}, &overlap);
  CHECK(overlap == 0);
}

TEST_CASE("a step that is longer than a radius passes through what it does not see", "[ranks]") {
  CHECK(verdict({}, {0, 0}, {3, -3.9}).empty());
  CHECK(verdict({}, {0, 0}, {3, -4.1}).find("particle 1 moves by 1.02 radii in a step") == 0);
}

}  // namespace pliant::test::overlap_check_test
