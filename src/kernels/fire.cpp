#include <pliant/base/simd.h>
#include <pliant/kernels/fire.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace pliant {
namespace {

using simd::Real2;
using simd::Real4;

/// The sum of terms 0 to n − 1 from the sums of every fourth of them up to the last four, and of the terms that are
/// left.
template <class Term>
PLIANT_INLINE Real sum_of(Real4 lanes, std::size_t n, Term&& term) {
  Real2 pair = simd::low(lanes) + simd::high(lanes);
  if (n % 4 >= 2) pair += Real2{term(n / 4 * 4), term(n / 4 * 4 + 1)};
  const Real sum = pair[0] + pair[1];
  return n % 2 == 0 ? sum : sum + term(n - 1);
}

PLIANT_INLINE Real largest_of(Real4 lanes) {
  return std::max(std::max(lanes[0], lanes[1]), std::max(lanes[2], lanes[3]));
}

}  // namespace

PLIANT_MULTIVERSION FireForces fire_forces(std::size_t n, const Real* f, const Real* v) {
  constexpr std::size_t part = 4096;  // stays in the first-level cache for its second loop
  FireForces sums;
  Real4 power{};
  // Squares are summed in units of the largest force so far.
  Real unit = 0, inverse = 1, squares = 0;
  for (std::size_t first = 0; first < n; first += part) {
    const std::size_t count = std::min(part, n - first);
    const Real* const here = f + first;
    std::size_t i = 0;
    Real4 most{};
    for (; i + 4 <= count; i += 4) {
      const Real4 force = simd::load4(here + i);
      power += force * simd::load4(v + first + i);
      most = simd::max(most, simd::abs(force));
    }
    Real largest = largest_of(most);
    for (; i < count; ++i) largest = std::max(largest, std::abs(here[i]));
    if (largest > unit) {
      squares *= unit / largest * (unit / largest);
      constexpr Real huge = std::numeric_limits<Real>::max();
      inverse = std::min(1 / largest, huge);
      unit = inverse < huge ? largest : 1 / huge;
    }
    sums.largest = std::max(sums.largest, largest);
    Real4 lanes{};
    for (i = 0; i + 4 <= count; i += 4) {
      const Real4 scaled = simd::load4(here + i) * inverse;
      lanes += scaled * scaled;
    }
    squares += sum_of(lanes, count,
                      [&](std::size_t k) PLIANT_INLINE_LAMBDA { return here[k] * inverse * (here[k] * inverse); });
  }
  sums.norm = unit * std::sqrt(squares);
  sums.power = sum_of(power, n, [&](std::size_t k) PLIANT_INLINE_LAMBDA { return f[k] * v[k]; });
  return sums;
}

PLIANT_MULTIVERSION Real fire_kick(std::size_t n, Real h, const Real* f, Real* v) {
  Real4 lanes{};
  std::size_t i = 0;
  for (; i + 4 <= n; i += 4) {
    const Real4 velocity = simd::load4(v + i) + h * simd::load4(f + i);
    simd::store4(v + i, velocity);
    lanes += velocity * velocity;
  }
  for (; i < n; ++i) v[i] += h * f[i];
  return sum_of(lanes, n, [&](std::size_t k) PLIANT_INLINE_LAMBDA { return v[k] * v[k]; });
}

PLIANT_MULTIVERSION Real fire_turn(std::size_t n, Real kept, Real turned, const Real* f, Real* v) {
  Real4 most{};
  std::size_t i = 0;
  for (; i + 4 <= n; i += 4) {
    const Real4 velocity = kept * simd::load4(v + i) + turned * simd::load4(f + i);
    simd::store4(v + i, velocity);
    most = simd::max(most, simd::abs(velocity));
  }
  Real largest = largest_of(most);
  for (; i < n; ++i) {
    v[i] = kept * v[i] + turned * f[i];
    largest = std::max(largest, std::abs(v[i]));
  }
  return largest;
}

PLIANT_MULTIVERSION void add_multiple(std::size_t n, Real h, const Real* v, Real* x) {
  std::size_t i = 0;
  for (; i + 4 <= n; i += 4) simd::store4(x + i, simd::load4(x + i) + h * simd::load4(v + i));
  for (; i < n; ++i) x[i] += h * v[i];
}

PLIANT_MULTIVERSION Real dot(std::size_t n, const Real* a, const Real* b) {
  Real4 lanes{};
  for (std::size_t i = 0; i + 4 <= n; i += 4) lanes += simd::load4(a + i) * simd::load4(b + i);
  return sum_of(lanes, n, [&](std::size_t k) PLIANT_INLINE_LAMBDA { return a[k] * b[k]; });
}

}  // namespace pliant
