// Motion of a contact in space within a step.
#pragma once

#include <utility>

#include <pliant/base/vector3.h>

namespace pliant {

/// Cosine and sine of an angle, to rounding: by series, of an angle that is large after it has been halved. Without
/// calls, which would cost loops over several contacts their registers.
template <class R>
PLIANT_INLINE std::pair<R, R> cosine_and_sine(R angle) {
  constexpr Real small = 0.02;  // rotations in one step are mostly smaller
  const auto series = [](R a) PLIANT_INLINE_LAMBDA {
    const R a2 = a * a, a4 = a2 * a2;
    return std::pair<R, R>((1 - a2 / 2) + a4 * (1.0 / 24 - a2 / 720),
                           a * ((1 - a2 * (1.0 / 6)) + a4 * (1.0 / 120 - a2 * (1.0 / 5040))));
  };
  if (!any_of(magnitude(angle) >= small)) return series(angle);
  R doublings{};
  for (int k = 0; k < 64 && any_of(magnitude(angle) >= small); ++k) {
    const MaskOf<R> far = magnitude(angle) >= small;
    angle = far ? angle / 2 : angle;
    doublings = far ? doublings + 1 : doublings;
  }
  auto [cosine, sine] = series(angle);
  for (; any_of(doublings > 0); doublings = doublings - 1) {
    const R twice = 2 * sine * cosine;
    cosine = doublings > 0 ? 1 - 2 * sine * sine : cosine;
    sine = doublings > 0 ? twice : sine;
  }
  return {cosine, sine};
}

/// The square of half a chord of the unit circle below which the series of the next two functions are exact to
/// rounding. Chords of one step are mostly shorter.
inline constexpr Real short_half2 = 5e-5;

/// The ratio of an arc of the unit circle to its chord, to rounding; half2: the square of half the chord.
template <class R>
PLIANT_INLINE R arc_per_chord(R half2) {
  const auto series = [](R h)
                          PLIANT_INLINE_LAMBDA { return (1 + h * (1.0 / 6)) + h * h * (3.0 / 40 + h * (15.0 / 336)); };
  if (!any_of(half2 >= short_half2)) return series(half2);
  R ratio = 1 + R();  // of the chords of the divided arc, in sum, to the whole chord
  for (int k = 0; k < 8 && any_of(half2 >= short_half2); ++k) {
    const MaskOf<R> far = half2 >= short_half2;
    const R rest = 1 - half2, share = 2 / (1 + square_root(rest > 0 ? rest : R()));
    half2 = far ? half2 * share / 4 : half2;
    ratio = far ? ratio * square_root(share) : ratio;
  }
  return ratio * series(half2);
}

/// The cosine c of half the angle between two directions, as 1/c (0 where they are opposite) and 1/(1 + c), to
/// rounding; half2: the square of half their chord, 1 − c².
template <class R>
PLIANT_INLINE std::pair<R, R> half_angle(R half2) {
  const R squared = half2 * half2;
  R per_cosine = (1 + half2 / 2) + squared * (3.0 / 8 + half2 * (5.0 / 16)),
    share = (1.0 / 2 + half2 / 8) + squared * (1.0 / 16 + half2 * (5.0 / 128));
  const MaskOf<R> far = half2 >= short_half2;
  if (any_of(far)) {
    const R rest = 1 - half2, cosine = square_root(rest > 0 ? rest : R()), per = 1 / cosine;
    per_cosine = far ? (cosine > 0 ? per : R()) : per_cosine;
    share = far ? 1 / (1 + cosine) : share;
  }
  return {per_cosine, share};
}

/// Between two directions n₀ and n of a contact: vectors across it turn as n does, by the shortest way, and about it by
/// half of the sum of the rotations of both bodies. The slip is evaluated halfway, so that a step is of second order.
/// For one contact, or for several in lanes; if n₀ is 0 all results are finite.
template <class R>
class SphereSlip {
 public:
  using Vector = Vector3<R>;

  /// both: the sum of the rotations of both bodies.
  PLIANT_INLINE SphereSlip(const Vector& before, const Vector& n, const Vector& both) : before_(before), n_(n) {
    const Vector chord = n - before, sum = before + n;
    half2_ = dot(chord, chord) / 4;
    const auto [per_cosine, share] = half_angle(half2_);
    const R half = per_cosine / 2;
    middle_ = half * sum;
    share_ = share;
    const auto [cosine, sine] = cosine_and_sine(R(half / 4 * dot(sum, both)));
    cosine_ = cosine, sine_ = sine;
  }

  /// The arc from n₀ to n on the unit sphere, straightened.
  PLIANT_INLINE Vector arc() const { return arc_per_chord(half2_) * (n_ - before_); }
  /// turned × n, halfway.
  PLIANT_INLINE Vector across(const Vector& turned) const { return cross(turned, middle_); }
  /// For a body without curvature: the part of its displacement along the surface.
  PLIANT_INLINE Vector along(const Vector& way) const { return way - dot(middle_, way) * middle_; }
  /// Turns a vector across n₀ into a vector across n.
  PLIANT_INLINE Vector carry(const Vector& spring) const {
    return turn(middle_, n_, twist(1 - 2 * sine_ * sine_, 2 * sine_ * cosine_, turn(before_, middle_, spring)));
  }
  /// Turns a vector across the direction halfway into a vector across n.
  PLIANT_INLINE Vector carry_on(const Vector& slid) const { return turn(middle_, n_, twist(cosine_, sine_, slid)); }

 private:
  /// x, across a, turned by the shortest rotation from a to b, by half the angle between n₀ and n.
  PLIANT_INLINE Vector turn(const Vector& a, const Vector& b, const Vector& x) const {
    return x - R(share_ * dot(b, x)) * (a + b);
  }
  PLIANT_INLINE Vector twist(R cosine, R sine, const Vector& x) const { return cosine * x + sine * cross(middle_, x); }

  Vector before_, n_, middle_;
  R half2_, share_, cosine_, sine_;
};

}  // namespace pliant
