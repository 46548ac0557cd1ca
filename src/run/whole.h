// All particles on every rank, for protocols that look at all of them after every step.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <pliant/run/simulation.h>

namespace pliant {

/// Particles in the order of their ids: on one rank those of the simulation itself, whose sorting must be `never`; on
/// several a copy of its state, with lists of its own.
template <int D>
class Whole {
 public:
  /// copy: particles, walls and forces as those of the simulation, on several ranks.
  Whole(Simulation<D>& simulation, std::optional<ParticleSystem<D>> copy)
      : simulation_(simulation), copy_(std::move(copy)) {
    if (copy_) copy_state_ = State(copy_->topology().points(), copy_->coordinates().all());
  }

  /// After a restart: update(), and which particles are active. Collective.
  void restore();
  /// After every change of the state. Collective.
  void update();
  /// After Simulation::find_velocities(). Collective.
  void update_velocities();

  ParticleSystem<D>& particles() { return copy_ ? *copy_ : simulation_.particles(); }
  const ParticleSystem<D>& particles() const { return copy_ ? *copy_ : simulation_.particles(); }
  const State& state() const { return copy_ ? copy_state_ : simulation_.state(); }
  const Topology& topology() const { return particles().topology(); }
  /// The present configuration, with valid lists.
  StateView<D> view() { return particles().view(state().x().data(), state().v().data(), state().t); }

  void set_walls(const Walls<D>& walls);
  /// Takes particle m, of all, out of the run.
  void deactivate(Index m);

 private:
  void gather(std::span<const Real> own, std::span<Real> all);

  Simulation<D>& simulation_;
  std::optional<ParticleSystem<D>> copy_;
  State copy_state_;
  std::vector<Index> ids_;         ///< of all ranks, in the order of their particles
  std::int64_t arrangement_ = -1;  ///< of the simulation, to which they belong
};

extern template class Whole<2>;
extern template class Whole<3>;

}  // namespace pliant
