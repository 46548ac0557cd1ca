// Whether particles at rest block the orifice, or lie next to it.
#pragma once

#include <pliant/geometry/container.h>
#include <pliant/model/state.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Whether an arch of touching particles stands over the orifice. In 2D an arch is a chain of contacts from the left to
/// the right wall, also through obstacles. In 3D an arch is a chain of contacts from a particle over the middle of the
/// orifice to the wall: centres of a dome leave no gap there that is wider than the largest particle. Heaps on both
/// sides of a flat bottom, or on an obstacle, do not form an arch. The same on all ranks. Collective.
template <int D>
bool arch_over_orifice(ParticleSystem<D>& system, const State& state, const Container& container);

}  // namespace pliant
