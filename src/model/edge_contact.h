// Contact between the vertices and the edges of deformable particles: smooth particles [H App. A], and rough particles
// with stretched edges.
#pragma once

#include <pliant/kernels/contact_law.h>
#include <pliant/kernels/edge_forces.h>
#include <pliant/model/outline.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/term.h>

namespace pliant {

/// How hard the middle of an edge pushes a vertex.
enum class EdgeForce {
  single,  ///< half as hard as two vertices that meet head on push each other
  twofold  ///< twice as hard
};

/// A vertex j of one polygon against the outline of another:
///   U_j = Σ_i [V(dist(j, closed edge i)) − V(dist(j, vertex i))]
/// with V by one of the laws in contact_law.h and the range r = (δ_m + δ_n)/2 of circulo-lines of width δ (smooth), or
/// r = δ_n/2 of the disk of vertex j and an edge without width (rough). The subtraction removes the double count where
/// two edges share a vertex, so that U_j equals V of the distance to the outline outside a convex corner and is C¹
/// everywhere; the distance rule of [H App. A] alone jumps where the foot of the perpendicular leaves an edge. Both
/// directions count. The gradient goes to the vertex and to both ends of the edge: linear and angular momentum of the
/// contact are conserved. The distance is unsigned: a vertex that has crossed an outline is an error state
/// (crossing.h). With a C² law the second derivatives jump only where the nearest place changes from an edge to a
/// corner. Each bracket is at least 0, therefore with an unbounded law U_j is unbounded wherever j approaches the
/// outline.
///
/// EdgeForce::twofold: Σ_i [2 V(dist(j, closed edge i)) − 7/2 V(dist(j, vertex i))], which is 2V before an edge and V/2
/// before a corner, on either side, and as smooth. Elements: neighbour list of vertices and edges.
struct EdgeContact {
  Real epsilon = 0;
  Edges edges = Edges::wide;
  bool on = true;
  EdgeForce force = EdgeForce::single;
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::vertex_edges;
  std::string_view name() const { return edges == Edges::wide ? "contact" : "edge"; }
  void read(ParameterReader& p) {
    if (edges == Edges::bare) return read_bare_contact(p, epsilon, on);
    epsilon = p.number(contact_energy::deformable);
    force = p.choice(
        {.name = "edge_force", .help = "smooth: vertex-edge force / vertex-vertex force: 0.5 (single) or 2 (twofold)"},
        named<EdgeForce>({{"single", EdgeForce::single}, {"twofold", EdgeForce::twofold}}));
  }

  EdgeContactLaw kernel_law() const { return {epsilon, law, edge_weight(), vertex_weight()}; }
  bool enabled(const StateView<2>&) const { return on; }
  bool off() const { return !on; }

  Real energy(const StateView<2>& s, Index e) const {
    const auto [p, a, b, v] = element(s, e);
    const SegmentFoot foot = segment_foot(s.position(p), s.position(a), s.position(b));
    return edge_weight() * v.value(std::sqrt(foot.d2)) -
           vertex_weight() * v.value((s.position(p) - s.position(a)).norm());
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index e, G& grad) const {
    const auto [p, a, b, v] = element(s, e);
    const Vec<2> rp = s.position(p), ra = s.position(a);
    const SegmentFoot foot = segment_foot(rp, ra, s.position(b));
    if (foot.d2 >= square(v.delta)) return;
    if (foot.t == 0 && force == EdgeForce::single) return;  // both parts cancel
    if (foot.d2 > 0) {
      const Real d = std::sqrt(foot.d2);
      const Vec<2> pull = edge_weight() * v.slope(d) / d * foot.offset;
      grad.add(p, pull);
      grad.add(a, -(1 - foot.t) * pull);
      grad.add(b, -foot.t * pull);
    }
    const Vec<2> r = rp - ra;
    const Real r2 = r.squaredNorm();
    if (r2 < square(v.delta) && r2 > 0) {
      const Real d = std::sqrt(r2);
      const Vec<2> pull = vertex_weight() * v.slope(d) / d * r;
      grad.add(p, -pull);
      grad.add(a, pull);
    }
  }

  void add_hessian(const StateView<2>& s, Index e, BlockSink<2>& h, PreStress pre_stress = PreStress::kept) const {
    const auto [p, a, b, v] = element(s, e);
    const SegmentDistance edge = segment_distance(s.position(p), s.position(a), s.position(b));
    if (!v.touches(edge.d)) return;
    const std::array<Index, 3> points{p, a, b};
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l)
        h.add(points[k], points[l],
              edge_weight() * (v.curvature(edge.d) * edge.gradient[k] * edge.gradient[l].transpose() +
                               slope_factor(pre_stress) * v.slope(edge.d) * edge.hessian[k][l]));
    const Vec<2> r = s.position(p) - s.position(a);
    const Real d = r.norm();
    if (!v.touches(d)) return;
    const Vec<2> n = direction<2>(r, d);
    const Mat<2> block = vertex_weight() * (v.curvature(d) * n * n.transpose() +
                                            slope_factor(pre_stress) * v.slope(d) * distance_curvature<2>(n, d));
    h.add(p, p, -block);
    h.add(a, a, -block);
    h.add(p, a, block);
    h.add(a, p, block);
  }

  bool contact(const StateView<2>& s, Index e, Contact<2>& c) const {
    const auto [p, a, b, v] = element(s, e);
    const SegmentFoot foot = segment_foot(s.position(p), s.position(a), s.position(b));
    const Real d = std::sqrt(foot.d2);
    if (!v.touches(d) || !carries_contact(s, p, a, foot)) return false;
    const Topology& topology = s.topology;
    c.first = topology.particle[p];
    c.second = topology.particle[a];
    c.normal = direction<2>(foot.offset, d);
    c.position = s.position(p) - topology.diameter[p] / (2 * v.delta) * foot.offset;
    c.overlap = 1 - d / v.delta;
    c.reach = v.delta;
    c.force = -(foot.interior() ? edge_weight() : 2 * edge_weight() - vertex_weight()) * v.slope(d) * c.normal;
    return true;
  }

  /// Worst case: vertex against vertex, which both directions count, ω² = 4 V''/m. Bare edges: a vertex at the middle
  /// of an edge, 3/2 V''/m; the disks of vertices keep vertices farther apart.
  Real max_rate(const Topology& topology) const {
    if (!on) return 0;
    const Real worst = edges == Edges::wide ? 4 : 1.5;
    return std::sqrt(worst * Overlap::stiffness(law) * epsilon / smallest_over_points(topology, [&](Index i) {
                       const Real delta = topology.diameter[i];
                       return square(vertex_edge_reach(edges, delta, delta)) * topology.mass(i);
                     }));
  }

  /// Factors of the two V.
  Real edge_weight() const { return force == EdgeForce::single ? 1 : 2; }
  Real vertex_weight() const { return force == EdgeForce::single ? 1 : 3.5; }

 private:
  struct Element {
    Index vertex, start, end;
    Overlap overlap;
  };
  Element element(const StateView<2>& s, Index e) const {
    const auto [p, a] = s.neighbours.vertex_edges[e];
    const Real reach = vertex_edge_reach(edges, s.topology.diameter[p], s.topology.diameter[a]);
    return {p, a, s.topology.next[a], {law, epsilon, reach}};
  }
};

}  // namespace pliant
