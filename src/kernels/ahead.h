// Memory that is needed soon, fetched bit by bit while something else is computed.
#pragma once

#include <array>
#include <cstddef>

#include <pliant/base/types.h>
#include <pliant/kernels/multiversion.h>

namespace pliant {

/// Up to four arrays of coordinates that will be gone through once a kernel is done with a chunk. A large system does
/// not fit into the caches; what is asked for in the loops that compute arrives while they do.
class Ahead {
 public:
  Ahead() = default;
  template <class... Arrays>
  explicit Ahead(const Arrays*... arrays) : arrays_{{arrays...}}, count_(sizeof...(arrays)) {}

  bool empty() const { return count_ == 0; }
  void add(const Real* array) { arrays_[count_++] = array; }

  /// Asks for the coordinates first … last−1 of each array.
  PLIANT_INLINE void fetch(std::ptrdiff_t first, std::ptrdiff_t last) const {
    for (int k = 0; k < count_; ++k)
      for (std::ptrdiff_t i = first; i < last; i += per_line) __builtin_prefetch(arrays_[k] + i);
  }

  static constexpr std::ptrdiff_t per_line = 8;  ///< coordinates of 8 bytes in a line of the cache

 private:
  std::array<const Real*, 4> arrays_{};
  int count_ = 0;
};

/// Spreads a fetch over the steps of a loop.
class AheadBySteps {
 public:
  /// Of the coordinates first … last−1 in so many steps.
  AheadBySteps(const Ahead& ahead, std::ptrdiff_t first, std::ptrdiff_t last, std::size_t steps)
      : ahead_(ahead), at_(first), rate_(steps > 0 ? static_cast<Real>(last - first) / static_cast<Real>(steps) : 0) {}

  PLIANT_INLINE void step() {
    due_ += rate_;
    for (; due_ >= Ahead::per_line; due_ -= Ahead::per_line, at_ += Ahead::per_line) ahead_.fetch(at_, at_ + 1);
  }

 private:
  const Ahead& ahead_;
  std::ptrdiff_t at_;
  Real rate_, due_ = 0;
};

}  // namespace pliant
