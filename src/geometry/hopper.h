// The hopper of [H 2.1]: two upright walls W apart that close at angle θ_w to gravity down to an orifice of width w at
// y = 0; in 3D its figure of revolution about z (a flat-bottomed cylinder at 90°).
#pragma once

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

  /// Walls of the hopper: for each side the sloped wall from the orifice up, then the upright one, without end.
  /// Errors: InputError where the measures make no hopper.
  template <int D>
  Walls<D> walls() const {
    check();
    std::vector<WallSegment> segments;
    std::vector<Vec<2>> lips;
    for (const Real side : {-1.0, 1.0}) {
      if (D == 3 && side < 0) continue;
      const Vec<2> lip(side * orifice / 2, 0), corner(side * wall_distance / 2, slope_height());
      segments.push_back(WallSegment::between(lip, corner));
      segments.push_back(WallSegment::ray(corner, {0, 1}));
      if (D == 2) lips.push_back(lip);
    }
    return Walls<D>(std::move(segments), std::move(lips));
  }

  /// The same with a lid at height `lid` and the orifice shut: a box to pack particles in.
  template <int D>
  Walls<D> closed(Real lid) const {
    std::vector<WallSegment> segments = walls<D>().segments();
    const Real left = D == 2 ? -1 : 0;
    segments.push_back(WallSegment::between({left * orifice / 2, 0}, {orifice / 2, 0}));
    segments.push_back(WallSegment::between({left * wall_distance / 2, lid}, {wall_distance / 2, lid}));
    return Walls<D>(std::move(segments));
  }

  void check() const {
    if (!(orifice > 0)) throw InputError("orifice width w = {} must be positive; set -hopper_width", orifice);
    if (!(orifice < wall_distance))
      throw InputError(
          "orifice width w = {} must be less than the distance W = {} between the walls; lower -hopper_width "
          "or raise -hopper_wall_distance",
          orifice, wall_distance);
    if (!(angle > 0 && angle <= 90))
      throw InputError("hopper angle {} degrees must be above 0 and at most 90; set -hopper_angle", angle);
  }
};

}  // namespace pliant
