#include <pliant/ts/verlet.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/base/large_pages.h>
#include <pliant/kernels/arrays.h>
#include <pliant/kernels/verlet.h>

namespace pliant {
namespace {

constexpr std::size_t block = 4096;  // coordinates, a share of a thread

/// work(first, length) for shares of n coordinates, by all threads where there are many: to gather a team, even of one,
/// takes as long as thousands of coordinates. Returns the largest result.
template <class Work>
Real for_blocks(std::size_t n, Work&& work) {
  if (n <= 4 * block) return std::max(Real(0), work(std::size_t(0), n));
  Real largest = 0;
#pragma omp parallel for schedule(static) reduction(max : largest)
  for (std::size_t i = 0; i < n; i += block) largest = std::max(largest, work(i, std::min(block, n - i)));
  return largest;
}

/// Bounds of the motion hold within a run: before and after it no bound is known.
class WithinRun {
 public:
  explicit WithinRun(SecondOrderSystem& system) : system_(system) { forget(); }
  ~WithinRun() { forget(); }
  WithinRun(const WithinRun&) = delete;
  WithinRun& operator=(const WithinRun&) = delete;

 private:
  void forget() { system_.moved_by(std::numeric_limits<Real>::infinity()); }
  SecondOrderSystem& system_;
};

/// Throws on all ranks if `finite` is false, which has the same value on all ranks.
void check(const SecondOrderSystem& system, const State& state, std::span<const Real> predicted, bool finite) {
  if (finite) return;
  system.ranks().together([&] {
    // A value that is not finite in an acceleration is not finite in the prediction either.
    const std::size_t i = first_non_finite(predicted.data(), predicted.size());
    if (i < predicted.size())
      throw NumericalError(
          "the acceleration of coordinate {} is {} at t = {} (step {}); reduce dt or check the initial state", i,
          predicted[i], state.t, state.step);
  });
}

}  // namespace

FixedStepVerlet::FixedStepVerlet(Real dt) : dt_(dt) {
  if (!std::isfinite(dt) || dt <= 0) throw InputError("the time step is {}, but it must be positive and finite", dt);
}

void FixedStepVerlet::evaluate(SecondOrderSystem& system, State& state) {
  resize_large(a_, state.size());
  resize_large(predicted_, state.size());
  system.moved_by(std::numeric_limits<Real>::infinity());
  system.acceleration(state.t, state.x().data(), state.v().data(), a_.data());
  ++statistics_.force_evaluations;
  verlet_predict(state.size(), dt_, state.v().data(), a_.data(), predicted_.data());
  check(system, state, predicted_, system.ranks().all(first_non_finite(a_.data(), state.size()) == state.size()));
}

void FixedStepVerlet::check_system(const FirstOrderSystem& system) const {
  if (!system.has_velocities())
    throw InputError("velocity Verlet is for motion with inertia; use {}", cures({Cure::ts}));
}

void FixedStepVerlet::run(FirstOrderSystem& system, State&, Real, const StepObserver&) { check_system(system); }

bool FixedStepVerlet::fused_step(SecondOrderSystem& system, State& state, Real t, bool predicted) {
  const std::size_t n = state.size();
  resize_large(last_predicted_, n);
  predicted_.swap(last_predicted_);
  if (!predicted) {
    resize_large(x_next_, n);
    for_blocks(n, [&](std::size_t i, std::size_t m) {
      return verlet_drift(m, dt_, &state.x()[i], &state.v()[i], &last_predicted_[i], &x_next_[i]);
    });
  }
  // Chunk by chunk, over the result of this step: the positions and the prediction for the one after it.
  Real *const x = state.x().data(), *const v = state.v().data(), *const p = predicted_.data();
  const SecondOrderSystem::Advance advance{[=, this](std::size_t first, std::size_t end, const Real* a) -> Real {
                                             if (first == end) return 0;
                                             return verlet_kick_drift(end - first, dt_, &x_next_[first], v + first,
                                                                      a + first, &last_predicted_[first], x + first,
                                                                      p + first);
                                           },
                                           Prefetch(v, x, p)};
  const bool finite = system.fused_step(t, x_next_, last_predicted_, advance);
  state.swap_x(x_next_);
  return finite;
}

bool FixedStepVerlet::pass_by_pass(SecondOrderSystem& system, State& state, Real t) {
  const std::size_t n = state.size();
  resize_large(a_, n);
  Real *const x = state.x().data(), *const v = state.v().data(), *const p = predicted_.data(), *const a = a_.data();
  const Real change = for_blocks(
      n, [=, h = dt_](std::size_t i, std::size_t m) { return verlet_drift(m, h, x + i, v + i, p + i, x + i); });
  system.moved_by(system.ranks().max(change));
  system.acceleration(t, x, p, a);
  const Real broken = for_blocks(
      n, [=, h = dt_](std::size_t i, std::size_t m) -> Real { return verlet_kick(m, h, v + i, a + i, p + i) ? 0 : 1; });
  return system.ranks().all(broken == 0);
}

void FixedStepVerlet::run(SecondOrderSystem& system, State& state, Real t_end, bool fresh,
                          const StepObserver& observer) {
  if (system.size() != state.size())
    throw InputError("the state has {} coordinates, but the system has {}; build both from one topology", state.size(),
                     system.size());
  const Real steps = std::round((t_end - state.t) / dt_);
  if (!(steps < most_steps))
    throw InputError("a run from t = {} to {} with dt = {} has too many steps to count; enlarge dt", state.t, t_end,
                     dt_);
  const Real origin = state.t - static_cast<Real>(state.step) * dt_;  // exactly 0 where t = step · dt
  const std::int64_t last = state.step + static_cast<std::int64_t>(steps);
  if (!fresh && predicted_.size() != state.size())
    throw InputError("{} velocities are predicted for a state of {} coordinates; start again", predicted_.size(),
                     state.size());
  const WithinRun within(system);
  if (fresh) evaluate(system, state);

  AfterStep after = AfterStep::changed;
  while (state.step < last) {
    const Real t = origin + static_cast<Real>(state.step + 1) * dt_;
    const bool finite = system.fuses_step() ? fused_step(system, state, t, after == AfterStep::proceed)
                                            : pass_by_pass(system, state, t);
    ++state.step;
    state.t = t;
    ++statistics_.force_evaluations;
    check(system, state, predicted_, finite);
    ++statistics_.steps;
    statistics_.last_dt = dt_;
    system.accepted(t, state.x().data(), state.v().data(), dt_, true);
    after = observer ? observer(state) : AfterStep::proceed;
    if (after == AfterStep::stop) return;
    if (after == AfterStep::changed) evaluate(system, state);
  }
}

}  // namespace pliant
