#include <pliant/model/crossing.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Keeps the first vertex, by index, that lies inside a polygon.
void test(const StateView<2>& s, Index vertex, Index other, std::optional<Crossing>& found) {
  if (found && found->vertex <= vertex) return;
  if (inside_polygon(s.x, s.topology, other, s.position(vertex))) found = {vertex, s.topology.particle[vertex], other};
}

Real squared_distance(const StateView<2>& s, Index vertex, Index edge) {
  return segment_foot(s.position(vertex), s.position(edge), s.position(s.topology.next[edge])).d2;
}

/// Up to this distance of a vertex from an outline, the lists hold the pair, within its reach. For pairs of vertices
/// and edges that is the least reach of all, which is half a diameter where edges are bare (points have a list too,
/// then); of vertices, one that is within reach of neither end of an edge may be nearer to its middle.
Real sure_distance(const StateView<2>& s) {
  const Topology& topology = s.topology;
  if (topology.points() == 0) return std::numeric_limits<Real>::infinity();
  const Real least = *std::min_element(topology.diameter.begin(), topology.diameter.end());
  if (!s.neighbours.vertex_edges.start.empty()) return s.neighbours.point_pairs.start.empty() ? least : least / 2;
  Real d2 = std::numeric_limits<Real>::infinity();
#pragma omp parallel for reduction(min : d2) if (s.neighbours.chunks() > 1)
  for (Index i = 0; i < topology.points(); ++i)
    d2 = std::min(d2, square((topology.diameter[i] + least) / 2) -
                          (s.position(topology.next[i]) - s.position(i)).squaredNorm() / 4);
  return std::sqrt(std::max(d2, Real(0)));
}

/// One kind of contact in a look: what pair e stands for has the squared distance distance2(e), touches within reach(e)
/// and is described by approach(e, d/reach); inside(e, found) tests pairs that touch. share: 2 where only one of
/// the two moves, else 1.
template <class Distance, class Reach, class Describe, class Inside>
void look(const PairList& list, Real least, Real share, OutlineLook& seen, Distance&& distance2, Reach&& reach,
          Describe&& approach, Inside&& inside) {
  Real gap = seen.gap;
#pragma omp parallel if (list.chunks() > 1)
  {
    std::optional<Crossing> found;
    std::optional<Approach> closest;
#pragma omp for reduction(min : gap)
    for (Index e = 0; e < list.size(); ++e) {
      const Real d = std::sqrt(distance2(e)), range = reach(e);
      gap = std::min(gap, share * (d - least * range));
      if (!(d < range)) continue;
      inside(e, found);
      if (d < least * range && (!closest || d < closest->distance * range)) closest = approach(e, d / range);
    }
#pragma omp critical
    {
      if (found && (!seen.crossing || found->vertex < seen.crossing->vertex)) seen.crossing = found;
      if (closest && (!seen.closest || closest->distance < seen.closest->distance)) seen.closest = closest;
    }
  }
  seen.gap = gap;
}

}  // namespace

std::optional<Crossing> find_crossing(const StateView<2>& s) {
  const Topology& topology = s.topology;
  std::optional<Crossing> found;
  for (const auto [i, j] : s.neighbours.point_pairs) {
    test(s, i, topology.particle[j], found);
    test(s, j, topology.particle[i], found);
  }
  for (const auto [vertex, edge] : s.neighbours.vertex_edges) test(s, vertex, topology.particle[edge], found);
  return found;
}

OutlineLook look_at_outlines(const StateView<2>& s, const LeastDistances& least) {
  const Topology& topology = s.topology;
  const PairList &edges = s.neighbours.vertex_edges, &points = s.neighbours.point_pairs, &walls = s.neighbours.walls,
                 &lips = s.neighbours.lips;
  const Real sure = sure_distance(s);
  OutlineLook seen{std::nullopt, sure * (1 - std::max(least.outlines, least.walls)), sure, std::nullopt};
  look(
      edges, least.outlines, 1, seen, [&](Index e) { return squared_distance(s, edges[e].first, edges[e].second); },
      [&](Index e) { return edges.reach[e]; },
      [&](Index e, Real d) {
        return Approach{edges[e].first, topology.particle[edges[e].second], d};
      },
      [&](Index e, std::optional<Crossing>& found) {
        test(s, edges[e].first, topology.particle[edges[e].second], found);
      });
  if (edges.start.empty()) {
    const auto to_both_edges = [&](Index i, Index j) {
      return std::min(squared_distance(s, i, topology.previous[j]), squared_distance(s, i, j));
    };
    look(
        points, least.outlines, 1, seen,
        [&](Index e) {
          return std::min(to_both_edges(points[e].first, points[e].second),
                          to_both_edges(points[e].second, points[e].first));
        },
        [&](Index e) { return points.reach[e]; },
        [&](Index e, Real d) {
          return Approach{points[e].first, topology.particle[points[e].second], d};
        },
        [&](Index e, std::optional<Crossing>& found) {
          test(s, points[e].first, topology.particle[points[e].second], found);
          test(s, points[e].second, topology.particle[points[e].first], found);
        });
  }
  if (!(least.walls > 0)) return seen;
  const auto nothing = [](Index, std::optional<Crossing>&) {};
  look(
      walls, least.walls, 2, seen,
      [&](Index e) { return square(s.walls.distance(s.position(walls[e].first), walls[e].second)); },
      [&](Index e) { return topology.diameter[walls[e].first] / 2; },
      [&](Index e, Real d) {
        return Approach{walls[e].first, -1, d};
      },
      nothing);
  look(
      lips, least.walls, 2, seen,
      [&](Index e) {
        const Index a = lips[e].second;
        return segment_foot(s.walls.lips()[lips[e].first], s.position(a), s.position(topology.next[a])).d2;
      },
      [&](Index e) { return topology.diameter[lips[e].second] / 2; },
      [&](Index e, Real d) {
        return Approach{lips[e].second, -1, d};
      },
      nothing);
  return seen;
}

}  // namespace pliant
