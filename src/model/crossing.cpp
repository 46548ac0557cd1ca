#include <pliant/model/crossing.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <pliant/base/parallel_errors.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Stores the first vertex, by index, that lies inside a polygon; of several polygons the first.
void test(const StateView<2>& s, Index vertex, Index other, std::optional<Crossing>& found) {
  if (found && std::pair(found->vertex, found->other) <= std::pair(vertex, other)) return;
  if (inside_polygon(s.x, s.topology, other, s.position(vertex))) found = {vertex, s.topology.particle[vertex], other};
}

Real squared_distance(const StateView<2>& s, Index vertex, Index edge) {
  return segment_foot(s.position(vertex), s.position(edge), s.position(s.topology.next[edge])).d2;
}

/// Up to this distance of a vertex from an outline, the lists hold the pair, within its reach: the least reach of all.
Real least_reach(const Topology& topology, Edges edges) {
  if (topology.points() == 0) return std::numeric_limits<Real>::infinity();
  const Real least = *std::min_element(topology.diameter.begin(), topology.diameter.end());
  return vertex_edge_reach(edges, least, least);
}

/// How deep inside a polygon a point can be: of an outline of length L at most L/2π, as a disk of that radius fits in.
Real greatest_depth(const StateView<2>& s) {
  Real longest = 0;
  for (Index m = 0; m < s.topology.particles(); ++m) longest = std::max(longest, polygon_perimeter(s.x, s.topology, m));
  return longest / (2 * pi);
}

/// One kind of contact in a check: pair e has the squared distance distance2(e), touches at distances below reach(e)
/// and is described by approach(e, d/reach); inside(e, found) tests pairs that touch, or are up to `beyond` farther
/// apart. share: 2 where only one of the two moves, else 1.
template <class Distance, class Reach, class Describe, class Inside>
void look(const PairList& list, Real least, Real share, Real beyond, OutlineLook& seen, Distance&& distance2,
          Reach&& reach, Describe&& approach, Inside&& inside) {
  Real gap = seen.gap;
  ParallelErrors errors;
#pragma omp parallel if (list.chunks() > 1)
  {
    std::optional<Crossing> found;
    std::optional<Approach> closest;
#pragma omp for reduction(min : gap)
    for (Index e = 0; e < list.size(); ++e) {
      const Real d = std::sqrt(distance2(e)), range = reach(e);
      gap = std::min(gap, share * (d - least * range));
      if (!(d < range + beyond)) continue;
      errors.catch_from([&] { inside(e, found); });
      if (d < least * range && (!closest || d < closest->distance * range)) closest = approach(e, d / range);
    }
#pragma omp critical
    {
      if (found && (!seen.crossing ||
                    std::pair(found->vertex, found->other) < std::pair(seen.crossing->vertex, seen.crossing->other)))
        seen.crossing = found;
      if (closest && (!seen.closest || closest->distance < seen.closest->distance)) seen.closest = closest;
    }
  }
  errors.rethrow();
  seen.gap = gap;
}

}  // namespace

OutlineLook look_at_outlines(const StateView<2>& s, const LeastDistances& least, Real deepest) {
  const Topology& topology = s.topology;
  const PairList &walls = s.neighbours.walls, &lips = s.neighbours.lips;
  const NeighbourNeeds& needs = s.neighbours.needs();
  const Real reach = least_reach(topology, needs.edges);
  // The list of points lacks vertices near the middle of a long edge.
  const bool own = !needs.vertex_edges || deepest >= reach;
  const Real beyond = deepest < reach ? 0 : std::min(deepest, greatest_depth(s)), depth = reach + beyond;
  Neighbours<2> near({.vertex_edges = true, .edges = needs.edges}, beyond);
  if (own) near.rebuild(topology, s.walls, s.x, s.t);
  const PairList& edges = own ? near.vertex_edges : s.neighbours.vertex_edges;
  OutlineLook seen{std::nullopt, depth - reach * std::max(least.outlines, least.walls), depth, std::nullopt};
  look(
      edges, least.outlines, 1, beyond, seen,
      [&](Index e) { return squared_distance(s, edges[e].first, edges[e].second); },
      [&](Index e) { return edges.reach[e]; },
      [&](Index e, Real d) {
        return Approach{edges[e].first, topology.particle[edges[e].second], d};
      },
      [&](Index e, std::optional<Crossing>& found) {
        test(s, edges[e].first, topology.particle[edges[e].second], found);
      });
  if (least.walls < 0) return seen;
  const auto nothing = [](Index, std::optional<Crossing>&) {};
  look(
      walls, least.walls, 2, 0, seen,
      [&](Index e) { return square(s.walls.distance(s.position(walls[e].first), walls[e].second, s.t)); },
      [&](Index e) { return topology.diameter[walls[e].first] / 2; },
      [&](Index e, Real d) {
        return Approach{walls[e].first, -1, d};
      },
      nothing);
  look(
      lips, least.walls, 2, 0, seen,
      [&](Index e) {
        const Index a = lips[e].second;
        return segment_foot(s.walls.lip(lips[e].first, s.t), s.position(a), s.position(topology.next[a])).d2;
      },
      [&](Index e) { return topology.diameter[lips[e].second] / 2; },
      [&](Index e, Real d) {
        return Approach{lips[e].second, -1, d};
      },
      nothing);
  return seen;
}

SelfLook look_at_own_outlines(const StateView<2>& s) {
  // Part of an edge's rest length; with a smaller bound, checks would be so frequent that the exact distance is
  // cheaper.
  constexpr Real least_bound = 0.125;
  const Topology& topology = s.topology;
  const Index n = topology.owned();
  Real gap = std::numeric_limits<Real>::infinity();
  Index first = n, count = 0;
  ParallelErrors errors;
#pragma omp parallel for reduction(min : gap, first) reduction(+ : count) if (s.neighbours.chunks() > 1)
  for (Index m = 0; m < n; ++m) {
    if (topology.active[m] == 0 || topology.points_of(m) < 3) continue;
    Real own = star_gap(s.x, topology, m);
    if (own < least_bound * topology.l0[m]) {
      OwnOutline outline{};
      errors.catch_from([&] { outline = look_at_own_outline(s.x, topology, m, topology.l0[m]); });
      if (!outline.simple()) {
        ++count;
        first = std::min(first, m);
        continue;
      }
      own = std::max(own, outline.gap);
    }
    gap = std::min(gap, own);
  }
  errors.rethrow();
  SelfLook seen{std::nullopt, count, gap};
  if (first < n) seen.crossing = {first, look_at_own_outline(s.x, topology, first, 0).meet};
  return seen;
}

std::optional<Crossing> find_crossing(const StateView<2>& s) {
  return look_at_outlines(s, {}, std::numeric_limits<Real>::infinity()).crossing;
}

bool meets(const Vec<2>& a, const Vec<2>& b, const WallSegment& wall) {
  if (wall.length == 0) return segment_foot(wall.origin, a, b).d2 < square(wall.radius);
  // A wall without end counts as far up as the segment.
  const Real reach = std::max({Real(0), (a - wall.origin).dot(wall.direction), (b - wall.origin).dot(wall.direction)});
  return segments_meet(a, b, wall.origin, wall.origin + std::min(reach, wall.length) * wall.direction);
}

bool outline_meets(const Real* x, const Topology& topology, Index m, const WallSegment& wall) {
  // Most polygons lie on one side of the wall's line, or beyond its ends.
  constexpr Real far = std::numeric_limits<Real>::infinity();
  const Vec<2> normal(-wall.direction[1], wall.direction[0]);
  Vec<2> low(far, far), high(-far, -far);
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
    const Vec<2> r = point<2>(x, i) - wall.origin, place(r.dot(wall.direction), r.dot(normal));
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
  }
  const Real rounding = 1e-9 * (1 + high.cwiseAbs().maxCoeff());
  const Real aside = wall.radius + rounding;
  if (low[1] > aside || high[1] < -aside || high[0] < -aside || low[0] > wall.length + aside) return false;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    if (meets(point<2>(x, i), point<2>(x, topology.next[i]), wall)) return true;
  return false;
}

namespace {

/// Whether the particle meets one of the segments within the sphere around a box.
template <class Test>
bool any_near(const Walls<2>& walls, Real t, const Vec<2>& low, const Vec<2>& high, Test&& test) {
  std::vector<Index> near;
  const Vec<2> middle = (low + high) / 2;
  walls.find_near(middle, (high - low).norm() / 2 + 1e-9 * (1 + middle.cwiseAbs().maxCoeff()), t, near);
  return std::any_of(near.begin(), near.end(), [&](Index s) {
    return s < static_cast<Index>(walls.segments().size()) && test(walls.segment(s, t));
  });
}

}  // namespace

bool meets(const Vec<2>& a, const Vec<2>& b, const Walls<2>& walls, Real t) {
  return any_near(walls, t, a.cwiseMin(b), a.cwiseMax(b), [&](const WallSegment& wall) { return meets(a, b, wall); });
}

bool outline_meets(const Real* x, const Topology& topology, Index m, const Walls<2>& walls, Real t) {
  Vec<2> low = point<2>(x, topology.offset[m]), high = low;
  for (Index i = topology.offset[m] + 1; i < topology.offset[m + 1]; ++i) {
    low = low.cwiseMin(point<2>(x, i));
    high = high.cwiseMax(point<2>(x, i));
  }
  return any_near(walls, t, low, high, [&](const WallSegment& wall) { return outline_meets(x, topology, m, wall); });
}

}  // namespace pliant
