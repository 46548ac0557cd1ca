// Particles in space that are closed surfaces of triangles: connectivity, rest shape, and measures of their shape.
#pragma once

#include <array>
#include <vector>

#include <pliant/geometry/mesh.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Connectivity and rest shape of particles. Particles of other rest volumes have the same shape: their rest lengths
/// are in proportion.
struct Surface {
  std::vector<Vec<3>> vertices;  ///< in the shape of the mesh, about their mean
  std::vector<Face> faces;
  std::vector<Hinge> hinges;
  Real volume = 0;                ///< rest volume
  Real sigma = 0;                 ///< diameter of the sphere of this volume
  std::vector<Real> rest_area;    ///< [faces]
  std::vector<Real> rest_length;  ///< [hinges]
  std::vector<Real> rest_angle;   ///< [hinges] from the normal of one face to the other, positive at convex edges

  /// The other face at an edge of a face.
  struct Across {
    Index face;
    Index vertex;  ///< the vertex of that face that does not belong to the edge
  };
  std::vector<std::array<Across, 3>> across;   ///< [faces] at the edge from each vertex of the face to the next one
  std::vector<std::array<Index, 2>> corners;   ///< [hinges] places, 0 to 2, of c and d in the faces left and right
  std::vector<std::array<Index, 3>> opposite;  ///< [faces] the hinge opposite to each vertex of the face
  std::vector<std::vector<Index>> around;      ///< [points] the other ends of the edges at each vertex
  std::vector<Index> lowest_face;              ///< [points] the lowest number of a face at each vertex

  Index points() const { return static_cast<Index>(vertices.size()); }
  Real total_rest_area() const;
  Real mean_rest_length() const;
};

/// Finds the neighbours of the faces and vertices of a surface with faces, vertices and hinges.
void connect_parts(Surface& surface);

/// Diameter of the sphere of this volume.
Real sphere_diameter(Real volume);

/// A surface that is at rest in the shape of the mesh. Errors: InputError as for check_mesh.
Surface relaxed_surface(const TriangleMesh& mesh);
/// The same with the rest areas and lengths of the shape parameter `shape`, and the same rest volume. Errors:
/// InputError also if the mesh has a larger shape parameter.
Surface surface_with_shape(const TriangleMesh& mesh, Real shape);

/// The surfaces of all particles: Topology::surfaces.
struct Surfaces {
  std::vector<Surface> kinds;
  std::vector<Index> kind;  ///< of each particle, by its id

  const Surface& of(const Topology& topology, Index m) const { return kinds[kind[topology.id[m]]]; }
  /// Length in particle m over length in its Surface.
  Real scale(const Topology& topology, Index m) const { return topology.sigma[m] / of(topology, m).sigma; }

  /// Appends a particle with the surface number `which` to the topology, with the given rest volume; delta is the
  /// diameter of a vertex or the width of edges and faces.
  void add_particle(Topology& topology, Index which, Real volume, Real delta, Real mass);
};

/// Signed volume of particle m, about its first vertex to keep digits far from the origin. x [points · 3].
Real surface_volume(const Real* x, const Topology& topology, const Surface& surface, Index m);

/// How near a particle is to shapes for which the shape energy has no meaning.
struct SurfaceShape {
  Real volume;          ///< not positive: inverted or flat
  Real least_area;      ///< least area of a face over its rest area
  Index smallest_face;  ///< its number in the particle
  Real least_cosine;    ///< least n̂·n̂' of the normals of two neighbouring faces: below −1/2 they fold over
  Index sharpest_hinge;
};
SurfaceShape look_at_surface(const Real* x, const Topology& topology, const Surfaces& surfaces, Index m);

/// Area of the surface of particle m.
Real surface_area(const Real* x, const Topology& topology, const Surface& surface, Index m);

}  // namespace pliant
