// What a disk of uniform pressure on a plane resists with when it slides and spins at the same time.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// The force F and the torque T of Coulomb friction on a disk of radius R that presses on a plane with N, evenly spread
/// [Z. Farkas, G. Bartels, T. Unger, D. E. Wolf, Phys. Rev. Lett. 90, 248302 (2003)]. In units of μN and μNR they are
/// points of one convex curve, a function of the ratio of velocity and spin; directions (v, Rω) are its normals, so it
/// is where slip takes the most energy. Slip is given by s = Rω/(v + Rω) in [0, 1].
/// The support function h(s) = (1 − s) F + s T, the power of the slip (1 − s, s), gives both: F = h − s h', T = h + (1
/// − s) h'. It is kept in a table, as cubics between exact values and slopes: F and T are off by less than 2·10⁻⁵, and
/// lie on a convex curve with these normals exactly.
class LimitSurface {
 public:
  static constexpr Real most_torque = 2.0 / 3;  ///< without sliding
  struct Point {
    Real force, torque;
    Real bend;  ///< h''
  };

  LimitSurface();

  PLIANT_INLINE Point at(Real s) const {
    const Real x = s * cells;
    const auto cell = static_cast<std::size_t>(std::min(x, Real(cells - 1)));
    const Real u = x - static_cast<Real>(cell);
    const std::array<Real, 4>& c = cubic_[cell];
    const Real h = c[0] + u * (c[1] + u * (c[2] + u * c[3])), slope = cells * (c[1] + u * (2 * c[2] + u * 3 * c[3]));
    return {h - s * slope, h + (1 - s) * slope, square(Real(cells)) * (2 * c[2] + 6 * u * c[3])};
  }

  /// The point of the curve that is nearest to (force, torque), both ≥ 0, and the slip that it stands for.
  struct Nearest {
    Real force, torque, slip;
    bool outside;  ///< whether the curve does not enclose what was given
  };
  /// To some 10⁻⁶. guess: of the slip, anything in [0, 1]. What is deep inside has no nearest point: returns itself.
  PLIANT_INLINE Nearest nearest(Real force, Real torque, Real guess) const {
    // Newton's method for the slip along which the point is off the curve, within bounds.
    Real low = 0, high = 1, s = guess;
    Point p = at(s);
    for (int k = 0; k < 60; ++k) {
      const Real over = (force - p.force) * s - (torque - p.torque) * (1 - s),
                 slope = (force - p.force) + (torque - p.torque) + p.bend * (square(s) + square(1 - s));
      if (over > 0)
        high = s;
      else
        low = s;
      Real next = slope > 0 ? s - over / slope : -1;
      if (!(next >= low && next <= high)) next = (low + high) / 2;
      const Real change = next - s;
      if (std::abs(change) < 5e-4) {  // what is left is of its square
        p.force -= s * p.bend * change;
        p.torque += (1 - s) * p.bend * change;
        s = next;
        break;
      }
      s = next;
      p = at(s);
    }
    const bool outside = (force - p.force) * (1 - s) + (torque - p.torque) * s > 0;
    return outside ? Nearest{p.force, p.torque, s, true} : Nearest{force, torque, s, false};
  }

  /// Whether a point is inside for sure, as it is under two chords of the curve that meet where v = Rω: in units where
  /// μN and μNR are `limit`, with the square of the force and the torque, which is ≥ 0. Takes no root and no division.
  PLIANT_INLINE static bool surely_inside(Real force2, Real torque, Real limit) {
    constexpr Real f = 8 / (3 * pi), t = 8 / (9 * pi);
    const Real a = limit - (1 - f) / t * torque, b = f / (most_torque - t) * (most_torque * limit - torque);
    return b >= 0 && force2 <= square(a) && force2 <= square(b);
  }

  /// F and T by complete elliptic integrals, which cancel each other where s is near 0: an error of 10⁻¹⁶/s⁴.
  static Point exact(Real s);

 private:
  static constexpr int cells = 128;
  std::vector<std::array<Real, 4>> cubic_;
};

/// The only one that there is.
const LimitSurface& limit_surface();

}  // namespace pliant
