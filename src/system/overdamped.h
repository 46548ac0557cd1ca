// Particles that move without inertia, as one equation of motion, on one rank or on several.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <pliant/system/mobility.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// A quantity that is integrated with the positions, with the same accuracy and error control.
template <int D>
struct IntegratedQuantity {
  std::string name;
  /// This rank's share of its rate, at the velocities s.v.
  std::function<Real(const ForceField<D>& field, const StateView<D>& s)> rate;
};

/// ẋ = v(t, x), where the forces of a model and drag balance [T 2.9, 4.1]. The wrapped particle system handles lists,
/// ranks, walls and sorting. The integrated quantities follow the coordinates, on the root (State::extra).
template <int D>
class OverdampedSystem final : public FirstOrderSystem {
 public:
  /// Errors: InputError if the mobility's range exceeds the range of the lists (NeighbourNeeds::beyond_contact).
  OverdampedSystem(ParticleSystem<D> particles, std::unique_ptr<Mobility<D>> mobility,
                   std::vector<IntegratedQuantity<D>> quantities = {})
      : particles_(std::move(particles)), mobility_(std::move(mobility)), quantities_(std::move(quantities)) {
    if (particles_.rotates_or_remembers())
      throw InputError(
          "particles without inertia have no spins, and their contacts no history; use a model with inertia");
    if (const Real listed = particles_.neighbours().needs().beyond_contact; !(mobility_->beyond_contact() <= listed))
      throw InputError("droplets are neighbours up to {} beyond contact, but the lists go to {} only",
                       mobility_->beyond_contact(), listed);
  }

  std::size_t size() const override { return particles_.size(); }
  std::size_t unknowns() const override { return size() + (ranks().root() ? quantities_.size() : 0); }
  const Ranks& ranks() const override { return particles_.ranks(); }
  Real outside_speed(Real t, const Real* x) const override { return particles_.outside_speed(t, x); }

  /// Errors: NumericalError where particles or walls have run into each other, with their numbers.
  void rate(Real t, const Real* y, Real* ydot) override {
    last_.resize(size());
    const StateView<D> s = particles_.view(y, last_.data(), t);
    if (particles_.neighbours().rebuilds() != numbered_) number(s);
    mobility_->find_velocities(particles_.field(), s, last_.data());
    std::copy(last_.begin(), last_.end(), ydot);
    if (quantities_.empty()) return;
    const StateView<D> moving = particles_.view(y, ydot, t);
    std::vector<Real> rates;
    for (const IntegratedQuantity<D>& q : quantities_) rates.push_back(q.rate(particles_.field(), moving));
    ranks().sum(rates);
    if (ranks().root()) std::copy(rates.begin(), rates.end(), ydot + size());
  }

  /// Velocities that rate() found last, with which the next solve starts: save them for a restart that is bit for bit.
  const std::vector<Real>& last() const { return last_; }
  void set_last(std::vector<Real> v) { last_ = std::move(v); }

  /// As ParticleSystem::sort; the velocities found last move too.
  Migration sort(State& state) {
    const bool known = ranks().any(!last_.empty());
    Migration migration = particles_.sort(state);
    if (known) migration.move_points(last_, D);
    return migration;
  }

  ParticleSystem<D>& particles() { return particles_; }
  const ParticleSystem<D>& particles() const { return particles_; }
  const Mobility<D>& mobility() const { return *mobility_; }
  const std::vector<IntegratedQuantity<D>>& quantities() const { return quantities_; }

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
    mobility_->set_numbers(std::move(numbers));
    numbered_ = particles_.neighbours().rebuilds();
  }

  ParticleSystem<D> particles_;
  std::unique_ptr<Mobility<D>> mobility_;
  std::vector<IntegratedQuantity<D>> quantities_;
  std::vector<Real> last_;
  std::int64_t numbered_ = -1;
};

}  // namespace pliant
