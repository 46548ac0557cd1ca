// Kinetic friction between smooth deformable particles in space [H 12].
#pragma once

#include <optional>

#include <pliant/model/friction.h>
#include <pliant/model/simplex_contact.h>

namespace pliant {

/// Where a vertex touches a face, or an edge an edge (VertexFace::touching, EdgeEdge::touching): the nearest places of
/// the two surfaces move with the velocities of their points, by the barycentric weights; with the relative velocity u
/// the force on the first place is −μ f u, the opposite one acts on the second place, and both are shared by the
/// weights. The factor f is m of the mollifier for two edges, and ½ for each direction where a vertex meets a vertex.
/// Dissipated power μ f |u|². Linear momentum is conserved. Tangential friction takes the part of u that is normal to
/// the line between the places. E: Elements::vertex_faces or Elements::edge_pairs.
template <Elements E>
struct SimplexFriction {
  static_assert(E == Elements::vertex_faces || E == Elements::edge_pairs);

  Real mu;
  Friction friction = Friction::whole;
  Real s0 = 0;  ///< s0 of the mollifier; 0: from the widths

  static constexpr Elements elements = E;
  static std::string_view name() { return of_edges ? "friction_edge" : "friction_vertex"; }
  void read(ParameterReader& p) {
    read_friction(p, mu, friction);
    if (of_edges) s0 = p.number(mollifier_s0);
  }
  bool enabled(const StateView<3>&) const { return !off(); }
  bool off() const { return !(mu > 0); }

  Real power(const StateView<3>& s, Index e) const {
    const auto pair = element(s, e);
    const auto touching = pair.touching(s);
    return touching ? mu * touching->factor * rubbed(s, pair.points, touching->places).squaredNorm() : 0;
  }

  template <class F>
  void add_force(const StateView<3>& s, Index e, F& force) const {
    const auto pair = element(s, e);
    const auto touching = pair.touching(s);
    if (!touching) return;
    const Vec<3> f = -mu * touching->factor * rubbed(s, pair.points, touching->places);
    for (int k = 0; k < 4; ++k) force.add(pair.points[k], Vec<3>(touching->places.weight[k] * f));
  }

  void add_dforce_dv(const StateView<3>& s, Index e, BlockSink<3>& h) const {
    const auto pair = element(s, e);
    const auto touching = pair.touching(s);
    if (!touching) return;
    const auto& weight = touching->places.weight;
    const Mat<3> block = -mu * touching->factor * rubbed_projector<3>(friction, touching->places.offset);
    for (int k = 0; k < 4; ++k)
      for (int l = 0; l < 4; ++l) h.add(pair.points[k], pair.points[l], weight[k] * weight[l] * block);
  }

  /// The places wander, which changes the weights, the normal turns, and the factor of two edges changes.
  void add_dforce_dx(const StateView<3>& s, Index e, BlockSink<3>& h) const {
    const auto pair = element(s, e);
    const auto touching = pair.touching(s);
    if (!touching) return;
    const NearestPlaces& places = touching->places;
    const PlaceMotion motion(pair.r, first, places);
    const Vec<3> slip = velocity(s, pair.points, places.weight), v = rubbed_part<3>(friction, slip, places.offset);
    const FourPoints by_factor = pair.factor_gradient();
    const Mat<3> turn = friction == Friction::tangential
                            ? rubbed_turn<3>(slip, direction<3>(places.offset, std::sqrt(places.d2)))
                            : Mat<3>(Mat<3>::Zero());
    for (int l = 0; l < 4; ++l) {
      Mat<3> by_normal = Mat<3>::Zero();  // derivative of the normal
      for (int k = 0; k < first; ++k) by_normal += motion.hessian(k, l);
      for (int k = 0; k < 4; ++k) {
        Mat<3> block = places.weight[k] * (v * by_factor[l].transpose() + touching->factor * turn * by_normal);
        for (int i = 0; i < motion.count(); ++i) {
          std::array<Real, 4> change;
          for (int j = 0; j < 4; ++j) change[j] = motion.weight(i, j);
          const Vec<3> dv = rubbed_part<3>(friction, velocity(s, pair.points, change), places.offset);
          block += touching->factor * (change[k] * v + places.weight[k] * dv) * motion.by_point(i, l).transpose();
        }
        h.add(pair.points[k], pair.points[l], -mu * block);
      }
    }
  }

  /// Two vertices against each other, half in each direction, or two edges that cross at their ends.
  Real max_damping(const Topology& topology) const {
    return 4 * mu / smallest_over_points(topology, [&](Index i) { return topology.mass(i); });
  }

 private:
  static constexpr bool of_edges = E == Elements::edge_pairs;
  static constexpr int first = of_edges ? 2 : 1;  ///< points of the first simplex

  auto element(const StateView<3>& s, Index e) const {
    if constexpr (of_edges)
      return EdgeEdge(s, e, s0);
    else
      return VertexFace(s, e);
  }
  static Vec<3> velocity(const StateView<3>& s, const std::array<Index, 4>& points, const std::array<Real, 4>& weight) {
    Vec<3> sum = Vec<3>::Zero();
    for (int k = 0; k < 4; ++k) sum += weight[k] * s.velocity(points[k]);
    return sum;
  }
  /// The part of the relative velocity of the places that friction opposes.
  Vec<3> rubbed(const StateView<3>& s, const std::array<Index, 4>& points, const NearestPlaces& places) const {
    return rubbed_part<3>(friction, velocity(s, points, places.weight), places.offset);
  }
};

}  // namespace pliant
