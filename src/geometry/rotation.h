// Angles, spins and torques of particles: one number in the plane, three in space.
#pragma once

#include <Eigen/Geometry>
#include <type_traits>

#include <pliant/base/types.h>

namespace pliant {

/// Numbers in an angle, a spin or a torque.
template <int D>
inline constexpr int rotations = D == 2 ? 1 : 3;

/// An angle, a spin or a torque; counter-clockwise is positive in the plane.
template <int D>
using Rotation = std::conditional_t<D == 2, Real, Vec<3>>;

/// The i-th of an array [n · rotations].
template <int D>
Rotation<D> rotation(const Real* values, Index i) {
  if constexpr (D == 2)
    return values[i];
  else
    return point<3>(values, i);
}

template <int D>
void add_rotation(Real* values, Index i, const Rotation<D>& r) {
  if constexpr (D == 2)
    values[i] += r;
  else
    point<3>(values, i) += r;
}

/// Torque of the force f with the lever r: r × f.
inline Real torque(const Vec<2>& r, const Vec<2>& f) { return r[0] * f[1] - r[1] * f[0]; }
inline Vec<3> torque(const Vec<3>& r, const Vec<3>& f) { return r.cross(f); }

/// Velocity, about the centre, of a material point at r from there: ω × r.
inline Vec<2> spin_velocity(Real omega, const Vec<2>& r) { return {-omega * r[1], omega * r[0]}; }
inline Vec<3> spin_velocity(const Vec<3>& omega, const Vec<3>& r) { return omega.cross(r); }

}  // namespace pliant
