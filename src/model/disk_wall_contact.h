// Friction and damping between disks and walls, fixed or moving.
#pragma once

#include <array>
#include <span>

#include <pliant/geometry/turn.h>
#include <pliant/model/fused_terms.h>
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
  OtherMaterials others = {};

  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 7;
  static constexpr auto losses = SurfaceTouch<2>::losses;
  static std::string_view name() { return "disk_wall_contact"; }
  bool enabled(const StateView<2>& s) const {
    return s.walls.size() > 0 && (others.roughest(surface).rubs() || surface.damping > 0);
  }
  void check(const Walls<2>& walls) const { others.check(name(), walls); }

  struct Touch : SurfaceTouch<2> {
    Index i, material;
    Real radius;                       ///< `lever` is 1 + (R − d) κ
    std::array<Real, 2> n;             ///< in space
    std::array<Real, 2> foot, across;  ///< foot and n seen from the wall
    Real angle;                        ///< θ seen from the wall
    std::array<Real, 2> velocity;      ///< of the wall
    Real spin;                         ///< of the wall
  };

  PLIANT_INLINE bool near(const StateView<2>& s, Index e) const {
    const auto [i, part] = s.neighbours.walls[e];
    return !s.walls.beyond(s.position(i), s.topology.diameter[i] / 2, part, s.t);
  }
  /// False also where another part of the surface carries the contact.
  PLIANT_INLINE bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    const auto [i, part] = s.neighbours.walls[e];
    const Vec<2> r = s.position(i);
    const Real R = s.topology.diameter[i] / 2;
    WallTouch<2> wall;
    if (!s.walls.touch(r, part, s.t, R, wall)) return false;
    const auto& [d, n, curvature, foot, across] = wall;
    c.i = i;
    c.radius = R;
    c.n = {n[0], n[1]};
    c.lever = 1 + (R - d) * curvature;
    c.foot = {foot[0], foot[1]};
    c.across = {across[0], across[1]};
    const Index body = s.walls.body_of_part(part);
    const Motion<2>& motion = s.walls.motion(body);
    c.material = s.walls.material(body);
    c.angle = s.angle(i) - motion.spin * (s.t - motion.since);
    c.spin = motion.spin;
    const Vec<2> v = s.walls.velocity(r, part, s.t);
    c.velocity = {v[0], v[1]};
    const Press<Real> press = press_of<Law>(epsilon, R, d);
    c.elastic = press.force;
    c.stiffen(surface, s.topology.mass(i) * press.stiffness, press.reference);
    c.stretched = 0;
    c.slid = false;
    if (!past.empty()) {
      const Vec<2> before(past[2], past[3]), middle = before + across, way = foot - Vec<2>(past[0], past[1]);
      const Real turned = turn_between(before, across), size = std::sqrt(middle[0] * middle[0] + middle[1] * middle[1]),
                 slid = size > 0 ? (middle[0] * way[1] - middle[1] * way[0]) / size : 0;
      c.stretched = past[5] + slid + R * (turned - (c.angle - past[4]));
      c.slid = past[6] != 0;
    }
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
  void advance(const StateView<2>& s, const Touch& c, Real h, bool known, std::span<Real> numbers,
               std::span<Real> heat) const {
    const SurfaceTouch<2>::Rub rubs = rub(s, c);
    c.add_heat(rubs, h, known, numbers[5], heat);
    numbers[0] = c.foot[0], numbers[1] = c.foot[1];
    numbers[2] = c.across[0], numbers[3] = c.across[1];
    numbers[4] = c.angle;
    numbers[5] = rubs.hold.spring;
    numbers[6] = rubs.hold.slides ? 1 : 0;
  }
  /// Of the wall on the disk, beside the elastic one; the wall feels the opposite.
  Vec<2> force(const StateView<2>& s, const Touch& c) const {
    const SurfaceTouch<2>::Rub rubs = rub(s, c);
    return force_of(c, rubs, rubs.normal - c.elastic);
  }

  /// ω² = k_t (1/m + R²/I) = 3 k_t/m.
  Real max_rate(const Topology& topology) const {
    return spring_rate<Law>(others.roughest(surface), topology, epsilon, 0.5, 3);
  }
  Real max_damping(const Topology& topology) const { return dashpot_rate<Law>(surface, topology, epsilon, 0.5, 2, 1); }

 private:
  PLIANT_INLINE SurfaceTouch<2>::Rub rub(const StateView<2>& s, const Touch& c) const {
    const Vec<2> n(c.n[0], c.n[1]), t(-c.n[1], c.n[0]), v = s.velocity(c.i) - Vec<2>(c.velocity[0], c.velocity[1]);
    return c.rub(others.of(c.material, surface), n.dot(v), c.lever * t.dot(v) - c.radius * (s.spin(c.i) - c.spin));
  }
  PLIANT_INLINE static Vec<2> force_of(const Touch& c, const SurfaceTouch<2>::Rub& rubs, Real normal) {
    return normal * Vec<2>(c.n[0], c.n[1]) - rubs.hold.pull * c.lever * Vec<2>(-c.n[1], c.n[0]);
  }
  template <class F>
  PLIANT_INLINE static void add(const Touch& c, const SurfaceTouch<2>::Rub& rubs, Real normal, F& force) {
    force.add(c.i, force_of(c, rubs, normal));
    force.add_torque(c.i, rubs.hold.pull * c.radius);
  }
};

/// All forces of walls on disks, or balls, in one pass.
struct DiskWallKernel {
  static constexpr bool fast() { return true; }
  template <int D, class Law, class Friction>
  static void add_forces(const StateView<D>& s, Index chunk, Real* f, const WallContact<D, Law>& contact,
                         const Friction& friction) {
    if (!friction.enabled(s)) return WallKernel::add_forces(s, chunk, f, contact);
    Real* const torques = f + static_cast<std::size_t>(s.topology.owned_points()) * D;
    Scatter<D, 1> force{f, {}, torques};
    Scatter<D, -1> gradient{f};
    // Parts that touch without carrying the contact press all the same.
    for_each_touch(
        friction, s, s.neighbours.walls.inside(chunk),
        [&](const auto& c) PLIANT_INLINE_LAMBDA { friction.add_total(s, c, force); },
        [&](Index e) { contact.add_gradient(s, e, gradient); });
  }
};

}  // namespace pliant
