// Collisions of disks with friction.
#include <petscsys.h>

#include <catch2/catch.hpp>

#include <pliant/ts/ts_integrator.h>

#include "support/frictional.h"
#include "support/order.h"
#include "support/problems.h"

namespace pliant::test::disk_contact_test {

namespace {

constexpr Real epsilon = 1000;

/// Two disks, of radii 0.5 and 0.7, that begin to touch: the second one is at rest.
struct Collision {
  SurfaceFriction surface;
  Real toward, across, spin;

  std::unique_ptr<Simulation<2>> simulation(std::unique_ptr<Integrator> by, Real turn = 0,
                                            pliant::Vec<2> drift = {0, 0}, Real faster = 1,
                                            ContactLaw law = ContactLaw::harmonic) const {
    const Eigen::Rotation2D<Real> rotate(turn);
    Configuration<2> c;
    c.add_soft(1, {0, 0});
    c.add_soft(1.4, rotate * pliant::Vec<2>(0, 1.2 + 1e-9));
    const pliant::Vec<2> v = rotate * pliant::Vec<2>(faster * across, faster * toward) + drift;
    c.v = {v[0], v[1], drift[0], drift[1]};
    auto s =
        simulation_of<2>(c, Sorting::never, Ranks(), std::move(by), disk_pairs(square(faster) * epsilon, surface, law));
    start(*s, c, {0, 0}, {faster * spin, 0});
    return s;
  }
  std::unique_ptr<Simulation<2>> simulation(Real dt) const { return simulation(std::make_unique<FixedStepVerlet>(dt)); }
};

/// The same with a spring that is integrated along with the motion, in very small steps: velocity and spin of both.
struct Reference {
  std::array<Real, 6> v{};
  int stuck = 0, slid = 0;  ///< steps

  explicit Reference(const Collision& c) {
    constexpr Real a = 0.5, b = 0.7;
    const Real m1 = pi * a * a, m2 = pi * b * b, i1 = m1 * a * a / 2, i2 = m2 * b * b / 2, k = epsilon / 1.44,
               kt = c.surface.stiffness * k, gamma = 2 * c.surface.damping * std::sqrt(k * m1 * m2 / (m1 + m2)),
               gamma_t = c.surface.tangential_damping * gamma;
    pliant::Vec<2> r1(0, 0), r2(0, 1.2 + 1e-9), v1(c.across, c.toward), v2(0, 0);
    Real w1 = c.spin, w2 = 0, spring = 0;
    const Real h = 2e-6;
    bool sliding = false;
    for (int step = 0;; ++step) {
      const pliant::Vec<2> r = r1 - r2;
      const Real d = r.norm();
      if (d > 1.2 && step > 1000) break;
      const pliant::Vec<2> n = r / d, t(-n[1], n[0]);
      const Real apart = n.dot(v1 - v2), share = d / 1.2,
                 slip = t.dot(v1 - v2) - share * (a * w1 + b * w2);  // at the point that divides d as the radii do
      const Real press = d < 1.2 ? std::max(k * (1.2 - d) - gamma * apart, 0.0) : 0.0;
      const Real rate = slip / share;
      spring += h * rate;
      const Real most = press * share, limit = (sliding ? c.surface.mu_dynamic : c.surface.mu_static) * most;
      sliding = kt * std::abs(spring) > limit;
      if (sliding) spring = std::copysign(c.surface.mu_dynamic * most / kt, spring);
      const Real cap = sliding ? c.surface.mu_dynamic * most : limit;
      const Real pull = std::clamp(kt * spring + gamma_t * rate, -cap, cap);
      if (press > 0) ++(sliding ? slid : stuck);
      const pliant::Vec<2> f = press * n - pull / share * t;
      v1 += h / m1 * f, v2 -= h / m2 * f;
      w1 += h / i1 * pull * a, w2 += h / i2 * pull * b;
      r1 += h * v1, r2 += h * v2;
    }
    v = {v1[0], v1[1], w1, v2[0], v2[1], w2};
  }
};

/// After a collision.
std::array<Real, 6> outcome(Simulation<2>& s, Real faster = 1) {
  s.advance(0.2 / faster);
  const auto v = s.state().v();
  CHECK(s.particles().history().of("disk_contact").contacts().keys.empty());
  return {v[0], v[1], s.spins()[0], v[2], v[3], s.spins()[1]};
}
Real difference(const std::array<Real, 6>& a, const std::array<Real, 6>& b) {
  Real most = 0;
  for (std::size_t k = 0; k < 6; ++k) most = std::max(most, std::abs(a[k] - b[k]));
  return most;
}

/// A dense cluster in motion.
struct Cluster {
  Configuration<2> c;
  std::vector<Real> angles, spins;
  explicit Cluster(Random& random, Index columns = 5, Index rows = 5) : c(soft_rows<2>(random, columns, rows)) {
    c.walls = Walls<2>();
    angles.assign(static_cast<std::size_t>(c.topology.particles()), 0);
    spins = random_numbers(random, angles.size(), 3);
  }
  std::unique_ptr<Simulation<2>> simulation(const SurfaceFriction& surface, Sorting sorting = Sorting::never,
                                            const Ranks& ranks = Ranks(), Real dt = 1e-3) const {
    auto s = simulation_of<2>(c, sorting, ranks, std::make_unique<FixedStepVerlet>(dt), disk_pairs(epsilon, surface));
    start(*s, c, angles, spins);
    return s;
  }
};

constexpr SurfaceFriction rough{.mu_static = 0.5, .mu_dynamic = 0.4, .damping = 0.1};

struct Momentum {
  pliant::Vec<2> linear = {0, 0};
  Real angular = 0;
  explicit Momentum(Simulation<2>& simulation) {
    const StateView<2> s = simulation.view();
    for (Index i = 0; i < s.topology.owned_points(); ++i) {
      const pliant::Vec<2> p = s.topology.mass(i) * s.velocity(i);
      linear += p;
      angular += torque(s.position(i), p) + s.topology.inertia[i] * s.spin(i);
    }
  }
};

}  // namespace

TEST_CASE("disks collide with the coefficient of restitution that was asked for") {
  const auto e = [](ContactLaw law, Real wanted, Real toward) {
    const Collision c{{.damping = damping_for(law, wanted)}, toward, 0, 0};
    const auto s = c.simulation(std::make_unique<FixedStepVerlet>(2e-5), 0, {0, 0}, 1, law);
    Real attracts = 0;
    std::vector<Real> f(s->state().size());
    s->advance(0.6, [&](State& state) {
      if (state.step % 50 == 0) {
        s->particles().field().forces(s->particles().view(state.x().data(), state.v().data()), f.data());
        attracts = std::max(attracts, f[1]);  // the first is pushed down
      }
      return AfterStep::proceed;
    });
    CHECK(attracts == 0);
    return (s->state().v()[3] - s->state().v()[1]) / toward;
  };
  for (const Real wanted : {1.0, 0.9, 0.5, 0.1}) {
    CHECK(e(ContactLaw::harmonic, wanted, 1) == Approx(wanted).epsilon(2e-3).margin(5e-4));
    for (const Real toward : {1.0, 2.0})
      CHECK(e(ContactLaw::hertz, wanted, toward) == Approx(wanted).epsilon(3e-3).margin(1e-3));
  }
  CHECK(restitution(ContactLaw::harmonic, 1) == Approx(std::exp(-2)));
  CHECK(restitution(ContactLaw::harmonic, 1 + 1e-7) == Approx(std::exp(-2)).epsilon(1e-5));
  CHECK_THROWS_AS(damping_for(ContactLaw::harmonic, 0), InputError);
  CHECK_THROWS_AS(damping_for(ContactLaw::harmonic, 1.1), InputError);
}

TEST_CASE("oblique collisions are those of a reference in very small steps") {
  struct Case {
    const char* what;
    Collision collision;
    bool sticks, slides;
  };
  const SurfaceFriction strong{.mu_static = 10, .mu_dynamic = 10, .damping = 0.1},
      weak{.mu_static = 0.05, .mu_dynamic = 0.05, .damping = 0.1},
      medium{.mu_static = 0.4, .mu_dynamic = 0.4, .damping = 0.1},
      drops{.mu_static = 0.5, .mu_dynamic = 0.3, .damping = 0.1};
  for (const Case& c : {Case{"sticks", {strong, 1, 0.3, 1}, true, false}, Case{"slides", {weak, 1, 2, 1}, false, true},
                        Case{"both", {medium, 1, 1.2, 0.5}, true, true},
                        Case{"static and dynamic", {drops, 1, 1.3, 0.5}, true, true}}) {
    INFO(c.what);
    const Reference exact(c.collision);
    CHECK((5 * exact.slid > exact.stuck) == c.slides);
    CHECK((5 * exact.stuck > exact.slid) == c.sticks);
    CHECK(std::abs(exact.v[2] - c.collision.spin) > 0.05);
    const auto error = [&](Real h) { return difference(outcome(*c.collision.simulation(h)), exact.v); };
    const OrderFit fit = fit_order(error, 8e-4, 4);
    INFO(fit.text());
    CHECK(fit.errors.front() < 0.02);
    CHECK(fit.errors.back() < 0.003);
    CHECK(fit.errors.back() < 0.5 * fit.errors.front());
    const PetscOptionScope scope(
        "-ts_type rk -ts_rk_type 5dp -ts_adapt_type basic -ts_rtol 1e-6 -ts_atol 1e-7 -ts_adapt_dt_max 2e-4");
    CHECK(difference(outcome(*c.collision.simulation(std::make_unique<TsIntegrator>())), exact.v) < 0.003);
  }
}

TEST_CASE("disks that stick to each other are integrated at second order by Verlet, at fourth by Runge-Kutta") {
  // Two that overlap since the start, and roll and twist about each other without damping.
  const auto run = [](std::unique_ptr<Integrator> by) {
    Configuration<2> c;
    c.add_soft(1, {0, 0});
    c.add_soft(1.4, {0, 1.15});
    c.v = {0.3, 0, 0, 0};
    auto s = simulation_of<2>(c, Sorting::never, Ranks(), std::move(by),
                              disk_pairs(epsilon, {.mu_static = 10, .mu_dynamic = 10}));
    start(*s, c, {0, 0}, {0, -0.4});
    touch(*s);
    s->advance(0.04);
    CHECK(s->particles().history().of("disk_contact").heat()[2] == 0);
    return std::pair(s->state().x()[0] + s->state().x()[2], s->angles()[0] + 2 * s->angles()[1]);
  };
  const auto exact = [&] {
    const PetscOptionScope scope("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
    return run(std::make_unique<TsIntegrator>(TsOptions{.dt = 1e-4}));
  }();
  const auto error = [&](std::unique_ptr<Integrator> by) {
    const auto [x, angle] = run(std::move(by));
    return std::abs(x - exact.first) + std::abs(angle - exact.second);
  };
  require_order(
      "Verlet", [&](Real h) { return error(std::make_unique<FixedStepVerlet>(h)); }, 0.004, 2);
  const PetscOptionScope scope("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
  require_order(
      "RK 4", [&](Real h) { return error(std::make_unique<TsIntegrator>(TsOptions{.dt = h})); }, 0.008, 4);
}

TEST_CASE("disks keep linear and angular momentum to rounding") {
  Random random(5);
  const auto s = Cluster(random).simulation(rough);
  const Momentum before(*s);
  s->advance(0.3);
  const Momentum after(*s);
  CHECK((after.linear - before.linear).norm() < 1e-12);
  CHECK(std::abs(after.angular - before.angular) < 1e-11);
  const auto heat = s->particles().history().of("disk_contact").heat();
  for (const Real h : heat) CHECK(h > 0.01);
}

TEST_CASE("the energy that disks lose is the heat of damping and sliding") {
  Random random(6);
  const Cluster cluster(random);
  const auto lost = [&](Real dt) {
    const auto s = cluster.simulation(rough, Sorting::never, Ranks(), dt);
    touch(*s);
    const Real before = energy(*s);
    s->advance(0.2);
    CHECK(before - energy(*s) > 2);
    return std::abs(before - energy(*s) - sum_of_heat(*s, "disk_contact")) / before;
  };
  const Real coarse = lost(1e-3), fine = lost(1.25e-4);
  CHECK(coarse < 0.02);
  CHECK(fine < 0.3 * coarse);
}

TEST_CASE("collisions do not depend on direction, place or a common velocity, nor on the units of time") {
  const Collision c{rough, 1, 0.6, 0.5};
  const auto run = [&](Real turn, pliant::Vec<2> drift, Real faster) {
    const auto s = c.simulation(std::make_unique<FixedStepVerlet>(1e-3 / faster), turn, drift, faster);
    return outcome(*s, faster);
  };
  const auto plain = run(0, {0, 0}, 1), turned = run(2.1, {0, 0}, 1), moving = run(0, {3, -5}, 1),
             fast = run(0, {0, 0}, 2);
  const Eigen::Rotation2D<Real> rotate(2.1);
  for (const std::size_t at : {0, 3}) {
    const pliant::Vec<2> v(plain[at], plain[at + 1]), w(turned[at], turned[at + 1]);
    CHECK((rotate * v - w).norm() < 1e-9);
    CHECK(turned[at + 2] == Approx(plain[at + 2]).margin(1e-9));
    CHECK((v - pliant::Vec<2>(moving[at] - 3, moving[at + 1] + 5)).norm() < 1e-9);
    CHECK(moving[at + 2] == Approx(plain[at + 2]).margin(1e-9));
    for (std::size_t k = at; k < at + 3; ++k) CHECK(fast[k] == 2 * plain[k]);
  }
}

TEST_CASE("disks that rub do the same on any number of ranks, with the same heat", "[ranks]") {
  Random random(7);
  const Cluster cluster(random, 10, 8);
  const auto alone = cluster.simulation(rough),
             shared = cluster.simulation(rough, Sorting::regularly, Ranks(PETSC_COMM_WORLD));
  alone->advance(0.1);
  shared->advance(0.1, [&](State& state) {
    if (state.step % 23 != 0) return AfterStep::proceed;
    shared->sort();
    return AfterStep::reordered;
  });
  CHECK(Snapshot<2>(*alone).difference(Snapshot<2>(*shared)) < 1e-9);
  for (std::size_t k = 0; k < 3; ++k) {
    const Real one = alone->particles().history().of("disk_contact").heat()[k],
               all = shared->ranks().sum(shared->particles().history().of("disk_contact").heat()[k]);
    CHECK(one > 0.1);
    CHECK(all == Approx(one).epsilon(1e-9));
  }
}

TEST_CASE("the one kernel for disks is the sum of the terms") {
  Random random(8);
  const Cluster cluster(random);
  const auto s = cluster.simulation(rough);
  s->advance(0.05);
  const StateView<2> view = s->view();
  std::vector<Real> all(s->state().size()), one(all.size()), sum(all.size());
  s->particles().field().forces(view, all.data());
  for (const TermReport& r : s->particles().field().report(view))
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += r.force[k];
  Real most = 0, largest = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    most = std::max(most, std::abs(all[k] - sum[k]));
    largest = std::max(largest, std::abs(all[k]));
  }
  CHECK(most < 1e-12 * largest);
  CHECK(s->particles().field().report(view).size() == 2);
}

}  // namespace pliant::test::disk_contact_test
