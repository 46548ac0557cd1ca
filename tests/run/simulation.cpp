#include <pliant/run/simulation.h>

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include <pliant/system/point_drag.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::simulation_test {

namespace {

constexpr Real dt = 1e-3;

std::unique_ptr<Simulation<2>> with_inertia(const Configuration<2>& c, Sorting sorting = Sorting::regularly) {
  auto s = std::make_unique<Simulation<2>>(c.topology, system_of<2>(c, ModelKind::sp), sorting);
  s->set_integrator(std::make_unique<FixedStepVerlet>(dt));
  s->place(c.x);
  return s;
}

/// By id.
std::vector<Real> places(const Simulation<2>& s) {
  const Topology& t = s.topology();
  std::vector<Real> x(s.state().size());
  for (Index m = 0; m < t.owned(); ++m) point<2>(x.data(), t.id[m]) = point<2>(s.state().x().data(), m);
  return x;
}

StepObserver sorted_every(Simulation<2>& s, int steps) {
  return [&s, steps](State& state) {
    if (state.step % steps != 0) return AfterStep::proceed;
    s.sort();
    return AfterStep::reordered;
  };
}

}  // namespace

TEST_CASE("simulations in one process do not disturb each other") {
  Random random(1);
  const Configuration<2> c = soft_rows<2>(random, 8, 8), other = soft_rows<2>(random, 6, 5);
  const auto alone = with_inertia(c);
  alone->advance(100 * dt);
  const auto one = with_inertia(c), two = with_inertia(other);
  for (int k = 1; k <= 100; ++k) {
    one->step();
    two->step();
  }
  CHECK(one->state().step == 100);
  CHECK(one->state().t == alone->state().t);
  CHECK(places(*one) == places(*alone));
  CHECK(places(*one) != std::vector<Real>(c.x));
}

TEST_CASE("what an integrator carries is sorted with the particles") {
  Random random(2);
  Configuration<2> c = soft_rows<2>(random, 10, 12);
  const auto unsorted = with_inertia(c, Sorting::never), sorted = with_inertia(c);
  REQUIRE(!std::is_sorted(sorted->topology().id.begin(), sorted->topology().id.end()));
  unsorted->advance(300 * dt);
  sorted->advance(300 * dt, sorted_every(*sorted, 50));
  const std::vector<Real> a = places(*unsorted), b = places(*sorted);
  Real most = 0, moved = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, std::abs(a[i] - b[i]));
    moved = std::max(moved, std::abs(a[i] - c.x[i]));
  }
  CHECK(most < 1e-9);
  CHECK(moved > 0.01);
}

TEST_CASE("a state that was changed from outside starts afresh") {
  Random random(3);
  const Configuration<2> c = soft_rows<2>(random, 6, 6);
  const auto run = [&](bool told) {
    const auto s = with_inertia(c);
    s->advance(50 * dt);
    for (Real& v : s->state().v()) v *= -1;
    if (told) s->changed();
    s->advance(51 * dt);
    return s->integrator().statistics().force_evaluations;
  };
  CHECK(run(true) == run(false) + 1);
}

TEST_CASE("velocities without inertia can be looked at without a change of the trajectory") {
  const PetscOptionScope options("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
  Random random(4);
  const Configuration<2> c = soft_rows<2>(random, 6, 6);
  const auto run = [&](bool look) {
    Simulation<2> s(c.topology,
                    OverdampedSystem<2>(system_of<2>(c, ModelKind::sp), std::make_unique<PointDrag<2>>(5.0)),
                    Sorting::at_start);
    s.set_integrator(std::make_unique<TsIntegrator>(TsOptions{.dt = dt}));
    s.place(c.x);
    Real fastest = 0;
    s.advance(40 * dt, [&](State& state) {
      if (look) {
        s.find_velocities();
        for (const Real v : state.v()) fastest = std::max(fastest, std::abs(v));
      }
      return AfterStep::proceed;
    });
    CHECK((fastest > 1e-3) == look);
    return places(s);
  };
  CHECK(run(true) == run(false));
}

}  // namespace pliant::test::simulation_test
