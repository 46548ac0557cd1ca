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

/// Reads the history of four contacts; returns the turns of the spheres at the end of the last step.
PLIANT_INLINE Vector take_past(const FourRows& rows, SphereWallTouch<Real4>::Past& past) {
  Vector angle;
  columns(rows, 0, past.foot.x, past.foot.y, past.foot.z, past.n.x);
  columns(rows, 4, past.n.y, past.n.z, angle.x, angle.y);
  columns(rows, 8, angle.z, past.spring.x, past.spring.y, past.spring.z);
  past.slid = column(rows, 12) != 0;
  return angle;
}

using Losses = std::array<Real, SurfaceTouch<3>::losses.size()>;

/// Adds the losses of the first `count` contacts.
PLIANT_INLINE void add_losses(const SphereWallTouch<Real4>& four, const SurfaceTouch<3, Real4>::Rub& rubs, Index count,
                              Losses& lost) {
  const Mask4 counted = simd::first(count);
  const Real4 each[] = {four.normal_power(rubs), four.tangential_power(rubs), four.slid_heat(rubs, four.before)};
  for (std::size_t j = 0; j < lost.size(); ++j) {
    const Real4 some = simd::where(counted, each[j]);
    lost[j] += (some[0] + some[1]) + (some[2] + some[3]);
  }
}

/// Positions and radii of the spheres, and segments of the walls, of four elements. An element whose wall is a solid
/// gets the first segment, and `solid` marks it.
struct FourPlaces {
  std::array<std::ptrdiff_t, 4> i;
  std::array<Index, 4> part;
  Mask4 solid{};
  Vector r;
  Real4 rho, radius, wall_radius;
  MeridianSegment<Real4> wall;

  PLIANT_INLINE FourPlaces(const StateView<3>& s, const Index* elements) {
    const auto* const pairs = s.neighbours.walls.pairs.data();
    const std::vector<WallSegment>& parts = s.walls.parts();
    FourRows rows;
    for (int k = 0; k < 4; ++k) {
      i[k] = pairs[elements[k]].first;
      part[k] = pairs[elements[k]].second;
      const bool segment = static_cast<std::size_t>(part[k]) < parts.size();
      solid[k] = segment ? 0 : -1;
      rows[k] = parts[segment ? static_cast<std::size_t>(part[k]) : 0].origin.data();
    }
    static_assert(offsetof(WallSegment, weight) == 6 * sizeof(Real));
    Real4 weight;
    columns(rows, 0, wall.origin_rho, wall.origin_z, wall.direction_rho, wall.direction_z);
    columns(rows, 3, wall.direction_z, wall.length, wall_radius, weight);
    r = FourPairs::gather3(s.x, i);
    radius = FourPairs::gather(s.topology.diameter.data(), i) / 2;
    rho = square_root(Real4(r.x * r.x + r.y * r.y));
  }
};

PLIANT_MULTIVERSION Index find_near_at_rest(const StateView<3>& s, Range range, Index* near) {
  Index count = 0;
  for (Index e = range.first; e < range.last; e += 4) {
    std::array<Index, 4> elements;
    for (Index k = 0; k < 4; ++k) elements[k] = std::min(e + k, range.last - 1);
    const FourPlaces c(s, elements.data());
    const MeridianDistance<Real4> at(c.rho, c.r.z, c.wall);
    // Near the axis walls are farther than this distance says.
    const Mask4 may_touch = (at.d - c.wall_radius < c.radius) | c.solid | (c.rho < axis_width);
    const Index some = std::min(range.last - e, Index(4));
    for (Index k = 0; k < some; ++k) {
      near[count] = e + k;
      count -= static_cast<Index>(may_touch[k]);
    }
  }
  return count;
}

template <ContactLaw law>
PLIANT_MULTIVERSION bool settle_resting(const SphereWallContact& term, const StateView<3>& s, const Index* near,
                                        Index count, const FourAtWalls<3, SphereWallContact>::Current& current,
                                        const FourAtWalls<3, SphereWallContact>::Next& next, const Scatter<3, 1>& force,
                                        bool total, Losses& lost) {
  static constexpr std::array<Real, SphereWallContact::history> nothing{};
  std::array<Index, 4> rest;
  const Index* const elements = four_from(near, count, 0, rest);
  const FourPlaces c(s, elements);
  const MeridianDistance<Real4> at(c.rho, c.r.z, c.wall);
  SphereWallTouch<Real4>::Place place;
  place.d = at.d - c.wall_radius;
  if (any_of(c.solid | (c.rho < axis_width) | (at.d <= 0) | (place.d >= c.radius))) return false;
  for (Index k = 0; k < count; ++k)
    if (at.at_end[k] != 0 || c.part[k] >= static_cast<Index>(s.walls.segments().size()))
      if (!s.walls.carries(s.position(static_cast<Index>(c.i[k])), c.part[k], s.t)) return false;

  place.radius = c.radius, place.share = simd::all(1);
  FourRows past;
  Real4 mu_static, mu_dynamic;
  for (Index k = 0; k < 4; ++k) {
    place.mass[k] = s.topology.mass(static_cast<Index>(c.i[k]));
    const Coulomb mu = term.others.of(s.walls.material(s.walls.body_of_part(c.part[k])), term.surface);
    mu_static[k] = mu.mu_static, mu_dynamic[k] = mu.mu_dynamic;
    const Real* const row = current(elements[k]);
    past[k] = row != nullptr ? row : nothing.data();
  }
  place.n = {at.n_rho * c.r.x / c.rho, at.n_rho * c.r.y / c.rho, at.n_z};
  place.foot = c.r - place.d * place.n;
  const Real4 farther = place.radius - place.d;
  const Matrix3<Real4> curvature =
      revolved(Real4(c.r.x / c.rho), Real4(c.r.y / c.rho), at.rho_rho, at.rho_z, at.z_z, Real4(at.n_rho / c.rho));
  place.stretch = {farther * curvature.x, farther * curvature.y, farther * curvature.z};
  place.stretch.x.x += 1, place.stretch.y.y += 1, place.stretch.z.z += 1;

  SphereWallTouch<Real4>::Past before;
  const Vector angle = FourPairs::gather3(s.angles, c.i);
  const Vector angle_before = take_past(past, before);
  SphereWallTouch<Real4> all;
  all.settle(law, term.epsilon, term.surface, place, before, angle - angle_before);
  const auto rubs = all.rub(term.surface.tangential_damping, mu_static, mu_dynamic, FourPairs::gather3(s.v, c.i),
                            FourPairs::gather3(s.spins, c.i));
  const FourVectors pushes(all.force(total ? rubs.normal : rubs.normal - all.elastic, rubs.hold.pull)),
      torques(all.torque(rubs.hold.pull));
  const Vector &foot = place.foot, &n = place.n, &spring = rubs.hold.spring;
  const Real4 slides = rubs.hold.slides ? simd::all(1) : Real4{};
  std::array<Real, SphereWallContact::history> unused;
  std::array<Real*, 4> numbers{unused.data(), unused.data(), unused.data(), unused.data()};
  for (Index k = 0; k < count; ++k) {
    pushes.add(k, force.out + 3 * c.i[k]);
    torques.add(k, force.torques + 3 * c.i[k]);
    numbers[k] = next.set(elements[k]);
  }
  write_columns(numbers, 0, foot.x, foot.y, foot.z, n.x);
  write_columns(numbers, 4, n.y, n.z, angle.x, angle.y);
  write_columns(numbers, 8, angle.z, spring.x, spring.y, spring.z);
  for (int k = 0; k < 4; ++k) numbers[k][12] = slides[k];
  add_losses(all, rubs, count, lost);
  return true;
}

template <ContactLaw law>
PLIANT_MULTIVERSION void settle(FourAtWalls<3, SphereWallContact>& four, const SphereWallContact& term,
                                const StateView<3>& s, const FourAtWalls<3, SphereWallContact>::Next& next,
                                const Scatter<3, 1>& force, bool total) {
  using Touch = SphereWallContact::Touch;
  static constexpr std::array<Real, SphereWallContact::history> nothing{};
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

  SphereWallTouch<Real4>::Place place;
  SphereWallTouch<Real4>::Past before;
  Real4 mu_static, mu_dynamic, unused;
  columns(rows(&Touch::size), 0, place.d, place.radius, place.mass, place.share);
  place.n = vector_of(rows(&Touch::across), mu_static);
  place.foot = vector_of(rows(&Touch::foot), mu_dynamic);
  place.stretch = matrix(&Touch::rows);
  const Vector angle_before = take_past(past, before);
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
  all.settle(law, term.epsilon, term.surface, place, before, turn);
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
  add_losses(all, rubs, count, four.lost);
  four.count = 0;
}

}  // namespace

Index SphereWallContact::find_near(const StateView<3>& s, Range range, Index* near) const {
  if (s.walls.rest() && !s.walls.parts().empty()) return find_near_at_rest(s, range, near);
  Index count = 0;
  for (Index e = range.first; e < range.last; ++e) {
    const auto [i, part] = s.neighbours.walls[e];
    near[count] = e;
    count += s.walls.beyond(s.position(i), s.topology.diameter[i] / 2, part, s.t) ? 0 : 1;
  }
  return count;
}

void SphereWallContact::settle_four(FourAtWalls<3, SphereWallContact>& four, const StateView<3>& s,
                                    const ContactWorkspace::Next<history, true>& next, const Scatter<3, 1>& force,
                                    bool total) const {
  with_surface_law(law, [&]<class Law>(Law) { settle<Law::kind>(four, *this, s, next, force, total); });
}

bool SphereWallContact::settle_at_rest(const StateView<3>& s, const Index* near, Index count,
                                       const ContactTable::Current<history>& current,
                                       const ContactWorkspace::Next<history, true>& next, const Scatter<3, 1>& force,
                                       bool total, Losses& lost) const {
  return s.walls.rest() && !s.walls.parts().empty() && with_surface_law(law, [&]<class Law>(Law) {
           return settle_resting<Law::kind>(*this, s, near, count, current, next, force, total, lost);
         });
}
static_assert(RangeTerm<SphereWallContact, 3>);

}  // namespace pliant
