// Four contacts at a time, with the same bits as one by one.
#include <pliant/model/disk_wall_contact.h>

#include <algorithm>

#include <pliant/base/simd.h>

namespace pliant {

using simd::load4;
using simd::Real2;
using simd::Real4;

namespace {

template <ContactLaw law>
PLIANT_MULTIVERSION void settle(FourAtWalls<2, DiskWallContact>& four, const DiskWallContact& term,
                                const StateView<2>& s, const FourAtWalls<2, DiskWallContact>::Next& next,
                                const Scatter<2, 1>& force, bool total) {
  static constexpr std::array<Real, DiskWallContact::history> nothing{};
  const Index count = four.count;
  std::array<DiskWallContact::Touch*, 4> c;
  std::array<const Real*, 4> past;
  for (Index k = 0; k < 4; ++k) {
    const Index l = std::min(k, count - 1);
    c[k] = &four.touch[l];
    past[k] = four.current[l] != nullptr ? four.current[l] : nothing.data();
  }
  const auto read = [](const Real* p, const Real* q, const Real* r, const Real* t, Real4& a, Real4& b, Real4& d,
                       Real4& e) PLIANT_INLINE_LAMBDA {
    a = load4(p), b = load4(q), d = load4(r), e = load4(t);
    simd::transpose(a, b, d, e);
  };

  DiskWallTouch<Real4>::Place place;
  DiskWallTouch<Real4>::Past before;
  Real4 n0, n1, wall0, wall1, spin, mu_static, mu_dynamic, again, slid;
  read(&c[0]->d, &c[1]->d, &c[2]->d, &c[3]->d, place.d, place.curvature, place.radius, place.mass);
  read(c[0]->foot.data(), c[1]->foot.data(), c[2]->foot.data(), c[3]->foot.data(), place.foot0, place.foot1,
       place.across0, place.across1);
  read(c[0]->n.data(), c[1]->n.data(), c[2]->n.data(), c[3]->n.data(), n0, n1, wall0, wall1);
  read(&c[0]->angle, &c[1]->angle, &c[2]->angle, &c[3]->angle, place.angle, spin, mu_static, mu_dynamic);
  read(past[0], past[1], past[2], past[3], before.foot0, before.foot1, before.across0, before.across1);
  read(past[0] + 3, past[1] + 3, past[2] + 3, past[3] + 3, again, before.angle, before.spring, slid);
  before.slid = slid != 0;

  DiskWallTouch<Real4> all;
  all.settle(law, term.epsilon, term.surface, place, before);
  std::array<Index, 4> i;
  std::array<Real2, 4> v;
  for (int k = 0; k < 4; ++k) i[k] = c[k]->i, v[k] = simd::load2(s.v + 2 * std::ptrdiff_t(i[k]));
  const simd::Points2 velocity = simd::transpose(v[0], v[1], v[2], v[3]);
  const Real4 turns{s.spins[i[0]], s.spins[i[1]], s.spins[i[2]], s.spins[i[3]]};
  const auto rubs = all.rub(term.surface.tangential_damping, mu_static, mu_dynamic, n0, n1, velocity.x - wall0,
                            velocity.y - wall1, place.radius, turns - spin);
  const auto [x, y] = all.force(n0, n1, total ? rubs.normal : rubs.normal - all.elastic, rubs.hold.pull);
  Real4 lanes02, lanes13;
  simd::transpose({x, y}, lanes02, lanes13);
  const Real2 push[4] = {simd::low(lanes02), simd::low(lanes13), simd::high(lanes02), simd::high(lanes13)};
  const Real4 torque = rubs.hold.pull * place.radius;
  const Real4 slides = rubs.hold.slides ? simd::all(1) : Real4{};
  for (Index k = 0; k < count; ++k) {
    Real* const out = force.out + 2 * std::ptrdiff_t(i[k]);
    simd::store2(out, simd::load2(out) + push[k]);
    force.torques[i[k]] += torque[k];
    Real* const numbers = next.set(four.element[k]);
    simd::store4(numbers, load4(c[k]->foot.data()));
    numbers[4] = c[k]->angle;
    numbers[5] = rubs.hold.spring[k];
    numbers[6] = slides[k];
  }
  const Real4 lost[3] = {all.normal_power(rubs), all.tangential_power(rubs), all.slid_heat(rubs, before.spring)};
  for (int j = 0; j < 3; ++j) {
    const Real4 some = simd::where(simd::first(count), lost[j]);
    four.lost[j] += (some[0] + some[1]) + (some[2] + some[3]);
  }
  four.count = 0;
}

}  // namespace

void DiskWallContact::settle_four(FourAtWalls<2, DiskWallContact>& four, const StateView<2>& s,
                                  const ContactWorkspace::Next<history, true>& next, const Scatter<2, 1>& force,
                                  bool total) const {
  with_surface_law(law, [&]<class Law>(Law) { settle<Law::kind>(four, *this, s, next, force, total); });
}
static_assert(RangeTerm<DiskWallContact, 2>);

}  // namespace pliant
