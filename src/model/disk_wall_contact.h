// Friction and damping between disks and walls, fixed or moving.
#pragma once

#include <array>
#include <span>
#include <utility>

#include <pliant/geometry/turn.h>
#include <pliant/model/four_at_walls.h>
#include <pliant/model/fused_terms.h>
#include <pliant/model/surface_friction.h>
#include <pliant/model/wall_contact.h>

namespace pliant {

/// A disk that touches a wall, or several such disks. All data except n and velocities are relative to the wall.
template <class R>
struct DiskWallTouch : SurfaceTouch<2, R> {
  /// Where it is.
  struct Place {
    R d, curvature, radius, mass;
    R foot0, foot1, across0, across1;  ///< foot and n
    R angle;                           ///< θ
  };
  /// And its current history; zeros if it did not touch.
  struct Past {
    R foot0, foot1, across0, across1, angle, spring;
    MaskOf<R> slid;
  };
  /// `lever` is 1 + (R − d) κ.
  PLIANT_INLINE void settle(ContactLaw law, Real epsilon, const SurfaceFriction& surface, const Place& c,
                            const Past& past) {
    this->lever = 1 + (c.radius - c.d) * c.curvature;
    const Press<R> press = press_of(law, epsilon, c.radius, c.d);
    this->elastic = press.force;
    this->stiffen(surface, R(c.mass * press.stiffness), press.reference);
    this->slid = past.slid;
    const R sine = past.across0 * c.across1 - past.across1 * c.across0,
            cosine = past.across0 * c.across0 + past.across1 * c.across1;
    // Along the surface halfway between n before and now.
    const R x = past.across0 + c.across0, y = past.across1 + c.across1, size = square_root(R(x * x + y * y)),
            way = (x * (c.foot1 - past.foot1) - y * (c.foot0 - past.foot0)) / size, slipped = size > 0 ? way : R();
    const MaskOf<R> known = (past.across0 != 0) | (past.across1 != 0);
    const R spring = past.spring + slipped + c.radius * (turn_of(sine, cosine) - (c.angle - past.angle));
    this->stretched = known ? spring : R();
  }
  /// Seen from the wall the disk moves with v and turns with `spin`. The pull is along t, n turned by 90°.
  template <class Mu>
  PLIANT_INLINE typename SurfaceTouch<2, R>::Rub rub(Real tangential_damping, Mu mu_static, Mu mu_dynamic, R n0, R n1,
                                                     R v0, R v1, R radius, R spin) const {
    return SurfaceTouch<2, R>::rub(tangential_damping, mu_static, mu_dynamic, R(n0 * v0 + n1 * v1),
                                   R(this->lever * (n0 * v1 - n1 * v0) - radius * spin));
  }
  PLIANT_INLINE std::pair<R, R> force(R n0, R n1, R normal, R pull) const {
    const R across = pull * this->lever;
    return {normal * n0 + across * n1, normal * n1 - across * n0};
  }
};

/// Friction and damping between a disk and a surface of the walls (Walls::surface_of_part), besides the force N_e = −V'
/// of WallContact, in the plane; as DiskContact, with the velocity of the wall's material. n is the unit vector from
/// the wall to the centre, t = n turned by 90°, d the distance, κ the curvature of the lines of constant distance
/// there.
///
/// N = max(N_e − γ_n u_n, 0). Seen from the wall, q = (way of the foot along the surface) + R φ − R θ grows as the disk
/// slides, φ the direction of n: t·r − Rθ along a straight wall, (R + ρ) φ − R θ round a corner of radius ρ. The spring
/// is ξ = q − q₀, P = k_t ξ + γ_t q̇ up to μN/(1 + (R − d) κ). The force on the disk is N n − P (1 + (R − d) κ) t, the
/// torque P R. The contact continues around convex corners. At an inner corner there are two contacts. Contact history,
/// relative to the wall: foot, n and θ at the end of the last step, ξ and whether the contact slid.
/// Elements: neighbour list of points and parts of the walls.
struct DiskWallContact {
  Real epsilon = 0;
  SurfaceFriction surface = {};
  OtherMaterials others = {};
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 7;
  static constexpr auto losses = SurfaceTouch<2>::losses;
  static std::string_view name() { return "disk_wall_contact"; }
  void read(ParameterReader& p) {
    epsilon = read_wall_energy(p);
    const Coulomb mu = read_wall_friction(p);
    surface = read_surface(p, law, mu);
    others = read_materials(p, mu);
  }
  bool enabled(const StateView<2>& s) const {
    return s.walls.size() > 0 && (others.roughest(surface).rubs() || surface.damping > 0);
  }
  void check(const Walls<2>& walls) const { others.check(name(), walls); }

  /// In groups of four numbers, so that four contacts can be read together in the layout of the history.
  struct Touch : DiskWallTouch<Real> {
    Real d, curvature, radius, mass;
    std::array<Real, 2> foot, across;  ///< foot and n seen from the wall
    std::array<Real, 2> n, velocity;   ///< n in space, and how the wall moves
    Real angle, spin;                  ///< θ seen from the wall; of the wall
    Real mu_static, mu_dynamic;
    Index i;
  };

  /// The first part of find(): whether the disk touches.
  PLIANT_INLINE bool place(const StateView<2>& s, Index e, Touch& c) const {
    const auto [i, part] = s.neighbours.walls[e];
    const Vec<2> r = s.position(i);
    const Real R = s.topology.diameter[i] / 2;
    WallTouch<2> wall;
    if (!s.walls.touch(r, part, s.t, R, wall)) return false;
    c.i = i;
    c.d = wall.d, c.curvature = wall.curvature, c.radius = R, c.mass = s.topology.mass(i);
    c.foot = {wall.foot[0], wall.foot[1]};
    c.across = {wall.across[0], wall.across[1]};
    c.n = {wall.n[0], wall.n[1]};
    const Vec<2> v = s.walls.velocity(r, part, s.t);
    c.velocity = {v[0], v[1]};
    const Index body = s.walls.body_of_part(part);
    const Motion<2>& motion = s.walls.motion(body);
    c.angle = s.angle(i) - motion.spin * (s.t - motion.since);
    c.spin = motion.spin;
    const Coulomb mu = others.of(s.walls.material(body), surface);
    c.mu_static = mu.mu_static, c.mu_dynamic = mu.mu_dynamic;
    return true;
  }
  /// False also where another part of the surface carries the contact.
  PLIANT_INLINE bool find(const StateView<2>& s, Index e, std::span<const Real> past, Touch& c) const {
    if (!place(s, e, c)) return false;
    using Past = DiskWallTouch<Real>::Past;
    c.settle(law, epsilon, surface,
             {c.d, c.curvature, c.radius, c.mass, c.foot[0], c.foot[1], c.across[0], c.across[1], c.angle},
             past.empty() ? Past{} : Past{past[0], past[1], past[2], past[3], past[4], past[5], past[6] != 0});
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
  void add_forces(const StateView<2>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<2, 1>& force) const {
    add_forces(s, range, table, workspace, force, false, [](Index) {});
  }
  /// total: with the elastic forces. untouched(e): for elements that do not touch.
  template <class Untouched>
  void add_forces(const StateView<2>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<2, 1>& force, bool total, Untouched&& untouched) const {
    add_wall_forces(*this, s, range, table, workspace, force, total, untouched);
  }
  /// See add_wall_forces().
  void settle_four(FourAtWalls<2, DiskWallContact>& four, const StateView<2>& s,
                   const ContactWorkspace::Next<history, true>& next, const Scatter<2, 1>& force, bool total) const;
  /// Force of the wall on the disk, without the elastic force; the wall feels the opposite.
  Vec<2> force(const StateView<2>& s, const Touch& c) const {
    const SurfaceTouch<2>::Rub rubs = rub(s, c);
    return force_of(c, rubs, rubs.normal - c.elastic);
  }

  /// ω² = k_t (1/m + R²/I) = 3 k_t/m.
  Real max_rate(const Topology& topology) const {
    return spring_rate(law, others.roughest(surface), topology, epsilon, 0.5, 3);
  }
  /// Walls on both sides: across the normals, where the elastic force is not, the rotation is stiffer than the motion.
  MotionRates crowded(const Topology& topology) const {
    return surface_rates(law, others.roughest(surface), topology, epsilon, 0.5, {2, 0, 4, 1});
  }
  Real max_damping(const Topology& topology) const { return dashpot_rate(law, surface, topology, epsilon, 0.5, 2, 1); }

 private:
  PLIANT_INLINE SurfaceTouch<2>::Rub rub(const StateView<2>& s, const Touch& c) const {
    const Vec<2> v = s.velocity(c.i);
    return static_cast<const DiskWallTouch<Real>&>(c).rub(surface.tangential_damping, c.mu_static, c.mu_dynamic, c.n[0],
                                                          c.n[1], v[0] - c.velocity[0], v[1] - c.velocity[1], c.radius,
                                                          s.spin(c.i) - c.spin);
  }
  PLIANT_INLINE static Vec<2> force_of(const Touch& c, const SurfaceTouch<2>::Rub& rubs, Real normal) {
    const auto [x, y] = c.force(c.n[0], c.n[1], normal, rubs.hold.pull);
    return {x, y};
  }
  template <class F>
  PLIANT_INLINE static void add(const Touch& c, const SurfaceTouch<2>::Rub& rubs, Real normal, F& force) {
    force.add(c.i, force_of(c, rubs, normal));
    force.add_torque(c.i, rubs.hold.pull * c.radius);
  }
};

/// All forces of walls on disks, or spheres, in one pass.
struct DiskWallKernel {
  static constexpr bool fast() { return true; }
  static constexpr bool writes_history = true;
  template <int D, class Friction>
  static void add_forces(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f,
                         const WallContact<D>& contact, const Friction& friction) {
    if (!friction.enabled(s)) return WallKernel::add_forces(s, chunk, f, contact);
    Scatter<D, 1> force{f, {}, torques_in(s, f)};
    Scatter<D, -1> gradient{f};
    // Parts of an outline that touch without carrying the contact press all the same.
    const auto others = [&](Index e) {
      if (!s.walls.plain()) press(contact, s, e, gradient);
    };
    const Range range = s.neighbours.walls.inside(chunk);
    if (workspace != nullptr) return add_steps(s, range, *workspace, force, friction, others);
    for_each_touch(
        friction, s, workspace, range, force,
        [&](const auto& c) PLIANT_INLINE_LAMBDA { friction.add_total(s, c, force); }, others);
  }

 private:
  /// Not compiled into all the places of add_steps that call it.
  template <int D>
  [[gnu::noinline]] static void press(const WallContact<D>& contact, const StateView<D>& s, Index e,
                                      Scatter<D, -1>& gradient) {
    contact.add_gradient(s, e, gradient);
  }
  /// In a step: the forces that count for speed.
  template <int D, class Friction, class Others>
  [[gnu::flatten]] static void add_steps(const StateView<D>& s, Range range, HistoryWorkspace& workspace,
                                         const Scatter<D, 1>& force, const Friction& friction, const Others& others) {
    friction.add_forces(s, range, s.history->of(friction.name()), workspace.of(friction.name()), force, true, others);
  }
};

}  // namespace pliant
