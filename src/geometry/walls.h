// Walls: straight segments and disks in the plane, in 3D figures of revolution with these as their meridian; and
// solids. They rest, or move as rigid bodies.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/base/multiversion.h>
#include <pliant/geometry/box_tree.h>
#include <pliant/geometry/circle.h>
#include <pliant/geometry/motion.h>
#include <pliant/geometry/revolution.h>
#include <pliant/geometry/solid.h>

namespace pliant {

/// Wall from `origin` along the unit vector `direction`, `length` long (may be infinite), and the region within
/// `radius` of it: a disk if the length is 0. In 3D its coordinates are (ρ, z).
struct WallSegment {
  Vec<2> origin, direction;
  Real length;
  Real radius = 0;
  Real weight = 1;  ///< weight of its contacts; −1 for joints, whose contacts are subtracted

  static WallSegment between(const Vec<2>& a, const Vec<2>& b) { return {a, (b - a).normalized(), (b - a).norm()}; }
  static WallSegment ray(const Vec<2>& a, const Vec<2>& direction) {
    return {a, direction, std::numeric_limits<Real>::infinity()};
  }
  static WallSegment disk(const Vec<2>& centre, Real radius) { return {centre, {1, 0}, 0, radius}; }

  MeridianSegment<Real> meridian() const { return {origin[0], origin[1], direction[0], direction[1], length}; }
  bool sphere_on_axis() const { return length == 0 && origin[0] == 0; }
  Vec<2> end() const { return length > 0 ? Vec<2>(origin + length * direction) : origin; }
};

/// In 3D the distance ρ from the axis as walls see it: ρ from `axis_width` on, and nearer to the axis
/// w (3 + 6 s² − s⁴)/8 with s = ρ/w. A sphere that touches a surface of revolution on its axis touches a full ring,
/// where the distance to the nearest point has a kink: the lateral force would jump from one side to the other. The
/// rounded distance is even and C², so that the force of the ring passes through 0. Not for spheres on the axis, which
/// have no kink.
constexpr Real axis_width = 0.05;  ///< w, in σ_avg
struct RoundedRadius {
  Real value, slope_over_rho, curvature;  ///< derivatives with respect to ρ; the slope over ρ, because the slope is 0
                                          ///< on the axis

  explicit RoundedRadius(Real rho) {
    constexpr Real w = axis_width;
    const Real s2 = (rho / w) * (rho / w);
    value = w * (3 + s2 * (6 - s2)) / 8;
    slope_over_rho = (3 - s2) / (2 * w);
    curvature = 3 * (1 - s2) / (2 * w);
  }
};

/// A free end, or a sharp corner, that points into the flow and can enter an edge, or in 3D a face, between its
/// vertices; in 3D it is a circle about the axis.
struct Lip {
  Vec<2> place;  ///< in 3D (ρ, z), ρ > 0
  Index wall;    ///< the wall that ends at the lip
};

/// Where two segments of an outline meet and count as one wall.
struct Joint {
  Vec<2> place;
  Index wall, before;  ///< the segments that begin and end at the joint
  bool convex;  ///< seen from where particles are, a straight one included: then both segments are of one surface
};

/// The segments of walls under construction.
struct WallParts {
  std::vector<WallSegment> segments;
  std::vector<Lip> lips = {};
  std::vector<Joint> joints = {};

  /// The number of the next segment.
  Index next() const { return static_cast<Index>(segments.size()); }
};

/// Place of a contact with a part of the walls: distance, unit vector from the wall and curvature of the lines, or
/// surfaces, of constant distance, in space; and the position in the frame of the part's body.
template <int D>
struct WallTouch {
  Real d;
  Vec<D> n;
  std::conditional_t<D == 2, Real, Mat<D>> curvature;  ///< in the plane a number: along the line
  Vec<D> foot, across;                                 ///< the place, and n, seen from the body
  Real share = 1;  ///< share of V' that acts along n: less than 1 near the axis of revolution, where the contact is a
                   ///< ring
};

/// The walls of a run, numbered in the order in which they are added: segments, which have two sides and no inside, and
/// solids, which push out points that have entered. Points touch the parts of the walls: segments, then joints, then
/// solids. The ends of segments are round corners: the distance is to the closed segment, so that a particle turns
/// round the lip of an orifice smoothly.
///
/// Segments count separately, except where a joint connects them: a contact there counts once, V(segment) + V(segment)
/// − V(joint), so that forces do not depend on how finely an outline is divided.
///
/// Each add() call creates one rigid body with its motion and a material, 0, 1, …, that terms may use.
/// A body of segments has boxes in its own frame, which find the segments near a point. In 3D this frame has the axis
/// of revolution.
template <int D>
class Walls {
  static_assert(D == 2 || D == 3);

 public:
  Walls() = default;
  explicit Walls(std::vector<WallSegment> segments, std::vector<Lip> lips = {})
      : Walls(WallParts{std::move(segments), std::move(lips)}) {}
  explicit Walls(const WallParts& walls) { add(walls); }
  explicit Walls(const std::vector<Solid<D>>& solids) {
    for (const Solid<D>& solid : solids) add(solid);
  }

  /// Adds walls that move together, and returns the number of their body. The walls are given in the frame of the body,
  /// whose place at motion.since is `pose`; without `pose`, in the laboratory frame at that time.
  Index add(const WallParts& walls, const Motion<D>& motion = {}, const Pose<D>& pose = {}, Index material = 0);
  Index add(const Solid<D>& solid, const Motion<D>& motion = {}, const Pose<D>& pose = {}, Index material = 0);
  /// From motion.since on a body moves so, from where it is at that time.
  void set_motion(Index body, const Motion<D>& motion);

  Index size() const { return static_cast<Index>(wall_body_.size()); }
  Index bodies() const { return static_cast<Index>(bodies_.size()); }
  Index body_of_wall(Index wall) const { return wall_body_[wall]; }
  Index body_of_part(Index part) const { return part_body_[part]; }
  const Motion<D>& motion(Index body) const { return bodies_[body].motion; }
  Pose<D> pose(Index body, Real t) const { return bodies_[body].at(t); }
  /// Finds where all bodies are at time t. Optional: queries for this time then cost less.
  void prepare(Real t) {
    if (still_) return;
    for (Body& body : bodies_)
      if (body.placed.t != t) body.placed = {t, body.at(t), body.motion.drift(t)};
  }
  Index material(Index body) const { return bodies_[body].material; }
  /// Whether any wall moves.
  bool move() const {
    return std::any_of(bodies_.begin(), bodies_.end(), [](const Body& b) { return !b.motion.rests(); });
  }

  /// In the frames of their bodies, as are solids and lips.
  std::span<const WallSegment> segments() const { return {parts_.data(), static_cast<std::size_t>(segments_)}; }
  /// Segments and joints.
  const std::vector<WallSegment>& parts() const { return parts_; }
  const std::vector<Solid<D>>& solids() const { return solids_; }
  const std::vector<Lip>& lips() const { return lips_; }
  WallSegment segment(Index s, Real t) const requires(D == 2) {
    const Pose<2> pose = pose_of(s, t);
    WallSegment placed = parts_[s];
    placed.origin = pose.place(placed.origin);
    placed.direction = pose.direction(placed.direction);
    return placed;
  }
  Vec<2> lip(Index l, Real t) const requires(D == 2) {
    return still_ ? lips_[l].place : bodies_[wall_body_[lips_[l].wall]].at(t).place(lips_[l].place);
  }

  /// In 3D: the circle, and the frame in which it is.
  Circle lip_circle(Index l) const requires(D == 3) { return {lips_[l].place[0], lips_[l].place[1]}; }
  Pose<3> lip_pose(Index l, Real t) const requires(D == 3) {
    return still_ ? Pose<3>() : bodies_[wall_body_[lips_[l].wall]].at(t);
  }
  /// The place of a lip that is nearest to the segment from a to b.
  Vec<3> lip(Index l, const Vec<3>& a, const Vec<3>& b, Real t) const requires(D == 3) {
    const Pose<3> pose = lip_pose(l, t);
    const Vec<3> start = pose.back(a), end = pose.back(b);
    const Circle circle = lip_circle(l);
    return pose.place(circle.nearest(start + nearest_to_circle(circle, start, end) * (end - start)));
  }

  /// Number of parts.
  Index part_count() const { return static_cast<Index>(parts_.size() + solids_.size()); }
  Index wall_of_part(Index part) const { return part_wall_[part]; }
  /// A contact keeps its history while it moves along a surface: a solid, or segments that are joined without
  /// concave corners.
  Index surface_of_part(Index part) const { return wall_surface_[part_wall_[part]]; }
  Index surfaces() const { return surfaces_; }
  /// With which the energy of a contact with a part counts: −1 for a joint.
  Real weight(Index part) const { return is_solid(part) ? 1 : parts_[part].weight; }
  /// The solid that a part is, at time t; none for segments and joints.
  std::optional<Solid<D>> solid(Index part, Real t) const {
    if (!is_solid(part)) return std::nullopt;
    const Solid<D>& s = solid_of(part);
    return still_ ? s : s.at(pose_of(part, t));
  }
  /// Whether all walls rest in the laboratory frame.
  bool rest() const { return still_; }
  /// Whether all walls are segments at rest, for which there are kernels.
  bool resting_segments() const { return still_ && solids_.empty(); }
  /// Whether all parts but solids are segments without radius: no disks, no joints.
  bool plain() const { return plain_; }

  /// Parts nearer to r than `radius` at time t, in ascending order. Returns how many distances it took.
  std::int64_t find_near(const Vec<D>& r, Real radius, Real t, std::vector<Index>& near) const {
    near.clear();
    std::int64_t tests = 0;
    bool ordered = bodies_.size() <= 1;
    for (const Body& body : bodies_) {
      if (body.parts.empty()) continue;
      const Vec<2> p = meridian(still_ ? r : body.at(t).back(r));
      const Real farther = near_axis(p) ? RoundedRadius(0).value : 0;
      tests += body.part_tree.for_each_near(p, (radius + farther) * (1 + 1e-12), [&](Index k) {
        ++tests;
        if (distance_in(p, body.parts[k]) < radius) near.push_back(body.parts[k]);
      });
      ordered = ordered && body.part_tree.ordered();
    }
    if (!ordered) std::sort(near.begin(), near.end());
    for (auto part = static_cast<Index>(parts_.size()); part < part_count(); ++part) {
      ++tests;
      if (distance(r, part, t) < radius) near.push_back(part);
    }
    return tests;
  }
  /// The same for lips.
  std::int64_t find_near_lips(const Vec<2>& r, Real radius, Real t, std::vector<Index>& near) const requires(D == 2) {
    near.clear();
    std::int64_t tests = 0;
    bool ordered = bodies_.size() <= 1;
    for (const Body& body : bodies_) {
      if (body.lips.empty()) continue;
      const Vec<2> p = still_ ? r : body.at(t).back(r);
      tests += body.lip_tree.for_each_near(p, radius * (1 + 1e-12), [&](Index k) {
        ++tests;
        if ((lips_[body.lips[k]].place - p).norm() < radius) near.push_back(body.lips[k]);
      });
      ordered = ordered && body.lip_tree.ordered();
    }
    if (!ordered) std::sort(near.begin(), near.end());
    return tests;
  }

  /// Distance of r from a part at time t, negative inside a solid and within the radius of a segment.
  Real distance(const Vec<D>& r, Index part, Real t) const {
    if (is_solid(part)) return foot(r, part, t).d;
    return distance_in(meridian(in_body(r, part, t)), part);
  }

  /// Whether r is for sure not nearer than `reach` to a part at time t. Costs little; always false for a solid.
  PLIANT_INLINE bool beyond(const Vec<D>& r, Real reach, Index part, Real t) const {
    if (is_solid(part)) return false;
    const WallSegment& wall = parts_[part];
    const Vec<2> q = offset(seen(meridian(in_body(r, part, t)), wall), wall);
    return dot(q, q) > square(reach + wall.radius) * (1 + 1e-12);
  }

  /// Distance with its gradient, for forces. n is zero on a segment without radius; a unit vector elsewhere,
  /// but near the axis of revolution.
  void nearest(const Vec<D>& r, Index part, Real t, Real& d, Vec<D>& n) const;

  /// The contact with a part at time t of a point at r that is nearer than the contact distance `reach`. Returns false
  /// if there is no contact, for a point on a segment without radius, and if another part of the surface carries the
  /// contact.
  PLIANT_INLINE bool touch(const Vec<D>& r, Index part, Real t, Real reach, WallTouch<D>& c) const {
    if (is_solid(part)) {
      const Pose<D> pose = pose_of(part, t);
      const WallFoot<D> foot = (still_ ? solid_of(part) : solid_of(part).at(pose)).foot(r);
      if (foot.d >= reach || foot.n == Vec<D>::Zero()) return false;
      c.d = foot.d, c.n = foot.n;
      if constexpr (D == 2)
        c.curvature = foot.curvature.trace();
      else
        c.curvature = foot.curvature;
      c.foot = pose.back(Vec<D>(r - c.d * c.n)), c.across = pose.back(Vec<D>(c.n + pose.shift));
      return true;
    }
    const Vec<D> b = in_body(r, part, t);
    if constexpr (D == 2) {
      const WallSegment& wall = parts_[part];
      const Vec<2> w = b - wall.origin;
      const Real along = dot(w, wall.direction);
      const Vec<2> q = w - std::clamp(along, Real(0), wall.length) * wall.direction;
      const Real d2 = dot(q, q);
      if (d2 > square(reach + wall.radius) * (1 + 1e-12)) return false;
      const Real d = std::sqrt(d2);
      c.d = d - wall.radius;
      if (d == 0 || c.d >= reach || !carries_in(b, part)) return false;
      const bool end = along <= 0 || along >= wall.length;
      c.across = q / d;
      c.curvature = end ? 1 / d : 0;
    } else {
      const WallFoot<D> foot = foot_in(b, part);
      const Vec<2> p = meridian(b);
      if (foot.d >= reach || foot.n == Vec<D>::Zero() || !carries_in(p, part)) return false;
      c.d = foot.d, c.across = foot.n, c.share = 1;
      Mat<D> curvature = foot.curvature;
      if (rounds(p, parts_[part])) {
        c.share = foot.n.norm();
        c.across /= c.share;
        curvature = (curvature - c.across * (c.across.transpose() * curvature)).eval() / c.share;
      }
      c.curvature = still_ ? curvature : pose_of(part, t).matrix(curvature);
    }
    c.foot = b - c.d * c.across;
    c.n = still_ ? c.across : body_of(part).direction(c.across, t);
    return true;
  }

  /// Distance with both derivatives.
  WallFoot<D> foot(const Vec<D>& r, Index part, Real t) const {
    if (is_solid(part)) return (still_ ? solid_of(part) : solid_of(part).at(pose_of(part, t))).foot(r);
    if (still_) return foot_in(r, part);
    const Pose<D> pose = pose_of(part, t);
    const WallFoot<D> foot = foot_in(pose.back(r), part);
    return {foot.d, pose.direction(foot.n), pose.matrix(foot.curvature)};
  }

  /// Velocity at time t of a material point at r that moves with a part.
  PLIANT_INLINE Vec<D> velocity(const Vec<D>& r, Index part, Real t) const {
    if (still_) return Vec<D>::Zero();
    const Body& body = body_of(part);
    return t == body.placed.t && !body.motion.turns() ? body.placed.drift : body.motion.velocity_at(r, t);
  }

  /// Whether a contact at r belongs to this part of a surface: to the part with the foot, or, if two parts meet at the
  /// foot, to the part that begins there. For terms that count contacts rather than energies, such as friction.
  bool carries(const Vec<D>& r, Index part, Real t) const {
    return is_solid(part) || carries_in(meridian(in_body(r, part, t)), part);
  }

  /// Upper bound of the motion, between two times, of all parts of the walls that particles can reach. farthest(p): the
  /// largest distance of a particle from p.
  template <class Farthest>
  Real moved(Real from, Real t, Farthest&& farthest) const {
    Real most = 0;
    for (const Body& body : bodies_) {
      const Motion<D>& m = body.motion;
      if (m.rests()) continue;
      if (!m.turns()) {
        most = std::max(most, (body.at(t).place(body.anchor) - body.at(from).place(body.anchor)).norm());
        continue;
      }
      const Real lever = std::isfinite(body.lever) ? body.lever : farthest(Vec<D>(m.pivot + m.shift(t)));
      most = std::max(most, (m.shift(t) - m.shift(from)).norm() + m.rate() * std::abs(t - from) * lever);
    }
    return most;
  }
  /// Upper bound of the speed of all these parts at any time. farthest: as for moved(), at time t.
  template <class Farthest>
  Real fastest(Real t, Farthest&& farthest) const {
    Real most = 0;
    for (const Body& body : bodies_) {
      const Motion<D>& m = body.motion;
      Real speed = m.velocity.norm() + std::abs(m.frequency) * m.amplitude.norm();
      if (m.turns())
        speed += m.rate() * (std::isfinite(body.lever) ? body.lever : farthest(Vec<D>(m.pivot + m.shift(t))));
      most = std::max(most, speed);
    }
    return most;
  }
  /// Whether moved() calls farthest().
  bool turn_without_end() const {
    return std::any_of(bodies_.begin(), bodies_.end(),
                       [](const Body& b) { return b.motion.turns() && !std::isfinite(b.lever); });
  }

 private:
  struct Body {
    Pose<D> start;  ///< at motion.since
    Motion<D> motion;
    Index material;
    std::vector<Index> parts, lips;  ///< without solids
    BoxTree part_tree, lip_tree;     ///< in its frame
    Vec<D> anchor;                   ///< a point of it
    Real lever;                      ///< largest distance of a turning point from the pivot

    /// Place at the time of the last prepare().
    struct Placed {
      Real t = std::numeric_limits<Real>::quiet_NaN();
      Pose<D> pose = {};
      Vec<D> drift = Vec<D>::Zero();
    } placed = {};

    PLIANT_INLINE Pose<D> at(Real t) const {
      if (t == placed.t) return placed.pose;
      return motion.rests() ? start : motion.pose(start, t);
    }
    /// at(t).back(r) and at(t).direction(a), with the same rounding.
    PLIANT_INLINE Vec<D> back(const Vec<D>& r, Real t) const {
      if (t == placed.t) return placed.pose.back(r);
      if (motion.turns() || start.turned) return at(t).back(r);
      return r - (motion.rests() ? start.shift : Vec<D>(start.shift + motion.shift(t)));
    }
    PLIANT_INLINE Vec<D> direction(const Vec<D>& a, Real t) const {
      if (t == placed.t) return placed.pose.direction(a);
      return motion.turns() || start.turned ? at(t).direction(a) : a;
    }
  };

  bool is_solid(Index part) const { return part >= first_solid_; }
  const Solid<D>& solid_of(Index part) const { return solids_[part - first_solid_]; }
  const Body& body_of(Index part) const { return bodies_[part_body_[part]]; }
  PLIANT_INLINE Pose<D> pose_of(Index part, Real t) const { return still_ ? Pose<D>() : body_of(part).at(t); }
  PLIANT_INLINE Vec<D> in_body(const Vec<D>& r, Index part, Real t) const {
    return still_ ? r : body_of(part).back(r, t);
  }
  void place(Body& body);
  /// The same for a segment or joint, p in the frame of the body.
  PLIANT_INLINE bool carries_in(const Vec<2>& p, Index part) const {
    return part < segments_ && ((before_[part] < 0 && after_[part] < 0) || has_foot(seen(p, parts_[part]), part));
  }
  /// For a segment that is joined to others.
  bool has_foot(const Vec<2>& p, Index part) const;

  Real distance_in(const Vec<2>& p, Index part) const {
    return offset(seen(p, parts_[part]), parts_[part]).norm() - parts_[part].radius;
  }

  /// In the frame of the body.
  PLIANT_INLINE WallFoot<D> foot_in(const Vec<D>& r, Index part) const {
    const WallSegment& wall = parts_[part];
    const Vec<2> on_meridian = meridian(r), p = seen(on_meridian, wall);
    const MeridianDistance<Real> at(p[0], p[1], wall.meridian());
    const Vec<2> n(at.n_rho, at.n_z);
    WallFoot<D> result;
    result.d = at.d - wall.radius;
    result.n = lift(r, on_meridian, n, wall);
    if constexpr (D == 2) {
      result.curvature << at.rho_rho, at.rho_z, at.rho_z, at.z_z;
    } else {
      const Real rho = on_meridian[0];
      const Vec<2> e_rho = rho > 0 ? Vec<2>(r[0] / rho, r[1] / rho) : Vec<2>(1, 0);
      Real across = rho > 0 ? n[0] / rho : at.rho_rho, in = at.rho_rho, slope = 1;  // ρ = 0: a sphere on the axis
      if (rounds(on_meridian, wall)) {
        const RoundedRadius rounded(rho);
        slope = rounded.slope_over_rho * rho;
        in = at.rho_rho * square(slope) + n[0] * rounded.curvature;
        across = n[0] * rounded.slope_over_rho;
      }
      const Matrix3<Real> a = revolved(e_rho[0], e_rho[1], in, at.rho_z * slope, at.z_z, across);
      result.curvature << a.x.x, a.x.y, a.x.z, a.y.x, a.y.y, a.y.z, a.z.x, a.z.y, a.z.z;
    }
    return result;
  }

  PLIANT_INLINE static Vec<2> meridian(const Vec<D>& r) {
    if constexpr (D == 2)
      return r;
    else
      return {std::sqrt(square(r[0]) + square(r[1])), r[2]};
  }

  PLIANT_INLINE static Real dot(const Vec<2>& a, const Vec<2>& b) { return a[0] * b[0] + a[1] * b[1]; }
  PLIANT_INLINE static Vec<2> offset(const Vec<2>& p, const WallSegment& wall) {
    const Vec<2> w = p - wall.origin;
    return w - std::clamp(dot(w, wall.direction), Real(0), wall.length) * wall.direction;
  }

  PLIANT_INLINE static bool near_axis(const Vec<2>& p) { return D == 3 && p[0] < axis_width; }
  PLIANT_INLINE static bool rounds(const Vec<2>& p, const WallSegment& wall) {
    return near_axis(p) && !wall.sphere_on_axis();
  }
  /// p of the meridian as a part sees it.
  PLIANT_INLINE static Vec<2> seen(const Vec<2>& p, const WallSegment& wall) {
    return rounds(p, wall) ? Vec<2>(RoundedRadius(p[0]).value, p[1]) : p;
  }

  /// Turns the gradient in the meridian, as the wall sees it, into a gradient in space. p: meridian coordinates of r.
  /// On the axis the radial part vanishes by symmetry.
  PLIANT_INLINE static Vec<D> lift(const Vec<D>& r, const Vec<2>& p, const Vec<2>& n, const WallSegment& wall) {
    if constexpr (D == 2) {
      return n;
    } else if (rounds(p, wall)) {
      const Real radial = n[0] * RoundedRadius(p[0]).slope_over_rho;
      return Vec<3>(radial * r[0], radial * r[1], n[1]);
    } else
      return p[0] > 0 ? Vec<3>(n[0] * r[0] / p[0], n[0] * r[1] / p[0], n[1]) : Vec<3>(0, 0, n[1]);
  }

  std::vector<WallSegment> parts_;  ///< segments and joints
  Index segments_ = 0, first_solid_ = 0;
  std::vector<Solid<D>> solids_;
  std::vector<Lip> lips_;
  std::vector<Index> part_wall_, part_body_, wall_body_, wall_surface_;
  Index surfaces_ = 0;
  /// Per segment: the preceding segment, which ends at its begin, and the following one, which begins at its end; or
  /// −1.
  std::vector<Index> before_, after_;
  std::vector<Body> bodies_;
  bool plain_ = true;
  bool still_ = true;  ///< all bodies rest, and their frames are the laboratory frame
};

}  // namespace pliant
