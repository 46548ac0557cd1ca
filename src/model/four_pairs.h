// Contacts between particles of one point each, four at a time: finding them, reading and adding to their points.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include <pliant/base/simd.h>
#include <pliant/base/vector3.h>
#include <pliant/kernels/scatter.h>
#include <pliant/model/term.h>

namespace pliant {

/// Calls visit(count, elements) for four elements at a time; fewer than four are filled up with copies of the last.
template <class Visit>
PLIANT_INLINE void for_each_four(const Index* elements, Index size, Visit&& visit) {
  Index k = 0;
  for (; k + 4 <= size; k += 4) visit(4, elements + k);
  if (k == size) return;
  std::array<Index, 4> rest;
  for (Index l = 0; l < 4; ++l) rest[l] = elements[std::min(k + l, size - 1)];
  visit(size - k, rest.data());
}

/// Four elements from the k-th on; fewer than four are filled up with copies of the last, in `room`.
PLIANT_INLINE const Index* four_from(const Index* elements, Index size, Index k, std::array<Index, 4>& room) {
  if (k + 4 <= size) return elements + k;
  for (Index l = 0; l < 4; ++l) room[l] = elements[std::min(k + l, size - 1)];
  return room.data();
}

/// Four rows of numbers, of which some are read together.
using FourRows = std::array<const Real*, 4>;

/// Columns first … first + 3 of four rows.
PLIANT_INLINE void columns(const FourRows& rows, int first, simd::Real4& a, simd::Real4& b, simd::Real4& c,
                           simd::Real4& d) {
  a = simd::load4(rows[0] + first), b = simd::load4(rows[1] + first), c = simd::load4(rows[2] + first),
  d = simd::load4(rows[3] + first);
  simd::transpose(a, b, c, d);
}
PLIANT_INLINE void write_columns(const std::array<Real*, 4>& rows, int first, simd::Real4 a, simd::Real4 b,
                                 simd::Real4 c, simd::Real4 d) {
  simd::transpose(a, b, c, d);
  simd::store4(rows[0] + first, a);
  simd::store4(rows[1] + first, b);
  simd::store4(rows[2] + first, c);
  simd::store4(rows[3] + first, d);
}
PLIANT_INLINE simd::Real4 column(const FourRows& rows, int k) {
  return simd::Real4{rows[0][k], rows[1][k], rows[2][k], rows[3][k]};
}

/// The points of four pairs.
struct FourPairs {
  std::array<std::ptrdiff_t, 4> first, second;

  /// Points of consecutive pairs.
  PLIANT_INLINE explicit FourPairs(const Pair* pairs) {
    for (int k = 0; k < 4; ++k) {
      first[k] = pairs[k].first;
      second[k] = pairs[k].second;
    }
  }
  PLIANT_INLINE FourPairs(const Pair* pairs, const Index* elements) {
    for (int k = 0; k < 4; ++k) {
      first[k] = pairs[elements[k]].first;
      second[k] = pairs[elements[k]].second;
    }
  }
  template <class T>
  PLIANT_INLINE static simd::Real4 gather(const T* a, const std::array<std::ptrdiff_t, 4>& at) {
    return simd::Real4{Real(a[at[0]]), Real(a[at[1]]), Real(a[at[2]]), Real(a[at[3]])};
  }
  /// Vectors in space, of arrays x0 y0 z0 x1 … .
  PLIANT_INLINE static Vector3<simd::Real4> gather3(const Real* a, const std::array<std::ptrdiff_t, 4>& at) {
    simd::Real2 xy[4], yz[4];
    for (int k = 0; k < 4; ++k) xy[k] = simd::load2(a + 3 * at[k]), yz[k] = simd::load2(a + 3 * at[k] + 1);
    return joined(xy, yz);
  }
  /// a_first − a_second, in the plane and in space.
  PLIANT_INLINE simd::Points2 differences(const Real* a) const {
    simd::Real2 u[4];
    for (int k = 0; k < 4; ++k) u[k] = simd::load2(a + 2 * first[k]) - simd::load2(a + 2 * second[k]);
    return simd::transpose(u[0], u[1], u[2], u[3]);
  }
  PLIANT_INLINE Vector3<simd::Real4> differences3(const Real* a) const {
    simd::Real2 xy[4], yz[4];
    for (int k = 0; k < 4; ++k) {
      xy[k] = simd::load2(a + 3 * first[k]) - simd::load2(a + 3 * second[k]);
      yz[k] = simd::load2(a + 3 * first[k] + 1) - simd::load2(a + 3 * second[k] + 1);
    }
    return joined(xy, yz);
  }

 private:
  /// Four vectors, of which (x, y) and (y, z) have been read.
  PLIANT_INLINE static Vector3<simd::Real4> joined(const simd::Real2* xy, const simd::Real2* yz) {
    const simd::Points2 p = simd::transpose(xy[0], xy[1], xy[2], xy[3]),
                        q = simd::transpose(yz[0], yz[1], yz[2], yz[3]);
    return {p.x, p.y, q.y};
  }
};

/// Writes the touching pairs of a range to `elements`, without a branch that depends on them, and returns their number.
/// The history of the other pairs ends.
template <int D, int Width>
PLIANT_INLINE Index find_touching(const StateView<D>& s, Range range, const ContactWorkspace::Next<Width>& next,
                                  Index* elements) {
  const PairList& list = s.neighbours.point_pairs;
  const Pair* const pairs = list.pairs.data();
  const Real *const reach = list.reach.data(), *const x = s.x;
  Index touching = 0, e = range.first;
  if constexpr (D == 3)
    for (; e + 64 <= range.last; e += 64) {
      std::uint64_t near = 0;
      for (Index k = 0; k < 64; k += 4) {
        const Vector3<simd::Real4> r = FourPairs(pairs + e + k).differences3(x);
        const simd::Real4 d2 = dot(r, r), most = simd::load4(reach + e + k);
        near |= std::uint64_t(simd::bits((d2 < most * most) & (d2 > 0))) << k;
      }
      for (std::uint64_t ended = next.touch_bits(e) & ~near; ended != 0; ended &= ended - 1)
        next.clear(e + std::countr_zero(ended));
      touching += simd::write_bits(near, e, elements + touching);
    }
  for (; e < range.last; ++e) {
    const std::ptrdiff_t i = D * std::ptrdiff_t(pairs[e].first), j = D * std::ptrdiff_t(pairs[e].second);
    const Real dx = x[i] - x[j], dy = x[i + 1] - x[j + 1];
    Real d2 = dx * dx + dy * dy;
    if constexpr (D == 3) d2 += square(x[i + 2] - x[j + 2]);
    const Index near = (d2 < square(reach[e])) & (d2 > 0);
    elements[touching] = e;  // else overwritten by the next element
    touching += near;
    if (Index(next.touches(e)) > near) next.clear(e);
  }
  return touching;
}

/// Four vectors in space, to be added to one point each.
struct FourVectors {
  std::array<simd::Real2, 4> xy;
  simd::Real4 z;

  PLIANT_INLINE explicit FourVectors(const Vector3<simd::Real4>& a) : z(a.z) {
    simd::Real4 lanes02, lanes13;
    simd::transpose({a.x, a.y}, lanes02, lanes13);
    xy = {simd::low(lanes02), simd::low(lanes13), simd::high(lanes02), simd::high(lanes13)};
  }
  PLIANT_INLINE void add(Index lane, Real* to) const {
    simd::store2(to, simd::load2(to) + xy[lane]);
    to[2] += z[lane];
  }
  PLIANT_INLINE void subtract(Index lane, Real* from) const {
    simd::store2(from, simd::load2(from) - xy[lane]);
    from[2] -= z[lane];
  }
};

/// Sums of a loss over the contacts that count in a chunk, lane by lane.
template <std::size_t N>
struct FourLosses {
  std::array<simd::Real4, N> sums{};

  template <int D, bool OwnOnly>
  PLIANT_INLINE void add(const StateView<D>& s, const Scatter<D, 1, OwnOnly>& force, Index count, const Index* elements,
                         const std::array<simd::Real4, N>& now) {
    simd::Mask4 counts = simd::first(count);
    if constexpr (OwnOnly)
      for (int l = 0; l < 4; ++l)
        if (!force.template counts<Elements::point_pairs>(s, elements[l])) counts[l] = 0;
    for (std::size_t j = 0; j < N; ++j) sums[j] += simd::where(counts, now[j]);
  }
  PLIANT_INLINE void write(Range range, ContactWorkspace& workspace) const {
    if (range.size() == 0) return;
    for (std::size_t j = 0; j < N; ++j)
      workspace.losses(range)[j] = (sums[j][0] + sums[j][1]) + (sums[j][2] + sums[j][3]);
  }
};

}  // namespace pliant
