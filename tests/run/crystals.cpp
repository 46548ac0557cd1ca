// Crystals in periodic boxes, and particles between walls: velocity Verlet is stable just below the limit of the model
// and unstable just above the limit of the mode.
#include <catch2/catch.hpp>

#include <limits>
#include <utility>

#include <pliant/catalogue/catalogue.h>
#include <pliant/run/simulation.h>
#include <pliant/ts/verlet.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::crystals_test {

namespace {

template <int D>
struct Crystal {
  Configuration<D> c;
  Box<D> box;
  ModelKind kind;
  ModelParameters p;

  std::unique_ptr<ForceField<D>> field() const { return make_force_field<D>(kind, p, pliant::Vec<D>::Zero()); }
  CriticalStep critical_step() const { return field()->critical_step(c.topology); }
  Real limit() const { return critical_step().limit(); }
  std::unique_ptr<Simulation<D>> simulation(Real dt) const {
    auto run = std::make_unique<Simulation<D>>(c.topology, ParticleSystem<D>({}, c.walls, field(), 0.1, Ranks(), box),
                                               Sorting::never);
    run->set_integrator(std::make_unique<FixedStepVerlet>(dt));
    run->place(c.x);
    return run;
  }
  /// Lets outlines find their equilibrium under drag.
  void relax() {
    const Real zeta = std::exchange(p.zeta, 2);
    const auto run = simulation(0.5 * limit());
    run->advance(20);
    c.x.assign(run->state().x().begin(), run->state().x().end());
    p.zeta = zeta;
  }
  /// Whether small random velocities grow in velocity Verlet with steps of this length.
  bool explodes(Real dt) const {
    const auto run = simulation(dt);
    Random random(3);
    constexpr Real speed = 1e-9;
    for (Real& v : run->state().v()) v = random(-speed, speed);
    // Contacts get their springs and tensions at the first steps.
    Real most = 0;
    run->advance(400 * dt, [&](State& s) {
      most = 0;
      for (const Real v : s.v()) most = std::max(most, std::abs(v));
      return std::isfinite(most) && most < 1e-3 ? AfterStep::proceed : AfterStep::stop;
    });
    return !(most < 1e-3);
  }
  /// The longest stable step, to one per cent, over the estimate.
  Real measured() const {
    Real low = 0.3 * limit(), high = 3 * limit();
    while (high / low > 1.01) {
      const Real middle = std::sqrt(low * high);
      (explodes(middle) ? high : low) = middle;
    }
    return low / limit();
  }
};

constexpr Real squeeze = 0.99;

Crystal<2> triangular(ModelKind kind, const ModelParameters& p, Real sigma = 1) {
  const Real a = squeeze * sigma, row = a * std::sqrt(3) / 2;
  Crystal<2> crystal{{}, Box<2>({0, 0}, {6 * a, 6 * row}), kind, p};
  for (int j = 0; j < 6; ++j)
    for (int i = 0; i < 6; ++i) crystal.c.add_soft(sigma, {(i + 0.5 * (j % 2)) * a, j * row});
  return crystal;
}

Crystal<3> fcc(ModelKind kind, const ModelParameters& p) {
  const Real a = squeeze * std::sqrt(2);
  constexpr int n = 4;
  Crystal<3> crystal{{}, Box<3>({0, 0, 0}, pliant::Vec<3>::Constant(n * a)), kind, p};
  for (int k = 0; k < n * n * n; ++k)
    for (const pliant::Vec<3>& at : {pliant::Vec<3>(0, 0, 0), pliant::Vec<3>(0.5, 0.5, 0), pliant::Vec<3>(0.5, 0, 0.5),
                                     pliant::Vec<3>(0, 0.5, 0.5)})
      crystal.c.add_soft(1, a * (pliant::Vec<3>(k % n, k / n % n, k / n / n) + at));
  return crystal;
}

ModelParameters frictional(Real e, ContactLaw law = ContactLaw::harmonic) {
  ModelParameters p{.epsilon = 100, .epsilon_wall = 0, .law = law};
  p.disk.restitution = e;
  return p;
}

/// A triangular crystal of pressed outlines with shape energies, relaxed.
Crystal<2> outlines(ModelKind kind, ModelParameters p, Real pressed, Index n = 16) {
  // Vertices of rough particles touch their neighbours in the outline.
  const Real l0 = std::sqrt(pi * std::tan(pi / n) / n), delta = kind == ModelKind::rough ? l0 : 0.1 * l0;
  const Real radius = l0 / (2 * std::sin(pi / n)), a = pressed * (2 * radius + delta), row = a * std::sqrt(3) / 2;
  Crystal<2> crystal{{}, Box<2>({0, 0}, {3 * a, 2 * row}), kind, p};
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 3; ++i) {
      crystal.c.topology.add_polygon(n, pi / 4, l0, delta, pi / 4);
      for (const pliant::Vec<2>& r : regular_polygon(n, radius, {(i + 0.5 * (j % 2)) * a, j * row}, 0.1))
        crystal.c.x.insert(crystal.c.x.end(), {r[0], r[1]});
    }
  crystal.c.v.resize(crystal.c.x.size());
  crystal.relax();
  return crystal;
}

/// The estimate lies below the measured limit, by no more than 15 % unless `most` is given.
template <int D>
void check(const Crystal<D>& crystal, Real most = 1.18) {
  const Real measured = crystal.measured();
  INFO("measured over estimated limit: " << measured);
  CHECK(measured > 0.985);
  CHECK(measured < most);
}

}  // namespace

TEST_CASE("the limit of soft crystals is that of all their contacts", "[crystals]") {
  const ModelParameters soft{.epsilon = 100, .epsilon_wall = 0};
  check(triangular(ModelKind::sp, soft));
  check(triangular(ModelKind::sp, soft, 0.7));
  check(fcc(ModelKind::sp, soft));
}

TEST_CASE("the limit of frictional crystals is that of all springs and dashpots", "[crystals]") {
  for (const Real e : {0.2, 0.5, 0.9}) {
    INFO("e = " << e);
    check(triangular(ModelKind::disk, frictional(e)));
    check(triangular(ModelKind::disk, frictional(e, ContactLaw::spring)));
    check(fcc(ModelKind::disk, frictional(e)));
  }
}

namespace {

/// A disk or a sphere that two walls touch.
template <int D>
Crystal<D> slot(ModelKind kind, Real e, ContactLaw law) {
  ModelParameters p{.epsilon = 1e-3, .epsilon_wall = 100, .law = law};
  p.disk.restitution = e;
  Crystal<D> crystal{{}, {}, kind, p};
  const pliant::Vec<D> up = pliant::Vec<D>::Unit(D - 1), wall = squeeze / 2 * up;
  crystal.c.walls = Walls<D>(std::vector{Solid<D>::half_space(-wall, up), Solid<D>::half_space(wall, -up)});
  crystal.c.add_soft(1, pliant::Vec<D>::Zero());
  return crystal;
}

template <int D>
void check_slots() {
  const auto over_one_contact = [](const Crystal<D>& crystal) {
    return crystal.limit() / crystal.critical_step().elastic;
  };
  for (const ContactLaw law : {ContactLaw::harmonic, ContactLaw::spring}) {
    if (law == ContactLaw::harmonic) {  // soft particles have no springs
      const Crystal<D> soft = slot<D>(ModelKind::sp, 1, law);
      CHECK(over_one_contact(soft) == Approx(1 / std::sqrt(2)));
      check(soft);
    }
    for (const Real e : {0.2, 0.5, 0.9}) {
      INFO("e = " << e);
      check(slot<D>(ModelKind::disk, e, law));
    }
    // Two springs alone give 0.71, dashpots take the rest.
    CHECK(over_one_contact(slot<D>(ModelKind::disk, 0.9, law)) == Approx(0.64).margin(0.01));
  }
}

}  // namespace

TEST_CASE("the limit of a particle is that between two walls", "[crystals]") {
  check_slots<2>();
  check_slots<3>();
}

TEST_CASE("the limit of pressed outlines is that of all contacts and of the shape", "[crystals]") {
  // Limits of contacts, and of the shape.
  const ModelParameters contacts{.epsilon = 300, .epsilon_wall = 0, .k_a = 1e3, .k_l = 100, .k_b = 1};
  const ModelParameters shapes{.epsilon = 10, .epsilon_wall = 0, .k_a = 1e3, .k_l = 100, .k_b = 1};
  for (const Real pressed : {0.98, 0.9}) {
    INFO("pressed to " << pressed);
    for (const auto& [kind, p] : {std::pair(ModelKind::rough, contacts), std::pair(ModelKind::rough, shapes),
                                  std::pair(ModelKind::smooth, shapes)})
      check(outlines(kind, p, pressed), std::numeric_limits<Real>::infinity());
  }
}

TEST_CASE("drag shortens the limit together with contacts", "[crystals]") {
  check(triangular(ModelKind::sp, {.epsilon = 100, .epsilon_wall = 0, .zeta = 10}));
}

}  // namespace pliant::test::crystals_test
