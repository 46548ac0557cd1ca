// The channel: sizes of disks, shapes, schedule of the plungers.
#include <catch2/catch.hpp>

#include <cmath>
#include <map>
#include <numeric>

#include <pliant/base/errors.h>
#include <pliant/scenarios/channel/channel_shape.h>
#include <pliant/scenarios/channel/distributions.h>
#include <pliant/scenarios/channel/push_schedule.h>
#include <pliant/scenarios/channel/start.h>

namespace pliant::test::channel_test {
using Catch::Matchers::Contains;

namespace {

constexpr Real filled = 2 * 37.7 * 20.5 - 20.5 * 20.5 - 10.7 * 20.5;  // the channel without a stroke, 906.1 cm²

Real fraction(const std::string& name, Real wanted) {
  const auto sizes = size_distribution(name);
  return covered_area(sizes, disks_for_area(sizes, wanted * filled)) / filled;
}

}  // namespace

TEST_CASE("Size distributions have the polydispersity of the table", "[channel][distributions]") {
  // [T table 3.1] prints two digits; the numbers of C1 to C3, which it does not have, are ours.
  const std::map<std::string, std::pair<Real, Real>> printed{
      {"bidisperse", {0.20, 0.005}}, {"T1", {0.23, 0.005}}, {"T2a", {0.27, 0.005}}, {"T2b", {0.29, 0.005}},
      {"T2c", {0.32, 0.01}},         {"T2d", {0.35, 0.01}}, {"T3", {0.35, 0.01}},   {"T4", {0.42, 0.005}},
      {"C1", {0.31, 0.015}},         {"C2", {0.40, 0.015}}, {"C3", {0.48, 0.015}}};
  REQUIRE(size_distribution_names().size() == printed.size());
  for (const std::string& name : size_distribution_names()) {
    INFO(name);
    const auto sizes = size_distribution(name);
    const auto [delta, tolerance] = printed.at(name);
    CHECK(polydispersity(sizes) == Approx(delta).margin(tolerance));
    CHECK(sizes.back().radius == Approx(0.635));
    CHECK(sizes.back().count == sizes[sizes.size() - 2].count);  // as many of the next size
  }
  CHECK(size_distribution("T4").front().radius == Approx(3.175));
  CHECK_THROWS_WITH(size_distribution("T5"), Contains("T2a"));
}

TEST_CASE("The number of disks follows from the area fraction", "[channel][distributions]") {
  for (const std::string& name : size_distribution_names())
    for (const Real wanted : {0.72, 0.74, 0.77, 0.79, 0.81}) {
      INFO(name << " " << wanted);
      // To half a set of the two smallest sizes, 4.1 cm².
      CHECK(fraction(name, wanted) == Approx(wanted).margin(4.2 / 2 / filled));
    }
  // Five large disks with 1:28:28 cover 0.81.
  CHECK(disks_for_area(size_distribution("T4"), 0.811 * filled) == std::vector<Index>{5, 140, 140});
  CHECK(disks_for_area(size_distribution("T4"), 0.77 * filled) == std::vector<Index>{5, 131, 131});
  CHECK(disks_for_area(size_distribution("bidisperse"), 0.77 * filled) == std::vector<Index>{169, 169});
  CHECK_THROWS_WITH(disks_for_area({{10, 1}}, 100), Contains("-area_fraction"));
  CHECK_THROWS_WITH(disks_for_area({{1e-3, 1}}, 100), Contains("disks are asked for"));
}

TEST_CASE("Sizes of one's own", "[channel][distributions]") {
  const auto sizes = parse_sizes("0.5, 1", "3,1");
  REQUIRE(sizes.size() == 2);
  CHECK(sizes[0].radius == 0.5);
  CHECK(sizes[1].count == 1);
  CHECK(polydispersity({{1, 1}, {3, 1}}) == Approx(0.5));
  CHECK_THROWS_WITH(parse_sizes("0.5,1", "3"), Contains("-counts 1"));
  CHECK_THROWS_WITH(parse_sizes("0.5,-1", "3,1"), Contains("-radii"));
  CHECK_THROWS_WITH(parse_sizes("0.5,x", "3,1"), Contains("list of numbers"));
  CHECK_THROWS_WITH(parse_sizes("", "3,1"), Contains("needs -radii"));
  CHECK_THROWS_WITH(parse_sizes("1", ""), Contains("needs -counts"));
}

TEST_CASE("Channels have their area, and their plungers face into them", "[channel][shape]") {
  const Real w = 20.5, a = 37.7;
  const auto check = [&](ChannelKind kind, Real area, std::size_t plungers) {
    const Channel c(kind, {w, a});
    CHECK(c.area() == Approx(area));
    REQUIRE(c.plungers().size() == plungers);
    CHECK(c.inside({w / 2, w / 2}));
    for (const Plunger& p : c.plungers()) {
      const Vec<2> middle = (p.ends[0] + p.ends[1]) / 2;
      CHECK(p.width() == Approx(w));
      CHECK(c.inside(middle + 0.1 * p.direction));
      CHECK_FALSE(c.inside(middle - 0.1 * p.direction));
      CHECK((middle - Vec<2>(w / 2, w / 2)).norm() == Approx(a - w / 2));
    }
    CHECK_NOTHROW(c.check_stroke(10.7));
    CHECK_THROWS_WITH(c.check_stroke(kind == ChannelKind::straight ? 60 : 17.3), Contains("runs into the corner"));
    return c;
  };
  const Real square = w * w, arm = w * (a - w);
  const Channel l = check(ChannelKind::l, square + 2 * arm, 2);
  check(ChannelKind::t, square + 3 * arm, 3);
  check(ChannelKind::x, square + 4 * arm, 4);
  check(ChannelKind::straight, square + 2 * arm, 2);
  // Push 0 belongs to the plunger at the end of +x.
  CHECK(l.plungers()[0].direction.isApprox(Vec<2>(-1, 0)));
  CHECK(l.plungers()[1].direction.isApprox(Vec<2>(0, -1)));
  CHECK(l.corners().size() == 6);
  CHECK_FALSE(l.inside({21, 21}));
  CHECK_FALSE(l.inside({-0.1, 5}));
  CHECK_THROWS_WITH(Channel(ChannelKind::l, {20, 20}), Contains("-channel_arm"));
}

TEST_CASE("Plungers are named by places on sides", "[channel][shape]") {
  Channel t(ChannelKind::t, {20, 40});
  t.set_plungers({{-20, 10}, {10, 40}});
  REQUIRE(t.plungers().size() == 2);
  CHECK(t.plungers()[0].direction.isApprox(Vec<2>(1, 0)));
  CHECK(t.plungers()[1].direction.isApprox(Vec<2>(0, -1)));
  CHECK_THROWS_WITH(t.set_plungers({{10, 30}}), Contains("nearest one"));
  CHECK_THROWS_WITH(t.set_plungers({{10, 40}, {11, 40}}), Contains("each once"));
  // A trapezium, given clockwise.
  Channel own({{0, 0}, {0, 10}, {20, 8}, {20, 2}});
  own.set_plungers({{20, 5}});
  CHECK(own.area() == Approx(160));
  CHECK(own.plungers()[0].direction.isApprox(Vec<2>(-1, 0)));
  CHECK_THROWS_WITH(Channel(std::vector<Vec<2>>{{0, 0}, {1, 0}}), Contains("three corners"));
  CHECK_THROWS_WITH(Channel(std::vector<Vec<2>>{{0, 0}, {1, 1}, {1, 0}, {0, 1}}), Contains("cross"));
}

TEST_CASE("Pushes take whole numbers of steps, and frames lie on both ends of a stroke", "[channel][schedule]") {
  const PushSchedule s({.stroke = 10.7, .speed = 1.1, .frame_travel = 0.11}, 1e-3);
  CHECK(s.frames() == 97);
  CHECK(std::abs(10 * s.frame_travel() / 1.1 - 1) < 0.05);
  CHECK(s.dt() <= 1e-3);
  CHECK(s.dt() > 0.9e-3);
  CHECK(s.steps_of_push() * s.dt() == Approx(10.7 / 1.1).epsilon(1e-14));
  std::int64_t frames = 0;
  Real last = -1;
  for (std::int64_t step = 0; step <= s.end_of_push(0); ++step)
    if (s.frame_at(step)) {
      CHECK(s.travel_at(step) > last);
      last = s.travel_at(step);
      CHECK(last == Approx(frames * s.frame_travel()).margin(1e-12));
      ++frames;
    }
  CHECK(frames == 98);
  CHECK(last == 10.7);
  // A plunger that is twice as fast has its frames at the same travel, with the same number of steps between them at
  // half the step.
  const PushSchedule fast({.stroke = 10.7, .speed = 2.2, .frame_travel = 0.11}, 0.5e-3);
  CHECK(fast.frames() == s.frames());
  CHECK(fast.steps_of_push() == s.steps_of_push());
  CHECK_THROWS_WITH(PushSchedule({.speed = 1e-12}, 1e-6), Contains("too many steps"));
}

TEST_CASE("A plunger pushes, rests for a step, goes back and waits", "[channel][schedule]") {
  const PushSchedule s({.stroke = 2, .speed = 1, .retract_speed = 4, .pause = 0.3, .frame_travel = 0.5}, 0.1);
  REQUIRE(s.steps_of_push() == 20);
  CHECK(s.period() == 20 + 1 + 5 + 3);
  Real place = 0;  // by adding up velocities
  for (std::int64_t step = 0; step < 3 * s.period(); ++step) {
    INFO(step);
    CHECK(s.travel_at(step) == Approx(place).margin(1e-12));
    CHECK(s.push_at(step) == step / 29);
    const std::int64_t at = step % 29;
    CHECK(s.phase_at(step) == (at < 20   ? PushPhase::push
                               : at < 21 ? PushPhase::hold
                               : at < 26 ? PushPhase::retract
                                         : PushPhase::rest));
    CHECK(s.phase_at(s.phase_begin(step)) == s.phase_at(step));
    CHECK(s.in_stroke(step) == (at <= 20));
    CHECK(s.frame_at(step) == (at % 5 == 0 && at <= 20));
    place += s.velocity_at(step) * s.dt();
  }
  // At once: without a separate step.
  const PushSchedule sudden({.stroke = 2, .speed = 1, .retract_speed = 0, .frame_travel = 0.5}, 0.1);
  CHECK(sudden.period() == 21);
  CHECK(sudden.phase_at(20) == PushPhase::hold);
  CHECK(sudden.phase_at(21) == PushPhase::push);
  CHECK(sudden.push_at(21) == 1);
  CHECK(sudden.travel_at(21) == 0);
}

namespace {

Topology disks_of(const std::string& name, Real area) {
  const auto sizes = size_distribution(name);
  const auto numbers = disks_for_area(sizes, area);
  Topology disks;
  for (std::size_t k = 0; k < sizes.size(); ++k)
    for (Index n = 0; n < numbers[k]; ++n) disks.add_soft(2 * sizes[k].radius, 1);
  return disks;
}

}  // namespace

TEST_CASE("Disks at random points are pushed apart, and stay in the channel", "[channel][start]") {
  constexpr Real tolerance = 1e-4;
  Channel own({{0, 0}, {20, 0}, {20, 12}, {13, 12}, {8, 8}, {0, 8}});
  own.set_plungers({{20, 6}});
  for (const Channel& channel : {Channel(ChannelKind::l, {20.5, 37.7}), Channel(ChannelKind::x, {12, 22}),
                                 Channel(ChannelKind::straight, {9, 30}), own})
    for (const char* name : {"bidisperse", "T2d"}) {
      const Topology disks = disks_of(name, 0.66 * channel.area());
      const ChannelStart start = random_start(disks, channel, channel.walls(), tolerance, 3);
      INFO(name << ", " << disks.particles() << " disks, " << start.iterations << " iterations");
      CHECK(start.max_overlap <= tolerance);
      CHECK(start.max_overlap > 0);
      const auto r = [&](Index m) { return Vec<2>(start.x[2 * m], start.x[2 * m + 1]); };
      const auto& corners = channel.corners();
      Index wrong = 0, outside = 0;
      for (Index m = 0; m < disks.particles(); ++m) {
        outside += !channel.inside(r(m));
        for (Index n = 0; n < m; ++n)
          wrong += (r(m) - r(n)).norm() < (disks.sigma[m] + disks.sigma[n]) / 2 * (1 - 1.001 * tolerance);
        for (std::size_t k = 0; k < corners.size(); ++k)
          wrong += std::sqrt(segment_foot(r(m), corners[k], corners[(k + 1) % corners.size()]).d2) <
                   disks.sigma[m] / 2 * (1 - 1.001 * tolerance);
      }
      CHECK(outside == 0);
      CHECK(wrong == 0);
      CHECK(random_start(disks, channel, channel.walls(), tolerance, 3).x == start.x);
      CHECK(random_start(disks, channel, channel.walls(), tolerance, 4).x != start.x);
    }
}

TEST_CASE("Disks that do not fit are an error", "[channel][start]") {
  const Channel channel(ChannelKind::l, {6, 11});
  CHECK_THROWS_WITH(random_start(disks_of("bidisperse", 0.95 * channel.area()), channel, channel.walls(), 1e-4, 1),
                    Contains("-area_fraction") && Contains("allowed"));
}

TEST_CASE("A plunger is a wall that moves", "[channel][shape]") {
  const Channel channel(ChannelKind::l, {6, 11});
  const Walls<2> walls = channel.walls({.plunger = 1, .travel = 1, .speed = 2, .since = 3});
  // Four sides, a joint at three corners, two plungers.
  REQUIRE(walls.size() == 6);
  const Index plunger = walls.size() - 1, part = walls.part_count() - 1;
  CHECK(walls.wall_of_part(part) == plunger);
  CHECK(walls.distance({3, 8}, part, 3) == Approx(2));    // at y = 10
  CHECK(walls.distance({3, 8}, part, 3.5) == Approx(1));  // at y = 9
  CHECK(walls.velocity({3, 8}, part, 3.5).isApprox(Vec<2>(0, -2)));
  CHECK(walls.distance({9, 3}, part - 1, 3.5) == Approx(2));  // the other rests
  const std::vector<Real> drawn = channel.drawn_walls(1, 2);
  REQUIRE(drawn.size() == 24);
  CHECK(std::vector<Real>(drawn.end() - 4, drawn.end()) == std::vector<Real>{6, 9, 0, 9});
  // A disk that moves around the inner corner has one contact with one surface, in an outer corner two contacts.
  const auto surfaces = [&](const Vec<2>& r) {
    std::vector<Index> near, all;
    walls.find_near(r, 1, 0, near);
    for (const Index k : near)
      if (walls.carries(r, k, 0)) all.push_back(walls.surface_of_part(k));
    return all;
  };
  CHECK(surfaces({6.5, 5.5}).size() == 1);
  CHECK(surfaces({5.5, 5.5}) == surfaces({6.5, 5.5}));
  CHECK(surfaces({5.5, 5.5}) == surfaces({5.5, 6.5}));
  CHECK(surfaces({0.5, 0.5}).size() == 2);
  // Side walls that slide.
  const Channel straight(ChannelKind::straight, {6, 11});
  const Walls<2> belts = straight.walls({.speed = 1, .shear = 0.5});
  REQUIRE(belts.size() == 4);
  CHECK(belts.velocity({3, 5}, 0, 1).isApprox(Vec<2>(-0.5, 0)));
  CHECK(belts.velocity({3, 1}, 1, 1).isApprox(Vec<2>(0.5, 0)));
  CHECK(belts.distance({3, 5}, 0, 1) == Approx(1));
  CHECK(belts.distance({3, 1}, 1, 1) == Approx(1));
  // Contacts stick to the material of a wall, which keeps its place when the velocity of the wall changes.
  const Walls<2> stopped = straight.walls({.sheared = 1, .since = 2});
  for (const Index body : {0, 1}) {
    CHECK(stopped.pose(body, 3).shift == belts.pose(body, 2).shift);
    CHECK(stopped.velocity({3, 3}, body, 3) == Vec<2>::Zero());
  }
}

}  // namespace pliant::test::channel_test
