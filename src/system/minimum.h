// Whether motion without inertia has nothing left to do but to come to rest.
#pragma once

#include <pliant/system/particle_system.h>

namespace pliant {

/// Whether x [points · D] is next to a minimum of the energy: Newton's method leads from x to a place of rest that is
/// nearer than `reach` in every coordinate, and the Hessian is positive definite all the way. Motion that always lowers
/// the energy then ends there; at a saddle, where it may be as slow, the Hessian is not. Inactive particles do not
/// count. In a periodic box nothing is: all together can move along it. Dense matrices, for some hundred points, on one
/// rank.
template <int D>
bool next_to_minimum(ParticleSystem<D>& system, std::span<const Real> x, Real t, Real reach);

}  // namespace pliant
