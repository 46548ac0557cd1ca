// Distance from a figure of revolution: of one point, or of several in lanes.
#pragma once

#include <pliant/base/vector3.h>

namespace pliant {

/// A segment in the meridian plane (WallSegment).
template <class R>
struct MeridianSegment {
  R origin_rho, origin_z, direction_rho, direction_z, length;
};

/// The distance d of a point (ρ, z) from a segment, and its first and second derivatives: 0 where d is 0.
template <class R>
struct MeridianDistance {
  R d, n_rho, n_z;
  R rho_rho, rho_z, z_z;
  MaskOf<R> at_end;  ///< whether the nearest point is an end of the segment

  PLIANT_INLINE MeridianDistance(R rho, R z, const MeridianSegment<R>& wall) {
    const R x = rho - wall.origin_rho, y = z - wall.origin_z, none{};
    const R along = x * wall.direction_rho + y * wall.direction_z;
    at_end = (along <= 0) | (along >= wall.length);
    const R inside = along < 0 ? none : (wall.length < along ? wall.length : along);
    const R q_rho = x - inside * wall.direction_rho, q_z = y - inside * wall.direction_z;
    d = square_root(R(q_rho * q_rho + q_z * q_z));
    const R on_rho = q_rho / d, on_z = q_z / d;
    n_rho = d > 0 ? on_rho : none, n_z = d > 0 ? on_z : none;
    rho_rho = rho_z = z_z = none;
    const MaskOf<R> round = at_end & (d > 0);
    if (!any_of(round)) return;
    const R a = (1 - n_rho * n_rho) / d, b = (0 - n_rho * n_z) / d, c = (1 - n_z * n_z) / d;
    rho_rho = round ? a : none, rho_z = round ? b : none, z_z = round ? c : none;
  }
};

/// The symmetric matrix with the components a_ρρ, a_ρz and a_zz in the meridian plane of the direction (x, y) from the
/// axis, and a_φφ across it.
template <class R>
PLIANT_INLINE Matrix3<R> revolved(R x, R y, R a_rho, R a_rho_z, R a_z, R a_phi) {
  const R xy = a_rho * x * y - a_phi * y * x, xz = a_rho_z * x, yz = a_rho_z * y;
  return {{a_rho * x * x + a_phi * y * y, xy, xz}, {xy, a_rho * y * y + a_phi * x * x, yz}, {xz, yz, a_z}};
}

}  // namespace pliant
