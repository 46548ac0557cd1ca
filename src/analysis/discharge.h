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

  Real c0 = unknown;               ///< 1/t0; NaN if the range of the fit has fewer than three samples or three counts
  Real error = unknown;            ///< one standard error of c0; NaN if there are too few samples for it
  Real chi2_per_dof = unknown;     ///< NaN as the error
  Real start_count = unknown;      ///< N − N_res of the law at the first sample of the fit
  std::int64_t residue = 0;        ///< N_res, the number of particles that stay on the bottom
  Real total_time = unknown;       ///< from the first sample to the first one with N = 0; NaN if it never empties
  std::size_t begin = 0, end = 0;  ///< samples [begin, end) of the fit
};

/// Fits dN/dt = −c0 sqrt(N − N_res) to the number N(t) left in the hopper: [H 15], with the sign of the flux, with
/// N_res particles that stay on the bottom. The law makes sqrt(N − N_res) a line of slope −c0/2; the line is a
/// regression.
///
/// N_res: on a flat bottom the last layer drains slowly, and some of it stays. N_res is the last count if it is at most
/// a quarter of the first and the flow faded: the last tenth of the particles that left took more than a quarter of the
/// time. Otherwise N_res is 0: the hopper emptied, or the flow stopped at once (an arch, the end of the run).
///
/// Range: from the time when 20 % of N(0) − N_res particles have left until 20 % remain, or the last particle leaves.
/// The law does not hold earlier, because the flow starts from rest, or later, because of the slow last layer (flat
/// bottom) or the free fall of the last particles (slopes).
///
/// Error: N is a count, therefore its deviations from the law add up to a random walk, and the textbook error of a
/// slope, which assumes independent deviations, is far too small. The fit divides its time into ten equal parts; the
/// error is the scatter of their ten slopes over sqrt(10). Each part needs three samples.
///
/// χ² compares the numbers of particles that leave in the ten parts with the law, with the variance of independent
/// departures (Poisson); 8 degrees of freedom. Dense flow is more regular: 0.1 to 0.8 per degree where the law holds.
/// Above 1.5 the law fails.
///
/// time, count [n]. Throws InputError unless the lengths agree, the times are finite and increase, and no count is
/// negative.
DischargeFit fit_discharge(std::span<const Real> time, std::span<const std::int64_t> count);

}  // namespace pliant
