// Closed surfaces of triangles: their topology, checks, and icospheres.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Numbers of the three vertices, counter-clockwise as seen from outside.
using Face = std::array<Index, 3>;

/// Vertices and faces of a surface.
struct TriangleMesh {
  std::vector<Vec<3>> vertices;
  std::vector<Face> faces;
};

/// An edge with the two faces that meet there: the face `left` runs along the edge from vertex a to b and ends at the
/// vertex c, the face `right` runs from b to a and ends at d.
struct Hinge {
  Index a, b, c, d;
  Index left, right;
  bool operator==(const Hinge&) const = default;
};

/// The hinges of a closed surface of `vertices` vertices, which are its edges: a < b, in ascending order of (a, b).
/// Errors: InputError that names a face, an edge or a vertex, unless the faces form one closed, oriented surface
/// without holes through it (Euler number 2), and all vertices belong to it.
std::vector<Hinge> closed_surface(Index vertices, const std::vector<Face>& faces);

/// Twice the area of a face as a vector that points outwards.
Vec<3> face_normal(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

Real volume(const TriangleMesh& mesh);
Real surface_area(const TriangleMesh& mesh);

/// 𝒜 = S^(3/2)/(6 √π V) of a surface of area S and volume V: 1 for a sphere, else larger.
Real shape_parameter(Real area, Real volume);

/// The hinges of a mesh. Errors: InputError as for closed_surface; also for vertices that are not finite, a face
/// without area, or a volume that is not positive because the faces are listed clockwise.
std::vector<Hinge> check_mesh(const TriangleMesh& mesh);

/// An icosahedron of 12 vertices or, subdivided once, twice or three times, a surface of 42, 162 or 642 vertices, which
/// lie on a sphere about the origin. Its volume is pi/6, the volume of a sphere of diameter 1. Errors: InputError for
/// other numbers of vertices.
TriangleMesh icosphere(Index vertices);

/// Reads a surface from an OFF or OBJ file, according to the end of its name. Of OBJ files vertices (v) and faces (f)
/// are read; names, normals, textures and materials are ignored. Errors: InputError with the file and the line for a
/// file of another format, a face that is not a triangle or names a vertex that does not exist; and as for check_mesh.
TriangleMesh read_mesh(const std::string& file);

}  // namespace pliant
