// The longest stable step of an explicit method.
#pragma once

#include <complex>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <pliant/model/force_field.h>

namespace pliant {

/// The fastest motion that a step has to follow, in 1/t0.
struct FastestRates {
  Real oscillation = 0;  ///< largest ω of ẍ + γ ẋ + ω² x = 0
  Real drag = 0;         ///< γ, by which every oscillation is damped at least
  Real decay = 0;        ///< largest r of v̇ = −r v, or of ẋ = −r x
};

/// R(z) of an explicit one-step method: a step of length h multiplies the solution of ẏ = λ y by R(λ h).
/// E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 1996, section IV.2.
class StabilityPolynomial {
 public:
  /// coefficients: of z⁰, z¹, …
  explicit StabilityPolynomial(std::vector<Real> coefficients) : coefficients_(std::move(coefficients)) {}
  /// R(z) = 1 + Σ z^k bᵀ A^(k−1) 1. a: strictly lower triangle, row by row [stages²]; b: [stages].
  static StabilityPolynomial of_tableau(std::span<const Real> a, std::span<const Real> b);

  std::complex<Real> operator()(std::complex<Real> z) const;

  /// The largest Y such that |R(iy)| ≤ 1 for 0 ≤ y ≤ Y: undamped oscillations are stable for ω h ≤ Y.
  Real imaginary_interval() const;
  /// The largest X such that |R(−x)| ≤ 1 for 0 ≤ x ≤ X: decays are stable for r h ≤ X.
  Real real_interval() const;
  /// The longest step at which no oscillation up to rates.oscillation and no decay up to rates.decay grows; 0 where
  /// every step makes oscillations grow, infinity where nothing moves.
  Real longest_step(const FastestRates& rates) const;

 private:
  Real longest_damped_step(const FastestRates& rates) const;

  std::vector<Real> coefficients_;
};

/// As above, for velocity Verlet, which predicts the velocities that forces depend on: ω² h² + 4 r h ≤ 4, if the
/// fastest oscillation also has the fastest decay.
inline Real longest_verlet_step(const FastestRates& rates) {
  return CriticalStep::limit({.stiffness = square(rates.oscillation), .damping = rates.decay});
}

}  // namespace pliant
