// Walls: straight segments in the plane, fixed; in 3D the same segments are the meridian of a wall of revolution about
// z. And solids, which droplets meet.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/geometry/solid.h>

namespace pliant {

/// Wall from `origin` along the unit vector `direction`, `length` long (may be infinite). In 3D its coordinates are (ρ,
/// z).
struct WallSegment {
  Vec<2> origin, direction;
  Real length;

  static WallSegment between(const Vec<2>& a, const Vec<2>& b) { return {a, (b - a).normalized(), (b - a).norm()}; }
  static WallSegment ray(const Vec<2>& a, const Vec<2>& direction) {
    return {a, direction, std::numeric_limits<Real>::infinity()};
  }
};

/// The walls of a run: segments, which are numbered first, then solids. Each segment counts separately in an interior
/// corner, and its ends are round corners: the distance is to the closed segment, so that a particle turns round the
/// lip of an orifice smoothly.
template <int D>
class Walls {
  static_assert(D == 2 || D == 3);

 public:
  Walls() = default;
  /// lips: free ends that point into the flow and can enter an edge between two vertices (2D).
  explicit Walls(std::vector<WallSegment> segments, std::vector<Vec<2>> lips = {})
      : segments_(std::move(segments)), lips_(std::move(lips)) {}
  explicit Walls(std::vector<Solid<D>> solids) : solids_(std::move(solids)) {}

  /// Segments.
  Index size() const { return static_cast<Index>(segments_.size()); }
  const std::vector<WallSegment>& segments() const { return segments_; }
  const std::vector<Vec<2>>& lips() const { return lips_; }
  const std::vector<Solid<D>>& solids() const { return solids_; }
  /// The wall that ends in lip l.
  Index wall_of_lip(Index l) const {
    Index s = 0;
    while (s < size() && segments_[s].origin != lips_[l]) ++s;
    return s;
  }

  /// Distance of r to wall s.
  Real distance(const Vec<D>& r, Index s) const { return offset(meridian(r), segments_[s]).norm(); }

  /// Distance with direction: what a force needs.
  void nearest(const Vec<D>& r, Index s, Real& d, Vec<D>& n) const {
    const Vec<2> p = meridian(r);
    const Vec<2> q = offset(p, segments_[s]);
    d = q.norm();
    n = lift(r, p, direction<2>(q, d));
  }

  /// Distance with both derivatives.
  WallFoot<D> foot(const Vec<D>& r, Index s) const {
    const Vec<2> p = meridian(r);
    const WallSegment& wall = segments_[s];
    const Vec<2> q = offset(p, wall);
    WallFoot<D> result;
    result.d = q.norm();
    const Vec<2> n = direction<2>(q, result.d);
    result.n = lift(r, p, n);
    const Real along = (p - wall.origin).dot(wall.direction);
    const bool end = along <= 0 || along >= wall.length;
    const Mat<2> flat = end ? distance_curvature<2>(n, result.d) : Mat<2>(Mat<2>::Zero());
    if constexpr (D == 2) {
      result.curvature = flat;
    } else {
      // Meridian part, and the azimuthal curvature n_ρ/ρ of a surface of revolution.
      const Vec<3> e_rho = p[0] > 0 ? Vec<3>(r[0] / p[0], r[1] / p[0], 0) : Vec<3>(Vec<3>::Zero());
      const Vec<3> e_z(0, 0, 1), e_phi(-e_rho[1], e_rho[0], 0);
      result.curvature = flat(0, 0) * e_rho * e_rho.transpose() + flat(1, 1) * e_z * e_z.transpose() +
                         flat(0, 1) * (e_rho * e_z.transpose() + e_z * e_rho.transpose());
      if (p[0] > 0) result.curvature += n[0] / p[0] * e_phi * e_phi.transpose();
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

  std::vector<WallSegment> segments_;
  std::vector<Vec<2>> lips_;
  std::vector<Solid<D>> solids_;
};

}  // namespace pliant
