// Every method converges at its order, on a linear and on nonlinear problems whose forces depend on the velocity.
#include "support/order.h"
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/ts_verlet.h>
#include <pliant/ts/verlet.h>
#include <catch2/catch.hpp>

#include "support/problems.h"

namespace pliant::test::order_test {

namespace {

constexpr Real t_end = 4;

double error_after(Integrator& integrator, const Problem& p) {
  FunctionSystem system = p.system();
  State s = p.state();
  integrator.run(system, s, t_end, true, {});
  CHECK(s.t == Approx(t_end).epsilon(1e-12));
  return error_of(s, p.exact(0, p.start, t_end));
}

double ts_error(const std::string& options, const Problem& p, Real h) {
  const PetscOptionScope scope(options + " -ts_adapt_type none");
  TsOptions o;
  o.dt = h;
  TsIntegrator ts(o);
  const double error = error_after(ts, p);
  CHECK(ts.statistics().steps == std::llround(t_end / h));  // a fixed step really
  return error;
}

}  // namespace

TEST_CASE("the plain velocity Verlet is of order 2") {
  for (const Problem& p : {driven_chain(), manufactured(), kepler()})
    require_order(
        p.name,
        [&](Real h) {
          FixedStepVerlet verlet(h);
          return error_after(verlet, p);
        },
        0.05, 2);
}

TEST_CASE("TS types converge at their order") {
  struct Method {
    const char* options;
    double order;
    Real h;
  };
  const auto method =
      GENERATE(Method{"-ts_type verlet", 2, 0.05}, Method{"-ts_type euler", 1, 0.002},
               Method{"-ts_type rk -ts_rk_type 1fe", 1, 0.002}, Method{"-ts_type rk -ts_rk_type 2a", 2, 0.05},
               Method{"-ts_type rk -ts_rk_type 2b", 2, 0.05}, Method{"-ts_type rk -ts_rk_type 3", 3, 0.05},
               Method{"-ts_type rk -ts_rk_type 3bs", 3, 0.05}, Method{"-ts_type rk -ts_rk_type 4", 4, 0.1},
               Method{"-ts_type rk -ts_rk_type 5f", 5, 0.1}, Method{"-ts_type rk -ts_rk_type 5dp", 5, 0.1},
               Method{"-ts_type rk -ts_rk_type 5bs", 5, 0.2}, Method{"-ts_type rk -ts_rk_type 6vr", 6, 0.2},
               Method{"-ts_type rk -ts_rk_type 7vr", 7, 0.5}, Method{"-ts_type rk -ts_rk_type 8vr", 8, 0.8},
               Method{"-ts_type ssp -ts_ssp_type rks2", 2, 0.1}, Method{"-ts_type ssp -ts_ssp_type rks3", 3, 0.1},
               Method{"-ts_type ssp -ts_ssp_type rk104", 4, 0.2});
  for (const Problem& p : {driven_chain(), manufactured(), kepler()})
    require_order(
        p.name + ", " + method.options, [&](Real h) { return ts_error(method.options, p, h); }, method.h, method.order);
}

TEST_CASE("the error of an adaptive method falls with its tolerance") {
  const auto table = GENERATE("2a", "3bs", "5f", "5dp", "5bs", "6vr", "7vr", "8vr");
  const auto adapt = GENERATE("basic", "dsp");
  const Problem p = driven_chain();
  std::vector<double> errors;
  std::vector<std::int64_t> steps;
  for (const char* tolerance : {"1e-3", "1e-5", "1e-7"}) {
    const PetscOptionScope scope(fmt::format("-ts_type rk -ts_rk_type {} -ts_adapt_type {} -ts_rtol {} -ts_atol {}",
                                             table, adapt, tolerance, tolerance));
    TsIntegrator ts;
    errors.push_back(error_after(ts, p));
    steps.push_back(ts.statistics().steps);
  }
  INFO(table << ' ' << adapt << ": errors " << errors[0] << ' ' << errors[1] << ' ' << errors[2] << ", steps "
             << steps[0] << ' ' << steps[1] << ' ' << steps[2]);
  CHECK(errors[1] < errors[0] / 5);
  CHECK(errors[2] < errors[1] / 5);
  CHECK(errors[2] < 1e-4);
  CHECK(steps[2] > steps[0]);
}

TEST_CASE("separate tolerances for positions and velocities") {
  const Problem p = driven_chain();
  const auto steps = [&](Real atol_x, Real atol_v, Real rtol) {
    TsOptions o;
    o.atol_x = atol_x, o.atol_v = atol_v, o.rtol = rtol;
    TsIntegrator ts(o);
    (void)error_after(ts, p);
    return ts.statistics().steps;
  };
  const auto loose = steps(1e-2, 1e-2, 1e-12);
  CHECK(steps(1e-8, 1e-2, 1e-12) > 2 * loose);
  CHECK(steps(1e-2, 1e-8, 1e-12) > 2 * loose);
  CHECK(steps(1e-8, 1e-8, 1e-1) > 2 * loose);  // rtol does not loosen the positions
}

TEST_CASE("Verlet as a plain loop and as a TS type are one method") {
  for (const Problem& p : {driven_chain(), manufactured(), kepler()}) {
    constexpr Real h = 0.0625;  // times exact in binary, so that both see the same t
    FunctionSystem a = p.system(), b = p.system();
    State plain = p.state(), ts = p.state();
    FixedStepVerlet verlet(h);
    verlet.run(a, plain, t_end, true, {});
    TsOptions o;
    o.type = ts_verlet, o.dt = h;
    TsIntegrator integrator(o);
    integrator.run(b, ts, t_end, true, {});
    CHECK(plain.step == 64);
    CHECK(ts.step == 64);
    CHECK(a.evaluations == 65);  // one per step and one to start
    CHECK(b.evaluations == 65);
    CHECK(verlet.statistics().force_evaluations == 65);
    CHECK(integrator.statistics().force_evaluations == 65);
    CHECK((y_of(plain) - y_of(ts)).lpNorm<Eigen::Infinity>() < 1e-14);
  }
}

TEST_CASE("Verlet conserves the energy of a conservative system for long times") {
  const Problem p = kepler();
  const auto energy = [](const State& s) {
    return 0.5 * (square(s.v()[0]) + square(s.v()[1])) - 1 / std::hypot(s.x()[0], s.x()[1]);
  };
  const auto worst = [&](Integrator& integrator, Real until) {
    FunctionSystem system = p.system();
    State s = p.state();
    const Real start = energy(s);
    Real largest = 0;
    integrator.run(system, s, until, true, [&](State& state) {
      largest = std::max(largest, std::abs(energy(state) - start));
      return AfterStep::proceed;
    });
    return largest;
  };
  constexpr Real h = 0.05, period = 2 * pi;
  TsOptions o;
  o.type = ts_verlet, o.dt = h;
  FixedStepVerlet plain_short(h), plain_long(h);
  TsIntegrator ts_short(o), ts_long(o);
  const Real one = worst(plain_short, period);
  CHECK(one > 1e-5);  // not exact: the bound below is significant
  CHECK(worst(plain_long, 500 * period) < 1.5 * one);
  CHECK(worst(ts_long, 500 * period) < 1.5 * worst(ts_short, period));
  // The test is sensitive: a method of the same order drifts far beyond.
  const PetscOptionScope scope("-ts_type rk -ts_rk_type 2a -ts_adapt_type none -ts_dt 0.05");
  TsIntegrator heun_short, heun_long;
  CHECK(worst(heun_long, 500 * period) > 10 * worst(heun_short, period));
}

TEST_CASE("Verlet with linear damping alone is stable up to rate times step 1") {
  const auto after = [](Real rate) {
    FunctionSystem system(1, [=](Real, const Real*, const Real* v, Real* a) { a[0] = -rate * v[0]; });
    State s(1, 1);
    s.v()[0] = 1;
    FixedStepVerlet verlet(1);
    verlet.run(system, s, 2000, true, {});
    return std::abs(s.v()[0]);
  };
  CHECK(after(0.98) < 1e-6);
  CHECK(after(1.02) > 1e6);
}

TEST_CASE("velocity Verlet with a controlled step: its error follows the tolerance") {
  const Problem p = driven_chain();
  const Real t_end = 3;
  const Eigen::VectorXd exact = p.exact(0, p.start, t_end);
  std::vector<Real> errors;
  std::vector<std::int64_t> steps;
  for (const Real tolerance : {1e-2, 1e-3, 1e-4, 1e-5}) {
    const PetscOptionScope scope("-ts_type verlet -ts_adapt_type basic");
    TsOptions o;
    o.dt = 0.1, o.rtol = o.atol_x = o.atol_v = tolerance;
    TsIntegrator ts(o);
    FunctionSystem system = p.system();
    State s = p.state();
    ts.run(system, s, t_end, true, {});
    errors.push_back(error_of(s, exact));
    steps.push_back(ts.statistics().steps);
    // A rejected step costs one evaluation, an accepted one another.
    CHECK(ts.statistics().force_evaluations == 1 + ts.statistics().steps + ts.statistics().rejected);
  }
  // The estimate is of second order in the step, the error of the method too: both fall alike.
  for (std::size_t k = 1; k < errors.size(); ++k) {
    INFO(errors[k - 1] << " -> " << errors[k] << ", steps " << steps[k - 1] << " -> " << steps[k]);
    CHECK(errors[k] < errors[k - 1] / 4);
    CHECK(errors[k] > errors[k - 1] / 30);
    CHECK(steps[k] > 2 * steps[k - 1]);
  }
}

}  // namespace pliant::test::order_test
