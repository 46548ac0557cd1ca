// Four contacts at a time, with the same bits as one by one.
#include <pliant/model/disk_contact.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include <pliant/base/simd.h>

namespace pliant {

using simd::load4;
using simd::Mask4;
using simd::Points2;
using simd::Real2;
using simd::Real4;

namespace {

using DiskPasts = ContactTable::Rows<DiskContact<>::history>;

/// What an evaluation leaves of a range: its elements, those that touch from the front and those that touch no more,
/// as ~e, from the back, with `none` between them where there is room; and records of those that touch, number by
/// number of four of them.
struct DiskRecords {
  static constexpr Index none = std::numeric_limits<Index>::min();
  static constexpr Index numbers = 12;
  static_assert(sizeof(DiskContact<>::Touch) >= sizeof(Real) * numbers);

  Index* element;
  Index size;
  Real* memory;

  DiskRecords(const ContactTable& table, Range range)
      : element(table.record<DiskContact<>::Touch>(range).room()),
        size(range.size()),
        memory(reinterpret_cast<Real*>(table.records().memory(range))) {}

  Index touching() const {
    Index n = 0;
    while (n < size && element[n] >= 0) ++n;
    return n;
  }
  /// visit(e) for those that touch no more.
  template <class Visit>
  void for_each_parted(Visit&& visit) const {
    for (Index k = size - 1; k >= 0 && element[k] < 0 && element[k] != none; --k) visit(~element[k]);
  }

  /// Of `count` contacts, the first being number k of those that touch.
  PLIANT_INLINE void write(Index k, Index count, const DiskTouch<Real4>& c) const {
    Real* to = memory + static_cast<std::ptrdiff_t>(k) * numbers;
    const auto store = [&](const auto&... all)
                           PLIANT_INLINE_LAMBDA { ((simd::store_first(to, all, count), to += count), ...); };
    store(c.elastic, c.k, c.gamma, c.lever, c.stretched, c.slid ? simd::all(1) : Real4{}, c.a, c.b, c.n0, c.n1,
          c.turned, c.before);
  }
  PLIANT_INLINE DiskTouch<Real4> read(Index k, Index count) const {
    const Real* from = memory + static_cast<std::ptrdiff_t>(k) * numbers;
    const auto load = [&](auto&... all)
                          PLIANT_INLINE_LAMBDA { ((simd::load_first(from, all, count), from += count), ...); };
    Real4 slid{};
    DiskTouch<Real4> c{};
    load(c.elastic, c.k, c.gamma, c.lever, c.stretched, slid, c.a, c.b, c.n0, c.n1, c.turned, c.before);
    c.slid = slid != 0;
    return c;
  }
};

/// visit(k, count, elements) for four of those that touch at a time. Fewer are filled up with copies of the last.
template <class Visit>
PLIANT_INLINE void for_each_four(const DiskRecords& records, Index touching, Visit&& visit) {
  Index k = 0;
  for (; k + 4 <= touching; k += 4) visit(k, 4, records.element + k);
  if (k == touching) return;
  std::array<Index, 4> rest;
  for (Index l = 0; l < 4; ++l) rest[l] = records.element[std::min(k + l, touching - 1)];
  visit(k, touching - k, rest.data());
}

/// The points of four pairs.
struct Places {
  std::array<std::ptrdiff_t, 4> first, second;

  PLIANT_INLINE Places(const Pair* pairs, const Index* elements) {
    for (int k = 0; k < 4; ++k) {
      first[k] = pairs[elements[k]].first;
      second[k] = pairs[elements[k]].second;
    }
  }
  template <class T>
  PLIANT_INLINE static Real4 gather(const T* a, const std::array<std::ptrdiff_t, 4>& at) {
    return Real4{Real(a[at[0]]), Real(a[at[1]]), Real(a[at[2]]), Real(a[at[3]])};
  }
  PLIANT_INLINE Points2 differences(const Real* a) const {
    Real2 u[4];
    for (int k = 0; k < 4; ++k) u[k] = simd::load2(a + 2 * first[k]) - simd::load2(a + 2 * second[k]);
    return simd::transpose(u[0], u[1], u[2], u[3]);
  }
};

PLIANT_INLINE SurfaceTouch<2, Real4>::Rub rub(const DiskTouch<Real4>& c, const SurfaceFriction& surface,
                                              const StateView<2>& s, const Places& at) {
  const Points2 v = at.differences(s.v);
  return c.rub(surface, v.x, v.y, Places::gather(s.spins, at.first), Places::gather(s.spins, at.second));
}

PLIANT_INLINE DiskTouch<Real4>::Past past_of(const DiskPasts& past, const Index* elements) {
  const Real* const p[4] = {past(elements[0]), past(elements[1]), past(elements[2]), past(elements[3])};
  Real4 n0 = load4(p[0]), n1 = load4(p[1]), turned = load4(p[2]), spring = load4(p[3]);
  simd::transpose(n0, n1, turned, spring);
  return {n0, n1, turned, spring, Real4{p[0][4], p[1][4], p[2][4], p[3][4]} != 0};
}

/// Of each pair of a range: the radii, their sum, and the root of the reduced mass.
void set_constants(const StateView<2>& s, Range range, const ContactTable& table) {
  const PairList& list = s.neighbours.point_pairs;
  const std::vector<Real>& diameter = s.topology.diameter;
  Real* to = table.constants(range.first);
  for (Index e = range.first; e < range.last; ++e) {
    const auto [i, j] = list[e];
    for (const Real number :
         {diameter[i] / 2, diameter[j] / 2, list.reach[e], DiskContact<>::root_mass(s.topology, i, j)})
      *to++ = number;
  }
}

template <class Law, bool OwnOnly>
PLIANT_MULTIVERSION void add_contacts(Real epsilon, const SurfaceFriction& friction, const StateView<2>& s, Range range,
                                      const ContactTable& table, const Scatter<2, 1, OwnOnly>& scatter, bool total) {
  const SurfaceFriction surface = friction;  // nobody else writes to these
  const DiskPasts past = table.rows<DiskContact<>::history>();
  const DiskRecords records(table, range);
  const Scatter<2, 1, OwnOnly> force = scatter;
  const PairList& list = s.neighbours.point_pairs;
  const Pair* const pairs = list.pairs.data();
  const Real *const reach = list.reach.data(), *const x = s.x;

  const Real* const all = table.constants(0);
  const auto constants = [&](Index e)
                             PLIANT_INLINE_LAMBDA { return all + std::ptrdiff_t(e) * DiskContact<>::constants; };
  if (range.size() > 0 && *constants(range.first) == 0) set_constants(s, range, table);

  // First which pairs touch, without a branch that depends on it.
  Index touching = 0, parted = range.size();
  for (Index e = range.first; e < range.last; ++e) {
    const std::ptrdiff_t i = 2 * std::ptrdiff_t(pairs[e].first), j = 2 * std::ptrdiff_t(pairs[e].second);
    const Real dx = x[i] - x[j], dy = x[i + 1] - x[j + 1], d2 = dx * dx + dy * dy;
    const bool near = (d2 < square(reach[e])) & (d2 > 0);
    records.element[touching] = e;  // or what comes next is there
    touching += near ? 1 : 0;
    if (past.known(e) & !near) records.element[--parted] = ~e;
  }
  if (touching < parted) records.element[touching] = records.element[parted - 1] = DiskRecords::none;

  for_each_four(records, touching, [&](Index k, Index count, const Index* e) PLIANT_INLINE_LAMBDA {
    const Places at(pairs, e);
    const Points2 r = at.differences(x);
    DiskTouch<Real4> c;
    Real4 a = load4(constants(e[0])), b = load4(constants(e[1])), both = load4(constants(e[2])),
          root_mass = load4(constants(e[3]));
    simd::transpose(a, b, both, root_mass);
    c.find<Law>(epsilon, surface,
                {r.x, r.y, r.x * r.x + r.y * r.y, both, a, b, root_mass, Places::gather(s.angles, at.first),
                 Places::gather(s.angles, at.second)},
                past_of(past, e));
    records.write(k, count, c);
    const auto rubs = rub(c, surface, s, at);
    const auto [fx, fy] = c.force(total ? rubs.normal : rubs.normal - c.elastic, rubs.hold.pull);
    Real4 lanes02, lanes13;
    simd::transpose({fx, fy}, lanes02, lanes13);
    const Real2 f[4] = {simd::low(lanes02), simd::low(lanes13), simd::high(lanes02), simd::high(lanes13)};
    const Real4 on_first = rubs.hold.pull * c.a, on_second = rubs.hold.pull * c.b;
    for (Index l = 0; l < count; ++l) {
      const auto add = [&](std::ptrdiff_t i, Real2 push, Real torque) PLIANT_INLINE_LAMBDA {
        if (OwnOnly && !force.own.contains(static_cast<Index>(i))) return;
        Real* const out = force.out + 2 * i;
        simd::store2(out, simd::load2(out) + push);
        force.torques[i] += torque;
      };
      add(at.first[l], f[l], on_first[l]);
      add(at.second[l], -f[l], on_second[l]);
    }
  });
}

/// Writes what is kept of those that touch, and over their records what each has lost; or adds all of it to `heat`.
PLIANT_MULTIVERSION void advance_contacts(const SurfaceFriction& friction, const StateView<2>& s, Real h,
                                          const DiskRecords& from, Index touching, ContactTable& table, Real* heat) {
  constexpr int losses = 3;
  const SurfaceFriction surface = friction;
  const DiskRecords records = from;
  const Pair* const pairs = s.neighbours.point_pairs.pairs.data();
  Real* lost = records.memory;  // far less than the records
  std::array<Real4, losses> sums{};
  for_each_four(records, touching, [&](Index k, Index count, const Index* e) PLIANT_INLINE_LAMBDA {
    const DiskTouch<Real4> c = records.read(k, count);
    const auto rubs = rub(c, surface, s, Places(pairs, e));
    std::array<Real4, losses> now{h * c.normal_power(rubs), h * c.tangential_power(rubs), c.slid_heat(rubs, c.before)};
    auto [n0, n1] = c.line();
    Real4 turned = c.turned, spring = rubs.hold.spring;
    simd::transpose(n0, n1, turned, spring);
    const Real4 rows[4] = {n0, n1, turned, spring}, slides = rubs.hold.slides ? simd::all(1) : Real4{};
    for (Index l = 0; l < count; ++l) {
      Real* const numbers = table.touches<DiskContact<>::history>(e[l]);
      simd::store4(numbers, rows[l]);
      numbers[4] = slides[l];
      if (heat == nullptr)
        for (const Real4& a : now) *lost++ = a[l];
    }
    for (int j = 0; j < losses; ++j) {
      for (Index l = count; l < 4; ++l) now[j][l] = 0;
      sums[j] += now[j];
    }
  });
  if (heat != nullptr)
    for (int j = 0; j < losses; ++j) heat[j] += (sums[j][0] + sums[j][1]) + (sums[j][2] + sums[j][3]);
}

}  // namespace

template <class Law, bool OwnOnly>
void add_disk_forces(Real epsilon, const SurfaceFriction& surface, const StateView<2>& s, Range range,
                     const ContactTable& table, const Scatter<2, 1, OwnOnly>& force, bool total) {
  add_contacts<Law>(epsilon, surface, s, range, table, force, total);
}
#define PLIANT_DISK_FORCES(Law, own)                                                                \
  template void add_disk_forces<Law, own>(Real, const SurfaceFriction&, const StateView<2>&, Range, \
                                          const ContactTable&, const Scatter<2, 1, own>&, bool);
PLIANT_DISK_FORCES(HarmonicOverlap, false)
PLIANT_DISK_FORCES(HarmonicOverlap, true)
PLIANT_DISK_FORCES(HertzOverlap, false)
PLIANT_DISK_FORCES(HertzOverlap, true)
PLIANT_DISK_FORCES(SpringOverlap, false)
PLIANT_DISK_FORCES(SpringOverlap, true)

DiskHeat advance_disks(const SurfaceFriction& surface, const StateView<2>& s, Range range, Real h, ContactTable& table,
                       Real* heat) {
  const DiskRecords records(table, range);
  const Index touching = records.touching();
  advance_contacts(surface, s, h, records, touching, table, heat);
  records.for_each_parted([&](Index e) { table.advance(e, [](bool, std::span<Real>) { return false; }); });
  return {{records.element, static_cast<std::size_t>(touching)}, records.memory};
}

}  // namespace pliant
