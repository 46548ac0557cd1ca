// Enthalpy of a packing as a function of its points and the length of its box.
#pragma once

#include <optional>
#include <vector>

#include <pliant/jamming/quasi_newton.h>
#include <pliant/jamming/stiffness_factors.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// U + p V of a system. Coordinates y: the own positions in the box at the start, and the logarithm of the box length
/// over the one at the start, times a factor. Particles keep their shapes while the box changes, since only their
/// centres follow it.
template <int D>
class Enthalpy final : public ApproximateHessian {
 public:
  /// Whether a system is of deformable particles, and particles and system are so small that factors of the Hessian
  /// cost less than the iterations of FIRE that they save.
  static bool suits(const ParticleSystem<D>& system);

  Enthalpy(ParticleSystem<D>& system, Real pressure);

  /// Positions for y, and the box of the system with them.
  const std::vector<Real>& place(const Real* y);
  /// Enthalpy and forces at y; the energy in it only where it is asked for.
  Real operator()(const Real* y, Real* f, bool with_energy);

  /// At a y near the start: as if the box there were the box at the start. A small multiple of the unit matrix is
  /// added, and a larger one where the Hessian is not positive definite.
  bool factorise(const Real* y) override;
  void solve(Eigen::VectorXd& b) override { factors_->solve(b); }

 private:
  Real* forces(const StateView<D>& s);
  Real virial_of_terms(const StateView<D>& s) const;

  ParticleSystem<D>& system_;
  Real pressure_, volume_ = 0, factor_ = 1, log_length_ = 0;
  Vec<D> origin_;
  std::vector<Real> x_, force_, on_particles_;
  std::optional<StiffnessFactors<D>> factors_;
};

extern template class Enthalpy<2>;
extern template class Enthalpy<3>;

}  // namespace pliant
