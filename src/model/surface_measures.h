// Lengths of a closed surface, and its inside.
#pragma once

#include <pliant/model/surface.h>

namespace pliant {

/// Rest lengths over lengths in the shape of the mesh.
Real stretch(const Surface& surface);

/// Largest distance of a place in a face from the nearest vertex of this face, where edges have their rest lengths.
Real widest_gap(const Surface& surface);

/// Whether a place is inside the surface of particle m, which must not cross itself. x [points · 3].
bool inside_surface(const Real* x, const Topology& topology, const Surface& surface, Index m, const Vec<3>& place);

}  // namespace pliant
