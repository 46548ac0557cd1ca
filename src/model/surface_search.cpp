#include <pliant/model/surface_search.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

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
thread_local std::vector<SimplexPair> candidates, near_candidates;
thread_local std::vector<Pair> numbers;  ///< of the candidates

void collect_edges(const Topology& t, const Real* x, Index m, const Bounds& where, std::vector<Near>& out) {
  const std::vector<Hinge>& edges = t.surfaces->of(t, m).hinges;
  collect(
      edges.size(), first_edge(t, m), x, t.offset[m], where,
      [&](std::size_t k) {
        return std::array{edges[k].a, edges[k].b};
      },
      out);
}

/// Calls found(i, j) for the collected parts of the first and of the second particle that are nearer than contact +
/// margin. points(i, j): their points; add_near: the kernel's test.
template <class Points, class AddNear>
void find_near(Real contact, Real margin, const Real* x, Points&& points, AddNear&& add_near, const FoundPair& found) {
  candidates.clear();
  near_candidates.clear();
  numbers.clear();
  for (const Near& a : first_parts) {
    const Bounds around = enlarged(a.bounds, contact + margin);
    for (const Near& b : second_parts) {
      if (!around.intersects(b.bounds)) continue;
      candidates.push_back({points(a.number, b.number), static_cast<Index>(numbers.size()), contact, {}});
      numbers.push_back({a.number, b.number});
    }
  }
  add_near(candidates, margin, x, near_candidates);
  for (const SimplexPair& pair : near_candidates) found(numbers[static_cast<std::size_t>(pair.element)]);
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

void find_vertex_faces(const Topology& t, const SurfaceBoxes& boxes, const Real* x, Real contact, Real margin, Index n,
                       Index m, const std::function<bool(Index)>& wanted, const FoundPair& found) {
  const Real range = contact + margin;
  collect(
      static_cast<std::size_t>(t.points_of(n)), t.offset[n], x, t.offset[n], enlarged(boxes.of(m), range),
      [](std::size_t k) { return std::array{static_cast<Index>(k)}; }, first_parts);
  if (first_parts.empty()) return;
  const std::vector<Face>& faces = t.surfaces->of(t, m).faces;
  collect(
      faces.size(), first_face(t, m), x, t.offset[m], enlarged(boxes.of(n), range),
      [&](std::size_t k) { return faces[k]; }, second_parts);
  if (wanted) std::erase_if(second_parts, [&](const Near& face) { return !wanted(face.number - first_face(t, m)); });
  const auto points = [&](Index vertex, Index face) {
    const auto [a, b, c] = points_of_face(t, face);
    return std::array{vertex, a, b, c};
  };
  find_near(contact, margin, x, points, add_near_vertex_faces, found);
}

void find_edge_pairs(const Topology& t, const SurfaceBoxes& boxes, const Real* x, Real margin, Index m, Index n,
                     const FoundPair& found) {
  const Real contact = contact_distance(t, m, n), range = contact + margin;
  collect_edges(t, x, m, enlarged(boxes.of(n), range), first_parts);
  if (first_parts.empty()) return;
  collect_edges(t, x, n, enlarged(boxes.of(m), range), second_parts);
  const auto points = [&](Index first, Index second) {
    const auto [a, b] = points_of_edge(t, first);
    const auto [c, d] = points_of_edge(t, second);
    return std::array{a, b, c, d};
  };
  find_near(contact, margin, x, points, add_near_edge_pairs, found);
}

void find_lip_edges(const Topology& t, const SurfaceBoxes& boxes, const Walls<3>& walls, const Real* x, Real time,
                    Real margin, Index first, Index last, const std::function<void(Index, Index)>& found) {
  if (!t.surfaces || walls.lips().empty() || first == last) return;
  for (Index m = t.particle[first]; m <= t.particle[last - 1]; ++m) {
    if (t.active[m] == 0) continue;
    const Real range = t.diameter[t.offset[m]] / 2 + margin;
    const Bounds& box = boxes.of(m);
    for (Index lip = 0; lip < static_cast<Index>(walls.lips().size()); ++lip) {
      const Pose<3> pose = walls.lip_pose(lip, time);
      const Circle circle = walls.lip_circle(lip);
      if (circle.distance(pose.back(box.center())) > box.diagonal().norm() / 2 + range) continue;
      const auto edges = static_cast<Index>(t.surfaces->of(t, m).hinges.size());
      for (Index edge = first_edge(t, m); edge < first_edge(t, m) + edges; ++edge) {
        const auto [i, j] = points_of_edge(t, edge);
        const Vec<3> a = pose.back(point<3>(x, i)), b = pose.back(point<3>(x, j));
        if (circle.distance(a + nearest_to_circle(circle, a, b) * (b - a)) < range) found(lip, edge);
      }
    }
  }
}

Real surface_distance(const Surface& first, const Real* x, const Vec<3>& shift, const Surface& second, const Real* y) {
  const auto of_first = [&](Index i) { return Vec<3>(point<3>(x, i) + shift); };
  const auto of_second = [&](Index i) { return Vec<3>(point<3>(y, i)); };
  Bounds around_first, around_second;
  Real least2 = std::numeric_limits<Real>::infinity();
  for (Index i = 0; i < first.points(); ++i) around_first.extend(of_first(i));
  for (Index j = 0; j < second.points(); ++j) around_second.extend(of_second(j));
  for (Index i = 0; i < first.points(); ++i)
    for (Index j = 0; j < second.points(); ++j) least2 = std::min(least2, (of_first(i) - of_second(j)).squaredNorm());
  // The parts that may be nearer, by their boxes.
  struct Part {
    std::array<Vec<3>, 3> r;
    Bounds bounds;
  };
  const auto near = [&](const auto& parts, const auto& corners, const auto& at, const Bounds& others) {
    std::vector<Part> found;
    for (const auto& part : parts) {
      Part own;
      own.r.fill(Vec<3>::Zero());  // an edge has two corners
      std::size_t count = 0;
      for (const Index i : corners(part)) own.bounds.extend(own.r[count++] = at(i));
      if (own.bounds.squaredExteriorDistance(others) < least2) found.push_back(own);
    }
    return found;
  };
  const auto compare = [&](const std::vector<Part>& some, const std::vector<Part>& others, auto&& distance2) {
    for (const Part& a : some)
      for (const Part& b : others)
        if (a.bounds.squaredExteriorDistance(b.bounds) < least2) least2 = std::min(least2, distance2(a.r, b.r));
  };
  const auto vertex_face = [](const auto& a, const auto& b) {
    const FourPoints r{a[0], b[0], b[1], b[2]};
    return VertexOnFace(r).d2();
  };
  const auto edge_edge = [](const auto& a, const auto& b) {
    const FourPoints r{a[0], a[1], b[0], b[1]};
    return EdgeOnEdge(r).d2();
  };
  const auto whole = [](const Face& face) { return face; };
  const auto ends = [](const Hinge& h) { return std::array{h.a, h.b}; };
  const auto alone = [](Index i) { return std::array{i}; };
  std::vector<Index> first_points(static_cast<std::size_t>(first.points())),
      second_points(static_cast<std::size_t>(second.points()));
  std::iota(first_points.begin(), first_points.end(), 0);
  std::iota(second_points.begin(), second_points.end(), 0);
  compare(near(first_points, alone, of_first, around_second), near(second.faces, whole, of_second, around_first),
          vertex_face);
  compare(near(second_points, alone, of_second, around_first), near(first.faces, whole, of_first, around_second),
          vertex_face);
  compare(near(first.hinges, ends, of_first, around_second), near(second.hinges, ends, of_second, around_first),
          edge_edge);
  return std::sqrt(least2);
}

}  // namespace pliant
