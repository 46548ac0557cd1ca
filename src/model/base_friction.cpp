// Four disks at a time. What is not vectors here runs seldom.
#include <pliant/model/base_friction.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include <pliant/base/simd.h>
#include <pliant/model/limit_surface.h>

namespace pliant {

using simd::any;
using simd::load4;
using simd::Mask4;
using simd::Real4;
using simd::select;
using simd::store4;

namespace {

/// Where four disks are, and how fast. Pointers to the first of them.
struct DisksOnBase {
  const Real *x, *angle, *v, *spin, *sigma, *mass;
};

PLIANT_INLINE simd::Points2 points(const Real* p) {
  const Real4 a = load4(p), b = load4(p + 4);
  return {__builtin_shufflevector(a, b, 0, 2, 4, 6), __builtin_shufflevector(a, b, 1, 3, 5, 7)};
}

PLIANT_INLINE void subtract(Real* from, Real4 a, Index count) {
  if (count >= 4) return store4(from, load4(from) - a);
  for (Index k = 0; k < count; ++k) from[k] -= a[k];
}

/// What an evaluation leaves of a range, number by number of four disks.
struct RecordsOnBase {
  Real* at;

  explicit RecordsOnBase(std::byte* memory) : at(reinterpret_cast<Real*>(memory)) {}
  PLIANT_INLINE void write(Real4 a, Index count) {
    if (count == 4)
      store4(at, a);
    else
      std::memcpy(at, &a, static_cast<std::size_t>(count) * sizeof(Real));
    at += count;
  }
  PLIANT_INLINE Real4 read(Index count) {
    Real4 a{};
    if (count == 4)
      a = load4(at);
    else
      std::memcpy(&a, at, static_cast<std::size_t>(count) * sizeof(Real));
    at += count;
    return a;
  }
};

/// The law. What becomes of a disk does not depend on the other three.
struct FourOnBase {
  static constexpr Real sticks = BaseFriction::sticks;

  const BaseFriction& base;
  // As in Touch.
  Real4 next[4];
  Real4 held_x, held_y, twist, lost;
  Real4 stiffness, gamma, most, radius;

  PLIANT_INLINE explicit FourOnBase(const BaseFriction& law) : base(law) {}

  /// past: what was kept of them, one after the other.
  PLIANT_INLINE void find(const DisksOnBase& d, const Real* past, Mask4 known) {
    const auto [x, y] = points(d.x);
    const Real4 angle = load4(d.angle), sigma = load4(d.sigma), mass = load4(d.mass);
    for (int k = 0; k < 4; ++k) next[k] = load4(past + 4 * k);
    simd::transpose(next[0], next[1], next[2], next[3]);

    const Real4 per_sigma = 1 / sigma, weight = mass * base.gravity, dynamic = base.mu_dynamic * weight;
    stiffness = base.all_alike ? simd::all(base.epsilon) : base.epsilon * (per_sigma * per_sigma);
    radius = sigma / 2;
    most = base.mu_static * weight;
    const Real4 dx = x - next[0], dy = y - next[1], wound = radius * (angle - next[2]);
    held_x = stiffness * dx, held_y = stiffness * dy, twist = stiffness * wound;
    const Mask4 slid = next[3] != sticks;
    const Real4 way = limit(known, select(slid, dynamic, most), dynamic, next[3]);
    const Mask4 slides = way != sticks;
    next[3] = way;
    lost = Real4{};
    if (any(slides)) {
      const Real4 give = base.all_alike ? simd::all(1 / base.epsilon) : (1 / base.epsilon) * (sigma * sigma);
      const Real4 sx = give * held_x, sy = give * held_y, turn = give * twist;
      next[0] = select(slides, x - sx, next[0]);
      next[1] = select(slides, y - sy, next[1]);
      next[2] = select(slides, angle - 2 * per_sigma * turn, next[2]);
      lost = held_x * (dx - sx) + held_y * (dy - sy) + twist * (wound - turn);
      // Where it comes from the limit of μ_static, the spring has lost what it held beyond that of μ_dynamic.
      const Real more = square(base.mu_static / base.mu_dynamic - 1) / 2;
      lost += simd::where(~slid, more * (held_x * sx + held_y * sy + twist * turn));
      lost = simd::where(slides, lost);
    }
    gamma = simd::where(known & ~slides, 2 * base.damping * simd::sqrt(stiffness * mass));
  }

  /// Adds what damps to the force of the spring, as far as the limit allows.
  PLIANT_INLINE void damp(const simd::Points2& v, Real4 spin) {
    const Mask4 damps = gamma > 0;
    if (!any(damps)) return;
    held_x += gamma * v.x;
    held_y += gamma * v.y;
    twist += gamma * radius * spin;
    limit(damps, most, most, simd::all(sticks));
  }

 private:
  /// Brings force and torque over R of some, where they are beyond `beyond`, to the limit of `then`. Returns what of it
  /// slides.
  PLIANT_INLINE Real4 limit(Mask4 of, Real4 beyond, Real4 then, Real4 guess) {
    const Real4 f2 = held_x * held_x + held_y * held_y, size = simd::abs(twist);
    if (!base.coupled) {
      const Mask4 moves = of & (f2 > beyond * beyond), turns = of & (size > LimitSurface::most_torque * beyond);
      const Real4 factor = select(moves, then / simd::sqrt(f2), simd::all(1)),
                  torque = LimitSurface::most_torque * then;
      held_x *= factor, held_y *= factor;
      twist = select(turns, select(twist > 0, torque, -torque), twist);
      return select(moves | turns, simd::where(moves, simd::all(1)) + simd::where(turns, simd::all(2)),
                    simd::all(sticks));
    }
    const Mask4 near = of & ~LimitSurface::surely_inside(f2, size, beyond);
    if (!any(near)) return simd::all(sticks);
    const Real4 root = simd::sqrt(f2), per = 1 / beyond, f = root * per, w = size * per;
    const Mask4 unknown = near & (guess == sticks);
    if (any(unknown)) guess = select(unknown, w / (f + w), guess);
    const LimitSurface::Nearest4 held = base.surface->nearest(f, w, guess, near);
    const Mask4 there = near & held.found & held.outside & (then == beyond);
    const Real4 factor = select(there & (root > 0), then * held.force / root, simd::all(1)),
                torque = then * held.torque;
    held_x *= factor, held_y *= factor;
    twist = select(there, select(twist > 0, torque, -torque), twist);
    Real4 way = select(there, held.slip, simd::all(sticks));
    const Mask4 seldom = near & ~there & ~(held.found & ~held.outside);
    if (any(seldom)) {
      Seldom few{seldom, held_x, held_y, twist, beyond, then, guess, way};
      few.limit(*base.surface);
      held_x = few.x, held_y = few.y, twist = few.twist, way = few.way;
    }
    return way;
  }

  /// The same one by one: where Newton's method takes long, or static friction gives way to the dynamic one.
  struct Seldom {
    Mask4 which;
    Real4 x, y, twist, beyond, then, guess, way;

    [[gnu::noinline]] void limit(const LimitSurface& surface) {
      for (int k = 0; k < 4; ++k) {
        if (!which[k]) continue;
        const Real root = std::hypot(x[k], y[k]), size = std::abs(twist[k]);
        LimitSurface::Nearest held = surface.nearest(root / beyond[k], size / beyond[k], guess[k]);
        way[k] = sticks;
        if (!held.outside) continue;
        if (then[k] != beyond[k]) held = surface.nearest(root / then[k], size / then[k], held.slip);
        if (root > 0) x[k] *= then[k] * held.force / root, y[k] *= then[k] * held.force / root;
        twist[k] = std::copysign(then[k] * held.torque, twist[k]);
        way[k] = held.slip;
      }
    }
  };
};

/// visit(first, count, disks) for four disks of a range at a time. Fewer are filled up with copies of the last.
template <class Visit>
PLIANT_INLINE void for_each_four(const StateView<2>& s, Range range, Visit&& visit) {
  // Where nobody asks for velocities there may be none.
  const DisksOnBase all{s.x,
                        s.angles,
                        s.v != nullptr ? s.v : s.x,
                        s.spins != nullptr ? s.spins : s.angles,
                        s.topology.diameter.data(),
                        s.topology.point_mass.data()};  // of one point each
  const auto from = [&](Index i) PLIANT_INLINE_LAMBDA {
    const std::ptrdiff_t two = 2 * std::ptrdiff_t(i);
    return DisksOnBase{all.x + two, all.angle + i, all.v + two, all.spin + i, all.sigma + i, all.mass + i};
  };
  Index i = range.first;
  for (; i + 4 <= range.last; i += 4) visit(i, 4, from(i));
  if (i == range.last) return;
  std::array<Real, 8> x, v;
  std::array<Real, 4> angle, spin, sigma, mass;
  for (Index k = 0; k < 4; ++k) {
    const DisksOnBase d = from(std::min(i + k, range.last - 1));
    for (Index c = 0; c < 2; ++c) x[2 * k + c] = d.x[c], v[2 * k + c] = d.v[c];
    angle[k] = *d.angle, spin[k] = *d.spin, sigma[k] = *d.sigma, mass[k] = *d.mass;
  }
  visit(i, range.last - i, DisksOnBase{x.data(), angle.data(), v.data(), spin.data(), sigma.data(), mass.data()});
}

/// What was kept of four disks, and of which: the others will stick where they are.
struct PastOnBase {
  std::array<Real, 16> numbers;
  Mask4 known;

  /// past(k): of each, null where nothing is known.
  template <class Past>
  PastOnBase(const DisksOnBase& d, Past&& past) {
    for (int k = 0; k < 4; ++k) {
      const Real* const of = past(k);
      known[k] = of != nullptr ? -1 : 0;
      const std::array<Real, 4> here{d.x[2 * k], d.x[2 * k + 1], d.angle[k], BaseFriction::sticks};
      std::copy_n(of != nullptr ? of : here.data(), 4, numbers.begin() + 4 * k);
    }
  }
};

using Pasts = ContactTable::Pasts<BaseFriction::history>;

PLIANT_MULTIVERSION void add_range(const BaseFriction& base, const StateView<2>& s, Range range, const Pasts& pasts,
                                   std::byte* memory, const Scatter<2, 1>& scatter) {
  const BaseFriction law = base;  // nobody else writes to these
  const Pasts past = pasts;
  const Scatter<2, 1> force = scatter;
  RecordsOnBase records(memory);
  for_each_four(s, range, [&](Index first, Index count, const DisksOnBase& d) PLIANT_INLINE_LAMBDA {
    FourOnBase four(law);
    const Real* const kept = past.all({first, first + count});
    if (kept != nullptr && count == 4) {
      four.find(d, kept, Mask4{-1, -1, -1, -1});
    } else {
      const PastOnBase some(d, [&](Index k) { return past(first + std::min(k, count - 1)); });
      four.find(d, some.numbers.data(), some.known);
    }
    for (const Real4& a : four.next) records.write(a, count);
    for (const Real4& a : {four.lost, four.held_x, four.held_y, four.twist, four.gamma, four.most})
      records.write(a, count);
    four.damp(points(d.v), load4(d.spin));
    const Real4 x = four.held_x, y = four.held_y;
    Real* const f = force.out + 2 * std::ptrdiff_t(first);
    subtract(f, __builtin_shufflevector(x, y, 0, 4, 1, 5), 2 * count);
    subtract(f + 4, __builtin_shufflevector(x, y, 2, 6, 3, 7), 2 * count - 4);
    subtract(force.torques + first, four.radius * four.twist, count);
  });
}

/// Writes what is kept. Returns the heat by damping per time and that by sliding.
PLIANT_MULTIVERSION void advance_range(const BaseFriction& base, const StateView<2>& s, Range range, std::byte* memory,
                                       Real* numbers, Real* heat) {
  const BaseFriction law = base;
  RecordsOnBase records(memory);
  Real4 damped{}, lost{};
  for_each_four(s, range, [&](Index, Index count, const DisksOnBase& d) PLIANT_INLINE_LAMBDA {
    FourOnBase four(law);
    for (Real4& a : four.next) a = records.read(count);
    simd::transpose(four.next[0], four.next[1], four.next[2], four.next[3]);
    for (Index k = 0; k < count; ++k, numbers += 4) store4(numbers, four.next[k]);
    lost += records.read(count);
    const Real4 x = records.read(count), y = records.read(count), twist = records.read(count);
    four.held_x = x, four.held_y = y, four.twist = twist;
    four.gamma = records.read(count), four.most = records.read(count);
    if (!any(four.gamma > 0)) return;
    four.radius = load4(d.sigma) / 2;
    const simd::Points2 v = points(d.v);
    const Real4 spin = load4(d.spin);
    four.damp(v, spin);
    damped += (four.held_x - x) * v.x + (four.held_y - y) * v.y + (four.twist - twist) * (four.radius * spin);
  });
  heat[0] = (damped[0] + damped[1]) + (damped[2] + damped[3]);
  heat[1] = (lost[0] + lost[1]) + (lost[2] + lost[3]);
}

PLIANT_MULTIVERSION void find_one(const BaseFriction& base, const StateView<2>& s, Index i, const Real* past,
                                  BaseFriction::Touch& c) {
  for_each_four(s, {i, i + 1}, [&](Index, Index, const DisksOnBase& d) PLIANT_INLINE_LAMBDA {
    FourOnBase four(base);
    const PastOnBase some(d, [&](Index) { return past; });
    four.find(d, some.numbers.data(), some.known);
    c = {{four.next[0][0], four.next[1][0], four.next[2][0], four.next[3][0]},
         {four.held_x[0], four.held_y[0]},
         four.twist[0],
         four.lost[0],
         four.stiffness[0],
         four.gamma[0],
         four.most[0],
         four.radius[0],
         i};
  });
}

PLIANT_MULTIVERSION void damp_one(const BaseFriction& base, const StateView<2>& s, const BaseFriction::Touch& c,
                                  Real* pull) {
  FourOnBase four(base);
  four.held_x = simd::all(c.held[0]), four.held_y = simd::all(c.held[1]), four.twist = simd::all(c.twist);
  four.gamma = simd::all(c.gamma), four.most = simd::all(c.most), four.radius = simd::all(c.radius);
  four.damp({simd::all(s.v[2 * c.i]), simd::all(s.v[2 * c.i + 1])}, simd::all(s.spins[c.i]));
  pull[0] = four.held_x[0], pull[1] = four.held_y[0], pull[2] = four.twist[0];
}

}  // namespace

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
                              const Scatter<2, 1>& force) const {
  add_range(*this, s, range, table.pasts<history>(), table.records().memory(range), force);
}

void BaseFriction::advance_all(const StateView<2>& s, Range range, Real h, ContactTable& table,
                               std::span<Real> heat) const {
  std::array<Real, 2> sum;
  advance_range(*this, s, range, table.records().memory(range), table.advance(range).data(), sum.data());
  heat[0] += h * sum[0];
  heat[1] += sum[1];
}

}  // namespace pliant
