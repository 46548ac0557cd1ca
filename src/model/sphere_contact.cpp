// Four contacts at a time, with the same bits as single contacts.
#include <pliant/model/sphere_contact.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include <pliant/model/four_pairs.h>

namespace pliant {

using simd::Mask4;
using simd::Real4;
using Vector = Vector3<Real4>;

namespace {

/// Contacts are computed in blocks of this many fours, in three passes whose loops are short enough for the processor
/// to overlap their iterations.
constexpr Index most_fours = 8;

using CurrentSpheres = ContactTable::CurrentRows<SphereContact::history>;

PLIANT_INLINE SphereTouch<Real4>::Past past_of(const CurrentSpheres& past, const Index* elements) {
  const std::array<const Real*, 4> rows{past(elements[0]), past(elements[1]), past(elements[2]), past(elements[3])};
  SphereTouch<Real4>::Past p;
  Real4 slid;
  columns(rows, 0, p.n.x, p.n.y, p.n.z, p.spring.x);
  columns(rows, 3, p.spring.x, p.spring.y, p.spring.z, slid);
  p.slid = slid != 0;
  return p;
}

/// The constants of the pairs of a range.
void set_constants(const SphereContact& term, const StateView<3>& s, Range range, ContactWorkspace& workspace) {
  const PairList& list = s.neighbours.point_pairs;
  for (Index e = range.first; e < range.last; ++e) {
    const auto c = term.constants_of(s.topology, list[e].first, list[e].second, list.reach[e]);
    std::ranges::copy(
        std::array<Real, SphereContact::constants>{c.a, c.b, c.reach, c.per_reach, c.order, c.stiffness, c.root},
        workspace.constants(e));
  }
}

template <ContactLaw law, bool OwnOnly>
PLIANT_MULTIVERSION void add_contacts(const SphereContact& term, const StateView<3>& s, Range range,
                                      const ContactTable& table, ContactWorkspace& workspace,
                                      const Scatter<3, 1, OwnOnly>& scatter, bool total) {
  const SurfaceFriction surface = term.surface;  // local copy, which stores cannot change
  const Real epsilon = term.epsilon;
  const CurrentSpheres past(table);
  const ContactWorkspace::Next<SphereContact::history> next(table, workspace);
  const Scatter<3, 1, OwnOnly> force = scatter;
  const Pair* const pairs = s.neighbours.point_pairs.pairs.data();
  const Real *const x = s.x, *const v = s.v, *const turns = s.turns, *const spins = s.spins;

  const Real* const all = workspace.constants(0);
  const auto constants = [&](Index e)
                             PLIANT_INLINE_LAMBDA { return all + std::ptrdiff_t(e) * SphereContact::constants; };
  if (range.size() > 0 && *constants(range.first) == 0) set_constants(term, s, range, workspace);

  Index* const elements = workspace.indices(range);
  const Index touching = find_touching(s, range, next, elements);

  FourLosses<3> lost;
  std::array<Index, 4> rest;
  std::array<SphereTouch<Real4>, most_fours> touches;
  std::array<SphereTouch<Real4>::Rub, most_fours> rubbed;
  for (Index begin = 0; begin < touching; begin += 4 * most_fours) {
    const Index fours = std::min((touching - begin + 3) / 4, most_fours);
    const auto for_each = [&](auto&& visit) PLIANT_INLINE_LAMBDA {
      for (Index f = 0; f < fours; ++f) visit(f, four_from(elements, touching, begin + 4 * f, rest));
    };
    for_each([&](Index f, const Index* e) PLIANT_INLINE_LAMBDA {
      const FourPairs at(pairs, e);
      const std::array<const Real*, 4> rows{constants(e[0]), constants(e[1]), constants(e[2]), constants(e[3])};
      SphereTouch<Real4>::Constants fixed;
      Real4 unused;
      columns(rows, 0, fixed.a, fixed.b, fixed.reach, fixed.per_reach);
      columns(rows, 4, fixed.order, fixed.stiffness, fixed.root, unused);
      touches[f].find(law, epsilon, surface, fixed,
                      {at.differences3(x), FourPairs::gather3(turns, at.first), FourPairs::gather3(turns, at.second)},
                      past_of(past, e));
    });
    for_each([&](Index f, const Index* e) PLIANT_INLINE_LAMBDA {
      const FourPairs at(pairs, e);
      rubbed[f] = touches[f].rub(surface, at.differences3(v), FourPairs::gather3(spins, at.first),
                                 FourPairs::gather3(spins, at.second));
    });
    for_each([&](Index f, const Index* e) PLIANT_INLINE_LAMBDA {
      const FourPairs at(pairs, e);
      const Index count = std::min(touching - begin - 4 * f, Index(4));
      const SphereTouch<Real4>& c = touches[f];
      const SphereTouch<Real4>::Rub& rubs = rubbed[f];
      // Copies of the last contact have no force.
      const Mask4 counted = simd::first(count);
      const Real4 normal = simd::where(counted, total ? rubs.normal : rubs.normal - c.elastic);
      const Vector pull = select<Real4>(counted, rubs.hold.pull, Vector{}), torque = c.torque(pull);
      const FourVectors pushes(c.force(normal, pull)), on_first(c.a * torque), on_second(c.b * torque);
      for (Index l = 0; l < 4; ++l) {
        if (!OwnOnly || force.own.contains(static_cast<Index>(at.first[l]))) {
          pushes.add(l, force.out + 3 * at.first[l]);
          on_first.add(l, force.torques + 3 * at.first[l]);
        }
        if (!OwnOnly || force.own.contains(static_cast<Index>(at.second[l]))) {
          pushes.subtract(l, force.out + 3 * at.second[l]);
          on_second.add(l, force.torques + 3 * at.second[l]);
        }
      }

      // Copies of the last contact write the same bits to its place.
      const std::array<Real*, 4> kept{next.set(e[0]), next.set(e[1]), next.set(e[2]), next.set(e[3])};
      const Vector n = c.order * c.n, spring = c.order * rubs.hold.spring;
      write_columns(kept, 0, n.x, n.y, n.z, spring.x);
      write_columns(kept, 3, spring.x, spring.y, spring.z, rubs.hold.slides ? simd::all(1) : Real4{});
      lost.add(s, force, count, e, {c.normal_power(rubs), c.tangential_power(rubs), c.slid_heat(rubs, c.before)});
    });
  }
  lost.write(range, workspace);
}

}  // namespace

template <bool OwnOnly>
void SphereContact::add_forces(const StateView<3>& s, Range range, const ContactTable& table,
                               ContactWorkspace& workspace, const Scatter<3, 1, OwnOnly>& force, bool total) const {
  with_surface_law(law,
                   [&]<class Law>(Law) { add_contacts<Law::kind>(*this, s, range, table, workspace, force, total); });
}
template void SphereContact::add_forces(const StateView<3>&, Range, const ContactTable&, ContactWorkspace&,
                                        const Scatter<3, 1, false>&, bool) const;
template void SphereContact::add_forces(const StateView<3>&, Range, const ContactTable&, ContactWorkspace&,
                                        const Scatter<3, 1, true>&, bool) const;
static_assert(RangeTerm<SphereContact, 3>);

}  // namespace pliant
