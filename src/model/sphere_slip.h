// How a contact in space has moved within a step.
#pragma once

#include <utility>

#include <pliant/base/vector3.h>

namespace pliant {

/// Cosine and sine of an angle, to rounding: by series, of an angle that is large after it has been halved. Without
/// calls, which would cost loops over several contacts their registers.
template <class R>
PLIANT_INLINE std::pair<R, R> cosine_and_sine(R angle) {
  constexpr Real small = 0.05;  // as it mostly is for the rotation in one step
  R doublings{};
  for (int k = 0; k < 64 && any_of(magnitude(angle) >= small); ++k) {
    const MaskOf<R> far = magnitude(angle) >= small;
    angle = far ? angle / 2 : angle;
    doublings = far ? doublings + 1 : doublings;
  }
  const R a2 = angle * angle;
  R cosine = 1 - a2 * (1.0 / 2 - a2 * (1.0 / 24 - a2 * (1.0 / 720 - a2 * (1.0 / 40320))));
  R sine = angle * (1 - a2 * (1.0 / 6 - a2 * (1.0 / 120 - a2 * (1.0 / 5040 - a2 * (1.0 / 362880)))));
  for (; any_of(doublings > 0); doublings = doublings - 1) {
    const R twice = 2 * sine * cosine;
    cosine = doublings > 0 ? 1 - 2 * sine * sine : cosine;
    sine = doublings > 0 ? twice : sine;
  }
  return {cosine, sine};
}

/// The ratio of an arc of the unit circle to its chord, to rounding; of the square of half the chord. In the same way.
template <class R>
PLIANT_INLINE R arc_per_chord(R half2) {
  constexpr Real small = 1e-4;
  R ratio = 1 + R();  // of the chords of the divided arc, in sum, to the whole chord
  for (int k = 0; k < 8 && any_of(half2 >= small); ++k) {
    const MaskOf<R> far = half2 >= small;
    const R rest = 1 - half2, share = 2 / (1 + square_root(rest > 0 ? rest : R()));
    half2 = far ? half2 * share / 4 : half2;
    ratio = far ? ratio * square_root(share) : ratio;
  }
  return ratio * (1 + half2 * (1.0 / 6 + half2 * (3.0 / 40 + half2 * (15.0 / 336 + half2 * (105.0 / 3456)))));
}

/// The cosine c of half the angle between two directions, as 1/c (0 where they are opposite) and 1/(1 + c), to
/// rounding; of the square of half their chord, 1 − c². By series, of angles that are large by a root.
template <class R>
PLIANT_INLINE std::pair<R, R> half_angle(R half2) {
  constexpr Real small = 1e-4;  // as it mostly is for the rotation in one step
  R per_cosine = 1 + half2 * (1.0 / 2 + half2 * (3.0 / 8 + half2 * (5.0 / 16 + half2 * (35.0 / 128)))),
    share = 1.0 / 2 + half2 * (1.0 / 8 + half2 * (1.0 / 16 + half2 * (5.0 / 128 + half2 * (7.0 / 256))));
  const MaskOf<R> far = half2 >= small;
  if (any_of(far)) {
    const R rest = 1 - half2, cosine = square_root(rest > 0 ? rest : R()), per = 1 / cosine;
    per_cosine = far ? (cosine > 0 ? per : R()) : per_cosine;
    share = far ? 1 / (1 + cosine) : share;
  }
  return {per_cosine, share};
}

/// Between two directions n₀ and n of a contact: vectors across it turn as n does, by the shortest way, and about it by
/// half of the sum of the rotations of both bodies. The slip is seen from halfway, so that a step is of second order.
/// Of one contact, or of several in lanes; where n₀ is 0 all is finite.
template <class R>
class SphereSlip {
 public:
  using Vector = Vector3<R>;

  /// both: the rotations of both bodies, in sum.
  PLIANT_INLINE SphereSlip(const Vector& before, const Vector& n, const Vector& both) : before_(before), n_(n) {
    const Vector chord = n - before;
    half2_ = dot(chord, chord) / 4;
    const auto [per_cosine, share] = half_angle(half2_);
    middle_ = (per_cosine / 2) * (before + n);
    share_ = share;
    const auto [cosine, sine] = cosine_and_sine(R(dot(middle_, both) / 4));
    cosine_ = cosine, sine_ = sine;
  }

  /// The arc from n₀ to n on the unit sphere, straightened.
  PLIANT_INLINE Vector arc() const { return arc_per_chord(half2_) * (n_ - before_); }
  /// turned × n, halfway.
  PLIANT_INLINE Vector across(const Vector& turned) const { return cross(turned, middle_); }
  /// Of a body without curvature: the part of its way along the surface.
  PLIANT_INLINE Vector along(const Vector& way) const { return way - dot(middle_, way) * middle_; }
  /// A vector across n₀, across n.
  PLIANT_INLINE Vector carry(const Vector& spring) const { return carry_on(twist(turn(before_, middle_, spring))); }
  /// One across the direction halfway, across n.
  PLIANT_INLINE Vector carry_on(const Vector& slid) const { return turn(middle_, n_, twist(slid)); }

 private:
  /// x, across a, turned by the shortest rotation from a to b, by half the angle between n₀ and n.
  PLIANT_INLINE Vector turn(const Vector& a, const Vector& b, const Vector& x) const {
    return x - R(share_ * dot(b, x)) * (a + b);
  }
  PLIANT_INLINE Vector twist(const Vector& x) const { return cosine_ * x + sine_ * cross(middle_, x); }

  Vector before_, n_, middle_;
  R half2_, share_, cosine_, sine_;
};

}  // namespace pliant
