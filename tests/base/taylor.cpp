// The helper that checks derivatives rejects derivatives that it cannot resolve.
#include <catch2/catch.hpp>

#include "support/taylor.h"

namespace pliant::test::taylor_test {

namespace {

/// U = x³/3 + parts, whose gradient is off by `wrong`.
Functional cubic(Real wrong, Real parts) {
  return {[parts](const VectorXd& x) { return x[0] * x[0] * x[0] / 3 + parts; },
          [wrong](const VectorXd& x) { return VectorXd(VectorXd::Constant(1, x[0] * x[0] + wrong)); },
          [](const VectorXd& x) { return MatrixXd(MatrixXd::Constant(1, 1, 2 * x[0])); }, parts};
}

}  // namespace

TEST_CASE("an order of a remainder that is below rounding is none, unless an error would be above it") {
  const VectorXd x = VectorXd::Constant(1, 0.7), p = VectorXd::Ones(1);
  CHECK(gradient_order(cubic(0, 1), x, p, 1e-3) == Approx(2).margin(0.05));
  CHECK(hessian_order(cubic(0, 1), x, p, 1e-3) == Approx(2).margin(0.05));
  CHECK(gradient_order(cubic(0.1, 1), x, p, 1e-3) == Approx(1).margin(0.05));
  // Rounding hides the remainder, but not an error of the gradient.
  CHECK(gradient_order(cubic(0, 1), x, p, 1e-8) > 1e6);
  CHECK(gradient_order(cubic(0.1, 1), x, p, 1e-8) == Approx(1).margin(0.05));
  // The rounding of a large constant hides both.
  for (const Real wrong : {0.0, 0.1}) CHECK_FALSE(gradient_order(cubic(wrong, 1e6), x, p, 1e-8) > 0);
}

}  // namespace pliant::test::taylor_test
