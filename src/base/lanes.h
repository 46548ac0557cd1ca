// Functions of numbers, or of vectors of several of them.
#pragma once

#include <cmath>
#include <cstddef>
#include <type_traits>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant {

/// Type of a comparison of numbers, or of vectors of numbers.
template <class R>
using MaskOf = decltype(R() < R());

/// Whether a mask is set anywhere.
template <class Mask>
PLIANT_INLINE bool any_of(const Mask& mask) {
  if constexpr (std::is_arithmetic_v<Mask>) {
    return mask;
  } else {
    static_assert(sizeof(Mask) == 4 * sizeof(Real));
    const auto half = __builtin_shufflevector(mask, mask, 0, 1) | __builtin_shufflevector(mask, mask, 2, 3);
    return (half[0] | half[1]) != 0;
  }
}

template <class R>
PLIANT_INLINE R square_root(R a) {
  if constexpr (std::is_arithmetic_v<R>) {
    return std::sqrt(a);
  } else {
    for (std::size_t k = 0; k < sizeof(R) / sizeof(Real); ++k) a[k] = std::sqrt(a[k]);
    return a;
  }
}

template <class R>
PLIANT_INLINE R magnitude(R a) {
  if constexpr (std::is_arithmetic_v<R>)
    return std::abs(a);
  else
    return R(MaskOf<R>(a) & ~MaskOf<R>(-R{}));
}

/// −a where `sign` is negative or −0, else a.
template <class R>
PLIANT_INLINE R times_sign_of(R sign, R a) {
  if constexpr (std::is_arithmetic_v<R>)
    return std::signbit(sign) ? -a : a;
  else
    return R(MaskOf<R>(a) ^ (MaskOf<R>(sign) & MaskOf<R>(-R{})));
}

}  // namespace pliant
