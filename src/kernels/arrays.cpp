#include <pliant/kernels/arrays.h>

#include <pliant/base/multiversion.h>
#include <pliant/kernels/finite.h>

namespace pliant {

std::size_t first_non_finite(const Real* a, std::size_t n) {
  FiniteCheck check;
  for (std::size_t i = 0; i < n; ++i) check.add(a[i]);
  if (check.all_finite()) return n;
  for (std::size_t i = 0; i < n; ++i) {
    FiniteCheck one;
    one.add(a[i]);
    if (!one.all_finite()) return i;
  }
  return n;
}

Real dot(const Real* a, const Real* b, std::size_t n) {
  Real sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

PLIANT_MULTIVERSION void subtract(const Real* a, const Real* b, std::size_t n, Real* __restrict__ difference) {
  for (std::size_t i = 0; i < n; ++i) difference[i] = a[i] - b[i];
}

}  // namespace pliant
