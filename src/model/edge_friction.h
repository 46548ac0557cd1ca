// Kinetic friction between smooth deformable particles [H 12].
#pragma once

#include <optional>

#include <pliant/kernels/edge_forces.h>
#include <pliant/model/friction.h>
#include <pliant/model/outline.h>

namespace pliant {

/// Where the velocity of the touched edge is taken.
enum class FrictionPoint {
  contact,  ///< the material point of the contact, (1 − t) v_i + t v_{i+1}
  vertex    ///< the edge's first vertex, as [H 12] prints it
};

/// A vertex j on edge i of another polygon.
/// contact: F = −μ (v_j − v_c) with the material point of the edge that carries the contact (outline.h: a corner counts
/// once), the reaction on both ends of the edge with weights 1 − t and t: power μ |v_j − v_c|², linear momentum
/// conserved. vertex: −μ (v_j − v_i) for every closed edge i within the contact distance, the reaction on vertex i.
/// Tangential friction takes the part of these velocities that is normal to the line from the foot on the edge to j.
/// Elements: neighbour list of vertices and edges.
struct EdgeFriction {
  Real mu;
  FrictionPoint where = FrictionPoint::contact;
  Friction friction = Friction::whole;

  static constexpr Elements elements = Elements::vertex_edges;
  static std::string_view name() { return "friction"; }
  void read(ParameterReader& p) {
    read_friction(p, mu, friction);
    where = p.choice({.name = "friction_point",
                      .help = "smooth: friction acts at the contact, or at the first vertex of the edge [H 12]",
                      .printed = "vertex"},
                     named<FrictionPoint>({{"contact", FrictionPoint::contact}, {"vertex", FrictionPoint::vertex}}));
  }

  EdgeFrictionLaw kernel_law() const { return {mu, where == FrictionPoint::contact, friction == Friction::tangential}; }
  bool enabled(const StateView<2>&) const { return !off(); }
  bool off() const { return !(mu > 0); }

  Real power(const StateView<2>& s, Index e) const {
    const std::optional<Rubbing> r = rubbing(s, e);
    return r ? mu * rubbed(s, *r).squaredNorm() : 0;
  }

  template <class F>
  void add_force(const StateView<2>& s, Index e, F& force) const {
    const std::optional<Rubbing> r = rubbing(s, e);
    if (!r) return;
    const Vec<2> f = -mu * rubbed(s, *r);
    force.add(r->vertex, f);
    force.add(r->start, -(1 - r->t) * f);
    force.add(r->end, -r->t * f);
  }

  void add_dforce_dv(const StateView<2>& s, Index e, BlockSink<2>& h) const {
    const std::optional<Rubbing> r = rubbing(s, e);
    if (!r) return;
    const std::array<Index, 3> points{r->vertex, r->start, r->end};
    const std::array<Real, 3> weight{1, -(1 - r->t), -r->t};
    const Mat<2> projector = rubbed_projector<2>(friction, r->offset);
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) h.add(points[k], points[l], -mu * weight[k] * weight[l] * projector);
  }

  /// The contact wanders along its edge, which changes the weights, and its normal turns.
  void add_dforce_dx(const StateView<2>& s, Index e, BlockSink<2>& h) const {
    const std::optional<Rubbing> r = rubbing(s, e);
    if (!r) return;
    if (friction == Friction::tangential) add_turn(s, *r, h);
    if (r->t <= 0 || r->t >= 1) return;
    const Vec<2> a = s.position(r->start), u = s.position(r->end) - a, w = s.position(r->vertex) - a;
    const Vec<2> offset = w - r->t * u, v = rubbed(s, *r),
                 dv_dt = rubbed_part<2>(friction, s.velocity(r->start) - s.velocity(r->end), offset);
    const std::array<Index, 3> points{r->vertex, r->start, r->end};
    const std::array<Real, 3> weight{1, -(1 - r->t), -r->t}, dw_dt{0, 1, -1};
    const std::array<Vec<2>, 3> dt{u, -(1 - r->t) * u - offset, offset - r->t * u};  // times |u|²
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l)
        h.add(points[k], points[l], -mu / u.squaredNorm() * (dw_dt[k] * v + weight[k] * dv_dt) * dt[l].transpose());
  }

  Real max_damping(const Topology& topology) const {
    return 4 * mu / smallest_over_points(topology, [&](Index i) { return topology.mass(i); });
  }

 private:
  /// Friction of a vertex with the point at t on an edge.
  struct Rubbing {
    Index vertex, start, end;
    Real t;
    Vec<2> offset;  ///< offset of the vertex from the edge
  };

  static Vec<2> slip(const StateView<2>& s, const Rubbing& r) {
    return s.velocity(r.vertex) - (1 - r.t) * s.velocity(r.start) - r.t * s.velocity(r.end);
  }

  /// The part of the relative velocity that friction opposes.
  Vec<2> rubbed(const StateView<2>& s, const Rubbing& r) const {
    return rubbed_part<2>(friction, slip(s, r), r.offset);
  }

  void add_turn(const StateView<2>& s, const Rubbing& r, BlockSink<2>& h) const {
    const SegmentDistance edge = segment_distance(s.position(r.vertex), s.position(r.start), s.position(r.end));
    const Mat<2> turn = rubbed_turn<2>(slip(s, r), edge.gradient[0]);
    const std::array<Index, 3> points{r.vertex, r.start, r.end};
    const std::array<Real, 3> weight{1, -(1 - r.t), -r.t};
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) h.add(points[k], points[l], -mu * weight[k] * turn * edge.hessian[0][l]);
  }

  std::optional<Rubbing> rubbing(const StateView<2>& s, Index e) const {
    const auto [p, a] = s.neighbours.vertex_edges[e];
    const Index b = s.topology.next[a];
    const Real reach = (s.topology.diameter[p] + s.topology.diameter[a]) / 2;
    const SegmentFoot foot = segment_foot(s.position(p), s.position(a), s.position(b));
    if (foot.d2 >= square(reach)) return std::nullopt;
    if (where == FrictionPoint::vertex) return Rubbing{p, a, b, 0, foot.offset};
    if (!carries_contact(s, p, a, foot)) return std::nullopt;
    return Rubbing{p, a, b, foot.t, foot.offset};
  }
};

}  // namespace pliant
