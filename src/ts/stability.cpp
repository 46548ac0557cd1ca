#include <pliant/ts/stability.h>

#include <algorithm>
#include <cmath>

namespace pliant {
namespace {

constexpr Real infinity = std::numeric_limits<Real>::infinity();
constexpr Real farthest = 100;  ///< no method of some twenty stages is stable so far from 0

/// The first x > 0 from which on grows(x) is true, to rounding.
template <class Grows>
Real first_growth(Grows&& grows) {
  constexpr Real look = 1.0 / 256;
  Real stable = 0, unstable = look;
  for (; !grows(unstable); unstable += look) {
    stable = unstable;
    if (stable > farthest) return infinity;
  }
  for (int k = 0; k < 50; ++k) {
    const Real middle = (stable + unstable) / 2;
    (grows(middle) ? unstable : stable) = middle;
  }
  return stable;
}

}  // namespace

StabilityPolynomial StabilityPolynomial::of_tableau(std::span<const Real> a, std::span<const Real> b) {
  const std::size_t stages = b.size();
  std::vector<Real> coefficients{1}, power(stages, 1);  // A^(k−1) 1
  for (std::size_t k = 0; k < stages; ++k) {
    Real sum = 0;
    for (std::size_t i = 0; i < stages; ++i) sum += b[i] * power[i];
    coefficients.push_back(sum);
    std::vector<Real> next(stages, 0);
    for (std::size_t i = 0; i < stages; ++i)
      for (std::size_t j = 0; j < i; ++j) next[i] += a[i * stages + j] * power[j];
    power = std::move(next);
  }
  return StabilityPolynomial(std::move(coefficients));
}

std::complex<Real> StabilityPolynomial::operator()(std::complex<Real> z) const {
  std::complex<Real> sum = 0;
  for (auto c = coefficients_.rbegin(); c != coefficients_.rend(); ++c) sum = sum * z + *c;
  return sum;
}

Real StabilityPolynomial::imaginary_interval() const {
  // |R(iy)|² − 1 as a polynomial in y²: near 0, where rounding would decide, the sign of its first coefficient counts.
  const std::size_t n = coefficients_.size();
  std::vector<Real> excess(n, 0);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t k = j % 2; k < n; k += 2)
      excess[(j + k) / 2] += ((j + 3 * k) / 2 % 2 == 0 ? 1 : -1) * coefficients_[j] * coefficients_[k];
  constexpr Real rounding = 1e-12;
  std::size_t first = 1;
  while (first < n && std::abs(excess[first]) < rounding) ++first;
  if (first == n) return infinity;
  if (excess[first] > 0) return 0;
  return first_growth([&](Real y) {
    Real sum = 0;
    for (std::size_t k = n; k-- > first;) sum = sum * y * y + excess[k];
    return sum > 0;
  });
}

Real StabilityPolynomial::real_interval() const {
  return first_growth([&](Real x) { return std::abs((*this)(-x)) > 1; });
}

Real StabilityPolynomial::longest_damped_step(const FastestRates& rates) const {
  constexpr int oscillations = 256;  // includes slow oscillations, which grow first with some methods
  const auto stable = [&](Real h) {
    for (int k = 1; k <= oscillations; ++k) {
      const Real w = rates.oscillation * k / oscillations;
      const std::complex<Real> root = std::sqrt(std::complex<Real>(square(rates.drag / 2) - square(w)));
      for (const auto& lambda : {-rates.drag / 2 + root, -rates.drag / 2 - root})
        if (std::abs((*this)(h * lambda)) > 1 + 1e-14) return false;
    }
    return true;
  };
  Real low = 1 / rates.oscillation;
  for (int k = 0; !stable(low); ++k, low /= 2)
    if (k == 100) return 0;
  Real high = low;
  for (constexpr Real look = 1.02; stable(high); high *= look) low = high;
  for (int k = 0; k < 40; ++k) {
    const Real middle = (low + high) / 2;
    (stable(middle) ? low : high) = middle;
  }
  return low;
}

Real StabilityPolynomial::longest_step(const FastestRates& rates) const {
  Real longest = rates.decay > 0 ? real_interval() / rates.decay : infinity;
  if (rates.oscillation > 0)
    longest = std::min(longest, rates.drag > 0 ? longest_damped_step(rates) : imaginary_interval() / rates.oscillation);
  return longest;
}

}  // namespace pliant
