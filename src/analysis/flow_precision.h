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
  std::size_t from = 0;  ///< first row of the averages
  FlowRate rate;         ///< mean flow rate of row `from` and all later rows
};

/// Columns that decide whether a flow is steady, [samples] each: time in t0, crossed_area cumulative, in σ_avg^D.
struct FlowColumns {
  std::span<const Real> time, crossed_area, kinetic_energy, top_height, bulk_fraction;
};

/// `steady_state` of the flow rate, the kinetic energy, the height of the filling and its bulk fraction, then
/// `flow_rate`, without an error where the flow is not steady. The last three may change by 5 %, because smaller
/// changes show nothing that the flow rate does not show. The first two determine the start-up.
///
/// Throws InputError for fewer than two rows and as `flow_rate` does.
SteadyFlow steady_flow(const FlowColumns& columns);

/// One row of `FlowColumns`, and the number of particles that have crossed.
struct FlowSample {
  Real time = 0, crossed = 0, crossed_area = 0, kinetic_energy = 0, top_height = 0, bulk_fraction = 0;
};

/// Detects when the relative standard error of the flow rate reaches the requested value. The result is a function of
/// the samples alone: after a restart, add the stored samples again.
///
/// The analysis runs at the 100th sample and then whenever the series has grown by 5 %; its total cost per sample is
/// the analysis of about twenty samples. An error bar that is computed often is too low by chance now and then, which
/// must not end a run; therefore `add` returns true only if
/// - the run is steady (`steady_state`),
/// - the steady part is worth 100 independent samples, in at least 16 blocks, and 100 particles crossed in it,
/// - the rate does not drift: leaving out its first 1/2, 1/4, 1/8 or 1/16 changes it by no more than two standard
///   deviations of such a change, or 0.3 of the error asked for (MSER-5 may leave the end of a start-up in),
/// - these conditions, and the error, were also met at the previous analysis.
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

  /// Relative error at the last analysis; NaN if it was unknown. Not reliable until `add` returns true.
  Real relative_error() const { return error_; }
  Real rate() const { return rate_; }  ///< σ_avg^D/t0, at the last analysis

 private:
  bool judge();
  /// Whether the rest of the start-up, or a slow change, shows in the rate.
  bool drifts(const SteadyFlow& flow) const;

  Real asked_, error_ = BlockAverage::unknown, rate_ = BlockAverage::unknown;
  std::vector<Real> time_, crossed_, area_, energy_, top_, fraction_;
  std::size_t next_ = 100;  ///< number of samples at the next analysis
  bool held_ = false;
};

}  // namespace pliant
