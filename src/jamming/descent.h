// Problem and result of minimisers that use a Hessian: L-BFGS (quasi_newton.h) and Newton's method (trust_region.h).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>

#include <pliant/base/petsc.h>
#include <pliant/system/fire.h>

namespace pliant {

/// A positive definite matrix near the Hessian of an energy.
class ApproximateHessian {
 public:
  virtual ~ApproximateHessian() = default;
  /// Computes factors at x; false if there are none.
  virtual bool factorise(const Real* x) = 0;
  /// b becomes H⁻¹ b.
  virtual void solve(Eigen::VectorXd& b) = 0;
};

/// With the exact Hessian, too, which may have negative eigenvalues.
class ExactHessian : public ApproximateHessian {
 public:
  /// Gives a sequential AIJ matrix the entries of the Hessian at the coordinates of the last factorise().
  virtual void fill(::Mat matrix) const = 0;
};

struct DescentOptions {
  Real force_tolerance = 1e-10;  ///< as of FireOptions
  std::int64_t max_evaluations = 10000;
  Real max_move = 0.1;                   ///< longest move of a coordinate per iteration
  std::function<bool()> stop = nullptr;  ///< ends the minimisation if it returns true; called now and then
};

struct DescentResult {
  bool converged = false, stopped = false;
  std::int64_t iterations = 0, evaluations = 0;
  Real max_force = 0;  ///< at the final x
};

}  // namespace pliant
