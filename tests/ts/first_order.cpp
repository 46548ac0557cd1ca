// Motion without inertia through TsIntegrator: ẋ = f(t, x).
#include <catch2/catch.hpp>

#include <pliant/ts/ts_integrator.h>

#include "support/order.h"
#include "support/problems.h"

namespace pliant::test::first_order_test {

namespace {

/// ẋ₀ = −x₁ + cos t, ẋ₁ = x₀ + sin t: a turn with a resonant drive. With z = x₀ + i x₁: ż = i z + e^{it},
/// z = (z₀ + t) e^{it}.
class DrivenTurn final : public FirstOrderSystem {
 public:
  std::size_t size() const override { return 2; }
  void rate(Real t, const Real* y, Real* ydot) override {
    ++evaluations;
    ydot[0] = -y[1] + std::cos(t);
    ydot[1] = y[0] + std::sin(t);
  }
  static State start() {
    State s(2, 1);
    s.x()[0] = 1;
    s.v()[0] = s.v()[1] = 7;  // not used
    return s;
  }
  static Real error(const State& s) {
    return std::hypot(s.x()[0] - (1 + s.t) * std::cos(s.t), s.x()[1] - (1 + s.t) * std::sin(s.t));
  }
  std::int64_t evaluations = 0;
};

}  // namespace

TEST_CASE("Runge–Kutta with fixed steps has its order without inertia") {
  const std::string table = GENERATE("4", "2a");
  const PetscOptionScope options("-ts_type rk -ts_rk_type " + table + " -ts_adapt_type none");
  require_order(
      "rk " + table,
      [](double h) {
        TsIntegrator integrator(TsOptions{.dt = h});
        DrivenTurn system;
        State state = DrivenTurn::start();
        integrator.run(system, state, 4, {});
        CHECK(state.v()[0] == 7);
        CHECK(integrator.statistics().steps == std::lround(4 / h));
        CHECK(integrator.statistics().force_evaluations == system.evaluations);
        return DrivenTurn::error(state);
      },
      0.25, table == "4" ? 4 : 2, 1e-12, 1);
}

TEST_CASE("adaptive steps without inertia keep the tolerance, and events restart them") {
  const PetscOptionScope options("-ts_type rk -ts_atol 1e-9");
  TsIntegrator integrator;
  DrivenTurn system;
  State state = DrivenTurn::start();
  bool turned = false;
  // At the first step after t = 1 the state is turned by a quarter about the origin, which only shifts z₀ + t.
  Real z_re = 0, z_im = 0, at = 0;
  integrator.run(system, state, 3, [&](State& s) {
    if (turned || s.t < 1) return AfterStep::proceed;
    turned = true;
    const Real x = s.x()[0];
    s.x()[0] = -s.x()[1];
    s.x()[1] = x;
    z_re = s.x()[0], z_im = s.x()[1], at = s.t;
    return AfterStep::changed;
  });
  REQUIRE(turned);
  CHECK(state.t == 3);
  // z(t) = z(at) e^{i(t−at)} + (t − at) e^{it}
  const Real s = state.t - at;
  const Real re = z_re * std::cos(s) - z_im * std::sin(s) + s * std::cos(state.t);
  const Real im = z_re * std::sin(s) + z_im * std::cos(s) + s * std::sin(state.t);
  CHECK(std::hypot(state.x()[0] - re, state.x()[1] - im) < 1e-7);
}

TEST_CASE("errors of motion without inertia") {
  SECTION("Verlet needs velocities") {
    const PetscOptionScope options("-ts_type verlet");
    TsIntegrator integrator;
    DrivenTurn system;
    State state = DrivenTurn::start();
    CHECK_THROWS_WITH(integrator.run(system, state, 1, {}), Catch::Contains("motion with inertia"));
  }
  SECTION("a velocity that is not finite is named") {
    const PetscOptionScope options("");
    TsIntegrator integrator;
    DrivenTurn system;
    State state = DrivenTurn::start();
    state.x()[0] = std::numeric_limits<Real>::quiet_NaN();
    CHECK_THROWS_WITH(integrator.run(system, state, 1, {}), Catch::Contains("the velocity of coordinate 1 is nan"));
  }
}

TEST_CASE("limits of stability of explicit methods on the real axis") {
  const auto limit = [](const std::string& options) {
    const PetscOptionScope scope(options + " -ts_adapt_type none");
    return TsIntegrator().longest_stable_step({.decay = 1});
  };
  CHECK(limit("-ts_type euler") == Approx(2));
  CHECK(limit("-ts_type rk -ts_rk_type 2a") == Approx(2));
  CHECK(limit("-ts_type rk -ts_rk_type 3bs") == Approx(2.5127453266));
  CHECK(limit("-ts_type rk -ts_rk_type 4") == Approx(2.7852935634));
  CHECK(limit("-ts_type ssp") == Approx(4 + 4 * std::pow(1.5, 0.2)));
  CHECK(limit("-ts_type ssp -ts_ssp_nstages 9") == Approx(8 + 8 * std::pow(1.25, 1.0 / 9)));
}

}  // namespace pliant::test::first_order_test
