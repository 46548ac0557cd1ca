// Adding vectors that were computed four at a time to the points that they belong to.
#pragma once

#include <array>
#include <cstddef>

#include <pliant/base/simd.h>

namespace pliant {

/// Four vectors, component by component.
template <int D>
using Vectors = std::array<simd::Real4, D>;

/// Adds vector k to the numbers from f + first[k] on, and with `second` its opposite from f + second[k] on. One
/// after the other, because several of the four may belong to the same point.
template <int D>
PLIANT_INLINE void scatter(const std::ptrdiff_t* first, const Vectors<D>& vectors, Real* f,
                           const std::ptrdiff_t* second = nullptr) {
  simd::Real4 lanes02, lanes13;
  simd::transpose(simd::Points2{vectors[0], vectors[1]}, lanes02, lanes13);
  const simd::Real2 xy[] = {simd::low(lanes02), simd::low(lanes13), simd::high(lanes02), simd::high(lanes13)};
  for (int k = 0; k < 4; ++k) {
    Real* const i = f + first[k];
    simd::store2(i, simd::load2(i) + xy[k]);
    if constexpr (D == 3) i[2] += vectors[2][k];
    if (second == nullptr) continue;
    Real* const j = f + second[k];
    simd::store2(j, simd::load2(j) - xy[k]);
    if constexpr (D == 3) j[2] -= vectors[2][k];
  }
}

}  // namespace pliant
