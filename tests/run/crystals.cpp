// Crystals in periodic boxes, and particles between walls: velocity Verlet is stable just below the limit of the model
// and unstable just above the limit of the mode.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/run/simulation.h>
#include <pliant/ts/verlet.h>

#include "support/configurations.h"

namespace pliant::test::crystals_test {

namespace {

template <int D>
struct Crystal {
  Configuration<D> c;
  Box<D> box;
  ModelKind kind;
  ModelParameters p;

  Real limit() const { return make_force_field<D>(kind, p, pliant::Vec<D>::Zero())->critical_step(c.topology).limit(); }
  /// Whether small random velocities grow in velocity Verlet with steps of this length.
  bool explodes(Real dt) const {
    Simulation<D> run(
        c.topology,
        ParticleSystem<D>({}, c.walls, make_force_field<D>(kind, p, pliant::Vec<D>::Zero()), 0.1, Ranks(), box),
        Sorting::never);
    run.set_integrator(std::make_unique<FixedStepVerlet>(dt));
    run.place(c.x);
    Random random(3);
    constexpr Real speed = 1e-9;
    for (Real& v : run.state().v()) v = random(-speed, speed);
    // Contacts get their springs and tensions at the first steps.
    Real most = 0;
    run.advance(400 * dt, [&](State& s) {
      most = 0;
      for (const Real v : s.v()) most = std::max(most, std::abs(v));
      return std::isfinite(most) && most < 1e-3 ? AfterStep::proceed : AfterStep::stop;
    });
    return !(most < 1e-6);
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

/// The estimate lies below the measured limit, by no more than 15 %.
template <int D>
void check(const Crystal<D>& crystal) {
  const Real measured = crystal.measured();
  INFO("measured over estimated limit: " << measured);
  CHECK(measured > 0.985);
  CHECK(measured < 1.18);
}

}  // namespace

TEST_CASE("the limit of soft crystals is that of all their contacts", "[crystals]") {
  const ModelParameters soft{.epsilon = 100, .epsilon_wall = 0};
  check(triangular(ModelKind::sp, soft));
  check(triangular(ModelKind::sp, soft, 0.7));
  check(fcc(ModelKind::sp, soft));
}

TEST_CASE("the limit of frictional crystals is that of all springs and dashpots", "[crystals]") {
  for (const Real e : {0.5, 0.9}) {
    INFO("e = " << e);
    check(triangular(ModelKind::disk, frictional(e)));
    check(triangular(ModelKind::disk, frictional(e, ContactLaw::spring)));
    check(fcc(ModelKind::disk, frictional(e)));
  }
}

TEST_CASE("the limit of a particle is that between two walls", "[crystals]") {
  for (const ModelKind kind : {ModelKind::sp, ModelKind::disk})
    for (const Real e : {0.5, 0.9}) {
      ModelParameters p{.epsilon = 1e-3, .epsilon_wall = 100};
      p.disk.restitution = e;
      Crystal<2> slot{{}, {}, kind, p};
      const Real half = squeeze / 2;
      slot.c.walls =
          Walls<2>(std::vector{Solid<2>::half_space({0, -half}, {0, 1}), Solid<2>::half_space({0, half}, {0, -1})});
      slot.c.add_soft(1, {0, 0});
      check(slot);
    }
}

TEST_CASE("drag shortens the limit together with contacts", "[crystals]") {
  check(triangular(ModelKind::sp, {.epsilon = 100, .epsilon_wall = 0, .zeta = 10}));
}

}  // namespace pliant::test::crystals_test
