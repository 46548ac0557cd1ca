// Droplets that move without inertia, as one equation of motion, on one rank or on several.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <pliant/system/mobility.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// ẋ = v(t, x), where the forces of a model and the viscous ones of a mobility balance [T 2.9, 4.1]. Everything else is
/// up to the system of particles within: lists, ranks, walls, sorting.
template <int D>
class OverdampedSystem final : public FirstOrderSystem {
 public:
  /// Arguments of a ParticleSystem, and the mobility's, whose range should be that of the model's attraction, within
  /// that of the lists (NeighbourNeeds::beyond). Errors: InputError where it is not.
  OverdampedSystem(Topology topology, Walls<D> walls, std::unique_ptr<ForceField<D>> field, NeighbourNeeds needs,
                   Real skin, const MobilityOptions& mobility, const Ranks& ranks = Ranks())
      : particles_(std::move(topology), std::move(walls), std::move(field), needs, skin, ranks),
        mobility_(mobility, ranks) {
    if (!(mobility.beyond <= needs.beyond))
      throw InputError("droplets are neighbours up to {} beyond contact, but the lists go to {} only", mobility.beyond,
                       needs.beyond);
  }

  std::size_t size() const override { return particles_.size(); }
  const Ranks& ranks() const override { return particles_.ranks(); }

  /// Errors: NumericalError where droplets or walls have run into each other, with their numbers.
  void rate(Real t, const Real* x, Real* v) override {
    last_.resize(size());
    const StateView<D> s = particles_.view(x, last_.data(), t);
    if (particles_.neighbours().rebuilds() != numbered_) number(s);
    force_.resize(static_cast<std::size_t>(s.topology.points()) * D);
    ranks().together([&] { particles_.field().forces(s, force_.data()); });
    mobility_.solve(s, force_.data(), last_.data());
    std::copy(last_.begin(), last_.end(), v);
  }

  /// Velocities that rate() found last, with which the next solve starts: save them for a restart that is bit for bit.
  const std::vector<Real>& last() const { return last_; }
  void set_last(std::vector<Real> v) { last_ = std::move(v); }

  /// As ParticleSystem::tidy; the velocities found last move too. Entries of the state behind the points are lost.
  void tidy(State& state) {
    const bool known = ranks().any(!last_.empty());
    const Migration migration = particles_.tidy(state);
    if (known) migration.move_points(last_, D);
  }

  ParticleSystem<D>& particles() { return particles_; }
  const ParticleSystem<D>& particles() const { return particles_; }
  const Mobility<D>& mobility() const { return mobility_; }

 private:
  /// Rows of the whole system: the ranks' own points one after the other.
  void number(const StateView<D>& s) {
    const Index own = s.topology.owned_points();
    const std::vector<Index> counts = ranks().all_gather(std::vector<Index>{own});
    Index first = 0;
    for (int r = 0; r < ranks().rank(); ++r) first += counts[r];
    std::vector<Real> mine(static_cast<std::size_t>(own) * D), storage;
    for (Index i = 0; i < own; ++i) mine[static_cast<std::size_t>(i) * D] = first + i;
    const Real* all = particles_.with_ghosts(mine.data(), storage);
    std::vector<Index> numbers(s.topology.points());
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<Index>(all[i * D]);
    mobility_.set_numbers(std::move(numbers));
    numbered_ = particles_.neighbours().rebuilds();
  }

  ParticleSystem<D> particles_;
  Mobility<D> mobility_;
  std::vector<Real> last_, force_;
  std::int64_t numbered_ = -1;
};

}  // namespace pliant
