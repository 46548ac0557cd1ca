// Eight disks at a time. The scalar code here is off the hot path.
#include <pliant/model/base_friction.h>

#include <algorithm>
#include <cstddef>

#include <pliant/base/simd8.h>
#include <pliant/model/limit_surface.h>

namespace pliant {

using simd::any;
using simd::load8;
using simd::Mask8;
using simd::Real4;
using simd::Real8;
using simd::select;
using simd::store8;

namespace {

/// Where eight disks are, and how fast. Pointers to the first of them.
struct DisksOnBase {
  const Real *x, *angle, *v, *spin, *sigma, *mass;

  PLIANT_INLINE DisksOnBase from(Index i) const {
    const std::ptrdiff_t two = 2 * std::ptrdiff_t(i);
    return {x + two, angle + i, v + two, spin + i, sigma + i, mass + i};
  }
};

struct Points8 {
  Real8 x, y;
};
PLIANT_INLINE Points8 points(const Real* p) {
  const Real8 low = load8(p), high = load8(p + 8);
  return {{__builtin_shufflevector(low.a, low.b, 0, 2, 4, 6), __builtin_shufflevector(high.a, high.b, 0, 2, 4, 6)},
          {__builtin_shufflevector(low.a, low.b, 1, 3, 5, 7), __builtin_shufflevector(high.a, high.b, 1, 3, 5, 7)}};
}
/// The inverse: for the first four lanes, and for the other four.
PLIANT_INLINE Real8 points(Real4 x, Real4 y) {
  return {__builtin_shufflevector(x, y, 0, 4, 1, 5), __builtin_shufflevector(x, y, 2, 6, 3, 7)};
}

/// Rows of four numbers of each disk become columns, or the other way round.
PLIANT_INLINE void transpose(std::array<Real8, 4>& a) {
  simd::transpose(a[0].a, a[1].a, a[2].a, a[3].a);
  simd::transpose(a[0].b, a[1].b, a[2].b, a[3].b);
}

PLIANT_INLINE void subtract(Real* from, const Real8& a, Index count) {
  if (count >= 8) return store8(from, load8(from) - a);
  if (count >= 4) simd::store4(from, simd::load4(from) - a.a);
  std::array<Real, 8> rest;
  store8(rest.data(), a);
  for (Index k = count >= 4 ? 4 : 0; k < count; ++k) from[k] -= rest[k];
}

/// The law. The result of a disk does not depend on the other disks.
struct EightOnBase {
  static constexpr Real sticks = BaseFriction::sticks;

  const BaseFriction& base;
  // As in Touch.
  std::array<Real8, 4> next;
  Real8 held_x, held_y, twist, lost;
  Real8 stiffness, gamma, most, radius;

  PLIANT_INLINE explicit EightOnBase(const BaseFriction& law) : base(law) {}

  /// past: their current histories, one after the other.
  PLIANT_INLINE void find(const DisksOnBase& d, const Real* past, const Mask8& known) {
    const auto [x, y] = points(d.x);
    const Real8 angle = load8(d.angle), sigma = load8(d.sigma), mass = load8(d.mass);
    for (int k = 0; k < 4; ++k) next[k] = {simd::load4(past + 4 * k), simd::load4(past + 4 * (k + 4))};
    transpose(next);

    const Real8 per_sigma = 1 / sigma, weight = mass * base.gravity, dynamic = base.mu_dynamic * weight;
    stiffness = base.all_alike ? Real8(base.epsilon) : base.epsilon * (per_sigma * per_sigma);
    radius = sigma / 2;
    most = base.mu_static * weight;
    const Real8 dx = x - next[0], dy = y - next[1], wound = radius * (angle - next[2]);
    held_x = stiffness * dx, held_y = stiffness * dy, twist = stiffness * wound;
    const Mask8 slid = next[3] != sticks;
    const Real8 way = limit(known, select(slid, dynamic, most), dynamic, next[3]);
    const Mask8 slides = way != sticks;
    next[3] = way;
    lost = 0;
    if (any(slides)) {
      const Real8 give = base.all_alike ? Real8(1 / base.epsilon) : (1 / base.epsilon) * (sigma * sigma);
      const Real8 sx = give * held_x, sy = give * held_y, turn = give * twist;
      next[0] = select(slides, x - sx, next[0]);
      next[1] = select(slides, y - sy, next[1]);
      next[2] = select(slides, angle - 2 * per_sigma * turn, next[2]);
      lost = simd::sum_of(held_x, dx - sx, held_y, dy - sy) + twist * (wound - turn);
      // Where it comes from the limit of μ_static, the spring has lost its energy above the limit of μ_dynamic.
      const Real more = square(base.mu_static / base.mu_dynamic - 1) / 2;
      lost += simd::where(~slid, more * (simd::sum_of(held_x, sx, held_y, sy) + twist * turn));
      lost = simd::where(slides, lost);
    }
    const Mask8 damps = known & ~slides;
    gamma = any(damps) ? simd::where(damps, 2 * base.damping * simd::sqrt(stiffness * mass)) : 0;
  }

  /// Adds damping to the force of the spring, as far as the limit allows.
  PLIANT_INLINE void damp(const Points8& v, const Real8& spin) {
    const Mask8 damps = gamma > 0;
    held_x += gamma * v.x;
    held_y += gamma * v.y;
    twist += gamma * radius * spin;
    limit(damps, most, most, sticks);
  }

 private:
  /// Brings force and torque over R of some, where they are beyond `beyond`, to the limit of `then`. Returns which of
  /// them slide.
  PLIANT_INLINE Real8 limit(const Mask8& of, const Real8& beyond, const Real8& then, Real8 guess) {
    const Real8 f2 = simd::sum_of(held_x, held_x, held_y, held_y), size = simd::abs(twist);
    if (!base.coupled) {
      const Mask8 moves = of & (f2 > beyond * beyond), turns = of & (size > LimitSurface::most_torque * beyond);
      const Real8 factor = select(moves, then / simd::sqrt(f2), 1), torque = LimitSurface::most_torque * then;
      held_x *= factor, held_y *= factor;
      twist = select(turns, select(twist > 0, torque, -torque), twist);
      return select(moves | turns, simd::where(moves, 1) + simd::where(turns, 2), sticks);
    }
    const Mask8 near = of & ~LimitSurface::surely_inside(f2, size, beyond);
    if (!any(near)) return sticks;
    const Real8 root = simd::sqrt(f2), per = 1 / beyond, f = root * per, w = size * per;
    const Mask8 unknown = near & (guess == sticks);
    if (any(unknown)) guess = select(unknown, w / (f + w), guess);
    const LimitSurface::Nearest8 held = base.surface->nearest(f, w, guess, near);
    const Mask8 there = near & held.found & held.outside & (then == beyond);
    const Real8 factor = select(there & (root > 0), then * held.force / root, 1), torque = then * held.torque;
    held_x *= factor, held_y *= factor;
    twist = select(there, select(twist > 0, torque, -torque), twist);
    Real8 way = select(there, held.slip, sticks);
    const Mask8 seldom = near & ~there & ~(held.found & ~held.outside);
    if (any(seldom)) {
      Seldom few{seldom, held_x, held_y, twist, beyond, then, guess, way};
      few.limit(*base.surface);
      held_x = few.x, held_y = few.y, twist = few.twist, way = few.way;
    }
    return way;
  }

  /// The same one by one: where Newton's method takes long, or static friction gives way to the dynamic one.
  struct Seldom {
    Mask8 which;
    Real8 x, y, twist, beyond, then, guess, way;

    [[gnu::noinline]] void limit(const LimitSurface& surface) {
      for (int k = 0; k < 8; ++k) {
        if (which[k] == 0) continue;
        const Real root = std::hypot(x[k], y[k]), size = std::abs(twist[k]);
        LimitSurface::Nearest held = surface.nearest(root / beyond[k], size / beyond[k], guess[k]);
        way.set(k, sticks);
        if (!held.outside) continue;
        if (then[k] != beyond[k]) held = surface.nearest(root / then[k], size / then[k], held.slip);
        if (root > 0) x.set(k, x[k] * (then[k] * held.force / root)), y.set(k, y[k] * (then[k] * held.force / root));
        twist.set(k, std::copysign(then[k] * held.torque, twist[k]));
        way.set(k, held.slip);
      }
    }
  };
};

/// Eight disks, of which those after the first few are copies of the last.
struct FewDisks {
  std::array<Real, 16> x, v;
  std::array<Real, 8> angle, spin, sigma, mass;

  DisksOnBase fill(const DisksOnBase& first, Index count) {
    for (Index k = 0; k < 8; ++k) {
      const DisksOnBase d = first.from(std::min(k, count - 1));
      for (Index c = 0; c < 2; ++c) x[2 * k + c] = d.x[c], v[2 * k + c] = d.v[c];
      angle[k] = *d.angle, spin[k] = *d.spin, sigma[k] = *d.sigma, mass[k] = *d.mass;
    }
    return {x.data(), angle.data(), v.data(), spin.data(), sigma.data(), mass.data()};
  }
};

PLIANT_INLINE DisksOnBase disks(const StateView<2>& s) {
  // Velocities may be missing where they are not needed.
  return {s.x,
          s.angles,
          s.v != nullptr ? s.v : s.x,
          s.spins != nullptr ? s.spins : s.angles,
          s.topology.diameter.data(),
          s.topology.point_mass.data()};  // particles have one point each
}

/// visit(first, count, disks) for eight disks of a range at a time. Fewer, four or the rest, are filled up
/// with copies of the last: four make the same bits as if they were half of eight. once: visit is inlined in one place.
template <bool once, class Visit>
PLIANT_INLINE void for_each_eight(const StateView<2>& s, Range range, Visit&& visit) {
  const DisksOnBase all = disks(s);
  Index i = range.first;
  if constexpr (once) {
    FewDisks few;
    for (Index count; i < range.last; i += count) {
      const Index left = range.last - i;
      count = left >= 8 ? 8 : std::min(left, Index(4));
      visit(i, count, count == 8 ? all.from(i) : few.fill(all.from(i), count));
    }
    return;
  }
  for (; i + 8 <= range.last; i += 8) visit(i, 8, all.from(i));
  FewDisks few;
  if (i + 4 <= range.last) {
    visit(i, 4, few.fill(all.from(i), 4));
    i += 4;
  }
  if (i < range.last) visit(i, range.last - i, few.fill(all.from(i), range.last - i));
}

/// Current histories of eight disks, and the mask of disks with a history: the other disks stick at their present
/// place.
struct PastOnBase {
  std::array<Real, 32> numbers;
  Mask8 known = ~Mask8{};

  /// past(k): of each, null where nothing is known.
  template <class Past>
  void gather(const DisksOnBase& d, Past&& past) {
    for (int k = 0; k < 8; ++k) {
      const Real* const of = past(k);
      (k < 4 ? known.a : known.b)[k % 4] = of != nullptr ? -1 : 0;
      const std::array<Real, 4> here{d.x[2 * k], d.x[2 * k + 1], d.angle[k], BaseFriction::sticks};
      std::copy_n(of != nullptr ? of : here.data(), 4, numbers.begin() + 4 * k);
    }
  }
};

template <bool once>
PLIANT_INLINE void add_range(const BaseFriction& base, const StateView<2>& s, Range range, const ContactTable& table,
                             ContactWorkspace& workspace, const Scatter<2, 1>& scatter) {
  if (range.size() == 0) return;
  const BaseFriction law = base;  // local copy, which stores cannot change
  const ContactTable::CurrentRows<BaseFriction::history> past(table);
  const Scatter<2, 1> force = scatter;
  Real* next = ContactWorkspace::Next<BaseFriction::history>(table, workspace).set(range);
  Real4 damped{}, slid{};
  for_each_eight<once>(s, range, [&](Index first, Index count, const DisksOnBase& d) PLIANT_INLINE_LAMBDA {
    EightOnBase eight(law);
    const Real* const kept = count == 8 ? past.all({first, first + count}) : nullptr;
    PastOnBase gathered;
    if (kept == nullptr)
      gathered.gather(d, [&](Index k) {
        const Index i = first + std::min(k, count - 1);
        return past.touches(i) ? past(i) : nullptr;
      });
    eight.find(d, kept != nullptr ? kept : gathered.numbers.data(), gathered.known);
    transpose(eight.next);
    for (Index k = 0; k < count; ++k, next += 4) simd::store4(next, k < 4 ? eight.next[k].a : eight.next[k - 4].b);
    const auto add = [&](Real4& to, const Real8& all) PLIANT_INLINE_LAMBDA {
      const Real8 some = count == 8 ? all : simd::where(simd::first8(count), all);
      to += some.a, to += some.b;
    };
    add(slid, eight.lost);
    if (any(eight.gamma > 0)) {
      const Real8 x = eight.held_x, y = eight.held_y, twist = eight.twist, spin = load8(d.spin);
      const Points8 v = points(d.v);
      eight.damp(v, spin);
      add(damped,
          simd::sum_of(eight.held_x - x, v.x, eight.held_y - y, v.y) + (eight.twist - twist) * (eight.radius * spin));
    }
    Real* const f = force.out + 2 * std::ptrdiff_t(first);
    subtract(f, points(eight.held_x.a, eight.held_y.a), 2 * count);
    subtract(f + 8, points(eight.held_x.b, eight.held_y.b), 2 * count - 8);
    subtract(force.torques + first, eight.radius * eight.twist, count);
  });
  workspace.losses(range)[0] = (damped[0] + damped[1]) + (damped[2] + damped[3]);
  workspace.losses(range)[1] = (slid[0] + slid[1]) + (slid[2] + slid[3]);
}

PLIANT_MULTIVERSION void find_one(const BaseFriction& base, const StateView<2>& s, Index i, const Real* past,
                                  BaseFriction::Touch& c) {
  FewDisks few;
  const DisksOnBase d = few.fill(disks(s).from(i), 1);
  PastOnBase some;
  some.gather(d, [&](Index) { return past; });
  EightOnBase eight(base);
  eight.find(d, some.numbers.data(), some.known);
  c = {{eight.next[0][0], eight.next[1][0], eight.next[2][0], eight.next[3][0]},
       {eight.held_x[0], eight.held_y[0]},
       eight.twist[0],
       eight.lost[0],
       eight.stiffness[0],
       eight.gamma[0],
       eight.most[0],
       eight.radius[0],
       i};
}

PLIANT_MULTIVERSION void damp_one(const BaseFriction& base, const StateView<2>& s, const BaseFriction::Touch& c,
                                  Real* pull) {
  EightOnBase eight(base);
  eight.held_x = c.held[0], eight.held_y = c.held[1], eight.twist = c.twist;
  eight.gamma = c.gamma, eight.most = c.most, eight.radius = c.radius;
  eight.damp({s.v[2 * c.i], s.v[2 * c.i + 1]}, s.spins[c.i]);
  pull[0] = eight.held_x[0], pull[1] = eight.held_y[0], pull[2] = eight.twist[0];
}

}  // namespace

static_assert(RangeTerm<BaseFriction, 2>);

const LimitSurface* BaseFriction::the_surface() { return &limit_surface(); }

bool BaseFriction::find(const StateView<2>& s, Index i, std::span<const Real> past, Touch& c) const {
  find_one(*this, s, i, past.empty() ? nullptr : past.data(), c);
  return true;
}

std::array<Real, 3> BaseFriction::damped(const StateView<2>& s, const Touch& c) const {
  std::array<Real, 3> pull;
  damp_one(*this, s, c, pull.data());
  return pull;
}

void BaseFriction::add_forces(const StateView<2>& s, Range range, const ContactTable& table,
                              ContactWorkspace& workspace, const Scatter<2, 1>& force) const {
  if (simd::fast())
    simd::run_fast([&]() PLIANT_INLINE_LAMBDA { add_range<false>(*this, s, range, table, workspace, force); });
  else
    add_range<true>(*this, s, range, table, workspace, force);
}

}  // namespace pliant
