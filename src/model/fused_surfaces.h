// Assigns the kernels of closed surfaces to their terms.
#pragma once

#include <pliant/base/multiversion.h>
#include <pliant/kernels/simplex_forces.h>
#include <pliant/kernels/surface_forces.h>
#include <pliant/model/model.h>
#include <pliant/model/simplex_friction.h>
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
      const SurfaceForces forces(law,
                                 {surface.points(), surface.faces, surface.hinges, surface.corners, surface.opposite,
                                  surface.rest_area.data(), surface.rest_length.data(), surface.rest_angle.data()});
      const auto same = [&] { return m < own.last && &all.of(topology, m) == &surface; };
      while (same()) {
        SurfaceBatch batch{};
        for (; same() && batch.count < SurfaceBatch::most; ++m) {
          batch.first[batch.count] = topology.offset[m];
          batch.scale[batch.count] = all.scale(topology, m);
          batch.volume[batch.count] = topology.a0[m];
          ++batch.count;
        }
        forces.add(batch, s.x, f);
      }
    }
  }
};

/// Vertices and faces, or pairs of edges.
template <Elements E>
struct SimplexKernel {
  using Kind = ElementKind<E>;
  static constexpr bool of_faces = E == Elements::vertex_faces;

  static bool fast() { return simd::fast(); }
  template <class Contact>
  static void add_forces(const StateView<3>& s, Index chunk, Real* f, const Contact& contact,
                         const SimplexFriction<E>& friction) {
    static_assert(Contact::elements == E);
    SimplexLaw law{contact.epsilon, friction.mu, friction.friction == Friction::tangential};
    if constexpr (!of_faces) law.s0 = contact.s0;
    const PairList& list = s.neighbours.*Kind::list;
    if (list.empty()) return;
    const Range own = s.pushed(chunk);
    thread_local std::vector<Index> on_rim;
    const auto add = [&](std::span<const SimplexPair> pairs) {
      if constexpr (of_faces)
        add_vertex_face_forces(law, pairs, {own.first, own.last}, s.x, s.v, f, on_rim);
      else
        add_edge_pair_forces(law, pairs, {own.first, own.last}, s.x, s.v, f);
    };
    const NearSimplices& near = of_faces ? s.neighbours.near_vertex_faces() : s.neighbours.near_edge_pairs();
    on_rim.clear();
    for (const Index part : {chunk, s.neighbours.chunks() + chunk})
      if (s.neighbours.narrowed())
        add(near[part]);
      else
        for_each_block<Kind>(s.topology, list, {list.start[part], list.start[part + 1]}, add);
    const Scatter<3, 1, true> scatter{f, own};
    for (const Index e : on_rim) friction.add_force(s, e, scatter);
  }
};

}  // namespace pliant
