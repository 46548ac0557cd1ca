// Friction and damping between spheres and walls, fixed or moving: DiskWallContact in space.
#pragma once

#include <array>
#include <span>

#include <pliant/model/four_at_walls.h>
#include <pliant/model/sphere_slip.h>
#include <pliant/model/surface_friction.h>
#include <pliant/model/wall_contact.h>

namespace pliant {

/// A sphere that touches a wall, or several such spheres. All vectors are relative to the wall.
template <class R>
struct SphereWallTouch : SurfaceTouch<3, R> {
  using Vector = Vector3<R>;

  R radius;
  Vector n;
  Matrix3<R> stretch;  ///< L
  Vector before;       ///< ξ at the end of the last step, turned with the contact

  /// Place of the contact. share: part of the elastic force.
  struct Place {
    R d, radius, mass, share;
    Vector n, foot;
    Matrix3<R> stretch;
  };
  /// Current history of the contact; zeros without contact.
  struct Past {
    Vector foot, n, spring;
    MaskOf<R> slid;
  };
  /// turned: rotation of the sphere in the step, relative to the wall.
  PLIANT_INLINE void settle(ContactLaw law, Real epsilon, const SurfaceFriction& surface, const Place& c,
                            const Past& past, const Vector& turned) {
    radius = c.radius, n = c.n, stretch = c.stretch;
    const Press<R> press = press_of(law, epsilon, c.radius, c.d);
    this->elastic = c.share * press.force;
    this->stiffen(surface, R(c.mass * press.stiffness), press.reference);
    this->slid = past.slid;
    const MaskOf<R> known = (past.n.x != 0) | (past.n.y != 0) | (past.n.z != 0);
    const Vector none{}, rotation = select<R>(known, turned, none);
    // A new contact has not moved.
    const SphereSlip<R> slip(select<R>(known, past.n, n), n, rotation);
    const Vector slid_by = slip.along(c.foot - past.foot) + radius * (slip.arc() - slip.across(rotation));
    before = slip.carry(past.spring);
    this->stretched = select<R>(known, before + slip.carry_on(slid_by), none);
    const Vector longer = stretch * this->stretched;
    const R size2 = dot(this->stretched, this->stretched), longer2 = dot(longer, longer);
    const MaskOf<R> some = longer2 > 0;
    const R root = square_root(R(size2 * longer2)), per = 1 / (some ? longer2 : 1 + R());
    this->per_lever = some ? root * per : 1 + R();
  }
  /// Relative to the wall the sphere moves with v and rotates with `spin`.
  template <class Mu>
  PLIANT_INLINE typename SurfaceTouch<3, R>::Rub rub(Real tangential_damping, Mu mu_static, Mu mu_dynamic,
                                                     const Vector& v, const Vector& spin) const {
    const R parting = dot(n, v);
    return SurfaceTouch<3, R>::rub(tangential_damping, mu_static, mu_dynamic, parting,
                                   stretch * (v - parting * n) - radius * cross(spin, n));
  }
  PLIANT_INLINE Vector force(R normal, const Vector& pull) const { return normal * n - stretch * pull; }
  PLIANT_INLINE Vector torque(const Vector& pull) const { return radius * cross(n, pull); }
};

/// Friction and damping between a sphere and a surface of the walls (Walls::surface_of_part), besides the force N_e =
/// −V' of WallContact, in space; as SphereContact, with the velocity of the wall's material. n is the unit vector from
/// the wall to the centre, d the distance, L = 1 + (R − d) κ with the curvature κ of the surfaces of constant distance.
///
/// The sphere slides with q̇ = L u − R ω × n, where u is its velocity across n, both relative to the wall. SphereSlip
/// computes the slip from the path of the foot along the surface and the rotations of n and of the sphere. The force is
/// N n − L P, the torque R n × P, with |P| up to μN over the stretch of L along the spring. Spins of rotating walls are
/// taken at the end of a step, to first order. Contact history, relative to the wall: foot, n and the turn of the
/// sphere at the end of the last step, ξ and whether the contact slid. Elements: neighbour list of points and parts of
/// the walls.
struct SphereWallContact {
  Real epsilon = 0;
  SurfaceFriction surface = {};
  OtherMaterials others = {};
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::walls;
  static constexpr bool rotates = true;
  static constexpr int history = 13;
  static constexpr auto losses = SurfaceTouch<3>::losses;
  static std::string_view name() { return "sphere_wall_contact"; }
  void read(ParameterReader& p) {
    epsilon = read_wall_energy(p);
    const Coulomb mu = read_wall_friction(p);
    surface = read_surface(p, law, mu);
    others = read_materials(p, mu);
  }
  bool enabled(const StateView<3>& s) const {
    return s.walls.size() > 0 && (others.roughest(surface).rubs() || surface.damping > 0);
  }
  void check(const Walls<3>& walls) const { others.check(name(), walls); }

  /// In groups of four numbers, so that four contacts can be read together.
  struct Touch : SphereWallTouch<Real> {
    using Four = std::array<Real, 4>;
    Four size;                      ///< d, R, mass and share
    Four across, foot;              ///< n and foot, with the coefficients of friction μ_s and μ_d
    Four angle;                     ///< turn of the sphere relative to the wall, in space
    Four wall_velocity, wall_spin;  ///< in space
    std::array<Four, 3> rows;       ///< of L
    std::array<Four, 3> turn;       ///< rows of the rotation of the wall; not set where all walls rest
    bool turned;                    ///< false: the rotation is the identity
    Index i;

    /// Transforms a vector in space to the frame of the wall, and back.
    Vector3<Real> seen(const Vector3<Real>& a) const { return turned ? rotation().transposed_times(a) : a; }
    Vector3<Real> unseen(const Vector3<Real>& a) const { return turned ? rotation() * a : a; }
    Matrix3<Real> rotation() const { return {vector3(turn[0]), vector3(turn[1]), vector3(turn[2])}; }
  };

  /// The first part of find(): whether the sphere touches.
  PLIANT_INLINE bool place(const StateView<3>& s, Index e, Touch& c) const {
    const auto [i, part] = s.neighbours.walls[e];
    const Vec<3> r = s.position(i);
    const Real R = s.topology.diameter[i] / 2;
    WallTouch<3> wall;
    if (!s.walls.touch(r, part, s.t, R, wall)) return false;
    c.i = i;
    c.size = {wall.d, R, s.topology.mass(i), wall.share};
    const Index body = s.walls.body_of_part(part);
    const Coulomb mu = others.of(s.walls.material(body), surface);
    c.across = {wall.across[0], wall.across[1], wall.across[2], mu.mu_static};
    c.foot = {wall.foot[0], wall.foot[1], wall.foot[2], mu.mu_dynamic};
    c.angle = four(s.angle(i));
    c.wall_velocity = c.wall_spin = {};
    c.turned = false;
    Mat<3> curvature = wall.curvature;
    if (!s.walls.rest()) {
      const Motion<3>& motion = s.walls.motion(body);
      c.angle = four(s.angle(i) - motion.spin * (s.t - motion.since));
      c.wall_velocity = four(s.walls.velocity(r, part, s.t));
      c.wall_spin = four(motion.spin);
      const Pose<3> pose = s.walls.pose(body, s.t);
      c.turned = pose.turned;
      for (int k = 0; k < 3; ++k) c.turn[k] = four(pose.turn.row(k));  // of each, because four are turned together
      if (c.turned) curvature = pose.turn.transpose() * curvature * pose.turn;
    }
    const Real farther = R - wall.d;
    for (int k = 0; k < 3; ++k) {
      c.rows[k] = {farther * curvature(k, 0), farther * curvature(k, 1), farther * curvature(k, 2), 0};
      c.rows[k][k] += 1;
    }
    return true;
  }
  /// Also false if another part of the surface carries the contact.
  bool find(const StateView<3>& s, Index e, std::span<const Real> past, Touch& c) const {
    if (!place(s, e, c)) return false;
    const Real* const p = past.data();
    using Past = typename SphereWallTouch<Real>::Past;
    c.settle(law, epsilon, surface,
             {c.size[0],
              c.size[1],
              c.size[2],
              c.size[3],
              vector3(c.across),
              vector3(c.foot),
              {vector3(c.rows[0]), vector3(c.rows[1]), vector3(c.rows[2])}},
             past.empty() ? Past{} : Past{vector3(p, 0), vector3(p, 1), vector3(p, 3), p[12] != 0},
             past.empty() ? Vector3<Real>{} : c.seen(vector3(c.angle) - vector3(p, 2)));
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
  void add_forces(const StateView<3>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<3, 1>& force) const {
    add_forces(s, range, table, workspace, force, false, [](Index) {});
  }
  /// See add_wall_forces().
  template <class Untouched>
  void add_forces(const StateView<3>& s, Range range, const ContactTable& table, ContactWorkspace& workspace,
                  const Scatter<3, 1>& force, bool total, Untouched&& untouched) const {
    add_wall_forces(*this, s, range, table, workspace, force, total, untouched);
  }
  // See add_wall_forces().
  Index find_near(const StateView<3>& s, Range range, Index* near) const;
  void settle_four(FourAtWalls<3, SphereWallContact>& four, const StateView<3>& s,
                   const ContactWorkspace::Next<history, true>& next, const Scatter<3, 1>& force, bool total) const;
  /// Returns false if a wall moves, or if one of the elements does not touch, or touches a solid or near the axis of
  /// the walls.
  bool settle_at_rest(const StateView<3>& s, const Index* near, Index count,
                      const ContactTable::Current<history>& current, const ContactWorkspace::Next<history, true>& next,
                      const Scatter<3, 1>& force, bool total, std::array<Real, losses.size()>& lost) const;
  /// Force of the wall on the sphere, without the elastic force; the wall feels the opposite.
  Vec<3> force(const StateView<3>& s, const Touch& c) const {
    const auto rubs = rub(s, c);
    return force_of(c, rubs, rubs.normal - c.elastic);
  }

  /// ω² = k_t (1/m + R²/I) = 7/2 k_t/m.
  Real max_rate(const Topology& topology) const {
    return spring_rate(law, others.roughest(surface), topology, epsilon, 0.5, 3.5);
  }
  /// Walls on both sides: across the normals, where the elastic force is not, the rotation is stiffer than the motion.
  MotionRates crowded(const Topology& topology) const {
    return surface_rates(law, others.roughest(surface), topology, epsilon, 0.5, {2, 0, 5, 1});
  }
  Real max_damping(const Topology& topology) const { return dashpot_rate(law, surface, topology, epsilon, 0.5, 2, 1); }

 private:
  /// The components, and 0.
  template <class V>
  PLIANT_INLINE static typename Touch::Four four(const V& a) {
    return {a[0], a[1], a[2], 0};
  }
  typename SurfaceTouch<3>::Rub rub(const StateView<3>& s, const Touch& c) const {
    return static_cast<const SphereWallTouch<Real>&>(c).rub(surface.tangential_damping, c.across[3], c.foot[3],
                                                            c.seen(vector3(s.v, c.i) - vector3(c.wall_velocity)),
                                                            c.seen(vector3(s.spins, c.i) - vector3(c.wall_spin)));
  }
  static Vec<3> force_of(const Touch& c, const typename SurfaceTouch<3>::Rub& rubs, Real normal) {
    return vec(c.unseen(static_cast<const SphereWallTouch<Real>&>(c).force(normal, rubs.hold.pull)));
  }
  template <class F>
  static void add(const Touch& c, const typename SurfaceTouch<3>::Rub& rubs, Real normal, F& force) {
    force.add(c.i, force_of(c, rubs, normal));
    force.add_torque(c.i, vec(c.unseen(c.torque(rubs.hold.pull))));
  }
};

}  // namespace pliant
