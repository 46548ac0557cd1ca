// Forces of the shape energy of closed surfaces (volume, faces and edges) in one pass.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <pliant/base/types.h>
#include <pliant/geometry/mesh.h>

namespace pliant {

/// Coefficients of the terms Volume, FaceArea, SurfaceTension, EdgeLength and HingeBending. A coefficient of zero
/// switches its term off.
struct SurfaceLaw {
  Real k_v = 0, k_a = 0, gamma = 0, k_l = 0, k_b = 0;
  bool rest_angles = false;  ///< whether hinges have rest angles; otherwise flat hinges have no bending energy
};

/// Connectivity and rest shape of particles.
struct SurfaceMesh {
  Index points;
  std::span<const Face> faces;
  std::span<const Hinge> hinges;
  std::span<const std::array<Index, 2>> corners;   ///< Surface::corners
  std::span<const std::array<Index, 3>> opposite;  ///< Surface::opposite
  const Real* rest_area;                           ///< [faces]
  const Real* rest_length;                         ///< [hinges]
  const Real* rest_angle;                          ///< [hinges]
};

/// A few particles with the same mesh.
struct SurfaceBatch {
  static constexpr int most = 4;
  int count;                      ///< 1 to `most`
  std::array<Index, most> first;  ///< point of each particle
  std::array<Real, most> scale;   ///< length in the particle over length in the mesh
  std::array<Real, most> volume;  ///< rest volume
};

/// Forces of the shape of all particles with the same mesh.
struct SurfaceForces {
  /// The arrays of `shape` live as long as this.
  SurfaceForces(const SurfaceLaw& coefficients, const SurfaceMesh& shape);
  /// Adds the forces −∂U/∂r of these particles to f. x, f [points · 3]. A particle's forces do not depend on the other
  /// particles of the batch.
  void add(const SurfaceBatch& batch, const Real* x, Real* f) const;

  const SurfaceLaw law;
  const SurfaceMesh mesh;
  /// Direction of a hinge at rest.
  struct Turn {
    Real cosine, sine;
  };
  std::vector<Real> half_inverse_area;  ///< [faces] 1/(2 · rest area)
  std::vector<Turn> rest;               ///< [hinges] if hinges have rest angles
};

}  // namespace pliant
