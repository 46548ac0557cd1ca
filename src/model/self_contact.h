// Contact of a deformable particle with itself: keeps its outline from crossing itself.
#pragma once

#include <algorithm>
#include <cmath>

#include <pliant/kernels/contact_law.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/polygon.h>
#include <pliant/model/term.h>

namespace pliant {

/// A vertex j against the rest of its own outline:
///   U_j = Σ_i V(dist(j, closed edge i)) − Σ_k V(|r_j − r_k|)
/// over all edges i that do not end at j and all vertices k ≠ j, with V and its range r as in EdgeContact: δ for smooth
/// particles, δ/2 for rough particles. Along the outline, the distance from j grows at first. As long as the distance
/// grows, the nearest point of each edge is one of its ends, and edges and vertices cancel: neighbours do not touch,
/// for any edge length, and corners with an inner angle above 90° have no energy. Where the distance has another
/// minimum, the outline returns towards j: U_j is V of this minimum, minus V of the farthest vertex in between, if this
/// vertex is also within r. Therefore U is zero in every relaxed shape whose opposite sides are farther apart than r,
/// it is at least 0 for an outline that is wider than r, and with a barrier it is unbounded wherever an outline is
/// about to cross itself. U is C¹: a foot that slides from edge to edge passes a vertex, where both edges and the
/// vertex have the same V. With a C² law the second derivatives jump only where a foot reaches the end of an edge. The
/// gradient goes to the vertex and to both ends of the edge, so momentum is conserved. Elements: particles, so that
/// there is no list; a star-shaped and wide outline costs one pass over its vertices, any other outline a walk round
/// the outline for each vertex, which skips distant edges.
struct SelfContact {
  Real epsilon = 0;
  Edges edges = Edges::wide;
  bool on = true;
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::particles;
  static std::string_view name() { return "self_contact"; }
  void read(ParameterReader& p) {
    epsilon = p.number(contact_energy::deformable);
    if (edges == Edges::bare) epsilon /= 4;  // as EdgeContact
    on = p.flag({.name = "self_contact",
                 .help = "vertices of a polygon also touch the edges of the same polygon",
                 .role = Role::self_contact});
  }

  bool enabled(const StateView<2>&) const { return on; }

  Real energy(const StateView<2>& s, Index m) const {
    const Overlap v = overlap(s.topology, m);
    Real sum = 0;
    for_each_near(s, m, [&](Index p, Index a, Index b, bool last) {
      const Vec<2> r = s.position(p);
      sum += v.value(std::sqrt(segment_foot(r, s.position(a), s.position(b)).d2)) - v.value((r - s.position(a)).norm());
      if (last) sum -= v.value((r - s.position(b)).norm());
    });
    return sum;
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index m, G& grad) const {
    const Overlap v = overlap(s.topology, m);
    const auto subtract = [&](Index p, Index k) {
      const Vec<2> r = s.position(p) - s.position(k);
      const Real d = r.norm();
      if (!(d > 0 && v.touches(d))) return;
      const Vec<2> pull = v.slope(d) / d * r;
      grad.add(p, -pull);
      grad.add(k, pull);
    };
    for_each_near(s, m, [&](Index p, Index a, Index b, bool last) {
      const SegmentFoot foot = segment_foot(s.position(p), s.position(a), s.position(b));
      if (foot.d2 >= square(v.delta)) return;
      if (foot.t == 0 && !last) return;  // both parts cancel
      if (foot.d2 > 0) {
        const Real d = std::sqrt(foot.d2);
        const Vec<2> pull = v.slope(d) / d * foot.offset;
        grad.add(p, pull);
        grad.add(a, -(1 - foot.t) * pull);
        grad.add(b, -foot.t * pull);
      }
      subtract(p, a);
      if (last) subtract(p, b);
    });
  }

  void add_hessian(const StateView<2>& s, Index m, BlockSink<2>& h) const {
    const Overlap v = overlap(s.topology, m);
    const auto subtract = [&](Index p, Index k) {
      const Vec<2> r = s.position(p) - s.position(k);
      const Real d = r.norm();
      if (!v.touches(d)) return;
      const Vec<2> n = direction<2>(r, d);
      const Mat<2> block = v.curvature(d) * n * n.transpose() + v.slope(d) * distance_curvature<2>(n, d);
      h.add(p, p, -block);
      h.add(k, k, -block);
      h.add(p, k, block);
      h.add(k, p, block);
    };
    for_each_near(s, m, [&](Index p, Index a, Index b, bool last) {
      const SegmentDistance edge = segment_distance(s.position(p), s.position(a), s.position(b));
      if (!v.touches(edge.d)) return;
      const std::array<Index, 3> points{p, a, b};
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l)
          h.add(points[k], points[l],
                v.curvature(edge.d) * edge.gradient[k] * edge.gradient[l].transpose() +
                    v.slope(edge.d) * edge.hessian[k][l]);
      subtract(p, a);
      if (last) subtract(p, b);
    });
  }

  /// Two vertices that meet head on, which both directions count: ω² = 4 V''/m.
  Real max_rate(const Topology& topology) const {
    if (!on) return 0;
    return std::sqrt(4 * Overlap::stiffness(law) * epsilon / smallest_over_points(topology, [&](Index i) {
                       const Real delta = topology.diameter[i];
                       return square(vertex_edge_reach(edges, delta, delta)) * topology.mass(i);
                     }));
  }

 private:
  Overlap overlap(const Topology& topology, Index m) const {
    const Real delta = topology.diameter[topology.offset[m]];
    return {law, epsilon, vertex_edge_reach(edges, delta, delta)};
  }

  /// visit(p, a, b, last) for the vertices p and edges from a to b of particle m that do not share a point, at least
  /// for those within the range; last: the edge before the edge that ends at p.
  template <class Visit>
  void for_each_near(const StateView<2>& s, Index m, Visit&& visit) const {
    const Topology& topology = s.topology;
    const Real reach = overlap(topology, m).delta;
    // No vertex is nearer to an edge than the sum of their displacements before they meet.
    if (topology.active[m] == 0 || star_gap(s.x, topology, m) > reach) return;
    const Index first = topology.offset[m], n = topology.points_of(m);
    Real longest2 = 0;
    for (Index i = first; i < first + n; ++i)
      longest2 = std::max(longest2, (s.position(topology.next[i]) - s.position(i)).squaredNorm());
    const Real longest = std::sqrt(longest2);
    for (Index i = 0; i < n; ++i)
      for (Index k = 1; k <= n - 2;) {
        const Index p = first + i, a = first + (i + k < n ? i + k : i + k - n);
        // The edge that begins an arc length l farther on is at least `far` − l outside the range.
        const Real far = (s.position(p) - s.position(a)).norm() - longest - reach;
        if (far > 0) {
          k += 1 + static_cast<Index>(std::min(far / longest, static_cast<Real>(n)));
          continue;
        }
        visit(p, a, topology.next[a], k == n - 2);
        ++k;
      }
  }
};

}  // namespace pliant
