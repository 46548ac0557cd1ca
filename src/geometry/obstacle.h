// Obstacles in a container: disks and polygons, in 3D their figures of revolution.
#pragma once

#include <vector>

#include <pliant/geometry/walls.h>

namespace pliant {

/// ∫ x dy (3D: π ∫ ρ² dz) along the polyline, up to height y: the area between it and the axis, negative where the line
/// runs downwards.
Real swept_area(int dim, const Vec<2>& a, const Vec<2>& b, Real y);

/// A disk about its only corner, or a polygon. In 3D the coordinates are (ρ, z): a sphere on the axis, or a ring.
struct Obstacle {
  std::vector<Vec<2>> corners;  ///< corners of the polygon, counterclockwise
  Real radius = 0;              ///< radius of the disk; 0 for a polygon

  bool disk() const { return corners.size() == 1; }
  bool contains(const Vec<2>& p) const;
  /// Its rim: a joint at each corner, and a lip where edges of polygons can catch.
  void add_to(WallParts& walls) const;
  /// Area (volume) of the part below height y.
  Real content(int dim, Real y) const;
};

/// Angle by which an outline from a over b to c turns at b, to the left or to the right, in rad.
Real turn(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, bool left);
inline constexpr Real sharp_turn = 20 * pi / 180;  ///< edges of polygons reach over flatter corners
inline constexpr Real flat_turn = 1e-6;            ///< up to this a corner counts as none

}  // namespace pliant
