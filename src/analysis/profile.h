// Velocity on the axis of the hopper against the height above the orifice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <pliant/analysis/block_average.h>
#include <pliant/base/types.h>

namespace pliant {

/// Adds one configuration to the sums of the coarse-grained axis profile [H Fig. 5] at the points r_k at height h_k on
/// the axis (x = 0 in 2D, x = y = 0 in 3D):
///   momentum[k] += Σ_i v_i φ(r_k − r_i),  weight[k] += Σ_i φ(r_k − r_i),  φ(r) = (sqrt(2π) s)^(−D) exp(−r²/2s²),
/// v_i the speed along gravity, −y (2D) or −z (3D), s the width (σ_avg). The profile is momentum/weight: without the
/// denominator, as [H] prints it, it would be a flux. The prefactor has D where [H] has 2. Particles for which φ falls
/// below 1e−16 of φ(0), at 8.6 s, do not count; a height with none near it keeps weight 0.
///
/// heights [H] ascending, above the orifice plane; centres, velocities [D · N] interleaved; active [N]; momentum,
/// weight [H]. Cost: N distances to the axis plus a Gaussian per particle and height that are near.
/// Throws InputError if lengths do not agree, the heights do not ascend or the width is not positive.
template <int D>
void add_axis_profile(std::span<const Real> heights, Real width, std::span<const Real> centres,
                      std::span<const Real> velocities, std::span<const std::uint8_t> active, std::span<Real> momentum,
                      std::span<Real> weight);

extern template void add_axis_profile<2>(std::span<const Real>, Real, std::span<const Real>, std::span<const Real>,
                                         std::span<const std::uint8_t>, std::span<Real>, std::span<Real>);
extern template void add_axis_profile<3>(std::span<const Real>, Real, std::span<const Real>, std::span<const Real>,
                                         std::span<const std::uint8_t>, std::span<Real>, std::span<Real>);

/// Velocity and block error at each height from one row of sums per sample (momentum, weight [samples · heights], as in
/// `/series` of a run): `block_ratio` of each column. Throws InputError if the lengths are not such a product.
std::vector<BlockAverage> axis_profile(std::span<const Real> momentum, std::span<const Real> weight,
                                       std::size_t heights);

}  // namespace pliant
