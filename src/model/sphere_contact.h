// Friction and damping between balls that touch, with rotation: DiskContact in space.
#pragma once

#include <array>
#include <span>

#include <pliant/model/pair_contact.h>
#include <pliant/model/sphere_slip.h>
#include <pliant/model/surface_friction.h>

namespace pliant {

/// What acts between two balls beside the elastic force N_e = −V' of PairContact, in space. n is the unit vector from j
/// to i, d the distance of the centres, u the relative velocity of the centres across n.
///
/// Normal damping: N = max(N_e − γ_n u_n, 0). The surfaces slide along each other with the velocity q̇ = (R_i + R_j)/d u
/// − (R_i ω_i + R_j ω_j) × n, as disks do in the plane of n and u. Their spring ξ is a vector across n: it grows by the
/// way that they slide (SphereSlip), and turns with n and, about n, with the mean of both balls. P = k_t ξ + γ_t q̇ up
/// to |P| = μ N d/(R_i + R_j); see SurfaceFriction. The force on i is N n − P (R_i + R_j)/d, with the torques R_i n × P
/// and R_j n × P: linear and angular momentum are conserved. No torque about n, none against rolling. The energy of the
/// spring is k_t/2 ξ².
/// Kept: n, R_i Ω_i + R_j Ω_j and Ω_i + Ω_j at the end of the last step, Ω the integral of a spin; ξ there, and whether
/// the contact slid. Units: as the contact's. Elements: neighbour list of points.
template <class Law = HarmonicOverlap>
struct SphereContact {
  Real epsilon;
  SurfaceFriction surface;

  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static constexpr int history = 13;
  static constexpr auto losses = SurfaceTouch<3>::losses;
  static std::string_view name() { return "sphere_contact"; }
  bool enabled(const StateView<3>&) const { return surface.rubs() || surface.damping > 0; }

  /// Of the pair as it is listed, in whatever order.
  struct Touch : SurfaceTouch<3> {
    Index first, second;
    Real a, b;                    ///< radii
    std::array<Real, 3> n;        ///< `lever` is (R_i + R_j)/d
    Real order;                   ///< 1, or −1 where the second one has the lower id
    std::array<Real, 3> turned;   ///< R_i Ω_i + R_j Ω_j
    std::array<Real, 3> twisted;  ///< Ω_i + Ω_j
    std::array<Real, 3> before;   ///< ξ at the end of the last step, turned with the contact
  };

  PLIANT_INLINE bool near(const StateView<3>& s, Index e) const {
    const PairList& list = s.neighbours.point_pairs;
    return (s.position(list[e].first) - s.position(list[e].second)).squaredNorm() < square(list.reach[e]);
  }
  PLIANT_INLINE bool find(const StateView<3>& s, Index e, std::span<const Real> past, Touch& c) const {
    const PairList& list = s.neighbours.point_pairs;
    const auto [first, second] = list.pairs[e];
    const Topology& topology = s.topology;
    const Vec<3> r = s.position(first) - s.position(second);
    const Real d2 = r.squaredNorm(), reach = list.reach[e];
    if (d2 >= square(reach) || d2 == 0) return false;
    const Real d = std::sqrt(d2);
    const Vec<3> n = r / d;
    c.first = first, c.second = second;
    c.a = topology.diameter[first] / 2, c.b = topology.diameter[second] / 2;
    c.n = array_of(n);
    c.order = topology.id[first] > topology.id[second] ? -1 : 1;
    c.lever = reach / d;
    const Vec<3> turned = c.a * s.angle(first) + c.b * s.angle(second), twisted = s.angle(first) + s.angle(second);
    c.turned = array_of(turned), c.twisted = array_of(twisted);
    const Press<Real> press = press_of<Law>(epsilon, reach, d);
    c.elastic = press.force;
    const Real masses = topology.inverse_point_mass[first] + topology.inverse_point_mass[second];
    c.stiffen(surface, press.stiffness / masses, press.reference);
    c.slid = false;
    c.before = c.stretched = {};
    if (!past.empty()) {
      const Real* const p = past.data();
      const SphereSlip slip(c.order * point<3>(p, 0), n, twisted - point<3>(p, 2));
      const Vec<3> spring = c.order * point<3>(p, 3);
      const Vec<3> before = slip.carry(spring);
      c.before = array_of(before);
      c.stretched = array_of(before + slip.carry_on(reach * slip.arc() - slip.across(turned - point<3>(p, 1))));
      c.slid = past[12] != 0;
    }
    return true;
  }
  Real energy(const StateView<3>& s, const Touch& c) const { return c.energy(rub(s, c)); }
  Real power(const StateView<3>& s, const Touch& c) const { return c.power(rub(s, c)); }
  template <class F>
  void add_force(const StateView<3>& s, const Touch& c, F& force) const {
    const auto rubs = rub(s, c);
    add(c, rubs, rubs.normal - c.elastic, force);
  }
  /// With the elastic force: for a kernel that computes both.
  template <class F>
  PLIANT_INLINE void add_total(const StateView<3>& s, const Touch& c, F& force) const {
    const auto rubs = rub(s, c);
    add(c, rubs, rubs.normal, force);
  }
  PLIANT_INLINE void keep(const StateView<3>& s, const Touch& c, std::span<const Real> past, Real* numbers,
                          Real* lost) const {
    const auto rubs = rub(s, c);
    c.count_losses(rubs, !past.empty(), vector_of(c.before), lost);
    point<3>(numbers, 0) = c.order * vector_of(c.n);
    point<3>(numbers, 1) = vector_of(c.turned);
    point<3>(numbers, 2) = vector_of(c.twisted);
    point<3>(numbers, 3) = c.order * rubs.hold.spring;
    numbers[12] = rubs.hold.slides ? 1 : 0;
  }
  /// The spring between two of the stiffest balls: ω² = k_t (2/m + 2R²/I) = 7 k_t/m.
  Real max_rate(const Topology& topology) const { return spring_rate<Law>(surface, topology, epsilon, 1, 7); }
  /// Twelve contacts: Σ n nᵀ = 4, Σ (1 − n nᵀ) = 8, and R² θ² = 5/2 I θ²/m: 2 · 8 · 5/2 for a rotation.
  MotionRates crowded(const Topology& topology) const {
    return surface_rates<Law>(surface, topology, epsilon, 1, {8, 16, 40, 2});
  }
  /// Twelve contacts, a third of them along any direction; as DiskContact.
  Real max_damping(const Topology& topology) const {
    return dashpot_rate<Law>(surface, topology, epsilon, 1, 4 * 4, 2);
  }

 private:
  PLIANT_INLINE typename SurfaceTouch<3>::Rub rub(const StateView<3>& s, const Touch& c) const {
    const Vec<3> v = s.velocity(c.first) - s.velocity(c.second), n = vector_of(c.n);
    const Real parting = n.dot(v);
    return c.rub(surface, parting,
                 c.lever * (v - parting * n) - Vec<3>(c.a * s.spin(c.first) + c.b * s.spin(c.second)).cross(n));
  }

  template <class F>
  PLIANT_INLINE static void add(const Touch& c, const typename SurfaceTouch<3>::Rub& rubs, Real normal, F& force) {
    const Vec<3> n = vector_of(c.n), f = normal * n - c.lever * rubs.hold.pull, twist = n.cross(rubs.hold.pull);
    force.add(c.first, f);
    force.add(c.second, Vec<3>(-f));
    force.add_torque(c.first, Vec<3>(c.a * twist));
    force.add_torque(c.second, Vec<3>(c.b * twist));
  }
};

}  // namespace pliant
