// Friction and damping between disks that touch, with rotation.
#pragma once

#include <span>

#include <pliant/geometry/turn.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/surface_friction.h>

namespace pliant {

/// What acts between two disks beside the elastic force N_e = −V' of PairContact, in the plane. i is the one with the
/// lower id, n the unit vector from j to i, t = n turned by 90°, d the distance of the centres.
///
/// Normal damping: N = max(N_e − γ_n u_n, 0), u_n = n·(v_i − v_j): the contact never attracts.
/// Tangential spring: with the direction φ of n, q = (R_i + R_j) φ − R_i θ_i − R_j θ_j grows as the surfaces slide
/// along each other. The spring is ξ = q − q₀, and P = k_t ξ + γ_t q̇ up to |P| = μ N d/(R_i + R_j); see
/// SurfaceFriction. The force on i is N n − P (R_i + R_j)/d t, which is at most μN, with the torques P R_i and P R_j:
/// it acts at the point that divides the distance of the centres as the radii do, so linear and angular momentum are
/// conserved. The energy of the spring is k_t/2 ξ², what it loses by sliding is heat. A contact that begins within a
/// step has no spring until its end. Kept: where n, R_i θ_i + R_j θ_j and ξ were at the end of the last step, and
/// whether the contact slid. Units: as the contact's. Elements: neighbour list of points.
template <class Law = HarmonicOverlap>
struct DiskContact {
  Real epsilon;
  SurfaceFriction surface;

  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static constexpr int history = 5;
  static constexpr auto losses = SurfaceTouch<2>::losses;
  static std::string_view name() { return "disk_contact"; }
  bool enabled(const StateView<2>&) const { return surface.rubs() || surface.damping > 0; }

  /// Of the pair as it is listed, in whatever order: but for n, all that is kept is the same from both sides.
  struct Touch : SurfaceTouch<2> {
    Index first, second;
    Real a, b;  ///< radii
    Real n0, n1;
    Real order;   ///< 1, or −1 where the second one has the lower id
    Real turned;  ///< R_i θ_i + R_j θ_j; `lever` is (R_i + R_j)/d
  };

  /// Each particle is one point: their numbers are the same.
  PLIANT_INLINE bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const PairList& list = s.neighbours.point_pairs;
    const auto [first, second] = list.pairs[e];
    const Topology& topology = s.topology;
    const Vec<2> r = s.position(first) - s.position(second);
    const Real d2 = r.squaredNorm(), reach = list.reach[e];
    if (d2 >= square(reach) || d2 == 0) return false;
    const Real a = topology.diameter[first] / 2, b = topology.diameter[second] / 2, d = std::sqrt(d2), per_d = 1 / d;
    const Vec<2> n = per_d * r;
    const Real turned = a * s.angles[first] + b * s.angles[second];
    const Real masses = topology.inverse_point_mass[first] + topology.inverse_point_mass[second];
    const Real order = topology.id[first] > topology.id[second] ? -1 : 1;
    const Press press = press_of(Law{epsilon, reach}, d);
    c.first = first, c.second = second;
    c.a = a, c.b = b;
    c.n0 = n[0], c.n1 = n[1];
    c.order = order;
    c.turned = turned;
    c.lever = reach * per_d;
    c.elastic = press.force;
    c.stiffen(surface, press.stiffness / masses, press.reference);
    c.slid = !past.empty() && past[4] != 0;
    c.stretched =
        past.empty() ? 0 : past[3] + reach * turn_between({order * past[0], order * past[1]}, n) - (turned - past[2]);
    return true;
  }
  Real energy(const StateView<2>& s, const Touch& c) const { return c.energy(rub(s, c)); }
  Real power(const StateView<2>& s, const Touch& c) const { return c.power(rub(s, c)); }
  template <class F>
  PLIANT_INLINE void add_force(const StateView<2>& s, const Touch& c, F& force) const {
    const SurfaceTouch<2>::Rub rubs = rub(s, c);
    add(c, rubs, rubs.normal - c.elastic, force);
  }
  /// With the elastic force: for a kernel that computes both.
  template <class F>
  PLIANT_INLINE void add_total(const StateView<2>& s, const Touch& c, F& force) const {
    const SurfaceTouch<2>::Rub rubs = rub(s, c);
    add(c, rubs, rubs.normal, force);
  }
  PLIANT_INLINE void advance(const StateView<2>& s, const Touch& c, Real h, bool known, std::span<Real> numbers,
                             std::span<Real> heat) const {
    const SurfaceTouch<2>::Rub rubs = rub(s, c);
    c.add_heat(rubs, h, known, numbers[3], heat);
    numbers[0] = c.order * c.n0;
    numbers[1] = c.order * c.n1;
    numbers[2] = c.turned;
    numbers[3] = rubs.hold.spring;
    numbers[4] = rubs.hold.slides ? 1 : 0;
  }
  /// The spring between two of the stiffest disks: ω² = k_t (2/m + 2R²/I) = 6 k_t/m.
  Real max_rate(const Topology& topology) const { return spring_rate<Law>(surface, topology, epsilon, 1, 6); }
  /// Six contacts, half of them along any direction; each damps with 4 ζ √(V''/(2m)), m of one of two like disks.
  Real max_damping(const Topology& topology) const {
    return dashpot_rate<Law>(surface, topology, epsilon, 1, 3 * 4, 2);
  }

 private:
  PLIANT_INLINE SurfaceTouch<2>::Rub rub(const StateView<2>& s, const Touch& c) const {
    const Vec<2> v = s.velocity(c.first) - s.velocity(c.second), n(c.n0, c.n1), t(-c.n1, c.n0);
    return c.rub(surface, n.dot(v), c.lever * t.dot(v) - (c.a * s.spins[c.first] + c.b * s.spins[c.second]));
  }

  template <class F>
  PLIANT_INLINE static void add(const Touch& c, const SurfaceTouch<2>::Rub& rubs, Real normal, F& force) {
    const Vec<2> n(c.n0, c.n1), t(-c.n1, c.n0), f = normal * n - rubs.hold.pull * c.lever * t;
    force.add(c.first, f);
    force.add(c.second, Vec<2>(-f));
    force.add_torque(c.first, rubs.hold.pull * c.a);
    force.add_torque(c.second, rubs.hold.pull * c.b);
  }
};

/// Both forces of pairs of disks, or of balls, in one pass.
struct DiskKernel {
  static constexpr bool fast() { return true; }
  template <int D, class Law, class Friction>
  static void add_forces(const StateView<D>& s, Index chunk, Real* f, const PairContact<D, Law>& contact,
                         const Friction& friction) {
    const PairList& list = s.neighbours.point_pairs;
    Real* const torques = f + static_cast<std::size_t>(s.topology.owned_points()) * D;
    const Range inside = list.inside(chunk), across = list.across(chunk), own = s.neighbours.points(chunk);
    if (!friction.enabled(s)) {
      Scatter<D, -1> here{f};
      Scatter<D, -1, true> there{f, own};
      for (Index e = inside.first; e < inside.last; ++e) contact.add_gradient(s, e, here);
      for (Index e = across.first; e < across.last; ++e) contact.add_gradient(s, e, there);
      return;
    }
    const auto add = [&](Range range, auto scatter) {
      for_each_touch(friction, s, range,
                     [&](const auto& c) PLIANT_INLINE_LAMBDA { friction.add_total(s, c, scatter); });
    };
    add(inside, Scatter<D, 1>{f, {}, torques});
    add(across, Scatter<D, 1, true>{f, own, torques});
  }
};

}  // namespace pliant
