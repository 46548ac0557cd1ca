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
  static constexpr auto losses = SurfaceTouch::losses;
  static std::string_view name() { return "disk_contact"; }
  bool enabled(const StateView<2>&) const { return surface.rubs() || surface.damping > 0; }

  Real energy(const StateView<2>& s, Index e, std::span<const Real> past) const {
    Touch c;
    return look(s, e, past, c) ? c.energy() : 0;
  }
  Real power(const StateView<2>& s, Index e, std::span<const Real> past) const {
    Touch c;
    return look(s, e, past, c) ? c.power() : 0;
  }
  template <class F>
  void add_force(const StateView<2>& s, Index e, std::span<const Real> past, F& force) const {
    Touch c;
    if (look(s, e, past, c)) add(c, c.normal - c.elastic, force);
  }
  /// With the elastic force: for a kernel that computes both.
  template <class F>
  void add_total(const StateView<2>& s, Index e, std::span<const Real> past, F& force) const {
    Touch c;
    if (look(s, e, past, c)) add(c, c.normal, force);
  }
  bool advance(const StateView<2>& s, Index e, Real h, bool known, std::span<Real> numbers,
               std::span<Real> heat) const {
    Touch c;
    if (!look(s, e, known ? numbers : std::span<Real>(), c)) return false;
    c.add_heat(h, known, numbers[3], heat);
    numbers[0] = c.n[0];
    numbers[1] = c.n[1];
    numbers[2] = c.turned;
    numbers[3] = c.hold.spring;
    numbers[4] = c.hold.slides ? 1 : 0;
    return true;
  }
  /// The spring between two of the stiffest disks: ω² = k_t (2/m + 2R²/I) = 6 k_t/m.
  Real max_rate(const Topology& topology) const {
    return std::sqrt((surface.rubs() ? 6 * surface.stiffness : 0) *
                     stiffest(topology, [](const Law& law) { return reference_stiffness(law); }));
  }
  /// Six contacts, half of them along any direction; each damps with 4 ζ √(V''/(2m)), m of one of two like disks.
  Real max_damping(const Topology& topology) const {
    return 3 * 4 * surface.damping *
           std::sqrt(
               stiffest(topology, [](const Law& law) { return Law::stiffness * law.epsilon / Law::scale(law.delta); }) /
               2);
  }

 private:
  struct Touch : SurfaceTouch {
    Index i, j;
    Vec<2> n;
    Real a, b, per_lever;  ///< radii; (R_i + R_j)/d
    Real turned;           ///< R_i θ_i + R_j θ_j
  };

  /// False where they don't touch. Each particle is one point: their numbers are the same.
  PLIANT_INLINE bool look(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const Pair& pair = s.neighbours.point_pairs[e];
    const Topology& topology = s.topology;
    const Index first = pair.first, second = pair.second;
    const Vec<2> r = s.position(first) - s.position(second);
    const Real d2 = r.squaredNorm(), reach = (topology.diameter[first] + topology.diameter[second]) / 2;
    if (d2 >= square(reach) || d2 == 0) return false;
    const bool turn = topology.id[first] > topology.id[second];
    const Index i = turn ? second : first, j = turn ? first : second;
    c.i = i, c.j = j;
    c.a = topology.diameter[i] / 2, c.b = topology.diameter[j] / 2;
    const Real d = std::sqrt(d2), per_d = 1 / d;
    c.n = (turn ? -per_d : per_d) * r;
    c.per_lever = reach * per_d;
    const Vec<2> v = s.velocity(i) - s.velocity(j), t(-c.n[1], c.n[0]);
    c.parting = c.n.dot(v);
    c.rate = c.per_lever * t.dot(v) - (c.a * s.spins[i] + c.b * s.spins[j]);
    c.turned = c.a * s.angles[i] + c.b * s.angles[j];
    const Press press = press_of(Law{epsilon, reach}, d);
    c.elastic = press.force;
    const Real masses = topology.inverse_point_mass[i] + topology.inverse_point_mass[j];
    const bool known = !past.empty(), slid = known && past[4] != 0;
    c.stretched = known ? past[3] + reach * turn_between({past[0], past[1]}, c.n) - (c.turned - past[2]) : 0;
    c.rub(surface, press.stiffness / masses, press.reference, c.per_lever, slid);
    return true;
  }

  template <class F>
  PLIANT_INLINE static void add(const Touch& c, Real normal, F& force) {
    const Vec<2> t(-c.n[1], c.n[0]), f = normal * c.n - c.hold.pull * c.per_lever * t;
    force.add(c.i, f);
    force.add(c.j, Vec<2>(-f));
    force.add_torque(c.i, c.hold.pull * c.a);
    force.add_torque(c.j, c.hold.pull * c.b);
  }

  /// The largest stiffness(law)/m of two like disks.
  template <class Stiffness>
  Real stiffest(const Topology& topology, Stiffness&& stiffness) const {
    return 1 / smallest_over_points(topology, [&](Index i) {
             return topology.mass(i) / stiffness(Law{epsilon, topology.diameter[i]});
           });
  }
};

/// Both forces of pairs of disks in one pass.
struct DiskKernel {
  static constexpr bool fast() { return true; }
  template <class Law>
  static void add_forces(const StateView<2>& s, Index chunk, Real* f, const PairContact<2, Law>& contact,
                         const DiskContact<Law>& friction) {
    const PairList& list = s.neighbours.point_pairs;
    Real* const torques = f + static_cast<std::size_t>(s.topology.owned_points()) * 2;
    const Range inside = list.inside(chunk), across = list.across(chunk), own = s.neighbours.points(chunk);
    if (!friction.enabled(s)) {
      Scatter<2, -1> here{f};
      Scatter<2, -1, true> there{f, own};
      for (Index e = inside.first; e < inside.last; ++e) contact.add_gradient(s, e, here);
      for (Index e = across.first; e < across.last; ++e) contact.add_gradient(s, e, there);
      return;
    }
    const ContactTable* const table = s.history != nullptr ? &s.history->of(friction.name()) : nullptr;
    const auto add = [&](Range range, auto scatter) {
      for (Index e = range.first; e < range.last; ++e)
        friction.add_total(s, e, table != nullptr ? table->past(e) : std::span<const Real>(), scatter);
    };
    add(inside, Scatter<2, 1>{f, {}, torques});
    add(across, Scatter<2, 1, true>{f, own, torques});
  }
};

}  // namespace pliant
