// The flow rate of the steady state, and when it is known well enough to end a run.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/steady_state.h>

namespace pliant {

/// Flow rate from the end of the start-up on.
struct SteadyFlow {
  SteadyState steady;
  std::size_t from = 0;  ///< row that the averages start at
  FlowRate rate;         ///< of the rows from there on
};

/// Columns that tell whether a flow is steady, [samples] each: time in t0, crossed_area cumulative, in σ_avg^D.
struct FlowColumns {
  std::span<const Real> time, crossed_area, kinetic_energy, top_height, bulk_fraction;
};

/// `steady_state` of the flow rate, the kinetic energy, the height of the filling and its bulk fraction, then
/// `flow_rate`, without an error where the flow is not steady. The last three may change by 5 %: by so little they tell
/// nothing that the flow rate does not. The start-up is that of the first two.
///
/// Throws InputError for fewer than two rows and as `flow_rate` does.
SteadyFlow steady_flow(const FlowColumns& columns);

/// One row of `FlowColumns`, and the number of particles that have crossed.
struct FlowSample {
  Real time = 0, crossed = 0, crossed_area = 0, kinetic_energy = 0, top_height = 0, bulk_fraction = 0;
};

/// Detects when the relative standard error of the flow rate reaches the requested value. The result is a function of
/// the samples alone: to go on after a restart, give it the stored ones again.
///
/// It judges at the 100th sample and then whenever the series has grown by 5 %, in all at the cost of some twenty
/// samples' analysis per sample. An error bar that is looked at often is low now and then, and a run that ends there
/// would be ended by chance; therefore it is believed only if
/// - the run is steady (`steady_state`),
/// - the steady part is worth 100 independent samples, in at least 16 blocks, and 100 particles crossed in it,
/// - the rate does not drift: leaving out its first 1/2, 1/4, 1/8 or 1/16 changes it by no more than two standard
///   deviations of such a change, or 0.3 of the error asked for (MSER-5 may leave the end of a start-up in),
/// - all that, and the error, held at the judgement before as well.
///
/// For AR(1) rates the actual error of runs ended so is at most 1.2 of the requested one, and their mean is unbiased;
/// the same holds after a start-up that relaxes within the run. A start-up that is slow on the scale of the whole run,
/// and changes the rate by less than its noise meanwhile, cannot be told from a steady state.
class FlowPrecision {
 public:
  static constexpr Real min_independent = 100, min_crossings = 100, max_drift = 0.3;
  static constexpr std::size_t min_blocks = 16;

  /// relative_error > 0.
  explicit FlowPrecision(Real relative_error) : asked_(relative_error) {}

  /// True if the run may end with this sample. Throws InputError as `flow_rate` does.
  bool add(const FlowSample& sample);

  /// At the last judgement; NaN if it was unknown. Not to be believed until `add` returns true.
  Real relative_error() const { return error_; }
  Real rate() const { return rate_; }  ///< σ_avg^D/t0, at the last judgement

 private:
  bool judge();
  /// Whether the rest of the start-up, or a slow change, shows in the rate.
  bool drifts(const SteadyFlow& flow) const;

  Real asked_, error_ = BlockAverage::unknown, rate_ = BlockAverage::unknown;
  std::vector<Real> time_, crossed_, area_, energy_, top_, fraction_;
  std::size_t next_ = 100;  ///< samples at the next judgement
  bool held_ = false;
};

}  // namespace pliant
