// How a contact in space has moved within a step.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// Between two directions n₀ and n of a contact: vectors across it turn as n does, by the shortest way, and about it by
/// half of what two bodies have turned together. What slides is seen from halfway, so that a step is of second order.
class SphereSlip {
 public:
  /// both: what both bodies have turned, in sum.
  PLIANT_INLINE SphereSlip(const Vec<3>& before, const Vec<3>& n, const Vec<3>& both)
      : before_(before), n_(n), middle_((before + n).normalized()) {
    const Real half_twist = middle_.dot(both) / 4;
    cosine_ = std::cos(half_twist), sine_ = std::sin(half_twist);
  }

  /// The arc from n₀ to n on the unit sphere, straightened.
  PLIANT_INLINE Vec<3> arc() const {
    const Vec<3> chord = n_ - before_;
    const Real half = chord.norm() / 2;
    return (half < 1e-4 ? 1 + square(half) / 6 : std::asin(std::min(half, 1.0)) / half) * chord;
  }
  /// turned × n, halfway.
  PLIANT_INLINE Vec<3> across(const Vec<3>& turned) const { return turned.cross(middle_); }
  /// Of a body without curvature: what of its way is along the surface.
  PLIANT_INLINE Vec<3> along(const Vec<3>& way) const { return way - middle_.dot(way) * middle_; }
  /// A vector across n₀, across n.
  PLIANT_INLINE Vec<3> carry(const Vec<3>& spring) const { return carry_on(twist(turn(before_, middle_, spring))); }
  /// One across the direction halfway, across n.
  PLIANT_INLINE Vec<3> carry_on(const Vec<3>& slid) const { return turn(middle_, n_, twist(slid)); }

 private:
  /// Turned by the shortest rotation from a to b.
  PLIANT_INLINE static Vec<3> turn(const Vec<3>& a, const Vec<3>& b, const Vec<3>& x) {
    const Vec<3> w = a.cross(b);
    const Real cosine = a.dot(b);
    return cosine * x + w.cross(x) + w.dot(x) / (1 + cosine) * w;
  }

  PLIANT_INLINE Vec<3> twist(const Vec<3>& x) const { return cosine_ * x + sine_ * middle_.cross(x); }

  Vec<3> before_, n_, middle_;
  Real cosine_, sine_;
};

}  // namespace pliant
