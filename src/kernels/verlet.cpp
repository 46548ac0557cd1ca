#include <pliant/kernels/verlet.h>

#include <cmath>

#include <pliant/kernels/multiversion.h>

namespace pliant {
namespace {

struct Prediction {
  Real x, v;
};

PLIANT_INLINE Prediction predict(Real h, Real x, Real v, Real a) {
  const Real v_half = v + 0.5 * h * a;
  return {x + h * v_half, v_half + 0.5 * h * a};
}

PLIANT_INLINE Real complete(Real h, Real v, Real a, Real v_predicted) { return 0.5 * (v + v_predicted) + 0.5 * h * a; }

template <int D>
PLIANT_INLINE bool within(std::size_t points, Real limit, const Real* __restrict__ x, const Real* __restrict__ r) {
  const Real limit2 = limit * limit;
  std::int64_t outside = 0;  // not bool: as wide as the numbers, which vectorises
  for (std::size_t i = 0; i < points; ++i) {
    Real moved2 = 0;
    for (int k = 0; k < D; ++k) moved2 += (x[i * D + k] - r[i * D + k]) * (x[i * D + k] - r[i * D + k]);
    outside |= moved2 <= limit2 ? 0 : 1;
  }
  return outside == 0;
}

PLIANT_MULTIVERSION bool within_2d(std::size_t points, Real limit, const Real* x, const Real* reference) {
  return within<2>(points, limit, x, reference);
}
PLIANT_MULTIVERSION bool within_3d(std::size_t points, Real limit, const Real* x, const Real* reference) {
  return within<3>(points, limit, x, reference);
}

}  // namespace

PLIANT_MULTIVERSION void verlet_predict(std::size_t n, Real h, const Real* x, const Real* __restrict__ v,
                                        const Real* __restrict__ a, Real* x_next, Real* __restrict__ v_next) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const Prediction p = predict(h, x[i], v[i], a[i]);
    x_next[i] = p.x;
    v_next[i] = p.v;
  }
}

PLIANT_MULTIVERSION void verlet_complete(std::size_t n, Real h, const Real* __restrict__ x, Real* __restrict__ v,
                                         const Real* __restrict__ a, const Real* __restrict__ v_predicted,
                                         Real* __restrict__ x_next, Real* __restrict__ v_next) {
  for (std::size_t i = 0; i < n; ++i) {
    v[i] = complete(h, v[i], a[i], v_predicted[i]);
    const Prediction p = predict(h, x[i], v[i], a[i]);
    x_next[i] = p.x;
    v_next[i] = p.v;
  }
}

PLIANT_MULTIVERSION void verlet_complete(std::size_t n, Real h, Real* __restrict__ v, const Real* __restrict__ a,
                                         const Real* __restrict__ v_predicted) {
  for (std::size_t i = 0; i < n; ++i) v[i] = complete(h, v[i], a[i], v_predicted[i]);
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
bool all_within(std::size_t points, Real limit, const Real* x, const Real* reference) {
  return D == 2 ? within_2d(points, limit, x, reference) : within_3d(points, limit, x, reference);
}

template bool all_within<2>(std::size_t, Real, const Real*, const Real*);
template bool all_within<3>(std::size_t, Real, const Real*, const Real*);

}  // namespace pliant
