// The history of wall contacts continues when a particle moves from one segment to the next.
#include <catch2/catch.hpp>

#include <pliant/geometry/obstacle.h>
#include <pliant/system/particle_system.h>

#include "support/configurations.h"

namespace pliant::test::wall_history_test {

namespace {

/// Counts the accepted steps of each contact.
struct Counter {
  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 1;
  static std::string_view name() { return "counter"; }
  bool enabled(const StateView<2>&) const { return true; }
  struct Touch {
    Index i;
    Real steps;
  };
  bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const auto [i, part] = s.neighbours.walls[e];
    c = {i, past.empty() ? 0 : past[0]};
    return s.walls.distance(s.position(i), part, s.t) < s.topology.diameter[i] / 2 &&
           s.walls.carries(s.position(i), part, s.t);
  }
  Real energy(const StateView<2>&, const Touch& c) const { return c.steps; }
  Real power(const StateView<2>&, const Touch&) const { return 1; }
  template <class F>
  void add_force(const StateView<2>&, const Touch& c, F& f) const {
    f.add(c.i, pliant::Vec<2>(1, 0));
  }
  void keep(const StateView<2>&, const Touch& c, std::span<const Real>, Real* numbers, Real*) const {
    numbers[0] = c.steps + 1;
  }
  Real max_rate(const Topology&) const { return 0; }
  Real max_damping(const Topology&) const { return 0; }
};

/// A disk of diameter 1 that is moved along by hand.
struct Disk {
  ParticleSystem<2> system;
  std::vector<Real> x{0, 0, 0}, v{0, 0, 0};

  explicit Disk(const Walls<2>& walls, Real skin) : system(topology(), walls, alone<2>(Counter{}), skin) {}
  static Topology topology() {
    Topology t;
    t.add_soft(1, 1);
    return t;
  }
  void accept(const pliant::Vec<2>& r, Real t = 0) {
    x = {r[0], r[1], 0};
    system.accepted(t, x.data(), v.data(), 1);
  }
  StoredContacts contacts() const { return system.history().tables()[0].contacts(); }
  /// Contacts of a force evaluation.
  Real acting(Real t = 0) {
    std::vector<Real> a(3);
    system.acceleration(t, x.data(), v.data(), a.data());
    const StateView<2> s = system.view(x.data(), v.data(), t);
    CHECK(system.field().power(s) == a[0]);
    return a[0];
  }
};

}  // namespace

TEST_CASE("a contact goes on round the corners of an obstacle") {
  const int corners = GENERATE(4, 7, 60);
  const Real skin = GENERATE(0.05, 0.5);  // the lists are rebuilt on the way, often and seldom
  CAPTURE(corners, skin);
  Obstacle polygon;
  for (int k = 0; k < corners; ++k) polygon.corners.push_back(2 * at_angle(2 * pi * (k + 0.2) / corners));
  WallParts parts;
  polygon.add_to(parts);
  const bool turning = GENERATE(false, true);
  Walls<2> walls;
  walls.add(parts, {.spin = turning ? 0.3 : 0});
  Disk disk(walls, skin);
  int steps = 0;
  for (Real angle = 0; angle < 2 * pi; angle += 0.01) {
    // As far from the nearest place as 0.4 in this direction.
    const Real t = turning ? 10 * angle : 0;
    Real inside = 0, outside = 5;
    for (int k = 0; k < 30; ++k) {
      const Real middle = (inside + outside) / 2;
      Real least = 1e9;
      for (Index s = 0; s < corners; ++s) least = std::min(least, walls.distance(middle * at_angle(angle), s, t));
      const bool within = polygon.contains(walls.pose(0, t).back(middle * at_angle(angle)));
      (least < 0.4 || within ? inside : outside) = middle;
    }
    disk.accept(outside * at_angle(angle), t);
    ++steps;
    const StoredContacts contacts = disk.contacts();
    REQUIRE(contacts.keys == std::vector<ContactKey>{{0, 0}});
    REQUIRE(contacts.values == std::vector<Real>{Real(steps)});
    REQUIRE(disk.acting(t) == 1);
  }
  if (skin == 0.5) CHECK(disk.system.neighbours().rebuilds() < 150);
  // Away and back: a new contact.
  disk.accept({5, 5}, turning ? 70 : 0);
  CHECK(disk.contacts().keys.empty());
}

TEST_CASE("in a concave corner there are two contacts, which end by themselves") {
  // A flat valley from (-3, 0.3) over (0, 0) to (3, 0.3).
  WallParts valley{{WallSegment::between({-3, 0.3}, {0, 0}), WallSegment::between({0, 0}, {3, 0.3})}};
  valley.joints.push_back({{0, 0}, 1, 0, false});
  Disk disk(Walls<2>(valley), 0.5);
  using Keys = std::vector<ContactKey>;
  disk.accept({-0.5, 0.5});
  CHECK(disk.contacts().keys == Keys{{0, 0}});
  disk.accept({-0.001, 0.45});
  CHECK(disk.contacts().keys == Keys{{0, 0}, {0, 1}});
  CHECK(disk.acting() == 2);
  // Past the normal of the first segment at the corner: in touch with its end, but the second segment carries that.
  disk.accept({0.1, 0.45});
  CHECK(disk.contacts().keys == Keys{{0, 1}});
  CHECK(disk.contacts().values == std::vector<Real>{2});
  CHECK(disk.acting() == 1);
  disk.accept({-0.001, 0.45});
  CHECK(disk.contacts().values == std::vector<Real>{1, 3});
}

}  // namespace pliant::test::wall_history_test
