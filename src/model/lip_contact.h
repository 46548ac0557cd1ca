// Contact of the lips of walls, for example at an orifice, with the edges of polygons: missing in [H 10], where only
// vertices feel walls.
#pragma once

#include <pliant/kernels/contact_law.h>
#include <pliant/model/term.h>
#include <pliant/model/wall_contact.h>

namespace pliant {

/// Whether lips touch edges too, or, as printed, vertices only.
inline bool read_lip_rule(ParameterReader& p) {
  return p.choice({.name = "lip_contact",
                   .help = "lips of walls touch edges and vertices of particles, or vertices only [H 10]",
                   .printed = "literal",
                   .role = Role::lip_rule},
                  named<bool>({{"edge", true}, {"literal", false}}));
}

/// Settings of the contact of lips with edges, of polygons or of surfaces. Elements: neighbour list of lips and edges.
struct LipSettings {
  Real epsilon;
  bool with_edges = true;  ///< false: as printed, only vertices feel lips
  Real thickness = 0;      ///< of the walls, as in WallContact

  static constexpr Elements elements = Elements::lips;
  static std::string_view name() { return "lip"; }
  void read(ParameterReader& p) {
    epsilon = read_wall_energy(p);
    thickness = read_wall_diameter(p);
    with_edges = read_lip_rule(p);
  }

  template <int D>
  bool enabled(const StateView<D>& s) const {
    return with_edges && !s.walls.lips().empty();
  }
  Real range() const { return thickness / 2; }

 protected:
  /// Bound of ω; stiffness: of the contact law.
  Real rate_of(Real stiffness, const Topology& topology) const {
    return with_edges
               ? std::sqrt(4 * stiffness * epsilon /
                           smallest_over_points(
                               topology,
                               [&](Index i) { return square(topology.diameter[i] + thickness) * topology.mass(i); }))
               : 0;
  }
};

/// Without it a lip enters an edge between two vertices. For a lip q and a polygon with edges (i, i+1):
///   U_q = Σ_i [V(dist(q, closed edge i)) − V(|q − r_i|) − V(|q − r_{i+1}|)], V as for walls.
/// Each vertex feels the lip already as a point near the wall's end, V(|q − r_i|); with that, the sum is V of the
/// distance to the outline, counted once, and C¹. Lips move with their walls.
struct LipContact : LipSettings {
  ContactLaw law = ContactLaw::harmonic;

  Real energy(const StateView<2>& s, Index e) const {
    const auto [q, a, b, v] = element(s, e);
    const Vec<2> ra = s.position(a), rb = s.position(b);
    return v.value(std::sqrt(segment_foot(q, ra, rb).d2)) - v.value((ra - q).norm()) - v.value((rb - q).norm());
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index e, G& grad) const {
    const auto [a, b] = forces(s, e);
    const Index start = s.neighbours.lips[e].second;
    grad.add(start, -a);
    grad.add(s.topology.next[start], -b);
  }

  /// Force of the lip on the edge; the wall that ends in it feels the opposite.
  Vec<2> force(const StateView<2>& s, Index e) const {
    const auto [a, b] = forces(s, e);
    return a + b;
  }

  void add_hessian(const StateView<2>& s, Index e, BlockSink<2>& h) const {
    const auto [q, a, b, v] = element(s, e);
    const std::array<Vec<2>, 2> r{s.position(a), s.position(b)};
    const std::array<Index, 2> points{a, b};
    const SegmentDistance edge = segment_distance(q, r[0], r[1]);
    if (!v.touches(edge.d)) return;
    for (int k = 0; k < 2; ++k) {
      for (int l = 0; l < 2; ++l)
        h.add(points[k], points[l],
              v.curvature(edge.d) * edge.gradient[k + 1] * edge.gradient[l + 1].transpose() +
                  v.slope(edge.d) * edge.hessian[k + 1][l + 1]);
      const Real d = (r[k] - q).norm();
      if (!v.touches(d)) continue;
      const Vec<2> n = direction<2>(r[k] - q, d);
      h.add(points[k], points[k], -v.curvature(d) * n * n.transpose() - v.slope(d) * distance_curvature<2>(n, d));
    }
  }

  Real max_rate(const Topology& topology) const { return rate_of(Overlap::stiffness(law), topology); }

 private:
  struct Element {
    Vec<2> lip;
    Index start, end;
    Overlap overlap;
  };
  Element element(const StateView<2>& s, Index e) const {
    const auto [lip, a] = s.neighbours.lips[e];
    return {s.walls.lip(lip, s.t), a, s.topology.next[a], {law, epsilon, (s.topology.diameter[a] + thickness) / 2}};
  }
  /// Forces on the two ends of the edge.
  std::array<Vec<2>, 2> forces(const StateView<2>& s, Index e) const {
    const auto [q, a, b, v] = element(s, e);
    const Vec<2> ra = s.position(a), rb = s.position(b);
    const SegmentFoot foot = segment_foot(q, ra, rb);
    if (foot.d2 >= square(v.delta)) return {Vec<2>::Zero(), Vec<2>::Zero()};
    const Real d = std::sqrt(foot.d2);
    const Vec<2> push = gradient(v, foot.offset, d);
    return {(1 - foot.t) * push + gradient(v, ra - q, (ra - q).norm()),
            foot.t * push + gradient(v, rb - q, (rb - q).norm())};
  }

  static Vec<2> gradient(const Overlap& v, const Vec<2>& r, Real d) {
    return d > 0 ? Vec<2>(v.slope(d) * direction<2>(r, d)) : Vec<2>(Vec<2>::Zero());  // a law may be infinite there
  }
};

}  // namespace pliant
