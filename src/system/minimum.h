// Whether motion without inertia can only relax into a nearby minimum.
#pragma once

#include <pliant/system/particle_system.h>

namespace pliant {

/// Whether x [points · D] is next to a minimum of the energy: Newton's method leads from x to a stationary point that
/// is nearer than `reach` in every coordinate, and the Hessian is positive definite along the whole path. Motion that
/// always lowers the energy then ends there; near a saddle, where motion may be as slow, the Hessian is not positive
/// definite. Inactive particles do not count. False in a periodic box, where all particles can translate together.
/// Dense matrices, for some hundred points, on one rank.
template <int D>
bool next_to_minimum(ParticleSystem<D>& system, std::span<const Real> x, Real t, Real reach);

}  // namespace pliant
