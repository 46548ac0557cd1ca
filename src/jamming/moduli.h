// Elastic moduli of a packing at mechanical equilibrium, by linear response.
#pragma once

#include <array>

#include <pliant/jamming/contact_network.h>
#include <pliant/jamming/stiffness.h>

namespace pliant {

/// Second derivatives of the energy per volume by strains, where the particles follow the strain r → (1 + e) r of the
/// box and relax: S_ab,cd = (∂²U/∂e_ab∂e_cd − Ξ_abᵀ H⁺ Ξ_cd)/V, with the Hessian H and the forces −Ξ by a strain
/// (StrainDerivatives). The stress of the packing contributes to S (pre-stress). Unit: ε/σ_avg^D.
template <int D>
struct Moduli {
  using Square = typename StrainDerivatives<D>::Square;
  static constexpr int voigt_size = D * (D + 1) / 2;
  using Voigt = Eigen::Matrix<Real, voigt_size, voigt_size>;

  Square tangent;      ///< S; strain e_ab is number a D + b
  Square affine;       ///< the same without relaxation
  Mat<D> stress;       ///< (1/V) ∂U/∂e_ab: tension positive
  Real residual = 0;   ///< largest |H u + Ξ| over the largest |Ξ| of all strains; u = −H⁺ Ξ
  Real max_force = 0;  ///< largest force on a coordinate: the moduli hold for a packing at equilibrium

  Real pressure() const { return (0 - stress.trace()) / D; }  // never -0
  /// ∂σ_ab/∂ε_cd for symmetric strains from here, with the true (Cauchy) stress: symmetric under exchange of ab and cd
  /// where the stress is isotropic (D. C. Wallace, Phys. Rev. 162, 776 (1967)).
  Real stiffness(int a, int b, int c, int d) const;
  /// stiffness() in the order xx, yy, xy, or xx, yy, zz, yz, xz, xy; shear strains are γ = 2 ε_ab.
  Voigt voigt() const;
  /// −V ∂p/∂V.
  Real bulk() const;
  /// Against simple shear by γ: displacements along a that grow with the coordinate b.
  Real simple_shear(int a, int b) const { return tangent(a * D + b, a * D + b); }
  /// Against pure shear by γ: stretched by exp(γ/2) along a, and by exp(−γ/2) along b.
  Real pure_shear(int a, int b) const;
  /// Mean over all directions of shear (Voigt average).
  Real shear() const;
};

/// Moduli at x [size of the system], a minimum of the energy. Rattlers must be out of the run (Backbone), or without
/// contacts. Errors: InputError for a box that is not periodic in all directions, for walls, and as for Stiffness;
/// NumericalError for a packing that is unstable, with an eigenvalue of the Hessian below −10⁻¹⁰ of its bound, and
/// where a strain drives a mode without stiffness.
template <int D>
Moduli<D> moduli(ParticleSystem<D>& system, std::span<const Real> x, PreStress pre_stress = PreStress::kept);

/// Moduli of a packing without its rattlers; NaN if all particles are rattlers. network: the contacts at x. Errors:
/// as of moduli() and Backbone.
template <int D>
Moduli<D> backbone_moduli(ParticleSystem<D>& system, std::span<const Real> x, const ContactNetwork<D>& network);

extern template struct Moduli<2>;
extern template struct Moduli<3>;

}  // namespace pliant
