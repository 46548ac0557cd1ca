#include <pliant/model/surface_crossing.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/geometry/hinge.h>
#include <pliant/model/resting_surface.h>
#include <pliant/model/surface_measures.h>

namespace pliant {
namespace {

constexpr Real sharpest_fold = -0.5;  ///< n̂·n̂'

using Bounds = Eigen::AlignedBox<Real, 3>;

template <class... Points>
Bounds around(const Points&... points) {
  Bounds b;
  (b.extend(points), ...);
  return b;
}

/// Six times the volume of a tetrahedron, with sign.
Real sixfold_volume(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d) {
  return (b - a).cross(c - a).dot(d - a);
}

class Look {
 public:
  explicit Look(const StateView<3>& s) : s_(s), bounds_(static_cast<std::size_t>(s.topology.particles())) {
    for (Index m = 0; m < s.topology.particles(); ++m)
      for (Index i = s.topology.offset[m]; i < s.topology.offset[m + 1]; ++i) bounds_[m].extend(s.position(i));
  }

  SurfacesLook all() {
    for (Index m = 0; m < s_.topology.owned(); ++m)
      if (s_.topology.active[m] != 0) look_at_own(m);
    find_pairs();
    return seen_;
  }

 private:
  const Surface& surface(Index m) const { return s_.topology.surfaces->of(s_.topology, m); }
  Vec<3> at(Index m, Index vertex) const { return s_.position(s_.topology.offset[m] + vertex); }

  void look_at_own(Index m) {
    const SurfaceShape shape = look_at_surface(s_.x, s_.topology, *s_.topology.surfaces, m);
    if (!seen_.bad_shape) {
      if (!(shape.volume > 0)) seen_.bad_shape = {m, BadShape::Kind::inverted, 0};
      if (!(shape.least_area >= least_face_area)) seen_.bad_shape = {m, BadShape::Kind::flat_face, shape.smallest_face};
    }
    const bool folds = shape.least_cosine < sharpest_fold;
    const std::optional<Piercing> piercing = star_shaped(m) ? std::nullopt : find(m, m, bounds_[m]);
    if (!folds && !piercing) return;
    ++seen_.self_crossings;
    if (seen_.crossing_itself) return;
    seen_.crossing_itself = m;
    seen_.self_piercing = piercing;
  }

  /// Whether the centre sees the outside of no face: then the surface does not meet itself.
  bool star_shaped(Index m) const {
    Vec<3> centre = Vec<3>::Zero();
    const Surface& own = surface(m);
    for (Index i = 0; i < own.points(); ++i) centre += at(m, i) / own.points();
    return std::ranges::all_of(
        own.faces, [&](const Face& f) { return sixfold_volume(at(m, f[0]), at(m, f[1]), at(m, f[2]), centre) < 0; });
  }

  void find_pairs() {
    for_each_near_pair([&](Index m, Index n) {
      const Bounds common = bounds_[m].intersection(bounds_[n]);
      seen_.piercing = find(m, n, common);
      if (!seen_.piercing) seen_.piercing = find(n, m, common);
      if (!seen_.enclosure && !seen_.piercing) seen_.enclosure = find_enclosure(m, n);
      return !seen_.piercing;
    });
    if (seen_.piercing) seen_.enclosure.reset();
  }

  /// Finds whether one of two particles, which do not pierce each other, is inside the other one.
  std::optional<Enclosure> find_enclosure(Index m, Index n) const {
    for (const Enclosure& e : {Enclosure{m, n}, Enclosure{n, m}})
      if (bounds_[e.outer].contains(bounds_[e.inner]) &&
          inside_surface(s_.x, s_.topology, surface(e.outer), e.outer, at(e.inner, 0)))
        return e;
    return {};
  }

  /// Calls visit(m, n) for particles whose bounds meet and of which one is this rank's, in a sweep along x, until it
  /// returns false.
  template <class Visit>
  void for_each_near_pair(Visit&& visit) {
    const Topology& t = s_.topology;
    std::vector<Index> order;
    for (Index m = 0; m < t.particles(); ++m)
      if (t.active[m] != 0) order.push_back(m);
    std::ranges::sort(order, {}, [&](Index m) { return std::pair(bounds_[m].min()[0], m); });
    for (std::size_t k = 0; k < order.size(); ++k)
      for (std::size_t j = k + 1; j < order.size() && bounds_[order[j]].min()[0] <= bounds_[order[k]].max()[0]; ++j) {
        const Index m = order[k], n = order[j];
        if ((m >= t.owned() && n >= t.owned()) || !bounds_[m].intersects(bounds_[n])) continue;
        if (!visit(m, n)) return;
      }
  }

  /// An edge of m that pierces a face of n within the bounds. Edges and faces of one particle with a common vertex do
  /// not count.
  std::optional<Piercing> find(Index m, Index n, const Bounds& where) {
    faces_.clear();
    const Surface &first = surface(m), &second = surface(n);
    for (std::size_t f = 0; f < second.faces.size(); ++f) {
      const auto& [a, b, c] = second.faces[f];
      const Bounds own = around(at(n, a), at(n, b), at(n, c));
      if (own.intersects(where)) faces_.push_back({static_cast<Index>(f), own});
    }
    if (faces_.empty()) return {};
    for (const Hinge& h : first.hinges) {
      const Vec<3> p = at(m, h.a), q = at(m, h.b);
      const Bounds edge = around(p, q);
      if (!edge.intersects(where)) continue;
      for (const auto& [f, bounds] : faces_) {
        if (!bounds.intersects(edge)) continue;
        const auto& [a, b, c] = second.faces[static_cast<std::size_t>(f)];
        const auto ends_at = [&](Index i) { return i == h.a || i == h.b; };
        if (m == n && (ends_at(a) || ends_at(b) || ends_at(c))) continue;
        if (pierces(p, q, at(n, a), at(n, b), at(n, c))) return Piercing{m, h.a, h.b, n, f};
      }
    }
    return {};
  }

  const StateView<3>& s_;
  std::vector<Bounds> bounds_;
  std::vector<std::pair<Index, Bounds>> faces_;
  SurfacesLook seen_;
};

}  // namespace

bool pierces(const Vec<3>& p, const Vec<3>& q, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) {
  const Real of_p = sixfold_volume(a, b, c, p), of_q = sixfold_volume(a, b, c, q);
  if (!((of_p < 0 && of_q > 0) || (of_p > 0 && of_q < 0))) return false;
  const Real ab = sixfold_volume(p, q, a, b), bc = sixfold_volume(p, q, b, c), ca = sixfold_volume(p, q, c, a);
  return (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
}

SurfacesLook look_at_surfaces(const StateView<3>& s) { return Look(s).all(); }

void check_crosses_nothing(const Surface& surface) {
  const RestingSurface resting(surface);
  const SurfacesLook seen = look_at_surfaces(resting.view());
  if (const auto& p = seen.self_piercing)
    throw InputError("the surface crosses itself: the edge from vertex {} to {} pierces face {}; move its vertices",
                     p->a, p->b, p->face);
  if (!seen.crossing_itself) return;
  const StateView<3> s = resting.view();
  const SurfaceShape shape = look_at_surface(s.x, s.topology, *s.topology.surfaces, 0);
  const Hinge& h = surface.hinges[static_cast<std::size_t>(shape.sharpest_hinge)];
  throw InputError(
      "faces {} and {}, which meet at the edge from vertex {} to {}, form an angle of {:.3g} degrees; a particle needs "
      "at least 60: blunt the edge",
      h.left, h.right, h.a, h.b, std::acos(-shape.least_cosine) * 180 / pi);
}

}  // namespace pliant
