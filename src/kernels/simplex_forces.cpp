#include <pliant/kernels/simplex_forces.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <limits>

#include <pliant/base/simd.h>
#include <pliant/base/vector3.h>
#include <pliant/kernels/contact_law.h>

namespace pliant {
namespace {

using namespace simd;
using Lanes3 = Vector3<Real4>;

/// Four pairs; fewer than four are filled up with copies.
struct Four {
  const SimplexPair* pair[4];

  PLIANT_INLINE Lanes3 points(const Real* a, int k) const {
    Real2 xy[4];
    Real z[4];
    for (int l = 0; l < 4; ++l) {
      const Real* const p = a + 3 * static_cast<std::ptrdiff_t>(pair[l]->points[k]);
      xy[l] = load2(p);
      z[l] = p[2];
    }
    const Points2 p = transpose(xy[0], xy[1], xy[2], xy[3]);
    return {p.x, p.y, Real4{z[0], z[1], z[2], z[3]}};
  }
  PLIANT_INLINE Real4 delta() const { return Real4{pair[0]->delta, pair[1]->delta, pair[2]->delta, pair[3]->delta}; }
  PLIANT_INLINE Real4 factors(int k) const {
    return Real4{pair[0]->factors[k], pair[1]->factors[k], pair[2]->factors[k], pair[3]->factors[k]};
  }
};

/// a where the mask is set, else 0.
PLIANT_INLINE Lanes3 only(const Mask4& mask, const Lanes3& a) {
  return {where(mask, a.x), where(mask, a.y), where(mask, a.z)};
}
PLIANT_INLINE void add(Lanes3& sum, const Lanes3& a) { sum = sum + a; }
PLIANT_INLINE void subtract(Lanes3& sum, const Lanes3& a) { sum = sum - a; }

/// Adds the forces on the four points of each pair, pair by pair, so that the sums do not depend on which pairs are
/// computed together. Forces on points that receive none go to scratch memory.
struct Forces {
  Real* f;
  PointRange own;
  mutable Real elsewhere[3] = {0, 0, 0};

  PLIANT_INLINE void add(const Four& four, const Lanes3& on_0, const Lanes3& on_1, const Lanes3& on_2,
                         const Lanes3& on_3) const {
    const Lanes3* const force[4] = {&on_0, &on_1, &on_2, &on_3};
    Real2 xy[4][4];
    for (int k = 0; k < 4; ++k) {
      Real4 lanes02, lanes13;
      transpose(Points2{force[k]->x, force[k]->y}, lanes02, lanes13);
      xy[0][k] = low(lanes02), xy[1][k] = low(lanes13), xy[2][k] = high(lanes02), xy[3][k] = high(lanes13);
    }
    for (int l = 0; l < 4; ++l)
      for (int k = 0; k < 4; ++k) {
        const Index i = four.pair[l]->points[k];
        const bool mine = static_cast<std::uint32_t>(i) - static_cast<std::uint32_t>(own.first) <
                          static_cast<std::uint32_t>(own.last - own.first);
        Real* const to = mine ? f + 3 * static_cast<std::ptrdiff_t>(i) : elsewhere;
        store2(to, load2(to) + xy[l][k]);
        to[2] += force[k]->z[l];
      }
  }
};

/// Nearest place of a segment from a along u to the point a + w.
struct Foot4 {
  Real4 t;
  Lanes3 offset;  ///< from there to the point
  Real4 d2;
  PLIANT_INLINE Foot4(const Lanes3& w, const Lanes3& u) {
    const Real4 uu = dot(u, u);
    t = where(uu > 0, min(max(dot(w, u) / uu, Real4{}), all(1)));
    offset = w - t * u;
    d2 = dot(offset, offset);
  }
  PLIANT_INLINE Mask4 inside() const { return (t > 0) & (t < 1); }
};

/// −V'(d)/d where the mask is set; 0 at d = 0, where the force has no direction.
PLIANT_INLINE Real4 push(Real epsilon, Mask4 mask, Real4 d2, Real4 delta) {
  return where(mask & (d2 > 0), HarmonicOverlap::push(epsilon, delta, sqrt(d2)));
}
/// V(d) where the mask is set.
PLIANT_INLINE Real4 energy(Real epsilon, Mask4 mask, Real4 d2, Real4 delta) {
  const Real4 overlap = 1 - sqrt(d2) / delta;
  return where(mask, epsilon / 2 * overlap * overlap);
}

/// The part of a velocity that friction opposes; offset: along the normal, of length √d2.
PLIANT_INLINE Lanes3 rubbed(bool tangential, const Lanes3& slip, const Lanes3& offset, Real4 d2) {
  return tangential ? slip - where(d2 > 0, dot(slip, offset) / d2) * offset : slip;
}

constexpr Real simplex_rounding = 64 * std::numeric_limits<Real>::epsilon();

/// Whether the point a + w may be within a distance of the segment from a along u. Never false where it is: with
/// c = w·u held between 0 and u·u, d² u·u = w·w u·u − c (2 w·u − c), which needs no division.
PLIANT_INLINE Mask4 near_segment(const Lanes3& w, const Lanes3& u, Real4 distance2) {
  const Real4 uu = dot(u, u), ww = dot(w, w), wu = dot(w, u), c = max(min(wu, uu), Real4{});
  return ((1 - simplex_rounding) * ww - distance2) * uu <= c * (2 * wu - c);
}

/// A vertex and a face. Edge k runs from corner k to corner k + 1.
struct VertexFaces {
  /// Whether they may be within a distance of each other.
  PLIANT_INLINE static Mask4 near(const Four& four, const Real* x, Real4 distance) {
    const Lanes3 p = four.points(x, 0), a = four.points(x, 1), b = four.points(x, 2), c = four.points(x, 3);
    const Lanes3 u = b - a, v = c - a, w = p - a, n = cross(u, v);
    const Real4 n2 = dot(n, n), height = dot(w, n), distance2 = distance * distance;
    const Real4 of_c = dot(cross(u, w), n), of_b = dot(cross(w, v), n);
    const Mask4 inside = (of_b > 0) & (of_c > 0) & (of_b + of_c < n2);
    return ((height * height * (1 - simplex_rounding) <= distance2 * n2) & inside) | near_segment(w, u, distance2) |
           near_segment(p - b, c - b, distance2) | near_segment(p - c, a - c, distance2);
  }

  template <bool rubs>
  PLIANT_INLINE static void add_four(const SimplexLaw& law, const Four& four, Mask4 counts, const Real* x,
                                     const Real* v, const Forces& forces, std::vector<Index>& on_rim) {
    const Lanes3 p = four.points(x, 0), a = four.points(x, 1), b = four.points(x, 2), c = four.points(x, 3);
    const Real4 delta = four.delta(), delta2 = delta * delta;
    const Lanes3 w[3] = {p - a, p - b, p - c}, u[3] = {b - a, c - b, a - c};
    const Lanes3 to_third = c - a, n = cross(u[0], to_third);
    const Real4 n2 = dot(n, n), of_2 = dot(cross(w[0], to_third), n), of_3 = dot(cross(u[0], w[0]), n),
                of_1 = n2 - of_2 - of_3;
    const Mask4 inside = (of_1 > 0) & (of_2 > 0) & (of_3 > 0);
    const Foot4 foot[3] = {{w[0], u[0]}, {w[1], u[1]}, {w[2], u[2]}};

    Lanes3 on_vertex{}, on_corner[3] = {};
    const Real4 height = dot(w[0], n) / n2;
    const Lanes3 offset = height * n;
    const Real4 d2 = dot(offset, offset);
    const Mask4 pressed = counts & inside & (d2 < delta2);
    if (any(pressed)) {
      const Real4 weight[3] = {of_1 / n2, of_2 / n2, of_3 / n2};
      Lanes3 force = push(law.epsilon, pressed, d2, delta) * offset;
      if constexpr (rubs) {
        const Lanes3 slip = four.points(v, 0) - weight[0] * four.points(v, 1) - weight[1] * four.points(v, 2) -
                            weight[2] * four.points(v, 3);
        subtract(force, only(pressed, all(law.mu) * rubbed(law.tangential, slip, offset, d2)));
      }
      on_vertex = only(pressed, force);
      for (int k = 0; k < 3; ++k) on_corner[k] = only(pressed, (-weight[k]) * force);
    }

    const Real4 nearest = min(foot[0].d2, min(foot[1].d2, foot[2].d2));
    const Mask4 at_rim = counts & (nearest < delta2);
    if (any(at_rim)) {
      // The first of several nearest edges.
      const Mask4 first = foot[0].d2 == nearest, second = ~first & (foot[1].d2 == nearest);
      const Mask4 is_nearest[3] = {first, second, ~(first | second)};
      Real4 factor_at[3] = {four.factors(0), four.factors(1), four.factors(2)};
      for (int k = 0; k < 3; ++k) {
        const int next = k == 2 ? 0 : k + 1;
        const Real4 factor = select(is_nearest[k] & ~inside, all(0.5), all(-0.5));
        const Mask4 on_edge = at_rim & foot[k].inside() & (foot[k].d2 < delta2);
        factor_at[k] += where(foot[k].t <= 0, factor);
        factor_at[next] += where(foot[k].t >= 1, factor);
        if (!any(on_edge)) continue;
        const Lanes3 force = (factor * push(law.epsilon, on_edge, foot[k].d2, delta)) * foot[k].offset;
        add(on_vertex, force);
        subtract(on_corner[k], (1 - foot[k].t) * force);
        subtract(on_corner[next], foot[k].t * force);
      }
      for (int k = 0; k < 3; ++k) {
        const Real4 at_corner = dot(w[k], w[k]);
        const Mask4 touches = at_rim & (at_corner < delta2);
        if (!any(touches)) continue;
        const Lanes3 force = (factor_at[k] * push(law.epsilon, touches, at_corner, delta)) * w[k];
        add(on_vertex, force);
        subtract(on_corner[k], force);
      }
      if constexpr (rubs)
        for (unsigned rest = bits(at_rim & ~inside); rest != 0; rest &= rest - 1)
          on_rim.push_back(four.pair[std::countr_zero(rest)]->element);
    } else if (!any(pressed)) {
      return;
    }
    forces.add(four, on_vertex, on_corner[0], on_corner[1], on_corner[2]);
  }
};

/// Two edges.
struct EdgePairs {
  PLIANT_INLINE static Mask4 near(const Four& four, const Real* x, Real4 distance) {
    const Lanes3 a = four.points(x, 0), b = four.points(x, 1), c = four.points(x, 2), d = four.points(x, 3);
    const Lanes3 u = b - a, v = d - c, w = c - a, n = cross(u, v);
    const Real4 n2 = dot(n, n), height = dot(w, n), distance2 = distance * distance;
    const Real4 s = dot(cross(w, v), n), t = dot(cross(w, u), n);
    const Mask4 inside = (s > 0) & (s < n2) & (t > 0) & (t < n2);
    return ((height * height * (1 - simplex_rounding) <= distance2 * n2) & inside) | near_segment(a - c, v, distance2) |
           near_segment(b - c, v, distance2) | near_segment(w, u, distance2) | near_segment(d - a, u, distance2);
  }

  template <bool rubs>
  PLIANT_INLINE static void add_four(const SimplexLaw& law, const Four& four, Mask4 counts, const Real* x,
                                     const Real* v, const Forces& forces, std::vector<Index>&) {
    const Lanes3 r[4] = {four.points(x, 0), four.points(x, 1), four.points(x, 2), four.points(x, 3)};
    const Real4 delta = four.delta(), delta2 = delta * delta;
    const Lanes3 edge[2] = {r[1] - r[0], r[3] - r[2]};
    const Lanes3 w = r[2] - r[0], n = cross(edge[0], edge[1]);
    const Real4 n2 = dot(n, n), s = dot(cross(w, edge[1]), n), t = dot(cross(w, edge[0]), n);
    const Mask4 inside = (s > 0) & (s < n2) & (t > 0) & (t < n2);
    // Nearest places of each end on the other edge.
    const Foot4 foot[4] = {{r[0] - r[2], edge[1]}, {r[1] - r[2], edge[1]}, {w, edge[0]}, {r[3] - r[0], edge[0]}};
    const Real4 nearest = min(min(foot[0].d2, foot[1].d2), min(foot[2].d2, foot[3].d2));
    const Real4 across = dot(w, n) / n2;
    const Lanes3 offset = (-across) * n;
    const Real4 d2 = dot(offset, offset);
    const Mask4 crossing = counts & inside & (d2 < delta2);
    const Mask4 at_end = counts & (nearest < delta2);
    if (!any(crossing | at_end)) return;

    Real4 value{};
    Lanes3 force[4] = {};
    Lanes3 rub[4] = {};
    const Real4 u2 = dot(edge[0], edge[0]), v2 = dot(edge[1], edge[1]), sine2 = n2 / (u2 * v2);
    const Real4 s0 = law.s0 > 0 ? all(law.s0) : four.factors(0);
    const Real4 part = min(sine2 / s0, all(1)), mollifier = part * (2 - part);
    if (any(crossing)) {
      const Real4 along = s / n2, other = t / n2, weight[4] = {1 - along, along, other - 1, -other};
      const Lanes3 pull = push(law.epsilon, crossing, d2, delta) * offset;
      value = energy(law.epsilon, crossing, d2, delta);
      for (int k = 0; k < 4; ++k) force[k] = only(crossing, weight[k] * pull);
      if constexpr (rubs) {
        Lanes3 slip = weight[0] * four.points(v, 0);
        for (int k = 1; k < 4; ++k) add(slip, weight[k] * four.points(v, k));
        const Lanes3 drag = (law.mu * mollifier) * rubbed(law.tangential, slip, offset, d2);
        for (int k = 0; k < 4; ++k) rub[k] = only(crossing, weight[k] * drag);
      }
    }
    if (any(at_end)) {
      // The first of several nearest ends.
      Mask4 left = ~inside;
      Real4 of_ends[2][2] = {{all(1), all(1)}, {all(1), all(1)}};
      for (int k = 0; k < 4; ++k) {
        const Mask4 is_nearest = left & (foot[k].d2 == nearest);
        left &= ~is_nearest;
        const Real4 factor = select(is_nearest, Real4{}, all(-1));
        Real4& at_start = k < 2 ? of_ends[k][0] : of_ends[0][k - 2];
        Real4& at_finish = k < 2 ? of_ends[k][1] : of_ends[1][k - 2];
        at_start += where(foot[k].t <= 0, factor);
        at_finish += where(foot[k].t >= 1, factor);
        const Mask4 on_edge = at_end & foot[k].inside() & (foot[k].d2 < delta2);
        if (!any(on_edge)) continue;
        const Lanes3 pull = (factor * push(law.epsilon, on_edge, foot[k].d2, delta)) * foot[k].offset;
        value += factor * energy(law.epsilon, on_edge, foot[k].d2, delta);
        const int start = k < 2 ? 2 : 0;
        add(force[k], pull);
        subtract(force[start], (1 - foot[k].t) * pull);
        subtract(force[start + 1], foot[k].t * pull);
      }
      for (int k = 0; k < 2; ++k)
        for (int l = 0; l < 2; ++l) {
          const Lanes3 between = r[k] - r[2 + l];
          const Real4 apart2 = dot(between, between);
          const Mask4 touches = at_end & (apart2 < delta2);
          if (!any(touches)) continue;
          const Lanes3 pull = (of_ends[k][l] * push(law.epsilon, touches, apart2, delta)) * between;
          value += of_ends[k][l] * energy(law.epsilon, touches, apart2, delta);
          add(force[k], pull);
          subtract(force[2 + l], pull);
        }
    }
    // −∂(m I): the factor turns with the edges.
    for (Lanes3& one : force) one = mollifier * one;
    const Real4 turning = value * (2 / s0 * (1 - part));
    if (any(turning != 0)) {
      const Lanes3 by_first = (turning * 2 / u2) * ((1 / v2) * cross(edge[1], n) - sine2 * edge[0]),
                   by_second = (turning * 2 / v2) * ((1 / u2) * cross(n, edge[0]) - sine2 * edge[1]);
      add(force[0], by_first);
      subtract(force[1], by_first);
      add(force[2], by_second);
      subtract(force[3], by_second);
    }
    if constexpr (rubs)
      for (int k = 0; k < 4; ++k) subtract(force[k], rub[k]);
    forces.add(four, force[0], force[1], force[2], force[3]);
  }
};

/// Calls visit(e, found) for each 64 pairs from e on; the bits of `found` are the pairs that may be within
/// delta + range of each other.
template <class Kind, class Visit>
PLIANT_INLINE void sieve(std::span<const SimplexPair> pairs, Real range, const Real* x, Visit&& visit) {
  const auto n = static_cast<Index>(pairs.size());
  constexpr Index word = 64;
  for (Index e = 0; e < n; e += word) {
    const Index count = std::min(n - e, word);
    std::uint64_t found = 0;
    for (Index k = 0; k < count; k += 4) {
      Four four;
      for (Index l = 0; l < 4; ++l) four.pair[l] = &pairs[e + std::min(k + l, count - 1)];
      found |= std::uint64_t(bits(Kind::near(four, x, four.delta() + range) & first(count - k))) << k;
    }
    visit(e, found);
  }
}

template <class Kind, bool rubs>
PLIANT_INLINE void add_touching(const SimplexLaw& law, std::span<const SimplexPair> pairs, PointRange own,
                                const Real* x, const Real* v, Real* f, std::vector<Index>& on_rim) {
  const Forces forces{f, own};
  // Up to three pairs wait until four have come together.
  Index list[3 + 64 + 7], waiting = 0;
  const auto add = [&](const Index* which, Index count) PLIANT_INLINE_LAMBDA {
    Four four;
    for (Index l = 0; l < 4; ++l) four.pair[l] = &pairs[which[std::min(l, count - 1)]];
    Kind::template add_four<rubs>(law, four, first(count), x, v, forces, on_rim);
  };
  sieve<Kind>(pairs, 0, x, [&](Index e, std::uint64_t found) PLIANT_INLINE_LAMBDA {
    waiting += write_bits(found, e, list + waiting);
    Index k = 0;
    for (; k + 4 <= waiting; k += 4) add(list + k, 4);
    std::copy(list + k, list + waiting, list);
    waiting -= k;
  });
  if (waiting > 0) add(list, waiting);
}

template <class Kind>
PLIANT_INLINE void add_all(const SimplexLaw& law, std::span<const SimplexPair> pairs, PointRange own, const Real* x,
                           const Real* v, Real* f, std::vector<Index>& on_rim) {
  if (law.mu > 0)
    add_touching<Kind, true>(law, pairs, own, x, v, f, on_rim);
  else
    add_touching<Kind, false>(law, pairs, own, x, v, f, on_rim);
}

template <class Kind>
PLIANT_INLINE void add_near(std::span<const SimplexPair> pairs, Real range, const Real* x,
                            std::vector<SimplexPair>& near) {
  sieve<Kind>(pairs, range, x, [&](Index e, std::uint64_t found) PLIANT_INLINE_LAMBDA {
    for (; found != 0; found &= found - 1) near.push_back(pairs[e + std::countr_zero(found)]);
  });
}

}  // namespace

void add_vertex_face_forces(const SimplexLaw& law, std::span<const SimplexPair> pairs, PointRange own, const Real* x,
                            const Real* v, Real* f, std::vector<Index>& on_rim) {
  run_fast([&]() PLIANT_INLINE_LAMBDA { add_all<VertexFaces>(law, pairs, own, x, v, f, on_rim); });
}

void add_edge_pair_forces(const SimplexLaw& law, std::span<const SimplexPair> pairs, PointRange own, const Real* x,
                          const Real* v, Real* f) {
  std::vector<Index> none;
  run_fast([&]() PLIANT_INLINE_LAMBDA { add_all<EdgePairs>(law, pairs, own, x, v, f, none); });
}

PLIANT_MULTIVERSION
void add_near_vertex_faces(std::span<const SimplexPair> pairs, Real range, const Real* x,
                           std::vector<SimplexPair>& near) {
  add_near<VertexFaces>(pairs, range, x, near);
}

PLIANT_MULTIVERSION
void add_near_edge_pairs(std::span<const SimplexPair> pairs, Real range, const Real* x,
                         std::vector<SimplexPair>& near) {
  add_near<EdgePairs>(pairs, range, x, near);
}

}  // namespace pliant
