// Lengths of a closed surface, and its inside.
#pragma once

#include <pliant/model/surface.h>

namespace pliant {

/// Rest lengths over lengths in the shape of the mesh.
Real stretch(const Surface& surface);

/// Largest distance of a place in a face from the nearest vertex of this face, where edges have their rest lengths.
Real widest_gap(const Surface& surface);

/// Volume within the distance `width` outside the surface of particle m: S w + M w² + 4π w³/3 with the area S and the
/// integral M = Σ_e l_e φ_e/2 of the mean curvature, where φ_e is the angle between the normals of the faces at edge e,
/// negative where the edge is concave. Exact for convex surfaces (formula of Steiner). x [points · 3].
Real shell_volume(const Real* x, const Topology& topology, const Surface& surface, Index m, Real width);

/// Volume of the parts of spheres around the vertices of particle m that are outside the surface:
/// (Nv/2 + Σ_e φ_e/(2π)) π d³/6, from the sum of the solid angles at the vertices. A place in two spheres
/// counts twice. The spheres of two neighbouring vertices touch where their edge has the length d.
Real outer_spheres_volume(const Real* x, const Topology& topology, const Surface& surface, Index m, Real diameter);

/// Whether a place is inside the surface of particle m, which must not cross itself. x [points · 3].
bool inside_surface(const Real* x, const Topology& topology, const Surface& surface, Index m, const Vec<3>& place);

}  // namespace pliant
