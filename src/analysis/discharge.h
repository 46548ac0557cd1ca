// The discharge of a hopper that is not refilled.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include <pliant/base/types.h>

namespace pliant {

struct DischargeFit {
  static constexpr Real unknown = std::numeric_limits<Real>::quiet_NaN();

  Real c0 = unknown;               ///< 1/t0; NaN if fewer than three samples lie in the middle of the discharge
  Real error = unknown;            ///< one standard error of c0; NaN if there are too few samples for it
  Real rounding_error = unknown;   ///< share of N being an integer in it, if the samples round independently
  Real total_time = unknown;       ///< from the first sample to the first one with N = 0; NaN if it never empties
  std::int64_t excluded = 0;       ///< particles left out at either end
  std::size_t begin = 0, end = 0;  ///< samples [begin, end) of the fit
};

/// Fits dN/dt = −c0 sqrt(N) [H 15, whose sign is that of the flux] to the number N(t) left in the hopper: the law makes
/// sqrt(N) = sqrt(N(t1)) − c0 (t − t1)/2 a line, so c0 is −2 times the slope of the regression of sqrt(N) on t.
/// As in [H] the first and the last 100 particles are left out (10 % of N(0) at either end if N(0) < 1000), and all
/// samples after the last particle has left (a clog).
///
/// Error: N counts, so its deviations from the law add up (a random walk) and are not independent, as the textbook
/// error of a slope wants them: that one is far too small. Here the time of the fit is cut into ten equal parts; the
/// scatter of their ten slopes, over sqrt(10), is the error. It needs three samples in each part. N is an integer: that
/// alone moves sqrt(N) by up to 1/(4 sqrt(N)) (standard deviation 1/sqrt(48 N)), which the error contains; the bias of
/// c0 from a count that is half a particle off on average is below 1/(4 excluded).
///
/// time, count [n]. Throws InputError unless the lengths agree, the times are finite and increase, and no count is
/// negative.
DischargeFit fit_discharge(std::span<const Real> time, std::span<const std::int64_t> count);

}  // namespace pliant
