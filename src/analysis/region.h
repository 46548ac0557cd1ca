// Number density and packing fraction in a part of the hopper.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <span>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// A part of space: `contains(p)` and its area or volume `measure()`.
template <class R, int D>
concept Region = requires(const R region, const Vec<D> p) {
  { region.contains(p) } -> std::convertible_to<bool>;
  { region.measure() } -> std::convertible_to<Real>;
};

/// lower ≤ p < upper in each coordinate: neighbouring boxes share no point.
template <int D>
struct BoxRegion {
  Vec<D> lower, upper;

  bool contains(const Vec<D>& p) const {
    return (p.array() >= lower.array()).all() && (p.array() < upper.array()).all();
  }
  Real measure() const { return (upper - lower).prod(); }
};

/// Round the z axis: distance < radius, bottom ≤ z < top.
struct CylinderRegion {
  Real radius, bottom, top;

  bool contains(const Vec<3>& p) const {
    return p.z() >= bottom && p.z() < top && p.head<2>().squaredNorm() < square(radius);
  }
  Real measure() const { return pi * square(radius) * (top - bottom); }
};

/// The region above the orifice in which [H App. B] measures the density: 2w wide and w high; in 3D a cylinder of
/// diameter 2w and height w. w: width (diameter) of the orifice.
template <int D>
auto orifice_region(Real w) {
  if (!(w > 0)) throw InputError("orifice region: the orifice is {} wide; it must be positive", w);
  if constexpr (D == 2) {
    return BoxRegion<2>{{-w, 0}, {w, w}};
  } else {
    static_assert(D == 3);
    return CylinderRegion{w, 0, w};
  }
}

/// Sum of `value(m)` over the active particles m whose centre lies in the region, per area (volume).
/// centres [D · N] interleaved, active [N]. Throws InputError if the lengths do not agree.
template <int D, Region<D> R, std::invocable<Index> F>
Real region_density(const R& region, std::span<const Real> centres, std::span<const std::uint8_t> active, F value) {
  if (centres.size() != D * active.size())
    throw InputError("density in a region: {} coordinates for {} particles in {} dimensions", centres.size(),
                     active.size(), D);
  Real sum = 0;
  for (Index m = 0; m < static_cast<Index>(active.size()); ++m)
    if (active[m] != 0 && region.contains(point<D>(centres.data(), m))) sum += value(m);
  return sum / region.measure();
}

/// Number density ρ_n, σ_avg^-D; its inverse is a_eff of [H App. B].
template <int D, Region<D> R>
Real number_density(const R& region, std::span<const Real> centres, std::span<const std::uint8_t> active) {
  return region_density<D>(region, centres, active, [](Index) { return Real{1}; });
}

/// Packing fraction Σ a0/measure of the particles with their centre in the region: overlaps count twice, and a particle
/// cut by the boundary counts wholly or not at all. a0 [N]: areas (volumes).
template <int D, Region<D> R>
Real packing_fraction(const R& region, std::span<const Real> centres, std::span<const Real> a0,
                      std::span<const std::uint8_t> active) {
  if (a0.size() != active.size())
    throw InputError("packing fraction: {} areas for {} particles; give one per particle", a0.size(), active.size());
  return region_density<D>(region, centres, active, [a0](Index m) { return a0[m]; });
}

}  // namespace pliant
