#include <pliant/model/surface_arrays.h>

#include <cmath>
#include <utility>

#include <pliant/base/errors.h>

namespace pliant {

SurfaceArrays::SurfaceArrays(const Surfaces& all) : kind(all.kind) {
  for (const Surface& s : all.kinds) {
    vertices_of_kind.push_back(s.points());
    volume.push_back(s.volume);
    for (const Vec<3>& r : s.vertices) vertices.insert(vertices.end(), r.begin(), r.end());
    for (const Face& face : s.faces) faces.insert(faces.end(), face.begin(), face.end());
    rest_area.insert(rest_area.end(), s.rest_area.begin(), s.rest_area.end());
    rest_length.insert(rest_length.end(), s.rest_length.begin(), s.rest_length.end());
    rest_angle.insert(rest_angle.end(), s.rest_angle.begin(), s.rest_angle.end());
  }
}

std::vector<Surface> SurfaceArrays::kinds() const {
  std::size_t points = 0, triangles = 0, edges = 0;
  for (const Index n : vertices_of_kind) {
    if (n < 4) throw InputError("a surface has {} vertices, but must have at least 4", n);
    points += static_cast<std::size_t>(n), triangles += static_cast<std::size_t>(2 * n - 4);
    edges += static_cast<std::size_t>(3 * n - 6);
  }
  if (vertices.size() != 3 * points || faces.size() != 3 * triangles || volume.size() != vertices_of_kind.size() ||
      rest_area.size() != triangles || rest_length.size() != edges || rest_angle.size() != edges)
    throw InputError("the numbers of vertices, faces and edges of surfaces do not fit each other");
  for (const Index k : kind)
    if (k < 0 || k >= static_cast<Index>(vertices_of_kind.size())) throw InputError("there is no surface {}", k);
  for (const auto* sizes : {&volume, &rest_area, &rest_length})
    for (const Real size : *sizes)
      if (!(size > 0 && std::isfinite(size))) throw InputError("a rest size of a surface is {}", size);
  std::vector<Surface> all;
  std::size_t point = 0, triangle = 0, edge = 0;
  const auto take = [](const std::vector<Real>& from, std::size_t first, std::size_t count) {
    return std::vector<Real>(from.begin() + static_cast<std::ptrdiff_t>(first),
                             from.begin() + static_cast<std::ptrdiff_t>(first + count));
  };
  for (std::size_t k = 0; k < vertices_of_kind.size(); ++k) {
    Surface s;
    const auto count = static_cast<std::size_t>(vertices_of_kind[k]);
    for (std::size_t i = 3 * point; i < 3 * (point + count); i += 3)
      s.vertices.emplace_back(vertices[i], vertices[i + 1], vertices[i + 2]);
    for (std::size_t f = 3 * triangle; f < 3 * (triangle + 2 * count - 4); f += 3)
      s.faces.push_back({faces[f], faces[f + 1], faces[f + 2]});
    s.hinges = closed_surface(vertices_of_kind[k], s.faces);
    s.volume = volume[k];
    s.sigma = sphere_diameter(s.volume);
    s.rest_area = take(rest_area, triangle, s.faces.size());
    s.rest_length = take(rest_length, edge, s.hinges.size());
    s.rest_angle = take(rest_angle, edge, s.hinges.size());
    connect_parts(s);
    point += count, triangle += s.faces.size(), edge += s.hinges.size();
    all.push_back(std::move(s));
  }
  return all;
}

}  // namespace pliant
