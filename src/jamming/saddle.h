// Saddle points of the energy, at which forces vanish as at minima.
#pragma once

#include <span>

#include <pliant/system/particle_system.h>

namespace pliant {

/// Where the Hessian at x [size of the system] has a negative eigenvalue: moves the particles along its mode, the one
/// with the lowest eigenvalue, by up to 0.01 of the diameter of the smallest point, and returns true. A minimisation
/// that starts from a symmetric configuration keeps its symmetry, and so ends at a saddle point if the symmetric
/// configuration is unstable; a minimisation from the changed x ends at another configuration. rattlers: ids of
/// particles that the Hessian leaves out. Errors: as of modes().
template <int D>
bool leave_saddle(ParticleSystem<D>& system, std::span<Real> x, std::span<const Index> rattlers);

}  // namespace pliant
