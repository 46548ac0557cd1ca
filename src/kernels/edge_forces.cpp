#include <pliant/kernels/edge_forces.h>

#include <algorithm>
#include <bit>
#include <limits>

#include <pliant/base/simd.h>

namespace pliant {
namespace {

using namespace simd;

PLIANT_INLINE Points2 operator+(const Points2& a, const Points2& b) { return {a.x + b.x, a.y + b.y}; }
PLIANT_INLINE Points2 operator-(const Points2& a, const Points2& b) { return {a.x - b.x, a.y - b.y}; }
PLIANT_INLINE Points2 operator*(Real4 s, const Points2& a) { return {s * a.x, s * a.y}; }
PLIANT_INLINE Real4 dot(const Points2& a, const Points2& b) { return a.x * b.x + a.y * b.y; }

/// (x, y) of points 0 and 2, and of points 1 and 3, lane by lane.
PLIANT_INLINE Points2 columns(Real4 lanes02, Real4 lanes13) {
  return {__builtin_shufflevector(lanes02, lanes13, 0, 4, 2, 6), __builtin_shufflevector(lanes02, lanes13, 1, 5, 3, 7)};
}

enum class Rubbing { none, at_contact, at_vertex };
enum class Opposed { whole, tangential };

struct Data {
  const Pair* pairs;
  const Real* reach;
  const Index* next;
  const Real *x, *v;
};

PLIANT_INLINE Real2 at(const Real* x, Index i) { return load2(x + 2 * static_cast<std::size_t>(i)); }

/// Receives the forces on every point.
struct Everything {
  Real* f;
  PLIANT_INLINE void add(Index i, Real2 force) const {
    Real* const p = f + 2 * static_cast<std::size_t>(i);
    store2(p, load2(p) + force);
  }
};

/// Receives the forces on a range of points. Other forces go to scratch memory, because a branch on the range would
/// often be mispredicted for pairs across the boundary.
struct OwnPoints {
  Real* f;
  Index first;
  std::uint32_t count;
  mutable Real elsewhere[2] = {0, 0};
  PLIANT_INLINE void add(Index i, Real2 force) const {
    const bool own = static_cast<std::uint32_t>(i) - static_cast<std::uint32_t>(first) < count;
    Real* const p = own ? f + 2 * static_cast<std::size_t>(i) : elsewhere;
    store2(p, load2(p) + force);
  }
};

PLIANT_INLINE Points2 gather(const Real* from, const Index* i) {
  return transpose(at(from, i[0]), at(from, i[1]), at(from, i[2]), at(from, i[3]));
}

/// Bit k: whether the vertex of pair e + k may be within delta[k] of the edge. Passes a few too many, never too few:
/// with c = w·u held between 0 and u·u, d² u·u = w·w u·u − c (2 w·u − c), which needs no division.
PLIANT_INLINE unsigned sieve(const Data& data, Index e, Real4 delta) {
  Real4 u[2], w[2];
  for (int k = 0; k < 2; ++k) {
    const auto [p, a] = data.pairs[e + k];
    const auto [q, b] = data.pairs[e + k + 2];
    const Real4 start = join(at(data.x, a), at(data.x, b));
    u[k] = join(at(data.x, data.next[a]), at(data.x, data.next[b])) - start;
    w[k] = join(at(data.x, p), at(data.x, q)) - start;
  }
  const Points2 us = columns(u[0], u[1]), ws = columns(w[0], w[1]);
  const Real4 uu = dot(us, us), ww = dot(ws, ws), wu = dot(ws, us);
  const Real4 c = max(min(wu, uu), Real4{});
  constexpr Real rounding = 64 * std::numeric_limits<Real>::epsilon();
  return bits(((1 - rounding) * ww - delta * delta) * uu <= c * (2 * wu - c));
}

/// −V'(d)/d where the mask is set; 0 at d = 0, where the force has no direction.
template <class Law>
PLIANT_INLINE Real4 push(Real epsilon, Mask4 mask, Real4 d2, Real4 delta) {
  return where(mask & (d2 > 0), Law::push(epsilon, delta, sqrt(d2)));
}

/// The part of a velocity that friction opposes; offset: along the normal, of length √d2.
template <Opposed opposed>
PLIANT_INLINE Points2 rubbed(const Points2& slip, const Points2& offset, Real4 d2) {
  if constexpr (opposed == Opposed::whole)
    return slip;
  else
    return slip - where(d2 > 0, dot(slip, offset) / d2) * offset;
}

/// Forces of the pairs list[0 … count − 1], count ≤ 4.
template <class Law, Rubbing rubbing, Opposed opposed, class Out>
PLIANT_INLINE void add_four(const EdgeLaw& law, const Data& data, const Index* list, Index count, const Out& out) {
  Index p[4], a[4], b[4];
  Real4 delta;
  for (int k = 0; k < 4; ++k) {
    p[k] = data.pairs[list[k]].first;
    a[k] = data.pairs[list[k]].second;
    b[k] = data.next[a[k]];
    delta[k] = data.reach[list[k]];
  }
  const Points2 rp = gather(data.x, p), ra = gather(data.x, a), rb = gather(data.x, b);
  const Points2 u = rb - ra, w = rp - ra;
  const Real4 uu = dot(u, u), ww = dot(w, w);
  const Real4 t = where(uu > 0, min(max(dot(w, u) / uu, Real4{}), all(1)));
  const Points2 offset = w - t * u;
  const Real4 d2 = dot(offset, offset), delta2 = delta * delta;
  const Mask4 touching = (Mask4{0, 1, 2, 3} < static_cast<std::int64_t>(count)) & (d2 < delta2);

  const Mask4 beyond_start = touching & (t > 0);
  // At t = 0 two parts of equal weight cancel.
  const Mask4 pushing = law.edge_weight == law.vertex_weight ? beyond_start : touching;
  Points2 on_edge = push<Law>(law.edge_weight * law.epsilon, pushing, d2, delta) * offset;
  Points2 on_start = push<Law>(law.vertex_weight * law.epsilon, pushing & (ww < delta2), ww, delta) * w;

  if constexpr (rubbing == Rubbing::at_vertex) {
    const Points2 slip = rubbed<opposed>(gather(data.v, p) - gather(data.v, a), offset, d2);
    on_start = on_start + where(touching, all(law.mu)) * slip;
  }
  if constexpr (rubbing == Rubbing::at_contact) {
    Index c[4];
    for (int k = 0; k < 4; ++k) c[k] = data.next[b[k]];
    // Friction at a corner that is nearest on both of its edges acts on the edge that ends there (outline.h).
    const Mask4 carries = beyond_start & ((t < 1) | (dot(rp - rb, gather(data.x, c) - rb) <= 0));
    const Points2 va = gather(data.v, a);
    const Points2 slip = rubbed<opposed>(gather(data.v, p) - va - t * (gather(data.v, b) - va), offset, d2);
    on_edge = on_edge - where(carries, all(law.mu)) * slip;
  }

  const Points2 to_vertex = on_edge - on_start, to_end = -t * on_edge;
  const Points2 to_start = all(-1) * (to_vertex + to_end);
  Real4 p02, p13, a02, a13, b02, b13;
  transpose(to_vertex, p02, p13);
  transpose(to_start, a02, a13);
  transpose(to_end, b02, b13);
  const Real2 force[4][3] = {{low(p02), low(a02), low(b02)},
                             {low(p13), low(a13), low(b13)},
                             {high(p02), high(a02), high(b02)},
                             {high(p13), high(a13), high(b13)}};
  for (int k = 0; k < 4; ++k) {
    out.add(p[k], force[k][0]);
    out.add(a[k], force[k][1]);
    out.add(b[k], force[k][2]);
  }
}

template <class Law, Rubbing rubbing, Opposed opposed, class Out>
PLIANT_INLINE void add_touching(const EdgeLaw& law, const Data& data, Index n, const Out& out) {
  constexpr Index word = 64, block = 16 * word;
  Index list[block + 7];  // pairs of a block that may touch
  for (Index first = 0; first < n; first += block) {
    const Index last = std::min(n, first + block);
    Index count = 0;
    for (Index e = first; e < last; e += word) {
      const Index pairs = std::min(last - e, word), fours = pairs - pairs % 4;
      std::uint64_t found = 0;
      for (Index k = 0; k < fours; k += 4) found |= std::uint64_t(sieve(data, e + k, load4(data.reach + e + k))) << k;
      // The last few pairs are not sieved, because add_four tests them.
      for (Index k = fours; k < pairs; ++k) found |= std::uint64_t(1) << k;
      count += write_bits(found, e, list + count);
    }
    std::fill_n(list + count, 3, 0);  // some pair, for lanes that do not count
    for (Index k = 0; k < count; k += 4) add_four<Law, rubbing, opposed>(law, data, list + k, count - k, out);
  }
}

template <class Law, Opposed opposed, class Out>
PLIANT_INLINE void add_rubbing(const EdgeLaw& law, const Data& data, Index n, const Out& out) {
  if (law.at_contact)
    add_touching<Law, Rubbing::at_contact, opposed>(law, data, n, out);
  else
    add_touching<Law, Rubbing::at_vertex, opposed>(law, data, n, out);
}

template <class Law, class Out>
PLIANT_INLINE void add_by_law(const EdgeLaw& law, const Data& data, Index n, const Out& out) {
  if (law.mu == 0)
    add_touching<Law, Rubbing::none, Opposed::whole>(law, data, n, out);
  else if (law.tangential)
    add_rubbing<Law, Opposed::tangential>(law, data, n, out);
  else
    add_rubbing<Law, Opposed::whole>(law, data, n, out);
}

template <class Out>
PLIANT_INLINE void add_all(const EdgeLaw& law, const Data& data, Index n, const Out& out) {
  if (law.contact == ContactLaw::barrier)
    add_by_law<BarrierOverlap>(law, data, n, out);
  else if (law.contact == ContactLaw::hertz)
    add_by_law<HertzOverlap>(law, data, n, out);
  else
    add_by_law<HarmonicOverlap>(law, data, n, out);
}

}  // namespace

void add_edge_forces(const EdgeLaw& law, std::span<const Pair> pairs, const Real* reach, const Index* next,
                     const Real* x, const Real* v, Real* f) {
  run_fast([&]() PLIANT_INLINE_LAMBDA {
    add_all(law, {pairs.data(), reach, next, x, v}, static_cast<Index>(pairs.size()), Everything{f});
  });
}

void add_edge_forces(const EdgeLaw& law, std::span<const Pair> pairs, const Real* reach, const Index* next,
                     Index own_first, Index own_last, const Real* x, const Real* v, Real* f) {
  run_fast([&]() PLIANT_INLINE_LAMBDA {
    add_all(law, {pairs.data(), reach, next, x, v}, static_cast<Index>(pairs.size()),
            OwnPoints{f, own_first, static_cast<std::uint32_t>(own_last - own_first)});
  });
}

PLIANT_MULTIVERSION
void add_near_pairs(std::span<const Pair> pairs, const Real* reach, Real range, const Index* next, const Real* x,
                    std::vector<Pair>& near, std::vector<Real>& near_reach) {
  const Data data{pairs.data(), reach, next, x, nullptr};
  const auto n = static_cast<Index>(pairs.size());
  for (Index e = 0; e < n; e += 4) {
    const Index left = std::min<Index>(n - e, 4);  // the last few pairs are not sieved
    for (unsigned found = left == 4 ? sieve(data, e, load4(reach + e) + all(range)) : (1u << left) - 1; found != 0;
         found &= found - 1) {
      const Index k = e + std::countr_zero(found);
      near.push_back(pairs[k]);
      near_reach.push_back(reach[k]);
    }
  }
}

}  // namespace pliant
