// Mean and standard error of a correlated time series, and of ratios and flow rates derived from one.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Result of `block_average`. A number that the series does not support is NaN.
struct BlockAverage {
  static constexpr Real unknown = std::numeric_limits<Real>::quiet_NaN();
  static constexpr std::size_t least_samples = 64;  ///< for an error

  Real mean = unknown;            ///< mean of all samples
  Real error = unknown;           ///< one standard error of the mean; NaN unless `plateau`
  Real error_of_error = unknown;  ///< error / sqrt(2 (blocks − 1)); of `slow_average` 0.3 error
  Real naive_error = unknown;     ///< standard error if the samples were independent
  Real lower_bound = unknown;     ///< largest error of any block size: a lower bound where there is no plateau
  Real inefficiency = unknown;  ///< (error/naive_error)²: samples per independent sample, 2 τ_int; NaN unless `plateau`
  std::size_t samples = 0;
  std::size_t block_size = 0;  ///< samples per block, of `block_average` a power of two; 0 unless `plateau`
  std::size_t blocks = 0;      ///< whole blocks of that size; 0 unless `plateau`
  bool plateau = false;        ///< the error has stopped growing with the block size
};

/// Blocking after Flyvbjerg & Petersen, J. Chem. Phys. 91, 461 (1989): block sizes B = 1, 2, 4, …; the variance of the
/// block means gives the error e_B. The block size is the smallest that fulfils B³ > 2 N max(1, e_B/e_1)⁴ with at least
/// 8 blocks [Lee et al., Phys. Rev. E 83, 066706 (2011)]: bias (∝ 1/B) and scatter (∝ sqrt(B/N)) of the error are then
/// about equal. If there is no such size, the error has no plateau and is NaN, as for a drift and for fewer than 64
/// samples. The floor 1 keeps anticorrelated series (particles that arrive evenly) from stopping too early.
///
/// How far to trust it, N' = samples/inefficiency being the independent samples: the mean error is within 5 % of the
/// true one for N' > 200, 10 % low for N' = 50; at N' = 25 half of the AR(1) series reach a plateau, those that
/// underestimate their correlation, with an error 30 % low. `error_of_error` has no part of this bias.
///
/// series: equidistant samples from the steady state.
BlockAverage block_average(std::span<const Real> series);

/// Mean and error of a quantity of the whole filling (packing fraction, height, contacts), whose samples have fast
/// noise and a small slow part. `block_average` chooses blocks that are long compared with the noise alone, and its
/// error can be half of the true one. Here the error comes from the means of 24 and of 8 equal stretches, by
///   e² = e_24² + 2 max(0, e_8² − e_24²),
/// the lugsail estimator of Vats & Flegal, Biometrika 109, 735 (2022), which removes the bias of e_8 to first order.
///
/// The true mean is within e in 60 to 78 %, and within 2 e in 88 to 98 % of the series, if their correlation time is at
/// most 1/20 of the series (AR(1), also under noise, and oscillations with periods of at most 1/24). Slower series have
/// errors that are too small (by 20 % at 1/10), oscillations with longer periods errors that are too large (by up to
/// 70 %). The error is NaN for fewer than 64 samples, and for e_8² > 3 e_24², as for a drift.
BlockAverage slow_average(std::span<const Real> series);

/// Σ numerator / Σ denominator with the error of the ratio to first order, which is the error of the series (numerator
/// − ratio · denominator) / mean(denominator). NaN where the denominators add to zero.
/// Throws InputError if the lengths differ.
BlockAverage block_ratio(std::span<const Real> numerator, std::span<const Real> denominator);

/// Rate of a cumulative quantity between neighbouring samples: [n − 1], entry i over (time[i], time[i+1]].
/// Throws InputError unless the lengths agree, all numbers are finite and the times increase.
std::vector<Real> rate_series(std::span<const Real> time, std::span<const Real> cumulative);

struct FlowRate {
  Real value = BlockAverage::unknown;             ///< σ_avg^D/t0
  Real error = BlockAverage::unknown;             ///< one standard error; NaN if it cannot be estimated
  Real correlation_time = BlockAverage::unknown;  ///< integrated, t0: inefficiency · bin / 2
  Real bin = BlockAverage::unknown;               ///< width of the time bins, t0
  BlockAverage blocks;                            ///< block average of the rate in the bins
};

/// Flow rate from the cumulative crossed area (or volume, or number) at the sample times, which need not be
/// equidistant: (last − first)/(duration). For the error the time is cut into equal bins, as wide as the longest
/// interval between samples; the cumulative curve is interpolated linearly at their edges and the rates in the bins are
/// block-averaged. Without a single crossing the rate is 0 and its error NaN.
///
/// time [n] in t0, crossed [n] in σ_avg^D, both from the steady state only. Fewer than two samples: all NaN.
/// Throws InputError unless the lengths agree, all numbers are finite, the times increase and `crossed` does not fall.
FlowRate flow_rate(std::span<const Real> time, std::span<const Real> crossed);

}  // namespace pliant
