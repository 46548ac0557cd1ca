#include <pliant/kernels/verlet.h>

#include <cmath>
#include <limits>

#include <pliant/base/multiversion.h>
#include <pliant/kernels/finite.h>

namespace pliant {
namespace {

// One formula for each, so that all passes give the same bits.
PLIANT_INLINE Real drifted(Real h, Real x, Real v, Real predicted) { return x + 0.5 * h * (v + predicted); }
PLIANT_INLINE Real predict(Real h, Real v, Real a) { return v + h * a; }
PLIANT_INLINE Real kicked(Real h, Real v, Real a, Real predicted) { return 0.5 * (v + predicted) + 0.5 * h * a; }

template <int D>
PLIANT_INLINE Real farthest2(std::size_t points, const Real* __restrict__ x, const Real* __restrict__ r) {
  Real largest = 0;
  std::int64_t unknown = 0;  // not bool: as wide as the numbers, which vectorises
#pragma omp simd reduction(max : largest) reduction(| : unknown)
  for (std::size_t i = 0; i < points; ++i) {
    Real moved2 = 0;
    for (int k = 0; k < D; ++k) moved2 += (x[i * D + k] - r[i * D + k]) * (x[i * D + k] - r[i * D + k]);
    largest = largest > moved2 ? largest : moved2;
    unknown |= moved2 == moved2 ? 0 : 1;
  }
  return unknown == 0 ? largest : std::numeric_limits<Real>::infinity();
}

PLIANT_MULTIVERSION Real farthest2_2d(std::size_t points, const Real* x, const Real* reference) {
  return farthest2<2>(points, x, reference);
}
PLIANT_MULTIVERSION Real farthest2_3d(std::size_t points, const Real* x, const Real* reference) {
  return farthest2<3>(points, x, reference);
}

}  // namespace

PLIANT_MULTIVERSION void verlet_predict(std::size_t n, Real h, const Real* v, const Real* a,
                                        Real* __restrict__ predicted) {
  for (std::size_t i = 0; i < n; ++i) predicted[i] = predict(h, v[i], a[i]);
}

PLIANT_MULTIVERSION Real verlet_drift(std::size_t n, Real h, const Real* x, const Real* __restrict__ v,
                                      const Real* __restrict__ predicted, Real* x_next) {
  Real largest = 0;
#pragma omp simd reduction(max : largest)
  for (std::size_t i = 0; i < n; ++i) {
    const Real next = drifted(h, x[i], v[i], predicted[i]), change = std::abs(next - x[i]);
    x_next[i] = next;
    largest = largest > change ? largest : change;
  }
  return largest;
}

PLIANT_MULTIVERSION bool verlet_kick(std::size_t n, Real h, Real* __restrict__ v, const Real* __restrict__ a,
                                     Real* __restrict__ predicted) {
  FiniteCheck check;
  for (std::size_t i = 0; i < n; ++i) {
    check.add(a[i]);
    v[i] = kicked(h, v[i], a[i], predicted[i]);
    predicted[i] = predict(h, v[i], a[i]);
  }
  return check.all_finite();
}

PLIANT_MULTIVERSION Real verlet_kick_drift(std::size_t n, Real h, const Real* __restrict__ x, Real* __restrict__ v,
                                           const Real* __restrict__ a, const Real* __restrict__ predicted,
                                           Real* __restrict__ x_next, Real* __restrict__ predicted_next) {
  Real largest = 0;
#pragma omp simd reduction(max : largest)
  for (std::size_t i = 0; i < n; ++i) {
    v[i] = kicked(h, v[i], a[i], predicted[i]);
    predicted_next[i] = predict(h, v[i], a[i]);
    x_next[i] = drifted(h, x[i], v[i], predicted_next[i]);
    const Real change = std::abs(x_next[i] - x[i]);
    largest = largest > change ? largest : change;
  }
  return largest;
}

PLIANT_MULTIVERSION WeightedSquares weighted_squares(std::size_t n, Real factor, const Real* f, const Real* f_old,
                                                     const Real* y, const Real* y_old, const Real* absolute,
                                                     const Real* relative) {
  Real sum = 0, largest = 0;
#pragma omp simd reduction(+ : sum) reduction(max : largest)
  for (std::size_t i = 0; i < n; ++i) {
    const Real a = std::abs(y[i]), b = std::abs(y_old[i]);
    const Real error = factor * (f[i] - f_old[i]) / (absolute[i] + relative[i] * (a > b ? a : b));
    sum += error * error;
    largest = largest > error * error ? largest : error * error;
  }
  return {sum, largest};
}

template <int D>
Real farthest(std::size_t points, const Real* x, const Real* reference) {
  return std::sqrt(D == 2 ? farthest2_2d(points, x, reference) : farthest2_3d(points, x, reference));
}

template Real farthest<2>(std::size_t, const Real*, const Real*);
template Real farthest<3>(std::size_t, const Real*, const Real*);

}  // namespace pliant
