// Walls that move: positions, velocities, distances, and the points near them.
#include <catch2/catch.hpp>

#include <numeric>

#include <pliant/geometry/obstacle.h>
#include <pliant/geometry/walls.h>

#include "support/random.h"
#include "support/taylor.h"

namespace pliant::test::moving_walls_test {

namespace {

template <int D>
Rotation<D> random_spin(Random& random, Real most) {
  if constexpr (D == 2)
    return random(-most, most);
  else
    return most * random.unit<3>();
}

/// A translation, an oscillation, a rotation, and all of them.
template <int D>
Motion<D> random_motion(Random& random, int kind) {
  Motion<D> m{.since = random(-1, 1)};
  if (kind == 0 || kind == 3) m.velocity = random.unit<D>();
  if (kind == 1 || kind == 3) m.amplitude = 0.7 * random.unit<D>(), m.frequency = 2.3, m.phase = random(0, 6);
  if (kind >= 2) m.spin = random_spin<D>(random, 1.1), m.pivot = 2 * random.unit<D>();
  return m;
}

WallParts outline() {
  WallParts parts;
  Obstacle{{{1, -0.5}, {3, -1}, {3.5, 1}, {2, 0.3}}}.add_to(parts);
  parts.segments.push_back(WallSegment::disk({4, 2}, 0.6));
  parts.segments.push_back(WallSegment::ray({0.5, 2}, {0.6, 0.8}));
  return parts;
}

/// Segments, a disk, a ray, a half-space and a wedge, each body with a different motion that has changed in between.
template <int D>
Walls<D> moving_walls(Random& random, int kind) {
  Walls<D> walls;
  walls.add(outline(), random_motion<D>(random, kind));
  walls.add(Solid<D>::half_space(random.unit<D>(), random.unit<D>()), random_motion<D>(random, kind));
  const Vec<D> along = random.unit<D>();
  walls.add(Solid<D>::wedge(random.unit<D>(), along, Vec<D>(random.unit<D>() + 0.1 * along)),
            random_motion<D>(random, kind));
  for (Index body = 0; body < 3; ++body) {
    Motion<D> next = random_motion<D>(random, kind);
    next.since = walls.motion(body).since + 0.4;
    walls.set_motion(body, next);
  }
  return walls;
}

/// Whether a place is where the distance from a part is twice differentiable.
template <int D>
bool smooth(const Walls<D>& walls, Index part, const Vec<D>& r, Real t) {
  const WallFoot<D> here = walls.foot(r, part, t);
  if (std::abs(here.d) < 0.1 || here.curvature.norm() > 20) return false;
  for (int k = 0; k < D; ++k)
    for (const Real h : {-0.02, 0.02}) {
      const Vec<D> shift = h * Vec<D>::Unit(k);
      const WallFoot<D> there = walls.foot(r + shift, part, t);
      if ((there.n - here.n - here.curvature * shift).norm() > 0.01) return false;
    }
  return true;
}

}  // namespace

TEST_CASE("a solid moves with its velocity and keeps its place when that changes", "[motion]") {
  Walls<2> walls(std::vector{Solid<2>::half_space({1, 2}, {0, 3})});
  const auto distance = [&](Real t) { return walls.distance({5, 2.5}, 0, t); };
  CHECK_FALSE(walls.move());
  CHECK(distance(7) == Approx(0.5));
  walls.set_motion(0, {.velocity = {0, -0.25}, .since = 2});
  CHECK(walls.move());
  CHECK(distance(4) == Approx(1));
  walls.set_motion(0, {.velocity = {0, 1}, .since = 4});
  CHECK(distance(4) == Approx(1));
  CHECK(distance(4.5) == Approx(0.5));
  walls.set_motion(0, {.amplitude = {0, 2}, .frequency = pi, .phase = pi / 2, .since = 5});
  CHECK(distance(5) == Approx(0).margin(1e-12));
  CHECK(distance(6) == Approx(4));  // the wall passed its highest position
  walls.set_motion(0, {.since = 6});
  CHECK(distance(60) == Approx(4));
  walls.set_motion(0, {.spin = pi / 2, .pivot = {5, -1.5}, .since = 7});
  CHECK(distance(7) == Approx(4));
  CHECK(walls.distance({6, 0}, 0, 8) == Approx(-1));  // its normal is −x now
}

TEMPLATE_TEST_CASE_SIG("walls that move: derivatives by place and time", "[motion]", ((int D), D), 2, 3) {
  const int kind = GENERATE(0, 1, 2, 3);
  CAPTURE(kind);
  int checked = 0;
  for (int k = 0; k < 30; ++k) {
    Random random(k);
    const Walls<D> walls = moving_walls<D>(random, kind);
    const Real t = random(0.5, 3);
    for (Index part = 0; part < walls.part_count(); ++part) {
      const Vec<D> r = 2.5 * random.unit<D>() + random.unit<D>();
      if (!smooth<D>(walls, part, r, t)) continue;
      ++checked;
      const WallFoot<D> foot = walls.foot(r, part, t);
      const Functional f{[&](const VectorXd& x) { return walls.distance(Vec<D>(x), part, t); },
                         [&](const VectorXd& x) { return VectorXd(walls.foot(Vec<D>(x), part, t).n); },
                         [&](const VectorXd& x) { return MatrixXd(walls.foot(Vec<D>(x), part, t).curvature); }};
      INFO("state " << k << " part " << part);
      CHECK(foot.d == Approx(walls.distance(r, part, t)).epsilon(1e-13));
      CHECK(foot.n.norm() == Approx(1));
      const VectorXd p = random_direction(random, D), x = r;
      if (foot.curvature.norm() > 1e-9) {
        CHECK(gradient_order(f, x, p, 1e-4) > 1.9);
        CHECK(hessian_order(f, x, p, 1e-4) > 1.9);
      } else {
        CHECK(f.energy(x + 0.01 * p) - foot.d == Approx(0.01 * foot.n.dot(p)).margin(1e-12));
      }
      Real d;
      Vec<D> n;
      walls.nearest(r, part, t, d, n);
      CHECK(d == Approx(foot.d).epsilon(1e-13));
      CHECK((n - foot.n).norm() < 1e-13);
      // ∂d/∂t = −n·v of the wall where it is touched.
      const Real h = 1e-4, slope = (walls.distance(r, part, t + h) - walls.distance(r, part, t - h)) / (2 * h);
      CHECK(slope == Approx(-n.dot(walls.velocity(r - d * n, part, t))).margin(1e-6));
    }
  }
  CHECK(checked > 100);
}

TEMPLATE_TEST_CASE_SIG("what goes with a wall keeps its distance and has its velocity", "[motion]", ((int D), D), 2,
                       3) {
  const int kind = GENERATE(0, 1, 2, 3);
  Random random(kind);
  const Walls<D> walls = moving_walls<D>(random, kind);
  for (Index body = 0; body < walls.bodies(); ++body) {
    const Real t = random(1, 3), h = 1e-4;
    const Vec<D> b = 2 * random.unit<D>();
    const auto at = [&](Real s) { return walls.pose(body, s).place(b); };
    CHECK((walls.pose(body, t).back(at(t)) - b).norm() < 1e-14);
    for (Index part = 0; part < walls.part_count(); ++part) {
      if (walls.body_of_wall(walls.wall_of_part(part)) != body) continue;
      CHECK(walls.distance(at(t), part, t) == Approx(walls.distance(at(t + 0.8), part, t + 0.8)).margin(1e-12));
      CHECK((walls.velocity(at(t), part, t) - (at(t + h) - at(t - h)) / (2 * h)).norm() < 1e-6);
    }
  }
}

TEMPLATE_TEST_CASE_SIG("what is near walls that move, as by brute force", "[motion]", ((int D), D), 2, 3) {
  Random random(8);
  Walls<D> walls = moving_walls<D>(random, 3);
  WallParts ring;
  Obstacle round;
  for (int k = 0; k < 200; ++k)
    round.corners.push_back(Vec<2>(3, 0) + 1.5 * Vec<2>(std::cos(2 * pi * k / 200), std::sin(2 * pi * k / 200)));
  round.add_to(ring);
  walls.add(ring, random_motion<D>(random, 3));
  REQUIRE(walls.part_count() == 4 + 2 + 4 + 400 + 2);
  std::size_t found = 0;
  for (int k = 0; k < 200; ++k) {
    const Real t = random(0, 4), radius = random(0.1, 1);
    const Vec<D> r = random(0, 5) * random.unit<D>();
    std::vector<Index> near, expected;
    for (Index part = 0; part < walls.part_count(); ++part) {
      const bool within = walls.distance(r, part, t) < radius;
      if (within) expected.push_back(part);
      CHECK(walls.beyond(r, radius, part, t) == (!within && !walls.solid(part, t)));
    }
    walls.find_near(r, radius, t, near);
    CHECK(near == expected);
    found += near.size();
    if constexpr (D == 2) {
      expected.clear();
      for (Index l = 0; l < static_cast<Index>(walls.lips().size()); ++l)
        if ((walls.lip(l, t) - r).norm() < radius) expected.push_back(l);
      walls.find_near_lips(r, radius, t, near);
      CHECK(near == expected);
    }
  }
  CHECK(found > 500);
}

TEMPLATE_TEST_CASE_SIG("what is beyond reach is so however walls move", "[motion]", ((int D), D), 2, 3) {
  Random random(11);
  int beyond = 0, within = 0;
  for (int kind = 0; kind < 4; ++kind) {
    const Walls<D> walls = moving_walls<D>(random, kind);
    for (int k = 0; k < 50; ++k) {
      const Real t = random(0, 4), reach = random(0.1, 2);
      const Vec<D> r = random(0, 5) * random.unit<D>();
      for (Index part = 0; part < walls.part_count(); ++part) {
        const Real d = walls.foot(r, part, t).d;
        CHECK(walls.distance(r, part, t) == Approx(d).margin(1e-12));
        CHECK(walls.beyond(r, reach, part, t) == (d >= reach && !walls.solid(part, t)));
        ++(d < reach ? within : beyond);
      }
    }
  }
  CHECK(within > 100);
  CHECK(beyond > 100);
}

TEMPLATE_TEST_CASE_SIG("how far walls have moved is no less than for any of their places", "[motion]", ((int D), D), 2,
                       3) {
  const int kind = GENERATE(0, 1, 2, 3);
  int close = 0;
  for (int k = 0; k < 20; ++k) {
    Random random(k);
    const Walls<D> walls = moving_walls<D>(random, kind);
    const Real from = random(1, 2), t = from + random(0.01, 0.2), far = 6;
    CHECK(walls.turn_without_end() == (kind >= 2));
    const Real bound = walls.moved(from, t, [&](const Vec<D>& p) { return far + p.norm(); });
    Real most = 0;
    for (int i = 0; i < 300; ++i) {
      // The distance to a resting point changes by no more.
      const Vec<D> r = far * std::pow(random(0, 1), 0.2) * random.unit<D>();
      for (Index part = 0; part < walls.part_count(); ++part)
        most = std::max(most, std::abs(walls.distance(r, part, t) - walls.distance(r, part, from)));
    }
    CHECK(most <= bound * (1 + 1e-9));
    close += most > 0.3 * bound;
  }
  CHECK(close > 5);
}

TEST_CASE("figures of revolution that turn about their axis stay where they are", "[motion]") {
  Walls<3> walls;
  Motion<3> motion{.velocity = {1, 0, 0}, .spin = {0, 0, 5}};
  walls.add(outline(), motion);
  const auto never = [](const Vec<3>&) -> Real { throw std::logic_error("no wall turns without end"); };
  CHECK_FALSE(walls.turn_without_end());
  CHECK(walls.moved(0, 0.5, never) == Approx(0.5));
  // About another axis they do not; a disk about its centre does.
  motion.pivot = {1, 0, 0};
  Walls<3> aside;
  aside.add(outline(), motion);
  CHECK(aside.turn_without_end());
  Walls<2> disk;
  disk.add(WallParts{{WallSegment::disk({2, 1}, 0.5)}}, {.spin = 3, .pivot = {2, 1}});
  CHECK(disk.moved(0, 1, [](const Vec<2>&) { return 1e9; }) == 0);
  CHECK((disk.velocity({2.5, 1}, 0, 7) - Vec<2>(0, 1.5)).norm() < 1e-14);
}

TEST_CASE("surfaces of outlines end at concave corners", "[surfaces]") {
  const auto surfaces = [](const Walls<2>& walls) {
    std::vector<Index> all;
    for (Index part = 0; part < walls.part_count(); ++part) all.push_back(walls.surface_of_part(part));
    return all;
  };
  // An obstacle with two concave corners, a single wall, a disk; a solid before them.
  WallParts parts;
  Obstacle{{{0, 0}, {2, 1}, {4, 0}, {4, 4}, {2, 3}, {0, 4}}}.add_to(parts);
  parts.segments.push_back(WallSegment::ray({9, 0}, {0, 1}));
  parts.segments.push_back(WallSegment::disk({7, 0}, 0.5));
  Walls<2> walls(std::vector{Solid<2>::half_space({0, -9}, {0, 1})});
  walls.add(parts);
  CHECK(walls.size() == 1 + 6 + 2);
  CHECK(walls.surfaces() == 5);
  // Segments, joints, the solid.
  CHECK(surfaces(walls) == std::vector<Index>{1, 2, 2, 2, 1, 1, 3, 4, 1, 2, 2, 2, 1, 1, 0});
  // A polygon is one surface, straight corners included, an outline that is seen from inside is one per side.
  WallParts square;
  Obstacle{{{0, 0}, {1, 0}, {2, 0}, {2, 2}, {0, 2}}}.add_to(square);
  CHECK(Walls<2>(square).surfaces() == 1);
  for (Joint& joint : square.joints) joint.convex = joint.place == Vec<2>(1, 0);
  CHECK(Walls<2>(square).surfaces() == 4);
  // A single concave corner is touched on both sides at a time.
  WallParts notch;
  Obstacle{{{0, 0}, {4, 0}, {4, 4}, {2, 1}, {0, 6}}}.add_to(notch);
  CHECK(surfaces(Walls<2>(notch)) == std::vector<Index>{0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
}

TEMPLATE_TEST_CASE_SIG("of each surface exactly one segment carries a contact", "[surfaces]", ((int D), D), 2, 3) {
  const int corners = GENERATE(3, 5, 100);
  Obstacle polygon;
  for (int k = 0; k < corners; ++k) {
    const Real angle = 2 * pi * (k + 0.3) / corners;
    polygon.corners.push_back(Vec<2>(6, 1) + 2 * Vec<2>(std::cos(angle), std::sin(angle)));
  }
  WallParts parts;
  polygon.add_to(parts);
  Walls<D> walls;
  Motion<D> motion{.velocity = 0.3 * Vec<D>::Unit(0)};
  if constexpr (D == 2)
    motion.spin = 0.7;
  else
    motion.spin = {0, 0, 0.7};
  walls.add(parts, motion);
  REQUIRE(walls.surfaces() == 1);
  Random random(corners);
  std::array<int, 2> at{};  // sides, corners
  for (int k = 0; k < 2000; ++k) {
    // From outside, at distances that particles have, now and then right at a corner or opposite to it.
    const Real t = random(0, 3);
    const Index side = random.below(corners);
    const Vec<2>&a = polygon.corners[side], &b = polygon.corners[(side + 1) % corners];
    const Vec<2> out = (a - Vec<2>(6, 1)).normalized();
    Vec<2> p =
        k % 3 == 0 ? Vec<2>(a + random(0, 0.5) * out) : Vec<2>(a + random(0, 1) * (b - a) + random(0, 0.5) * out);
    if (polygon.contains(p)) continue;
    Vec<D> r = Vec<D>::Zero();
    r[0] = p[0];
    r[D - 1] = p[1];
    r = walls.pose(0, t).place(r);
    Index carrier = -1;
    int carriers = 0;
    Real least = std::numeric_limits<Real>::infinity();
    for (Index part = 0; part < walls.part_count(); ++part) {
      const Real d = walls.distance(r, part, t);
      least = std::min(least, d);
      if (d < 0.6 && walls.carries(r, part, t)) ++carriers, carrier = part;
    }
    // The far sides of a triangle can be as near.
    if (corners > 3) CHECK(carriers == 1);
    REQUIRE(carriers >= 1);
    if (carriers > 1) continue;
    CHECK(walls.distance(r, carrier, t) == Approx(least).margin(1e-12));
    ++at[std::size_t(k % 3 == 0)];
  }
  CHECK(at[0] > 100);
  CHECK(at[1] > 300);
}

TEST_CASE("free ends carry contacts, concave corners none of their own", "[surfaces]") {
  // From (0, 0) to the concave corner (2, 0) and up.
  WallParts corner{{WallSegment::between({0, 0}, {2, 0}), WallSegment::ray({2, 0}, {0.6, 0.8})}};
  corner.joints.push_back({{2, 0}, 1, 0, false});
  const Walls<2> walls(corner);
  CHECK(walls.surfaces() == 2);
  const auto carriers = [&](const Vec<2>& r) {
    return std::array{walls.carries(r, 0, 0), walls.carries(r, 1, 0), walls.carries(r, 2, 0)};
  };
  CHECK(carriers({-0.3, 0.2}) == std::array{true, false, false});
  CHECK(carriers({1.9, 0.3}) == std::array{true, true, false});
  CHECK(carriers({2.1, 0.4}) == std::array{false, true, false});   // past the end of the level wall
  CHECK(carriers({2.2, -0.3}) == std::array{false, true, false});  // behind the corner: the wall that begins there
}

TEMPLATE_TEST_CASE_SIG("what touches is where the walls are nearest, and what is prepared has the same bits",
                       "[motion]", ((int D), D), 2, 3) {
  const int kind = GENERATE(0, 1, 2, 3);
  Random random(kind + 40);
  Walls<D> walls = moving_walls<D>(random, kind), before = walls;  // without prepared positions
  int touching = 0;
  for (int k = 0; k < 200; ++k) {
    const Real t = random(1, 3);
    const Vec<D> r = random(0, 4) * random.unit<D>();
    walls.prepare(t);
    if (k == 100) {  // the preparation for another motion is undefined
      Motion<D> next = random_motion<D>(random, kind);
      next.since = t - 0.2;
      walls.set_motion(0, next);
      before.set_motion(0, next);
    }
    for (Index part = 0; part < walls.part_count(); ++part) {
      const Index body = walls.body_of_part(part);
      CHECK(body == walls.body_of_wall(walls.wall_of_part(part)));
      CHECK(walls.distance(r, part, t) == before.distance(r, part, t));
      CHECK(walls.velocity(r, part, t) == before.velocity(r, part, t));
      WallTouch<D> touch{}, anew{};
      const bool touches = walls.touch(r, part, t, 0.8, touch);
      REQUIRE(touches == before.touch(r, part, t, 0.8, anew));
      if (!touches) continue;
      ++touching;
      CHECK((touch.d == anew.d && touch.n == anew.n && touch.foot == anew.foot && touch.across == anew.across));
      const WallFoot<D> foot = walls.foot(r, part, t);
      const Pose<D> pose = walls.pose(body, t);
      CHECK(touch.d == Approx(foot.d).margin(1e-13));
      CHECK((touch.n - foot.n).norm() < 1e-12);
      CHECK((pose.place(touch.foot) - (r - foot.d * foot.n)).norm() < 1e-12);
      CHECK((pose.direction(touch.across) - foot.n).norm() < 1e-12);
      if constexpr (D == 2) {
        const Vec<2> along(-foot.n[1], foot.n[0]);
        CHECK(touch.curvature == Approx(along.dot(foot.curvature * along)).margin(1e-12));
      } else {
        CHECK((touch.curvature - foot.curvature).norm() < 1e-12);
      }
    }
  }
  CHECK(touching > 50);
}

}  // namespace pliant::test::moving_walls_test
