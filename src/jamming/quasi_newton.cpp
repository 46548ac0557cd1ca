#include <pliant/jamming/quasi_newton.h>

#include <algorithm>
#include <cmath>

#include <pliant/kernels/fire.h>

namespace pliant {
namespace {

/// The last pairs of a step and the change of the gradient, in a ring.
class Curvatures {
 public:
  explicit Curvatures(Eigen::Index n) : step_(n, most), change_(n, most) {}
  void clear() { count_ = 0; }
  void add(const Eigen::VectorXd& step, const Eigen::VectorXd& change) {
    const Real product = step.dot(change);
    // Without a clearly positive curvature the matrix would not remain positive definite.
    if (!(product > 1e-10 * step.norm() * change.norm())) return;
    const Eigen::Index k = place(count_++);
    step_.col(k) = step;
    change_.col(k) = change;
    inverse_[k] = 1 / product;
  }
  /// The direction −H⁻¹ g, H the approximate Hessian with these pairs.
  void direction(const Eigen::VectorXd& g, ApproximateHessian& hessian, Eigen::VectorXd& d) {
    const Eigen::Index first = std::max<Eigen::Index>(0, count_ - most);
    const auto n = static_cast<std::size_t>(g.size());
    d = -g;
    for (Eigen::Index i = count_ - 1; i >= first; --i) {
      const Eigen::Index k = place(i);
      part_[k] = inverse_[k] * dot(n, step_.col(k).data(), d.data());
      add_multiple(n, -part_[k], change_.col(k).data(), d.data());
    }
    hessian.solve(d);
    for (Eigen::Index i = first; i < count_; ++i) {
      const Eigen::Index k = place(i);
      const Real part = part_[k] - inverse_[k] * dot(n, change_.col(k).data(), d.data());
      add_multiple(n, part, step_.col(k).data(), d.data());
    }
  }

 private:
  static constexpr Eigen::Index most = 20;
  static Eigen::Index place(Eigen::Index i) { return i % most; }
  Eigen::MatrixXd step_, change_;
  Real inverse_[most] = {}, part_[most] = {};
  Eigen::Index count_ = 0;
};

}  // namespace

DescentResult quasi_newton(std::span<Real> x_in, const EnergyAndForce& energy_and_force, ApproximateHessian& hessian,
                           const DescentOptions& o) {
  constexpr int renewal = 20, most_trials = 20;
  const auto n = static_cast<Eigen::Index>(x_in.size());
  Eigen::Map<Eigen::VectorXd> x(x_in.data(), n);
  Eigen::VectorXd g(n), d(n), next(n), next_g(n);
  Curvatures curvatures(n);
  DescentResult result;
  const auto evaluate = [&](const Real* at, Eigen::VectorXd& gradient) {
    ++result.evaluations;
    const Real energy = energy_and_force(at, gradient.data());
    gradient = -gradient;
    return energy;
  };
  Real energy = evaluate(x.data(), g);
  int since = renewal;
  const auto renew = [&] {
    since = 0;
    curvatures.clear();
    return hessian.factorise(x.data());
  };
  while (true) {
    result.max_force = g.cwiseAbs().maxCoeff();
    result.converged = result.max_force <= o.force_tolerance;
    // Many trials for each step: at a saddle point, or where rounding errors hide the slope.
    const bool stuck = result.evaluations > 10 * result.iterations + 100;
    if (result.converged || stuck || result.evaluations >= o.max_evaluations) return result;
    if (o.stop && result.iterations % 10 == 0 && o.stop()) {
      result.stopped = true;
      return result;
    }
    if (since >= renewal && !renew()) return result;
    curvatures.direction(g, hessian, d);
    const Real slope = g.dot(d);
    Real part = std::min(Real(1), o.max_move / d.cwiseAbs().maxCoeff());
    bool found = false;
    for (int trial = 0; slope < 0 && !found && trial < most_trials; ++trial) {
      next = x + part * d;
      const Real next_energy = evaluate(next.data(), next_g), next_slope = next_g.dot(d);
      // Near the minimum the energy changes by less than its rounding errors, the slope does not. It may even stay the
      // same, up to a contact that the step would close.
      found = next != x && (next_energy <= energy + 1e-4 * part * slope ||
                            (next_slope < 0.5 * std::abs(slope) && next_energy <= energy + 1e-12 * std::abs(energy)));
      if (found)
        energy = next_energy;
      else
        part *= next_slope > slope ? std::clamp(slope / (slope - next_slope), 0.1, 0.5) : 0.5;
    }
    if (!found) {
      if (since == 0) return result;
      since = renewal;
      continue;
    }
    d = next - x;
    g = next_g - g;
    curvatures.add(d, g);
    x = next;
    g = next_g;
    ++result.iterations;
    ++since;
  }
}

}  // namespace pliant
