// The same particles on one rank and shared out among all.
#pragma once

#include <pliant/catalogue/catalogue.h>
#include <pliant/system/particle_system.h>
#include <pliant/ts/integrator.h>

#include "model_parameters.h"
#include "support/rows.h"

namespace pliant::test {

inline constexpr Real skin = 0.05;
inline const ModelParameters parameters{
    .epsilon = 100, .epsilon_wall = 200, .k_a = 20, .k_l = 3, .k_b = 0.02, .mu = 0.2, .zeta = 0.3};

template <int D>
ParticleSystem<D> system_of(const Configuration<D>& c, ModelKind kind, const Ranks& ranks = Ranks(),
                            const ModelParameters& p = parameters, const Box<D>& box = {},
                            const pliant::Vec<D>& gravity = pliant::Vec<D>::LinSpaced(0.1, -1)) {
  return ParticleSystem<D>(c.topology, c.walls, make_force_field<D>(kind, p, gravity), skin, ranks, box);
}

/// The particles of a configuration, ids in order, on one rank and shared out: every size()-th, or by `owner(id)`.
template <int D>
struct Twins {
  Ranks ranks{PETSC_COMM_WORLD};
  Configuration<D>& c;
  ParticleSystem<D> whole, shared;
  State whole_state, state;

  Twins(Configuration<D>& configuration, ModelKind kind, const Box<D>& box = {})
      : Twins(
            configuration, kind, [this](Index m) { return m % ranks.size(); }, box) {}
  template <class Owner>
  Twins(Configuration<D>& configuration, ModelKind kind, Owner&& owner, const Box<D>& box = {})
      : c(configuration),
        whole(system_of<D>(c, kind, Ranks(), parameters, box)),
        shared(system_of<D>(c, kind, ranks, parameters, box)) {
    std::vector<Index> mine;
    for (Index m = 0; m < c.topology.particles(); ++m)
      if (owner(m) == ranks.rank()) mine.push_back(m);
    shared.take(c.topology.select(mine));
    load();
  }

  /// Both states as the configuration is.
  void load() {
    whole_state.assign(c.x, c.v);
    std::vector<Real> x, v;
    for (Index m = 0; m < shared.topology().owned(); ++m)
      for (Index k = first(m); k < first(m) + D * shared.topology().points_of(m); ++k) {
        x.push_back(c.x[k]);
        v.push_back(c.v[k]);
      }
    state.assign(x, v);
  }
  /// Where the coordinates of own particle m begin in the whole.
  Index first(Index m) const { return c.topology.offset[shared.topology().id[m]] * D; }

  /// Largest difference, over all ranks, between the owned coordinates and the coordinates of the full system; infinity
  /// for NaN.
  Real difference(std::span<const Real> own, std::span<const Real> all) const {
    Real most = 0;
    const Topology& t = shared.topology();
    for (Index m = 0; m < t.owned(); ++m)
      for (Index k = 0; k < D * t.points_of(m); ++k) {
        const Real d = std::abs(own[t.offset[m] * D + k] - all[first(m) + k]);
        if (!(d <= most)) most = std::isnan(d) ? std::numeric_limits<Real>::infinity() : d;
      }
    return ranks.max(most);
  }

  void sort() { shared.sort(state); }
  /// With the predictions of its integrator.
  void sort(Integrator& integrator) {
    std::vector<Real> carried(integrator.carried().begin(), integrator.carried().end());
    const Migration migration = shared.sort(state);
    if (!integrator.carries()) return;
    migration.move_points(carried, D);
    integrator.set_carried(carried);
  }
};

}  // namespace pliant::test
