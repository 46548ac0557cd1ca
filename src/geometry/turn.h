// The angle between two directions of the plane.
#pragma once

#include <cmath>
#include <cstddef>
#include <type_traits>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// Angle in (−π, π] from the unit vector a to b, counter-clockwise: arcsin by its series where it is small, as it
/// mostly is for what moves in one step; exact to rounding. Of numbers, or of vectors of them.
template <class R>
PLIANT_INLINE R turn_between(R ax, R ay, R bx, R by) {
  const R sine = ax * by - ay * bx, cosine = ax * bx + ay * by, s2 = sine * sine;
  const R turn = sine * (1 + s2 * (1.0 / 6 + s2 * (3.0 / 40 + s2 * (15.0 / 336 + s2 * (105.0 / 3456)))));
  const auto small = (cosine > 0) & ((sine < 0 ? -sine : sine) < 0.03);
  if constexpr (std::is_arithmetic_v<R>) {
    return small ? turn : std::atan2(sine, cosine);
  } else {
    bool all = true;
    R exact = turn;
    for (std::size_t k = 0; k < sizeof(R) / sizeof(Real); ++k) all = all && small[k];
    if (all) return turn;
    for (std::size_t k = 0; k < sizeof(R) / sizeof(Real); ++k)
      if (!small[k]) exact[k] = std::atan2(sine[k], cosine[k]);
    return exact;
  }
}
PLIANT_INLINE Real turn_between(const Vec<2>& a, const Vec<2>& b) { return turn_between(a[0], a[1], b[0], b[1]); }

}  // namespace pliant
