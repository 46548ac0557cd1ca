// Distance of a segment in space to a circle about the z axis: the geometry of the rims of round openings.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <pliant/base/types.h>

namespace pliant {

/// Length of (x, y). std::hypot takes several times as long; its extreme numbers do not occur in lengths of particles.
inline Real length_of(Real x, Real y) { return std::sqrt(x * x + y * y); }

/// A circle about the z axis.
struct Circle {
  Real radius, height;

  /// The nearest place to p; for p on the axis, some place.
  Vec<3> nearest(const Vec<3>& p) const {
    const Real rho = length_of(p[0], p[1]);
    return rho > 0 ? Vec<3>(radius / rho * p[0], radius / rho * p[1], height) : Vec<3>(radius, 0, height);
  }
  Real distance(const Vec<3>& p) const { return length_of(length_of(p[0], p[1]) - radius, p[2] - height); }
};

/// Where the closed segment from a to b is nearest to a circle: at a + t (b − a). If it is as near at several places,
/// one of them.
inline Real nearest_to_circle(const Circle& circle, const Vec<3>& a, const Vec<3>& b) {
  const Vec<3> u = b - a, p = a - Vec<3>(0, 0, circle.height);
  const Real uu = u.squaredNorm(), flat2 = square(u[0]) + square(u[1]), cross = p[0] * u[1] - p[1] * u[0];
  // With ρ(t) = √(c²/f + f (t − m)²), where f = |u_xy|² and c = p_xy × u_xy, half of the squared distance has the slope
  //   g(t) = (p + t u)·u − R ρ'(t), ρ' = f (t − m)/ρ, ρ'' = c²/ρ³.
  const Real middle = flat2 > 0 ? -(p[0] * u[0] + p[1] * u[1]) / flat2 : 0;
  const auto rho = [&](Real t) { return length_of(p[0] + t * u[0], p[1] + t * u[1]); };
  const auto slope = [&](Real t) {
    const Real r = rho(t);
    return p.dot(u) + t * uu - (r > 0 ? circle.radius * flat2 * (t - middle) / r : 0);
  };
  const auto height2 = [&](Real t) { return square(rho(t) - circle.radius) + square(p[2] + t * u[2]); };
  Real best = 0, least = height2(0);
  const auto take = [&](Real t) {
    if (const Real d2 = height2(t); d2 < least) best = t, least = d2;
  };
  take(1);
  // On each side of m the slope is convex towards the end of the segment, so there is one place at most where it turns
  // from down to up, and Newton's steps from the end lead there.
  const Real split = std::clamp(middle, Real(0), Real(1));
  for (const auto& [end, inner, sign] : {std::array{Real(1), split, Real(1)}, std::array{Real(0), split, Real(-1)}}) {
    if (!(sign * (end - inner) > 0)) continue;
    Real t = end;
    for (int k = 0; k < 60; ++k) {
      const Real g = sign * slope(t), r = rho(t);
      if (!(g > 0) || !(r > 0)) break;
      const Real rise = uu - circle.radius * square(cross) / (r * r * r);
      if (!(rise > 0)) break;
      const Real next = t - sign * g / rise;
      if (!(sign * (next - inner) >= 0) || next == t) break;
      t = next;
    }
    if (t != end) take(t);
  }
  return best;
}

}  // namespace pliant
