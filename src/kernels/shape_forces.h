// Forces of the shape energy of deformable particles (area, edges and corners) in one pass.
#pragma once

#include <pliant/base/types.h>
#include <pliant/kernels/prefetch.h>

namespace pliant {

/// Coefficients of the terms Area, Perimeter and Bending.
struct AreaLaw {
  Real k_a;
  bool relative_area = false;  ///< k_a/a0 instead of k_a
};
struct PerimeterLaw {
  Real k_l;
};
struct BendingLaw {
  Real k_b;
  bool full_edges = false;  ///< l_i/l0 instead of l̂_i
};

/// U_m = k_a/2 (a − a0)² + k_l n/2 Σ (l_i − l0)² + k_b/(2 n l0²) Σ |l̂_i − l̂_{i+1}|² of a polygon of n vertices. A
/// coefficient of zero switches its part off: nothing is computed for it.
struct ShapeLaw : AreaLaw, PerimeterLaw, BendingLaw {};

/// Adds the forces −∂U_m/∂r of particles first … last−1 to f. The points of particle m are offset[m] … offset[m+1]−1, a
/// closed polygon in that order; particles of fewer than three points have no shape and are skipped. offset
/// [particles + 1]; a0, l0 [particles]; x, f [points · 2]. A particle's forces do not depend on the other particles.
/// Of the arrays to prefetch, the points of these particles are fetched.
void add_shape_forces(const ShapeLaw& law, const Index* offset, const Real* a0, const Real* l0, Index first, Index last,
                      const Real* x, Real* f, const Prefetch& prefetch = {});

}  // namespace pliant
