// Packings one after the other, as the steps of a run.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <pliant/jamming/minimise.h>
#include <pliant/ts/integrator.h>

namespace pliant {

/// An integrator whose step makes the next packing: the time of a run of packings is the number of steps. `advance`
/// changes the state and returns the number of force evaluations; nothing if a stop request has interrupted it, after
/// which the state is as before.
class PackingSteps final : public Integrator {
 public:
  using Advance = std::function<std::optional<std::int64_t>(State&)>;
  /// minimiser: name of the method.
  PackingSteps(std::string minimiser, Advance advance)
      : minimiser_(std::move(minimiser)), advance_(std::move(advance)) {}

  void run(SecondOrderSystem& /*system*/, State& state, Real t_end, bool /*fresh*/,
           const StepObserver& observer) override {
    while (state.t < t_end - 0.5) {
      if (const std::optional<std::int64_t> evaluations = advance_(state)) {
        statistics_.force_evaluations += *evaluations;
        ++state.step;
        state.t = static_cast<Real>(state.step);
        ++statistics_.steps;
        statistics_.last_dt = 1;
      }
      if (observer && observer(state) == AfterStep::stop) return;
    }
  }
  void run(FirstOrderSystem& /*system*/, State& /*state*/, Real /*t_end*/, const StepObserver& /*observer*/) override {
    throw std::logic_error("packings have no rates");
  }
  void check_system(const FirstOrderSystem& /*system*/) const override {}
  const IntegratorStatistics& statistics() const override { return statistics_; }
  std::string name() const override { return minimiser_; }
  Real next_dt() const override { return 1; }
  bool explicit_fixed_step() const override { return false; }
  Real longest_stable_step(const FastestRates& /*rates*/) const override {
    return std::numeric_limits<Real>::infinity();
  }
  bool first_same_as_last() const override { return false; }

 private:
  std::string minimiser_;
  Advance advance_;
  IntegratorStatistics statistics_;
};

}  // namespace pliant
