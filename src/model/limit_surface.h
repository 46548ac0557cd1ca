// Friction of a disk of uniform pressure on a plane that slides and spins at the same time.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <pliant/base/simd8.h>
#include <pliant/base/types.h>

namespace pliant {

/// The force F and the torque T of Coulomb friction on a disk of radius R that presses on a plane with N, evenly spread
/// [Z. Farkas, G. Bartels, T. Unger, D. E. Wolf, Phys. Rev. Lett. 90, 248302 (2003)]. In units of μN and μNR they are
/// points of one convex curve, a function of the ratio of velocity and spin; directions (v, Rω) are its normals, so
/// that the dissipation is largest. Slip is given by s = Rω/(v + Rω) in [0, 1].
/// The support function h(s) = (1 − s) F + s T, the power of the slip (1 − s, s), gives both: F = h − s h', T = h + (1
/// − s) h'. A table stores h as cubics between exact values and slopes: F and T are off by less than 2·10⁻⁵, and lie on
/// a convex curve with these normals exactly.
class LimitSurface {
 public:
  static constexpr Real most_torque = 2.0 / 3;  ///< at rest Values at one slip, or at several.
  template <class R>
  struct PointOf {
    R force, torque;
    R bend;  ///< h''
  };
  using Point = PointOf<Real>;

 private:
  template <class R>
  PLIANT_INLINE static PointOf<R> point_of(const std::array<R, 4>& c, R u, R s) {
    const R h = c[0] + u * (c[1] + u * (c[2] + u * c[3])), slope = Real(cells) * (c[1] + u * (2 * c[2] + u * 3 * c[3])),
            force = h - s * slope;
    return {force, force + slope, square(Real(cells)) * (2 * c[2] + 6 * u * c[3])};
  }
  /// How far (force, torque) is off the normal at s, and how that changes with s.
  template <class R>
  PLIANT_INLINE static std::pair<R, R> off_the_normal(R force, R torque, const PointOf<R>& p, R s) {
    const R df = force - p.force, dt = torque - p.torque, rest = 1 - s;
    return {simd::sum_of(df, s, -dt, rest), df + dt + p.bend * simd::sum_of(s, s, rest, rest)};
  }
  /// A small change of slip; the remainder is of its square.
  static constexpr Real enough = 5e-4;
  template <class R>
  PLIANT_INLINE static PointOf<R> moved(const PointOf<R>& p, R s, R change) {
    return {p.force - s * p.bend * change, p.torque + (1 - s) * p.bend * change, p.bend};
  }
  template <class R>
  PLIANT_INLINE static auto is_outside(R force, R torque, const PointOf<R>& p, R s) {
    return simd::sum_of(R(force - p.force), R(1 - s), R(torque - p.torque), s) > 0;
  }

 public:
  LimitSurface();

  PLIANT_INLINE Point at(Real s) const {
    const Real x = s * cells;
    const auto cell = static_cast<std::size_t>(std::min(x, Real(cells - 1)));
    return point_of<Real>(cubic_[cell], x - static_cast<Real>(cell), s);
  }
  PLIANT_INLINE PointOf<simd::Real4> at(simd::Real4 s) const {
    const simd::Real4 x = s * Real(cells);
    const simd::Int4 cell = simd::truncate(simd::min(x, simd::all(cells - 1)));
    std::array<simd::Real4, 4> c;
    for (int k = 0; k < 4; ++k) c[k] = simd::load4(cubic_[cell[k]].data());
    simd::transpose(c[0], c[1], c[2], c[3]);
    return point_of<simd::Real4>(c, x - simd::real(cell), s);
  }
  PLIANT_INLINE PointOf<simd::Real8> at(const simd::Real8& s) const {
    const PointOf<simd::Real4> p = at(s.a), q = at(s.b);
    return {{p.force, q.force}, {p.torque, q.torque}, {p.bend, q.bend}};
  }

  /// The point of the curve that is nearest to (force, torque), both ≥ 0, and its slip.
  struct Nearest {
    Real force, torque, slip;
    bool outside;  ///< whether the curve does not enclose the given point
  };
  /// To some 10⁻⁶. guess: of the slip, anything in [0, 1]. A point deep inside has no nearest point and is returned.
  PLIANT_INLINE Nearest nearest(Real force, Real torque, Real guess) const {
    // Newton's method for the slip along which the point is off the curve, within bounds.
    Real low = 0, high = 1, s = guess;
    Point p = at(s);
    for (int k = 0; k < 60; ++k) {
      const auto [over, slope] = off_the_normal(force, torque, p, s);
      if (over > 0)
        high = s;
      else
        low = s;
      Real next = slope > 0 ? s - over / slope : -1;
      if (!(next >= low && next <= high)) next = (low + high) / 2;
      const Real change = next - s;
      if (std::abs(change) < enough) {
        p = moved(p, s, change);
        s = next;
        break;
      }
      s = next;
      p = at(s);
    }
    return is_outside(force, torque, p, s) ? Nearest{p.force, p.torque, s, true} : Nearest{force, torque, s, false};
  }

  /// The same for eight, without bounds: a few steps of Newton's method.
  struct Nearest8 {
    simd::Real8 force, torque, slip;  ///< force and torque, also if the curve encloses the given point
    simd::Mask8 outside;
    simd::Mask8 found;  ///< lanes that have not converged need nearest()
  };
  /// of: mask of the requested lanes.
  PLIANT_INLINE Nearest8 nearest(const simd::Real8& force, const simd::Real8& torque, const simd::Real8& guess,
                                 const simd::Mask8& of) const {
    using simd::select;
    // Two steps do for most.
    simd::Real8 s = select(of, guess, 0.5);
    const auto [first_over, first_slope] = off_the_normal(force, torque, at(s), s);
    s = simd::min(simd::max(s - first_over / first_slope, 0), 1);
    PointOf<simd::Real8> p = at(s);
    simd::Mask8 found{};
    for (int k = 0; k < 3; ++k) {
      const auto [over, slope] = off_the_normal(force, torque, p, s);
      const simd::Real8 next = s - over / slope, change = next - s;
      // Converged lanes stay unchanged while other lanes iterate.
      const simd::Mask8 ends = of & ~found & (slope > 0) & (next >= 0) & (next <= 1) & (simd::abs(change) < enough);
      const PointOf<simd::Real8> end = moved(p, s, change);
      p.force = select(ends, end.force, p.force);
      p.torque = select(ends, end.torque, p.torque);
      s = select(ends, next, s);
      found = found | ends;
      const simd::Mask8 open = of & ~found;
      if (!simd::any(open)) break;
      s = select(open, simd::min(simd::max(next, 0), 1), s);
      const PointOf<simd::Real8> there = at(s);
      p.force = select(open, there.force, p.force);
      p.torque = select(open, there.torque, p.torque);
      p.bend = there.bend;
    }
    return {p.force, p.torque, s, is_outside(force, torque, p, s), found};
  }

  /// Whether a point is certainly inside, because it lies below two chords of the curve that meet where v = Rω: in
  /// units where μN and μNR are `limit`, with the square of the force and the torque, which is ≥ 0. Takes no root and
  /// no division.
  template <class R>
  PLIANT_INLINE static auto surely_inside(R force2, R torque, R limit) {
    constexpr Real f = 8 / (3 * pi), t = 8 / (9 * pi);
    const R a = limit - (1 - f) / t * torque, b = f / (most_torque - t) * (most_torque * limit - torque);
    return (b >= 0) & (force2 <= a * a) & (force2 <= b * b);
  }

  /// F and T by complete elliptic integrals, which cancel each other where s is near 0: an error of 10⁻¹⁶/s⁴.
  static Point exact(Real s);

 private:
  static constexpr int cells = 128;
  std::vector<std::array<Real, 4>> cubic_;
};

/// The only instance.
const LimitSurface& limit_surface();

}  // namespace pliant
