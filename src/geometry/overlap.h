// Volumes that a sphere shares with another sphere and with the depletion layer of a solid, with their derivatives.
#pragma once

#include <cmath>

#include <pliant/geometry/solid.h>

namespace pliant {

/// A function of one distance, with its derivatives.
struct Radial {
  Real value = 0, slope = 0, curvature = 0;
};

/// Two spheres of radii a and b at the distance r, |a − b| < r [T 2.4, 2.6]. C¹ where they touch.
inline Radial lens_volume(Real r, Real a, Real b) {
  const Real s = a + b, s2 = square(s), d2 = square(a - b), r2 = r * r;
  if (r >= s) return {};
  return {pi / (12 * r) * square(s - r) * (r2 + 2 * r * s - 3 * d2), -pi / 4 * (s - r) * (s + r) * (r2 - d2) / r2,
          pi / 2 * (r - s2 * d2 / (r2 * r))};
}

/// A sphere and a half-space whose surface is at the distance y ≥ −radius from its centre. C¹ where they touch.
inline Radial cap_volume(Real y, Real radius) {
  const Real c = radius - y;
  if (c <= 0) return {};
  return {pi / 3 * square(c) * (2 * radius + y), -pi * c * (radius + y), 2 * pi * y};
}

/// A function of a point, with its derivatives.
template <int D>
struct Expansion {
  Real value = 0;
  Vec<D> gradient = Vec<D>::Zero();
  Mat<D> hessian = Mat<D>::Zero();
};

/// A sphere round p, in the coordinates of a wedge with this opening (solid.h), and the region within `layer` of the
/// wedge: the wedge, a layer on its faces, and a round edge. p must be farther than `layer` from the wedge. Exact to
/// rounding, except where the far end of the round edge is just touched from within, which needs a sphere pushed deep
/// into a face next to the tip.
Expansion<2> wedge_overlap(const Vec<2>& p, Real opening, Real radius, Real layer);

/// The volume that a sphere round r, in the plane or in space, shares with all that is less than `layer` from a solid.
/// Its distance d from the solid must be positive; from a wedge it must be more than `layer`.
template <int D>
Expansion<D> layer_overlap(const Solid<D>& solid, const Vec<D>& r, Real radius, Real layer) {
  const Vec<2> p = solid.plane(r);
  if (solid.flat()) {
    const Radial cap = cap_volume(p[1] - layer, radius);
    return {cap.value, cap.slope * solid.out, cap.curvature * solid.out * solid.out.transpose()};
  }
  const Expansion<2> overlap = wedge_overlap(p, solid.opening, radius, layer);
  return {overlap.value, solid.lift(overlap.gradient), solid.lift(overlap.hessian)};
}

}  // namespace pliant
