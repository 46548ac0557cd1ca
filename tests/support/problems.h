// Problems with exact solutions, with forces that depend on the time and on the velocities.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>
#include <utility>
#include <vector>

#include <pliant/base/petsc.h>
#include <pliant/model/state.h>
#include <pliant/system/equation.h>

namespace pliant::test {

/// A system from a function, counting its evaluations.
class FunctionSystem : public SecondOrderSystem {
 public:
  using Function = std::function<void(Real, const Real*, const Real*, Real*)>;
  FunctionSystem(std::size_t n, Function function) : n_(n), function_(std::move(function)) {}
  std::size_t size() const override { return n_; }
  void acceleration(Real t, const Real* x, const Real* v, Real* a) override {
    ++evaluations;
    function_(t, x, v, a);
  }
  std::int64_t evaluations = 0;

 private:
  std::size_t n_;
  Function function_;
};

/// y = [x; v] at time t, given y at time t0.
using Exact = std::function<Eigen::VectorXd(Real t0, const Eigen::VectorXd& y0, Real t)>;

struct Problem {
  std::string name;
  std::size_t n;
  FunctionSystem::Function function;
  Exact exact;
  Eigen::VectorXd start;

  FunctionSystem system() const { return {n, function}; }
  State state() const {
    State s(static_cast<Index>(n), 1);
    const auto half = start.begin() + static_cast<std::ptrdiff_t>(n);
    std::copy(start.begin(), half, s.x().begin());
    std::copy(half, start.end(), s.v().begin());
    return s;
  }
};

/// [x; v]
inline Eigen::VectorXd y_of(const State& s) {
  Eigen::VectorXd y(2 * static_cast<Eigen::Index>(s.size()));
  std::copy(s.v().begin(), s.v().end(), std::copy(s.x().begin(), s.x().end(), y.begin()));
  return y;
}

inline double error_of(const State& s, const Eigen::VectorXd& exact) { return (y_of(s) - exact).norm(); }

/// Four masses in a chain with springs, non-symmetric damping by the neighbours' velocities, and a periodic drive:
/// ẍ = −K x − C v + b cos(ω t), exact through the exponential of the autonomous system [x; v; cos; sin].
inline Problem driven_chain() {
  constexpr int n = 4;
  constexpr Real omega = 1.3;
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n, n), c = k;
  Eigen::VectorXd b(n);
  b << 1, 0, -0.5, 0.25;
  for (int i = 0; i < n; ++i) {
    k(i, i) = 2 + 0.1 * i;
    c(i, i) = 0.3;
    if (i > 0) k(i, i - 1) = k(i - 1, i) = -1, c(i, i - 1) = -0.25, c(i - 1, i) = 0.1;
  }
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(2 * n + 2, 2 * n + 2);
  m.block(0, n, n, n).setIdentity();
  m.block(n, 0, n, n) = -k;
  m.block(n, n, n, n) = -c;
  m.block(n, 2 * n, n, 1) = b;
  m(2 * n, 2 * n + 1) = -omega;
  m(2 * n + 1, 2 * n) = omega;
  Problem p{"driven chain", n, {}, {}, Eigen::VectorXd(2 * n)};
  p.function = [=](Real t, const Real* x, const Real* v, Real* a) {
    Eigen::Map<Eigen::VectorXd>(a, n) = -k * Eigen::Map<const Eigen::VectorXd>(x, n) -
                                        c * Eigen::Map<const Eigen::VectorXd>(v, n) + b * std::cos(omega * t);
  };
  p.exact = [=](Real t0, const Eigen::VectorXd& y0, Real t) {
    Eigen::VectorXd z(2 * n + 2);
    z << y0, std::cos(omega * t0), std::sin(omega * t0);
    return Eigen::VectorXd(((m * (t - t0)).exp() * z).head(2 * n));
  };
  p.start << 1, -0.5, 0.2, 0, 0, 0.3, -1, 0.5;
  return p;
}

/// x₀ = sin t, x₁ = cos(1.5 t) made the solution of coupled, nonlinear equations with a force cubic in the velocities.
inline Problem manufactured() {
  const auto solution = [](Real t) {
    Eigen::VectorXd y(4);
    y << std::sin(t), std::cos(1.5 * t), std::cos(t), -1.5 * std::sin(1.5 * t);
    return y;
  };
  const auto law = [](const Real* x, const Real* v, Real* g) {
    g[0] = -x[0] * x[1] * x[1] - 0.2 * v[0] * v[0] * v[0] + 0.3 * v[1];
    g[1] = -std::sin(x[1]) - 0.1 * v[1] * v[0] * v[0] - 0.4 * x[0] * v[1];
  };
  Problem p{"manufactured", 2, {}, {}, solution(0)};
  p.function = [=](Real t, const Real* x, const Real* v, Real* a) {
    const Eigen::VectorXd y = solution(t);
    Real exact[2], g[2];
    law(y.data(), y.data() + 2, exact);
    law(x, v, g);
    a[0] = -std::sin(t) + g[0] - exact[0];
    a[1] = -2.25 * std::cos(1.5 * t) + g[1] - exact[1];
  };
  p.exact = [=](Real, const Eigen::VectorXd&, Real t) { return solution(t); };
  return p;
}

/// Kepler orbit of eccentricity 0.3 from its pericentre, period 2π.
inline Problem kepler() {
  constexpr Real e = 0.3;
  const auto solution = [](Real t) {
    Real u = t;
    for (int i = 0; i < 50; ++i) u -= (u - e * std::sin(u) - t) / (1 - e * std::cos(u));
    const Real b = std::sqrt(1 - e * e), rate = 1 / (1 - e * std::cos(u));
    Eigen::VectorXd y(4);
    y << std::cos(u) - e, b * std::sin(u), -std::sin(u) * rate, b * std::cos(u) * rate;
    return y;
  };
  Problem p{"Kepler", 2, {}, {}, solution(0)};
  p.function = [](Real, const Real* x, const Real*, Real* a) {
    const Real r = std::hypot(x[0], x[1]);
    for (int i = 0; i < 2; ++i) a[i] = -x[i] / (r * r * r);
  };
  p.exact = [=](Real, const Eigen::VectorXd&, Real t) { return solution(t); };
  return p;
}

/// PETSc options for the life of the object, e.g. PetscOptionScope("-ts_type rk -ts_rk_type 3bs"), in place of all
/// others.
class PetscOptionScope {
 public:
  explicit PetscOptionScope(const std::string& text) {
    petsc_check(PetscOptionsClear(nullptr));
    petsc_check(PetscOptionsInsertString(nullptr, text.c_str()));
  }
  ~PetscOptionScope() { (void)PetscOptionsClear(nullptr); }
  PetscOptionScope(const PetscOptionScope&) = delete;
  PetscOptionScope& operator=(const PetscOptionScope&) = delete;
};

}  // namespace pliant::test
