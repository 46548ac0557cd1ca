// Particles in a drag so strong that inertia does not matter.
#pragma once

#include <utility>
#include <vector>

#include <pliant/model/drag.h>
#include <pliant/system/mobility.h>

namespace pliant {

/// v = F/ζ_i with the drag coefficient ζ_i of each point, as Drag has it: the limit of ẍ = (F − ζ_i ẋ)/m
/// if m/ζ_i is shorter than all other times. Forces that depend on velocities do not count.
template <int D>
class PointDrag final : public Mobility<D> {
 public:
  /// Errors: InputError unless the coefficient is positive.
  explicit PointDrag(Real coefficient, DragLaw law = DragLaw::per_particle) : PointDrag(Drag<D>{coefficient, law}) {}
  explicit PointDrag(const Drag<D>& drag) : drag_(drag) {
    if (!(drag.zeta > 0))
      throw InputError("the drag coefficient is {}, but motion without inertia needs a positive one", drag.zeta);
  }

  void find_velocities(const ForceField<D>& field, const StateView<D>& s, Real* v) override {
    at_rest_.assign(static_cast<std::size_t>(s.topology.points()) * D, 0);
    StateView<D> still = s;
    still.v = at_rest_.data();
    field.accelerations(still, v);
    for (Index i = 0; i < s.topology.owned_points(); ++i)
      point<D>(v, i) *= s.topology.mass(i) * shares(s.topology, i) / drag_.zeta;
  }

  Real power(const StateView<D>& s) const override {
    Real sum = 0;
    for (Index i = 0; i < s.topology.owned_points(); ++i) sum += s.velocity(i).squaredNorm() / shares(s.topology, i);
    return drag_.zeta * sum;
  }

  bool remembers() const override { return false; }
  Real beyond_contact() const override { return 0; }
  void set_numbers(std::vector<Index> /*numbers*/) override {}

 private:
  Real shares(const Topology& topology, Index i) const {
    return drag_shares<D>(drag_.law, topology, topology.particle[i]);
  }

  Drag<D> drag_;
  std::vector<Real> at_rest_;
};

}  // namespace pliant
