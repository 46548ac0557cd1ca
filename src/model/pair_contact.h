// Contact between points of different particles: soft particles [H 2] and rough deformable particles [H 9].
#pragma once

#include <pliant/kernels/contact_law.h>
#include <pliant/kernels/pair_forces.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// The energy scales of contacts of soft particles, of deformable particles, and of frictional disks and spheres.
namespace contact_energy {
inline constexpr Parameter soft{.name = "e_sp",
                                .symbol = "E_{sp}",
                                .unit = dimension::energy,
                                .help = "contact energy E_sp of soft particles",
                                .value = 100,
                                .min_open = true,
                                .alias = "eps_sp",
                                .role = Role::contact_energy};
inline constexpr Parameter deformable{.name = "e_c",
                                      .symbol = "E_c",
                                      .unit = dimension::energy,
                                      .help = "contact energy E_c of deformable particles",
                                      .value = 1e4,
                                      .min_open = true,
                                      .alias = "eps_c",
                                      .role = Role::contact_energy};
inline constexpr Parameter disk{.name = "e_disk",
                                .symbol = "E_{disk}",
                                .unit = dimension::energy,
                                .help = "contact energy of frictional disks and spheres",
                                .value = 1e4,
                                .min_open = true,
                                .role = Role::contact_energy};
}  // namespace contact_energy

/// Vertices of rough particles can touch edges (3D: faces) without width, too. Such a contact is as stiff as a
/// contact of two vertices: ε/4 over half the distance.
inline void read_bare_contact(ParameterReader& p, Real& epsilon, bool& on) {
  epsilon = p.number(contact_energy::deformable) / 4;
  on = p.choice({.name = "rough_contact",
                 .help = "vertices touch vertices and edges (3D: faces), or vertices alone (literal) [H 9]",
                 .printed = "literal",
                 .role = Role::edge_contacts},
                named<bool>({{"edge", true}, {"literal", false}}));
}

/// U = Σ_pairs V(r), r the distance of the points and V of range δ_mn = (δ_m + δ_n)/2, the mean of the contact
/// diameters, by one of the laws in contact_law.h; harmonic: ε/2 (1 − r/δ_mn)² Θ(1 − r/δ_mn), with the force
/// ε/δ_mn (1 − r/δ_mn) r̂ on the first point. Elements: neighbour list of points.
template <int D>
struct PairContact {
  Real epsilon;
  std::string_view label;  ///< "pair" for soft particles, "contact" for vertices
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::point_pairs;
  std::string_view name() const { return label; }
  /// energy: one of contact_energy.
  void read(ParameterReader& p, const Parameter& energy) { epsilon = p.number(energy); }

  PairContactLaw kernel_law() const { return {epsilon, law}; }
  bool enabled(const StateView<D>&) const { return true; }

  Real energy(const StateView<D>& s, Index e) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    return overlap(s, i, j).value((s.position(i) - s.position(j)).norm());
  }

  template <class G>
  void add_gradient(const StateView<D>& s, Index e, G& grad) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Vec<D> r = s.position(i) - s.position(j);
    const Real d2 = r.squaredNorm();
    if (d2 >= square(range(s, i, j)) || d2 == 0) return;
    const Real d = std::sqrt(d2);
    const Vec<D> pull = overlap(s, i, j).slope(d) / d * r;
    grad.add(i, pull);
    grad.add(j, -pull);
  }

  void add_hessian(const StateView<D>& s, Index e, BlockSink<D>& h, PreStress pre_stress = PreStress::kept) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Vec<D> r = s.position(i) - s.position(j);
    const Real d = r.norm();
    const Overlap v = overlap(s, i, j);
    if (!v.touches(d)) return;
    const Vec<D> n = direction<D>(r, d);
    const Mat<D> block =
        v.curvature(d) * n * n.transpose() + slope_factor(pre_stress) * v.slope(d) * distance_curvature<D>(n, d);
    h.add(i, i, block);
    h.add(j, j, block);
    h.add(i, j, -block);
    h.add(j, i, -block);
  }

  bool contact(const StateView<D>& s, Index e, Contact<D>& c) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Vec<D> r = s.position(i) - s.position(j);
    const Real d = r.norm();
    const Overlap v = overlap(s, i, j);
    if (!v.touches(d)) return false;
    const Topology& topology = s.topology;
    c.first = topology.particle[i];
    c.second = topology.particle[j];
    c.normal = direction<D>(r, d);
    c.position = s.position(j) + topology.diameter[j] / (topology.diameter[i] + topology.diameter[j]) * r;
    c.overlap = 1 - d / v.delta;
    c.reach = v.delta;
    c.force = -v.slope(d) * c.normal;
    return true;
  }

  /// Two of the stiffest points against each other: ω² = 2 V''/m, with the harmonic law 2 ε/(δ² m).
  Real max_rate(const Topology& topology) const {
    return std::sqrt(2 * Overlap::stiffness(law) * epsilon / smallest_over_points(topology, [&](Index i) {
                       return Overlap::scale(law, topology.diameter[i]) * topology.mass(i);
                     }));
  }

 private:
  static Real range(const StateView<D>& s, Index i, Index j) {
    return (s.topology.diameter[i] + s.topology.diameter[j]) / 2;
  }
  Overlap overlap(const StateView<D>& s, Index i, Index j) const { return {law, epsilon, range(s, i, j)}; }
};

}  // namespace pliant
