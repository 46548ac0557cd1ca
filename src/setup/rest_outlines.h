// Outlines of rough polygons: ellipses, rods, and corners from a file.
#pragma once

#include <string>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

enum class OutlineKind { ellipse, rod, corners };

/// Shape of an outline; its size does not matter.
struct OutlineShape {
  OutlineKind kind = OutlineKind::ellipse;
  Real aspect = 1;                   ///< length over width of an ellipse or a rod, its vertices' disks included; ≥ 1
  std::vector<Vec<2>> corners = {};  ///< of another one, counterclockwise
};

/// n vertices along the outline with edges of length 1, the first vertex at an end of it or at its first corner, about
/// their mean. Every vertex has a disk of diameter 1. Errors: InputError where the outline cannot have n equal edges.
std::vector<Vec<2>> rest_outline(const OutlineShape& shape, Index n);

/// Area covered by the polygon and the disks, as long as these overlap within the polygon only.
Real outline_area(const std::vector<Vec<2>>& vertices);
/// Largest distance from the mean.
Real outline_radius(const std::vector<Vec<2>>& vertices);

}  // namespace pliant
