#include <pliant/base/simd.h>
#include <pliant/kernels/scatter.h>
#include <pliant/kernels/wall_forces.h>

namespace pliant {
namespace {

using simd::Mask4;
using simd::Points2;
using simd::Real4;

/// A vector of the plane at `of(k)` of four things.
template <class Of>
PLIANT_INLINE Points2 gather(Of&& of) {
  return simd::transpose(simd::load2(of(0)), simd::load2(of(1)), simd::load2(of(2)), simd::load2(of(3)));
}

template <int D, class Law>
PLIANT_INLINE void add_four(Real epsilon, const Pair* pairs, const WallSegment* walls, Real4 reach, const Real* x,
                            Real* f) {
  std::ptrdiff_t at[4];
  const WallSegment* wall[4];
  for (int k = 0; k < 4; ++k) {
    at[k] = std::ptrdiff_t(D) * pairs[k].first;
    wall[k] = walls + pairs[k].second;
  }
  // The plane of the walls: in 3D, that of the axis and the point.
  const Points2 xy = gather([&](int k) __attribute__((always_inline)) { return x + at[k]; });
  Points2 p = xy;
  if constexpr (D == 3) {
    p.x = simd::sqrt(xy.x * xy.x + xy.y * xy.y);
    p.y = Real4{x[at[0] + 2], x[at[1] + 2], x[at[2] + 2], x[at[3] + 2]};
  }
  const Points2 origin = gather([&](int k) __attribute__((always_inline)) { return wall[k]->origin.data(); });
  const Points2 along = gather([&](int k) __attribute__((always_inline)) { return wall[k]->direction.data(); });
  const Real4 length{wall[0]->length, wall[1]->length, wall[2]->length, wall[3]->length};
  Points2 q{p.x - origin.x, p.y - origin.y};
  const Real4 foot = simd::min(simd::max(q.x * along.x + q.y * along.y, Real4{}), length);
  q.x -= foot * along.x;
  q.y -= foot * along.y;

  const Real4 d2 = q.x * q.x + q.y * q.y;
  const Real4 d = simd::sqrt(d2);
  const Mask4 touches = (d < reach) & (d2 > 0);
  const Real4 push = simd::where(touches, Law::push(epsilon, reach, d));
  if constexpr (D == 2) {
    scatter<2>(at, {push * q.x, push * q.y}, f);
  } else {
    // On the axis there is no radial direction.
    const Real4 radial = simd::where(p.x > 0, push * q.x / p.x);
    scatter<3>(at, {radial * xy.x, radial * xy.y, push * q.y}, f);
  }
}

template <int D, class Law>
PLIANT_INLINE void add_all(Real epsilon, std::span<const Pair> pairs, const WallSegment* walls, const Real* diameter,
                           const Real* x, Real* f) {
  std::size_t e = 0;
  for (; e + 4 <= pairs.size(); e += 4) {
    const Pair* const four = pairs.data() + e;
    const Real4 reach{diameter[four[0].first], diameter[four[1].first], diameter[four[2].first],
                      diameter[four[3].first]};
    add_four<D, Law>(epsilon, four, walls, 0.5 * reach, x, f);
  }
  if (e == pairs.size()) return;
  // The rest, filled up with points that touch nothing.
  Pair rest[4];
  Real4 reach{};
  for (std::size_t k = 0; k < 4; ++k) {
    const bool listed = e + k < pairs.size();
    rest[k] = listed ? pairs[e + k] : pairs.back();
    reach[k] = listed ? diameter[rest[k].first] / 2 : 0;
  }
  add_four<D, Law>(epsilon, rest, walls, reach, x, f);
}

template <int D>
PLIANT_INLINE void add(Real epsilon, std::span<const Pair> pairs, const WallSegment* walls, const Real* diameter,
                       const Real* x, Real* f, ContactLaw law) {
  if (law == ContactLaw::barrier)
    add_all<D, BarrierOverlap>(epsilon, pairs, walls, diameter, x, f);
  else if (law == ContactLaw::hertz)
    add_all<D, HertzOverlap>(epsilon, pairs, walls, diameter, x, f);
  else
    add_all<D, HarmonicOverlap>(epsilon, pairs, walls, diameter, x, f);
}

PLIANT_MULTIVERSION void add_2d(Real epsilon, std::span<const Pair> pairs, const WallSegment* walls,
                                const Real* diameter, const Real* x, Real* f, ContactLaw law) {
  add<2>(epsilon, pairs, walls, diameter, x, f, law);
}
PLIANT_MULTIVERSION void add_3d(Real epsilon, std::span<const Pair> pairs, const WallSegment* walls,
                                const Real* diameter, const Real* x, Real* f, ContactLaw law) {
  add<3>(epsilon, pairs, walls, diameter, x, f, law);
}

}  // namespace

template <int D>
void add_wall_forces(Real epsilon, std::span<const Pair> pairs, std::span<const WallSegment> walls,
                     const Real* diameter, const Real* x, Real* f, ContactLaw law) {
  if constexpr (D == 2)
    add_2d(epsilon, pairs, walls.data(), diameter, x, f, law);
  else
    add_3d(epsilon, pairs, walls.data(), diameter, x, f, law);
}
template void add_wall_forces<2>(Real, std::span<const Pair>, std::span<const WallSegment>, const Real*, const Real*,
                                 Real*, ContactLaw);
template void add_wall_forces<3>(Real, std::span<const Pair>, std::span<const WallSegment>, const Real*, const Real*,
                                 Real*, ContactLaw);

}  // namespace pliant
