#include <pliant/jamming/backbone.h>
#include <pliant/jamming/minimise.h>
#include <pliant/jamming/moduli.h>
#include <pliant/jamming/stiffness_factors.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace pliant {
namespace {

/// Solves H u = b for a positive semidefinite H whose null space is orthogonal to b: by conjugate gradients, with the
/// factors of H + shift as preconditioner. All eigenvalues far above the shift become 1, so that few steps suffice.
template <int D>
class SemidefiniteSolver {
 public:
  /// Errors: NumericalError if H has an eigenvalue below −shift.
  SemidefiniteSolver(const Stiffness<D>& h, Real shift) : h_(h.matrix()), factors_(h) {
    if (!factors_.factorise(shift))
      throw NumericalError(
          "the packing is unstable: eigenvalues of its Hessian are below {:.3g}; minimise its energy further", -shift);
  }

  /// Solves until |H u − b| ≤ tolerance; |H u − b| may be larger afterwards.
  Eigen::VectorXd solve(const Eigen::VectorXd& b, Real tolerance) {
    constexpr int most_steps = 200;
    Eigen::VectorXd u = Eigen::VectorXd::Zero(b.size()), r = b, z = precondition(r), p = z, hp;
    Real rz = r.dot(z);
    for (int step = 0; step < most_steps && r.norm() > tolerance; ++step) {
      hp = h_ * p;
      const Real curvature = p.dot(hp);
      if (!(curvature > 0)) break;
      u += rz / curvature * p;
      r -= rz / curvature * hp;
      z = precondition(r);
      const Real next = r.dot(z);
      p = z + next / rz * p;
      rz = next;
    }
    return u;
  }

 private:
  Eigen::VectorXd precondition(Eigen::VectorXd r) {
    factors_.solve(r);
    return r;
  }

  Eigen::Map<const typename Stiffness<D>::Csr> h_;
  StiffnessFactors<D> factors_;
};

/// Indices of the components of a symmetric tensor in Voigt's order.
template <int D>
constexpr std::array<std::array<int, 2>, Moduli<D>::voigt_size> voigt_indices() {
  if constexpr (D == 2)
    return {{{0, 0}, {1, 1}, {0, 1}}};
  else
    return {{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};
}

}  // namespace

template <int D>
Real Moduli<D>::stiffness(int a, int b, int c, int d) const {
  const auto is = [](int i, int j) { return i == j ? 1.0 : 0.0; };
  // The second derivative by the Lagrangian strain, which is symmetric, and the change of area and direction of the
  // faces on which the stress acts.
  const Real lagrangian = (tangent(a * D + b, c * D + d) - stress(b, d) * is(a, c) +  //
                           tangent(b * D + a, c * D + d) - stress(a, d) * is(b, c) + tangent(a * D + b, d * D + c) -
                           stress(b, c) * is(a, d) + tangent(b * D + a, d * D + c) - stress(a, c) * is(b, d)) /
                          4;
  return lagrangian +
         (stress(b, d) * is(a, c) + stress(b, c) * is(a, d) + stress(a, c) * is(b, d) + stress(a, d) * is(b, c)) / 2 -
         stress(a, b) * is(c, d);
}

template <int D>
typename Moduli<D>::Voigt Moduli<D>::voigt() const {
  constexpr auto indices = voigt_indices<D>();
  Voigt matrix;
  for (int k = 0; k < voigt_size; ++k)
    for (int l = 0; l < voigt_size; ++l)
      matrix(k, l) = stiffness(indices[k][0], indices[k][1], indices[l][0], indices[l][1]);
  return matrix;
}

template <int D>
Real Moduli<D>::bulk() const {
  return voigt().template topLeftCorner<D, D>().sum() / (D * D);
}

template <int D>
Real Moduli<D>::pure_shear(int a, int b) const {
  return (stiffness(a, a, a, a) + stiffness(b, b, b, b) - stiffness(a, a, b, b) - stiffness(b, b, a, a)) / 4;
}

template <int D>
Real Moduli<D>::shear() const {
  // Of each plane: the mean of simple and pure shear in 2D; 2/5 and 3/5 of the means over the planes in 3D.
  Real simple = 0, pure = 0;
  for (int a = 0; a < D; ++a)
    for (int b = 0; b < a; ++b) {
      simple += stiffness(a, b, a, b);
      pure += pure_shear(a, b);
    }
  constexpr int planes = D * (D - 1) / 2;
  constexpr Real part = D == 2 ? 0.5 : 0.6;
  return (part * simple + (1 - part) * pure) / planes;
}

template <int D>
Moduli<D> moduli(ParticleSystem<D>& system, std::span<const Real> x, PreStress pre_stress) {
  for (int k = 0; k < D; ++k)
    if (!system.box().periodic(k))
      throw InputError("direction {} of the box is open; moduli need a box that is periodic in all directions", k);
  if (system.walls().size() > 0)
    throw InputError("there are {} walls; moduli need a periodic box without walls", system.walls().size());
  const Stiffness<D> h(system, x, pre_stress);
  if (h.size() == 0) throw InputError("no particle is left in the run; moduli need a packing");
  constexpr Real relative_shift = 1e-10, relative_tolerance = 1e-12, accepted = 1e-8;
  constexpr Real epsilon = std::numeric_limits<Real>::epsilon();
  const StrainDerivatives<D>& strain = h.strain();
  const Real bound = h.bound(), volume = system.box().volume(), length = system.box().length().maxCoeff(),
             of_strain = strain.affine.cwiseAbs().maxCoeff() / square(length);
  // One particle that touches its own images resists strains, although nothing resists its motion.
  const bool moves_freely = bound <= epsilon * of_strain;
  if (moves_freely && !(of_strain > 0))
    throw NumericalError("no particles touch, and the packing has no stiffness; compress it");

  Moduli<D> m;
  const StateView<D> s = system.view(x.data(), nullptr);
  std::vector<Real> force(static_cast<std::size_t>(s.topology.points()) * D);
  system.field().energy(s, force.data());
  for (const Index i : h.points())
    m.max_force = std::max(m.max_force, point<D>(force.data(), i).template lpNorm<Eigen::Infinity>());
  m.stress = pre_stress == PreStress::kept ? stress_of<D>(system, x.data()).stress : Mat<D>(Mat<D>::Zero());

  // Where symmetry makes all forces vanish, they are rounding errors of sums of large products.
  const Real rounding =
      100 * epsilon * (moves_freely ? of_strain : bound) * length * std::sqrt(static_cast<Real>(h.size()));
  // In a crystal these forces come from the rest of the forces in the minimum, amplified by soft modes.
  const Real noise = 100 * rounding, scale = largest_column(strain.mixed),
             floor = scale > noise ? std::max(relative_tolerance * scale, rounding) : noise;
  Eigen::MatrixXd u = Eigen::MatrixXd::Zero(h.size(), D * D);
  if (!moves_freely) {
    SemidefiniteSolver<D> solver(h, relative_shift * bound);
    for (int k = 0; k < D * D; ++k) u.col(k) = -solver.solve(strain.mixed.col(k), floor);
  }
  const Eigen::MatrixXd hu = h.matrix() * u;
  const Real left = largest_column(hu + strain.mixed);
  m.residual = scale > noise ? left / scale : 0;
  if (!(left <= std::max(accepted * scale, noise)))
    throw NumericalError(
        "the response to strains was not found: residual {:.3g} of the forces; a strain excites a mode without "
        "stiffness, so that this packing has no elastic moduli",
        m.residual);
  m.affine = strain.affine / volume;
  // The error of this form is quadratic in the error of u.
  const typename Moduli<D>::Square cross = strain.mixed.transpose().lazyProduct(u);
  m.tangent = m.affine + (cross + cross.transpose() + u.transpose().lazyProduct(hu)) / volume;
  return m;
}

template <int D>
Moduli<D> backbone_moduli(ParticleSystem<D>& system, std::span<const Real> x, const ContactNetwork<D>& network) {
  if (network.backbone == 0) {
    Moduli<D> none;
    none.tangent = none.affine = Moduli<D>::Square::Constant(std::numeric_limits<Real>::quiet_NaN());
    none.stress.setZero();
    return none;
  }
  const Backbone<D> backbone(system, network.rattlers);
  return moduli<D>(system, x);
}

template struct Moduli<2>;
template struct Moduli<3>;
template Moduli<2> moduli(ParticleSystem<2>&, std::span<const Real>, PreStress);
template Moduli<3> moduli(ParticleSystem<3>&, std::span<const Real>, PreStress);
template Moduli<2> backbone_moduli(ParticleSystem<2>&, std::span<const Real>, const ContactNetwork<2>&);
template Moduli<3> backbone_moduli(ParticleSystem<3>&, std::span<const Real>, const ContactNetwork<3>&);

}  // namespace pliant
