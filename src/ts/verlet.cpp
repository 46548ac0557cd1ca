#include <pliant/ts/verlet.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/ts/finite.h>

namespace pliant {
namespace {

constexpr std::size_t worth_threads = 20000;  // coordinates: below, starting threads costs more than they save

// v becomes v½, x becomes x', p the predicted velocity.
void kick_drift(std::size_t n, Real h, Real* __restrict__ x, Real* __restrict__ v, const Real* __restrict__ a,
                Real* __restrict__ p) {
  const Real half = 0.5 * h;
#pragma omp parallel for simd schedule(static) if (n >= worth_threads)
  for (std::size_t i = 0; i < n; ++i) {
    const Real v_half = v[i] + half * a[i];
    v[i] = v_half;
    x[i] += h * v_half;
    p[i] = v_half + half * a[i];
  }
}

bool kick(std::size_t n, Real half, Real* __restrict__ v, const Real* __restrict__ a) {
  constexpr std::size_t block = 4096;
  bool finite = true;
#pragma omp parallel for reduction(&& : finite) schedule(static) if (n >= worth_threads)
  for (std::size_t first = 0; first < n; first += block) {
    const std::size_t last = std::min(n, first + block);
    FiniteCheck check;
    for (std::size_t i = first; i < last; ++i) {
      v[i] += half * a[i];
      check.add(a[i]);
    }
    finite = finite && check.all_finite();
  }
  return finite;
}

[[noreturn]] void throw_not_finite(const State& state) {
  const std::size_t i = first_non_finite(state.a().data(), state.size());
  throw NumericalError(
      "the acceleration of coordinate {} is {} at t = {} (step {}); reduce dt or check the initial state", i,
      state.a()[i], state.t, state.step);
}

}  // namespace

FixedStepVerlet::FixedStepVerlet(Real dt) : dt_(dt) {
  if (!std::isfinite(dt) || dt <= 0) throw InputError("the time step is {}, but it must be positive and finite", dt);
}

void FixedStepVerlet::evaluate(SecondOrderSystem& system, State& state) {
  system.acceleration(state.t, state.x().data(), state.v().data(), state.a().data());
  ++statistics_.force_evaluations;
  check(system, state, first_non_finite(state.a().data(), state.size()) == state.size());
}

void FixedStepVerlet::check(const SecondOrderSystem& system, const State& state, bool finite) {
  if (!system.ranks().all(finite))
    system.ranks().together([&] {
      if (!finite) throw_not_finite(state);
    });
}

void FixedStepVerlet::run(SecondOrderSystem& system, State& state, Real t_end, bool fresh,
                          const StepObserver& observer) {
  if (system.size() != state.size())
    throw InputError("the state has {} coordinates, but the system has {}; build both from one topology", state.size(),
                     system.size());
  const Real steps = std::round((t_end - state.t) / dt_);
  if (!(steps < 9e15))
    throw InputError("a run from t = {} to {} with dt = {} has too many steps to count; enlarge dt", state.t, t_end,
                     dt_);
  const Real origin = state.t - static_cast<Real>(state.step) * dt_;  // exactly 0 where t = step · dt
  const std::int64_t last = state.step + static_cast<std::int64_t>(steps);
  if (fresh) evaluate(system, state);

  while (state.step < last) {
    const std::size_t n = state.size();
    v_predicted_.resize(n);
    kick_drift(n, dt_, state.x().data(), state.v().data(), state.a().data(), v_predicted_.data());
    ++state.step;
    state.t = origin + static_cast<Real>(state.step) * dt_;
    system.acceleration(state.t, state.x().data(), v_predicted_.data(), state.a().data());
    ++statistics_.force_evaluations;
    check(system, state, kick(n, 0.5 * dt_, state.v().data(), state.a().data()));
    ++statistics_.steps;
    statistics_.last_dt = dt_;
    if (!observer) continue;
    const AfterStep after = observer(state);
    if (after == AfterStep::stop) return;
    if (after == AfterStep::changed) evaluate(system, state);
  }
}

}  // namespace pliant
