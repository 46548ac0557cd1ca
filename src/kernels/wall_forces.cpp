#include <pliant/base/simd.h>
#include <pliant/kernels/scatter.h>
#include <pliant/kernels/wall_forces.h>

namespace pliant {
namespace {

using simd::Mask4;
using simd::Points2;
using simd::Real4;

/// A vector of the plane at `of(k)` of four objects.
template <class Of>
PLIANT_INLINE Points2 gather(Of&& of) {
  return simd::transpose(simd::load2(of(0)), simd::load2(of(1)), simd::load2(of(2)), simd::load2(of(3)));
}

/// plain: all parts are segments without radius, of weight 1.
template <int D, class Law, bool plain>
PLIANT_INLINE void add_four(WallLaw law, const Pair* pairs, const WallSegment* walls, Real4 reach, const Real* x,
                            Real* f) {
  std::ptrdiff_t at[4];
  const WallSegment* wall[4];
  for (int k = 0; k < 4; ++k) {
    at[k] = std::ptrdiff_t(D) * pairs[k].first;
    wall[k] = walls + pairs[k].second;
  }
  // The plane of the walls: in 3D, the plane through the axis and the point.
  const Points2 xy = gather([&](int k) __attribute__((always_inline)) { return x + at[k]; });
  Points2 p = xy;
  if constexpr (D == 3) {
    p.x = simd::sqrt(xy.x * xy.x + xy.y * xy.y);
    p.y = Real4{x[at[0] + 2], x[at[1] + 2], x[at[2] + 2], x[at[3] + 2]};
  }
  const Points2 origin = gather([&](int k) __attribute__((always_inline)) { return wall[k]->origin.data(); });
  const Points2 along = gather([&](int k) __attribute__((always_inline)) { return wall[k]->direction.data(); });
  const Real4 length{wall[0]->length, wall[1]->length, wall[2]->length, wall[3]->length};
  [[maybe_unused]] const Real4 rho = p.x;
  [[maybe_unused]] Mask4 rounds{};  // near the axis, except for spheres on the axis: as RoundedRadius
  [[maybe_unused]] Real4 s2{};
  if constexpr (D == 3) {
    rounds = (rho < axis_width) & ((length > 0) | (origin.x != 0));
    if (simd::any(rounds)) {
      s2 = rho * rho / (axis_width * axis_width);
      p.x = simd::select(rounds, axis_width * (3 + s2 * (6 - s2)) / 8, rho);
    }
  }
  Points2 q{p.x - origin.x, p.y - origin.y};
  const Real4 foot = simd::min(simd::max(q.x * along.x + q.y * along.y, Real4{}), length);
  q.x -= foot * along.x;
  q.y -= foot * along.y;

  const Real4 d2 = q.x * q.x + q.y * q.y;
  const Real4 far = simd::sqrt(d2);
  Real4 push;
  if constexpr (plain) {
    const Mask4 touches = (far < reach) & (d2 > 0);
    push = simd::where(touches, Law::push(law.epsilon, reach, far));
  } else {
    const Real4 radius{wall[0]->radius, wall[1]->radius, wall[2]->radius, wall[3]->radius};
    const Real4 weight{wall[0]->weight, wall[1]->weight, wall[2]->weight, wall[3]->weight};
    const Real4 d = far - radius;
    const Mask4 touches = (d < reach) & (d2 > 0) & (d != 0) & (reach > 0);
    push = simd::where(touches, Law::push(law.epsilon, reach, d) * d * weight / far);
  }
  if constexpr (D == 2) {
    scatter<2>(at, {push * q.x, push * q.y}, f);
  } else {
    // On the axis there is no radial direction.
    Real4 radial = simd::where(rho > 0, push * q.x / rho);
    if (simd::any(rounds)) radial = simd::select(rounds, push * q.x * (3 - s2) / (2 * axis_width), radial);
    scatter<3>(at, {radial * xy.x, radial * xy.y, push * q.y}, f);
  }
}

template <int D, class Law, bool plain>
PLIANT_INLINE void add_all(WallLaw law, std::span<const Pair> pairs, const WallSegment* walls, const Real* diameter,
                           const Real* x, Real* f) {
  std::size_t e = 0;
  for (; e + 4 <= pairs.size(); e += 4) {
    const Pair* const four = pairs.data() + e;
    const Real4 reach{diameter[four[0].first], diameter[four[1].first], diameter[four[2].first],
                      diameter[four[3].first]};
    add_four<D, Law, plain>(law, four, walls, 0.5 * reach, x, f);
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
  add_four<D, Law, plain>(law, rest, walls, reach, x, f);
}

template <int D, bool plain>
PLIANT_INLINE void add(WallLaw law, std::span<const Pair> pairs, const WallSegment* walls, const Real* diameter,
                       const Real* x, Real* f) {
  if (law.contact == ContactLaw::barrier)
    add_all<D, BarrierOverlap, plain>(law, pairs, walls, diameter, x, f);
  else if (law.contact == ContactLaw::hertz)
    add_all<D, HertzOverlap, plain>(law, pairs, walls, diameter, x, f);
  else if (law.contact == ContactLaw::linear)
    add_all<D, LinearOverlap, plain>(law, pairs, walls, diameter, x, f);
  else if (law.contact == ContactLaw::spring)
    add_all<D, SpringOverlap, plain>(law, pairs, walls, diameter, x, f);
  else
    add_all<D, HarmonicOverlap, plain>(law, pairs, walls, diameter, x, f);
}

}  // namespace

template <int D>
void add_wall_forces(const WallLaw& law, std::span<const Pair> pairs, const Walls<D>& walls, const Real* diameter,
                     const Real* x, Real* f) {
  const WallSegment* const parts = walls.parts().data();
  const WallLaw copy = law;  // which stores cannot change
  if (walls.plain())
    simd::run_fast([&]() PLIANT_INLINE_LAMBDA { add<D, true>(copy, pairs, parts, diameter, x, f); });
  else
    simd::run_fast([&]() PLIANT_INLINE_LAMBDA { add<D, false>(copy, pairs, parts, diameter, x, f); });
}
template void add_wall_forces<2>(const WallLaw&, std::span<const Pair>, const Walls<2>&, const Real*, const Real*,
                                 Real*);
template void add_wall_forces<3>(const WallLaw&, std::span<const Pair>, const Walls<3>&, const Real*, const Real*,
                                 Real*);

}  // namespace pliant
