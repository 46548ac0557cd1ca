// Assigns the kernel of closed surfaces to the terms of their shape.
#pragma once

#include <pliant/base/multiversion.h>
#include <pliant/kernels/surface_forces.h>
#include <pliant/model/surface_terms.h>

namespace pliant {

struct SurfaceKernel {
  static bool fast() { return simd::fast(); }
  static void add_forces(const StateView<3>& s, Index chunk, Real* f, const Volume& volume, const FaceArea& area,
                         const EdgeLength& edge, const HingeBending& bending, const SurfaceTension& tension) {
    const Topology& topology = s.topology;
    if (!topology.surfaces) return;
    const SurfaceLaw law{volume.k_v, area.k_a, tension.gamma, edge.k_l, bending.k_b, bending.with_rest};
    const Surfaces& all = *topology.surfaces;
    const Range own = s.neighbours.particles(chunk);
    for (Index m = own.first; m < own.last;) {
      const Surface& surface = all.of(topology, m);
      SurfaceBatch batch{};
      for (; m < own.last && batch.count < SurfaceBatch::most && &all.of(topology, m) == &surface; ++m) {
        batch.first[batch.count] = topology.offset[m];
        batch.scale[batch.count] = all.scale(topology, m);
        batch.volume[batch.count] = topology.a0[m];
        ++batch.count;
      }
      add_surface_forces(law,
                         {surface.points(), surface.faces, surface.hinges, surface.rest_area.data(),
                          surface.rest_length.data(), surface.rest_angle.data()},
                         batch, s.x, f);
    }
  }
};

}  // namespace pliant
