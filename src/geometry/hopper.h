// The hopper of [H 2.1]: two upright walls W apart that close at angle θ_w to gravity down to an orifice of width w at
// y = 0; in 3D its figure of revolution about z (a flat-bottomed cylinder at 90°).
#pragma once

#include <pliant/base/cure.h>
#include <pliant/geometry/walls.h>

namespace pliant {

/// Lengths in σ_avg, angle between a sloped wall and the direction of gravity in degrees (90: flat bottom).
struct Hopper {
  Real wall_distance = 50;  ///< W
  Real orifice = 5;         ///< w
  Real angle = 90;          ///< θ_w

  Real slope_height() const { return angle == 90 ? 0 : (wall_distance - orifice) / (2 * std::tan(angle * pi / 180)); }

  /// Half of the distance between the walls at height y.
  Real half_width(Real y) const {
    const Real top = slope_height();
    if (y >= top) return wall_distance / 2;
    return y <= 0 ? orifice / 2 : orifice / 2 + (wall_distance - orifice) / 2 * y / top;
  }

  /// Area (volume) between the orifice and height y.
  Real capacity(int dim, Real y) const {
    const Real slope = slope_height(), bottom = orifice / 2, top = wall_distance / 2;
    const Real s = std::min(y, slope), at = half_width(s);
    if (dim == 2) return s * (bottom + at) + 2 * top * std::max(y - slope, Real(0));
    return pi / 3 * s * (square(bottom) + bottom * at + square(at)) + pi * square(top) * std::max(y - slope, Real(0));
  }

  /// Walls of the hopper: for each side the sloped wall from the orifice up, then the upright one, without end, and a
  /// joint where they meet.
  /// Errors: InputError where the measures make no hopper.
  WallParts walls(int dim) const {
    check();
    WallParts walls;
    for (const Real side : {-1.0, 1.0}) {
      if (dim == 3 && side < 0) continue;
      const Vec<2> lip(side * orifice / 2, 0), corner(side * wall_distance / 2, slope_height());
      walls.lips.push_back({lip, walls.next()});
      walls.joints.push_back({corner, walls.next() + 1, walls.next(), false});
      walls.segments.push_back(WallSegment::between(lip, corner));
      walls.segments.push_back(WallSegment::ray(corner, {0, 1}));
    }
    return walls;
  }
  template <int D>
  Walls<D> walls() const {
    return Walls<D>(walls(D));
  }

  void check() const {
    if (!(orifice > 0))
      throw InputError("orifice width w = {} must be positive; use {}", orifice, cures({Cure::wider_orifice}));
    if (!(orifice < wall_distance))
      throw InputError("orifice width w = {} must be less than the distance W = {} between the walls; use {}", orifice,
                       wall_distance, cures({Cure::narrower_orifice, Cure::wider_container}));
    if (!(angle > 0 && angle <= 90))
      throw InputError("hopper angle {} degrees must be above 0 and at most 90; use {}", angle,
                       cures({Cure::other_angle}));
  }
};

}  // namespace pliant
