// When a particle that was above the orifice line in one step and below it in the next was on it.
#pragma once

#include <array>

#include <pliant/base/types.h>

namespace pliant {

/// Where a particle's centre was, and how fast. Plain data, to be sent.
template <int D>
struct Sighting {
  Real t = 0;
  std::array<Real, D> x{}, v{};
};

/// From the last sight of a particle above height 0 (x[D − 1] ≥ 0) and the first below: the one on the line, by the
/// cubic through positions and velocities, with an error of O(dt⁴) in x. If `above` is not, it is the answer.
template <int D>
Sighting<D> on_the_line(const Sighting<D>& above, const Sighting<D>& below) {
  const Real h = below.t - above.t;
  const auto at = [&](Real s) {
    const Real x1 = s * s * (3 - 2 * s), v0 = h * s * (1 - s) * (1 - s), v1 = h * s * s * (s - 1);
    Sighting<D> result{above.t + s * h, {}, {}};
    for (int k = 0; k < D; ++k) {
      result.x[k] = (1 - x1) * above.x[k] + x1 * below.x[k] + v0 * above.v[k] + v1 * below.v[k];
      result.v[k] = h > 0 ? 6 * s * (1 - s) * (below.x[k] - above.x[k]) / h + (1 - s) * (1 - 3 * s) * above.v[k] +
                                s * (3 * s - 2) * below.v[k]
                          : above.v[k];
    }
    return result;
  };
  Real low = 0, high = 1;
  for (Real s = 0.5; low < s && s < high; s = (low + high) / 2) (at(s).x[D - 1] > 0 ? low : high) = s;
  return at(low);
}

}  // namespace pliant
