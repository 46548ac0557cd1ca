// Prefetches memory in small pieces during a computation.
#pragma once

#include <array>
#include <cstddef>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// Up to five arrays of coordinates that the next pass over a chunk reads. A large system does not fit into the caches;
/// data requested within a computing loop arrive meanwhile.
class Prefetch {
 public:
  Prefetch() = default;
  template <class... Arrays>
  explicit Prefetch(const Arrays*... arrays) : arrays_{{arrays...}}, count_(sizeof...(arrays)) {}

  void add(const Real* array) { arrays_[count_++] = array; }

  /// Prefetches the coordinates first … last−1 of each array.
  PLIANT_INLINE void fetch(std::ptrdiff_t first, std::ptrdiff_t last) const {
    for (int k = 0; k < count_; ++k)
      for (std::ptrdiff_t i = first; i < last; i += per_line) __builtin_prefetch(arrays_[k] + i);
  }

 private:
  static constexpr std::ptrdiff_t per_line = 8;  ///< coordinates of 8 bytes in a line of the cache

  std::array<const Real*, 5> arrays_{};
  int count_ = 0;
};

}  // namespace pliant
