// Particles in motion: equations, state and integrator.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include <pliant/system/overdamped.h>
#include <pliant/ts/integrator.h>

namespace pliant {

/// When particles are sorted in space, which places neighbours in space near each other in memory, and wraps particles
/// that have left a periodic box. On several ranks particles are always sorted at the start, and when too many are far
/// from the region of their rank; in a periodic box when they are spread over many images, unless `never`.
enum class Sorting {
  never,     ///< on one rank particles stay in the order of their ids
  at_start,  ///< and never again, as a method that remembers steps would forget them
  regularly
};

/// Any number of them may live in a process. Writes and prints nothing.
template <int D>
class Simulation {
 public:
  using System = std::variant<ParticleSystem<D>, OverdampedSystem<D>>;

  /// `all`: the particles of all ranks, in the order of their ids. `system`: with inertia or without; its topology is
  /// not used.
  Simulation(Topology all, System system, Sorting sorting)
      : all_(std::move(all)), system_(std::move(system)), sorting_(sorting) {}
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  /// Before advance(); null where nothing advances. Errors: InputError if the integrator cannot solve the system.
  void set_integrator(std::unique_ptr<Integrator> integrator);

  /// Shares the particles out over the ranks, at rest. x [points of all particles · D]. Collective.
  void place(std::span<const Real> x);
  /// Makes these particles, in this order, the rank's own. The state is up to the caller.
  void take(std::span<const Index> ids);
  /// Forgets the list of all particles, which is for place() and take().
  void forget_all() { all_ = Topology(); }

  /// Integrates until t_end, or until the observer stops. Collective. Errors: as of Integrator::run.
  void advance(Real t_end, const StepObserver& observer = {});
  /// One step.
  void step();
  /// The state was changed from outside: predictions are invalid.
  void changed() { fresh_ = true; }
  /// The predictions of the integrator belong to the state.
  void restored() { fresh_ = false; }
  /// Velocities of the present state, where they are not part of it: once for each step, and after
  /// forget_velocities(). Changes no trajectory. Collective.
  void find_velocities();
  void forget_velocities() { velocities_of_ = -1; }

  /// Whether sort() pays. The same on every rank.
  bool wants_sorting() const;
  /// Sorts particles in space, on the ranks where they belong. The caller applies the result to its data
  /// per particle. Collective.
  Migration sort();
  /// Another number whenever the rank has other particles, or has them in another order.
  std::int64_t arrangement() const { return arrangement_; }
  /// Owned particle m was moved to another place in the state; as ParticleSystem::relist.
  void relist(Index m) { particles().relist(state_.x().data(), m); }

  ParticleSystem<D>& particles() {
    return overdamped() ? overdamped()->particles() : std::get<ParticleSystem<D>>(system_);
  }
  const ParticleSystem<D>& particles() const { return const_cast<Simulation*>(this)->particles(); }
  /// Null with inertia.
  OverdampedSystem<D>* overdamped() { return std::get_if<OverdampedSystem<D>>(&system_); }
  const OverdampedSystem<D>* overdamped() const { return std::get_if<OverdampedSystem<D>>(&system_); }
  Integrator& integrator() { return *integrator_; }
  const Integrator& integrator() const { return *integrator_; }
  State& state() { return state_; }
  /// Of the own particles [own · rotations], where the model has torques; else empty.
  std::span<Real> angles() { return particles().rotations_in(state_.x()); }
  std::span<Real> spins() { return particles().rotations_in(state_.v()); }
  std::span<const Real> angles() const { return particles().rotations_in(state_.x()); }
  std::span<const Real> spins() const { return particles().rotations_in(state_.v()); }
  const State& state() const { return state_; }
  /// All particles by id; empty after forget_all().
  const Topology& all() const { return all_; }
  const Topology& topology() const { return particles().topology(); }
  const Ranks& ranks() const { return particles().ranks(); }
  /// The present configuration, with valid lists. Collective.
  StateView<D> view() { return particles().view(state_.x().data(), state_.v().data(), state_.t); }

 private:
  Topology all_;
  System system_;
  Sorting sorting_;
  std::unique_ptr<Integrator> integrator_;
  State state_;
  std::int64_t velocities_of_ = -1;  ///< the step for which they were found
  std::int64_t arrangement_ = 0;
  bool fresh_ = true;  ///< nothing that the integrator carries belongs to the state
};

extern template class Simulation<2>;
extern template class Simulation<3>;

}  // namespace pliant
