// Stress of particles in a periodic box: momentum that points carry, and shares of the particles.
#pragma once

#include <span>
#include <vector>

#include <pliant/system/particle_system.h>

namespace pliant {

/// The upper triangle of a symmetric matrix: xx, xy, yy; in 3D xx, xy, xz, yy, yz, zz.
template <int D>
std::vector<Real> upper_triangle(const Mat<D>& m) {
  std::vector<Real> values;
  for (int a = 0; a < D; ++a)
    for (int b = a; b < D; ++b) values.push_back((m(a, b) + m(b, a)) / 2);
  return values;
}

/// Kinetic part of the stress of point i, times the volume: −m w ⊗ w, with the velocity w relative to the flow of the
/// box. Tension is positive.
template <int D>
Mat<D> momentum_flux(const StateView<D>& s, Index i) {
  const Vec<D> w = s.velocity(i) - s.flow.at(s.position(i));
  return -s.topology.mass(i) * w * w.transpose();
}

/// The derivative of the energy of interactions by the logarithm of the box length, if the centres of particles follow
/// the box and their shapes do not. At equilibrium the derivative is the trace of the virial. forces [particles · D]:
/// for each particle and each ghost, the sum of the forces on its points, computed with StateView::ghosts_feel. The
/// function needs a single rank, and costs less than the virials of the terms.
template <int D>
Real virial_of_centres(const StateView<D>& s, const Real* forces);

/// Share of each own particle of the stress [own particles], in units of energy per volume: the sum over all particles
/// of all ranks is the stress of the box, kinetic part included. An interaction of two particles belongs to either by
/// half. x, v [size of the system]. Errors: InputError for a box that is open in a direction, and for models without
/// virials.
template <int D>
std::vector<Mat<D>> particle_stress(ParticleSystem<D>& system, std::span<const Real> x, std::span<const Real> v,
                                    Real t);

}  // namespace pliant
