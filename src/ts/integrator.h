// The one interface between a scenario and the two integration paths (plain velocity Verlet, PETSc TS).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <pliant/model/force_field.h>
#include <pliant/model/state.h>
#include <pliant/system/equation.h>
#include <pliant/ts/stability.h>

namespace pliant {

/// Request of a scenario after an accepted step, the same on every rank: proceed, reordered, changed or stop.
/// Reordered: particles were sorted or moved between ranks, with the carried acceleration, and the length of the state
/// may have changed. Changed: the scenario has changed the state, a discontinuity. Multistep methods then restart,
/// first-same-as-last stages are dropped, and a carried acceleration is evaluated again.
enum class AfterStep { proceed, reordered, changed, stop };

/// Called after every accepted step with the state at its end.
using StepObserver = std::function<AfterStep(State&)>;

struct IntegratorStatistics {
  std::int64_t steps = 0;  ///< accepted
  std::int64_t rejected = 0;
  std::int64_t above_tolerance = 0;    ///< accepted although their error was estimated to be above the tolerance
  std::int64_t force_evaluations = 0;  ///< includes evaluations of a part of the terms
  std::int64_t jacobian_evaluations = 0;
  std::int64_t linear_iterations = 0;
  Real last_dt = 0;  ///< in t0
};

class Integrator {
 public:
  virtual ~Integrator() = default;
  /// Advances state from state.t until t_end or until the observer stops it; a fixed step takes round((t_end − t)/dt)
  /// steps. With `fresh` the accelerations in the state are not valid yet (a new run, not a restart). Errors:
  /// NumericalError where a step fails or dt underflows.
  virtual void run(SecondOrderSystem& system, State& state, Real t_end, bool fresh, const StepObserver& observer) = 0;
  /// As above, for a first-order system, whose unknowns are State::x and State::extra; State::v is not changed.
  virtual void run(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer) = 0;
  /// Errors: InputError if the method cannot solve this system, as it needs velocities or derivatives of the forces.
  virtual void check_system(const FirstOrderSystem& system) const = 0;
  virtual const IntegratorStatistics& statistics() const = 0;
  virtual std::string name() const = 0;  ///< "verlet", or "ts:" and the TS type

  /// The step that the next run starts with, in t0: save it for a restart.
  virtual Real next_dt() const = 0;
  /// Whether no error estimate shortens the step, and no solve makes a long one stable.
  virtual bool explicit_fixed_step() const = 0;
  /// The longest step at which an explicit method is stable for such motion, by its stability polynomial; infinite for
  /// implicit methods.
  virtual Real longest_stable_step(const FastestRates& rates) const = 0;
  /// The shortest step of error control (-ts_adapt_dt_min), 0 without limit.
  virtual Real shortest_controlled_step() const { return 0; }
  /// Whether the last evaluation of every step is at its end, so that an observer gets the rates without another
  /// evaluation.
  virtual bool first_same_as_last() const = 0;
  /// Whether it carries velocities from step to step, one for each coordinate: an observer that sorts the state
  /// sorts them too, and a restart that is bit for bit needs it.
  virtual bool carries() const { return false; }
  virtual std::span<const Real> carried() const { return {}; }
  virtual void set_carried(std::span<const Real> /*values*/) {}
};

/// The fastest translation and rotation of a dense packing; drag in 1/t0.
std::vector<FastestRates> fastest_motions(const CriticalStep& critical, Real drag = 0);
/// The longest step at which a method is stable for all these motions.
Real longest_stable_step(const Integrator& method, std::span<const FastestRates> motions);
/// The usual step of a scenario, shortened for a method of fixed steps to the safe part of its longest stable step.
/// Unchanged if no step is stable.
Real standard_step(const Integrator& method, std::span<const FastestRates> motions, Real usual);

}  // namespace pliant
