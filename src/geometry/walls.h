// Walls: straight segments and disks in the plane, fixed; in 3D the same outlines are the meridian of walls of
// revolution about z. And solids, which droplets meet.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/geometry/box_tree.h>
#include <pliant/geometry/solid.h>

namespace pliant {

/// Wall from `origin` along the unit vector `direction`, `length` long (may be infinite), and all that is within
/// `radius` of it: a disk where the length is 0. In 3D its coordinates are (ρ, z).
struct WallSegment {
  Vec<2> origin, direction;
  Real length;
  Real radius = 0;
  Real weight = 1;  ///< of its contacts; −1 where they are counted out again

  static WallSegment between(const Vec<2>& a, const Vec<2>& b) { return {a, (b - a).normalized(), (b - a).norm()}; }
  static WallSegment ray(const Vec<2>& a, const Vec<2>& direction) {
    return {a, direction, std::numeric_limits<Real>::infinity()};
  }
  static WallSegment disk(const Vec<2>& centre, Real radius) { return {centre, {1, 0}, 0, radius}; }

  Vec<2> end() const { return length > 0 ? Vec<2>(origin + length * direction) : origin; }
};

/// A free end, or a sharp corner, that points into the flow and can enter an edge between two vertices; in 3D there are
/// none.
struct Lip {
  Vec<2> place;
  Index wall;  ///< that ends there
};

/// Where two segments of an outline meet and count as one wall.
struct Joint {
  Vec<2> place;
  Index wall;  ///< one of the two
};

/// What walls are made of, as they are put together.
struct WallParts {
  std::vector<WallSegment> segments;
  std::vector<Lip> lips = {};
  std::vector<Joint> joints = {};

  /// The number of the next segment.
  Index next() const { return static_cast<Index>(segments.size()); }
};

/// The walls of a run: segments, which are numbered first, then solids. Each segment counts separately in an interior
/// corner, and its ends are round corners: the distance is to the closed segment, so that a particle turns round the
/// lip of an orifice smoothly. Outlines have joints: what touches both segments there counts once, V(segment) +
/// V(segment) − V(joint), so that forces do not depend on how finely an outline is divided. What points meet, segments
/// and joints, are the parts of the walls; segments come first.
template <int D>
class Walls {
  static_assert(D == 2 || D == 3);

 public:
  Walls() = default;
  explicit Walls(std::vector<WallSegment> segments, std::vector<Lip> lips = {})
      : Walls(WallParts{std::move(segments), std::move(lips)}) {}
  explicit Walls(WallParts walls)
      : parts_(std::move(walls.segments)), segments_(static_cast<Index>(parts_.size())), lips_(std::move(walls.lips)) {
    if (D == 3) lips_.clear();
    for (const Joint& joint : walls.joints) {
      parts_.push_back({.origin = joint.place, .direction = {1, 0}, .length = 0, .weight = -1});
      joined_.push_back(joint.wall);
    }
    plain_ =
        std::all_of(parts_.begin(), parts_.end(), [](const WallSegment& s) { return s.radius == 0 && s.weight == 1; });
    std::vector<Box2> boxes;
    for (const WallSegment& s : parts_) boxes.push_back(box_of(s));
    part_tree_ = BoxTree(boxes);
    boxes.clear();
    for (const Lip& lip : lips_) boxes.push_back({lip.place, lip.place});
    lip_tree_ = BoxTree(boxes);
  }
  explicit Walls(std::vector<Solid<D>> solids) : solids_(std::move(solids)) {}

  /// All walls: segments and solids.
  Index size() const { return segments_ + static_cast<Index>(solids_.size()); }
  std::span<const WallSegment> segments() const { return {parts_.data(), static_cast<std::size_t>(segments_)}; }
  const std::vector<WallSegment>& parts() const { return parts_; }
  const std::vector<Lip>& lips() const { return lips_; }
  const std::vector<Solid<D>>& solids() const { return solids_; }
  /// Numbers of walls.
  Index wall_of_part(Index s) const { return s < segments_ ? s : joined_[s - segments_]; }
  Index wall_of_solid(Index k) const { return segments_ + k; }
  /// Whether all parts are segments without radius: no disks, no joints.
  bool plain() const { return plain_; }

  /// Parts nearer to r than `radius`, in ascending order. Returns how many distances it took.
  std::int64_t find_near(const Vec<D>& r, Real radius, std::vector<Index>& near) const {
    near.clear();
    std::int64_t tests = 0;
    tests += part_tree_.for_each_near(meridian(r), radius * (1 + 1e-12), [&](Index s) {
      ++tests;
      if (distance(r, s) < radius) near.push_back(s);
    });
    if (!part_tree_.ordered()) std::sort(near.begin(), near.end());
    return tests;
  }
  /// The same for lips.
  std::int64_t find_near_lips(const Vec<2>& r, Real radius, std::vector<Index>& near) const requires(D == 2) {
    near.clear();
    std::int64_t tests = 0;
    tests += lip_tree_.for_each_near(r, radius * (1 + 1e-12), [&](Index l) {
      ++tests;
      if ((lips_[l].place - r).norm() < radius) near.push_back(l);
    });
    if (!lip_tree_.ordered()) std::sort(near.begin(), near.end());
    return tests;
  }

  /// Distance of r from part s, negative within its radius.
  Real distance(const Vec<D>& r, Index s) const { return offset(meridian(r), parts_[s]).norm() - parts_[s].radius; }

  /// Distance with direction: what a force needs.
  void nearest(const Vec<D>& r, Index s, Real& d, Vec<D>& n) const {
    const Vec<2> p = meridian(r);
    const Vec<2> q = offset(p, parts_[s]);
    d = q.norm();
    n = lift(r, p, direction<2>(q, d));
    d -= parts_[s].radius;
  }

  /// Distance with both derivatives.
  WallFoot<D> foot(const Vec<D>& r, Index s) const {
    const Vec<2> p = meridian(r);
    const WallSegment& wall = parts_[s];
    const Vec<2> q = offset(p, wall);
    WallFoot<D> result;
    const Real d = q.norm();
    result.d = d - wall.radius;
    const Vec<2> n = direction<2>(q, d);
    result.n = lift(r, p, n);
    const Real along = (p - wall.origin).dot(wall.direction);
    const bool end = along <= 0 || along >= wall.length;
    const Mat<2> flat = end ? distance_curvature<2>(n, d) : Mat<2>(Mat<2>::Zero());
    if constexpr (D == 2) {
      result.curvature = flat;
    } else {
      // Meridian part, and the azimuthal curvature n_ρ/ρ of a surface of revolution.
      const Vec<3> e_rho = p[0] > 0 ? Vec<3>(r[0] / p[0], r[1] / p[0], 0) : Vec<3>(Vec<3>::Zero());
      const Vec<3> e_z(0, 0, 1), e_phi(-e_rho[1], e_rho[0], 0);
      result.curvature = flat(0, 0) * e_rho * e_rho.transpose() + flat(1, 1) * e_z * e_z.transpose() +
                         flat(0, 1) * (e_rho * e_z.transpose() + e_z * e_rho.transpose());
      if (p[0] > 0)
        result.curvature += n[0] / p[0] * e_phi * e_phi.transpose();
      else if (wall.length == 0 && q[0] == 0)  // a sphere on the axis, seen from there
        result.curvature += flat(0, 0) * (Mat<3>::Identity() - e_z * e_z.transpose());
    }
    return result;
  }

 private:
  static Vec<2> meridian(const Vec<D>& r) {
    if constexpr (D == 2)
      return r;
    else
      return {std::sqrt(square(r[0]) + square(r[1])), r[2]};
  }

  static Vec<2> offset(const Vec<2>& p, const WallSegment& wall) {
    const Vec<2> w = p - wall.origin;
    return w - std::clamp(w.dot(wall.direction), Real(0), wall.length) * wall.direction;
  }

  /// Meridian vector to space; on the axis the radial direction does not exist and its part vanishes by symmetry.
  static Vec<D> lift(const Vec<D>& r, const Vec<2>& p, const Vec<2>& n) {
    if constexpr (D == 2)
      return n;
    else
      return p[0] > 0 ? Vec<3>(n[0] * r[0] / p[0], n[0] * r[1] / p[0], n[1]) : Vec<3>(0, 0, n[1]);
  }

  static Box2 box_of(const WallSegment& s) {
    const Vec<2> end = s.length < std::numeric_limits<Real>::infinity() ? s.end() : far_end(s);
    const Vec<2> radius = Vec<2>::Constant(s.radius);
    return {s.origin.cwiseMin(end) - radius, s.origin.cwiseMax(end) + radius};
  }
  /// Infinite along each axis that the direction is not perpendicular to.
  static Vec<2> far_end(const WallSegment& s) {
    Vec<2> end = s.origin;
    for (int k = 0; k < 2; ++k)
      if (s.direction[k] != 0) end[k] = std::copysign(s.length, s.direction[k]);
    return end;
  }

  std::vector<WallSegment> parts_;
  Index segments_ = 0;
  std::vector<Index> joined_;  ///< wall of each joint
  bool plain_ = true;
  std::vector<Lip> lips_;
  std::vector<Solid<D>> solids_;
  BoxTree part_tree_, lip_tree_;
};

}  // namespace pliant
