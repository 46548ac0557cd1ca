// Vertices that cross outlines are found in the very state in which they are inside.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/crossing.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::crossing_watch_test {

namespace {

/// A wedge that flies past a hexagon without forces, its tip through one corner of it. `depth`: how deep it gets.
struct Flight {
  explicit Flight(ModelKind kind, Real depth, Real speed = 1) {
    const Real delta = kind == ModelKind::smooth ? 0.1 : 0.5;
    c.add_polygon(regular_polygon(6, 0.5), delta);
    c.add_polygon(wedge({0.5 - depth, -0.6}, {1, 0}), delta);
    system = std::make_unique<ParticleSystem<2>>(
        c.topology, Walls<2>(), make_force_field<2>(kind, {.epsilon = 0}, pliant::Vec<2>::Zero()), 0.06);
    state = State(c.topology.points(), 2);
    std::copy(c.x.begin(), c.x.end(), state.x().begin());
    for (Index i = 6; i < 10; ++i) point<2>(state.v().data(), i) = pliant::Vec<2>(0, speed);
  }
  /// The result of a check after every step.
  bool crossed() const {
    for (Index i = 0; i < 10; ++i)
      if (inside_polygon(state.x().data(), system->topology(), i < 6, point<2>(state.x().data(), i))) return true;
    return false;
  }

  Configuration<2> c;
  std::unique_ptr<ParticleSystem<2>> system;
  State state;
};

/// Steps until the watch finds a vertex inside; 0 if it never does. A state with one must not pass.
std::int64_t found_at(Integrator& integrator, Flight& f) {
  CrossingWatch watch;
  watch.start(*f.system, f.state);
  std::int64_t found = 0;
  try {
    integrator.run(*f.system, f.state, 1.2, true, [&](State& s) {
      found = s.step;
      watch.after_step(*f.system, s);
      REQUIRE(!f.crossed());
      return AfterStep::proceed;
    });
  } catch (const NumericalError& error) {
    CHECK(f.crossed());
    CHECK(std::string(error.what()).find(" has crossed the outline of particle ") != std::string::npos);
    return found;
  }
  return 0;
}

}  // namespace

TEST_CASE("a vertex that goes in and out is found in the first state in which it is inside") {
  for (const ModelKind kind : {ModelKind::smooth, ModelKind::rough})
    for (const Real depth : {0.001, 0.02, 0.2})
      for (const Real dt : {1e-4, 7e-4}) {
        INFO(to_string(kind) << ", depth " << depth << ", dt " << dt);
        // Without the watch: in at some step, and out again before the end.
        Flight alone(kind, depth);
        std::int64_t in = 0;
        FixedStepVerlet(dt).run(*alone.system, alone.state, 1.2, true, [&](State& s) {
          if (in == 0 && alone.crossed()) in = s.step;
          return AfterStep::proceed;
        });
        REQUIRE(in > 0);
        REQUIRE(!alone.crossed());

        Flight watched(kind, depth);
        FixedStepVerlet verlet(dt);
        CHECK(found_at(verlet, watched) == in);
        if (dt < 5e-4) continue;
        Flight by_ts(kind, depth);
        TsIntegrator ts({.dt = dt, .longest_dt = 2 * dt});
        CHECK(found_at(ts, by_ts) > 0);
      }
}

TEST_CASE("a vertex that stays outside is not found") {
  for (const ModelKind kind : {ModelKind::smooth, ModelKind::rough}) {
    Flight f(kind, -0.001);
    FixedStepVerlet verlet(7e-4);
    CHECK(found_at(verlet, f) == 0);
  }
}

TEST_CASE("a vertex that one step carries deep inside is found") {
  for (const ModelKind kind : {ModelKind::smooth, ModelKind::rough}) {
    INFO(to_string(kind));
    Flight f(kind, 0.5, 2);
    FixedStepVerlet verlet(0.3);  // in two steps to the centre, far from every listed edge
    CHECK(found_at(verlet, f) > 0);
  }
}

TEST_CASE("a start with a vertex inside is refused, however deep it is") {
  for (const Real y : {-0.42, 0.0}) {
    Flight f(ModelKind::smooth, 0.5);
    for (Index i = 6; i < 10; ++i) f.state.x()[2 * i + 1] += 0.6 + y;
    CrossingWatch watch;
    CHECK_THROWS_AS(watch.start(*f.system, f.state), NumericalError);
  }
}

TEST_CASE("what was put somewhere else is looked at there") {
  Flight f(ModelKind::smooth, 0.02);
  CrossingWatch watch;
  watch.start(*f.system, f.state);
  for (Index i = 6; i < 10; ++i) f.state.x()[2 * i + 1] += 0.6;
  f.system->relist(f.state.x().data(), 1);
  CHECK_THROWS_AS(watch.after_change(*f.system, f.state), NumericalError);
}

TEST_CASE("a vertex inside the image of a particle is found", "[periodic]") {
  Configuration<2> c;
  c.add_polygon(regular_polygon(6, 0.5), 0.1);
  c.add_polygon(wedge({3.1, 0.05}, {1, 0}), 0.1);  // 0.1 in the hexagon's image
  State state(c.topology.points(), 2);
  std::copy(c.x.begin(), c.x.end(), state.x().begin());
  for (const Real length : {Box<2>::infinite, 3.0}) {
    ParticleSystem<2> system(c.topology, {}, make_force_field<2>(ModelKind::smooth, {}, pliant::Vec<2>::Zero()), 0.06,
                             Ranks(), Box<2>({0, 0}, {length, Box<2>::infinite}));
    CrossingWatch watch;
    if (length == 3)
      CHECK_THROWS_WITH(watch.start(system, state), Catch::Contains("has crossed the outline of particle"));
    else
      CHECK_NOTHROW(watch.start(system, state));
  }
}

}  // namespace pliant::test::crossing_watch_test
