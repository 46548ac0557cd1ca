// Searches for the pairs that can touch before any point or wall has moved by skin/2. Every pair is found exactly once,
// for any particle sizes.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include <pliant/geometry/cell_grid.h>
#include <pliant/geometry/distance.h>
#include <pliant/geometry/walls.h>

namespace pliant {

/// Two elements that may touch: point–point (i, j), vertex–edge (vertex, first vertex of the edge), point–wall,
/// lip–edge.
struct Pair {
  Index first, second;
  auto operator<=>(const Pair&) const = default;  // NOLINT(modernize-use-nullptr): mistakes <=> for a comparison with 0
};

/// Data of the points for the searches: spans over the topology's arrays.
struct PointCloud {
  const Real* x;                       ///< positions [n · D]
  std::span<const Real> diameter;      ///< contact diameter [n]
  std::span<const Index> group;        ///< owner [n]; pairs within one owner do not count
  std::span<const Index> next;         ///< cyclic successor [n]: edge i runs from i to next[i]
  std::span<const std::uint8_t> used;  ///< per owner: 0 leaves its points out

  Index size() const { return static_cast<Index>(diameter.size()); }
  bool uses(Index i) const { return used[group[i]] != 0; }
};

/// The searches below go through the points first … last−1 and call found(…) for each pair, in an order that
/// depends on the points and the grid only.

/// Pairs with |r_i − r_j| < (δ_i + δ_j)/2 + skin, i from the range: found(i, j, (δ_i + δ_j)/2). The larger point looks
/// for the smaller ones (ties: the lower index), in a range that depends on its own size only, so that size ratios of
/// 1:10 stay cheap.
template <int D, class Found>
void find_point_pairs(const PointCloud& cloud, const CellGrid<D>& grid, Real skin, Index first, Index last,
                      Found&& found) {
  std::vector<Index> near;
  for (Index i = first; i < last; ++i) {
    if (!cloud.uses(i)) continue;
    const Vec<D> r = point<D>(cloud.x, i);
    const Real di = cloud.diameter[i];
    grid.for_each_near(r, di + skin, di / 2 + skin, near, [&](Index j) {
      const Real dj = cloud.diameter[j];
      if (dj > di || (dj == di && j <= i) || cloud.group[i] == cloud.group[j]) return;
      found(i, j, (di + dj) / 2);
    });
  }
}

/// How wide the edges of polygons, and the faces of surfaces, are: as their vertices are, or not at all.
enum class Edges { wide, bare };

/// Distance at which a vertex touches an edge or a face, from the contact diameters of the two particles.
inline Real vertex_edge_reach(Edges edges, Real vertex, Real edge) {
  return (edges == Edges::wide ? vertex + edge : vertex) / 2;
}

/// Vertices j of other polygons within their reach + skin of edge i, whose first vertex is from the range:
/// found(j, i, reach). widest: the largest diameter of the cloud.
template <class Found>
void find_vertex_edge_pairs(const PointCloud& cloud, const CellGrid<2>& grid, Edges edges, Real skin, Real widest,
                            Index first, Index last, Found&& found) {
  std::vector<Index> near;
  for (Index i = first; i < last; ++i) {
    if (!cloud.uses(i)) continue;
    const Vec<2> a = point<2>(cloud.x, i), b = point<2>(cloud.x, cloud.next[i]);
    // A point within the contact distance of the edge lies within this distance + half an edge of its middle.
    const Real reach = (b - a).norm() / 2 + vertex_edge_reach(edges, 0, cloud.diameter[i]) + skin;
    grid.for_each_near((a + b) / 2, reach + widest / 2, reach * (1 + 1e-12), near, [&](Index j) {
      if (cloud.group[i] == cloud.group[j]) return;
      const Real contact = vertex_edge_reach(edges, cloud.diameter[j], cloud.diameter[i]);
      if (segment_foot(point<2>(cloud.x, j), a, b).d2 < square(contact + skin)) found(j, i, contact);
    });
  }
}

/// Visits points in blocks of points that are adjacent in memory, and usually in space: visit(first, last, centre,
/// radius) with a sphere around the points of a block and their successors, enlarged by half the largest diameter and
/// the skin.
template <int D, class Visit>
void for_each_block(const PointCloud& cloud, Real skin, Index first, Index last, Visit&& visit) {
  constexpr Index block = 64;
  for (; first < last; first += block) {
    const Index end = std::min<Index>(last, first + block);
    Vec<D> low = point<D>(cloud.x, first), high = low;
    Real widest = 0;
    for (Index i = first; i < end; ++i)
      for (const Index j : {i, cloud.next[i]}) {
        low = low.cwiseMin(point<D>(cloud.x, j));
        high = high.cwiseMax(point<D>(cloud.x, j));
        widest = std::max(widest, cloud.diameter[j]);
      }
    const Real radius = ((high - low).norm() + widest) / 2 + skin;
    visit(first, end, (low + high) / 2, radius * (1 + 1e-12));
  }
}

/// If at most this many walls are near a block, each point is tested with all of them.
constexpr std::size_t few_walls = 16;

/// Points of the range with distance < δ/2 + skin from a part of the walls at time t: found(point, part), the parts of
/// each point in ascending order. Returns how many distances it took.
template <int D, class Found>
std::int64_t find_wall_pairs(const PointCloud& cloud, const Walls<D>& walls, Real t, Real skin, Index first, Index last,
                             Found&& found) {
  std::int64_t tests = 0;
  std::vector<Index> around, near;
  for_each_block<D>(cloud, skin, first, last, [&](Index begin, Index end, const Vec<D>& centre, Real radius) {
    tests += walls.find_near(centre, radius, t, around);
    if (around.empty()) return;
    for (Index i = begin; i < end; ++i) {
      if (!cloud.uses(i)) continue;
      const Vec<D> r = point<D>(cloud.x, i);
      const Real range = cloud.diameter[i] / 2 + skin;
      if (around.size() > few_walls) {
        tests += walls.find_near(r, range, t, near);
        for (const Index s : near) found(i, s);
      } else {
        tests += static_cast<std::int64_t>(around.size());
        for (const Index s : around)
          if (walls.distance(r, s, t) < range) found(i, s);
      }
    }
  });
  return tests;
}

/// Edges, with their first vertex from the range, with distance < δ/2 + skin from a lip at time t: found(lip, first
/// vertex). Returns how many distances it took.
template <class Found>
std::int64_t find_lip_pairs(const PointCloud& cloud, const Walls<2>& walls, Real t, Real skin, Index first, Index last,
                            Found&& found) {
  std::int64_t tests = 0;
  std::vector<Index> around, near;
  for_each_block<2>(cloud, skin, first, last, [&](Index begin, Index end, const Vec<2>& centre, Real radius) {
    tests += walls.find_near_lips(centre, radius, t, around);
    if (around.empty()) return;
    for (Index i = begin; i < end; ++i) {
      if (!cloud.uses(i)) continue;
      const Vec<2> a = point<2>(cloud.x, i), b = point<2>(cloud.x, cloud.next[i]);
      const Real range = cloud.diameter[i] / 2 + skin;
      const bool few = around.size() <= few_walls;
      if (!few) tests += walls.find_near_lips((a + b) / 2, ((b - a).norm() / 2 + range) * (1 + 1e-12), t, near);
      for (const Index l : few ? around : near) {
        ++tests;
        if (segment_foot(walls.lip(l, t), a, b).d2 < square(range)) found(l, i);
      }
    }
  });
  return tests;
}

}  // namespace pliant
