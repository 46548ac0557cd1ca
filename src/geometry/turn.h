// The angle between two directions of the plane.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include <pliant/base/lanes.h>

namespace pliant {

/// arcsin of sines, or where one is not small the angle to which cosines belong, too: exact to rounding. Of numbers, or
/// of vectors of them.
template <class R>
PLIANT_INLINE R turn_of(R sine, R cosine) {
  constexpr Real small = 0.01;  // as most turns in one step are
  const R s2 = sine * sine;
  const R turn = sine * (1 + s2 * (1.0 / 6 + s2 * (3.0 / 40 + s2 * (15.0 / 336))));
  if constexpr (std::is_arithmetic_v<R>) {
    return cosine > 0 && std::abs(sine) < small ? turn : std::atan2(sine, cosine);
  } else {
    const auto far = (cosine < 0) | (magnitude(sine) >= small);
    std::int64_t any = 0;
    for (std::size_t k = 0; k < sizeof(R) / sizeof(Real); ++k) any |= far[k];
    if (any == 0) return turn;
    R exact = turn;
    for (std::size_t k = 0; k < sizeof(R) / sizeof(Real); ++k)
      if (far[k]) exact[k] = std::atan2(sine[k], cosine[k]);
    return exact;
  }
}

/// Angle in (−π, π] from the unit vector a to b, counter-clockwise.
PLIANT_INLINE Real turn_between(const Vec<2>& a, const Vec<2>& b) {
  return turn_of(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
}
/// As turn_between, for two lines, in [−π/2, π/2]: the signs of the vectors along the lines do not matter. 0 for a zero
/// vector.
template <class R>
PLIANT_INLINE R turn_between_lines(R ax, R ay, R bx, R by) {
  const R sine = ax * by - ay * bx, cosine = ax * bx + ay * by;
  return turn_of(times_sign_of(cosine, sine), magnitude(cosine));
}

}  // namespace pliant
