// Particles in a drag so strong that inertia does not matter.
#pragma once

#include <span>
#include <vector>

#include <pliant/system/particle_system.h>

namespace pliant {

/// ẋ = F(t, x)/ζ_i with the drag coefficient ζ_i = ζ/n of each of a particle's n points: what ẍ = (F − ζ_i ẋ)/m tends
/// to where m/ζ_i is shorter than all other times. Forces that depend on velocities do not count.
template <int D>
class DragLimit final : public FirstOrderSystem {
 public:
  /// The particles' walls, lists and order stay theirs. Errors: InputError unless ζ is positive.
  DragLimit(ParticleSystem<D>& particles, Real zeta) : particles_(particles), zeta_(zeta) {
    if (!(zeta > 0))
      throw InputError("the drag coefficient is {}, but motion without inertia needs a positive one", zeta);
  }

  std::size_t size() const override { return particles_.size(); }
  const Ranks& ranks() const override { return particles_.ranks(); }

  void rate(Real t, const Real* x, Real* v) override {
    at_rest_.assign(size(), 0);
    const StateView<D> s = particles_.view(x, at_rest_.data(), t);
    particles_.field().accelerations(s, v);
    for (Index i = 0; i < s.topology.owned_points(); ++i)
      point<D>(v, i) *= s.topology.mass(i) * s.topology.points_of(s.topology.particle[i]) / zeta_;
    last_.assign(v, v + size());
  }

  /// The velocities of the last evaluation.
  std::span<const Real> last() const { return last_; }

 private:
  ParticleSystem<D>& particles_;
  Real zeta_;
  std::vector<Real> at_rest_, last_;
};

}  // namespace pliant
