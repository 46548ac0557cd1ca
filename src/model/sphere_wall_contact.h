// Friction and damping between balls and walls, fixed or moving: DiskWallContact in space.
#pragma once

#include <array>
#include <span>

#include <pliant/model/sphere_slip.h>
#include <pliant/model/surface_friction.h>
#include <pliant/model/wall_contact.h>

namespace pliant {

/// What acts between a ball and a surface of the walls (Walls::surface_of_part) beside the elastic force N_e = −V' of
/// WallContact, in space; as SphereContact, with the velocity of the wall's material. n is the unit vector from the
/// wall to the centre, d the distance, L = 1 + (R − d) κ with the curvature κ of the surfaces of constant distance.
///
/// The ball slides with q̇ = L u − R ω × n, u its velocity across n, both seen from the wall: by the way of the foot
/// along the surface and what n and the ball have turned (SphereSlip). The force is N n − L P, the torque R n × P, with
/// |P| up to μN over the stretch of L along the spring. Spins of walls that turn count as at the end of a step, to
/// first order. Kept, seen from the wall: foot, n and what the ball has turned at the end of the last step, ξ and
/// whether the contact slid. Elements: neighbour list of points and parts of the walls.
template <class Law = HarmonicOverlap>
struct SphereWallContact {
  Real epsilon;
  SurfaceFriction surface;
  OtherMaterials others = {};

  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 13;
  static constexpr auto losses = SurfaceTouch<3>::losses;
  static std::string_view name() { return "sphere_wall_contact"; }
  bool enabled(const StateView<3>& s) const {
    return s.walls.size() > 0 && (others.roughest(surface).rubs() || surface.damping > 0);
  }
  void check(const Walls<3>& walls) const { others.check(name(), walls); }

  struct Touch : SurfaceTouch<3> {
    Index i, material;
    Real radius;
    Vector3<Real> n;               ///< in space
    std::array<Real, 9> stretch;   ///< L
    std::array<Real, 9> turn;      ///< of the wall
    Vector3<Real> foot, across;    ///< foot and n seen from the wall
    Vector3<Real> angle;           ///< what the ball has turned, less the wall, in space
    Vector3<Real> before;          ///< ξ at the end of the last step, turned with the contact, in space
    Vector3<Real> velocity, spin;  ///< of the wall
  };

  bool near(const StateView<3>& s, Index e) const {
    const auto [i, part] = s.neighbours.walls[e];
    return !s.walls.beyond(s.position(i), s.topology.diameter[i] / 2, part, s.t);
  }
  /// False also where another part of the surface carries the contact.
  bool find(const StateView<3>& s, Index e, std::span<const Real> past, Touch& c) const {
    const auto [i, part] = s.neighbours.walls[e];
    const Vec<3> r = s.position(i);
    const Real R = s.topology.diameter[i] / 2;
    WallTouch<3> wall;
    if (!s.walls.touch(r, part, s.t, R, wall)) return false;
    const auto& [d, n, curvature, foot, across, share] = wall;
    c.i = i;
    c.radius = R;
    c.n = vector3(n);
    const Mat<3> stretch = Mat<3>::Identity() + (R - d) * curvature;
    Eigen::Map<Mat<3>>(c.stretch.data()) = stretch;
    c.foot = vector3(foot), c.across = vector3(across);
    const Index body = s.walls.body_of_part(part);
    const Mat<3> turn = s.walls.pose(body, s.t).turn;
    Eigen::Map<Mat<3>>(c.turn.data()) = turn;
    const Motion<3>& motion = s.walls.motion(body);
    c.material = s.walls.material(body);
    const Vec<3> angle = s.angle(i) - motion.spin * (s.t - motion.since);
    c.angle = vector3(angle);
    c.velocity = vector3(s.walls.velocity(r, part, s.t));
    c.spin = vector3(motion.spin);
    const Press<Real> press = press_of<Law>(epsilon, R, d);
    c.elastic = share * press.force;
    c.stiffen(surface, s.topology.mass(i) * press.stiffness, press.reference);
    c.lever = 1;
    c.slid = false;
    c.before = c.stretched = Vector3<Real>{};
    if (!past.empty()) {
      const Real* const p = past.data();
      const Vec<3> turned = turn.transpose() * (angle - point<3>(p, 2));
      const SphereSlip<Real> slip(vector3(p, 1), c.across, vector3(turned));
      const Vector3<Real> slid = slip.along(c.foot - vector3(p, 0)) + R * (slip.arc() - slip.across(vector3(turned))),
                          before = slip.carry(vector3(p, 3));
      const Vec<3> stretched = turn * vec(before + slip.carry_on(slid));
      c.before = vector3(Vec<3>(turn * vec(before)));
      c.stretched = vector3(stretched);
      if (const Real size = stretched.norm(); size > 0) c.lever = (stretch * stretched).norm() / size;
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
  void add_total(const StateView<3>& s, const Touch& c, F& force) const {
    const auto rubs = rub(s, c);
    add(c, rubs, rubs.normal, force);
  }
  void keep(const StateView<3>& s, const Touch& c, std::span<const Real> past, Real* numbers, Real* lost) const {
    const auto rubs = rub(s, c);
    c.count_losses(rubs, !past.empty(), c.before, lost);
    point<3>(numbers, 0) = vec(c.foot);
    point<3>(numbers, 1) = vec(c.across);
    point<3>(numbers, 2) = vec(c.angle);
    point<3>(numbers, 3) = Eigen::Map<const Mat<3>>(c.turn.data()).transpose() * vec(rubs.hold.spring);
    numbers[12] = rubs.hold.slides ? 1 : 0;
  }
  /// Of the wall on the ball, beside the elastic one; the wall feels the opposite.
  Vec<3> force(const StateView<3>& s, const Touch& c) const {
    const auto rubs = rub(s, c);
    return force_of(c, rubs, rubs.normal - c.elastic);
  }

  /// ω² = k_t (1/m + R²/I) = 7/2 k_t/m.
  Real max_rate(const Topology& topology) const {
    return spring_rate<Law>(others.roughest(surface), topology, epsilon, 0.5, 3.5);
  }
  /// Walls on both sides: across the normals, where the elastic force is not, the rotation is stiffer than the motion.
  MotionRates crowded(const Topology& topology) const {
    return surface_rates<Law>(others.roughest(surface), topology, epsilon, 0.5, {2, 0, 5, 1});
  }
  Real max_damping(const Topology& topology) const { return dashpot_rate<Law>(surface, topology, epsilon, 0.5, 2, 1); }

 private:
  typename SurfaceTouch<3>::Rub rub(const StateView<3>& s, const Touch& c) const {
    const Vec<3> n = vec(c.n), v = s.velocity(c.i) - vec(c.velocity);
    const Real parting = n.dot(v);
    const Vec<3> along = Eigen::Map<const Mat<3>>(c.stretch.data()) * (v - parting * n);
    const Coulomb mu = others.of(c.material, surface);
    return c.rub(surface.tangential_damping, mu.mu_static, mu.mu_dynamic, parting,
                 vector3(Vec<3>(along - c.radius * Vec<3>(s.spin(c.i) - vec(c.spin)).cross(n))));
  }
  static Vec<3> force_of(const Touch& c, const typename SurfaceTouch<3>::Rub& rubs, Real normal) {
    return normal * vec(c.n) - Eigen::Map<const Mat<3>>(c.stretch.data()) * vec(rubs.hold.pull);
  }
  template <class F>
  static void add(const Touch& c, const typename SurfaceTouch<3>::Rub& rubs, Real normal, F& force) {
    force.add(c.i, force_of(c, rubs, normal));
    force.add_torque(c.i, Vec<3>(c.radius * vec(c.n).cross(vec(rubs.hold.pull))));
  }
};

}  // namespace pliant
