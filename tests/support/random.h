// Reproducible random numbers for state generators.
#pragma once

#include <Eigen/Dense>

#include <pliant/base/rng.h>
#include <pliant/base/types.h>

namespace pliant::test {

class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(seed) {}
  /// Uniform in [low, high).
  Real operator()(Real low, Real high) { return low + (high - low) * rng::uniform(seed_, 0, counter_++); }
  /// Uniform in 0 … n−1.
  Index below(Index n) { return static_cast<Index>((*this)(0, n)); }
  /// Direction, uniform on the sphere.
  template <int D>
  Vec<D> unit() {
    Vec<D> r;
    for (int k = 0; k < D; ++k) r[k] = rng::normal(seed_, 1, counter_++);
    return r.normalized();
  }

 private:
  std::uint64_t seed_, counter_ = 0;
};

/// Unit vector in n dimensions, no component of which is preferred.
inline Eigen::VectorXd random_direction(Random& random, Index n) {
  Eigen::VectorXd p(n);
  for (Index k = 0; k < n; ++k) p[k] = random(-1, 1);
  return p.normalized();
}

}  // namespace pliant::test
