// Friction and damping between disks that touch, with rotation.
#pragma once

#include <span>
#include <utility>

#include <pliant/geometry/turn.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/surface_friction.h>
#include <pliant/model/term_loops.h>

namespace pliant {

/// Two disks that touch, or several such pairs if R is a vector. The pair may be listed in either order: the stored
/// numbers are equal from both sides.
template <class R>
struct DiskTouch : SurfaceTouch<2, R> {
  R a, b;  ///< radii
  R n0, n1;
  R turned;  ///< R_i θ_i + R_j θ_j; `lever` is (R_i + R_j)/d

  /// Data of the disks.
  struct Pair {
    R x, y, d2;          ///< from the second to the first
    R reach, a, b;       ///< R_i + R_j, and each
    R root_mass;         ///< root of the reduced mass
    R angle_a, angle_b;  ///< θ
  };
  /// And their current history; zeros if they did not touch.
  struct Past {
    R n0, n1, turned, spring;
    MaskOf<R> slid;
  };
  PLIANT_INLINE void find(ContactLaw law, Real epsilon, const SurfaceFriction& surface, const Pair& pair,
                          const Past& past) {
    const R d = square_root(pair.d2), per_d = 1 / d;
    a = pair.a, b = pair.b;
    n0 = per_d * pair.x, n1 = per_d * pair.y;
    turned = a * pair.angle_a + b * pair.angle_b;
    this->lever = pair.reach * per_d;
    const Press<R> press = press_of(law, epsilon, pair.reach, d);
    this->elastic = press.force;
    this->gamma = 2 * surface.damping * square_root(press.stiffness) * pair.root_mass;
    this->k = surface.stiffness * press.reference;
    this->slid = past.slid;
    const MaskOf<R> known = (past.n0 != 0) | (past.n1 != 0);
    const R spring = past.spring + pair.reach * turn_between_lines(past.n0, past.n1, n0, n1) - (turned - past.turned);
    this->stretched = known ? spring : R();
  }
  /// v: velocity of the first relative to the second; spins of both.
  PLIANT_INLINE typename SurfaceTouch<2, R>::Rub rub(const SurfaceFriction& surface, R vx, R vy, R spin_a,
                                                     R spin_b) const {
    return SurfaceTouch<2, R>::rub(surface, n0 * vx + n1 * vy,
                                   this->lever * (n0 * vy - n1 * vx) - (a * spin_a + b * spin_b));
  }
  /// n or −n, the same from both sides.
  PLIANT_INLINE std::pair<R, R> line() const {
    const MaskOf<R> other = (n0 < 0) | ((n0 == 0) & (n1 < 0));
    return {other ? -n0 : n0, other ? -n1 : n1};
  }
  /// Force on the first disk: normal force plus tangential pull.
  PLIANT_INLINE std::pair<R, R> force(R normal, R pull) const {
    const R across = pull * this->lever;
    return {normal * n0 + across * n1, normal * n1 - across * n0};
  }
};

/// Friction and damping between two disks, besides the elastic force N_e = −V' of PairContact, in the plane. i is the
/// disk with the lower id, n the unit vector from j to i, t = n turned by 90°, d the distance of the centres.
///
/// Normal damping: N = max(N_e − γ_n u_n, 0), u_n = n·(v_i − v_j): the contact never attracts.
/// Tangential spring: with the direction φ of n, q = (R_i + R_j) φ − R_i θ_i − R_j θ_j grows as the surfaces slide
/// along each other. The spring is ξ = q − q₀, and P = k_t ξ + γ_t q̇ up to |P| = μ N d/(R_i + R_j); see
/// SurfaceFriction. The force on i is N n − P (R_i + R_j)/d t, which is at most μN, with the torques P R_i and P R_j.
/// The force acts at the point that divides the distance of the centres as the radii do, so linear and angular momentum
/// are conserved. The energy of the spring is k_t/2 ξ², sliding turns this energy into heat. A contact that begins
/// within a step has no spring until its end. Stored: the line of n, R_i θ_i + R_j θ_j and ξ at the end of the last
/// step, and whether the contact slid; n turns by less than a right angle in a step. Units: as the contact's. Elements:
/// neighbour list of points.
struct DiskContact {
  Real epsilon = 0;
  SurfaceFriction surface = {};
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::point_pairs;
  static constexpr bool rotates = true;
  static constexpr int history = 5, constants = 4;
  static constexpr auto losses = SurfaceTouch<2>::losses;
  static std::string_view name() { return "disk_contact"; }
  void read(ParameterReader& p) {
    epsilon = p.number(contact_energy::disk);
    surface = read_surface(p, law, read_pair_friction(p));
  }
  bool enabled(const StateView<2>&) const { return surface.rubs() || surface.damping > 0; }

  struct Touch : DiskTouch<Real> {
    Index first, second;
  };

  /// Each particle is one point: their numbers are the same.
  PLIANT_INLINE bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const PairList& list = s.neighbours.point_pairs;
    const auto [first, second] = list.pairs[e];
    const Topology& topology = s.topology;
    const Vec<2> r = s.position(first) - s.position(second);
    const Real d2 = r.squaredNorm(), reach = list.reach[e];
    if (d2 >= square(reach) || d2 == 0) return false;
    c.first = first, c.second = second;
    const bool known = !past.empty();
    c.find(law, epsilon, surface,
           {r[0], r[1], d2, reach, topology.diameter[first] / 2, topology.diameter[second] / 2,
            root_mass(topology, first, second), s.angles[first], s.angles[second]},
           known ? DiskTouch<Real>::Past{past[0], past[1], past[2], past[3], past[4] != 0} : DiskTouch<Real>::Past{});
    return true;
  }
  static Real root_mass(const Topology& topology, Index i, Index j) {
    return std::sqrt(1 / (topology.inverse_point_mass[i] + topology.inverse_point_mass[j]));
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
  /// total: with the elastic forces.
  template <bool OwnOnly>
  void add_forces(const StateView<2>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<2, 1, OwnOnly>& force, bool total = false) const;
  /// The spring between two of the stiffest disks: ω² = k_t (2/m + 2R²/I) = 6 k_t/m.
  Real max_rate(const Topology& topology) const { return spring_rate(law, surface, topology, epsilon, 1, 6); }
  /// Six contacts: Σ n nᵀ = Σ t tᵀ = 3, and (u_i·t ± R θ_i)² weighs R² θ² = 2 I θ²/m: 2 · 6 · 2 for a rotation.
  MotionRates crowded(const Topology& topology) const {
    return surface_rates(law, surface, topology, epsilon, 1, {6, 6, 24, 2});
  }
  /// Six contacts, half of them along any direction; each damps with 4 ζ √(V''/(2m)), m of one of two like disks.
  Real max_damping(const Topology& topology) const {
    return dashpot_rate(law, surface, topology, epsilon, 1, 3 * 4, 2);
  }

 private:
  PLIANT_INLINE SurfaceTouch<2>::Rub rub(const StateView<2>& s, const Touch& c) const {
    const Vec<2> v = s.velocity(c.first) - s.velocity(c.second);
    return static_cast<const DiskTouch<Real>&>(c).rub(surface, v[0], v[1], s.spins[c.first], s.spins[c.second]);
  }

  template <class F>
  PLIANT_INLINE static void add(const Touch& c, const SurfaceTouch<2>::Rub& rubs, Real normal, F& force) {
    const auto [x, y] = c.force(normal, rubs.hold.pull);
    force.add(c.first, Vec<2>(x, y));
    force.add(c.second, Vec<2>(-x, -y));
    force.add_torque(c.first, rubs.hold.pull * c.a);
    force.add_torque(c.second, rubs.hold.pull * c.b);
  }
};

/// The elastic and the frictional forces of pairs of disks, or of spheres, in one pass.
struct DiskKernel {
  static constexpr bool fast() { return true; }
  static constexpr bool writes_history = true;
  template <int D, class Friction>
  static void add_forces(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f,
                         const PairContact<D>& contact, const Friction& friction) {
    if (!friction.enabled(s)) return TermLoops<D, PairContact<D>>::add_forces(contact, s, nullptr, chunk, f);
    const PairList& list = s.neighbours.point_pairs;
    Real* const torques = torques_in(s, f);
    const auto add = [&](Range range, auto scatter) {
      if (range.size() == 0) return;
      if (workspace != nullptr)
        return friction.add_forces(s, range, s.history->of(friction.name()), workspace->of(friction.name()), scatter,
                                   true);
      for_each_touch(friction, s, workspace, range, scatter,
                     [&](const auto& c) PLIANT_INLINE_LAMBDA { friction.add_total(s, c, scatter); });
    };
    add(list.inside(chunk), Scatter<D, 1>{f, {}, torques});
    add(list.across(chunk), Scatter<D, 1, true>{f, s.neighbours.points(chunk), torques});
  }
};

}  // namespace pliant
