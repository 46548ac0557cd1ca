// The models of deformable particles in space, which are closed surfaces of triangles. Runs do not offer them yet.
#pragma once

#include <memory>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/surface.h>

namespace pliant {

/// The model of these surfaces: ModelKind::shape (energies of the shape) or ModelKind::rough (each vertex also carries
/// a sphere that touches the vertices of other particles). `surfaces` may be null where only the parameters are listed.
/// shape_terms = false: without the energies of the shape. Errors: InputError for other kinds.
ModelDefinition surface_model(ModelKind kind, std::shared_ptr<const Surfaces> surfaces = nullptr,
                              bool shape_terms = true);

}  // namespace pliant
