// L-BFGS with an approximate Hessian: minima of an energy, near which it needs fewer evaluations than FIRE.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>

#include <pliant/system/fire.h>

namespace pliant {

/// A positive definite matrix near the Hessian of an energy.
class ApproximateHessian {
 public:
  virtual ~ApproximateHessian() = default;
  /// At coordinates; false if there is none.
  virtual bool factorise(const Real* x) = 0;
  /// b becomes H⁻¹ b.
  virtual void solve(Eigen::VectorXd& b) = 0;
};

struct QuasiNewtonOptions {
  Real force_tolerance = 1e-10;  ///< as of FireOptions
  std::int64_t max_evaluations = 10000;
  Real max_move = 0.1;                   ///< longest move of a coordinate per iteration
  std::function<bool()> stop = nullptr;  ///< ends the minimisation if it returns true; called now and then
};

struct QuasiNewtonResult {
  bool converged = false, stopped = false;
  std::int64_t iterations = 0, evaluations = 0;
  Real max_force = 0;  ///< at the final x
};

/// Minimises an energy over x, in place. The method does not converge where the energy is too rough or its Hessian
/// fails, and then leaves x at the lowest energy found. Method: limited-memory BFGS (D. C. Liu and J. Nocedal, Math.
/// Program. 45, 503 (1989)), which begins with the approximate Hessian and replaces it after a number of iterations.
QuasiNewtonResult quasi_newton(std::span<Real> x, const EnergyAndForce& energy_and_force, ApproximateHessian& hessian,
                               const QuasiNewtonOptions& options);

}  // namespace pliant
