#include <pliant/model/surface_search.h>

#include <algorithm>

#include <pliant/geometry/simplex_distance.h>
#include <pliant/model/surface_parts.h>

namespace pliant {
namespace {

using Bounds = SurfaceBoxes::Bounds;

/// A vertex, edge or face near another particle.
struct Near {
  Index number;
  Bounds bounds;
};

/// The parts of a surface, with their numbers from `first` on, whose bounds meet `where`. points(k): numbers of the
/// points of part k in the particle.
template <class Points>
void collect(std::size_t count, Index first, const Real* x, Index first_point, const Bounds& where, Points&& points,
             std::vector<Near>& out) {
  out.clear();
  for (std::size_t k = 0; k < count; ++k) {
    Bounds own;
    for (const Index i : points(k)) own.extend(Vec<3>(point<3>(x, first_point + i)));
    if (own.intersects(where)) out.push_back({first + static_cast<Index>(k), own});
  }
}

Bounds enlarged(const Bounds& b, Real by) { return {b.min() - Vec<3>::Constant(by), b.max() + Vec<3>::Constant(by)}; }

/// Memory of a thread.
thread_local std::vector<Near> first_parts, second_parts;

void collect_edges(const Topology& t, const Real* x, Index m, const Bounds& where, std::vector<Near>& out) {
  const std::vector<Hinge>& edges = t.surfaces->of(t, m).hinges;
  collect(
      edges.size(), first_edge(t, m), x, t.offset[m], where,
      [&](std::size_t k) {
        return std::array{edges[k].a, edges[k].b};
      },
      out);
}

/// Calls test(i, j) for the collected parts of the first and of the second particle that are not farther apart than
/// `range` along any axis.
template <class Test>
void for_each_near(Real range, Test&& test) {
  for (const Near& a : first_parts) {
    const Bounds around = enlarged(a.bounds, range);
    for (const Near& b : second_parts)
      if (around.intersects(b.bounds)) test(a.number, b.number);
  }
}

}  // namespace

Bounds SurfaceBoxes::around(const Topology& topology, const Real* x, Index m) {
  Bounds b;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) b.extend(Vec<3>(point<3>(x, i)));
  return b;
}

void SurfaceBoxes::build(const Topology& topology, const Real* x, Real margin) {
  margin_ = margin;
  const Index n = topology.particles();
  bounds_.resize(n);
  std::vector<Real> centres(static_cast<std::size_t>(n) * 3), widths(n);
  Real mean = 0;
  widest_ = 0;
  for (Index m = 0; m < n; ++m) {
    bounds_[m] = around(topology, x, m);
    point<3>(centres.data(), m) = bounds_[m].center();
    widths[m] = bounds_[m].diagonal().norm() + topology.diameter[topology.offset[m]];
    widest_ = std::max(widest_, widths[m] / 2);
    mean += widths[m] / n;
  }
  grid_.build(centres.data(), widths.data(), n, mean + margin, [&](Index m) { return topology.active[m] != 0; });
}

void find_vertex_faces(const Topology& t, const SurfaceBoxes& boxes, const Real* x, Real margin, Index n, Index m,
                       const FoundPair& found) {
  const Real range = contact_distance(t, m, n) + margin;
  collect(
      static_cast<std::size_t>(t.points_of(n)), t.offset[n], x, t.offset[n], enlarged(boxes.of(m), range),
      [](std::size_t k) { return std::array{static_cast<Index>(k)}; }, first_parts);
  if (first_parts.empty()) return;
  const std::vector<Face>& faces = t.surfaces->of(t, m).faces;
  collect(
      faces.size(), first_face(t, m), x, t.offset[m], enlarged(boxes.of(n), range),
      [&](std::size_t k) { return faces[k]; }, second_parts);
  for_each_near(range, [&](Index vertex, Index face) {
    const auto [a, b, c] = points_of_face(t, face);
    const FourPoints r{point<3>(x, vertex), point<3>(x, a), point<3>(x, b), point<3>(x, c)};
    if (VertexOnFace(r).d2() < square(range)) found({vertex, face});
  });
}

void find_edge_pairs(const Topology& t, const SurfaceBoxes& boxes, const Real* x, Real margin, Index m, Index n,
                     const FoundPair& found) {
  const Real range = contact_distance(t, m, n) + margin;
  collect_edges(t, x, m, enlarged(boxes.of(n), range), first_parts);
  if (first_parts.empty()) return;
  collect_edges(t, x, n, enlarged(boxes.of(m), range), second_parts);
  for_each_near(range, [&](Index first, Index second) {
    const auto [a, b] = points_of_edge(t, first);
    const auto [c, d] = points_of_edge(t, second);
    const FourPoints r{point<3>(x, a), point<3>(x, b), point<3>(x, c), point<3>(x, d)};
    if (EdgeOnEdge(r).d2() < square(range)) found({first, second});
  });
}

}  // namespace pliant
