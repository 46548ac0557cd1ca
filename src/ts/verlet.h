// Velocity Verlet with a fixed step as a plain loop: the cheapest path for dense flow.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include <pliant/base/large_pages.h>
#include <pliant/ts/integrator.h>

namespace pliant {

/// Velocity Verlet for forces that depend on the velocity, one force evaluation per step of length h:
///
///     p = v + a h,   v½ = (v + p)/2,   x' = x + h v½,   a' = A(t + h, x', p),   v' = v½ + a' h/2
///
/// The predictor p that the force sees keeps order 2 under damping and for any A(t, x, v); where A does not
/// depend on v this is the symplectic velocity Verlet (M. P. Allen, D. J. Tildesley, Computer Simulation of Liquids,
/// 2017, section 3.2). A linear damping a = −γ v alone is stable for γ h < 1.
///
/// Accelerations are used at once and not stored; the predicted velocity p is carried to the next step. Times are t =
/// step · dt, counted by integers,
/// so that a restart from (step, x, v, p) with fresh = false continues bit for bit. Where state.t is not step · dt at
/// the start of a run (dt was changed, which needs fresh), the difference is stored as an offset. The acceleration in p
/// depends on the previous prediction, so p is part of the state: computing p again gives a difference of O(h³).
class FixedStepVerlet : public Integrator {
 public:
  /// In one run: the largest count of a Real.
  static constexpr Real most_steps = 9e15;

  /// dt in t0. Errors: InputError unless dt is positive and finite.
  explicit FixedStepVerlet(Real dt);

  /// As Integrator::run. After the observer has `changed` the state, the prediction is computed again before the next
  /// step (also after the last step). A state that is saved inside an observer call which changes it has an outdated
  /// prediction: start it with fresh. Errors: InputError if the state does not fit the system; NumericalError, which
  /// names the coordinate, if an acceleration is not finite.
  void run(SecondOrderSystem& system, State& state, Real t_end, bool fresh, const StepObserver& observer) override;
  void run(FirstOrderSystem& system, State& state, Real t_end, const StepObserver& observer) override;
  void check_system(const FirstOrderSystem& system) const override;
  const IntegratorStatistics& statistics() const override { return statistics_; }
  std::string name() const override { return "verlet"; }
  Real next_dt() const override { return dt_; }
  bool explicit_fixed_step() const override { return true; }
  Real longest_stable_step(const FastestRates& rates) const override { return longest_verlet_step(rates); }
  bool first_same_as_last() const override { return false; }
  /// The predicted velocities p.
  bool carries() const override { return true; }
  std::span<const Real> carried() const override { return predicted_; }
  void set_carried(std::span<const Real> values) override {
    resize_large(predicted_, values.size());
    std::copy(values.begin(), values.end(), predicted_.begin());
  }

 private:
  /// Predicts the velocities again, from the accelerations at x and v.
  void evaluate(SecondOrderSystem& system, State& state);
  /// Steps to time t; return whether the accelerations are finite. Both give the same bits.
  bool fused_step(SecondOrderSystem& system, State& state, Real t, bool predicted);
  bool pass_by_pass(SecondOrderSystem& system, State& state, Real t);

  Real dt_;
  std::vector<Real> predicted_;                ///< p for the step to come
  std::vector<Real> a_;                        ///< pass by pass
  std::vector<Real> x_next_, last_predicted_;  ///< in one pass: at the end of the step; ghosts follow
  IntegratorStatistics statistics_;
};

}  // namespace pliant
