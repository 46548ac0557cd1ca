// Four contacts at a time, with the same bits as one by one.
#include <pliant/model/disk_contact.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include <pliant/base/simd.h>

namespace pliant {

using simd::load4;
using simd::Mask4;
using simd::Points2;
using simd::Real2;
using simd::Real4;

namespace {

using DiskPasts = ContactTable::Rows<DiskContact<>::history>;

/// visit(count, elements) for four elements at a time. Fewer are filled up with copies of the last.
template <class Visit>
PLIANT_INLINE void for_each_four(const Index* elements, Index size, Visit&& visit) {
  Index k = 0;
  for (; k + 4 <= size; k += 4) visit(4, elements + k);
  if (k == size) return;
  std::array<Index, 4> rest;
  for (Index l = 0; l < 4; ++l) rest[l] = elements[std::min(k + l, size - 1)];
  visit(size - k, rest.data());
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
  const ContactTable::Ahead<DiskContact<>::history> ahead(table);
  const Scatter<2, 1, OwnOnly> force = scatter;
  const PairList& list = s.neighbours.point_pairs;
  const Pair* const pairs = list.pairs.data();
  const Real *const reach = list.reach.data(), *const x = s.x;

  const Real* const all = table.constants(0);
  const auto constants = [&](Index e)
                             PLIANT_INLINE_LAMBDA { return all + std::ptrdiff_t(e) * DiskContact<>::constants; };
  if (range.size() > 0 && *constants(range.first) == 0) set_constants(s, range, table);

  // First which pairs touch, without a branch that depends on it.
  Index* const elements = table.room(range);
  Index touching = 0;
  for (Index e = range.first; e < range.last; ++e) {
    const std::ptrdiff_t i = 2 * std::ptrdiff_t(pairs[e].first), j = 2 * std::ptrdiff_t(pairs[e].second);
    const Real dx = x[i] - x[j], dy = x[i + 1] - x[j + 1], d2 = dx * dx + dy * dy;
    const bool near = (d2 < square(reach[e])) & (d2 > 0);
    elements[touching] = e;  // or what comes next is there
    touching += near ? 1 : 0;
    if (ahead.known(e) & !near) ahead.parted(e);
  }

  std::array<Real4, 3> lost{};
  for_each_four(elements, touching, [&](Index count, const Index* e) PLIANT_INLINE_LAMBDA {
    const Places at(pairs, e);
    const Points2 r = at.differences(x);
    const DiskTouch<Real4>::Past before = past_of(past, e);
    DiskTouch<Real4> c;
    Real4 a = load4(constants(e[0])), b = load4(constants(e[1])), both = load4(constants(e[2])),
          root_mass = load4(constants(e[3]));
    simd::transpose(a, b, both, root_mass);
    c.find<Law>(epsilon, surface,
                {r.x, r.y, r.x * r.x + r.y * r.y, both, a, b, root_mass, Places::gather(s.angles, at.first),
                 Places::gather(s.angles, at.second)},
                before);
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

    auto [n0, n1] = c.line();
    Real4 turned = c.turned, spring = rubs.hold.spring;
    simd::transpose(n0, n1, turned, spring);
    const Real4 rows[4] = {n0, n1, turned, spring}, slides = rubs.hold.slides ? simd::all(1) : Real4{};
    for (Index l = 0; l < count; ++l) {
      Real* const numbers = ahead.touches(e[l]);
      simd::store4(numbers, rows[l]);
      numbers[4] = slides[l];
    }
    Mask4 counts = simd::first(count);
    if constexpr (OwnOnly)
      for (int l = 0; l < 4; ++l)
        if (!force.template counts<Elements::point_pairs>(s, e[l])) counts[l] = 0;
    const Real4 now[3] = {c.normal_power(rubs), c.tangential_power(rubs), c.slid_heat(rubs, before.spring)};
    for (int j = 0; j < 3; ++j) lost[j] += simd::where(counts, now[j]);
  });
  if (range.size() > 0)
    for (int j = 0; j < 3; ++j) table.lost(range)[j] = (lost[j][0] + lost[j][1]) + (lost[j][2] + lost[j][3]);
}

}  // namespace

template <class Law, bool OwnOnly>
void add_disk_forces(Real epsilon, const SurfaceFriction& surface, const StateView<2>& s, Range range,
                     const ContactTable& table, const Scatter<2, 1, OwnOnly>& force, bool total) {
  add_contacts<Law>(epsilon, surface, s, range, table, force, total);
}
static_assert(RangeTerm<DiskContact<>, 2>);
#define PLIANT_DISK_FORCES(Law, own)                                                                \
  template void add_disk_forces<Law, own>(Real, const SurfaceFriction&, const StateView<2>&, Range, \
                                          const ContactTable&, const Scatter<2, 1, own>&, bool);
PLIANT_DISK_FORCES(HarmonicOverlap, false)
PLIANT_DISK_FORCES(HarmonicOverlap, true)
PLIANT_DISK_FORCES(HertzOverlap, false)
PLIANT_DISK_FORCES(HertzOverlap, true)
PLIANT_DISK_FORCES(SpringOverlap, false)
PLIANT_DISK_FORCES(SpringOverlap, true)

}  // namespace pliant
