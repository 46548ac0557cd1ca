// A check for inf and NaN that costs less than the loop around it.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include <pliant/base/types.h>

namespace pliant {

/// Collects non-finite values by integer arithmetic: unlike std::isfinite it leaves loops vectorisable on plain SSE2.
class FiniteCheck {
 public:
  void add(Real value) {
    constexpr std::uint64_t exponent = 0x7ff0000000000000, one = 0x0010000000000000;
    // An exponent of all ones (inf, NaN) carries into the sign bit, other exponents do not.
    bits_ |= (std::bit_cast<std::uint64_t>(value) & exponent) + one;
  }
  bool all_finite() const { return (bits_ >> 63) == 0; }

 private:
  std::uint64_t bits_ = 0;
};

/// Index of the first inf or NaN in a[n]; n if there is none.
inline std::size_t first_non_finite(const Real* a, std::size_t n) {
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

}  // namespace pliant
