// Depletion attraction of droplets to solid walls and to their tips [T 2.8].
#pragma once

#include <pliant/model/depletion.h>
#include <pliant/model/droplet_walls.h>

namespace pliant {

/// U = −φ_c/(8 a_s³) V, V the volume that a sphere of radius R + a_s shares with all that is within a_s of the solid.
/// At a plane V = π c² (3(R + a_s) − c)/3 with c = R + 2 a_s − h, h < R + 2 a_s, which is the printed force (π
/// φ_c/8a_s³)(R + 2a_s − h)(R + h) towards the wall. At the tip of a wedge the same volume is smaller, and the force,
/// its gradient, points to the solid (geometry/overlap.cpp). C¹ at the end of the range.
struct WallDepletionLaw {
  Real phi_c;
  Real a_s;  ///< radius of the depletant

  void read(ParameterReader& p) {
    DepletionLaw pairs{};
    pairs.read(p);
    phi_c = pairs.phi_c, a_s = pairs.a_s;
  }

  static constexpr std::string_view name = "wall_depletion";
  Real range() const { return 2 * a_s; }
  /// At a wedge the centre must be outside the layer.
  template <int D>
  Real least_distance(const std::optional<Solid<D>>& solid) const {
    return solid && !solid->flat() ? a_s : 0;
  }
  template <int D>
  Expansion<D> at(const std::optional<Solid<D>>& solid, const WallFoot<D>& foot, const Vec<D>& r, Real radius) const {
    if (!solid || foot.d >= radius + 2 * a_s) return {};
    const Real strength = phi_c / (8 * a_s * square(a_s));
    const Expansion<D> v = layer_overlap<D>(*solid, r, radius + a_s, a_s);
    return {-strength * v.value, -strength * v.gradient, -strength * v.hessian};
  }
  /// Segments have no volume behind them. Errors: InputError for walls that are not solids, unless the attraction is
  /// switched off.
  template <int D>
  void check(const Walls<D>& walls) const {
    if (phi_c != 0 && !walls.segments().empty())
      throw InputError(
          "wall {} is a segment, which droplets cannot be attracted to: depletion needs the volume behind a wall; make "
          "walls half-spaces or wedges, or set phi_c = 0",
          walls.wall_of_part(0));
  }
  /// 0, because the attraction softens the repulsion.
  static Real max_rate(const Topology&) { return 0; }
};

template <int D>
using WallDepletion = DropletWalls<D, WallDepletionLaw>;

}  // namespace pliant
