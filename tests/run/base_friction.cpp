// Disks on a substrate that stick, slide and spin, against exact answers.
#include <catch2/catch.hpp>

#include <pliant/model/limit_surface.h>

#include "support/on_table.h"

namespace pliant::test::base_friction_test {

namespace {

constexpr Real radius = 0.6;

/// One disk that lies on the table since the start. The displacement at the limit of μ = 0.3 is `give`.
struct OnTable {
  BaseFriction base;
  std::unique_ptr<Simulation<2>> s;
  Real mass;

  OnTable(BaseFriction friction, Real dt, pliant::Vec<2> v = {0, 0}, Real spin = 0, pliant::Vec<2> slope = {0, 0},
          Real give = 1e-5)
      : base(friction) {
    Configuration<2> c;
    c.add_soft(2 * radius, {7, -3});
    mass = c.topology.point_mass[0];
    base.epsilon = 0.3 * mass * base.gravity / give * square(2 * radius);
    s = simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(dt), base, Slope{slope});
    c.v = {v[0], v[1]};
    start(*s, c, {0.4}, {spin});
    touch(*s);
  }
  pliant::Vec<2> position() const { return {s->state().x()[0] - 7, s->state().x()[1] + 3}; }
  pliant::Vec<2> velocity() const { return {s->state().v()[0], s->state().v()[1]}; }
  Real angle() const { return s->angles()[0] - 0.4; }
  Real spin() const { return s->spins()[0]; }
};

BaseFriction friction(Real mu_static, Real mu_dynamic, Real g = 10) {
  BaseFriction base;
  base.gravity = g;
  base.mu_static = mu_static, base.mu_dynamic = mu_dynamic;
  return base;
}

}  // namespace

TEST_CASE("a disk on a slope slides beyond the angle of friction, and not before") {
  for (const Real mu_dynamic : {0.5, 0.3}) {
    for (const Real beyond : {-1e-6, 1e-6}) {
      INFO("dynamic " << mu_dynamic << ", beyond " << beyond);
      const Real phi = std::atan(0.5) + beyond, give = 1e-5, down = 10 * std::sin(phi);
      OnTable disk(friction(0.5, mu_dynamic, 10 * std::cos(phi)), 2e-4, {0, 0}, 0, {down, 0}, give);
      // Where the spring holds it.
      const Real k = disk.base.epsilon / square(2 * radius), hangs = disk.mass * down / k;
      disk.s->state().x()[0] += hangs;
      disk.s->advance(1);
      if (beyond < 0) {
        CHECK(disk.position()[0] == Approx(hangs).epsilon(1e-10));
        CHECK(disk.velocity().norm() < 1e-11);
      } else {
        // With μ_d from the start; then 10 (sin φ − μ_d cos φ) t²/2.
        const Real a = down - mu_dynamic * 10 * std::cos(phi);
        CHECK(a > 0);
        CHECK(disk.position()[0] - hangs == Approx(a / 2).epsilon(1e-3));
      }
    }
  }
}

TEST_CASE("a disk slides v²/(2μg) and then rests") {
  const auto run = [](Real give, Real dt) {
    OnTable disk(friction(0.3, 0.3), dt, {0.8, 0.6}, 0, {0, 0}, give);
    Real farthest = 0;
    disk.s->advance(20 * std::sqrt(give) + 1, [&](State&) {
      farthest = std::max(farthest, disk.position().norm());
      return AfterStep::proceed;
    });
    // The disk stops with the spring stretched by `give`; then the spring pulls it back to the point where it is
    // relaxed.
    const Real distance = 1.0 / (2 * 0.3 * 10);
    CHECK(farthest == Approx(distance).epsilon(1e-6));
    CHECK(disk.position().norm() == Approx(distance - give).epsilon(1e-5));
    CHECK(disk.position()[1] / disk.position()[0] == Approx(0.75).epsilon(1e-10));
    CHECK(disk.angle() == 0);
    // All energy is heat, nearly all of it by sliding.
    const auto heat = disk.s->particles().history().of("base_friction").heat();
    CHECK(heat[0] + heat[1] == Approx(disk.mass / 2).epsilon(1e-3));
    CHECK(heat[1] > 0.99 * disk.mass / 2);
    // The disk stays at rest.
    disk.s->advance(disk.s->state().t + 200 * std::sqrt(give));
    const pliant::Vec<2> rest = disk.position();
    CHECK(disk.velocity().norm() < 1e-9);
    disk.s->advance(disk.s->state().t + 1);
    CHECK((disk.position() - rest).norm() < 1e-13);
  };
  run(1e-3, 2e-4);
  run(1e-4, 5e-5);
}

TEST_CASE("a disk that spins comes to rest after 3ωR/(4μg)") {
  const Real spin = -4, alpha = 4.0 / 3 * 0.3 * 10 / radius;  // 2/3 μ m g R over m R²/2
  OnTable disk(friction(0.3, 0.3), 2e-5, {0, 0}, spin, {0, 0}, 1e-5);
  const Real stops = 4 / alpha;
  disk.s->advance(stops / 2);
  CHECK(disk.spin() == Approx(spin / 2).epsilon(1e-3));
  CHECK(disk.velocity().norm() < 1e-12);
  disk.s->advance(0.999 * stops);
  CHECK(disk.spin() < 0);
  disk.s->advance(stops + 0.2);
  CHECK(std::abs(disk.spin()) < 1e-3);
  CHECK(disk.angle() == Approx(-square(spin) / (2 * alpha)).epsilon(1e-4));
  CHECK(sum_of_heat(*disk.s, "base_friction") == Approx(disk.mass * square(radius * spin) / 4).epsilon(1e-3));
}

TEST_CASE("sliding and spinning are coupled, and end together") {
  struct Motion {
    Real v, w;  // w = Rω
  };
  for (const Motion start : {Motion{1, 0.5}, Motion{0.3, 1}, Motion{1, 0.05}}) {
    INFO("v " << start.v << " Rω " << start.w);
    OnTable disk(friction(0.3, 0.3), 2e-5, {0, -start.v}, start.w / radius, {0, 0}, 1e-6);
    // v̇ = −μg F, Rω̇ = −2 μg T by the exact integrals, in small steps.
    Motion exact = start;
    Real t = 0, until = 0.15;
    const Real h = 1e-5;
    const auto rate = [](const Motion& m) {
      const LimitSurface::Point p = LimitSurface::exact(m.w / (m.v + m.w));
      return Motion{-3 * p.force, -6 * p.torque};
    };
    for (; t < until - h / 2; t += h) {
      const Motion a = rate(exact), b = rate({exact.v + h / 2 * a.v, exact.w + h / 2 * a.w});
      exact = {exact.v + h * b.v, exact.w + h * b.w};
    }
    disk.s->advance(until);
    CHECK(disk.velocity().norm() == Approx(exact.v).epsilon(2e-4));
    CHECK(radius * disk.spin() == Approx(exact.w).epsilon(2e-4));
    Real slides = 0, spins = 0;
    disk.s->advance(1, [&](State&) {
      if (disk.velocity().norm() > 5e-3) slides = disk.s->state().t;
      if (radius * disk.spin() > 5e-3) spins = disk.s->state().t;
      return AfterStep::proceed;
    });
    CHECK(disk.velocity().norm() + radius * std::abs(disk.spin()) < 1e-3);
    CHECK(slides > until);
    CHECK(spins == Approx(slides).margin(5e-3));
    const Real all = disk.mass / 2 * (square(start.v) + square(start.w) / 2);
    CHECK(sum_of_heat(*disk.s, "base_friction") == Approx(all).epsilon(1e-3));
  }
}

TEST_CASE("uncoupled, sliding and spinning know nothing of each other") {
  BaseFriction base = friction(0.3, 0.3);
  base.coupled = false;
  OnTable disk(base, 2e-5, {1, 0}, 1 / radius, {0, 0}, 1e-6);
  disk.s->advance(0.1);
  CHECK(disk.velocity()[0] == Approx(1 - 0.3).epsilon(1e-3));
  CHECK(radius * disk.spin() == Approx(1 - 0.4).epsilon(1e-3));
  disk.s->advance(0.28);
  CHECK(std::abs(disk.spin()) < 1e-2);
  CHECK(disk.velocity()[0] == Approx(1 - 0.84).epsilon(1e-2));
}

TEST_CASE("a disk that is pushed by less than friction holds does not creep") {
  OnTable disk(friction(0.5, 0.3), 1e-4, {0, 0}, 0, {0.95 * 5 * 0.6, 0.95 * 5 * 0.8}, 1e-4);
  const Real k = disk.base.epsilon / square(2 * radius);
  const pliant::Vec<2> hangs = disk.mass / k * pliant::Vec<2>(0.95 * 3, 0.95 * 4);
  for (int d = 0; d < 2; ++d) disk.s->state().x()[d] += 0.97 * hangs[d];
  disk.s->advance(3);
  const pliant::Vec<2> before = disk.position();
  CHECK((before - hangs).norm() < 1e-9 * hangs.norm() + 1e-13);
  disk.s->advance(10);
  CHECK((disk.position() - before).norm() < 1e-13);
  CHECK(disk.s->particles().history().of("base_friction").heat()[1] == 0);
}

TEST_CASE("a disk that sticks is integrated at second order, and one that comes to slide at first") {
  check_orders_on_table([](Real v, Real h) {
    BaseFriction base = friction(0.3, 0.3);
    base.damping = 0;
    OnTable disk(base, h, {v, 0}, 0, {0, 0}, 0.01);
    disk.s->advance(0.05);
    return disk.position()[0];
  });
}

TEST_CASE("what a disk loses as it breaks away, from the static limit to the dynamic one, is heat") {
  BaseFriction base = friction(0.5, 0.3);
  base.damping = 0;
  OnTable disk(base, 2e-5, {0.6, 0}, 0, {0, 0}, 0.01);
  check_heat_of_breaking_away(*disk.s, disk.mass);
}

TEST_CASE("disks do not depend on the frame in which they lie, nor on the units of time") {
  // Turned by 90° and mirrored, exactly.
  OnTable a(friction(0.5, 0.3), 1e-3, {0.5, -0.3}, 2), b(friction(0.5, 0.3), 1e-3, {0.3, 0.5}, 2);
  a.s->advance(0.1), b.s->advance(0.1);
  CHECK(b.position()[0] == Approx(-a.position()[1]).epsilon(1e-8));
  CHECK(b.position()[1] == Approx(a.position()[0]).epsilon(1e-8));
  CHECK(b.angle() == Approx(a.angle()).epsilon(1e-8));
  // k and g four times, v twice, dt half: the same places.
  OnTable fast(friction(0.5, 0.3, 40), 5e-4, {1, -0.6}, 4);
  fast.s->advance(0.05);
  CHECK(fast.position() == a.position());
  CHECK(fast.angle() == a.angle());
  CHECK(a.angle() > 0.05);
}

}  // namespace pliant::test::base_friction_test
