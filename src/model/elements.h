// The kinds of element that terms can have, as a table. An entry states the points of an element, which elements belong
// to a chunk, how they are found, and which blocks of second derivatives they fill.
#pragma once

#include <array>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <pliant/geometry/pair_search.h>
#include <pliant/model/surface_parts.h>
#include <pliant/model/surface_search.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Kinds of elements of a term. A new kind is an enumerator before the last one, an entry below, and where it is
/// found by a search its list in NeighbourLists and NeighbourNeeds.
enum class Elements {
  particles,
  points,
  edges,         ///< of an outline, named by their first vertex
  corners,       ///< two edges that meet, named by the first vertex of the first one
  point_pairs,   ///< points of two particles
  vertex_edges,  ///< a vertex and an edge of another particle
  walls,         ///< a point and a part of the walls
  lips,          ///< a lip and an edge
  vertex_faces,  ///< a vertex and a face of another closed surface
  edge_pairs     ///< edges of two closed surfaces
};
inline constexpr std::size_t element_kinds = static_cast<std::size_t>(Elements::edge_pairs) + 1;

/// first … last−1.
struct Range {
  Index first = 0, last = 0;
  Index size() const { return last - first; }
  bool contains(Index i) const { return first <= i && i < last; }
};

/// A list whose pairs are grouped by chunk: first the pairs inside each chunk, then the pairs across the border of each
/// chunk. A pair across a border is listed by the chunks on both sides, which compute the forces on their points only.
struct PairList {
  std::vector<Pair> pairs;
  std::vector<Real> reach;   ///< contact distance of each pair; empty for walls and lips
  std::vector<Index> start;  ///< [2 chunks + 1]

  Index size() const { return static_cast<Index>(pairs.size()); }
  bool empty() const { return pairs.empty(); }
  const Pair& operator[](Index e) const { return pairs[e]; }
  /// Drops all pairs for which unwanted(pair) is true.
  template <class Unwanted>
  void erase(Unwanted&& unwanted);
  /// Adds a pair at the end of a chunk's part; a list without reaches takes none.
  void insert(Index chunk, bool across_border, const Pair& pair, Real contact = 0);
  auto begin() const { return pairs.begin(); }
  auto end() const { return pairs.end(); }
  Index chunks() const { return static_cast<Index>(start.size()) / 2; }
  Range inside(Index chunk) const { return {start[chunk], start[chunk + 1]}; }
  Range across(Index chunk) const { return inside(chunks() + chunk); }
  void clear() { pairs.clear(), reach.clear(), start.assign(1, 0); }
};

/// Some elements of a list of vertices and faces or of pairs of edges, with the data that kernels need, by chunk:
/// inside each chunk [chunks], then across the border of each chunk [chunks].
using NearSimplices = std::vector<std::vector<SimplexPair>>;

/// The elements that searches find.
struct NeighbourLists {
  PairList point_pairs;   ///< (point, point); across a border the chunk's own point comes first
  PairList vertex_edges;  ///< (vertex, first vertex of the edge)
  PairList walls;         ///< (point, part of the walls)
  PairList lips;          ///< (lip, first vertex of the edge); in 3D (lip, edge), numbered as surface_parts.h explains
  PairList vertex_faces;  ///< (vertex, face), numbered as surface_parts.h explains
  PairList edge_pairs;    ///< (edge, edge); across a border the edge of the chunk comes first
};

/// The lists that a model needs.
struct NeighbourNeeds {
  bool point_pairs = false;
  bool vertex_edges = false;
  bool walls = false;
  bool lips = false;
  Real beyond_contact = 0;    ///< range of forces beyond the contact distance, for points and walls
  Edges edges = Edges::wide;  ///< in contacts of vertices with edges and faces
  bool vertex_faces = false;
  bool edge_pairs = false;
  bool surface_parts() const { return vertex_faces || edge_pairs || lips; }
  bool operator==(const NeighbourNeeds&) const = default;
};

/// Input of the searches.
template <int D>
struct SearchSpace {
  PointCloud cloud;
  const CellGrid<D>& grid;
  const Walls<D>& walls;
  Real t;                ///< for walls that move
  Real margin;           ///< how far beyond the contact distance
  Edges edges;           ///< in contacts of vertices with edges and faces
  Real widest, longest;  ///< diameter of a point, edge
  const Topology& topology;
  const SurfaceBoxes& boxes;  ///< of closed surfaces, if the model needs their faces or edges
};

/// The blocks of second derivatives that an element fills, in addition to the diagonal block of each point.
enum class Couples {
  nothing,
  particle,  ///< all points of its particle, which the preconditioner solves together
  stencil    ///< all points of its stencil
};

/// The entry of a kind. It has
///   in<D>                             whether there are such elements in D dimensions
///   couples                           see Couples
///   inside(lists, chunk)              the elements of a chunk
///   stencil(topology, element)        ids of the points that an element is made of
///   listed                            whether it is found by a search; then element is a Pair, else its index
/// and where it is not listed
///   particle(topology, element)       the particle that it belongs to
/// and where it is listed
///   list, need                        the members of NeighbourLists and NeighbourNeeds
///   paired                            whether it joins two particles, which may belong to two chunks
///   points_of_both(pair)              where it is paired: a point of each particle
///   search(space, first, last, found) calls found(pair) for points, or edges that begin there, first … last−1
/// and where it is paired, to list a single particle again,
///   symmetric                         (i, j) is (j, i)
///   near(space, i)                    a box with all points that point i, or the edge i, can have an element with
///   test(space, i, j, found)          calls found for the elements of points i and j
/// or, between closed surfaces (of_surfaces), test_surfaces(space, m, n, found) for the elements of particles m and n
template <Elements E>
struct ElementKind;

/// Whether terms in D dimensions can have such elements.
template <Elements E, int D>
concept ElementsIn = static_cast<std::size_t>(E) < element_kinds&& ElementKind<E>::template in<D>;

/// Calls `visit(ElementKind<…>())` for all kinds.
template <class Visit>
void for_each_kind(Visit&& visit) {
  [&]<std::size_t... k>(std::index_sequence<k...>) { (visit(ElementKind<static_cast<Elements>(k)>()), ...); }
  (std::make_index_sequence<element_kinds>());
}

/// Base of entries that need no list.
struct OfOneParticle {
  template <int D>
  static constexpr bool in = true;
  static constexpr bool listed = false, paired = false;
  static constexpr Couples couples = Couples::particle;
  template <class Lists>
  static Range inside(const Lists& lists, Index chunk) {
    return lists.points(chunk);
  }
  static Index particle(const Topology& t, Index i) { return t.particle[i]; }
};

/// Base of entries with a list.
template <PairList NeighbourLists::*List, bool NeighbourNeeds::*Need, bool Paired>
struct Listed {
  template <int D>
  static constexpr bool in = true;
  static constexpr bool listed = true, paired = Paired, of_surfaces = false;
  static constexpr Couples couples = Paired ? Couples::stencil : Couples::nothing;
  static constexpr PairList NeighbourLists::*list = List;
  static constexpr bool NeighbourNeeds::*need = Need;
  static Range inside(const NeighbourLists& lists, Index chunk) { return (lists.*List).inside(chunk); }
  static Pair points_of_both(const Pair& pair) { return pair; }
};

/// Calls visit(m, n) for the particles m with points first … last−1, and the particles n near them.
template <class Visit>
void for_each_near_surface(const SearchSpace<3>& s, Index first, Index last, Visit&& visit) {
  if (!s.topology.surfaces || first == last) return;
  for (Index m = s.topology.particle[first]; m <= s.topology.particle[last - 1]; ++m)
    s.boxes.for_each_near(s.topology, m, {}, [&](Index n) { visit(m, n); });
}

template <>
struct ElementKind<Elements::particles> : OfOneParticle {
  template <class Lists>
  static Range inside(const Lists& lists, Index chunk) {
    return lists.particles(chunk);
  }
  static Index particle(const Topology&, Index m) { return m; }
  static std::vector<Index> stencil(const Topology& t, Index m) {
    std::vector<Index> points(static_cast<std::size_t>(t.offset[m + 1] - t.offset[m]));
    std::iota(points.begin(), points.end(), t.offset[m]);
    return points;
  }
};

template <>
struct ElementKind<Elements::points> : OfOneParticle {
  static constexpr Couples couples = Couples::nothing;
  static std::array<Index, 1> stencil(const Topology&, Index i) { return {i}; }
};

template <>
struct ElementKind<Elements::edges> : OfOneParticle {
  static std::array<Index, 2> stencil(const Topology& t, Index i) { return {i, t.next[i]}; }
};

template <>
struct ElementKind<Elements::corners> : OfOneParticle {
  static std::array<Index, 3> stencil(const Topology& t, Index i) { return {i, t.next[i], t.next[t.next[i]]}; }
};

template <>
struct ElementKind<Elements::point_pairs> : Listed<&NeighbourLists::point_pairs, &NeighbourNeeds::point_pairs, true> {
  static constexpr bool symmetric = true;
  static std::array<Index, 2> stencil(const Topology&, const Pair& p) { return {p.first, p.second}; }
  template <int D, class Found>
  static void search(const SearchSpace<D>& s, Index first, Index last, Found&& found) {
    find_point_pairs<D>(s.cloud, s.grid, s.margin, first, last, found);
  }
  template <int D>
  static std::pair<Vec<D>, Vec<D>> near(const SearchSpace<D>& s, Index i) {
    const Vec<D> r = point<D>(s.cloud.x, i);
    const Vec<D> range = Vec<D>::Constant((s.cloud.diameter[i] + s.widest) / 2 + s.margin);
    return {r - range, r + range};
  }
  template <int D, class Found>
  static void test(const SearchSpace<D>& s, Index i, Index j, Found&& found) {
    const Real contact = (s.cloud.diameter[i] + s.cloud.diameter[j]) / 2;
    if ((point<D>(s.cloud.x, j) - point<D>(s.cloud.x, i)).squaredNorm() < square(contact + s.margin))
      found(i, j, contact);
  }
};

template <>
struct ElementKind<Elements::vertex_edges>
    : Listed<&NeighbourLists::vertex_edges, &NeighbourNeeds::vertex_edges, true> {
  template <int D>
  static constexpr bool in = D == 2;
  static constexpr bool symmetric = false;
  static std::array<Index, 3> stencil(const Topology& t, const Pair& p) {
    return {p.first, p.second, t.next[p.second]};
  }
  template <class Found>
  static void search(const SearchSpace<2>& s, Index first, Index last, Found&& found) {
    find_vertex_edge_pairs(s.cloud, s.grid, s.edges, s.margin, s.widest, first, last, found);
  }
  static std::pair<Vec<2>, Vec<2>> near(const SearchSpace<2>& s, Index i) {
    const Vec<2> a = point<2>(s.cloud.x, i), b = point<2>(s.cloud.x, s.cloud.next[i]);
    // Edges are found by their first vertex, which is up to an edge away.
    const Vec<2> range = Vec<2>::Constant((s.cloud.diameter[i] + s.widest) / 2 + s.margin + s.longest);
    return {a.cwiseMin(b) - range, a.cwiseMax(b) + range};
  }
  template <class Found>
  static void test(const SearchSpace<2>& s, Index i, Index j, Found&& found) {
    for (const auto& [vertex, edge] : {Pair{i, j}, Pair{j, i}}) {
      const Real contact = vertex_edge_reach(s.edges, s.cloud.diameter[vertex], s.cloud.diameter[edge]);
      const SegmentFoot foot =
          segment_foot(point<2>(s.cloud.x, vertex), point<2>(s.cloud.x, edge), point<2>(s.cloud.x, s.cloud.next[edge]));
      if (foot.d2 < square(contact + s.margin)) found(vertex, edge, contact);
    }
  }
};

template <>
struct ElementKind<Elements::walls> : Listed<&NeighbourLists::walls, &NeighbourNeeds::walls, false> {
  static std::array<Index, 1> stencil(const Topology&, const Pair& p) { return {p.first}; }
  template <int D, class Found>
  static void search(const SearchSpace<D>& s, Index first, Index last, Found&& found) {
    find_wall_pairs<D>(s.cloud, s.walls, s.t, s.margin, first, last, found);
  }
};

template <>
struct ElementKind<Elements::lips> : Listed<&NeighbourLists::lips, &NeighbourNeeds::lips, false> {
  static constexpr Couples couples = Couples::particle;
  static std::array<Index, 2> stencil(const Topology& t, const Pair& p) {
    return t.surfaces ? points_of_edge(t, p.second) : std::array{p.second, t.next[p.second]};
  }
  template <class Found>
  static void search(const SearchSpace<2>& s, Index first, Index last, Found&& found) {
    find_lip_pairs(s.cloud, s.walls, s.t, s.margin, first, last, found);
  }
  template <class Found>
  static void search(const SearchSpace<3>& s, Index first, Index last, Found&& found) {
    find_lip_edges(s.topology, s.boxes, s.walls, s.cloud.x, s.t, s.margin, first, last, found);
  }
};

template <>
struct ElementKind<Elements::vertex_faces>
    : Listed<&NeighbourLists::vertex_faces, &NeighbourNeeds::vertex_faces, true> {
  template <int D>
  static constexpr bool in = D == 3;
  static constexpr bool symmetric = false, of_surfaces = true;
  static std::array<Index, 4> stencil(const Topology& t, const Pair& p) {
    const auto [a, b, c] = points_of_face(t, p.second);
    return {p.first, a, b, c};
  }
  static Pair points_of_both(const Pair& p) { return {p.first, point_of_face(p.second)}; }
  /// Element e of the list for its kernel.
  static SimplexPair simplices(const Topology& t, const PairList& list, Index e) {
    return vertex_face(t, list[e], list.reach[e], e);
  }
  template <class Found>
  static void search(const SearchSpace<3>& s, Index first, Index last, Found&& found) {
    for_each_near_surface(s, first, last, [&](Index m, Index n) { test_faces(s, n, m, found); });
  }
  template <class Found>
  static void test_surfaces(const SearchSpace<3>& s, Index m, Index n, Found&& found) {
    test_faces(s, m, n, found);
    test_faces(s, n, m, found);
  }

 private:
  /// Vertices of particle n and faces of particle m.
  template <class Found>
  static void test_faces(const SearchSpace<3>& s, Index n, Index m, Found&& found) {
    const Real contact = vertex_edge_reach(s.edges, s.topology.diameter[s.topology.offset[n]],
                                           s.topology.diameter[s.topology.offset[m]]);
    find_vertex_faces(s.topology, s.boxes, s.cloud.x, contact, s.margin, n, m, {},
                      [&](const Pair& pair) { found(pair.first, pair.second, contact); });
  }
};

template <>
struct ElementKind<Elements::edge_pairs> : Listed<&NeighbourLists::edge_pairs, &NeighbourNeeds::edge_pairs, true> {
  template <int D>
  static constexpr bool in = D == 3;
  static constexpr bool symmetric = true, of_surfaces = true;
  static std::array<Index, 4> stencil(const Topology& t, const Pair& p) {
    const auto [a, b] = points_of_edge(t, p.first);
    const auto [c, d] = points_of_edge(t, p.second);
    return {a, b, c, d};
  }
  static Pair points_of_both(const Pair& p) { return {point_of_edge(p.first), point_of_edge(p.second)}; }
  static SimplexPair simplices(const Topology& t, const PairList& list, Index e) {
    return edge_pair(t, list[e], list.reach[e], e);
  }
  template <class Found>
  static void search(const SearchSpace<3>& s, Index first, Index last, Found&& found) {
    for_each_near_surface(s, first, last, [&](Index m, Index n) {
      if (m < n) test_surfaces(s, m, n, found);
    });
  }
  template <class Found>
  static void test_surfaces(const SearchSpace<3>& s, Index m, Index n, Found&& found) {
    find_edge_pairs(s.topology, s.boxes, s.cloud.x, s.margin, m, n,
                    [&](const Pair& pair) { found(pair.first, pair.second, contact_distance(s.topology, m, n)); });
  }
};

/// Calls visit(pairs) for the elements of a range, vertices and faces or pairs of edges, a few at a time.
template <class Kind, class Visit>
void for_each_block(const Topology& topology, const PairList& list, Range range, Visit&& visit) {
  std::array<SimplexPair, 256> block;
  for (Index e = range.first; e < range.last;) {
    std::size_t count = 0;
    for (; e < range.last && count < block.size(); ++e) block[count++] = Kind::simplices(topology, list, e);
    visit(std::span<const SimplexPair>(block.data(), count));
  }
}

}  // namespace pliant
