#include <pliant/base/simd.h>
#include <pliant/kernels/pair_forces.h>
#include <pliant/kernels/scatter.h>

#include <stdexcept>

namespace pliant {
namespace {

using simd::Mask4;
using simd::Points2;
using simd::Real2;
using simd::Real4;

/// Places of the points of four pairs in an array [points · D]. Kept in registers: the compiler cannot know that
/// writing forces does not change the list.
template <int D>
struct Places {
  std::ptrdiff_t first[4], second[4];

  PLIANT_INLINE explicit Places(const Pair* pairs) {
    for (int k = 0; k < 4; ++k) {
      first[k] = std::ptrdiff_t(D) * pairs[k].first;
      second[k] = std::ptrdiff_t(D) * pairs[k].second;
    }
  }
};

// a_first − a_second

PLIANT_INLINE Vectors<2> differences(const Places<2>& at, const Real* a) {
  Real2 u[4];
  for (int k = 0; k < 4; ++k) u[k] = simd::load2(a + at.first[k]) - simd::load2(a + at.second[k]);
  const Points2 p = simd::transpose(u[0], u[1], u[2], u[3]);
  return {p.x, p.y};
}

PLIANT_INLINE Vectors<3> differences(const Places<3>& at, const Real* a) {
  Real2 xy[4];
  Real z[4];
  for (int k = 0; k < 4; ++k) {
    xy[k] = simd::load2(a + at.first[k]) - simd::load2(a + at.second[k]);
    z[k] = a[at.first[k] + 2] - a[at.second[k] + 2];
  }
  const Points2 p = simd::transpose(xy[0], xy[1], xy[2], xy[3]);
  return {p.x, p.y, Real4{z[0], z[1], z[2], z[3]}};
}

enum class Rub { none, whole, tangential };

template <int D, class Law, Rub rub, Sides sides>
PLIANT_INLINE void add_four(const PairLaw& law, const Pair* pairs, Real4 reach, const Real* x, const Real* v, Real* f) {
  const Places<D> at(pairs);
  auto force = differences(at, x);
  Real4 d2{};
  for (const Real4& r : force) d2 += r * r;
  const Mask4 touches = d2 < reach * reach;
  const Real4 d = simd::sqrt(d2);
  Real4 push = simd::where(touches & (d2 > 0), Law::push(law.epsilon, reach, d));
  if constexpr (rub == Rub::tangential) {  // removes the normal part of the friction
    const auto u = differences(at, v);
    Real4 along{};
    for (std::size_t k = 0; k < u.size(); ++k) along += u[k] * force[k];
    push += simd::where(touches & (d2 > 0), law.mu * along / d2);
  }
  for (Real4& r : force) r *= push;
  if constexpr (rub != Rub::none) {
    const Real4 mu = simd::where(touches, simd::all(law.mu));
    const auto u = differences(at, v);
    for (std::size_t k = 0; k < u.size(); ++k) force[k] -= mu * u[k];
  }
  scatter<D>(at.first, force, f, sides == Sides::both ? at.second : nullptr);
}

template <int D, class Law, Rub rub, Sides sides>
PLIANT_INLINE void add_all(const PairLaw& law, std::span<const Pair> pairs, const Real* reach, const Real* x,
                           const Real* v, Real* f) {
  std::size_t e = 0;
  for (; e + 4 <= pairs.size(); e += 4) {
    // The hardware does not predict the order of points in the list. Addresses may lie beyond the arrays.
    const std::ptrdiff_t soon = std::ptrdiff_t(D) * (pairs[e].first + 64);
    __builtin_prefetch(x + soon);
    __builtin_prefetch(f + soon, 1);
    if constexpr (rub != Rub::none) __builtin_prefetch(v + soon);
    add_four<D, Law, rub, sides>(law, pairs.data() + e, simd::load4(reach + e), x, v, f);
  }
  if (e == pairs.size()) return;
  // The rest, filled up with pairs that never touch.
  Pair rest[4];
  Real4 rest_reach{};
  for (std::size_t k = 0; k < 4; ++k) {
    const bool listed = e + k < pairs.size();
    rest[k] = listed ? pairs[e + k] : pairs.back();
    rest_reach[k] = listed ? reach[e + k] : 0;
  }
  add_four<D, Law, rub, sides>(law, rest, rest_reach, x, v, f);
}

template <int D, class Law, Rub rub>
PLIANT_INLINE void add_to(const PairLaw& law, std::span<const Pair> pairs, const Real* reach, Sides sides,
                          const Real* x, const Real* v, Real* f) {
  if (sides == Sides::both)
    add_all<D, Law, rub, Sides::both>(law, pairs, reach, x, v, f);
  else
    add_all<D, Law, rub, Sides::first>(law, pairs, reach, x, v, f);
}

template <int D, class Law>
PLIANT_INLINE void add_by_law(const PairLaw& law, std::span<const Pair> pairs, const Real* reach, Sides sides,
                              const Real* x, const Real* v, Real* f) {
  if (law.mu == 0)
    add_to<D, Law, Rub::none>(law, pairs, reach, sides, x, v, f);
  else if (law.tangential)
    add_to<D, Law, Rub::tangential>(law, pairs, reach, sides, x, v, f);
  else
    add_to<D, Law, Rub::whole>(law, pairs, reach, sides, x, v, f);
}

template <int D>
PLIANT_INLINE void add(const PairLaw& law, std::span<const Pair> pairs, const Real* reach, Sides sides, const Real* x,
                       const Real* v, Real* f) {
  if (law.contact == ContactLaw::hertz)
    add_by_law<D, HertzOverlap>(law, pairs, reach, sides, x, v, f);
  else if (law.contact == ContactLaw::linear)
    add_by_law<D, LinearOverlap>(law, pairs, reach, sides, x, v, f);
  else
    add_by_law<D, HarmonicOverlap>(law, pairs, reach, sides, x, v, f);
}

}  // namespace

template <int D>
void add_pair_forces(const PairLaw& law, std::span<const Pair> pairs, const Real* reach, Sides sides, const Real* x,
                     const Real* v, Real* f) {
  if (law.contact == ContactLaw::barrier || law.contact == ContactLaw::spring)
    throw std::logic_error("add_pair_forces has neither the barrier nor the spring");
  simd::run_fast([&]() PLIANT_INLINE_LAMBDA { add<D>(law, pairs, reach, sides, x, v, f); });
}
template void add_pair_forces<2>(const PairLaw&, std::span<const Pair>, const Real*, Sides, const Real*, const Real*,
                                 Real*);
template void add_pair_forces<3>(const PairLaw&, std::span<const Pair>, const Real*, Sides, const Real*, const Real*,
                                 Real*);

}  // namespace pliant
