// A check for inf and NaN that costs less than the loop around it.
#pragma once

#include <bit>
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

}  // namespace pliant
