// How wide the skin of the neighbour lists should be.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <pliant/base/types.h>

namespace pliant {

/// How neighbour lists were used.
struct ListUse {
  std::int64_t evaluations = 0, rebuilds = 0;
};

/// The skin for which lists cost least, in the unit of width, from the use of the present one. Per point and
/// evaluation a list costs its pairs plus its share of a rebuild,
///   P(s) + R/k(s),  P ∝ (width + s)^dim,  k ∝ s evaluations between two rebuilds:
/// because the fastest particle decides, and it flies freely. R is the cost of a rebuild, in visits of a pair. pairs:
/// listed per point; width: mean contact diameter. Depends on counts only, so that a run does not depend on the clock.
inline Real best_skin(Real skin, const ListUse& use, int dim, Real pairs, Real width) {
  const Real rebuild_in_visits = dim == 2 ? 60 : 150;
  const Real interval = static_cast<Real>(use.evaluations) / static_cast<Real>(std::max<std::int64_t>(use.rebuilds, 1));
  const auto cost = [&](Real s) {
    return pairs * std::pow((width + s) / (width + skin), dim) + rebuild_in_visits * skin / (interval * s);
  };
  // Not far at once: the law is a rough one, and particles may speed up.
  Real best = skin;
  for (Real s = 0.6 * skin; s < 1.7 * skin; s *= 1.02)
    if (s < width && cost(s) < cost(best)) best = s;
  return best;
}

}  // namespace pliant
