// Contact between the vertices, edges and faces of deformable particles in space: smooth ones, and rough ones with
// stretched faces.
#pragma once

#include <algorithm>
#include <array>
#include <optional>

#include <pliant/geometry/simplex_distance.h>
#include <pliant/kernels/contact_law.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/term.h>

namespace pliant {

/// Σ c V(d) over the distances d of a few pairs of simplices that are parts of an element.
template <int Most>
class PartSum {
 public:
  /// Only parts that are nearer than delta count.
  void add(Real factor, Real delta, const NearestPlaces& places) {
    if (factor != 0 && places.d2 < square(delta)) parts_[count_++] = {factor, places};
  }
  bool empty() const { return count_ == 0; }

  Real value(const HarmonicOverlap& v) const {
    Real sum = 0;
    for (int k = 0; k < count_; ++k) sum += parts_[k].factor * v.value(std::sqrt(parts_[k].places.d2));
    return sum;
  }
  /// Derivatives by the four points. Parts without a distance have no direction.
  FourPoints gradient(const HarmonicOverlap& v) const {
    FourPoints sum;
    sum.fill(Vec<3>::Zero());
    for (int k = 0; k < count_; ++k) {
      const auto& [factor, places] = parts_[k];
      if (!(places.d2 > 0)) continue;
      const Real d = std::sqrt(places.d2);
      const Vec<3> pull = factor * v.slope(d) / d * places.offset;
      for (int l = 0; l < 4; ++l) sum[l] += places.weight[l] * pull;
    }
    return sum;
  }
  /// first: points of the first simplex.
  std::array<std::array<Mat<3>, 4>, 4> hessian(const FourPoints& r, int first, const HarmonicOverlap& v,
                                               PreStress pre_stress) const {
    std::array<std::array<Mat<3>, 4>, 4> sum;
    for (auto& row : sum) row.fill(Mat<3>::Zero());
    for (int k = 0; k < count_; ++k) {
      const auto& [factor, places] = parts_[k];
      const Real d = std::sqrt(places.d2);
      const Vec<3> n = direction<3>(places.offset, d);
      const PlaceMotion motion(r, first, places);
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
          sum[i][j] += factor * (v.curvature(d) * places.weight[i] * places.weight[j] * n * n.transpose() +
                                 slope_factor(pre_stress) * v.slope(d) * motion.hessian(i, j));
    }
    return sum;
  }

 private:
  struct Part {
    Real factor;
    NearestPlaces places;
  };
  std::array<Part, Most> parts_;
  int count_ = 0;
};

/// The places of an element where two surfaces touch, and the factor with which they count.
struct TouchingPlaces {
  NearestPlaces places;
  Real factor;
};

/// A vertex of one surface and a face of another one, with the contact distance δ.
struct VertexFace {
  std::array<Index, 4> points;
  FourPoints r;
  Real delta;
  Index particle, face;  ///< the face: its particle, and its number there
  const Surface& surface;

  VertexFace(const StateView<3>& s, Index e)
      : delta(s.neighbours.vertex_faces.reach[e]),
        particle(s.topology.particle[point_of_face(s.neighbours.vertex_faces[e].second)]),
        face(s.neighbours.vertex_faces[e].second - first_face(s.topology, particle)),
        surface(s.topology.surfaces->of(s.topology, particle)) {
    const Index first = s.topology.offset[particle];
    const auto& [a, b, c] = surface.faces[face];
    points = {s.neighbours.vertex_faces[e].first, first + a, first + b, first + c};
    for (int k = 0; k < 4; ++k) r[k] = s.position(points[k]);
  }

  /// Whether the vertex is farther than δ from the plane of the face.
  bool apart() const {
    const Vec<3> n = (r[2] - r[1]).cross(r[3] - r[1]);
    return square(n.dot(r[0] - r[1])) > square(delta) * n.squaredNorm();
  }
  /// V(d to the face) − ½ Σ V(d to an edge) + Σ V(d to a corner)/(2k), where k faces meet: the sum over the faces of a
  /// surface is Σ_f V − Σ_e V + ½ Σ_u V.
  PartSum<7> parts() const {
    PartSum<7> sum;
    if (apart()) return sum;
    const VertexOnFace on(r);
    if (!(on.d2() < square(delta))) return sum;
    if (on.inside) sum.add(1, delta, *on.inside);
    std::array<Real, 3> at_corner;
    for (int k = 0; k < 3; ++k) at_corner[k] = 0.5 / static_cast<Real>(surface.around[corner(k)].size());
    for (int k = 0; k < 3; ++k) {
      const Real factor = !on.inside && k == on.nearest_edge() ? 0.5 : -0.5;
      if (on.foot[k].interior())
        sum.add(factor, delta, on.on_edge(k));
      else
        at_corner[on.foot[k].t == 0 ? k : (k + 1) % 3] += factor;
    }
    for (int k = 0; k < 3; ++k) sum.add(at_corner[k], delta, on.at_corner(k));
    return sum;
  }
  /// Where the vertex touches the face, if no other face is nearer around this place. A place on an edge belongs to one
  /// of its faces, a place at a vertex to one of the faces there. Two vertices touch where each is the nearest place of
  /// its surface; they are two elements, which count by halves.
  std::optional<TouchingPlaces> touching(const StateView<3>& s) const {
    if (apart()) return {};
    const VertexOnFace on(r);
    if (!(on.d2() < square(delta))) return {};
    if (on.inside) return TouchingPlaces{*on.inside, 1};
    const int k = on.nearest_edge();
    const Index first = s.topology.offset[particle];
    const Vec<3>& offset = on.foot[k].offset;
    if (on.foot[k].interior()) {
      const Surface::Across& other = surface.across[face][k];
      if (other.face < face || offset.dot(s.position(first + other.vertex) - r[1 + k]) > 0) return {};
      return TouchingPlaces{on.on_edge(k), 1};
    }
    const int at = on.foot[k].t == 0 ? k : (k + 1) % 3;
    if (surface.lowest_face[corner(at)] != face) return {};
    const Index own = s.topology.particle[points[0]];
    if (!nearest_around(s, particle, points[1 + at], offset) || !nearest_around(s, own, points[0], -offset)) return {};
    return TouchingPlaces{on.at_corner(at), 0.5};
  }
  /// Derivatives of the factor by the points.
  static FourPoints factor_gradient() {
    FourPoints none;
    none.fill(Vec<3>::Zero());
    return none;
  }

 private:
  Index corner(int k) const { return surface.faces[face][k]; }
  /// Whether vertex i of particle m is the nearest place of its faces to a point in the direction `towards`.
  static bool nearest_around(const StateView<3>& s, Index m, Index i, const Vec<3>& towards) {
    const Index first = s.topology.offset[m];
    return std::ranges::all_of(s.topology.surfaces->of(s.topology, m).around[i - first],
                               [&](Index end) { return towards.dot(s.position(first + end) - s.position(i)) <= 0; });
  }
};

/// Factor m = x (2 − x), x = min(1, sin²θ/s0), of two edges u and v at the angle θ: 0 and without a slope for parallel
/// edges, whose nearest places jump.
class Mollifier {
 public:
  Mollifier(const Vec<3>& u, const Vec<3>& v, Real s0) : u_(u), v_(v), s0_(s0) {
    const Vec<3> n = u.cross(v);
    const Real u2 = u.squaredNorm(), v2 = v.squaredNorm();
    s_ = n.squaredNorm() / (u2 * v2);
    by_u_ = 2 / u2 * (v.cross(n) / v2 - s_ * u);
    by_v_ = 2 / v2 * (n.cross(u) / u2 - s_ * v);
  }

  Real value() const { return s_ < s0_ ? s_ / s0_ * (2 - s_ / s0_) : 1; }
  Real slope() const { return s_ < s0_ ? 2 / s0_ * (1 - s_ / s0_) : 0; }
  Real curvature() const { return s_ < s0_ ? -2 / square(s0_) : 0; }
  /// Derivatives of sin²θ by u and v, first and second.
  const Vec<3>& gradient(int k) const { return k == 0 ? by_u_ : by_v_; }
  Mat<3> hessian(int k, int l) const {
    // sin²θ = 1 − c²; derivatives of c = û·v̂.
    const Vec<3> a = (k == 0 ? u_ : v_).normalized(), b = (k == 0 ? v_ : u_).normalized();
    const Real length = (k == 0 ? u_ : v_).norm(), other = (k == 0 ? v_ : u_).norm(), c = a.dot(b);
    const Vec<3> by_a = (b - c * a) / length, by_b = (a - c * b) / other;
    if (k == l)
      return -2 * (by_a * by_a.transpose() +
                   c / square(length) *
                       (3 * c * a * a.transpose() - b * a.transpose() - a * b.transpose() - c * Mat<3>::Identity()));
    return -2 * (by_a * by_b.transpose() + c / (length * other) * (Mat<3>::Identity() - a * a.transpose()) *
                                               (Mat<3>::Identity() - b * b.transpose()));
  }

 private:
  Vec<3> u_, v_, by_u_, by_v_;
  Real s0_, s_;
};

/// Edges of two surfaces, with the contact distance δ.
struct EdgeEdge {
  std::array<Index, 4> points;
  FourPoints r;
  Real delta;
  Real s0;  ///< s0 of the mollifier

  /// given_s0: 0 for usual_mollifier.
  EdgeEdge(const StateView<3>& s, Index e, Real given_s0) : delta(s.neighbours.edge_pairs.reach[e]), s0(given_s0) {
    points = ElementKind<Elements::edge_pairs>::stencil(s.topology, s.neighbours.edge_pairs[e]);
    for (int k = 0; k < 4; ++k) r[k] = s.position(points[k]);
    if (!(s0 > 0)) s0 = usual_mollifier(s.topology, points[0], points[2]);
  }

  Mollifier mollifier() const { return {r[1] - r[0], r[3] - r[2], s0}; }
  /// Whether the lines through the edges are farther than δ from each other.
  bool apart() const {
    const Vec<3> n = (r[1] - r[0]).cross(r[3] - r[2]);
    return square(n.dot(r[2] - r[0])) > square(delta) * n.squaredNorm();
  }
  /// I = V(d of the edges) − Σ V(d of an end and the other edge) + Σ V(d of two ends).
  PartSum<9> parts() const {
    PartSum<9> sum;
    if (apart()) return sum;
    const EdgeOnEdge on(r);
    if (!(on.d2() < square(delta))) return sum;
    if (on.inside) sum.add(1, delta, *on.inside);
    std::array<std::array<int, 2>, 2> of_ends{{{1, 1}, {1, 1}}};
    for (int k = 0; k < 4; ++k) {
      const int factor = !on.inside && k == on.nearest_end() ? 0 : -1;
      if (on.foot[k].interior()) {
        sum.add(factor, delta, on.of_end(k));
      } else {
        const int other = on.foot[k].t == 0 ? 0 : 1;
        (k < 2 ? of_ends[k][other] : of_ends[other][k - 2]) += factor;
      }
    }
    for (const int first : {0, 1})
      for (const int second : {0, 1}) sum.add(of_ends[first][second], delta, on.of_points(first, 2 + second));
    return sum;
  }
  /// Where the edges touch with their insides.
  std::optional<TouchingPlaces> touching(const StateView<3>&) const {
    if (apart()) return {};
    const EdgeOnEdge on(r);
    if (!on.inside || !(on.inside->d2 < square(delta))) return {};
    return TouchingPlaces{*on.inside, mollifier().value()};
  }
  /// Derivatives of the mollifier, the factor, by the points.
  FourPoints factor_gradient() const {
    const Mollifier m = mollifier();
    FourPoints by_points;
    for (int k = 0; k < 4; ++k) by_points[k] = side(k) * m.slope() * m.gradient(k / 2);
    return by_points;
  }
  /// Derivative of an edge by point k.
  static Real side(int k) { return k % 2 == 0 ? -1 : 1; }
};

/// The contact at these places, for the output.
inline Contact<3> contact_at(const StateView<3>& s, const std::array<Index, 4>& points, int first,
                             const TouchingPlaces& touching, const HarmonicOverlap& v) {
  const NearestPlaces& places = touching.places;
  const Real d = std::sqrt(places.d2);
  Contact<3> c;
  c.first = s.topology.particle[points[0]];
  c.second = s.topology.particle[points[3]];
  c.normal = direction<3>(places.offset, d);
  Vec<3> place = Vec<3>::Zero();
  for (int k = 0; k < first; ++k) place += places.weight[k] * s.position(points[k]);
  c.position = place - s.topology.diameter[points[0]] / (2 * v.delta) * places.offset;
  c.overlap = 1 - d / v.delta;
  c.reach = v.delta;
  c.force = -touching.factor * v.slope(d) * c.normal;
  return c;
}

/// Rates of a motion with this ω².
inline MotionRates vibration(Real stiffness) {
  MotionRates rates;
  rates.translation.stiffness = stiffness;
  return rates;
}

/// A vertex v of one surface against another surface:
///   U_v = Σ_f V(d(v, f)) − Σ_e V(d(v, e)) + ½ Σ_u V(|v − u|)
/// over its closed faces, edges and vertices, with V(d) = ε/2 (1 − d/δ)² for d < δ, and δ the mean of the widths of the
/// particles (smooth), or the radius of the sphere of vertex v and faces without width (rough). Where the surface is
/// convex, only V of the distance to the surface is left, or ½ V if a vertex is nearest, which counts in both
/// directions; U_v is C¹. Both directions count, and linear and angular momentum are conserved. The distance is
/// unsigned: surfaces that have pierced each other are an error state (surface_crossing.h). Elements: neighbour list of
/// vertices and faces.
struct VertexFaceContact {
  Real epsilon;
  Edges edges = Edges::wide;  ///< and faces
  bool on = true;

  static constexpr Elements elements = Elements::vertex_faces;
  std::string_view name() const { return edges == Edges::wide ? "contact_vertex" : "face"; }
  void read(ParameterReader& p) {
    if (edges == Edges::bare) return read_bare_contact(p, epsilon, on);
    epsilon = p.number(contact_energy::deformable);
  }
  bool enabled(const StateView<3>&) const { return on; }
  bool off() const { return !on; }

  Real energy(const StateView<3>& s, Index e) const {
    const VertexFace pair(s, e);
    return pair.parts().value({epsilon, pair.delta});
  }
  template <class G>
  void add_gradient(const StateView<3>& s, Index e, G& grad) const {
    const VertexFace pair(s, e);
    const PartSum<7> parts = pair.parts();
    if (parts.empty()) return;
    const FourPoints sum = parts.gradient({epsilon, pair.delta});
    for (int k = 0; k < 4; ++k) grad.add(pair.points[k], sum[k]);
  }
  void add_hessian(const StateView<3>& s, Index e, BlockSink<3>& h, PreStress pre_stress = PreStress::kept) const {
    const VertexFace pair(s, e);
    const PartSum<7> parts = pair.parts();
    if (parts.empty()) return;
    const auto blocks = parts.hessian(pair.r, 1, {epsilon, pair.delta}, pre_stress);
    for (int k = 0; k < 4; ++k)
      for (int l = 0; l < 4; ++l) h.add(pair.points[k], pair.points[l], blocks[k][l]);
  }
  bool contact(const StateView<3>& s, Index e, Contact<3>& c) const {
    const VertexFace pair(s, e);
    const auto touching = pair.touching(s);
    if (!touching) return false;
    c = contact_at(s, pair.points, 1, *touching, {epsilon, pair.delta});
    return true;
  }
  /// Two vertices against each other: ω² = 2 V''/m. Bare faces: a vertex at the middle of an edge, 3/2 V''/m; the
  /// spheres of vertices keep vertices farther apart.
  Real max_rate(const Topology& topology) const {
    if (!on) return 0;
    const Real worst = edges == Edges::wide ? 2 : 1.5;
    return std::sqrt(worst * epsilon / smallest_over_points(topology, [&](Index i) {
                       const Real delta = topology.diameter[i];
                       return square(vertex_edge_reach(edges, delta, delta)) * topology.mass(i);
                     }));
  }
  /// Surfaces that lie flat on each other: a vertex touches a face, and its own faces touch several vertices. Bare
  /// faces touch few vertices.
  MotionRates crowded(const Topology& topology) const {
    return vibration((edges == Edges::wide ? 3 : 1) * square(max_rate(topology)));
  }
};

/// The parameter of the mollifier.
inline constexpr Parameter mollifier_s0{
    .name = "mollifier_s0",
    .symbol = "s_0",
    .help = "smooth: edges count less below this sin^2 of their angle; 0: 4 edge_width^2",
    .value = 0,
    .max = 1};

/// An edge of one surface against an edge of another one: U = m I with
///   I = V(d(e, e')) − Σ_{v∈e} V(d(v, e')) − Σ_{u∈e'} V(d(u, e)) + Σ_{v, u} V(|v − u|)
/// and the factor m of Mollifier, whose slope is part of the force. I is V of the distance where the insides of the
/// edges touch far from their ends; at an end VertexFaceContact takes over, and the sum is C¹. Elements: neighbour list
/// of edges.
struct EdgePairContact {
  Real epsilon;
  Real s0 = 0;  ///< s0 of the mollifier; 0: from the widths

  static constexpr Elements elements = Elements::edge_pairs;
  static std::string_view name() { return "contact_edge"; }
  void read(ParameterReader& p) {
    epsilon = p.number(contact_energy::deformable);
    s0 = p.number(mollifier_s0);
  }
  static bool enabled(const StateView<3>&) { return true; }

  Real energy(const StateView<3>& s, Index e) const {
    const EdgeEdge pair(s, e, s0);
    const PartSum<9> parts = pair.parts();
    return parts.empty() ? 0 : pair.mollifier().value() * parts.value({epsilon, pair.delta});
  }
  template <class G>
  void add_gradient(const StateView<3>& s, Index e, G& grad) const {
    const EdgeEdge pair(s, e, s0);
    const PartSum<9> parts = pair.parts();
    if (parts.empty()) return;
    const HarmonicOverlap v{epsilon, pair.delta};
    const Mollifier m = pair.mollifier();
    const FourPoints sum = parts.gradient(v);
    const Real slope = m.slope() * parts.value(v);
    for (int k = 0; k < 4; ++k)
      grad.add(pair.points[k], Vec<3>(m.value() * sum[k] + EdgeEdge::side(k) * slope * m.gradient(k / 2)));
  }
  void add_hessian(const StateView<3>& s, Index e, BlockSink<3>& h, PreStress pre_stress = PreStress::kept) const {
    const EdgeEdge pair(s, e, s0);
    const PartSum<9> parts = pair.parts();
    if (parts.empty()) return;
    const HarmonicOverlap v{epsilon, pair.delta};
    const Mollifier m = pair.mollifier();
    const auto blocks = parts.hessian(pair.r, 2, v, pre_stress);
    const FourPoints sum = parts.gradient(v), by = pair.factor_gradient();
    const Real value = parts.value(v), turning = slope_factor(pre_stress);
    for (int k = 0; k < 4; ++k)
      for (int l = 0; l < 4; ++l) {
        const Mat<3> second =
            m.slope() * m.hessian(k / 2, l / 2) + m.curvature() * m.gradient(k / 2) * m.gradient(l / 2).transpose();
        h.add(pair.points[k], pair.points[l],
              m.value() * blocks[k][l] + turning * (by[k] * sum[l].transpose() + sum[k] * by[l].transpose() +
                                                    value * EdgeEdge::side(k) * EdgeEdge::side(l) * second));
      }
  }
  bool contact(const StateView<3>& s, Index e, Contact<3>& c) const {
    const EdgeEdge pair(s, e, s0);
    const auto touching = pair.touching(s);
    if (!touching) return false;
    c = contact_at(s, pair.points, 2, *touching, {epsilon, pair.delta});
    return true;
  }
  /// Two edges that cross at their ends: ω² = 2 V''/m.
  Real max_rate(const Topology& topology) const { return VertexFaceContact{epsilon}.max_rate(topology); }
  /// Surfaces that lie flat on each other: each edge crosses a few edges, and their stiffness adds up at its ends.
  MotionRates crowded(const Topology& topology) const { return vibration(10 * square(max_rate(topology))); }
};

}  // namespace pliant
