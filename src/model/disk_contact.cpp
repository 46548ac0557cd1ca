// Four contacts at a time, with the same bits as one by one.
#include <pliant/model/disk_contact.h>

#include <cstddef>

#include <pliant/model/four_pairs.h>

namespace pliant {

using simd::load4;
using simd::Points2;
using simd::Real2;
using simd::Real4;

namespace {

using CurrentDisks = ContactTable::CurrentRows<DiskContact::history>;

PLIANT_INLINE SurfaceTouch<2, Real4>::Rub rub(const DiskTouch<Real4>& c, const SurfaceFriction& surface,
                                              const StateView<2>& s, const FourPairs& at) {
  const Points2 v = at.differences(s.v);
  return c.rub(surface, v.x, v.y, FourPairs::gather(s.spins, at.first), FourPairs::gather(s.spins, at.second));
}

PLIANT_INLINE DiskTouch<Real4>::Past past_of(const CurrentDisks& past, const Index* elements) {
  const Real* const p[4] = {past(elements[0]), past(elements[1]), past(elements[2]), past(elements[3])};
  Real4 n0 = load4(p[0]), n1 = load4(p[1]), turned = load4(p[2]), spring = load4(p[3]);
  simd::transpose(n0, n1, turned, spring);
  return {n0, n1, turned, spring, Real4{p[0][4], p[1][4], p[2][4], p[3][4]} != 0};
}

/// For each pair of a range: the radii, their sum, and the root of the reduced mass.
void set_constants(const StateView<2>& s, Range range, ContactWorkspace& workspace) {
  const PairList& list = s.neighbours.point_pairs;
  const std::vector<Real>& diameter = s.topology.diameter;
  Real* to = workspace.constants(range.first);
  for (Index e = range.first; e < range.last; ++e) {
    const auto [i, j] = list[e];
    for (const Real number :
         {diameter[i] / 2, diameter[j] / 2, list.reach[e], DiskContact::root_mass(s.topology, i, j)})
      *to++ = number;
  }
}

template <ContactLaw law, bool OwnOnly>
PLIANT_MULTIVERSION void add_contacts(const DiskContact& term, const StateView<2>& s, Range range,
                                      const ContactTable& table, ContactWorkspace& workspace,
                                      const Scatter<2, 1, OwnOnly>& scatter, bool total) {
  const SurfaceFriction surface = term.surface;  // local copy, which stores cannot change
  const Real epsilon = term.epsilon;
  const CurrentDisks past(table);
  const ContactWorkspace::Next<DiskContact::history> next(table, workspace);
  const Scatter<2, 1, OwnOnly> force = scatter;
  const Pair* const pairs = s.neighbours.point_pairs.pairs.data();
  const Real* const x = s.x;

  const Real* const all = workspace.constants(0);
  const auto constants = [&](Index e) PLIANT_INLINE_LAMBDA { return all + std::ptrdiff_t(e) * DiskContact::constants; };
  if (range.size() > 0 && *constants(range.first) == 0) set_constants(s, range, workspace);

  Index* const elements = workspace.indices(range);
  const Index touching = find_touching(s, range, next, elements);

  FourLosses<3> lost;
  for_each_four(elements, touching, [&](Index count, const Index* e) PLIANT_INLINE_LAMBDA {
    const FourPairs at(pairs, e);
    const Points2 r = at.differences(x);
    const DiskTouch<Real4>::Past before = past_of(past, e);
    DiskTouch<Real4> c;
    Real4 a = load4(constants(e[0])), b = load4(constants(e[1])), both = load4(constants(e[2])),
          root_mass = load4(constants(e[3]));
    simd::transpose(a, b, both, root_mass);
    c.find(law, epsilon, surface,
           {r.x, r.y, r.x * r.x + r.y * r.y, both, a, b, root_mass, FourPairs::gather(s.angles, at.first),
            FourPairs::gather(s.angles, at.second)},
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
      Real* const numbers = next.set(e[l]);
      simd::store4(numbers, rows[l]);
      numbers[4] = slides[l];
    }
    lost.add(s, force, count, e, {c.normal_power(rubs), c.tangential_power(rubs), c.slid_heat(rubs, before.spring)});
  });
  lost.write(range, workspace);
}

}  // namespace

template <bool OwnOnly>
void DiskContact::add_forces(const StateView<2>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                             const Scatter<2, 1, OwnOnly>& force, bool total) const {
  with_surface_law(law,
                   [&]<class Law>(Law) { add_contacts<Law::kind>(*this, s, range, table, workspace, force, total); });
}
template void DiskContact::add_forces(const StateView<2>&, Range, const ContactTable&, ContactWorkspace&,
                                      const Scatter<2, 1, false>&, bool) const;
template void DiskContact::add_forces(const StateView<2>&, Range, const ContactTable&, ContactWorkspace&,
                                      const Scatter<2, 1, true>&, bool) const;
static_assert(RangeTerm<DiskContact, 2>);

}  // namespace pliant
