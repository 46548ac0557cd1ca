// Contacts of particles with walls, for the output.
#pragma once

#include <vector>

#include <pliant/run/frame_data.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// Contacts of this rank's particles with walls: {id of the particle, number of the wall}. A point, the centre of a
/// disk or a vertex, has one contact with each surface of the walls that acts on it, and that surface's nearest segment
/// has it. `position` is where the wall is touched, in a periodic box as seen from where the particle is drawn. Where
/// edges feel a lip, a particle has one contact with it, at the nearest place of its outline. `force` is that on the
/// particle, friction and damping by the wall included; `overlap` is 1 − 2d/δ, d the distance of the wall and δ the
/// contact diameter of the point: negative where a force reaches beyond δ/2. The forces of a particle's contacts add up
/// to all that walls do to it.
///
/// Forces are found by the terms of the model itself, with all other elements taken off the neighbour lists, which are
/// as they were afterwards. Errors: as of the terms.
template <int D>
std::vector<ContactRecord<D>> find_wall_contacts(ParticleSystem<D>& system, const StateView<D>& view);

}  // namespace pliant
