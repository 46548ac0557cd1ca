// Friction and damping between spheres that touch, with rotation: DiskContact in space.
#pragma once

#include <cmath>
#include <span>

#include <pliant/model/pair_contact.h>
#include <pliant/model/sphere_slip.h>
#include <pliant/model/surface_friction.h>

namespace pliant {

/// Two spheres that touch, or several such pairs if R is a vector. The pair may be listed in either order.
template <class R>
struct SphereTouch : SurfaceTouch<3, R> {
  using Vector = Vector3<R>;

  R a, b;         ///< radii; `lever` is (R_i + R_j)/d
  R order;        ///< 1, or −1 if the second sphere has the lower id
  Vector n;       ///< from the second to the first
  Vector before;  ///< ξ at the end of the last step, turned with the contact

  /// Constants of a pair: the radii, their sum and its inverse; V'' and √(m V'') with the reduced mass m if V'' does
  /// not depend on the distance, else 0 and √m.
  struct Constants {
    R a, b, reach, per_reach, order, stiffness, root;
  };
  /// Places of the spheres.
  struct Pair {
    Vector r;               ///< from the second to the first
    Vector turn_a, turn_b;  ///< rotations in the step
  };
  /// Current history of the pair; zeros without contact.
  struct Past {
    Vector n, spring;
    MaskOf<R> slid;
  };
  PLIANT_INLINE void find(ContactLaw law, Real epsilon, const SurfaceFriction& surface, const Constants& c,
                          const Pair& pair, const Past& past) {
    const R d2 = dot(pair.r, pair.r), d = square_root(d2), per_d = d * (1 / d2);  // root and quotient overlap
    a = c.a, b = c.b, order = c.order;
    n = per_d * pair.r;
    this->lever = c.reach * per_d, this->per_lever = c.per_reach * d;
    if (constant_stiffness(law)) {
      this->elastic = c.stiffness * (c.reach - d);
      this->gamma = 2 * surface.damping * c.root;
      this->k = surface.stiffness * c.stiffness;
    } else {
      const Press<R> press = press_of(law, epsilon, c.reach, d);
      this->elastic = press.force;
      this->gamma = 2 * surface.damping * square_root(press.stiffness) * c.root;
      this->k = surface.stiffness * press.reference;
    }
    this->slid = past.slid;
    const MaskOf<R> known = (past.n.x != 0) | (past.n.y != 0) | (past.n.z != 0);
    const Vector none{};
    // A new contact has not moved.
    const SphereSlip<R> slip(select<R>(known, order * past.n, n), n, select<R>(known, pair.turn_a + pair.turn_b, none));
    before = slip.carry(order * past.spring);
    const Vector slid_by = c.reach * slip.arc() - slip.across(a * pair.turn_a + b * pair.turn_b);
    this->stretched = select<R>(known, before + slip.carry_on(slid_by), none);
  }
  /// v: velocity of the first relative to the second; spins of both.
  PLIANT_INLINE typename SurfaceTouch<3, R>::Rub rub(const SurfaceFriction& surface, const Vector& v,
                                                     const Vector& spin_a, const Vector& spin_b) const {
    const R parting = dot(n, v);
    return SurfaceTouch<3, R>::rub(surface, parting,
                                   this->lever * (v - parting * n) - cross(a * spin_a + b * spin_b, n));
  }
  /// Force on the first sphere: normal force plus tangential pull.
  PLIANT_INLINE Vector force(R normal, const Vector& pull) const { return normal * n - this->lever * pull; }
  /// The torque of the pull on a sphere of radius 1.
  PLIANT_INLINE Vector torque(const Vector& pull) const { return cross(n, pull); }
};

/// Friction and damping between two spheres, besides the elastic force N_e = −V' of PairContact, in space. n is the
/// unit vector from j to i, d the distance of the centres, u the relative velocity of the centres across n.
///
/// Normal damping: N = max(N_e − γ_n u_n, 0). The surfaces slide along each other with the velocity q̇ = (R_i + R_j)/d u
/// − (R_i ω_i + R_j ω_j) × n, as disks do in the plane of n and u. The spring ξ is a vector across n, which grows by
/// the slip of the surfaces (SphereSlip), rotates with n and, about n, with the mean rotation of both spheres. P = k_t
/// ξ + γ_t q̇ up to |P| = μ N d/(R_i + R_j); see SurfaceFriction. The force on i is N n − P (R_i + R_j)/d, with the
/// torques R_i n × P and R_j n × P: linear and angular momentum are conserved. There is no torque about n, and no
/// resistance to rolling. The energy of the spring is k_t/2 ξ².
/// Contact history: n and ξ at the end of the last step, and whether the contact slid. Units: as the contact's.
/// Elements: neighbour list of points.
struct SphereContact {
  Real epsilon = 0;
  SurfaceFriction surface = {};
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static constexpr int history = 7, constants = 8;
  static constexpr auto losses = SurfaceTouch<3>::losses;
  static std::string_view name() { return "sphere_contact"; }
  void read(ParameterReader& p) {
    epsilon = p.number(contact_energy::disk);
    surface = read_surface(p, law, read_pair_friction(p));
  }
  bool enabled(const StateView<3>&) const { return surface.rubs() || surface.damping > 0; }

  struct Touch : SphereTouch<Real> {
    Index first, second;
  };

  /// Each particle is one point: their numbers are the same.
  PLIANT_INLINE bool find(const StateView<3>& s, Index e, std::span<const Real> past, Touch& c) const {
    const PairList& list = s.neighbours.point_pairs;
    const auto [first, second] = list.pairs[e];
    const Topology& topology = s.topology;
    const Vector3<Real> r = vector3(s.x, first) - vector3(s.x, second);
    const Real d2 = dot(r, r), reach = list.reach[e];
    if (d2 >= square(reach) || d2 == 0) return false;
    c.first = first, c.second = second;
    const Real* const p = past.data();
    c.find(law, epsilon, surface, constants_of(topology, first, second, reach),
           past.empty() ? SphereTouch<Real>::Pair{r, {}, {}}
                        : SphereTouch<Real>::Pair{r, vector3(s.turns, first), vector3(s.turns, second)},
           past.empty() ? SphereTouch<Real>::Past{} : SphereTouch<Real>::Past{vector3(p, 0), vector3(p, 1), p[6] != 0});
    return true;
  }
  SphereTouch<Real>::Constants constants_of(const Topology& topology, Index i, Index j, Real reach) const {
    const Real mass = 1 / (topology.inverse_point_mass[i] + topology.inverse_point_mass[j]),
               stiffness = constant_stiffness(law) ? press_of(law, epsilon, reach, reach).stiffness : 0;
    return {topology.diameter[i] / 2,
            topology.diameter[j] / 2,
            reach,
            1 / reach,
            topology.id[i] > topology.id[j] ? -1.0 : 1.0,
            stiffness,
            std::sqrt(constant_stiffness(law) ? mass * stiffness : mass)};
  }
  Real energy(const StateView<3>& s, const Touch& c) const { return c.energy(rub(s, c)); }
  Real power(const StateView<3>& s, const Touch& c) const { return c.power(rub(s, c)); }
  template <class F>
  PLIANT_INLINE void add_force(const StateView<3>& s, const Touch& c, F& force) const {
    const SurfaceTouch<3>::Rub rubs = rub(s, c);
    add(c, rubs, rubs.normal - c.elastic, force);
  }
  /// With the elastic force: for a kernel that computes both.
  template <class F>
  PLIANT_INLINE void add_total(const StateView<3>& s, const Touch& c, F& force) const {
    const SurfaceTouch<3>::Rub rubs = rub(s, c);
    add(c, rubs, rubs.normal, force);
  }
  /// total: with the elastic forces.
  template <bool OwnOnly>
  void add_forces(const StateView<3>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<3, 1, OwnOnly>& force, bool total = false) const;
  /// The spring between two of the stiffest spheres: ω² = k_t (2/m + 2R²/I) = 7 k_t/m.
  Real max_rate(const Topology& topology) const { return spring_rate(law, surface, topology, epsilon, 1, 7); }
  /// Twelve contacts: Σ n nᵀ = 4, Σ (1 − n nᵀ) = 8, and R² θ² = 5/2 I θ²/m: 2 · 8 · 5/2 for a rotation.
  MotionRates crowded(const Topology& topology) const {
    return surface_rates(law, surface, topology, epsilon, 1, {8, 16, 40, 2});
  }
  /// Twelve contacts, a third of them along any direction; as DiskContact.
  Real max_damping(const Topology& topology) const {
    return dashpot_rate(law, surface, topology, epsilon, 1, 4 * 4, 2);
  }

 private:
  PLIANT_INLINE SurfaceTouch<3>::Rub rub(const StateView<3>& s, const Touch& c) const {
    return static_cast<const SphereTouch<Real>&>(c).rub(surface, vector3(s.v, c.first) - vector3(s.v, c.second),
                                                        vector3(s.spins, c.first), vector3(s.spins, c.second));
  }

  template <class F>
  PLIANT_INLINE static void add(const Touch& c, const SurfaceTouch<3>::Rub& rubs, Real normal, F& force) {
    const Vec<3> f = vec(c.force(normal, rubs.hold.pull)), twist = vec(c.torque(rubs.hold.pull));
    force.add(c.first, f);
    force.add(c.second, Vec<3>(-f));
    force.add_torque(c.first, Vec<3>(c.a * twist));
    force.add_torque(c.second, Vec<3>(c.b * twist));
  }
};

}  // namespace pliant
