// Four doubles at a time, with the compiler's vector types, which every target has.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>

namespace pliant::simd {

typedef Real Real2 __attribute__((vector_size(2 * sizeof(Real))));
typedef Real Real4 __attribute__((vector_size(4 * sizeof(Real))));
typedef std::int64_t Mask4
    __attribute__((vector_size(4 * sizeof(std::int64_t))));  ///< results of comparisons: lanes of 0 or −1

typedef std::int32_t Int4 __attribute__((vector_size(4 * sizeof(std::int32_t))));

PLIANT_INLINE Real4 all(Real a) { return Real4{a, a, a, a}; }

PLIANT_INLINE Real2 load2(const Real* p) {
  Real2 a;
  std::memcpy(&a, p, sizeof a);
  return a;
}
PLIANT_INLINE void store2(Real* p, Real2 a) { std::memcpy(p, &a, sizeof a); }
PLIANT_INLINE Real4 load4(const Real* p) {
  Real4 a;
  std::memcpy(&a, p, sizeof a);
  return a;
}
PLIANT_INLINE void store4(Real* p, Real4 a) { std::memcpy(p, &a, sizeof a); }

PLIANT_INLINE Real4 join(Real2 low, Real2 high) { return __builtin_shufflevector(low, high, 0, 1, 2, 3); }
PLIANT_INLINE Real2 low(Real4 a) { return __builtin_shufflevector(a, a, 0, 1); }
PLIANT_INLINE Real2 high(Real4 a) { return __builtin_shufflevector(a, a, 2, 3); }

/// Mask of the first lanes, at most four.
PLIANT_INLINE Mask4 first(Index count) { return Mask4{0, 1, 2, 3} < std::int64_t(count); }
/// a where the mask is set, else b.
PLIANT_INLINE Real4 select(Mask4 mask, Real4 a, Real4 b) { return mask ? a : b; }
/// a where the mask is set, else 0.
PLIANT_INLINE Real4 where(Mask4 mask, Real4 a) { return mask ? a : Real4{}; }
PLIANT_INLINE Real4 min(Real4 a, Real4 b) { return a < b ? a : b; }
PLIANT_INLINE Real4 max(Real4 a, Real4 b) { return a > b ? a : b; }
PLIANT_INLINE Real4 abs(Real4 a) { return max(a, -a); }
PLIANT_INLINE bool any(Mask4 mask) {
  const auto half = __builtin_shufflevector(mask, mask, 0, 1) | __builtin_shufflevector(mask, mask, 2, 3);
  return (half[0] | half[1]) != 0;
}
/// Bit k: whether lane k is set.
PLIANT_INLINE unsigned bits(Mask4 mask) {
#ifdef __SSE2__
  typedef float Float8 __attribute__((vector_size(8 * sizeof(float))));
  const Float8 halves = (Float8)mask;
  return static_cast<unsigned>(__builtin_ia32_movmskps(__builtin_shufflevector(halves, halves, 0, 2, 4, 6)));
#else
  return static_cast<unsigned>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
#endif
}

PLIANT_INLINE Real4 sqrt(Real4 a) {
  Real4 r;
  for (int k = 0; k < 4; ++k) r[k] = std::sqrt(a[k]);
  return r;
}

PLIANT_INLINE Int4 truncate(Real4 a) { return __builtin_convertvector(a, Int4); }
PLIANT_INLINE Real4 real(Int4 a) { return __builtin_convertvector(a, Real4); }

/// Writes first + (number of each bit that is set) to the list, by eights, so that the loop's end is foreseen: up to
/// seven more than count are written. Returns how many count.
PLIANT_INLINE Index write_bits(std::uint64_t bits, Index first, Index* list) {
  const Index count = std::popcount(bits);
  for (Index done = 0; done < count; done += 8)
    for (Index k = done; k < done + 8; ++k) {
      list[k] = first + std::countr_zero(bits);
      bits &= bits - 1;
    }
  return count;
}

/// Rows become columns.
PLIANT_INLINE void transpose(Real4& a, Real4& b, Real4& c, Real4& d) {
  const Real4 ab = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab1 = __builtin_shufflevector(a, b, 1, 5, 3, 7),
              cd = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd1 = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab1, cd1, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
  d = __builtin_shufflevector(ab1, cd1, 2, 3, 6, 7);
}

/// (x, y) of four points, lane by lane.
struct Points2 {
  Real4 x, y;
};
PLIANT_INLINE Points2 transpose(Real2 a, Real2 b, Real2 c, Real2 d) {
  const Real4 ac = join(a, c), bd = join(b, d);
  return {__builtin_shufflevector(ac, bd, 0, 4, 2, 6), __builtin_shufflevector(ac, bd, 1, 5, 3, 7)};
}
/// The inverse: (x, y) of lanes 0 and 2, and of lanes 1 and 3.
PLIANT_INLINE void transpose(const Points2& p, Real4& lanes02, Real4& lanes13) {
  lanes02 = __builtin_shufflevector(p.x, p.y, 0, 4, 2, 6);
  lanes13 = __builtin_shufflevector(p.x, p.y, 1, 5, 3, 7);
}

}  // namespace pliant::simd
