// Limits of stability of explicit methods.
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include <pliant/ts/stability.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/problems.h"

namespace pliant::test::stability_test {

namespace {

Real limit(const std::string& options, const FastestRates& rates) {
  const PetscOptionScope scope(options + " -ts_adapt_type none");
  return TsIntegrator().longest_stable_step(rates);
}
Real on_imaginary_axis(const std::string& options) { return limit(options, {.oscillation = 1}); }

}  // namespace

TEST_CASE("undamped oscillations: the interval on the imaginary axis", "[stability]") {
  // |R(iy)| of orders 1 and 2 is above 1 from 0 on, and so it is of some methods of orders 5 to 7.
  CHECK(on_imaginary_axis("-ts_type euler") == 0);
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 1fe") == 0);
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 2a") == 0);
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 2b") == 0);
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 5f") == 0);
  CHECK(on_imaginary_axis("-ts_type ssp -ts_ssp_nstages 2") == 0);
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 3") == Approx(std::sqrt(3)));
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 3bs") == Approx(std::sqrt(3)));
  CHECK(on_imaginary_axis("-ts_type rk -ts_rk_type 4") == Approx(2 * std::sqrt(2)));
  CHECK(on_imaginary_axis("-ts_type arkode -ts_arkode_fixed_step -ts_arkode_table knoth_wolke") ==
        Approx(std::sqrt(3)));
  CHECK(on_imaginary_axis("-ts_type arkode -ts_arkode_fixed_step -ts_arkode_order 5") ==
        Approx(on_imaginary_axis("-ts_type rk -ts_rk_type 5dp")));
  CHECK(on_imaginary_axis("-ts_type verlet") == 2);
  CHECK(FixedStepVerlet(1).longest_stable_step({.oscillation = 4}) == 0.5);
}

TEST_CASE("steps of length y grow oscillations beyond the interval and not within", "[stability]") {
  // R is compared with steps of the method, which do not use the tableau.
  const auto grows = [](const std::string& type, Real y) {
    struct Turn final : SecondOrderSystem {
      std::size_t size() const override { return 1; }
      void acceleration(Real, const Real* x, const Real*, Real* a) override { a[0] = -x[0]; }
    } system;
    const PetscOptionScope scope("-ts_type rk -ts_adapt_type none -ts_rk_type " + type);
    TsIntegrator integrator({.dt = y});
    State state(1, 1);
    state.x()[0] = 1;
    integrator.run(system, state, 400 * y, true, {});
    return std::hypot(state.x()[0], state.v()[0]) > 1 + 1e-9;
  };
  for (const char* type : {"3", "3bs", "4", "5dp", "8vr"}) {
    INFO(type);
    const Real interval = on_imaginary_axis(std::string("-ts_type rk -ts_rk_type ") + type);
    CHECK(interval > 0);
    CHECK_FALSE(grows(type, 0.98 * interval));
    CHECK(grows(type, 1.02 * interval));
  }
  for (const char* type : {"1fe", "2a", "2b", "5f", "6vr", "7vr"}) {
    INFO(type);
    CHECK(on_imaginary_axis(std::string("-ts_type rk -ts_rk_type ") + type) == 0);
    CHECK(grows(type, 0.5));
  }
}

TEST_CASE("drag makes steps of order 1 and 2 stable", "[stability]") {
  // |1 + hλ|² = 1 − γh + ω²h² for euler; the slowest oscillation does not need a shorter step than the fastest.
  CHECK(limit("-ts_type euler", {.oscillation = 100, .drag = 0.5}) == Approx(0.5 / 1e4));
  // Overdamped: the interval on the real axis, of γ.
  CHECK(limit("-ts_type euler", {.oscillation = 0.1, .drag = 50}) == Approx(2.0 / 50).epsilon(1e-3));
  const Real light = limit("-ts_type rk -ts_rk_type 2a", {.oscillation = 100, .drag = 0.01}),
             heavy = limit("-ts_type rk -ts_rk_type 2a", {.oscillation = 100, .drag = 1});
  // γh/2 = (ωh)⁴/8.
  CHECK(light == Approx(std::cbrt(4 * 0.01 / 1e8)).epsilon(0.02));
  CHECK(light < heavy);
  CHECK(limit("-ts_type rk -ts_rk_type 4", {.oscillation = 100, .drag = 1e-3}) ==
        Approx(std::sqrt(8.0) / 100).epsilon(1e-3));
  CHECK(limit("-ts_type rk -ts_rk_type 4", {.oscillation = 1, .decay = 1000}) == Approx(2.7852935634e-3));
}

TEST_CASE("implicit methods and CVODE have no limit of stability", "[stability]") {
  for (const char* type :
       {"-ts_type beuler", "-ts_type alpha", "-ts_type cvode", "-ts_type arkode -ts_arkode_type dirk"})
    CHECK(std::isinf(limit(type, {.oscillation = 1, .decay = 1})));
}

}  // namespace pliant::test::stability_test
