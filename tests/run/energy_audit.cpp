// How often the energy audit evaluates the power of friction, the heat that it finds, and the errors that count.
#include <catch2/catch.hpp>

#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include <pliant/model/pair_friction.h>
#include <pliant/run/energy_audit.h>

#include "support/disks.h"

namespace pliant::test::energy_audit_test {

namespace {

using pliant::Vec;  // PETSc has one, too

/// Counts evaluations of the forces of the listed pairs.
struct CountedFriction : PairFriction<2> {
  std::int64_t* evaluations;

  template <class F>
  void add_force(const StateView<2>& s, Index e, F& force) const {
    if (e == 0) ++*evaluations;
    PairFriction<2>::add_force(s, e, force);
  }
};

}  // namespace

TEST_CASE("a gain of energy beyond the work is an error, up to the error of sampled work") {
  EnergyBudget budget{.work = 1, .change = 2, .uncertainty = 0.5};
  CHECK(budget.certain_error() == Approx(0.5));  // no heat, which is never negative, can explain it
  budget.uncertainty_of_work = 0.2;
  CHECK(budget.certain_error() == Approx(0.2));
  CHECK_THROWS_AS(check_energy(budget), NumericalError);
  budget.uncertainty = budget.uncertainty_of_work = std::numeric_limits<Real>::infinity();
  CHECK(budget.certain_error() == 0);
}

TEST_CASE("friction is sampled seldom once the heat is accurate") {
  constexpr Real side = 10.5, dt = 1e-3;
  constexpr std::int64_t steps = 20000;
  Random random(5);
  Configuration<2> c;
  for (int k = 0; k < 100; ++k)
    c.add_soft(random(0.9, 1.1),
               Vec<2>(0.75 + k % 10 + random(-0.05, 0.05), 0.75 + static_cast<Real>(k / 10) + random(-0.05, 0.05)));
  c.random_velocities(random);
  c.walls = Walls<2>({WallSegment::between({0, 0}, {side, 0}), WallSegment::between({side, 0}, {side, side}),
                      WallSegment::between({side, side}, {0, side}), WallSegment::between({0, side}, {0, 0})});
  std::int64_t evaluations = 0;
  const auto simulation =
      simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(dt), PairContact<2>{200, "pair"},
                       WallContact<2>{200}, CountedFriction{{0.05}, &evaluations});
  simulation->place(c.x);
  std::ranges::copy(c.v, simulation->state().v().begin());
  EnergyAudit<2> audit(*simulation);
  audit.sample_every(6, 36);
  audit.start();
  std::int64_t early = 0;
  simulation->advance(steps * dt, [&](State& s) {
    audit.follow();
    audit.prepare(false);
    if (s.step == 300) early = evaluations - s.step;
    return AfterStep::proceed;
  });
  const std::int64_t samples = evaluations - steps;
  CHECK(early > 300 / 7);
  CHECK(samples < steps / 12);
  CHECK(samples > steps / 37);
  const EnergyBudget budget = audit.budget();
  CHECK(budget.heat > 10);
  CHECK(budget.heat == Approx(-budget.change).epsilon(0.01));
  CHECK(budget.uncertainty < 0.006 * budget.heat);
}

}  // namespace pliant::test::energy_audit_test
