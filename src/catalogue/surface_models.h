// The models of deformable particles in space, which are closed surfaces of triangles (Topology::surfaces).
#pragma once

#include <memory>

#include <pliant/catalogue/catalogue.h>

namespace pliant {

/// Energies of the shape alone.
std::unique_ptr<ForceField<3>> surfaces_without_contacts(ParameterReader& p, const Surroundings<3>& s);

/// Each vertex is also the centre of a sphere that touches vertices of other particles and walls.
std::unique_ptr<ForceField<3>> rough_surfaces(ParameterReader& p, const Surroundings<3>& s);

/// Vertices, edges and faces of a particle touch vertices, edges and faces of other particles. Vertices touch walls.
std::unique_ptr<ForceField<3>> smooth_surfaces(ParameterReader& p, const Surroundings<3>& s);

}  // namespace pliant
