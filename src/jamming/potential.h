// Energy or enthalpy of a packing as a function of its points and the length of its box.
#pragma once

#include <optional>
#include <vector>

#include <pliant/jamming/descent.h>
#include <pliant/jamming/stiffness_factors.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// U of a system, at a pressure U + p V. Coordinates y: the own positions in the box at the start; at a pressure, then
/// √(N/2) times the logarithm of the box length over the one at the start, for N points. When the box changes, the
/// particles follow with their centres and keep their shapes.
template <int D>
class Potential final : public ExactHessian {
 public:
  static constexpr Index most_points = D == 2 ? 20000 : 2000;

  /// Whether the system has a Hessian, and at most most_points points; with more the factors take too long.
  static bool suits(const ParticleSystem<D>& system);
  /// Whether factors of the Hessian also cost less than the iterations of FIRE that L-BFGS saves: small systems of
  /// small polygons.
  static bool quick(const ParticleSystem<D>& system);

  Potential(ParticleSystem<D>& system, std::optional<Real> pressure);

  /// Positions for y, and the box of the system with them.
  const std::vector<Real>& place(const Real* y);
  /// The energy, at a pressure with p V, and forces at y; U only where it is asked for.
  Real operator()(const Real* y, Real* f, bool with_energy);

  /// The change of the box since the start is neglected, so y must be near the start. A small multiple of the unit
  /// matrix is added, and a larger one where the Hessian is not positive definite.
  bool factorise(const Real* y) override;
  void solve(Eigen::VectorXd& b) override { factors_->solve(b); }
  /// With the small multiple of the unit matrix: zero modes have no negative curvature.
  void fill(::Mat matrix) const override;

 private:
  void differentiate(const Real* y);
  Real* forces(const StateView<D>& s);
  Real virial_of_terms(const StateView<D>& s) const;

  ParticleSystem<D>& system_;
  std::optional<Real> pressure_;
  Real volume_ = 0, factor_ = 1, log_length_ = 0;
  Vec<D> origin_;
  std::vector<Real> x_, force_, on_particles_;
  std::optional<Stiffness<D>> stiffness_;
  Eigen::VectorXd by_box_;  ///< the last row and column of the Hessian, without its corner; empty without a pressure
  Real box_ = 0;            ///< the corner
  Real least_shift_ = 0;    ///< multiple of the unit matrix that hides rounding errors of zero eigenvalues
  std::optional<StiffnessFactors<D>> factors_;
};

extern template class Potential<2>;
extern template class Potential<3>;

}  // namespace pliant
