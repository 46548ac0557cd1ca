// Assigns kernels to terms: passes coefficients of terms and lists to the kernels.
#pragma once

#include <span>

#include <pliant/base/multiversion.h>
#include <pliant/kernels/edge_forces.h>
#include <pliant/kernels/pair_forces.h>
#include <pliant/kernels/points.h>
#include <pliant/kernels/shape_forces.h>
#include <pliant/kernels/wall_forces.h>
#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/gravity.h>
#include <pliant/model/model.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/pair_friction.h>
#include <pliant/model/perimeter.h>
#include <pliant/model/wall_contact.h>

namespace pliant {

/// Weight and drag of all points.
struct PointKernel {
  static constexpr bool fast() { return true; }
  static constexpr bool sets_forces = true;  ///< so that nothing needs to be zeroed
  template <int D>
  static void set_forces(const StateView<D>& s, Index chunk, Real* f, const Gravity<D>& gravity, const Drag<D>&) {
    const Range own = s.neighbours.particles(chunk);
    set_points<D>(s.topology.offset.data(), s.topology.point_mass.data(), own.first, own.last, gravity.g, f);
  }
  template <int D>
  static void add_forces(const StateView<D>& s, Index chunk, Real* f, const Gravity<D>&, const Drag<D>& drag) {
    if (!drag.enabled(s)) return;
    const Topology& topology = s.topology;
    const Range own = s.neighbours.particles(chunk);
    if (!s.flow.flows() && drag.law == DragLaw::per_particle && topology.points() == topology.particles()) {
      for (Index k = D * own.first; k < D * own.last; ++k) f[k] -= drag.zeta * s.v[k];
      return;
    }
    const auto add = [&](auto&& shares, auto&& slip) {
      for (Index m = own.first; m < own.last; ++m) {
        const Real zeta = drag.zeta / shares(m);
        for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) point<D>(f, i) -= zeta * slip(i);
      }
    };
    const auto shares = [&](Index m) { return drag_shares<D>(drag.law, topology, m); };
    const auto velocity = [&](Index i) { return s.velocity(i); };
    if (s.flow.flows())
      add(shares, [&](Index i) { return drag.slip(s, i); });
    else if (drag.law == DragLaw::per_particle)
      add([&](Index m) { return topology.points_of(m); }, velocity);
    else
      add(shares, velocity);
  }
};

struct PairKernel {
  static bool fast() { return simd::fast(); }
  template <int D>
  static void add_forces(const StateView<D>& s, Index chunk, Real* f, const PairContact<D>& contact,
                         const PairFriction<D>& friction) {
    add(s, chunk, f, {contact.kernel_law(), friction.kernel_law()});
  }
  template <int D>
  static void add_dissipation(const StateView<D>& s, Index chunk, Real* f, const PairContact<D>&,
                              const PairFriction<D>& friction) {
    if (friction.enabled(s)) add(s, chunk, f, {PairContactLaw{.epsilon = 0}, friction.kernel_law()});
  }

 private:
  template <int D>
  static void add(const StateView<D>& s, Index chunk, Real* f, const PairLaw& law) {
    const PairList& list = s.neighbours.point_pairs;
    const auto add_range = [&](Range range, Sides sides) {
      add_pair_forces<D>(law, std::span(list.pairs).subspan(range.first, range.size()), list.reach.data() + range.first,
                         sides, s.x, s.v, f);
    };
    add_range(list.inside(chunk), Sides::both);
    add_range(list.across(chunk), s.ghosts_feel ? Sides::both : Sides::first);
  }
};

struct WallKernel {
  static bool fast() { return simd::fast(); }
  template <int D>
  static void add_forces(const StateView<D>& s, Index chunk, Real* f, const WallContact<D>& contact) {
    const PairList& list = s.neighbours.walls;
    const Range own = list.inside(chunk);
    if (!s.walls.resting_segments() || contact.thickness > 0) {
      const Scatter<D, -1> scatter{f};
      for (Index e = own.first; e < own.last; ++e) contact.add_gradient(s, e, scatter);
      return;
    }
    add_wall_forces<D>(contact.kernel_law(), std::span(list.pairs).subspan(own.first, own.size()), s.walls,
                       s.topology.diameter.data(), s.x, f);
  }
};

struct ShapeKernel {
  static constexpr bool fast() { return true; }
  static void add_forces(const StateView<2>& s, Index chunk, Real* f, const Area& area, const Perimeter& perimeter,
                         const Bending& bending) {
    const Range own = s.neighbours.particles(chunk);
    add_shape_forces({area.kernel_law(), perimeter.kernel_law(), bending.kernel_law()}, s.topology.offset.data(),
                     s.topology.a0.data(), s.topology.l0.data(), own.first, own.last, s.x, f, s.prefetch);
  }
};

struct EdgeKernel {
  static bool fast() { return simd::fast(); }
  static void add_forces(const StateView<2>& s, Index chunk, Real* f, const EdgeContact& contact,
                         const EdgeFriction& friction) {
    if (contact.enabled(s)) add(s, chunk, f, {contact.kernel_law(), friction.kernel_law()});
  }
  static void add_dissipation(const StateView<2>& s, Index chunk, Real* f, const EdgeContact& contact,
                              const EdgeFriction& friction) {
    if (contact.enabled(s) && friction.enabled(s))
      add(s, chunk, f, {EdgeContactLaw{.epsilon = 0}, friction.kernel_law()});
  }

 private:
  static void add(const StateView<2>& s, Index chunk, Real* f, const EdgeLaw& law) {
    const PairList& list = s.neighbours.near_edges();
    const Index* next = s.topology.next.data();
    const auto pairs = [&](Range range) { return std::span(list.pairs).subspan(range.first, range.size()); };
    const Range inside = list.inside(chunk), across = list.across(chunk), own = s.pushed(chunk);
    add_edge_forces(law, pairs(inside), list.reach.data() + inside.first, next, s.x, s.v, f);
    add_edge_forces(law, pairs(across), list.reach.data() + across.first, next, own.first, own.last, s.x, s.v, f);
  }
};

}  // namespace pliant
