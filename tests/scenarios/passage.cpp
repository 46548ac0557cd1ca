// Detection of particles that passed through walls, and of particles that came through the orifice.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>

#include <pliant/model/polygon.h>
#include <pliant/scenarios/hopper/passage.h>

namespace pliant::test::passage_test {
namespace {

/// One polygon in a hopper.
struct Polygon {
  Hopper hopper{.wall_distance = 10, .orifice = 3};
  std::vector<Vec<2>> outline;

  template <class Judge>
  bool judge(Judge&& judge) const {
    Topology topology;
    topology.add_polygon(static_cast<Index>(outline.size()), 1, 0.3, 0.1, 1);
    std::vector<Real> x;
    for (const Vec<2>& r : outline) x.insert(x.end(), {r[0], r[1]});
    const Walls<2> walls = hopper.walls<2>();
    const Vec<2> mean = mean_of_points<2>(x.data(), topology, 0);
    return judge(Passage<2>{x.data(), topology, hopper, walls}, mean);
  }
  bool through_wall(bool outside = false) const {
    return judge([&](const Passage<2>& p, const Vec<2>&) { return p.through_wall(0, outside); });
  }
  bool through_orifice() const {
    return judge([](const Passage<2>& p, const Vec<2>& r) { return p.through_orifice(0, std::array{r[0], r[1]}); });
  }
};

std::vector<Vec<2>> square(Real x, Real y, Real half = 0.5) {
  return {{x - half, y - half}, {x + half, y - half}, {x + half, y + half}, {x - half, y + half}};
}

/// A soft polygon that hangs over the right lip at (1.5, 0): most of its vertices lie on the floor.
const std::vector<Vec<2>> draped{{0.8, -0.6}, {1.2, -0.5}, {1.4, 0.2}, {2, 0.05}, {2.5, 0.1}, {2.6, 0.3}, {1.1, 0.4}};

bool sphere_through_orifice(const Hopper& hopper, const std::array<Real, 3>& place) {
  Topology topology;
  topology.add_soft(1, 1);
  const Walls<3> walls = hopper.walls<3>();
  return Passage<3>{place.data(), topology, hopper, walls}.through_orifice(0, place);
}

bool disk_through_wall(const Hopper& hopper, const std::array<Real, 2>& place, bool outside = false) {
  Topology topology;
  topology.add_soft(1, 1);
  const Walls<2> walls = hopper.walls<2>();
  return Passage<2>{place.data(), topology, hopper, walls}.through_wall(0, outside);
}

}  // namespace

TEST_CASE("polygons between the walls, and through them", "[passage]") {
  CHECK_FALSE(Polygon{.outline = square(3, 0.6)}.through_wall());
  CHECK(Polygon{.outline = square(3, 0.4)}.through_wall());    // floor
  CHECK(Polygon{.outline = square(4.6, 200)}.through_wall());  // upright wall, far up
  CHECK_FALSE(Polygon{.outline = square(4.4, 200)}.through_wall());
  CHECK_FALSE(Polygon{.outline = square(0.5, 0)}.through_wall());           // in the orifice
  CHECK(Polygon{.outline = square(1.4, 0)}.through_wall());                 // a lip within
  CHECK(Polygon{.outline = {{1, -1}, {2, 1}, {1.2, 0.8}}}.through_wall());  // a lip within, no vertex near a wall
  CHECK(Polygon{.outline = {{1, -1}, {4, 0.5}, {1, 1}}}.through_wall());
  CHECK_FALSE(Polygon{.outline = {{1, -1}, {1.45, 0.2}, {1, 1}}}.through_wall());
  CHECK_FALSE(Polygon{.outline = draped}.through_wall());
  const Hopper sloped{.wall_distance = 10, .orifice = 3, .angle = 45};
  CHECK_FALSE(Polygon{sloped, square(1.4, 1)}.through_wall());
  CHECK(Polygon{sloped, square(2.4, 1)}.through_wall());
}

TEST_CASE("polygons through the orifice", "[passage]") {
  CHECK(Polygon{.outline = square(0.5, -0.01)}.through_orifice());
  CHECK_FALSE(Polygon{.outline = square(1.4, -0.01)}.through_orifice());  // its middle is, but it holds a lip
  CHECK_FALSE(Polygon{.outline = square(3, -0.01)}.through_orifice());    // half through the floor
  CHECK_FALSE(Polygon{.outline = square(3, -0.6)}.through_orifice());     // all through the floor
  CHECK_FALSE(Polygon{.outline = square(7, -0.01)}.through_orifice());    // out through the side
  // Its middle lies beyond the lip: on the floor, as it may.
  const Polygon soft{.outline = draped};
  REQUIRE(soft.judge([](const Passage<2>&, const Vec<2>& r) { return r[0] > 1.5; }));
  CHECK(soft.through_orifice());
}

TEST_CASE("disks and spheres go by their centres", "[passage]") {
  const Hopper flat{.wall_distance = 10, .orifice = 3}, sloped{.wall_distance = 10, .orifice = 3, .angle = 45};
  CHECK(sphere_through_orifice(flat, {1, 1.1, 0}));
  CHECK_FALSE(sphere_through_orifice(flat, {1.1, 1.1, 0}));
  CHECK_FALSE(disk_through_wall(flat, {4.99, 1}));
  CHECK(disk_through_wall(flat, {-5.01, 1}));
  CHECK_FALSE(disk_through_wall(sloped, {2.4, 1}));
  CHECK(disk_through_wall(sloped, {2.6, 1}));
  CHECK_FALSE(disk_through_wall(flat, {7, -1}));  // falls outside
}

TEST_CASE("what is outside may be behind the walls, but not go through them", "[passage]") {
  const Hopper sloped{.wall_distance = 10, .orifice = 3, .angle = 45};
  CHECK(Polygon{sloped, square(3.6, 0.9)}.through_wall());
  CHECK_FALSE(Polygon{sloped, square(3.6, 0.9)}.through_wall(true));
  CHECK(Polygon{sloped, square(2.4, 1)}.through_wall(true));
  CHECK_FALSE(disk_through_wall(sloped, {2.6, 1}, true));
  CHECK(disk_through_wall(sloped, {2.4, 1}, true));
}

}  // namespace pliant::test::passage_test
