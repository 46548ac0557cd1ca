// Contacts of particles with walls, for the output.
#pragma once

#include <vector>

#include <pliant/run/frame_data.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Contacts of this rank's particles with walls: {id of the particle, number of the wall}. A point, the centre of a
/// disk or a vertex, has one contact with each surface of the walls that acts on it; the contact belongs to the nearest
/// segment of the surface. `position` is the place on the wall, in a periodic box relative to the drawn particle. If
/// edges touch lips, a particle has one contact with a lip, at the nearest place of its outline. `force` is the force
/// on the particle, including friction and damping by the wall; `overlap` is 1 − 2d/δ, d the distance of the wall and δ
/// the contact diameter of the point: negative if the cutoff exceeds δ/2. The forces of a particle's contacts add up to
/// the total force of the walls on it.
///
/// Forces are found by the terms of the model itself, with all other elements taken off the neighbour lists, which are
/// as they were afterwards. Errors: as of the terms.
template <int D>
std::vector<ContactRecord<D>> find_wall_contacts(ParticleSystem<D>& system, const StateView<D>& view);

}  // namespace pliant
