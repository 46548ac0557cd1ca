// Where the start-up ends, and whether the rest of a run is a steady state.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include <pliant/base/types.h>

namespace pliant {

struct SteadyState {
  std::size_t index = 0;    ///< first sample after the start-up
  Real time = 0;            ///< its time, t0
  bool steady = false;      ///< false: the samples from `index` on must not be averaged as a steady state
  std::string explanation;  ///< one sentence for the log
};

/// A time series with the name that messages use for it.
struct NamedSeries {
  std::string_view name;
  std::span<const Real> values;  ///< [samples]
  Real tolerance = 1e-6;         ///< changes below this part of the mean do not count as drift
  bool finds_start_up = true;    ///< `steady_state` applies `mser5` to it
};

/// Number of samples at the front that belong to the start-up, at most half of them. MSER-5 [White, Simulation 69, 323
/// (1997); White, Cobb & Spratt, Winter Simulation Conference 2000, 755]: of the k means z_j over 5 samples each, the
/// first d are dropped for the d ≤ k/2 that minimises Σ_{j>d} (z_j − z̄_d)²/(k − d)², the smallest such d if there are
/// several.
///
/// d is a truncation, not a test: a series with growing variance, or with a slow drift, may keep all samples.
std::size_t mser5(std::span<const Real> values);

/// How the mean or the spread of a series changes; empty if no change is significant. The spread is the mean distance
/// from the mean of the first, middle or last third.
///
/// The series is divided into 18, 36 and 72 batches, and a polynomial of degree 4 is fitted to the means of each. There
/// is a drift if one of its (orthogonal) powers has a Student's t above the quantile for a two-sided probability of
/// 2·10⁻⁴ with each number of batches: correlations much shorter than a twentieth of the series then make no false
/// alarm. In addition the mean of thirds or sixths must change by more than series.tolerance of the mean, and the
/// spread by a quarter, because error bars are not known better than that.
std::string drift(const NamedSeries& series);

/// The start-up ends at the latest `mser5` of the series that find it. If a series drifts from there on, a start-up may
/// be left in them: then later starts, which drop up to a third of the rest but no more than half of the run, are tried
/// with stricter tests (probabilities of 10⁻², spreads that change by a tenth). If all of them find a drift the run is
/// not steady, and `index` is the latest. Neither is it with fewer than 50 samples, or with numbers that are not
/// finite. A flow rate from `rate_series` has one sample less: pass it with subspan(1) of the time and of other series.
///
/// Of stationary series (white, AR(1) of 50 independent samples or more, bursts) less than 1 % are called unsteady.
/// Oscillations with a period of less than half of the run do not count as drift.
///
/// time, series.values [samples]. Throws InputError if there is no series or a length differs.
SteadyState steady_state(std::span<const Real> time, std::span<const NamedSeries> series);

}  // namespace pliant
