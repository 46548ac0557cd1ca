// Distance of a point to a segment, its gradient and its Hessian: the geometry under every contact.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <pliant/base/types.h>

namespace pliant {

/// Nearest point of the closed segment a–b to p: at a + t (b − a), 0 ≤ t ≤ 1.
template <int D>
struct FootOnSegment {
  Vec<D> offset;  ///< p − nearest point
  Real t;
  Real d2;  ///< squared distance

  bool interior() const { return t > 0 && t < 1; }
};
using SegmentFoot = FootOnSegment<2>;

template <int D>
FootOnSegment<D> foot_on_segment(const Vec<D>& p, const Vec<D>& a, const Vec<D>& b) {
  const Vec<D> u = b - a, w = p - a;
  const Real uu = u.squaredNorm();
  const Real t = uu > 0 ? std::clamp(w.dot(u) / uu, Real(0), Real(1)) : 0;
  const Vec<D> offset = w - t * u;
  return {offset, t, offset.squaredNorm()};
}
inline SegmentFoot segment_foot(const Vec<2>& p, const Vec<2>& a, const Vec<2>& b) {
  return foot_on_segment<2>(p, a, b);
}

/// Unit vector along r of length d; zero where d = 0, where the direction does not exist.
template <int D>
Vec<D> direction(const Vec<D>& r, Real d) {
  return d > 0 ? Vec<D>(r / d) : Vec<D>(Vec<D>::Zero());
}

/// Hessian of |r| with respect to r: (1 − n nᵀ)/|r|.
template <int D>
Mat<D> distance_curvature(const Vec<D>& n, Real d) {
  return d > 0 ? Mat<D>((Mat<D>::Identity() - n * n.transpose()) / d) : Mat<D>(Mat<D>::Zero());
}

/// Where a wall is nearest to a point: the distance d, the unit vector n from there to the point (∇d), and ∇²d. Near an
/// axis of revolution n = ∇d is shorter (RoundedRadius).
template <int D>
struct WallFoot {
  Real d;
  Vec<D> n;
  Mat<D> curvature;
};

/// First and second derivatives of the distance d(p, a, b) of p to the closed segment a–b, with respect to the points
/// p, a, b. d is C¹; its Hessian jumps where the foot reaches an end.
struct SegmentDistance {
  Real d;
  std::array<Vec<2>, 3> gradient;
  std::array<std::array<Mat<2>, 3>, 3> hessian;
};

/// Inside the segment, with τ its direction, n the unit vector from the foot to p and L its length, the second
/// variation is −2 α δθ − d δθ², α = τ·(δp − (1−t) δa − t δb), δθ = n·(δb − δa)/L the turn of the segment.
inline SegmentDistance segment_distance(const Vec<2>& p, const Vec<2>& a, const Vec<2>& b) {
  const SegmentFoot foot = segment_foot(p, a, b);
  SegmentDistance result;
  result.d = std::sqrt(foot.d2);
  const Vec<2> n = direction<2>(foot.offset, result.d);
  const std::array<Real, 3> weight{1, -(1 - foot.t), -foot.t};
  for (int k = 0; k < 3; ++k) result.gradient[k] = weight[k] * n;
  if (!foot.interior()) {
    const Mat<2> curvature = distance_curvature<2>(n, result.d);
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) result.hessian[k][l] = weight[k] * weight[l] * curvature;
    return result;
  }
  const Real length = (b - a).norm();
  const Vec<2> tangent = (b - a) / length;
  const std::array<Real, 3> turn{0, -1 / length, 1 / length};
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l)
      result.hessian[k][l] = -weight[k] * turn[l] * tangent * n.transpose() -
                             turn[k] * weight[l] * n * tangent.transpose() -
                             result.d * turn[k] * turn[l] * n * n.transpose();
  return result;
}

}  // namespace pliant
