// The region that particles are in: hoppers, own outlines, obstacles.
#include <catch2/catch.hpp>

#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/geometry/container.h>

#include "support/random.h"

namespace pliant::test::container_test {

namespace {

/// A silo that widens, narrows and leans, with a wall that overhangs.
Vessel leaning() { return {{{-1, 0}, {-4, 2}, {-3, 5}, {-6, 8}, {-6, 9}}, {{1, 0}, {3, 0.5}, {2, 3}, {5, 2}, {4, 7}}}; }

const std::vector<Obstacle> obstacles{{{{0, 4}}, 0.7}, {{{-2, 1.5}, {-1, 1.4}, {-1.2, 2.6}}}};

/// By random points below height y.
Real sampled_capacity(const Container& container, int dim, Real y) {
  Random random(5);
  const Vec<2> across = container.extent();
  const int points = 400000;
  Real sum = 0;
  for (int k = 0; k < points; ++k) {
    const Vec<2> p(random(dim == 2 ? across[0] : 0, across[1]), random(0, y));
    if (container.inside(dim, p)) sum += dim == 2 ? 1 : 2 * pi * p[0];
  }
  return sum / points * y * (across[1] - (dim == 2 ? across[0] : 0));
}

}  // namespace

TEST_CASE("a hopper is a container", "[container]") {
  const Hopper hopper{.wall_distance = 10, .orifice = 4, .angle = 45};
  const Container container(hopper);
  CHECK(container.orifice() == 4);
  CHECK(container.inflow() == Vec<2>(-5, 5));
  CHECK(container.extent() == Vec<2>(-5, 5));
  CHECK(container.upright_from() == hopper.slope_height());
  CHECK(container.plain());
  for (const int dim : {2, 3}) {
    CHECK(container.half_width(dim, 2) == hopper.half_width(2));
    CHECK(container.inside(dim, {2.9, 1}));
    CHECK_FALSE(container.inside(dim, {3.1, 1}));
    CHECK_FALSE(container.inside(dim, {0, -0.1}));
    CHECK(container.inside(dim, {4.9, 1000}));
    for (const Real y : {1.0, 7.0})
      CHECK(container.capacity(dim, y) == Approx(sampled_capacity(container, dim, y)).epsilon(0.01));
    CHECK(container.capacity(dim, container.fill_height(dim, 33)) == Approx(33));
  }
}

TEST_CASE("capacity near the axis", "[container]") {
  const Real w = 4;
  const Container flat(Hopper{.wall_distance = 8, .orifice = w});
  CHECK(flat.capacity_near_axis(2, w, w) == 2 * w * w);
  CHECK(flat.capacity_near_axis(3, w, w) == pi * w * w * w);
  CHECK(flat.capacity_near_axis(2, 5, w) == Approx(8 * w));
  // Between slopes of 45° the width grows from w to 2w within a height of w/2.
  const Container sloped(Hopper{.wall_distance = 20, .orifice = w, .angle = 45});
  CHECK(sloped.capacity_near_axis(2, w, w) == Approx(1.75 * w * w).epsilon(1e-6));
  const auto cone = [](Real from, Real to) { return pi * (to * to * to - from * from * from) / 3; };
  CHECK(sloped.capacity_near_axis(3, w, w) == Approx(cone(w / 2, w) + pi * w * w * w / 2).epsilon(1e-5));
  const Container blocked(Hopper{.wall_distance = 8, .orifice = w}, {Obstacle{{{0.5, 2}}, 1}});
  CHECK(blocked.capacity_near_axis(2, w, w) == Approx(2 * w * w - pi).epsilon(1e-3));
}

TEST_CASE("capacity and inside of outlines with obstacles", "[container]") {
  const Container container(leaning(), obstacles);
  CHECK(container.orifice() == 2);
  CHECK(container.inflow() == Vec<2>(-6, 4));
  CHECK(container.extent() == Vec<2>(-6, 5));
  CHECK(container.upright_from() == 9);
  CHECK_FALSE(container.plain());
  CHECK(container.inside(2, {0, 1}));
  CHECK_FALSE(container.inside(2, {0, 4}));       // in the disk
  CHECK_FALSE(container.inside(2, {-1.4, 1.8}));  // in the triangle
  CHECK(container.inside(2, {-1.9, 2.6}));        // next to it
  CHECK(container.inside(2, {3.5, 3}));           // over the overhang
  CHECK_FALSE(container.inside(2, {3.5, 2}));     // under it
  CHECK_FALSE(container.inside(2, {-3.9, 4}));
  CHECK(container.inside(2, {-5.9, 1e6}));
  CHECK_FALSE(container.inside(2, {4.1, 1e6}));
  CHECK(container.half_width(2, 2.5) == Approx(2.2));
  CHECK(container.half_width(2, -1) == 1);
  const Container revolved(leaning(), {obstacles[0], {{{1, 1.5}, {2, 1.4}, {1.8, 2.6}}}, {{{2.5, 5}}, 0.6}});
  for (const Real y : {1.0, 2.2, 4.1, 5.2, 8.5, 20.0}) {
    CHECK(container.capacity(2, y) == Approx(sampled_capacity(container, 2, y)).epsilon(0.015));
    CHECK(revolved.capacity(3, y) == Approx(sampled_capacity(revolved, 3, y)).epsilon(0.015));
  }
}

TEST_CASE("a hopper whose walls have different angles", "[container]") {
  const Hopper hopper{.wall_distance = 12, .orifice = 3, .angle = 45};
  Random random(9);
  for (const Real left : {0.0, 20.0}) {
    CAPTURE(left);
    const Container container(uneven_hopper(hopper, left));
    const Real lean = std::tan(left * pi / 180), top = 9 / (1 + lean), reach = 1.5 + top * lean;
    CHECK(container.orifice() == 3);
    CHECK(container.upright_from() == Approx(top));
    CHECK(container.inflow()[0] == Approx(-reach));
    CHECK(container.inflow_width() == Approx(12));
    if (left == 0) CHECK(container.inflow()[0] == -1.5);
    CHECK(container.capacity(2, top + 2) == Approx(top * (3 + 12) / 2 + 24));
    // Distances, by brute force from points on the walls.
    std::vector<Vec<2>> on_walls;
    const Real spacing = 1e-3;
    for (Real y = 0; y < 25; y += spacing) {
      on_walls.emplace_back(-1.5 - std::min(y, top) * lean, y);
      on_walls.emplace_back(1.5 + std::min(y, top), y);
    }
    const Walls<2> walls = container.walls<2>();
    for (int k = 0; k < 40; ++k) {
      const Vec<2> p(random(-8, 14), random(-3, 20));
      Real expected = 1e9, found = 1e9;
      for (const Vec<2>& w : on_walls) expected = std::min(expected, (p - w).norm());
      for (Index s = 0; s < walls.size(); ++s) found = std::min(found, walls.distance(p, s, 0));
      CHECK(found == Approx(expected).margin(2 * spacing));
      const Real y = std::min(p[1], top);
      CHECK(container.inside(2, p) == (p[1] > 0 && p[0] > -1.5 - y * lean && p[0] < 1.5 + y));
    }
    // Both ends of the orifice are lips, and no other corner.
    REQUIRE(walls.lips().size() == 2);
    CHECK(walls.lips()[0].place == Vec<2>(-1.5, 0));
    CHECK(walls.lips()[1].place == Vec<2>(1.5, 0));
  }
  const Hopper flat{.wall_distance = 12, .orifice = 3, .angle = 90},
      narrow{.wall_distance = 2, .orifice = 3, .angle = 45};
  CHECK_THROWS_WITH(uneven_hopper(flat, 0),
                    Catch::Contains("angles 0 of the left wall and 90") && Catch::Contains("outline"));
  CHECK_THROWS_WITH(uneven_hopper(hopper, 90), Catch::Contains("angles 90 of the left wall"));
  CHECK_THROWS_WITH(uneven_hopper(narrow, 0), Catch::Contains("use a narrower orifice or a wider container"));
}

TEST_CASE("inside agrees with the walls: no way in but through one", "[container]") {
  const Container container(leaning(), obstacles);
  const Walls<2> walls = container.closed<2>(12);
  const auto crossings = [&](const Vec<2>& a, const Vec<2>& b) {
    int n = 0;
    for (const WallSegment& s : walls.segments()) {
      if (s.radius > 0) continue;
      const Vec<2> c = s.origin, d = s.origin + std::min(s.length, 100.0) * s.direction;
      const auto side = [](const Vec<2>& p, const Vec<2>& q, const Vec<2>& r) {
        return (q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0] > 0;
      };
      n += side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b);
    }
    return n;
  };
  const auto in = [&](const Vec<2>& p) {  // the disk has no segments
    return container.inside(2, p) || (p - obstacles[0].corners[0]).norm() < obstacles[0].radius;
  };
  Random random(4);
  for (int k = 0; k < 20000; ++k) {
    const Vec<2> a(random(-8, 8), random(-2, 11)), b(random(-8, 8), random(-2, 11));
    if ((crossings(a, b) % 2 == 0) != (in(a) == in(b))) {
      CAPTURE(a[0], a[1], b[0], b[1]);
      FAIL_CHECK("parity");
    }
  }
}

TEST_CASE("lips and joints of outlines and obstacles", "[container]") {
  const Walls<2> walls = Container(leaning(), obstacles).walls<2>();
  CHECK(walls.segments().size() == 5 + 5 + 1 + 3);
  CHECK(walls.size() == 14);
  CHECK(walls.parts().size() == 14 + 4 + 4 + 3);
  CHECK_FALSE(walls.plain());
  std::vector<std::pair<Real, Real>> lips;
  for (const Lip& lip : walls.lips()) {
    lips.emplace_back(lip.place[0], lip.place[1]);
    const WallSegment& wall = walls.segments()[lip.wall];
    CHECK(wall.origin == lip.place);
  }
  // The ends of the orifice, the corners that point into the flow, the corners of the triangle.
  CHECK(lips ==
        std::vector<std::pair<Real, Real>>{{-1, 0}, {-3, 5}, {1, 0}, {2, 3}, {-2, 1.5}, {-1, 1.4}, {-1.2, 2.6}});
  for (std::size_t k = walls.segments().size(); k < walls.parts().size(); ++k) {
    CHECK(walls.parts()[k].weight == -1);
    const WallSegment& wall = walls.segments()[walls.wall_of_part(static_cast<Index>(k))];
    CHECK(wall.origin == walls.parts()[k].origin);
  }
  // In space the circles of those with a radius.
  const Walls<3> revolved = Container(leaning(), obstacles).walls<3>();
  REQUIRE(revolved.lips().size() == 2);
  CHECK(revolved.lips()[0].place == Vec<2>(1, 0));
  CHECK(revolved.lips()[1].place == Vec<2>(2, 3));
}

TEST_CASE("a hopper and the same outline push alike, in corners too", "[container]") {
  const Real angle = GENERATE(30, 60, 90);
  const Hopper hopper{.wall_distance = 10, .orifice = 4, .angle = angle};
  const Real slope = hopper.slope_height();
  const Vessel outline{{{-2, 0}, {-5, slope}}, {{2, 0}, {3.5, slope / 2}, {5, slope}}};  // the right wall in two pieces
  const auto energy = [](const Walls<2>& walls, const Vec<2>& r) {
    Real sum = 0;
    for (Index part = 0; part < static_cast<Index>(walls.parts().size()); ++part) {
      const Real d = walls.distance(r, part, 0);
      if (d < 1) sum += walls.weight(part) * square(1 - d);
    }
    return sum;
  };
  const Walls<2> once = Container(hopper).walls<2>(), literal = Container(hopper, {}, CornerRule::literal).walls<2>(),
                 drawn = Container(outline).walls<2>();
  CHECK(literal.plain());
  Random random(7);
  Real most = 0;
  for (int k = 0; k < 2000; ++k) {
    const Vec<2> r(random(-5, 5), slope / 2 + random(-1.5, 3));
    CHECK(energy(once, r) == Approx(energy(drawn, r)).margin(1e-12));
    most = std::max(most, energy(literal, r) - energy(once, r));
  }
  CHECK(most > 0.3);  // reached close to a corner
}

TEST_CASE("a particle can fall to where no wall is in the way", "[container]") {
  const Container container(leaning(), obstacles);
  const Walls<2> walls = container.walls<2>();
  const auto can = [&](Real x, Real y, Real radius) { return Container::can_fall_to<2>(walls, {x, y}, radius); };
  CHECK(can(0, 6, 0.5));
  CHECK_FALSE(can(0, 5.1, 0.5));  // touches the disk
  CHECK(can(0, 5.21, 0.5));
  CHECK_FALSE(can(0, 2, 0.5));    // under it
  CHECK_FALSE(can(1.1, 2, 0.5));  // next to it, too narrow
  CHECK(can(1.21, 2, 0.5));
  CHECK_FALSE(can(-3.5, 3, 0.3));  // under the wall that leans
  CHECK_FALSE(can(4.7, 3, 0.1));   // inside, but to the side of the inflow
  CHECK(can(3.5, 3.5, 0.2));
  const Walls<3> revolved = Container(Hopper{.wall_distance = 10, .orifice = 4}, {{{{0, 4}}, 1.0}}).walls<3>();
  CHECK_FALSE(Container::can_fall_to<3>(revolved, {1, 0.9, 2}, 0.5));
  CHECK(Container::can_fall_to<3>(revolved, {1, 1.2, 2}, 0.5));
}

TEST_CASE("whether particles find a way to the orifice", "[container]") {
  const Hopper hopper{.wall_distance = 10, .orifice = 4};
  const auto passes = [&](std::vector<Obstacle> all, Real radius) {
    return Container(hopper, std::move(all)).lets_pass<2>(radius);
  };
  CHECK(passes({}, 1.9));
  CHECK_FALSE(passes({}, 2.6));
  // Two disks with a gap of 1 in the middle, and one of 1.5 at each side.
  const std::vector<Obstacle> two{{{{-2, 5}}, 1.5}, {{{2, 5}}, 1.5}};
  CHECK(passes(two, 0.7));
  CHECK_FALSE(passes(two, 1));
  // Before the orifice, with ways round.
  const std::vector<Obstacle> shut{{{{-3, 0.5}, {3, 0.5}, {0, 2}}}};
  CHECK_FALSE(passes(shut, 0.5));
  CHECK(passes(shut, 0.2));
  // A slot from wall to wall.
  CHECK_FALSE(passes({{{{-5, 3}, {5, 3}, {5, 4}, {-5, 4}}}}, 0.3));
  const Container ball(hopper, {{{{0, 6}}, 4.5}});
  CHECK(ball.lets_pass<3>(0.2));
  CHECK_FALSE(ball.lets_pass<3>(0.4));
}

TEST_CASE("outlines that are none are refused", "[container]") {
  using Line = Vessel::Line;
  const Line left{{-1, 0}, {-5, 0}, {-5, 3}}, right{{1, 0}, {5, 0}, {5, 3}};
  CHECK_NOTHROW(Vessel(left, right));
  const auto refused = [](const Line& l, const Line& r, const char* a, const char* b = "") {
    CHECK_THROWS_AS(Vessel(l, r), InputError);
    CHECK_THROWS_WITH(Vessel(l, r), Catch::Contains(a) && Catch::Contains(b));
  };
  refused({{-1, 0}}, right, "1 points", "at least two");
  refused(left, {{1, 0}, {1, 0}, {5, 3}}, "(1, 0)", "no length");
  refused(left, {{1, 1}, {5, 3}}, "y = 0", "(1, 1)");
  refused(left, {{1, 0}, {5, -1}, {5, 3}}, "(5, -1)", "below");
  refused({{1, 0}, {-5, 3}}, {{-1, 0}, {5, 3}}, "no width");
  refused({{-2, 0}, {-5, 3}}, right, "not centred", "shift all points by 0.5");
  refused(left, {{1, 0}, {5, 4}, {0, 0}, {0, 3}}, "(0, 0)", "orifice");
  refused(left, {{1, 0}, {5, 4}, {6, 1}, {1, 4}, {1, 9}}, "meets", "(6, 1) to (1, 4)");
  refused(left, {{1, 0}, {-5, 2}}, "meets");
  refused(left, {{1, 0}, {5, 0}, {3, 0}, {3, 5}}, "goes back");
  refused(left, {{1, 0}, {5, 4}, {3, 6}, {3.5, 1}}, "meets");
  refused({{-1, 0}, {-5, 3}, {5, 6}}, right, "meets", "straight up");
}

}  // namespace pliant::test::container_test
