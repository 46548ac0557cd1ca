// The angle between two directions of the plane.
#pragma once

#include <cmath>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// Angle in (−π, π] from the unit vector a to b, counter-clockwise: arcsin by its series where it is small, as it
/// mostly is for what moves in one step; exact to rounding.
PLIANT_INLINE Real turn_between(const Vec<2>& a, const Vec<2>& b) {
  const Real sine = a[0] * b[1] - a[1] * b[0], cosine = a.dot(b);
  if (cosine > 0 && std::abs(sine) < 0.03) {
    const Real s2 = sine * sine;
    return sine * (1 + s2 * (1.0 / 6 + s2 * (3.0 / 40 + s2 * (15.0 / 336 + s2 * (105.0 / 3456)))));
  }
  return std::atan2(sine, cosine);
}

}  // namespace pliant
