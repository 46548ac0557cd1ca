// Outlines that cross themselves are found in the very state in which they do.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/run/crossing_watch.h>
#include <pliant/ts/verlet.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::self_crossing_test {

namespace {

/// A polygon without forces, of which one vertex flies through the opposite side.
struct Flight {
  Flight(ModelKind kind, int n, Real drift) {
    c.add_polygon(regular_polygon(n, 0.5), 0.02);
    system = std::make_unique<ParticleSystem<2>>(
        c.topology, Walls<2>(), make_force_field<2>(kind, {.epsilon = 0}, pliant::Vec<2>::Zero()), 0.06);
    state = State(n, 2);
    std::copy(c.x.begin(), c.x.end(), state.x().begin());
    for (Index i = 0; i < n; ++i) point<2>(state.v().data(), i) = pliant::Vec<2>(i == 0 ? -1 : 0, drift);
  }
  bool crosses() const {
    return self_intersects(state.x().data(), system->topology(), 0) ||
           !(polygon_area(state.x().data(), system->topology(), 0) > 0);
  }
  Configuration<2> c;
  std::unique_ptr<ParticleSystem<2>> system;
  State state;
};

}  // namespace

TEST_CASE("an outline that crosses itself is found in the first state in which it does", "[self]") {
  for (const ModelKind kind : {ModelKind::smooth, ModelKind::rough})
    for (const int n : {3, 4, 7, 16})
      for (const Real drift : {0.0, 2.0}) {
        INFO(to_string(kind) << ", " << n << " vertices, drift " << drift);
        Flight f(kind, n, drift);
        CrossingWatch watch;
        watch.start(*f.system, f.state);
        bool found = false;
        try {
          FixedStepVerlet(3e-3).run(*f.system, f.state, 1.5, true, [&](State& s) {
            watch.after_step(*f.system, s);
            REQUIRE(!f.crosses());
            return AfterStep::proceed;
          });
        } catch (const NumericalError& error) {
          found = true;
          CHECK(f.crosses());
          CHECK_THAT(std::string(error.what()), Catch::StartsWith("particle 0 "));
        }
        CHECK(found);
      }
}

TEST_CASE("outlines that cross themselves are let pass where they only count", "[self]") {
  Flight f(ModelKind::smooth, 16, 0);
  CrossingWatch watch;
  watch.set_self_crossing({.stops = false});
  watch.start(*f.system, f.state);
  FixedStepVerlet(3e-3).run(*f.system, f.state, 1.2, true, [&](State& s) {
    watch.after_step(*f.system, s);
    return AfterStep::proceed;
  });
  CHECK(f.crosses());
  CHECK(look_at_own_outlines(f.system->view(f.state.x().data(), nullptr)).count == 1);
}

TEST_CASE("a start that crosses itself is refused, and a trial step that does", "[self]") {
  Flight f(ModelKind::smooth, 16, 0);
  CrossingWatch watch;
  watch.set_self_crossing({.refuses_trials = true});
  watch.start(*f.system, f.state);
  CHECK(watch.admits(*f.system, f.state.x().data()));
  f.state.x()[0] -= 0.99;
  CHECK(watch.admits(*f.system, f.state.x().data()));
  f.state.x()[0] -= 0.02;
  CHECK(!watch.admits(*f.system, f.state.x().data()));
  CHECK_THROWS_WITH(watch.start(*f.system, f.state), Catch::Contains("crosses itself: its edge from vertex"));
}

}  // namespace pliant::test::self_crossing_test
