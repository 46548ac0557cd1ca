#include <algorithm>
#include <cmath>

#include <pliant/analysis/profile.h>
#include <pliant/base/errors.h>

namespace pliant {

template <int D>
void add_axis_profile(std::span<const Real> heights, Real width, std::span<const Real> centres,
                      std::span<const Real> velocities, std::span<const std::uint8_t> active, std::span<Real> momentum,
                      std::span<Real> weight) {
  if (!(width > 0)) throw InputError("axis profile: the width {} of the Gaussian must be positive", width);
  if (centres.size() != D * active.size() || velocities.size() != centres.size())
    throw InputError("axis profile: {} coordinates and {} velocities for {} particles in {} dimensions", centres.size(),
                     velocities.size(), active.size(), D);
  if (momentum.size() != heights.size() || weight.size() != heights.size())
    throw InputError("axis profile: {} heights but sums of length {} and {}", heights.size(), momentum.size(),
                     weight.size());
  if (!std::ranges::is_sorted(heights)) throw InputError("axis profile: the heights do not ascend; sort them");

  constexpr int up = D - 1;
  const Real norm = std::pow(std::sqrt(2 * pi) * width, -D);
  const Real exponent = 1 / (2 * square(width));
  const Real cutoff_squared = std::log(1e16) / exponent;
  for (Index m = 0; m < static_cast<Index>(active.size()); ++m) {
    if (active[m] == 0) continue;
    const Vec<D> centre = point<D>(centres.data(), m);
    const Real from_axis = centre.template head<up>().squaredNorm();
    if (!(from_axis < cutoff_squared)) continue;
    const Real reach = std::sqrt(cutoff_squared - from_axis);
    const Real speed = -velocities[static_cast<std::size_t>(m) * D + up];
    auto k = static_cast<std::size_t>(std::ranges::lower_bound(heights, centre[up] - reach) - heights.begin());
    for (; k < heights.size() && heights[k] <= centre[up] + reach; ++k) {
      const Real phi = norm * std::exp(-(from_axis + square(heights[k] - centre[up])) * exponent);
      momentum[k] += speed * phi;
      weight[k] += phi;
    }
  }
}

template void add_axis_profile<2>(std::span<const Real>, Real, std::span<const Real>, std::span<const Real>,
                                  std::span<const std::uint8_t>, std::span<Real>, std::span<Real>);
template void add_axis_profile<3>(std::span<const Real>, Real, std::span<const Real>, std::span<const Real>,
                                  std::span<const std::uint8_t>, std::span<Real>, std::span<Real>);

std::vector<BlockAverage> axis_profile(std::span<const Real> momentum, std::span<const Real> weight,
                                       std::size_t heights) {
  if (momentum.size() != weight.size() || (heights == 0 ? !momentum.empty() : momentum.size() % heights != 0))
    throw InputError("axis profile: {} momenta and {} weights are not rows of {} heights", momentum.size(),
                     weight.size(), heights);
  std::vector<BlockAverage> profile;
  const std::size_t samples = heights == 0 ? 0 : momentum.size() / heights;
  std::vector<Real> momentum_column(samples), weight_column(samples);
  for (std::size_t k = 0; k < heights; ++k) {
    for (std::size_t s = 0; s < samples; ++s) {
      momentum_column[s] = momentum[s * heights + k];
      weight_column[s] = weight[s * heights + k];
    }
    profile.push_back(block_ratio(momentum_column, weight_column));
  }
  return profile;
}

}  // namespace pliant
