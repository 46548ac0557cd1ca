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

/// distance2(e) is the least squared distance of what pair e of a list stands for; inside(e, found) tests it.
template <class Distance, class Inside>
void look(const PairList& list, OutlineLook& seen, Distance&& distance2, Inside&& inside) {
  Real d2 = square(seen.gap);
#pragma omp parallel if (list.chunks() > 1)
  {
    std::optional<Crossing> found;
#pragma omp for reduction(min : d2)
    for (Index e = 0; e < list.size(); ++e) {
      const Real near = distance2(e);
      d2 = std::min(d2, near);
      if (near < square(list.reach[e])) inside(e, found);
    }
#pragma omp critical
    if (found && (!seen.crossing || found->vertex < seen.crossing->vertex)) seen.crossing = found;
  }
  seen.gap = std::sqrt(d2);
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

OutlineLook look_at_outlines(const StateView<2>& s) {
  const Topology& topology = s.topology;
  const PairList &edges = s.neighbours.vertex_edges, &points = s.neighbours.point_pairs;
  const Real sure = sure_distance(s);
  OutlineLook seen{std::nullopt, sure, sure};
  look(
      edges, seen, [&](Index e) { return squared_distance(s, edges[e].first, edges[e].second); },
      [&](Index e, std::optional<Crossing>& found) {
        test(s, edges[e].first, topology.particle[edges[e].second], found);
      });
  if (!edges.start.empty()) return seen;
  const auto to_both_edges = [&](Index i, Index j) {
    return std::min(squared_distance(s, i, topology.previous[j]), squared_distance(s, i, j));
  };
  look(
      points, seen,
      [&](Index e) {
        return std::min(to_both_edges(points[e].first, points[e].second),
                        to_both_edges(points[e].second, points[e].first));
      },
      [&](Index e, std::optional<Crossing>& found) {
        test(s, points[e].first, topology.particle[points[e].second], found);
        test(s, points[e].second, topology.particle[points[e].first], found);
      });
  return seen;
}

}  // namespace pliant
