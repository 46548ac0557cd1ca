// Repulsion of droplets by walls [T 2.7].
#pragma once

#include <pliant/model/bubble_contact.h>
#include <pliant/model/droplet_walls.h>

namespace pliant {

/// U = f0 ⟨R⟩ (h/R − 1 − ln(h/R)) for h < R, h the distance of the centre from the wall, else 0: the force is
/// f0 ⟨R⟩ (1/h − 1/R) away from the wall. The force grows without bound as h → 0. C¹: U'' jumps from 0 to f0 ⟨R⟩/R² at
/// touch, and where the nearest point of a wedge reaches its tip.
struct WallRepulsionLaw {
  Real f0_mean_radius;  ///< f0 ⟨R⟩

  void read(ParameterReader& p) {
    f0_mean_radius = BubbleContactLaw::read_force(p) * p.number({.name = "R_mean",
                                                                 .symbol = "\\langle R\\rangle",
                                                                 .unit = dimension::length,
                                                                 .help = "mean radius of the droplets",
                                                                 .value = 1,
                                                                 .min_open = true,
                                                                 .role = Role::mean_radius});
  }

  static constexpr std::string_view name = "wall_repulsion";
  static Real range() { return 0; }
  template <int D>
  static Real least_distance(const std::optional<Solid<D>>&) {
    return 0;
  }
  template <int D>
  Expansion<D> at(const std::optional<Solid<D>>&, const WallFoot<D>& foot, const Vec<D>&, Real radius) const {
    const Real h = foot.d;
    if (h >= radius) return {};
    const Real x = (radius - h) / radius, slope = -f0_mean_radius * x / h;
    return {-f0_mean_radius * (x + std::log1p(-x)), slope * foot.n,
            f0_mean_radius / square(h) * foot.n * foot.n.transpose() + slope * foot.curvature};
  }
  /// ω² = f0 ⟨R⟩/(R² m) at touch.
  Real max_rate(const Topology& topology) const {
    return std::sqrt(4 * f0_mean_radius / smallest_over_points(topology, [&](Index i) {
                       return square(topology.diameter[i]) * topology.mass(i);
                     }));
  }
};

template <int D>
using WallRepulsion = DropletWalls<D, WallRepulsionLaw>;

}  // namespace pliant
