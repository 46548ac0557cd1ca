// Four contacts at a time, with the same bits as single contacts.
#include <pliant/model/sphere_wall_contact.h>

#include <algorithm>
#include <array>
#include <cstddef>

#include <pliant/model/four_pairs.h>

namespace pliant {

using simd::Mask4;
using simd::Real4;
using Vector = Vector3<Real4>;

namespace {

/// Three numbers of each row as a vector, and the fourth.
PLIANT_INLINE Vector vector_of(const FourRows& rows, Real4& fourth) {
  Vector a;
  columns(rows, 0, a.x, a.y, a.z, fourth);
  return a;
}

template <class Law>
PLIANT_MULTIVERSION void settle(FourAtWalls<3, SphereWallContact<Law>>& four, const SphereWallContact<Law>& term,
                                const StateView<3>& s,
                                const typename FourAtWalls<3, SphereWallContact<Law>>::Next& next,
                                const Scatter<3, 1>& force, bool total) {
  using Touch = typename SphereWallContact<Law>::Touch;
  static constexpr std::array<Real, SphereWallContact<Law>::history> nothing{};
  const Index count = four.count;
  std::array<const Touch*, 4> c;
  FourRows past;
  std::array<std::ptrdiff_t, 4> i;
  bool turned = false;
  for (Index k = 0; k < 4; ++k) {
    const Index l = std::min(k, count - 1);
    c[k] = &four.touch[l];
    past[k] = four.current[l] != nullptr ? four.current[l] : nothing.data();
    i[k] = c[k]->i;
    turned = turned || c[k]->turned;
  }
  const auto rows = [&](auto member) PLIANT_INLINE_LAMBDA {
    return FourRows{(c[0]->*member).data(), (c[1]->*member).data(), (c[2]->*member).data(), (c[3]->*member).data()};
  };
  const auto matrix = [&](auto member) PLIANT_INLINE_LAMBDA {
    Real4 unused;
    std::array<Vector, 3> row;
    for (int k = 0; k < 3; ++k)
      row[k] = vector_of(
          {(c[0]->*member)[k].data(), (c[1]->*member)[k].data(), (c[2]->*member)[k].data(), (c[3]->*member)[k].data()},
          unused);
    return Matrix3<Real4>{row[0], row[1], row[2]};
  };

  typename SphereWallTouch<Real4>::Place place;
  typename SphereWallTouch<Real4>::Past before;
  Real4 mu_static, mu_dynamic, unused;
  columns(rows(&Touch::size), 0, place.d, place.radius, place.mass, place.share);
  place.n = vector_of(rows(&Touch::across), mu_static);
  place.foot = vector_of(rows(&Touch::foot), mu_dynamic);
  place.stretch = matrix(&Touch::rows);
  Vector angle_before;
  columns(past, 0, before.foot.x, before.foot.y, before.foot.z, before.n.x);
  columns(past, 4, before.n.y, before.n.z, angle_before.x, angle_before.y);
  columns(past, 8, angle_before.z, before.spring.x, before.spring.y, before.spring.z);
  before.slid = column(past, 12) != 0;
  Vector turn = vector_of(rows(&Touch::angle), unused) - angle_before,
         velocity = FourPairs::gather3(s.v, i) - vector_of(rows(&Touch::wall_velocity), unused),
         spin = FourPairs::gather3(s.spins, i) - vector_of(rows(&Touch::wall_spin), unused);
  if (turned) {
    const Matrix3<Real4> rotation = matrix(&Touch::turn);
    turn = rotation.transposed_times(turn);
    velocity = rotation.transposed_times(velocity);
    spin = rotation.transposed_times(spin);
  }

  SphereWallTouch<Real4> all;
  all.template settle<Law>(term.epsilon, term.surface, place, before, turn);
  const auto rubs = all.rub(term.surface.tangential_damping, mu_static, mu_dynamic, velocity, spin);
  Vector push = all.force(total ? rubs.normal : rubs.normal - all.elastic, rubs.hold.pull),
         torque = all.torque(rubs.hold.pull);
  if (turned) {
    const Matrix3<Real4> rotation = matrix(&Touch::turn);
    push = rotation * push, torque = rotation * torque;
  }
  const FourVectors pushes(push), torques(torque);
  const Vector& spring = rubs.hold.spring;
  const Real4 slides = rubs.hold.slides ? simd::all(1) : Real4{};
  for (Index k = 0; k < count; ++k) {
    pushes.add(k, force.out + 3 * i[k]);
    torques.add(k, force.torques + 3 * i[k]);
    Real* const numbers = next.set(four.element[k]);
    std::copy_n(c[k]->foot.data(), 3, numbers);
    std::copy_n(c[k]->across.data(), 3, numbers + 3);
    std::copy_n(c[k]->angle.data(), 3, numbers + 6);
    numbers[9] = spring.x[k], numbers[10] = spring.y[k], numbers[11] = spring.z[k], numbers[12] = slides[k];
  }
  const Mask4 counted = simd::first(count);
  const Real4 lost[3] = {all.normal_power(rubs), all.tangential_power(rubs), all.slid_heat(rubs, all.before)};
  for (int j = 0; j < 3; ++j) {
    const Real4 some = simd::where(counted, lost[j]);
    four.lost[j] += (some[0] + some[1]) + (some[2] + some[3]);
  }
  four.count = 0;
}

}  // namespace

template <class Law>
void settle_four(FourAtWalls<3, SphereWallContact<Law>>& four, const SphereWallContact<Law>& term,
                 const StateView<3>& s, const typename FourAtWalls<3, SphereWallContact<Law>>::Next& next,
                 const Scatter<3, 1>& force, bool total) {
  settle(four, term, s, next, force, total);
}
static_assert(RangeTerm<SphereWallContact<>, 3>);
// A type cannot be in parentheses. NOLINTBEGIN(bugprone-macro-parentheses)
#define PLIANT_SETTLE_FOUR(Law)                                                                                     \
  template void settle_four<Law>(FourAtWalls<3, SphereWallContact<Law>>&, const SphereWallContact<Law>&,            \
                                 const StateView<3>&, const typename FourAtWalls<3, SphereWallContact<Law>>::Next&, \
                                 const Scatter<3, 1>&, bool);
PLIANT_SETTLE_FOUR(HarmonicOverlap)
PLIANT_SETTLE_FOUR(HertzOverlap)
PLIANT_SETTLE_FOUR(SpringOverlap)
#undef PLIANT_SETTLE_FOUR
// NOLINTEND(bugprone-macro-parentheses)

}  // namespace pliant
