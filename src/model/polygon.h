// Areas, perimeters, shortest edges and centres of the polygons of a topology.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

#include <pliant/model/topology.h>

namespace pliant {

/// Signed area of particle m (shoelace; positive for counter-clockwise), taken about its first vertex to keep digits
/// far from the origin.
inline Real polygon_area(const Real* x, const Topology& topology, Index m) {
  const Index first = topology.offset[m], last = topology.offset[m + 1];
  const Vec<2> o = point<2>(x, first);
  Real twice = 0;
  Vec<2> r = Vec<2>::Zero();
  for (Index i = first + 1; i < last; ++i) {
    const Vec<2> s = point<2>(x, i) - o;
    twice += r[0] * s[1] - r[1] * s[0];
    r = s;
  }
  return twice / 2;
}

/// ∂(area)/∂r_i.
inline Vec<2> area_gradient(const Real* x, const Topology& topology, Index i) {
  const Vec<2> chord = point<2>(x, topology.next[i]) - point<2>(x, topology.previous[i]);
  return {chord[1] / 2, -chord[0] / 2};
}

inline Real polygon_perimeter(const Real* x, const Topology& topology, Index m) {
  Real sum = 0;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    sum += (point<2>(x, topology.next[i]) - point<2>(x, i)).norm();
  return sum;
}

inline Real shortest_edge(const Real* x, const Topology& topology, Index m) {
  Real least = std::numeric_limits<Real>::infinity();
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    least = std::min(least, (point<2>(x, topology.next[i]) - point<2>(x, i)).norm());
  return least;
}

template <int D>
Vec<D> mean_of_several_points(const Real* x, const Topology& topology, Index m) {
  const Index first = topology.offset[m], points = topology.points_of(m);
  Vec<D> sum = point<D>(x, first);
  for (Index i = first + 1; i < first + points; ++i) sum += point<D>(x, i);
  return sum / points;
}

/// Mean of the points of particle m: its centre of mass, as they have equal masses. Works for velocities too. Inlined
/// for particles of one point, because hoppers call it in each step.
template <int D>
[[gnu::always_inline]] inline Vec<D> mean_of_points(const Real* x, const Topology& topology, Index m) {
  return topology.points_of(m) == 1 ? Vec<D>(point<D>(x, topology.offset[m]))
                                    : mean_of_several_points<D>(x, topology, m);
}

/// Whether p lies inside polygon m (even–odd rule).
inline bool inside_polygon(const Real* x, const Topology& topology, Index m, const Vec<2>& p) {
  bool inside = false;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
    const Vec<2> a = point<2>(x, i), b = point<2>(x, topology.next[i]);
    if ((a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])) inside = !inside;
  }
  return inside;
}

/// Whether the closed segments from a to b and from c to d have a point in common.
bool segments_meet(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d);

/// Whether two edges of polygon m that share no vertex meet.
bool self_intersects(const Real* x, const Topology& topology, Index m);

/// Two edges of one polygon, by their first vertices, counted from the polygon's first one.
struct EdgePair {
  Index first, second;
};

/// How a polygon lies to itself.
struct OwnOutline {
  std::optional<EdgePair> meet;  ///< two edges without a common vertex that meet, if there are any
  bool inverted;                 ///< its signed area is not positive: clockwise, or flat
  Real gap;                      ///< least distance of a vertex to an edge that does not end there, at most `most`
  bool simple() const { return !meet && !inverted; }
};

/// Compares all edges of polygon m. Parts of the outline that are too far apart to meet or to be nearer than `most` are
/// skipped, which makes it about linear in the number of vertices as long as the outline is not crumpled.
OwnOutline look_at_own_outline(const Real* x, const Topology& topology, Index m, Real most);

/// A lower bound, from the angles under which the centre sees the edges, of the sum of the displacements of two points
/// before polygon m can cross itself: 0 if the outline is not star-shaped about its centre, or not counterclockwise.
/// Linear in the number of vertices.
Real star_gap(const Real* x, const Topology& topology, Index m);

}  // namespace pliant
