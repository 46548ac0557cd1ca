// Finite differences: the order at which a Taylor remainder falls, and the agreement of one-sided derivatives.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include <pliant/base/types.h>

#include "support/order.h"

namespace pliant::test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A scalar function of many variables with its first two derivatives.
struct Functional {
  std::function<Real(const VectorXd&)> energy;
  std::function<VectorXd(const VectorXd&)> gradient;
  std::function<MatrixXd(const VectorXd&)> hessian;
  Real parts = 0;  ///< size of energies that may cancel in the sum: their rounding stays
};

/// Slope of log(error) against log(h) over the errors above `floor` (rounding). Where at most one of them is above:
/// infinity if an error of a thousandth in the `tested` term, of lower order at the first h, would have been;
/// otherwise nothing could be seen: NaN, which is above no order.
inline Real observed_order(const std::vector<Real>& h, const std::vector<Real>& error, Real floor = 0,
                           Real tested = 0) {
  OrderFit fit;
  for (std::size_t k = 0; k < h.size(); ++k)
    if (!(error[k] <= floor)) {
      fit.steps.push_back(h[k]);
      fit.errors.push_back(error[k]);
    }
  if (fit.errors.size() >= 2) return fit.slope();
  return tested > 1e3 * floor ? std::numeric_limits<Real>::infinity() : std::numeric_limits<Real>::quiet_NaN();
}

/// Steps h0, h0/2, h0/4, …
inline std::vector<Real> halvings(Real h0, int count) {
  std::vector<Real> h(count);
  for (int k = 0; k < count; ++k) h[k] = std::ldexp(h0, -k);
  return h;
}

/// Rounding of gradients near x: they change by |H| |x| ε when x is rounded. H may live on one side of x only.
inline Real gradient_rounding(const Functional& f, const VectorXd& x, const VectorXd& p, Real h0) {
  const Real curvature = std::max({f.hessian(x).norm(), f.hessian(x + h0 * p).norm(), f.hessian(x - h0 * p).norm()});
  return 50 * std::numeric_limits<Real>::epsilon() * (f.gradient(x).norm() + curvature * x.norm());
}
inline Real energy_rounding(const Functional& f, const VectorXd& x, const VectorXd& p, Real h0) {
  return 50 * std::numeric_limits<Real>::epsilon() *
             (std::abs(f.energy(x)) + f.parts + f.gradient(x).norm() * x.norm()) +
         h0 * gradient_rounding(f, x, p, h0);
}

/// Order of |U(x + h p) − U(x) − h g·p|: 2 where g = ∇U is Lipschitz; 1 if g is wrong.
inline Real gradient_order(const Functional& f, const VectorXd& x, const VectorXd& p, Real h0) {
  const Real u = f.energy(x);
  const VectorXd g = f.gradient(x);
  const std::vector<Real> h = halvings(h0, 5);
  std::vector<Real> error;
  for (const Real step : h) error.push_back(std::abs(f.energy(x + step * p) - u - step * g.dot(p)));
  return observed_order(h, error, energy_rounding(f, x, p, h0), h0 * std::abs(g.dot(p)));
}

/// Order of |g(x + h p) − g(x) − h H p|: 2 where H is Lipschitz, 1 where H jumps at x (or is wrong). Where H = 0 it is
/// the gradient that must not change.
inline Real hessian_order(const Functional& f, const VectorXd& x, const VectorXd& p, Real h0) {
  const VectorXd g = f.gradient(x);
  const MatrixXd hessian = f.hessian(x);
  const std::vector<Real> h = halvings(h0, 5);
  std::vector<Real> error;
  for (const Real step : h) error.push_back((f.gradient(x + step * p) - g - step * (hessian * p)).norm());
  return observed_order(h, error, gradient_rounding(f, x, p, h0),
                        hessian.norm() > 0 ? h0 * (hessian * p).norm() : g.norm());
}

/// Derivatives from the two sides of x along p.
struct Sides {
  Real gradient_jump_order;  ///< of |g(x + h p) − g(x − h p)|: 1 where g is continuous, 0 where it jumps
  Real forward, backward;    ///< |H p − one-sided difference of g| relative to |H|, on the side of +p and of −p
  Real hessian_jump;         ///< |H p| difference across x relative to |H|: 0 if x is not a boundary for this direction
};

inline Sides compare_sides(const Functional& f, const VectorXd& x, const VectorXd& p, Real h0) {
  Sides sides;
  const std::vector<Real> h = halvings(h0, 5);
  std::vector<Real> jump;
  for (const Real step : h) jump.push_back((f.gradient(x + step * p) - f.gradient(x - step * p)).norm());
  sides.gradient_jump_order = observed_order(h, jump, gradient_rounding(f, x, p, h0));
  const Real eta = h0 / 16;
  const auto side = [&](Real sign, VectorXd& hp) {
    // Central difference about x ± 2 η p with points on this side.
    const VectorXd y = x + sign * 2 * eta * p;
    const MatrixXd hessian = f.hessian(y);
    hp = hessian * p;
    const VectorXd difference = (f.gradient(y + eta * p) - f.gradient(y - eta * p)) / (2 * eta);
    return (hp - difference).norm() / std::max(hessian.norm(), f.hessian(x - sign * 2 * eta * p).norm());
  };
  VectorXd above, below;
  sides.forward = side(1, above);
  sides.backward = side(-1, below);
  sides.hessian_jump = (above - below).norm() / std::max(above.norm(), below.norm());
  return sides;
}

}  // namespace pliant::test
