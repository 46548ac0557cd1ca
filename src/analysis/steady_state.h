// Where the start-up ends and the steady state begins.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include <pliant/base/types.h>

namespace pliant {

struct SteadyState {
  std::size_t index = 0;    ///< first sample to keep
  Real time = 0;            ///< its time, t0
  bool steady = false;      ///< false: the samples from `index` on must not be averaged as a steady state
  std::string explanation;  ///< one sentence for the log
};

/// A time series with the name that messages use for it.
struct NamedSeries {
  std::string_view name;
  std::span<const Real> values;  ///< [samples]
};

/// MSER-5 [White, Simulation 69, 323 (1997); White, Cobb & Spratt, Winter Simulation Conference 2000, 755]: of the k
/// means z_j over 5 samples each, the first d are dropped for the d ≤ k/2 that minimises Σ_{j>d} (z_j − z̄_d)²/(k − d)²,
/// the smallest such d if there are several. A minimum in the last tenth of the first half means that the statistic
/// still falls there: not steady (with the literal "at its very end", one drifting series in four passes by chance).
/// Neither is a series of fewer than 50 samples, or one with a number that is not finite.
///
/// It cannot see a drift, over the whole run, below some three standard deviations of the 5-sample means;
/// `block_average` then reports no plateau.
///
/// time, series.values [samples]. Throws InputError if the lengths differ.
SteadyState mser5(std::span<const Real> time, const NamedSeries& series);

/// `mser5` of each series; the latest truncation counts, and one unsteady series makes the whole unsteady. A flow rate
/// from `rate_series` has one sample less: pass it with subspan(1) of the time and of the other series.
///
/// Throws InputError if there is no series or a length differs.
SteadyState steady_state(std::span<const Real> time, std::span<const NamedSeries> series);

}  // namespace pliant
