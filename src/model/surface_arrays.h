// Closed surfaces as arrays, for files.
#pragma once

#include <string>
#include <vector>

#include <pliant/model/surface.h>

namespace pliant {

/// Surfaces as arrays, for files: the kinds one after another, and the kind of each particle.
struct SurfaceArrays {
  std::vector<Index> kind;              ///< [particles]
  std::vector<Index> vertices_of_kind;  ///< [kinds] their number, from which the numbers of faces and edges follow
  std::vector<Real> vertices;           ///< [3 · Σ vertices] in the shape of the mesh
  std::vector<Index> faces;             ///< [3 · Σ faces] numbers of vertices in the kind
  std::vector<Real> volume;             ///< [kinds] rest volume
  std::vector<Real> rest_area;          ///< [Σ faces]
  std::vector<Real> rest_length, rest_angle;  ///< [Σ edges] edges in the order of closed_surface

  SurfaceArrays() = default;
  explicit SurfaceArrays(const Surfaces& all);
  /// visit(name, array, numbers per row)
  template <class Self, class Visit>
  static void for_each(Self& self, Visit&& visit) {
    visit("kind", self.kind, 1);
    visit("vertices_of_kind", self.vertices_of_kind, 1);
    visit("vertices", self.vertices, 3);
    visit("faces", self.faces, 3);
    visit("volume", self.volume, 1);
    visit("rest_area", self.rest_area, 1);
    visit("rest_length", self.rest_length, 1);
    visit("rest_angle", self.rest_angle, 1);
  }
  /// The kinds. Errors: InputError for arrays that do not describe closed surfaces.
  std::vector<Surface> kinds() const;
};

}  // namespace pliant
