// Numbers of the faces and edges of all closed surfaces, and data of their elements for kernels.
#pragma once

#include <array>

#include <pliant/geometry/pair_search.h>
#include <pliant/kernels/simplex_forces.h>
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

/// s0 of the mollifier of two edges that end at these points, if none is given: 4 times the product of the widths of
/// the edges over their mean rest lengths.
inline Real usual_mollifier(const Topology& t, Index i, Index j) {
  const auto width = [&](Index k) { return t.diameter[k] / t.l0[t.particle[k]]; };
  return 4 * width(i) * width(j);
}

/// Element e of a list, a vertex and a face, for its kernel.
inline SimplexPair vertex_face(const Topology& t, const Pair& pair, Real reach, Index e) {
  const auto [a, b, c] = points_of_face(t, pair.second);
  const Index m = t.particle[a];
  const auto& around = t.surfaces->of(t, m).around;
  const auto share = [&](Index i) { return 0.5 / static_cast<Real>(around[i - t.offset[m]].size()); };
  return {{pair.first, a, b, c}, e, reach, {share(a), share(b), share(c)}};
}
/// Element e of a list, two edges, for its kernel.
inline SimplexPair edge_pair(const Topology& t, const Pair& pair, Real reach, Index e) {
  const auto [a, b] = points_of_edge(t, pair.first);
  const auto [c, d] = points_of_edge(t, pair.second);
  return {{a, b, c, d}, e, reach, {usual_mollifier(t, a, c)}};
}

}  // namespace pliant
