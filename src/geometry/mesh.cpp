#include <pliant/geometry/mesh.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include <pliant/base/errors.h>

namespace pliant {
namespace {

using DirectedEdge = std::pair<Index, Index>;

/// A face and the vertex at which it ends.
struct Side {
  Index face, end;
};

std::map<DirectedEdge, Side> sides_of(Index vertices, const std::vector<Face>& faces) {
  std::map<DirectedEdge, Side> sides;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const Index a = faces[f][k], b = faces[f][(k + 1) % 3], c = faces[f][(k + 2) % 3];
      if (a < 0 || a >= vertices)
        throw InputError("face {} has the vertex {}, but there are {} vertices, from 0; correct the face", f, a,
                         vertices);
      if (a == b) throw InputError("face {} has the vertex {} twice; give it three different vertices", f, a);
      const auto [other, is_new] = sides.insert({{a, b}, {static_cast<Index>(f), c}});
      if (!is_new)
        throw InputError(
            "faces {} and {} both run from vertex {} to vertex {}; list the vertices of all faces counter-clockwise, "
            "as "
            "seen from outside, and let two faces meet at each edge",
            other->second.face, f, a, b);
    }
  return sides;
}

/// The faces around each vertex must be a single fan: then the surface is one near the vertex.
void check_fans(Index vertices, const std::vector<Face>& faces, const std::map<DirectedEdge, Side>& sides) {
  std::vector<Index> faces_at(vertices, 0), start(vertices, -1);
  for (const Face& face : faces)
    for (int k = 0; k < 3; ++k) {
      ++faces_at[face[k]];
      start[face[k]] = face[(k + 1) % 3];
    }
  for (Index v = 0; v < vertices; ++v) {
    if (faces_at[v] == 0) throw InputError("vertex {} belongs to no face; remove it", v);
    Index count = 0, next = start[v];
    do {
      next = sides.at({v, next}).end;
      ++count;
    } while (next != start[v] && count <= faces_at[v]);
    if (count != faces_at[v])
      throw InputError("two parts of the surface meet at vertex {} only; give each part a separate vertex", v);
  }
}

Index count_parts(Index vertices, const std::vector<Face>& faces) {
  std::vector<Index> root(vertices);
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](Index v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const Face& face : faces)
    for (int k = 1; k < 3; ++k) root[find(face[k])] = find(face[0]);
  Index parts = 0;
  for (Index v = 0; v < vertices; ++v) parts += find(v) == v ? 1 : 0;
  return parts;
}

/// Each face divided into four, with the new vertices on the unit sphere.
TriangleMesh subdivided(const TriangleMesh& mesh) {
  TriangleMesh finer{mesh.vertices, {}};
  std::map<DirectedEdge, Index> middles;
  const auto middle = [&](Index a, Index b) {
    const auto [found, is_new] = middles.insert({std::minmax(a, b), static_cast<Index>(finer.vertices.size())});
    if (is_new) finer.vertices.push_back((mesh.vertices[a] + mesh.vertices[b]).normalized());
    return found->second;
  };
  for (const auto& [a, b, c] : mesh.faces) {
    const Index ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const Face& face : {Face{a, ab, ca}, Face{b, bc, ab}, Face{c, ca, bc}, Face{ab, bc, ca}})
      finer.faces.push_back(face);
  }
  return finer;
}

TriangleMesh icosahedron() {
  const Real g = (1 + std::sqrt(5.0)) / 2;
  TriangleMesh mesh{{{-1, g, 0},
                     {1, g, 0},
                     {-1, -g, 0},
                     {1, -g, 0},
                     {0, -1, g},
                     {0, 1, g},
                     {0, -1, -g},
                     {0, 1, -g},
                     {g, 0, -1},
                     {g, 0, 1},
                     {-g, 0, -1},
                     {-g, 0, 1}},
                    {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                     {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                     {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
  for (Vec<3>& r : mesh.vertices) r.normalize();
  return mesh;
}

}  // namespace

Vec<3> face_normal(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) { return (b - a).cross(c - a); }

std::vector<Hinge> closed_surface(Index vertices, const std::vector<Face>& faces) {
  if (faces.size() < 4) throw InputError("the surface has {} faces, but a closed one has at least 4", faces.size());
  const std::map<DirectedEdge, Side> sides = sides_of(vertices, faces);
  std::vector<Hinge> hinges;
  for (const auto& [edge, side] : sides) {
    const auto [a, b] = edge;
    const auto opposite = sides.find({b, a});
    if (opposite == sides.end())
      throw InputError("the surface is open: only face {} has the edge from vertex {} to vertex {}; close the surface",
                       side.face, a, b);
    if (a < b) hinges.push_back({a, b, side.end, opposite->second.end, side.face, opposite->second.face});
  }
  check_fans(vertices, faces, sides);
  if (const Index parts = count_parts(vertices, faces); parts != 1)
    throw InputError("the surface consists of {} separate parts; a particle has one surface", parts);
  const Index euler = vertices - static_cast<Index>(hinges.size()) + static_cast<Index>(faces.size());
  if (euler != 2)
    throw InputError("the surface has the Euler number {}, so {} hole(s) lead through it; its Euler number must be 2",
                     euler, (2 - euler) / 2);
  return hinges;
}

Real volume(const TriangleMesh& mesh) {
  const Vec<3> o = mesh.vertices.front();
  Real sixfold = 0;
  for (const auto& [a, b, c] : mesh.faces)
    sixfold += (mesh.vertices[a] - o).dot((mesh.vertices[b] - o).cross(mesh.vertices[c] - o));
  return sixfold / 6;
}

Real surface_area(const TriangleMesh& mesh) {
  Real twice = 0;
  for (const auto& [a, b, c] : mesh.faces)
    twice += face_normal(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]).norm();
  return twice / 2;
}

Real shape_parameter(Real area, Real volume) { return area * std::sqrt(area) / (6 * std::sqrt(pi) * volume); }

std::vector<Hinge> check_mesh(const TriangleMesh& mesh) {
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite())
      throw InputError("vertex {} has a coordinate that is not finite; give it finite coordinates", v);
  std::vector<Hinge> hinges = closed_surface(static_cast<Index>(mesh.vertices.size()), mesh.faces);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    if (!(face_normal(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]).norm() > 0))
      throw InputError("face {} has no area; move one of its vertices {}, {} and {}", f, a, b, c);
  }
  if (const Real v = volume(mesh); !(v > 0))
    throw InputError(
        "the surface has the signed volume {}; list the vertices of each face counter-clockwise, as seen "
        "from outside",
        v);
  return hinges;
}

TriangleMesh icosphere(Index vertices) {
  TriangleMesh mesh = icosahedron();
  for (int level = 0; level < 3 && static_cast<Index>(mesh.vertices.size()) < vertices; ++level)
    mesh = subdivided(mesh);
  if (static_cast<Index>(mesh.vertices.size()) != vertices)
    throw InputError("there is no icosphere of {} vertices; choose 12, 42, 162 or 642", vertices);
  const Real radius = std::cbrt(pi / 6 / volume(mesh));
  for (Vec<3>& r : mesh.vertices) r *= radius;
  return mesh;
}

}  // namespace pliant
