// Particles, walls, neighbour lists and forces as one equation of motion, on one rank or on several.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <pliant/domain/halo.h>
#include <pliant/domain/migration.h>
#include <pliant/model/model.h>
#include <pliant/ts/system.h>

namespace pliant {

/// M r̈ = F(r, ṙ) for the points of a topology [H 7, 13]. Inactive particles keep their positions: their inverse mass is
/// zero. On several ranks each has a share of the particles, and copies (ghosts) of others' near them; all functions
/// that take positions are collective then.
template <int D>
class ParticleSystem final : public SecondOrderSystem {
 public:
  /// topology: the rank's own particles. All particles of all ranks together have different ids.
  ParticleSystem(Topology topology, Walls<D> walls, std::unique_ptr<ForceField<D>> field, NeighbourNeeds needs,
                 Real skin, Ranks ranks = Ranks())
      : ranks_(ranks),
        topology_(std::move(topology)),
        walls_(std::move(walls)),
        field_(std::move(field)),
        neighbours_(needs, skin),
        halo_(ranks) {}

  std::size_t size() const override { return static_cast<std::size_t>(topology_.owned_points()) * D; }
  const Ranks& ranks() const override { return ranks_; }

  void acceleration(Real, const Real* x, const Real* v, Real* a) override { field_->accelerations(view(x, v), a); }

  /// The configuration with neighbour lists that are valid for it, ghosts included. x, v [owned points · D]; v may be
  /// null where only energies are asked for.
  StateView<D> view(const Real* x, const Real* v) {
    if (!ranks_.several()) {
      neighbours_.ensure(topology_, walls_, x);
      return {x, v, topology_, neighbours_, walls_};
    }
    if (ranks_.any(!neighbours_.valid(x)))
      rebuild(x);
    else
      halo_.update(x, x_);
    if (v != nullptr) halo_.update(v, v_);
    return {x_.data(), v != nullptr ? v_.data() : nullptr, topology_, neighbours_, walls_};
  }

  /// Builds ghosts and lists from x, which becomes their reference.
  void rebuild(const Real* x) {
    if (!ranks_.several()) {
      neighbours_.rebuild(topology_, walls_, x);
      return;
    }
    if (!settled_) {
      halo_.settle(topology_, x);
      settled_ = true;
    }
    halo_.build(topology_, x, neighbours_.skin());
    halo_.update(x, x_);
    ranks_.together([&] { neighbours_.rebuild(topology_, walls_, x_.data()); });
    const Index strays = static_cast<Index>(ranks_.sum(static_cast<std::int64_t>(halo_.strays())));
    crowded_ = strays > many_strays;
  }

  /// Leaves this rank the particles `which` of those it has, in that order. Not collective.
  void keep(std::span<const Index> which) {
    topology_ = topology_.select(which);
    neighbours_.invalidate();
  }

  /// Whether particles should be sorted again: it has been a number of list rebuilds. The same on every rank.
  bool untidy() const { return neighbours_.rebuilds() >= tidy_at_ + rebuilds_to_sort; }
  /// Whether many particles have gone far from their rank's place, which makes many ghosts. The same on every rank.
  bool crowded() const { return crowded_; }

  /// Sorts particles in space, moves them to the ranks where they belong and builds the lists. The caller applies the
  /// migration that is returned to whatever else it keeps per particle.
  Migration tidy(State& state) {
    const Migration migration = plan_migration<D>(ranks_, topology_, state.x().data());
    migration.move(topology_);
    migration.move(state, D);
    settled_ = crowded_ = false;
    rebuild(state.x().data());
    tidy_at_ = neighbours_.rebuilds();
    return migration;
  }

  /// List rebuilds since the last tidy(): part of what a restart needs.
  std::int64_t rebuilds_since_tidy() const { return neighbours_.rebuilds() - tidy_at_; }
  void set_rebuilds_since_tidy(std::int64_t count) { tidy_at_ = neighbours_.rebuilds() - count; }

  /// Takes own particle m out of the run. Not collective.
  void deactivate(Index m) {
    topology_.deactivate(m);
    neighbours_.invalidate();
  }

  /// Own particles, then ghosts.
  const Topology& topology() const { return topology_; }
  const Walls<D>& walls() const { return walls_; }
  const ForceField<D>& field() const { return *field_; }
  Neighbours<D>& neighbours() { return neighbours_; }
  const Neighbours<D>& neighbours() const { return neighbours_; }

 private:
  static constexpr std::int64_t rebuilds_to_sort = 32;
  static constexpr Index many_strays = 32;

  Ranks ranks_;
  Topology topology_;
  Walls<D> walls_;
  std::unique_ptr<ForceField<D>> field_;
  Neighbours<D> neighbours_;
  Halo<D> halo_;
  std::vector<Real> x_, v_;  ///< with ghosts; unused on one rank
  bool settled_ = false, crowded_ = false;
  std::int64_t tidy_at_ = 0;
};

}  // namespace pliant
