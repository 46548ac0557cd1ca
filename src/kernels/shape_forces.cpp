#include <pliant/kernels/shape_forces.h>

#include <cstddef>
#include <utility>

#include <pliant/base/simd.h>

// As PLIANT_MULTIVERSION, but with a separate width for each instruction set: GCC splits vectors that are wider than
// the registers lane by lane, which is slower than scalar code.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(PLIANT_ONE_VERSION)
#define PLIANT_WIDER_TARGETS
#endif

namespace pliant {
namespace {

typedef Real Real8 __attribute__((vector_size(8 * sizeof(Real))));

template <int Width>
struct OfWidth;
template <>
struct OfWidth<2> {
  using Type = simd::Real2;
};
template <>
struct OfWidth<4> {
  using Type = simd::Real4;
};
template <>
struct OfWidth<8> {
  using Type = Real8;
};
template <int Width>
using Lanes = typename OfWidth<Width>::Type;
template <class V>
inline constexpr int width = sizeof(V) / sizeof(Real);

template <class V>
PLIANT_INLINE V load(const Real* p) {
  V a;
  std::memcpy(&a, p, sizeof a);
  return a;
}
template <class V>
PLIANT_INLINE void add_to(Real* p, V a) {
  a += load<V>(p);
  std::memcpy(p, &a, sizeof a);
}

/// Lane k of the result is lane From(k) of a and b in succession.
template <auto From, class V, int... K>
PLIANT_INLINE V pick(V a, V b, std::integer_sequence<int, K...>) {
  return __builtin_shufflevector(a, b, From(K)...);
}
template <auto From, class V>
PLIANT_INLINE V pick(V a, V b) {
  return pick<From>(a, b, std::make_integer_sequence<int, width<V>>());
}
/// The successor of each lane of a; the last one is the first lane of b.
template <class V>
PLIANT_INLINE V following(V a, V b) {
  return pick<[](int k) { return k + 1; }>(a, b);
}
/// The predecessor of each lane of b; the first one is the last lane of a.
template <class V>
PLIANT_INLINE V preceding(V a, V b) {
  return pick<[](int k) { return width<V> - 1 + k; }>(a, b);
}

template <class V, class Half, int... K>
PLIANT_INLINE V join(Half a, Half b, std::integer_sequence<int, K...>) {
  return __builtin_shufflevector(a, b, K...);
}
/// As many points as V takes, from i on in a polygon of n vertices; goes round at most once.
template <class V>
PLIANT_INLINE V load_points(const Real* x, Index n, Index i) {
  if constexpr (width<V> == 2) {
    return load<V>(x + 2 * (i < n ? i : i - n));
  } else {
    using Half = Lanes<width<V> / 2>;
    return join<V>(load_points<Half>(x, n, i), load_points<Half>(x, n, i + width<Half> / 2),
                   std::make_integer_sequence<int, width<V>>());
  }
}
/// Adds the first `count` points of a to f, not all of them.
template <class V>
PLIANT_INLINE void add_points(Real* f, V a, Index count) {
  for (int k = 0; k < width<V> / 2; ++k)
    if (k < count) add_to(f + 2 * k, simd::Real2{a[2 * k], a[2 * k + 1]});
}

/// As polygon_area, about the first vertex: the terms r_i × r_{i+1} of the first and the last edge vanish.
template <class V>
PLIANT_INLINE Real area(const Real* x, Index n) {
  constexpr int terms = width<V> / 2;
  static_assert(terms <= 2);
  V origin, sum{};
  for (int k = 0; k < width<V>; ++k) origin[k] = x[k % 2];
  // Where the number of terms is odd the first edge's makes it even.
  for (Index i = n % terms == 0 ? 1 : 0; i < n - 1; i += terms) {
    const V r = load<V>(x + 2 * i) - origin, s = load<V>(x + 2 * i + 2) - origin;
    sum += r * pick<[](int k) { return k ^ 1; }>(s, s);
  }
  Real twice = 0;
  for (int k = 0; k < width<V>; k += 2) twice += sum[k] - sum[k + 1];
  return twice / 2;
}

enum class Bent {
  none,
  unit,  ///< directions of edges
  full   ///< whole edges
};

/// Edges in succession.
template <class V>
struct Edges {
  V x{}, y{}, inverse{};  ///< the edge and 1/length
  V ux{}, uy{};           ///< its direction

  /// Member by member: GCC 12 copies the whole through general registers.
  PLIANT_INLINE void become(const Edges& other) {
    x = other.x;
    y = other.y;
    inverse = other.inverse;
    ux = other.ux;
    uy = other.uy;
  }
};

/// Edges from i on in a polygon of n vertices; goes round at most once.
template <bool Lengths, class V>
PLIANT_INLINE void edges_from(const Real* x, Index n, Index i, Edges<V>& e) {
  constexpr int half = width<V> / 2;
  V a, b;
  if (i + width<V> <= n) {
    const Real *p = x + 2 * i, *q = p + width<V>;
    const V last = load<V>(q);
    a = load<V>(p + 2) - load<V>(p);
    b = (i + width<V> < n ? load<V>(q + 2) : pick<[](int k) { return k + 2; }>(last, load<V>(x))) - last;
  } else {
    a = load_points<V>(x, n, i + 1) - load_points<V>(x, n, i);
    b = load_points<V>(x, n, i + half + 1) - load_points<V>(x, n, i + half);
  }
  e.x = pick<[](int k) { return 2 * k; }>(a, b);
  e.y = pick<[](int k) { return 2 * k + 1; }>(a, b);
  if constexpr (Lengths) {
    const V squared = e.x * e.x + e.y * e.y;
    V length;
    for (int k = 0; k < width<V>; ++k) length[k] = std::sqrt(squared[k]);
    e.inverse = 1 / length;
    e.ux = e.x * e.inverse;
    e.uy = e.y * e.inverse;
  }
}

/// Data for the forces on a polygon besides its edges.
struct Factors {
  Real half_pressure, stiffness, stiffness_rest, bending;
};

/// Data that a block of edges passes to the next block.
template <class V>
struct Carry {
  V sine{}, bx{}, by{};
  V x{}, y{};  ///< the full edge, for bending of full edges
};

/// Forces on the first vertices of some edges. With e the edges and l̂ their directions, the force on vertex i is
/// g_i − g_{i−1} of g = ∂U/∂e, and half the pressure times the quarter turns of both edges. For the bending energy g_i
/// = −c (s_i − s_{i−1})/l_i times the quarter turn of l̂_i, s_i = l̂_i × l̂_{i+1}: equal to the vectors (û·ŵ) û − ŵ of
/// the element form, without their cancellation. For full edges g_i = c (2 e_i − e_{i−1} − e_{i+1}). `next` follows the
/// last edge: directions, or full edges.
template <bool Lengths, Bent bent, class V>
PLIANT_INLINE void forces(const Factors& factors, const Edges<V>& e, V next_x, V next_y, Carry<V>& carry, V& low,
                          V& high) {
  V along{}, across{};  // g in units of e and of its quarter turn
  if constexpr (Lengths) along = factors.stiffness - factors.stiffness_rest * e.inverse;
  if constexpr (bent == Bent::unit) {
    const V sine = e.ux * following(e.uy, next_y) - e.uy * following(e.ux, next_x);
    across = -factors.bending * e.inverse * e.inverse * (sine - preceding(carry.sine, sine));
    carry.sine = sine;
  }
  if constexpr (bent == Bent::full) along += 2 * factors.bending;
  const V ahead = factors.half_pressure + across, behind = factors.half_pressure - across;
  V bx = -behind * e.y - along * e.x, by = behind * e.x - along * e.y;
  V fx = along * e.x - ahead * e.y, fy = along * e.y + ahead * e.x;
  if constexpr (bent == Bent::full) {  // bending acts on both neighbours
    const V gx = factors.bending * (following(e.x, next_x) + preceding(carry.x, e.x));
    const V gy = factors.bending * (following(e.y, next_y) + preceding(carry.y, e.y));
    bx += gx;
    by += gy;
    fx -= gx;
    fy -= gy;
    carry.x = e.x;
    carry.y = e.y;
  }
  fx += preceding(carry.bx, bx);
  fy += preceding(carry.by, by);
  carry.bx = bx;
  carry.by = by;
  constexpr int lanes = width<V>;
  low = pick<[](int k) { return k / 2 + k % 2 * lanes; }>(fx, fy);
  high = pick<[](int k) { return lanes / 2 + k / 2 + k % 2 * lanes; }>(fx, fy);
}

template <bool Lengths, Bent bent, class V>
PLIANT_INLINE void add_polygon(const Factors& factors, const Real* x, Index n, Real* f) {
  constexpr int lanes = width<V>;
  constexpr bool full = bent == Bent::full;
  Edges<V> e;
  edges_from<Lengths>(x, n, 0, e);
  const Real first_x = e.x[0], first_y = e.y[0], first_inverse = e.inverse[0];
  const V round_x = (full ? first_x : e.ux[0]) + V{}, round_y = (full ? first_y : e.uy[0]) + V{};
  Carry<V> carry;  // no contribution to the first vertices, which are completed at the end
  V low, high;
  Index i = 0;
  for (; i + lanes < n; i += lanes) {
    Edges<V> next;
    edges_from<Lengths>(x, n, i + lanes, next);
    forces<Lengths, bent>(factors, e, full ? next.x : next.ux, full ? next.y : next.uy, carry, low, high);
    add_to(f + 2 * i, low);
    add_to(f + 2 * i + lanes, high);
    e.become(next);
  }
  forces<Lengths, bent>(factors, e, round_x, round_y, carry, low, high);
  if (i + lanes == n) {
    add_to(f + 2 * i, low);
    add_to(f + 2 * i + lanes, high);
  } else {
    add_points(f + 2 * i, low, n - i);
    add_points(f + 2 * i + lanes, high, n - i - lanes / 2);
  }
  const Index end = n - 1 - i;
  Real gx = 0, gy = 0;  // of the first edge, from the last one
  if constexpr (bent == Bent::unit) {
    const Real g = factors.bending * first_inverse * first_inverse * carry.sine[end];
    gx = -g * first_y;
    gy = g * first_x;
  }
  if constexpr (full) {
    gx = -factors.bending * carry.x[end];
    gy = -factors.bending * carry.y[end];
  }
  f[0] += carry.bx[end] + gx;
  f[1] += carry.by[end] + gy;
  f[2] -= gx;
  f[3] -= gy;
}

template <class V>
PLIANT_INLINE void add_polygon(const ShapeLaw& law, Real a0, Real l0, const Real* x, Index n, Real* f) {
  const Real k_a = law.relative_area ? law.k_a / a0 : law.k_a;
  const Real pressure = law.k_a != 0 ? k_a * (area<Lanes<(width<V> < 4 ? width<V> : 4)>>(x, n) - a0) : 0;
  const Real stiffness = law.k_l * n;
  if (law.k_b != 0) {
    const Real bending = law.k_b / (n * l0 * l0);
    const Factors factors{pressure / 2, stiffness, stiffness * l0, law.full_edges ? bending / (l0 * l0) : bending};
    if (!law.full_edges)
      add_polygon<true, Bent::unit, V>(factors, x, n, f);
    else if (law.k_l != 0)
      add_polygon<true, Bent::full, V>(factors, x, n, f);
    else
      add_polygon<false, Bent::full, V>(factors, x, n, f);
  } else if (law.k_l != 0) {
    add_polygon<true, Bent::none, V>({pressure / 2, stiffness, stiffness * l0, 0}, x, n, f);
  } else if (law.k_a != 0) {
    add_polygon<false, Bent::none, V>({pressure / 2, 0, 0, 0}, x, n, f);
  }
}

template <int Width>
PLIANT_INLINE void add_particles(const ShapeLaw& law, const Index* offset, const Real* a0, const Real* l0, Index first,
                                 Index last, const Real* x, Real* f, const Prefetch& prefetch) {
  for (Index m = first; m < last; ++m) {
    const Index n = offset[m + 1] - offset[m];
    const std::ptrdiff_t begin = 2 * static_cast<std::ptrdiff_t>(offset[m]);
    prefetch.fetch(begin, begin + 2 * n);
    if (n < 3) continue;
    if (Width == 8 && n >= 8)  // below, eight edges could go round more than once
      add_polygon<Lanes<8>>(law, a0[m], l0[m], x + begin, n, f + begin);
    else
      add_polygon<Lanes<(Width < 4 ? Width : 4)>>(law, a0[m], l0[m], x + begin, n, f + begin);
  }
}

/// Instruction set for which the whole file is compiled.
#if defined(__AVX512F__)
constexpr int own_width = 8;
#elif defined(__AVX2__)
constexpr int own_width = 4;
#else
constexpr int own_width = 2;
#endif

#ifdef PLIANT_WIDER_TARGETS
[[gnu::target("arch=x86-64-v4")]] void add_8(const ShapeLaw& law, const Index* offset, const Real* a0, const Real* l0,
                                             Index first, Index last, const Real* x, Real* f,
                                             const Prefetch& prefetch) {
  add_particles<8>(law, offset, a0, l0, first, last, x, f, prefetch);
}

[[gnu::target("arch=x86-64-v3")]] void add_4(const ShapeLaw& law, const Index* offset, const Real* a0, const Real* l0,
                                             Index first, Index last, const Real* x, Real* f,
                                             const Prefetch& prefetch) {
  add_particles<4>(law, offset, a0, l0, first, last, x, f, prefetch);
}
#endif

}  // namespace

void add_shape_forces(const ShapeLaw& law, const Index* offset, const Real* a0, const Real* l0, Index first, Index last,
                      const Real* x, Real* f, const Prefetch& prefetch) {
#ifdef PLIANT_WIDER_TARGETS
  if (__builtin_cpu_supports("x86-64-v4")) return add_8(law, offset, a0, l0, first, last, x, f, prefetch);
  if (__builtin_cpu_supports("x86-64-v3")) return add_4(law, offset, a0, l0, first, last, x, f, prefetch);
#endif
  add_particles<own_width>(law, offset, a0, l0, first, last, x, f, prefetch);
}

}  // namespace pliant
