// TS type cvode: against exact and reference solutions, and as a good citizen of TS.
#include <catch2/catch.hpp>

#include <limits>

#include "problems.h"
#include "solver.h"

namespace pliant::test::cvode_test {
using namespace problems;
using Catch::Matchers::Contains;

namespace {

Solver kepler(TSRHSFunction rhs = Kepler::rhs, void* context = nullptr) {
  const auto start = Kepler::exact(0);
  return {{start.begin(), start.end()}, rhs, context};
}

// y' = f with counted calls, and failures on request.
struct Decay {
  int calls = 0;
  int fail_at_call = std::numeric_limits<int>::max();
  double singular_at = std::numeric_limits<double>::infinity();  // NaN beyond this time
  PetscErrorCode code = PETSC_ERR_FP;
  static PetscErrorCode rhs(TS, PetscReal t, Vec y, Vec f, void* context) {
    auto& self = *static_cast<Decay*>(context);
    PetscFunctionBegin;
    if (++self.calls >= self.fail_at_call) return self.code;
    PetscCall(VecCopy(y, f));
    PetscCall(VecScale(f, t > self.singular_at ? std::numeric_limits<double>::quiet_NaN() : -1));
    PetscFunctionReturn(0);
  }
};

// y' = 1/(1 − t): no solution beyond t = 1.
PetscErrorCode pole(TS, PetscReal t, Vec, Vec f, void*) {
  PetscFunctionBegin;
  PetscCall(VecSet(f, 1 / (1 - t)));
  PetscFunctionReturn(0);
}

// Slope of log(error) over log(tolerance).
double slope(const std::vector<double>& tolerance, const std::vector<double>& error) {
  double x = 0, y = 0, xx = 0, xy = 0;
  const auto n = static_cast<double>(error.size());
  for (std::size_t i = 0; i < error.size(); ++i) {
    const double a = std::log(tolerance[i]), b = std::log(error[i]);
    x += a, y += b, xx += a * a, xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

}  // namespace

TEST_CASE("errors fall in proportion to the tolerance") {
  const std::string type = GENERATE("adams", "bdf");
  std::vector<double> tols, errors;
  for (const double tol : {1e-5, 1e-6, 1e-7, 1e-8, 1e-9}) {
    Solver s = kepler();
    s.configure("-ts_type cvode -ts_dt 1e-3 -ts_cvode_type " + type + " " + tolerances(tol));
    CHECK(s.solve(Kepler::period) == TS_CONVERGED_TIME);
    CHECK(s.time() == Kepler::period);
    tols.push_back(tol);
    errors.push_back(distance(s.values(), Kepler::exact(0)));
    INFO(type << " tolerance " << tol << " error " << errors.back() << " steps " << s.steps());
    // Local errors of one tolerance per step, some hundred steps, growth like t² in phase.
    CHECK(errors.back() < 2000 * tol);
  }
  INFO(type << " slope " << slope(tols, errors));
  CHECK(slope(tols, errors) > 0.75);
  CHECK(slope(tols, errors) < 1.25);
}

TEST_CASE("a tight solution agrees with rk 5dp") {
  std::vector<std::vector<double>> ends;
  for (const std::string o : {"-ts_type rk -ts_rk_type 5dp", "-ts_type cvode -ts_cvode_type adams", "-ts_type cvode"}) {
    Solver s = kepler();
    s.configure(o + " -ts_dt 1e-3 " + tolerances(1e-12));
    s.solve(5);
    ends.push_back(s.values());
    CHECK(distance(ends.back(), Kepler::exact(5)) < 1e-8);
  }
}

TEST_CASE("a stiff problem, by every solver") {
  struct Way {
    const char* options;
    bool jacobian;
  };
  const Way way =
      GENERATE(Way{"", true}, Way{"-ksp_type preonly -pc_type lu", true}, Way{"-pc_type none", true},
               Way{"-ts_cvode_linear spgmr", false}, Way{"-ts_cvode_nonlinear snes", true},
               Way{"-ts_cvode_nonlinear snes -snes_mf", false}, Way{"-ts_cvode_nonlinear snes -snes_mf_operator", true},
               Way{"-ts_cvode_nonlinear snes -snes_type newtontr", true});
  VanDerPol problem;
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  s.use_jacobian(VanDerPol::jacobian, &problem);
  s.configure(std::string("-ts_type cvode -ts_dt 1e-6 -ts_max_steps 10000 ") + way.options + " " + tolerances(1e-7));
  const TSConvergedReason reason = s.solve(VanDerPol::t_end);
  INFO(way.options << ": error " << distance(s.values(), VanDerPol::reference) << " steps " << s.steps() << " rhs "
                   << problem.rhs_calls << " Jacobians " << problem.jacobian_calls);
  CHECK(reason == TS_CONVERGED_TIME);
  CHECK(distance(s.values(), VanDerPol::reference) < 2e-5);
  CHECK((problem.jacobian_calls > 0) == way.jacobian);
  CHECK(problem.rhs_calls < 20000);  // an explicit method needs a million
}

TEST_CASE("CVODE's Newton keeps the Jacobian for many steps") {
  VanDerPol problem;
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  s.use_jacobian(VanDerPol::jacobian, &problem);
  s.configure("-ts_type cvode -ts_dt 1e-6 " + tolerances(1e-7));
  s.solve(VanDerPol::t_end);
  CHECK(problem.jacobian_calls * 10 < s.steps());
}

TEST_CASE("a Jacobian in shift form") {
  VanDerPol problem;
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  PetscInt n = 2;
  petsc_check(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, n, nullptr, s.jacobian.out()));
  const auto shifted = [](TS ts, PetscReal t, Vec y, Vec, PetscReal shift, Mat a, Mat p, void* context) {
    PetscFunctionBegin;
    PetscCall(VanDerPol::jacobian(ts, t, y, a, p, context));
    PetscCall(MatScale(p, -1));
    PetscCall(MatShift(p, shift));
    PetscFunctionReturn(0);
  };
  petsc_check(TSSetIJacobian(s.ts, s.jacobian, s.jacobian, shifted, &problem));
  s.configure("-ts_type cvode -ts_dt 1e-6 " + tolerances(1e-7));
  s.solve(VanDerPol::t_end);
  CHECK(problem.jacobian_calls > 0);
  CHECK(problem.jacobian_calls * 10 < s.steps());
  CHECK(distance(s.values(), VanDerPol::reference) < 2e-5);
}

TEST_CASE("Anderson acceleration lets fixedpoint converge") {
  int calls[2];
  for (const int m : {0, 3}) {
    VanDerPol problem{.epsilon = 0.02};
    Solver s({2, 0}, VanDerPol::rhs, &problem);
    s.configure(fmt::format("-ts_type cvode -ts_cvode_nonlinear fixedpoint -ts_dt 1e-6 -ts_cvode_anderson {} ", m) +
                tolerances(1e-5));
    s.solve(2);
    calls[m > 0] = problem.rhs_calls;
  }
  CHECK(calls[1] < calls[0]);
}

TEST_CASE("a solution that one rank alone changes", "[ranks]") {
  DM dm = nullptr;
  petsc_check(Brusselator::dm_create(PETSC_COMM_WORLD, 16, &dm));
  PetscMPIInt rank;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  const auto decay = [](TS, PetscReal, Vec y, Vec f, void*) {
    petsc_check(VecCopy(y, f));
    petsc_check(VecScale(f, -1));
    return PetscErrorCode(0);
  };
  Solver s(dm, decay, nullptr);
  petsc_check(VecSet(s.y, 1));
  petsc_check(TSSetPostStep(s.ts, [](TS ts) {
    Vec y;
    PetscScalar* values;
    PetscInt step;
    PetscMPIInt here;
    MPI_Comm_rank(PETSC_COMM_WORLD, &here);
    petsc_check(TSGetStepNumber(ts, &step));
    if (step != 5 || here != 0) return PetscErrorCode(0);
    petsc_check(TSGetSolution(ts, &y));
    petsc_check(VecGetArray(y, &values));
    values[0] *= 2;
    petsc_check(VecRestoreArray(y, &values));
    return PetscErrorCode(0);
  }));
  s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-3 " + tolerances(1e-8));
  CHECK(s.solve(1) == TS_CONVERGED_TIME);
  const std::vector<double> y = s.values();
  CHECK(y[0] == Approx((rank == 0 ? 2 : 1) * std::exp(-1)).epsilon(1e-6));
  CHECK(y[1] == Approx(std::exp(-1)).epsilon(1e-6));
  petsc_check(DMDestroy(&dm));
}

TEST_CASE("the Brusselator on all ranks agrees with rk 5dp", "[ranks]") {
  DM dm = nullptr;
  petsc_check(Brusselator::dm_create(PETSC_COMM_WORLD, 64, &dm));
  const auto solve = [&](const std::string& options) {
    Solver s(dm, Brusselator::rhs, nullptr);
    Mat a = nullptr;
    petsc_check(Brusselator::initial(dm, s.y));
    petsc_check(DMCreateMatrix(dm, &a));
    petsc_check(TSSetRHSJacobian(s.ts, a, a, Brusselator::jacobian, nullptr));
    petsc_check(MatDestroy(&a));
    s.configure(options);
    CHECK(s.solve(4) == TS_CONVERGED_TIME);
    return s.values();
  };
  const std::vector<double> reference = solve("-ts_type rk -ts_rk_type 5dp -ts_dt 1e-3 " + tolerances(1e-10));
  for (const std::string options :
       {"", "-pc_type asm", "-ts_cvode_linear spgmr", "-ts_cvode_nonlinear snes", "-ts_cvode_nonlinear snes -snes_mf",
        "-ts_cvode_type adams -ts_cvode_nonlinear newton", "-ts_cvode_type adams"}) {
    const std::vector<double> y = solve("-ts_type cvode -ts_dt 1e-3 " + options + " " + tolerances(1e-7));
    INFO(options);
    CHECK(distance(y, reference) < 2e-5);
  }
  petsc_check(DMDestroy(&dm));
}

TEST_CASE("events: bounces at the right times") {
  const std::string type = GENERATE("adams", "bdf");
  Bounce problem;
  Solver s({1, 0}, Bounce::rhs, &problem);
  PetscInt direction = 0;
  PetscBool terminate = PETSC_FALSE;
  petsc_check(TSSetEventHandler(s.ts, 1, &direction, &terminate, Bounce::event, Bounce::bounce, &problem));
  s.configure("-ts_type cvode -ts_dt 1e-2 -ts_event_tol 1e-9 -ts_cvode_type " + type + " " + tolerances(1e-9));
  CHECK(s.solve(10) == TS_CONVERGED_TIME);
  CHECK(s.time() == 10);
  REQUIRE(problem.times.size() >= 5);
  for (std::size_t i = 0; i < problem.times.size(); ++i) {
    INFO(type << " bounce " << i);
    CHECK(problem.times[i] == Approx(Bounce::exact_time(static_cast<int>(i))).margin(1e-5));
  }
  CHECK(Bounce::exact_time(static_cast<int>(problem.times.size())) > 10);  // none is missing
  CHECK(distance(s.values(), Bounce::exact(10)) < 1e-5);
}

TEST_CASE("events that change nothing do not disturb CVODE") {
  int calls[2];
  for (const bool watch : {false, true}) {
    struct Count {
      int calls = 0;
      std::vector<double> times;
    } count;
    Solver s = kepler(
        [](TS ts, PetscReal t, Vec y, Vec f, void* context) {
          ++static_cast<Count*>(context)->calls;
          return Kepler::rhs(ts, t, y, f, nullptr);
        },
        &count);
    PetscInt direction = 0;
    PetscBool terminate = PETSC_FALSE;
    const auto record = [](TS, PetscInt, PetscInt[], PetscReal t, Vec, PetscBool, void* context) {
      PetscFunctionBegin;
      static_cast<Count*>(context)->times.push_back(t);
      PetscFunctionReturn(0);
    };
    if (watch)  // x = 0 twice per revolution
      petsc_check(TSSetEventHandler(s.ts, 1, &direction, &terminate, Bounce::event, record, &count));
    s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-2 -ts_event_tol 1e-8 " + tolerances(1e-9));
    s.solve(2 * Kepler::period);
    CHECK(distance(s.values(), Kepler::exact(0)) < 1e-5);
    calls[watch] = count.calls;
    if (!watch) continue;
    REQUIRE(count.times.size() == 4);
    for (const double t : count.times) CHECK(std::abs(Kepler::exact(t)[0]) < 1e-6);
  }
  CHECK(calls[0] == calls[1]);
}

TEST_CASE("an event can end the solve") {
  Bounce problem;
  Solver s({1, 0}, Bounce::rhs, &problem);
  PetscInt direction = 0;
  PetscBool terminate = PETSC_TRUE;
  petsc_check(TSSetEventHandler(s.ts, 1, &direction, &terminate, Bounce::event, nullptr, &problem));
  s.configure("-ts_type cvode -ts_dt 1e-2 -ts_event_tol 1e-9 " + tolerances(1e-9));
  CHECK(s.solve(10) == TS_CONVERGED_EVENT);
  CHECK(s.time() == Approx(Bounce::exact_time(0)).margin(1e-7));
}

TEST_CASE("a time span comes from the dense output") {
  std::vector<double> times{0, 0.1, 0.2, 1, 1.0001, 2.5, 3, 4};
  int calls[2];
  for (const bool spans : {false, true}) {
    Decay count{};
    Solver s = kepler(
        [](TS ts, PetscReal t, Vec y, Vec f, void* context) {
          ++static_cast<Decay*>(context)->calls;
          return Kepler::rhs(ts, t, y, f, nullptr);
        },
        &count);
    if (spans) petsc_check(TSSetTimeSpan(s.ts, static_cast<PetscInt>(times.size()), times.data()));
    s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-2 " + tolerances(1e-9));
    s.solve(4);
    calls[spans] = count.calls;
    if (!spans) continue;
    PetscInt n = 0;
    Vec* solutions = nullptr;
    petsc_check(TSGetTimeSpanSolutions(s.ts, &n, &solutions));
    REQUIRE(n == static_cast<PetscInt>(times.size()));
    for (PetscInt i = 0; i < n; ++i) {
      INFO("t = " << times[i]);
      CHECK(distance(s.values(solutions[i]), Kepler::exact(times[i])) < 1e-6);
    }
  }
  CHECK(calls[0] == calls[1]);
}

TEST_CASE("the three ways to end, and interpolation within a step") {
  const TSExactFinalTimeOption mode =
      GENERATE(TS_EXACTFINALTIME_MATCHSTEP, TS_EXACTFINALTIME_STEPOVER, TS_EXACTFINALTIME_INTERPOLATE);
  Solver s = kepler();
  s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-2 " + tolerances(1e-9));
  petsc_check(TSSetExactFinalTime(s.ts, mode));
  struct Middle {
    double worst = 0, before = 0, promised = 0;
    int steps = 0, kept = 0;
  } middle;
  petsc_check(TSSetApplicationContext(s.ts, &middle));
  petsc_check(TSSetPostStep(s.ts, [](TS ts) {
    Middle* m;
    pliant::PetscVec u;
    Vec y;
    PetscReal t, h;
    const PetscScalar* in;
    PetscFunctionBegin;
    PetscCall(TSGetApplicationContext(ts, &m));
    PetscCall(TSGetSolution(ts, &y));
    PetscCall(VecDuplicate(y, u.out()));
    PetscCall(TSGetTime(ts, &t));
    PetscCall(TSInterpolate(ts, (m->before + t) / 2, u));
    PetscCall(VecGetArrayRead(u, &in));
    m->worst = std::max(m->worst, distance(Kepler::exact((m->before + t) / 2), std::vector<double>(in, in + 4)));
    PetscCall(VecRestoreArrayRead(u, &in));
    PetscCall(TSGetTimeStep(ts, &h));
    ++m->steps;
    if (std::abs(t - m->before - m->promised) < 1e-9 * h) ++m->kept;
    m->promised = h;
    m->before = t;
    PetscFunctionReturn(0);
  }));
  CHECK(s.solve(5) == TS_CONVERGED_TIME);
  PetscReal end;
  petsc_check(TSGetSolveTime(s.ts, &end));
  if (mode == TS_EXACTFINALTIME_STEPOVER)
    CHECK(end > 5);
  else
    CHECK(end == 5);
  CHECK(distance(s.values(), Kepler::exact(end)) < 1e-6);
  CHECK(middle.worst < 1e-6);
  // The next step has the announced length, unless it is rejected.
  CHECK(middle.steps == s.steps());
  CHECK(middle.kept + s.rejections() >= middle.steps - 1);
  CHECK(middle.kept > middle.steps / 2);
}

TEST_CASE("tolerances per component") {
  // Two oscillators, the second a thousandth as large.
  const auto oscillators = [](TS, PetscReal, Vec y, Vec f, void*) {
    const PetscScalar* in;
    PetscScalar* out;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    PetscCall(VecGetArrayWrite(f, &out));
    out[0] = in[1], out[1] = -in[0], out[2] = 4 * in[3], out[3] = -4 * in[2];
    PetscCall(VecRestoreArrayWrite(f, &out));
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscFunctionReturn(0);
  };
  const auto error_of_small = [&](double rtol, const std::vector<double>& vrtol, double atol,
                                  const std::vector<double>& vatol, PetscInt* steps = nullptr) {
    Solver s({1, 0, 1e-3, 0}, oscillators, nullptr), v({0, 0, 0, 0}, oscillators, nullptr),
        w({0, 0, 0, 0}, oscillators, nullptr);
    if (!vrtol.empty()) v.set(vrtol);
    if (!vatol.empty()) w.set(vatol);
    petsc_check(
        TSSetTolerances(s.ts, atol, vatol.empty() ? nullptr : w.y.get(), rtol, vrtol.empty() ? nullptr : v.y.get()));
    s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-3");
    s.solve(10);
    if (steps != nullptr) *steps = s.steps();
    const std::vector<double> y = s.values();
    return std::max(std::abs(y[2] - 1e-3 * std::cos(40)), std::abs(y[3] + 1e-3 * std::sin(40)));
  };
  PetscInt a = 0, b = 0;
  const double loose = error_of_small(1e-5, {}, 1e-5, {}, &a);
  CHECK(error_of_small(1, std::vector<double>(4, 1e-5), 1, std::vector<double>(4, 1e-5), &b) == Approx(loose));
  CHECK(a == b);
  const double by_atol = error_of_small(1e-5, {}, 1, {1e-5, 1e-5, 1e-9, 1e-9});
  const double by_both = error_of_small(1, {1e-5, 1e-5, 0, 0}, 1, {1e-5, 1e-5, 1e-9, 1e-9});
  const double by_rtol = error_of_small(1, {1e-5, 1e-5, 1e-7, 1e-7}, 1e-9, {});
  CHECK(by_atol < loose / 20);
  CHECK(by_both < loose / 20);
  CHECK(by_rtol < loose / 20);
}

TEST_CASE("a restart with the known step is cheaper than a cold one") {
  int calls[2];
  for (const bool cold : {false, true}) {
    struct Count {
      int calls = 0;
      bool cold;
    } count{0, cold};
    Solver s = kepler(
        [](TS ts, PetscReal t, Vec y, Vec f, void* context) {
          ++static_cast<Count*>(context)->calls;
          return Kepler::rhs(ts, t, y, f, nullptr);
        },
        &count);
    petsc_check(TSSetApplicationContext(s.ts, &count));
    petsc_check(TSSetPostStep(s.ts, [](TS ts) {
      Count* c;
      PetscInt n;
      PetscFunctionBegin;
      PetscCall(TSGetApplicationContext(ts, &c));
      PetscCall(TSGetStepNumber(ts, &n));
      if (n % 40 == 0) {
        PetscCall(TSRestartStep(ts));
        if (c->cold) PetscCall(TSSetTimeStep(ts, 0));
      }
      PetscFunctionReturn(0);
    }));
    s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-3 " + tolerances(1e-8));
    s.solve(10 * Kepler::period);
    calls[cold] = count.calls;
  }
  CHECK(calls[0] < calls[1]);
}

TEST_CASE("a solution that was changed is noticed") {
  Decay problem;
  Solver s({1}, Decay::rhs, &problem);
  s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-3 " + tolerances(1e-9));
  s.solve(1);
  CHECK(s.values()[0] == Approx(std::exp(-1)).epsilon(1e-7));
  s.set({5});
  s.solve(2);
  CHECK(s.values()[0] == Approx(5 * std::exp(-1)).epsilon(1e-7));
  petsc_check(TSSetTime(s.ts, 0));  // and a time that was
  s.solve(1);
  CHECK(s.values()[0] == Approx(5 * std::exp(-2)).epsilon(1e-7));
}

TEST_CASE("a solve in pieces goes on where it was") {
  int calls[2];
  for (const bool pieces : {false, true}) {
    Decay problem;
    Solver s({1}, Decay::rhs, &problem);
    s.configure("-ts_type cvode -ts_cvode_type adams -ts_dt 1e-3 " + tolerances(1e-9));
    if (pieces) {
      for (PetscInt n = 10; s.time() < 1; n += 10) {
        petsc_check(TSSetMaxSteps(s.ts, n));
        s.solve(1);
        s.set(s.values());  // writes unchanged values
      }
    }
    s.solve(1);
    calls[pieces] = problem.calls;
  }
  CHECK(calls[0] == calls[1]);
}

TEST_CASE("limits of the step") {
  Solver s = kepler();
  s.configure("-ts_type cvode -ts_dt 1e-2 -ts_adapt_dt_max 0.01 " + tolerances(1e-4));
  s.solve(1);
  CHECK(s.steps() >= 100);
  CHECK(s.steps() < 130);

  Solver t = kepler();
  t.configure("-ts_type cvode -ts_dt 1e-2 -ts_adapt_dt_min 0.1 -ts_error_if_step_fails 0 " + tolerances(1e-9));
  CHECK(t.solve(1) == TS_DIVERGED_STEP_REJECTED);
}

TEST_CASE("what TSView says") {
  VanDerPol problem;
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  s.use_jacobian(VanDerPol::jacobian, &problem);
  s.configure("-ts_type cvode -ts_dt 1e-6 -ts_cvode_max_order 3 " + tolerances(1e-6));
  s.solve(1);
  petsc_check(TSRestartStep(s.ts));  // counts continue over restarts
  s.solve(2);
  const std::string text = view(s.ts);
  CAPTURE(text);
  CHECK_THAT(text, Contains("CVODE bdf, newton") && Contains("linear solver: ksp"));
  CHECK(number_after(text, " steps") == s.steps());
  CHECK(number_after(text, "right-hand sides") == problem.rhs_calls);
  CHECK(number_after(text, "error test failures") == s.rejections());
  CHECK(s.rejections() > 0);
  CHECK(number_after(text, "Jacobians") == problem.jacobian_calls);
  CHECK(number_after(text, "nonlinear iterations") >= s.steps());
  CHECK(number_after(text, "linear iterations") > 0);
  CHECK(number_after(text, "last order") <= 3);
  CHECK(number_after(text, "next step") == Approx(s.time_step()).epsilon(1e-5));
}

TEST_CASE("an error of a callback comes out as it was") {
  const std::string options = GENERATE("-ts_cvode_type adams", "-ts_cvode_linear spgmr", "-ts_cvode_nonlinear snes",
                                       "-ts_cvode_nonlinear snes -snes_mf");
  const int at = GENERATE(1, 2, 3, 4, 50);
  INFO(options << " at call " << at);
  Decay problem{.fail_at_call = at, .code = PETSC_ERR_FP};
  Solver s({1}, Decay::rhs, &problem);
  s.use_jacobian(
      [](TS, PetscReal, Vec, Mat, Mat p, void*) {
        PetscFunctionBegin;
        PetscCall(MatSetValue(p, 0, 0, -1, INSERT_VALUES));
        PetscCall(MatAssemblyBegin(p, MAT_FINAL_ASSEMBLY));
        PetscCall(MatAssemblyEnd(p, MAT_FINAL_ASSEMBLY));
        PetscFunctionReturn(0);
      },
      nullptr);
  s.configure("-ts_type cvode -ts_dt 1e-3 " + options + " " + tolerances(1e-9));
  petsc_check(TSSetMaxTime(s.ts, 5));
  CHECK(TSSolve(s.ts, s.y) == PETSC_ERR_FP);
  CHECK(problem.calls == at);  // the step is not tried again
}

TEST_CASE("an exception crosses CVODE") {
  struct Strange {
    int value;
  };
  Solver s(
      {1},
      [](TS, PetscReal t, Vec, Vec f, void*) {
        return pliant::petsc_callback([&] {
          if (t > 0.5) throw Strange{7};
          petsc_check(VecSet(f, 1));
        });
      },
      nullptr);
  s.configure("-ts_type cvode -ts_dt 1e-3 " + tolerances(1e-6));
  int caught = 0;
  try {
    s.solve(1);
  } catch (const Strange& strange) {
    caught = strange.value;
  }
  CHECK(caught == 7);
}

TEST_CASE("an error of the Jacobian comes out as it was") {
  const std::string options = GENERATE("", "-ts_cvode_nonlinear snes");
  Decay problem;
  Solver s({1}, Decay::rhs, &problem);
  s.use_jacobian([](TS, PetscReal, Vec, Mat, Mat, void*) -> PetscErrorCode { return PETSC_ERR_FILE_OPEN; }, nullptr);
  s.configure("-ts_type cvode " + options);
  petsc_check(TSSetMaxTime(s.ts, 1));
  CHECK(TSSolve(s.ts, s.y) == PETSC_ERR_FILE_OPEN);
}

TEST_CASE("steps that leave the domain are made smaller") {
  const bool by_nan = GENERATE(true, false);
  const std::string options = GENERATE("-ts_cvode_type adams ", "", "-ts_cvode_nonlinear snes -snes_mf ");
  INFO(options << by_nan);
  // y' = −√y: a long step guesses y < 0.
  Solver s(
      {1},
      [](TS, PetscReal, Vec y, Vec f, void*) {
        PetscFunctionBegin;
        PetscCall(VecCopy(y, f));
        PetscCall(VecSqrtAbs(f));
        PetscReal least;
        PetscCall(VecMin(y, nullptr, &least));
        PetscCall(VecScale(f, least < 0 ? std::numeric_limits<double>::quiet_NaN() : -1));
        PetscFunctionReturn(0);
      },
      nullptr);
  static int refused;
  refused = 0;
  if (!by_nan)
    petsc_check(TSSetFunctionDomainError(s.ts, [](TS, PetscReal, Vec y, PetscBool* inside) {
      PetscReal least;
      PetscFunctionBegin;
      PetscCall(VecMin(y, nullptr, &least));
      *inside = least < 0 ? PETSC_FALSE : PETSC_TRUE;
      refused += least < 0;
      PetscFunctionReturn(0);
    }));
  s.configure("-ts_type cvode -ts_dt 50 " + options + tolerances(1e-8));
  petsc_check(TSSetExactFinalTime(s.ts, TS_EXACTFINALTIME_INTERPOLATE));
  CHECK(s.solve(1) == TS_CONVERGED_TIME);
  CHECK(s.values()[0] == Approx(0.25).epsilon(1e-5));
  CHECK((refused > 0) == !by_nan);
}

TEST_CASE("steps that fail have a reason, and the last good solution stays") {
  const std::string options = GENERATE("-ts_cvode_type adams ", "", "-ts_cvode_nonlinear snes -snes_mf ");
  INFO(options);
  const std::string common = "-ts_type cvode -ts_dt 1e-3 -ts_error_if_step_fails 0 " + options;
  {
    Decay problem{.singular_at = 1};
    Solver s({1}, Decay::rhs, &problem);
    s.configure(common + tolerances(1e-6));
    CHECK(s.solve(2) < 0);
    CHECK(s.time() > 0.9);
    CHECK(s.time() <= 1);
    CHECK(s.values()[0] == Approx(std::exp(-s.time())).epsilon(1e-4));
  }
  {
    Decay problem;
    Solver s({1}, Decay::rhs, &problem);
    s.configure(common + tolerances(1e-20));
    CHECK(s.solve(1) == TS_DIVERGED_STEP_REJECTED);
    CHECK(s.time() == 0);
    CHECK(s.values()[0] == 1);
  }
  {
    Solver s({1}, pole, nullptr);
    s.configure(common + tolerances(1e-6) + "-ts_max_steps 2000");
    const TSConvergedReason reason = s.solve(2);
    INFO(TSConvergedReasons[reason] << " at " << s.time() << " steps " << s.steps());
    CHECK(reason < 0);
    CHECK(s.time() == Approx(1).epsilon(1e-3));
  }
  {
    Decay problem{.singular_at = -1};
    Solver s({1}, Decay::rhs, &problem);
    s.configure(common);
    CHECK(s.solve(1) == TS_DIVERGED_STEP_REJECTED);
    s.configure("-ts_type cvode -ts_error_if_step_fails");
    CHECK(TSSolve(s.ts, s.y) == PETSC_ERR_NOT_CONVERGED);
  }
}

TEST_CASE("what it refuses") {
  Decay problem;
  const auto refuses = [&](const std::string& options, const std::string& why, bool jacobian = false) {
    Solver s({1}, Decay::rhs, &problem);
    if (jacobian) s.use_jacobian([](TS, PetscReal, Vec, Mat, Mat, void*) -> PetscErrorCode { return 0; }, nullptr);
    CHECK_THROWS_WITH((s.configure("-ts_type cvode " + options), s.solve(1)), Contains(why));
  };
  refuses("-ts_cvode_type nonsense", "nonsense");
  refuses("-ts_cvode_max_order 6", "6");
  refuses("-ts_cvode_linear ksp", "needs a matrix");
  refuses("-ts_cvode_linear ksp -snes_mf", "-snes_mf", true);
  refuses("-ts_rtol -1", "must be positive");
  {
    Solver s({1}, nullptr, nullptr);
    petsc_check(TSSetIFunction(
        s.ts, nullptr, [](TS, PetscReal, Vec, Vec, Vec, void*) -> PetscErrorCode { return 0; }, nullptr));
    s.configure("-ts_type cvode");
    CHECK_THROWS_WITH(s.solve(1), Contains("TSSetRHSFunction"));
  }
}

TEST_CASE("types can be changed, and a TS used again") {
  VanDerPol problem{.epsilon = 0.1};
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  s.use_jacobian(VanDerPol::jacobian, &problem);
  std::vector<std::vector<double>> ends;
  for (const std::string options :
       {"-ts_type cvode", "-ts_type rk", "-ts_type cvode -ts_cvode_type adams", "-ts_cvode_nonlinear snes",
        "-ts_type beuler -ts_max_steps 3", "-ts_type cvode -ts_cvode_nonlinear newton"}) {
    s.set({2, 0});
    petsc_check(TSSetTime(s.ts, 0));
    petsc_check(TSSetStepNumber(s.ts, 0));
    petsc_check(TSSetMaxSteps(s.ts, 100000));
    s.configure("-ts_dt 1e-3 " + options + " " + tolerances(1e-8));
    s.solve(1);
    if (options.find("beuler") == std::string::npos) ends.push_back(s.values());
  }
  for (const auto& end : ends) CHECK(distance(end, ends[0]) < 1e-5);
}

}  // namespace pliant::test::cvode_test
