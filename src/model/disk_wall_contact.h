// Friction and damping between disks and walls, fixed or moving.
#pragma once

#include <span>

#include <pliant/geometry/turn.h>
#include <pliant/model/surface_friction.h>
#include <pliant/model/wall_contact.h>

namespace pliant {

/// What acts between a disk and a surface of the walls (Walls::surface_of_part) beside the elastic force N_e = −V' of
/// WallContact, in the plane; as DiskContact, with the velocity of the wall's material. n is the unit vector from the
/// wall to the centre, t = n turned by 90°, d the distance, κ the curvature of the lines of constant distance there.
///
/// N = max(N_e − γ_n u_n, 0). Seen from the wall, q = (way of the foot along the surface) + R φ − R θ grows as the disk
/// slides, φ the direction of n: t·r − Rθ along a straight wall, (R + ρ) φ − R θ round a corner of radius ρ. The spring
/// is ξ = q − q₀, P = k_t ξ + γ_t q̇ up to μN/(1 + (R − d) κ). The force on the disk is N n − P (1 + (R − d) κ) t, the
/// torque P R. Round convex corners it stays one contact. At an inner corner there are two.
/// Kept, seen from the wall: foot, n and θ at the end of the last step, ξ and whether the contact slid.
/// Elements: neighbour list of points and parts of the walls.
template <class Law = HarmonicOverlap>
struct DiskWallContact {
  Real epsilon;
  SurfaceFriction surface;

  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 7;
  static constexpr auto losses = SurfaceTouch::losses;
  static std::string_view name() { return "disk_wall_contact"; }
  bool enabled(const StateView<2>& s) const { return s.walls.size() > 0 && (surface.rubs() || surface.damping > 0); }

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
    if (!look(s, e, past, c)) return;
    force.add(c.i, c.force());
    force.add_torque(c.i, c.hold.pull * c.radius);
  }
  bool advance(const StateView<2>& s, Index e, Real h, bool known, std::span<Real> numbers,
               std::span<Real> heat) const {
    Touch c;
    if (!look(s, e, known ? numbers : std::span<Real>(), c)) return false;
    c.add_heat(h, known, numbers[5], heat);
    numbers[0] = c.foot[0], numbers[1] = c.foot[1];
    numbers[2] = c.across[0], numbers[3] = c.across[1];
    numbers[4] = c.angle;
    numbers[5] = c.hold.spring;
    numbers[6] = c.hold.slides ? 1 : 0;
    return true;
  }
  /// Of the wall on the disk, beside the elastic one; the wall feels the opposite.
  Vec<2> force(const StateView<2>& s, Index e, std::span<const Real> past) const {
    Touch c;
    return look(s, e, past, c) ? c.force() : Vec<2>(Vec<2>::Zero());
  }

  /// ω² = k_t (1/m + R²/I) = 3 k_t/m.
  Real max_rate(const Topology& topology) const {
    return std::sqrt((surface.rubs() ? 3 * surface.stiffness : 0) *
                     stiffest(topology, [](const Law& law) { return reference_stiffness(law); }));
  }
  Real max_damping(const Topology& topology) const {
    return 2 * surface.damping * std::sqrt(stiffest(topology, [](const Law& law) {
             return Law::stiffness * law.epsilon / Law::scale(law.delta);
           }));
  }

 private:
  struct Touch : SurfaceTouch {
    Index i;
    Real radius, lever;      ///< 1 + (R − d) κ
    Vec<2> n, foot, across;  ///< n in space; foot and n seen from the wall
    Real angle;              ///< θ seen from the wall

    Vec<2> force() const { return (normal - elastic) * n - hold.pull * lever * Vec<2>(-n[1], n[0]); }
  };

  /// False where they don't touch, and where another part of the surface carries the contact.
  bool look(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const auto [i, part] = s.neighbours.walls[e];
    const Vec<2> r = s.position(i);
    const Real R = s.topology.diameter[i] / 2;
    Real d;
    s.walls.nearest(r, part, s.t, d, c.n);
    if (d >= R || c.n == Vec<2>::Zero() || !s.walls.carries(r, part, s.t)) return false;
    const Law law{epsilon, R};
    c.i = i;
    c.radius = R;
    const Vec<2> t(-c.n[1], c.n[0]);
    c.lever = 1 + (R - d) * t.dot(s.walls.foot(r, part, s.t).curvature * t);
    const Index body = s.walls.body_of_wall(s.walls.wall_of_part(part));
    const Pose<2> pose = s.walls.pose(body, s.t);
    c.foot = pose.back(Vec<2>(r - d * c.n));
    c.across = pose.back(Vec<2>(c.n + pose.shift));
    const Motion<2>& motion = s.walls.motion(body);
    c.angle = s.angle(i) - motion.spin * (s.t - motion.since);
    const Vec<2> v = s.velocity(i) - s.walls.velocity(r, part, s.t);
    c.parting = c.n.dot(v);
    c.rate = c.lever * t.dot(v) - R * (s.spin(i) - motion.spin);
    const Press press = press_of(law, d);
    c.elastic = press.force;
    c.stretched = 0;
    bool slid = false;
    if (!past.empty()) {
      const Vec<2> before(past[2], past[3]), middle = before + c.across;
      const Real turned = turn_between(before, c.across);
      const Vec<2> along = Vec<2>(-middle[1], middle[0]).normalized();
      c.stretched = past[5] + along.dot(c.foot - Vec<2>(past[0], past[1])) + R * (turned - (c.angle - past[4]));
      slid = past[6] != 0;
    }
    c.rub(surface, s.topology.mass(i) * press.stiffness, press.reference, c.lever, slid);
    return true;
  }

  /// The largest stiffness(law)/m.
  template <class Stiffness>
  Real stiffest(const Topology& topology, Stiffness&& stiffness) const {
    return 1 / smallest_over_points(topology, [&](Index i) {
             return topology.mass(i) / stiffness(Law{epsilon, topology.diameter[i] / 2});
           });
  }
};

}  // namespace pliant
