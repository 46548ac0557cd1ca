// Repulsion of droplets that overlap: Durian's bubble model [T 2.1].
#pragma once

#include <pliant/model/droplet_pairs.h>

namespace pliant {

/// U = f0 (s − r)²/(2s) for r < s = R_i + R_j, else 0: the energy of the printed force f0 (1/r − 1/s) r_ij, whose size
/// is f0 (1 − r/s). C¹: U'' jumps from 0 to f0/s at touch. f0 is a force.
struct BubbleContactLaw {
  Real f0;

  static Real read_force(ParameterReader& p) {
    return p.number({.name = "f0",
                     .symbol = "f_0",
                     .unit = dimension::force,
                     .help = "contact force f0",
                     .value = 10,
                     .min_open = true,
                     .role = Role::contact_force});
  }
  void read(ParameterReader& p) { f0 = read_force(p); }

  static constexpr std::string_view name = "contact";
  static Real range() { return 0; }
  Radial at(Real r, Real a, Real b) const {
    const Real s = a + b, overlap = s - r;
    if (overlap <= 0) return {};
    return {f0 * square(overlap) / (2 * s), -f0 * overlap / s, f0 / s};
  }
  /// Two of the stiffest droplets against each other: ω² = 2 f0/(δ m).
  Real max_rate(const Topology& topology) const {
    return std::sqrt(2 * f0 /
                     smallest_over_points(topology, [&](Index i) { return topology.diameter[i] * topology.mass(i); }));
  }
};

template <int D>
using BubbleContact = DropletPairs<D, BubbleContactLaw>;

}  // namespace pliant
