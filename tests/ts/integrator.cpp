// Guarantees for scenarios: restarts, changes of the state between steps, stops, errors, options.
#include "support/order.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>

#include <pliant/base/errors.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/ts_verlet.h>
#include <pliant/ts/verlet.h>

#include "support/problems.h"

namespace pliant::test::integrator_test {
using Catch::Matchers::Contains;

namespace {

bool same_bits(std::span<const Real> a, std::span<const Real> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

std::unique_ptr<Integrator> make(const std::string& kind, Real h) {
  if (kind == "plain") return std::make_unique<FixedStepVerlet>(h);
  TsOptions o;
  o.dt = h;
  return std::make_unique<TsIntegrator>(o);
}

struct Strange : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace

TEST_CASE("a restart of the plain path continues bit for bit") {
  const Problem p = driven_chain();
  constexpr Real h = 0.013, t_end = 200 * h;
  FunctionSystem system = p.system();
  State whole = p.state();
  FixedStepVerlet verlet(h);
  verlet.run(system, whole, t_end, true, {});
  REQUIRE(whole.step == 200);
  CHECK(whole.t == 200 * h);

  for (const std::int64_t k : {1, 77, 199}) {
    State saved;
    FixedStepVerlet first(h), second(h);
    State s = p.state();
    first.run(system, s, t_end, true, [&](State& state) {
      if (state.step < k) return AfterStep::proceed;
      saved = state;
      return AfterStep::stop;
    });
    CHECK(s.step == k);
    CHECK(saved.t == static_cast<Real>(k) * h);
    second.set_carried(first.carried());
    second.run(system, saved, t_end, false, {});
    CHECK(second.statistics().force_evaluations == 200 - k);
    CHECK(saved.step == 200);
    CHECK(saved.t == whole.t);
    CHECK(same_bits(saved.x(), whole.x()));
    CHECK(same_bits(saved.v(), whole.v()));
    CHECK(same_bits(second.carried(), verlet.carried()));
  }
  // The carried prediction matters: its acceleration has seen a predicted velocity.
  State s = p.state();
  verlet.run(system, s, 77 * h, true, {});
  verlet.run(system, s, t_end, true, {});
  CHECK(!same_bits(s.v(), whole.v()));
}

TEST_CASE("a fixed step can change between runs") {
  const Problem p = driven_chain();
  FunctionSystem system = p.system();
  State s = p.state();
  FixedStepVerlet coarse(0.02), fine(0.005);
  coarse.run(system, s, 1, true, {});
  fine.run(system, s, 2, true, {});  // the carried prediction belongs to the old step
  CHECK(s.step == 250);
  CHECK(s.t == Approx(2).epsilon(1e-14));
  CHECK(error_of(s, p.exact(0, p.start, 2)) < 1e-3);
}

TEST_CASE("a state that the observer changes goes on as the exact piecewise solution") {
  struct Method {
    const char* options;
    double order;
    Real h;
  };
  const auto method =
      GENERATE(Method{"plain", 2, 0.05}, Method{"-ts_type verlet", 2, 0.05},
               Method{"-ts_type rk -ts_rk_type 2a", 2, 0.05}, Method{"-ts_type rk -ts_rk_type 3bs", 3, 0.05},
               Method{"-ts_type rk -ts_rk_type 5dp", 5, 0.2}, Method{"-ts_type rk -ts_rk_type 5bs", 5, 0.2},
               Method{"-ts_type rk -ts_rk_type 6vr", 6, 0.2}, Method{"-ts_type ssp -ts_ssp_type rk104", 4, 0.2});
  const Problem p = driven_chain();
  constexpr Real t_kick = 1.6, t_end = 4;
  Eigen::VectorXd kick = Eigen::VectorXd::Zero(8);
  kick << 0, 0.3, 0, 0, 1, 0, -2, 0.5;  // a jump of x and of v
  const Eigen::VectorXd exact = p.exact(t_kick, p.exact(0, p.start, t_kick) + kick, t_end);
  CHECK((exact - p.exact(0, p.start, t_end)).norm() > 0.5);

  require_order(
      std::string(method.options) + ", kicked",
      [&](Real h) {
        const bool plain = method.options == std::string("plain");
        const PetscOptionScope scope(plain ? "" : std::string(method.options) + " -ts_adapt_type none");
        const auto integrator = make(plain ? "plain" : "ts", h);
        FunctionSystem system = p.system();
        State s = p.state();
        const auto kick_step = std::llround(t_kick / h);
        int kicks = 0;
        integrator->run(system, s, t_end, true, [&](State& state) {
          if (state.step != kick_step) return AfterStep::proceed;
          CHECK(state.t == Approx(t_kick).epsilon(1e-12));
          for (std::size_t i = 0; i < 4; ++i) {
            state.x()[i] += kick[static_cast<Eigen::Index>(i)];
            state.v()[i] += kick[static_cast<Eigen::Index>(i) + 4];
          }
          ++kicks;
          return AfterStep::changed;
        });
        CHECK(kicks == 1);
        CHECK(integrator->statistics().steps == std::llround(t_end / h));
        return error_of(s, exact);
      },
      method.h, method.order);
}

TEST_CASE("kicks between adaptive steps are followed within the tolerance") {
  const auto table = GENERATE("3bs", "5f", "5dp", "5bs", "8vr");
  const auto adapt = GENERATE("basic", "dsp");
  const Problem p = driven_chain();
  const PetscOptionScope scope(
      fmt::format("-ts_rk_type {} -ts_adapt_type {} -ts_rtol 1e-9 -ts_atol 1e-9", table, adapt));
  TsIntegrator ts;
  FunctionSystem system = p.system();
  State s = p.state();
  Eigen::VectorXd y = p.start;
  Real t = 0;
  int kicks = 0;
  ts.run(system, s, 4, true, [&](State& state) {
    if (state.step % 5 != 0) return AfterStep::proceed;
    y = p.exact(t, y, state.t);
    t = state.t;
    for (Eigen::Index i = 0; i < 4; ++i) {
      const Real dv = 0.3 * std::cos(static_cast<Real>(state.step + i));
      state.v()[static_cast<std::size_t>(i)] += dv;
      y[4 + i] += dv;
    }
    ++kicks;
    return AfterStep::changed;
  });
  CHECK(kicks > 3);
  CHECK(error_of(s, p.exact(t, y, 4)) < 1e-6);
}

TEST_CASE("after a change the plain path carries the prediction of the changed state") {
  const Problem p = driven_chain();
  FunctionSystem system = p.system();
  State s = p.state();
  FixedStepVerlet verlet(0.01);
  verlet.run(system, s, 0.1, true, [](State& state) {
    if (state.step != 10) return AfterStep::proceed;
    state.v()[0] += 1;
    return AfterStep::changed;  // after the last step
  });
  std::vector<Real> a(4);
  system.acceleration(s.t, s.x().data(), s.v().data(), a.data());
  for (std::size_t i = 0; i < 4; ++i) CHECK(verlet.carried()[i] == Approx(s.v()[i] + 0.01 * a[i]).epsilon(1e-14));
}

TEST_CASE("the observer sees accepted states and stops a run") {
  const auto kind = GENERATE("plain", "ts");
  const Problem p = driven_chain();
  const auto integrator = make(kind, 0.01);
  FunctionSystem system = p.system();
  State s = p.state();
  std::int64_t calls = 0;
  Real t = 0;
  integrator->run(system, s, 100, true, [&](State& state) {
    CHECK(&state == &s);
    CHECK(state.step == ++calls);
    CHECK(state.t > t);
    t = state.t;
    CHECK(error_of(state, p.exact(0, p.start, state.t)) < 0.01);
    return state.step == 25 ? AfterStep::stop : AfterStep::proceed;
  });
  CHECK(calls == 25);
  CHECK(integrator->statistics().steps == 25);
  CHECK(s.t < 100);
  integrator->run(system, s, s.t + 0.1, false, {});  // and continues
  CHECK(s.t == Approx(t + 0.1).epsilon(1e-14));
  const auto steps = s.step;
  integrator->run(system, s, s.t, false, {});  // nothing left to do
  CHECK(s.step == steps);
}

TEST_CASE("an adaptive run ends at its time exactly, and chains keep their step") {
  const Problem p = driven_chain();
  FunctionSystem system = p.system();
  TsIntegrator whole, chain;
  State s = p.state();
  whole.run(system, s, 10, true, {});
  CHECK(s.t == 10);

  State c = p.state();
  for (int k = 1; k <= 8; ++k) {
    const Real t = 10.0 * k / 8;
    chain.run(system, c, t, k == 1, {});
    REQUIRE(c.t == t);
  }
  CHECK(chain.next_dt() > 0.5 * whole.next_dt());
  // One or two steps per piece: the piece's short last step does not shrink the next first one.
  CHECK(chain.statistics().steps < whole.statistics().steps + 2 * 8);
  CHECK(error_of(c, p.exact(0, p.start, 10)) < 1e-2);
}

TEST_CASE("after a cut run the first step is the controller's, not a rest") {
  const Problem p = driven_chain();
  FunctionSystem system = p.system();
  TsIntegrator ts;
  State s = p.state();
  ts.run(system, s, 5, true, {});
  const Real dt = ts.next_dt();
  ts.run(system, s, 5 + 1e-6, false, {});
  CHECK(ts.statistics().last_dt == Approx(1e-6).epsilon(1e-6));
  CHECK(ts.next_dt() == Approx(dt));
  ts.run(system, s, s.t + 1.003 * dt, false, {});  // a whole step and a rest
  CHECK(ts.statistics().last_dt == Approx(0.003 * dt).epsilon(1e-6));
  CHECK(ts.next_dt() == Approx(dt));
}

TEST_CASE("a first step that is far too long is rejected and counted") {
  const Problem p = driven_chain();
  FunctionSystem system = p.system();
  State s = p.state();
  TsOptions o;
  o.dt = 50;
  o.rtol = o.atol_x = o.atol_v = 1e-6;
  TsIntegrator ts(o);
  ts.run(system, s, 10, true, {});
  CHECK(ts.statistics().rejected >= 1);
  CHECK(ts.statistics().force_evaluations == system.evaluations);
  CHECK(ts.next_dt() < 1);
  CHECK(error_of(s, p.exact(0, p.start, 10)) < 1e-3);
}

TEST_CASE("exceptions of the system and of the observer arrive unchanged") {
  const auto options = GENERATE("plain", "-ts_type rk", "-ts_type verlet", "-ts_type euler", "-ts_type ssp");
  const bool plain = options == std::string("plain");
  const PetscOptionScope scope(plain ? "" : options);
  const auto integrator = make(plain ? "plain" : "ts", 0.01);
  const Problem p = driven_chain();
  FunctionSystem good = p.system();

  FunctionSystem throws(4, [&](Real t, const Real* x, const Real* v, Real* a) {
    if (t > 0.5) throw Strange("contact lost");
    p.function(t, x, v, a);
  });
  State s = p.state();
  REQUIRE_THROWS_AS(integrator->run(throws, s, 1, true, {}), Strange);
  s = p.state();
  REQUIRE_THROWS_WITH(integrator->run(throws, s, 1, true, {}), "contact lost");
  s = p.state();
  const StepObserver observer = [](State& state) -> AfterStep {
    if (state.t > 0.3) throw OutputError("disk full at step {}", state.step);
    return AfterStep::proceed;
  };
  REQUIRE_THROWS_AS(integrator->run(good, s, 1, true, observer), OutputError);
  s = p.state();
  REQUIRE_THROWS_WITH(integrator->run(good, s, 1, true, observer), Contains("disk full at step"));
  FunctionSystem numerical(4,
                           [](Real, const Real*, const Real*, Real*) { throw NumericalError("disk 3 left the box"); });
  s = p.state();
  REQUIRE_THROWS_WITH(integrator->run(numerical, s, 1, true, {}), "disk 3 left the box");  // nothing added
  // And the integrator still works.
  s = p.state();
  integrator->run(good, s, 1, true, {});
  CHECK(error_of(s, p.exact(0, p.start, 1)) < 0.05);
}

TEST_CASE("an acceleration that is not finite stops the run and is named") {
  const auto kind = GENERATE("plain", "ts");
  const auto bad = GENERATE(std::numeric_limits<Real>::quiet_NaN(), std::numeric_limits<Real>::infinity(),
                            -std::numeric_limits<Real>::infinity());
  const Problem p = driven_chain();
  FunctionSystem system(4, [&](Real t, const Real* x, const Real* v, Real* a) {
    p.function(t, x, v, a);
    if (t > 0.5) a[2] = bad;
  });
  const auto integrator = make(kind, 0.01);
  State s = p.state();
  REQUIRE_THROWS_AS(integrator->run(system, s, 1, true, {}), NumericalError);
  s = p.state();
  REQUIRE_THROWS_WITH(integrator->run(system, s, 1, true, {}), Contains("coordinate 2") && Contains("t = 0.5"));
}

TEST_CASE("large and small finite values are not mistaken for inf") {
  FunctionSystem system(2, [](Real, const Real*, const Real*, Real* a) {
    a[0] = std::numeric_limits<Real>::max() / 4, a[1] = -std::numeric_limits<Real>::denorm_min();
  });
  State s(2, 1);
  FixedStepVerlet verlet(1e-3);
  REQUIRE_NOTHROW(verlet.run(system, s, 0.01, true, {}));
}

TEST_CASE("a step that cannot succeed is a numerical error with its time") {
  // ẋ = x² blows up at t = 1; the step shrinks to nothing before.
  FunctionSystem system(1, [](Real, const Real*, const Real* v, Real* a) { a[0] = v[0] * v[0]; });
  State s(1, 1);
  s.v()[0] = 1;
  TsIntegrator ts;
  REQUIRE_THROWS_AS(ts.run(system, s, 2, true, {}), NumericalError);
  CHECK(s.t == Approx(1).epsilon(1e-2));
  s = State(1, 1);
  s.v()[0] = 1;
  REQUIRE_THROWS_WITH(ts.run(system, s, 2, true, {}), Contains("time step fell to") && Contains("at t = 0.99"));

  const PetscOptionScope scope("-ts_dt 1 -ts_max_reject 0 -ts_rtol 1e-12 -ts_atol 1e-12");
  const Problem p = driven_chain();
  FunctionSystem chain = p.system();
  TsIntegrator strict;
  s = p.state();
  const StepObserver never = [](State&) -> AfterStep { throw Strange("called for a step that failed"); };
  REQUIRE_THROWS_WITH(strict.run(chain, s, 10, true, never), Contains("after t = 0") && Contains("STEP_REJECTED"));
  CHECK(s.step == 0);
  const PetscOptionScope limit("-ts_max_steps 3");
  TsIntegrator limited;
  s = p.state();
  REQUIRE_THROWS_WITH(limited.run(chain, s, 10, true, {}), Contains("-ts_max_steps"));
  CHECK(s.step == 3);
}

TEST_CASE("an error of PETSc itself is reported with its time") {
  FunctionSystem system(1, [](Real t, const Real*, const Real*, Real* a) { a[0] = t < 0.5 ? 0 : 1e300; });
  State s(1, 1);
  TsIntegrator ts;
  REQUIRE_THROWS_AS(ts.run(system, s, 1, true, {}), NumericalError);
  s = State(1, 1);
  REQUIRE_THROWS_WITH(ts.run(system, s, 1, true, {}), Contains("failed in the step after t = 0.") && Contains("norm"));
}

TEST_CASE("options are read in the constructor and bad ones refused") {
  const auto message = [](const std::string& options) -> std::string {
    const PetscOptionScope scope(options);
    try {
      TsIntegrator ts;
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const char* types = "alpha, alpha2, arkimex, arkode, bdf, beuler, cn, cvode, euler, rk, rosw, ssp, theta, verlet";
  for (const char* type : {"basicsymplectic", "irk", "pseudo"}) {
    const std::string text = message(fmt::format("-ts_type {}", type));
    CHECK_THAT(text, Contains(type) && Contains(types));
  }
  CHECK_THAT(message("-ts_type rkk"), Contains("rkk is not known") && Contains(types));
  CHECK_THAT(message("-ts_rk_type 9zz"), Contains("9zz"));
  CHECK_THAT(message("-ts_adapt_type what"), Contains("what"));
  CHECK_THAT(message("-ts_max_time 3"), Contains("-ts_max_time"));
  CHECK_THAT(message("-ts_exact_final_time stepover"), Contains("-ts_exact_final_time"));
  CHECK_THAT(message("-ts_dt -1"), Contains("-ts_dt") && Contains("-1"));
  CHECK_THAT(message("-ts_dt abc"), Contains("abc"));
  CHECK_THAT(message("-ts_rtol -1e-3"), Contains("-ts_rtol"));
  CHECK_THAT(message("-ts_atol 0"), Contains("-ts_atol"));
  CHECK_THAT(message("-ts_rk_type 4 -ts_adapt_type basic"), Contains("rk 4") && Contains("error estimate"));
  CHECK_THAT(message("-ts_type ssp -ts_adapt_type basic"), Contains("ssp") && Contains("error estimate"));
  CHECK(message("-ts_type ssp").empty());

  const PetscOptionScope scope("-ts_type rk -ts_rk_type 3bs -ts_adapt_type basic -ts_rtol 1e-5 -ts_monitor_cancel");
  TsIntegrator ts;
  CHECK(ts.name() == "ts:rk 3bs");
  PetscInt unused = -1;
  petsc_check(PetscOptionsAllUsed(nullptr, &unused));
  CHECK(unused == 0);
}

TEST_CASE("-ts_monitor works") {
  const std::string file = (std::filesystem::temp_directory_path() / "pliant_ts_monitor.txt").string();
  std::filesystem::remove(file);
  const Problem p = kepler();
  FunctionSystem system = p.system();
  State s = p.state();
  {
    const PetscOptionScope scope("-ts_type euler -ts_dt 0.25 -ts_monitor ascii:" + file);
    TsIntegrator ts;
    ts.run(system, s, 1, true, {});
  }
  std::ifstream in(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  REQUIRE(lines.size() == 5);
  CHECK_THAT(lines[4], Contains("4 TS dt 0.25 time 1."));
  std::filesystem::remove(file);
}

TEST_CASE("the name says which method ran") {
  CHECK(TsIntegrator().name() == "ts:rk 5dp");
  CHECK(FixedStepVerlet(1).name() == "verlet");
  const PetscOptionScope scope("-ts_type verlet");
  CHECK(TsIntegrator().name() == "ts:verlet");
}

TEST_CASE("wrong sizes and steps are refused") {
  const Problem p = kepler();
  FunctionSystem system = p.system();
  State s(3, 1);
  FixedStepVerlet verlet(0.1);
  CHECK_THROWS_AS(verlet.run(system, s, 1, true, {}), InputError);
  CHECK_THROWS_AS(TsIntegrator().run(system, s, 1, true, {}), InputError);
  CHECK_THROWS_AS(FixedStepVerlet(0), InputError);
  CHECK_THROWS_AS(FixedStepVerlet(-1), InputError);
  CHECK_THROWS_AS(FixedStepVerlet(std::numeric_limits<Real>::quiet_NaN()), InputError);
}

TEST_CASE("one TS integrator serves systems of different sizes") {
  TsIntegrator ts;
  for (const Problem& p : {kepler(), driven_chain(), manufactured()}) {
    FunctionSystem system = p.system();
    State s = p.state();
    ts.run(system, s, 2, true, {});
    CHECK(error_of(s, p.exact(0, p.start, 2)) < 1e-2);
  }
}

namespace {

PetscErrorCode oscillator(TS, PetscReal, ::Vec y, ::Vec f, void* count) {
  const PetscScalar* in;
  PetscScalar* out;
  PetscFunctionBegin;
  ++*static_cast<int*>(count);
  PetscCall(VecGetArrayRead(y, &in));
  PetscCall(VecGetArrayWrite(f, &out));
  out[0] = in[1];
  out[1] = -in[0] - 0.1 * in[1];
  PetscCall(VecRestoreArrayWrite(f, &out));
  PetscCall(VecRestoreArrayRead(y, &in));
  PetscFunctionReturn(0);
}

Eigen::Vector2d oscillator_exact(Real t) {
  Eigen::Matrix2d m;
  m << 0, 1, -1, -0.1;
  return (m * t).exp() * Eigen::Vector2d(1, 0.5);
}

struct BareTs {
  explicit BareTs(Real h, PetscInt n = 2) {
    petsc_check(ts_verlet_register());
    petsc_check(TSCreate(PETSC_COMM_SELF, ts.out()));
    petsc_check(TSSetProblemType(ts, TS_NONLINEAR));
    petsc_check(VecCreateSeq(PETSC_COMM_SELF, n, y.out()));
    petsc_check(VecSetValue(y, 0, 1, INSERT_VALUES));
    petsc_check(VecSetValue(y, 1, 0.5, INSERT_VALUES));
    petsc_check(VecAssemblyBegin(y));
    petsc_check(VecAssemblyEnd(y));
    petsc_check(TSSetSolution(ts, y));
    petsc_check(TSSetRHSFunction(ts, nullptr, oscillator, &evaluations));
    petsc_check(TSSetType(ts, ts_verlet));
    petsc_check(TSSetTimeStep(ts, h));
    petsc_check(TSSetMaxTime(ts, 100));
    petsc_check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  }
  Eigen::Vector2d solution() const { return values(y); }
  static Eigen::Vector2d values(::Vec vec) {
    const PetscScalar* v;
    petsc_check(VecGetArrayRead(vec, &v));
    Eigen::Vector2d out(v[0], v[1]);
    petsc_check(VecRestoreArrayRead(vec, &v));
    return out;
  }
  int evaluations = 0;
  PetscVec y;
  PetscTs ts;
};

}  // namespace

TEST_CASE("TS verlet interpolates within a step at order 2 or better") {
  require_order(
      "dense output",
      [](Real h) {
        BareTs bare(h);
        PetscVec at;
        petsc_check(VecDuplicate(bare.y, at.out()));
        double worst = 0;
        for (int step = 0; step < std::lround(4 / h); ++step) {
          PetscReal begin = 0, end = 0;
          petsc_check(TSStep(bare.ts));
          petsc_check(TSGetPrevTime(bare.ts, &begin));
          petsc_check(TSGetTime(bare.ts, &end));
          for (const Real s : {0.0, 0.3, 0.7, 1.0}) {
            const Real t = s < 1 ? begin + s * (end - begin) : end;
            petsc_check(TSInterpolate(bare.ts, t, at));
            worst = std::max(worst, (BareTs::values(at) - oscillator_exact(t)).norm());
          }
        }
        return worst;
      },
      0.1, 2);
  // Between the ends the interpolation adds far less than the method's error.
  BareTs bare(0.1);
  PetscVec at;
  petsc_check(VecDuplicate(bare.y, at.out()));
  petsc_check(TSStep(bare.ts));
  petsc_check(TSInterpolate(bare.ts, 0.05, at));
  CHECK((BareTs::values(at) - oscillator_exact(0.05)).norm() < 2 * (bare.solution() - oscillator_exact(0.1)).norm());
}

TEST_CASE("TS verlet rolls back and starts the step anew") {
  BareTs bare(0.1);
  petsc_check(TSStep(bare.ts));
  CHECK(bare.evaluations == 2);
  const Eigen::Vector2d first = bare.solution();
  petsc_check(TSStep(bare.ts));
  CHECK(bare.evaluations == 3);
  petsc_check(TSRollBack(bare.ts));
  CHECK(bare.solution() == first);
  petsc_check(TSStep(bare.ts));
  CHECK(bare.evaluations == 5);  // the carried acceleration is dropped
  petsc_check(TSRestartStep(bare.ts));
  petsc_check(TSStep(bare.ts));
  CHECK(bare.evaluations == 7);
  CHECK((bare.solution() - oscillator_exact(0.3)).norm() < 1e-2);
}

TEST_CASE("TS verlet refuses what it cannot solve") {
  BareTs odd(0.1, 3);
  CHECK_THROWS_WITH(petsc_check(TSStep(odd.ts)), Contains("is odd"));
  PetscTs ts;
  PetscVec y;
  petsc_check(TSCreate(PETSC_COMM_SELF, ts.out()));
  petsc_check(VecCreateSeq(PETSC_COMM_SELF, 2, y.out()));
  petsc_check(TSSetSolution(ts, y));
  petsc_check(TSSetType(ts, ts_verlet));
  CHECK_THROWS_WITH(petsc_check(TSSetUp(ts)), Contains("right-hand side"));
}

}  // namespace pliant::test::integrator_test
