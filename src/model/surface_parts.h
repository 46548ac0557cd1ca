// Numbers of the faces and edges of all closed surfaces.
#pragma once

#include <array>

#include <pliant/model/surface.h>

namespace pliant {

// A surface of n vertices has 2n − 4 faces and 3n − 6 edges. Therefore face f of particle m has the number
// 2 offset[m] + f and edge e the number 3 offset[m] + e: a half and a third of these numbers are points of the
// particle.

inline Index point_of_face(Index face) { return face / 2; }
inline Index point_of_edge(Index edge) { return edge / 3; }

/// Numbers of the first face and of the first edge of particle m.
inline Index first_face(const Topology& t, Index m) { return 2 * t.offset[m]; }
inline Index first_edge(const Topology& t, Index m) { return 3 * t.offset[m]; }

/// The points of a face, counter-clockwise as seen from outside.
inline std::array<Index, 3> points_of_face(const Topology& t, Index face) {
  const Index m = t.particle[point_of_face(face)], first = t.offset[m];
  const auto& [a, b, c] = t.surfaces->of(t, m).faces[face - first_face(t, m)];
  return {first + a, first + b, first + c};
}
inline std::array<Index, 2> points_of_edge(const Topology& t, Index edge) {
  const Index m = t.particle[point_of_edge(edge)], first = t.offset[m];
  const Hinge& h = t.surfaces->of(t, m).hinges[edge - first_edge(t, m)];
  return {first + h.a, first + h.b};
}

}  // namespace pliant
