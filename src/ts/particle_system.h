// Particles, walls, neighbour lists and forces as one equation of motion.
#pragma once

#include <memory>
#include <utility>

#include <pliant/model/model.h>
#include <pliant/ts/system.h>

namespace pliant {

/// M r̈ = F(r, ṙ) for the points of a topology [H 7, 13]. Inactive particles keep their positions: their inverse mass is
/// zero.
template <int D>
class ParticleSystem final : public SecondOrderSystem {
 public:
  ParticleSystem(Topology topology, Walls<D> walls, std::unique_ptr<ForceField<D>> field, NeighbourNeeds needs,
                 Real skin)
      : topology_(std::move(topology)), walls_(std::move(walls)), field_(std::move(field)), neighbours_(needs, skin) {}

  std::size_t size() const override { return static_cast<std::size_t>(topology_.points()) * D; }

  void acceleration(Real, const Real* x, const Real* v, Real* a) override {
    field_->forces(view(x, v), a);
    const Real* inverse_mass = topology_.inverse_mass.data();
    const std::size_t n = topology_.inverse_mass.size();
    for (std::size_t i = 0; i < n; ++i)
      for (int k = 0; k < D; ++k) a[i * D + k] *= inverse_mass[i];
  }

  /// The configuration with neighbour lists that are valid for it. v may be null where only energies are asked for.
  StateView<D> view(const Real* x, const Real* v) {
    neighbours_.ensure(topology_, walls_, x);
    return {x, v, topology_, neighbours_, walls_};
  }

  /// Takes particle m out of the run.
  void deactivate(Index m) {
    topology_.deactivate(m);
    neighbours_.invalidate();
  }

  const Topology& topology() const { return topology_; }
  const Walls<D>& walls() const { return walls_; }
  const ForceField<D>& field() const { return *field_; }
  Neighbours<D>& neighbours() { return neighbours_; }
  const Neighbours<D>& neighbours() const { return neighbours_; }

 private:
  Topology topology_;
  Walls<D> walls_;
  std::unique_ptr<ForceField<D>> field_;
  Neighbours<D> neighbours_;
};

}  // namespace pliant
