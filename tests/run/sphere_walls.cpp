// Spheres moved along prescribed paths at flat, round and moving walls, and at each other.
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include <pliant/model/drag.h>
#include <pliant/model/gravity.h>
#include <pliant/model/sphere_contact.h>
#include <pliant/model/sphere_wall_contact.h>

#include "support/frictional.h"

namespace pliant::test::sphere_walls_test {

namespace {

using Vector = pliant::Vec<3>;
using Matrix = pliant::Mat<3>;

constexpr Real stiff = 100, radius = 0.5, wide = 1.2;
constexpr SurfaceFriction sticky{.mu_static = 1e6, .mu_dynamic = 1e6, .damping = 0.3};

Matrix rotation(Real angle, const Vector& axis) {
  return Eigen::AngleAxis<Real>(angle, axis.normalized()).toRotationMatrix();
}

/// Spheres with prescribed positions and velocities.
struct Led {
  std::unique_ptr<Simulation<3>> s;
  std::vector<Real> x, v;
  Real t = 0;

  template <class Term>
  Led(const std::vector<Vector>& places, Walls<3> walls, const Term& term) {
    Configuration<3> c;
    for (const Vector& place : places) c.add_soft(2 * radius, place);
    c.walls = std::move(walls);
    s = simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(1e-3), term);
    start(*s, c, std::vector<Real>(3 * places.size()), std::vector<Real>(3 * places.size()));
    x.assign(s->state().x().begin(), s->state().x().end());
    v.assign(x.size(), 0);
    accept();
  }
  Index balls() const { return static_cast<Index>(x.size() / 6); }
  auto place(Index m) { return point<3>(x.data(), m); }
  auto angle(Index m) { return point<3>(x.data(), balls() + m); }
  auto velocity(Index m) { return point<3>(v.data(), m); }
  auto spin(Index m) { return point<3>(v.data(), balls() + m); }
  StateView<3> view() { return s->particles().view(x.data(), v.data(), t); }
  void accept(Real h = 1e-3) { s->particles().accepted(t, x.data(), v.data(), h); }
  /// Force and torque on a sphere.
  std::pair<Vector, Vector> force(Index m = 0) {
    std::vector<Real> f(x.size());
    s->particles().field().forces(view(), f.data());
    return {point<3>(f.data(), m), point<3>(f.data(), balls() + m)};
  }
  Real power() { return s->particles().field().power(view()); }
  Real energy() { return s->particles().field().energy(view()); }
};

SphereWallContact at_wall(const SurfaceFriction& surface) { return {stiff, surface}; }

/// The floor z = 0, and a tube round z, in the frame of the wall; spheres that overlap them by 0.15.
Walls<3> floor(const Motion<3>& motion = {}) {
  Walls<3> walls;
  walls.add(Solid<3>::half_space(Vector::Zero(), {0, 0, 1}), motion);
  return walls;
}
Walls<3> tube(const Motion<3>& motion = {}) {
  Walls<3> walls;
  walls.add(WallParts{{WallSegment::between({wide, -5}, {wide, 5})}}, motion);
  return walls;
}
/// A floor, a tube, a cone and a narrow tube that are joined; a sphere on the axis, and two rings.
Walls<3> cup() {
  WallParts parts{{WallSegment::between({0, 0}, {wide, 0}), WallSegment::between({wide, 0}, {wide, 1.5}),
                   WallSegment::between({wide, 1.5}, {0.9, 2.2}), WallSegment::between({0.9, 2.2}, {0.9, 2.9}),
                   WallSegment::disk({0, 3}, 0.1), WallSegment::disk({0.3, 4}, 0.1),
                   WallSegment::disk({0.61, 5.5}, 0.1)}};
  parts.joints = {{{wide, 0}, 1, 0, false}, {{wide, 1.5}, 2, 1, false}, {{0.9, 2.2}, 3, 2, true}};
  return Walls<3>(parts);
}
const Vector on_floor(0.2, -0.1, 0.35), in_tube(0.85, 0, 0.3);
constexpr Real pressed = stiff / (radius * radius) * 0.15;  // N_e

}  // namespace

TEST_CASE("what a wall does to a ball that it carries turns with the wall, and takes no energy") {
  const Vector axis(0.3, -0.5, 0.6), pivot(0.4, -1, 0.3), drift(0.3, -0.2, 0.5);
  const Motion<3> motion{.velocity = drift, .spin = axis, .pivot = pivot};
  for (const bool round : {false, true}) {
    INFO((round ? "tube" : "floor"));
    const Vector start = round ? in_tube : on_floor;
    Led ball({start}, round ? tube(motion) : floor(motion), at_wall(sticky));
    const auto carry = [&](Real t, const Vector& from, const Vector& rolled) {
      ball.t = t;
      const Matrix turn = rotation(axis.norm() * t, axis);
      const Vector r = pivot + t * drift + turn * (from - pivot);
      ball.place(0) = r;
      ball.angle(0) = t * axis + turn * rolled;
      ball.velocity(0) = drift + axis.cross(r - pivot - t * drift);
      ball.spin(0) = axis;
    };
    const Vector sheared = start + Vector(0, 0.01, round ? 0.02 : 0), rolled(0.01, 0.02, -0.01);
    carry(0, sheared, Vector::Zero());
    ball.accept();
    carry(0, sheared, rolled);
    const auto [force, torque] = ball.force();
    CHECK(force.norm() > 0.5);
    CHECK(torque.norm() > 0.2);
    for (int k = 1; k <= 100; ++k) {
      carry(0.02 * k, sheared, Vector::Zero());
      ball.accept(0.02);
    }
    CHECK(std::abs(ball.power()) < 1e-9);
    carry(2, sheared, rolled);
    const Matrix turn = rotation(2 * axis.norm(), axis);
    CHECK((ball.force().first - turn * force).norm() < 1e-9);
    CHECK((ball.force().second - turn * torque).norm() < 1e-9);
  }
}

TEST_CASE("balls at walls four at a time have the forces of each by itself bit for bit") {
  const SurfaceFriction weak{.mu_static = 0.01, .mu_dynamic = 0.008, .damping = 0.1};
  Index slide = 0, hold = 0;
  for (std::size_t n = 1; n <= 24; ++n)
    for (const std::string_view kind : {"moving", "turning", "at rest", "at rest with a solid"}) {
      CAPTURE(n, kind);
      std::vector<Vector> places;
      for (std::size_t m = 0; m < n; ++m)
        places.push_back(rotation(Real(m), {0, 0, 1}) * Vector(0.8, 0, 0.4 + 0.05 * Real(m)));
      Walls<3> walls;
      if (kind == "moving" || kind == "turning") {
        walls = tube(kind == "turning" ? Motion<3>{.velocity = {0, 0.1, 0.3}, .spin = {0.1, 0, 0.5}} : Motion<3>{});
        walls.add(Solid<3>::half_space(Vector::Zero(), {0, 0, 1}), {.velocity = {0.2, 0.1, 0}});
      } else {
        walls = cup();
        const std::vector<Vector> others{{0.01, 0.02, 0.4},     // on the floor, near the axis
                                         {0.36, -0.48, 2.155},  // at the convex corner
                                         {-0.1, 0.04, 2.6},     // at the sphere on the axis
                                         {0.5, 0.03, 0.42},     // on the floor
                                         {0.01, 0.02, 4.1},     // in a ring
                                         {0.001, 0.001, 5.5}};  // in a ring that it touches on the axis only
        // Pairs of spheres in the tube shift the following corners among the groups of four.
        for (std::size_t m = 5; m < n; ++m)
          places[m] = m < 11 ? others[m - 5]
                             : Vector(rotation(Real(m), {0, 0, 1}) * (m % 3 == 0 ? others[1] : Vector(0.8, 0, 0.8)));
        if (kind == "at rest with a solid") walls.add(Solid<3>::half_space({0, 0, 0.1}, {0, 0, 1}));
      }
      const SphereWallContact term = at_wall(weak);
      Led led(places, walls, term);
      for (std::size_t k = 0; k < led.v.size(); ++k) led.v[k] = std::sin(Real(k + n)) * (k % 2 == 0 ? 1 : 0.02);
      for (int step = 0; step < 5; ++step) {
        led.t += 1e-3;
        for (std::size_t k = 0; k < led.x.size(); ++k) led.x[k] += 1e-3 * led.v[k];
        if (step < 4) led.accept();
      }
      const StateView<3> view = led.view();
      const ContactTable& table = view.history->of(term.name());
      ContactWorkspace workspace(table.needs());
      workspace.follow(table);
      const Range all = view.neighbours.walls.inside(0);
      std::vector<Real> found(led.x.size()), single(led.x.size());
      const auto into = [&](std::vector<Real>& f) { return Scatter<3, 1>{f.data(), {}, f.data() + 3 * n}; };
      term.add_forces(view, all, table, workspace, into(found));
      const auto one = into(single);
      SphereWallContact::Touch c;
      const ContactWorkspace::Next<SphereWallContact::history, true> next(table, workspace);
      for (Index e = all.first; e < all.last; ++e) {
        if (!term.find(view, e, table.current(e), c)) continue;
        REQUIRE(!table.current(e).empty());
        term.add_force(view, c, one);
        (next.set(e)[12] != 0 ? slide : hold) += 1;
      }
      CHECK(found == single);
    }
  CHECK(slide > 5);
  CHECK(hold > 5);
}

TEST_CASE("what friction at a wall takes from a ball is in its spring or heat") {
  for (const bool round : {false, true}) {
    INFO((round ? "tube" : "floor"));
    Led ball({round ? in_tube : on_floor}, round ? tube() : floor(), at_wall(sticky));
    ball.place(0) += Vector(0, 0.02, round ? 0.03 : 0);
    ball.angle(0) = Vector(0.02, 0.01, 0.03);
    ball.accept();
    const std::vector<Real> there = ball.x;
    for (const Vector& v : {Vector(0.4, 0.7, -0.3), Vector(-0.2, 0.1, 0.6)}) {
      ball.velocity(0) = v;
      ball.spin(0) = Vector(0.5, -1.1, 0.8);
      const auto energy = [&](Real h) {
        for (std::size_t k = 0; k < there.size(); ++k) ball.x[k] = there[k] + h * ball.v[k];
        return ball.energy();
      };
      const Real grows = (energy(1e-6) - energy(-1e-6)) / 2e-6;
      ball.x = there;
      const auto [force, torque] = ball.force();
      const Real taken = -force.dot(v) - torque.dot(ball.spin(0));
      CHECK(std::abs(grows) > 0.01);
      CHECK(ball.power() > 0.1);
      CHECK(taken == Approx(grows + ball.power()).epsilon(1e-6));
    }
  }
}

TEST_CASE("a ball that comes straight at a wall, or at another, feels the dashpot of its mass along the way") {
  for (const bool round : {false, true}) {
    Led ball({round ? in_tube : on_floor}, round ? tube() : floor(), at_wall(sticky));
    const Vector n = round ? Vector(-1, 0, 0) : Vector(0, 0, 1);
    ball.velocity(0) = -0.1 * n;
    const auto [force, torque] = ball.force();
    const Real mass = ball.s->topology().mass(0);
    CHECK((force - 0.1 * 2 * 0.3 * std::sqrt(mass * stiff) / radius * n).norm() < 1e-12);
    CHECK(torque.norm() < 1e-12);
  }
}

TEST_CASE("the spring of a ball that rolls round a tube goes round with it") {
  Led ball({in_tube}, tube(), at_wall(sticky));
  ball.place(0) += Vector(0, 0, 0.01);
  ball.angle(0) = Vector(0, 0, 0.02);
  ball.accept();
  const auto [force, torque] = ball.force();
  CHECK(std::abs(force[1]) > 0.1);  // along the tube's round
  CHECK(std::abs(force[2]) > 0.1);  // and along its axis
  const Real depth = in_tube[0];
  const Vector start(depth, 0, ball.place(0)[2]);
  for (int k = 1; k <= 400; ++k) {
    const Real phi = 2.0 * k / 400;
    ball.place(0) = rotation(phi, Vector(0, 0, 1)) * start;
    ball.angle(0) = Vector(0, 0, 0.02 - (wide - radius) / radius * phi);  // as if it were hard
    ball.accept();
  }
  const Matrix turn = rotation(2, Vector(0, 0, 1));
  CHECK((ball.force().first - turn * force).norm() < 1e-3 * force.norm());
  CHECK((ball.force().second - turn * torque).norm() < 1e-3 * torque.norm());
}

TEST_CASE("a ball breaks away from a wall at the static limit and slides on at the dynamic one") {
  constexpr SurfaceFriction rough{.mu_static = 0.5, .mu_dynamic = 0.3};
  enum class Way { floor, round, axis };
  for (const Way way : {Way::floor, Way::round, Way::axis}) {
    INFO("way " << static_cast<int>(way));
    Led ball({way == Way::floor ? on_floor : in_tube}, way == Way::floor ? floor() : tube(), at_wall(rough));
    const Vector from = ball.place(0);
    Real most = 0;
    for (int k = 1; k <= 4000; ++k) {
      const Real gone = 2e-4 * k;
      ball.place(0) = way == Way::round ? Vector(rotation(gone / from[0], Vector(0, 0, 1)) * from)
                                        : Vector(from + gone * (way == Way::floor ? Vector(1, 0, 0) : Vector(0, 0, 1)));
      const Real ratio = ball.force().first.norm() / pressed;
      ball.accept();
      if (k <= 3000)
        most = std::max(most, ratio);
      else if (ratio > 0.3001 || ratio < 0.2999)
        FAIL("it slides with " << ratio << " of the force across");
    }
    CHECK(most == Approx(0.5).epsilon(2e-3));
    const auto heat = ball.s->particles().history().of("sphere_wall_contact").heat();
    CHECK(heat[2] > 0.5 * 0.3 * pressed * 0.3);
  }
}

TEST_CASE("a ball breaks away from another at the static limit and slides on at the dynamic one") {
  constexpr SurfaceFriction rough{.mu_static = 0.5, .mu_dynamic = 0.3};
  Led balls({Vector::Zero(), Vector(0, 0.9, 0)}, {}, SphereContact{stiff, rough});
  const Real limit = stiff * 0.1 * 0.9 * radius;  // N d/(R_i + R_j) R_i of a torque
  Real most = 0;
  for (int k = 1; k <= 4000; ++k) {
    balls.angle(1) = Vector(3e-4 * k, 0, 0);
    const Real ratio = balls.force(1).second.norm() / limit;
    balls.accept();
    if (k <= 3000)
      most = std::max(most, ratio);
    else if (ratio > 0.3001 || ratio < 0.2999)
      FAIL("the torque is " << ratio << " of the limit");
  }
  CHECK(most == Approx(0.5).epsilon(2e-3));
}

namespace {

/// A large sphere that falls 0.02 onto a ring, a cone or a lip, off their axis, with gravity.
struct Plug {
  std::unique_ptr<Simulation<3>> s;

  template <class... More>
  Plug(const WallParts& parts, Real height, More... more) {
    Configuration<3> c;
    c.add_soft(4, {0.03, -0.02, height});
    c.walls = Walls<3>(parts);
    s = simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(1e-3), WallContact<3>{1e4},
                         Gravity<3>{{0, 0, -1}}, more...);
    s->place(c.x);
  }
  Real kinetic() const {
    Real sum = 0;
    for (const Real v : s->state().v().first(3)) sum += square(v) / 2;
    return sum * s->topology().mass(0);
  }
  Real energy() { return kinetic() + s->particles().field().energy(s->view()); }
};

const WallParts ring{{WallSegment::disk({1.5, 0}, 0.1)}}, cone{{WallSegment::between({1.2, -0.3}, {4, 2.5})}},
    lip{{WallSegment::between({1.5, 0}, {6, 0})}};

}  // namespace

TEST_CASE("a ball that plugs an orifice conserves energy, and comes to rest with drag") {
  struct Case {
    const char* name;
    WallParts parts;
    Real height;
  };
  for (const Case& of : {Case{"ring", ring, 1.5}, Case{"cone", cone, 1.35}, Case{"lip", lip, 1.35}}) {
    INFO(of.name);
    Plug free(of.parts, of.height);
    const Real before = free.energy();
    for (int k = 0; k < 20000; ++k) free.s->step();
    CHECK(free.energy() == Approx(before).epsilon(0).margin(1e-4 * free.s->topology().mass(0)));
    Plug damped(of.parts, of.height, Drag<3>{60});
    for (int k = 0; k < 30000; ++k) damped.s->step();
    CHECK(damped.kinetic() < 1e-12);
    const auto at = damped.s->view().position(0);
    CHECK(std::hypot(at[0], at[1]) < 1e-5);
  }
}

TEST_CASE("a ball with friction that plugs an orifice slows down below the speed that counts as rest") {
  Plug rough(cone, 1.35, SphereWallContact{1e4, {.mu_static = 0.3, .mu_dynamic = 0.3, .damping = 0.3}});
  for (int k = 0; k < 60000; ++k) rough.s->step();
  CHECK(rough.kinetic() < square(1e-3) / 2 * rough.s->topology().mass(0));  // only by friction and damping
}

}  // namespace pliant::test::sphere_walls_test
