#include <pliant/ts/verlet.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/base/large_pages.h>
#include <pliant/kernels/verlet.h>

namespace pliant {
namespace {

constexpr std::size_t block = 4096;  // coordinates, a share of a thread

/// work(first, length) for shares of n coordinates, by all threads where there are many.
template <class Work>
void for_blocks(std::size_t n, Work&& work) {
#pragma omp parallel for schedule(static) if (n > 4 * block)
  for (std::size_t i = 0; i < n; i += block) work(i, std::min(block, n - i));
}

/// Throws on all ranks if `finite` is false, as it is on all ranks then.
void check(const SecondOrderSystem& system, const State& state, bool finite) {
  if (finite) return;
  system.ranks().together([&] {
    const std::size_t i = first_non_finite(state.a().data(), state.size());
    if (i < state.size())
      throw NumericalError(
          "the acceleration of coordinate {} is {} at t = {} (step {}); reduce dt or check the initial state", i,
          state.a()[i], state.t, state.step);
  });
}

}  // namespace

FixedStepVerlet::FixedStepVerlet(Real dt) : dt_(dt) {
  if (!std::isfinite(dt) || dt <= 0) throw InputError("the time step is {}, but it must be positive and finite", dt);
}

void FixedStepVerlet::predict(const State& state) {
  const std::size_t n = state.size();
  resize_large(x_next_, n);
  resize_large(v_next_, n);
  for_blocks(n, [&](std::size_t i, std::size_t m) {
    verlet_predict(m, dt_, &state.x()[i], &state.v()[i], &state.a()[i], &x_next_[i], &v_next_[i]);
  });
}

void FixedStepVerlet::evaluate(SecondOrderSystem& system, State& state) {
  system.acceleration(state.t, state.x().data(), state.v().data(), state.a().data());
  ++statistics_.force_evaluations;
  check(system, state, system.ranks().all(first_non_finite(state.a().data(), state.size()) == state.size()));
}

bool FixedStepVerlet::sweep(SecondOrderSystem& system, State& state, Real t, bool foreseen) {
  if (!foreseen) predict(state);
  resize_large(v_, state.size());
  // The step after this one is predicted chunk by chunk, over the positions that this one leaves behind.
  const SecondOrderSystem::Advance advance{[&](std::size_t first, std::size_t end) -> const Real* {
                                             if (first < end)
                                               verlet_complete(end - first, dt_, &x_next_[first], &state.v()[first],
                                                               &state.a()[first], &v_next_[first], &state.x()[first],
                                                               &v_[first]);
                                             return state.x().data();
                                           },
                                           Ahead(state.v().data(), state.x().data(), v_.data())};
  const bool finite = system.sweep(t, x_next_, v_next_, state.a().data(), foreseen, advance);
  state.swap_x(x_next_);
  v_next_.swap(v_);
  return finite;
}

bool FixedStepVerlet::pass_by_pass(SecondOrderSystem& system, State& state, Real t) {
  const std::size_t n = state.size();
  resize_large(v_next_, n);
  Real *const x = state.x().data(), *const v = state.v().data(), *const a = state.a().data(), *const p = v_next_.data();
  for_blocks(n,
             [=, h = dt_](std::size_t i, std::size_t m) { verlet_predict(m, h, x + i, v + i, a + i, x + i, p + i); });
  system.acceleration(t, x, p, a);
  for_blocks(n, [=, h = dt_](std::size_t i, std::size_t m) { verlet_complete(m, h, v + i, a + i, p + i); });
  return system.ranks().all(first_non_finite(a, n) == n);
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

  AfterStep after = AfterStep::changed;
  while (state.step < last) {
    const Real t = origin + static_cast<Real>(state.step + 1) * dt_;
    const bool finite =
        system.one_pass() ? sweep(system, state, t, after == AfterStep::proceed) : pass_by_pass(system, state, t);
    ++state.step;
    state.t = t;
    ++statistics_.force_evaluations;
    check(system, state, finite);
    ++statistics_.steps;
    statistics_.last_dt = dt_;
    after = observer ? observer(state) : AfterStep::proceed;
    if (after == AfterStep::stop) return;
    if (after == AfterStep::changed) evaluate(system, state);
  }
}

}  // namespace pliant
