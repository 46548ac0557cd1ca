// Solid walls: half-spaces and convex wedges.
#pragma once

#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/geometry/distance.h>
#include <pliant/geometry/motion.h>

namespace pliant {

/// The region behind a plane, or behind two planes that meet in a sharp convex edge (in 2D: a tip) of infinite length.
/// In the plane that meets the edge at a right angle, with the edge as origin, `along` and `out` span the coordinates
/// (x, y); the solid lies between the directions 0 and −opening, so that x runs along the first face and y is the
/// height over it.
template <int D>
struct Solid {
  Vec<D> place;       ///< a point of the plane, or of the edge
  Vec<D> along, out;  ///< unit, perpendicular to each other
  Real opening = pi;  ///< π: a half-space

  /// The half-space behind the plane through `point`, with its normal out of the solid.
  /// Errors: InputError for a normal without direction.
  static Solid half_space(const Vec<D>& point, const Vec<D>& normal) {
    Solid s;
    s.place = point;
    s.out = unit(normal, "the normal of a wall");
    Index k = 0;
    s.out.cwiseAbs().minCoeff(&k);
    s.along = (Vec<D>::Unit(k) - s.out[k] * s.out).normalized();
    return s;
  }

  /// The wedge whose faces run from `tip` in two directions.
  /// Errors: InputError for a direction of length 0, or two directions that do not form a corner.
  static Solid wedge(const Vec<D>& tip, const Vec<D>& first, const Vec<D>& second) {
    Solid s;
    s.place = tip;
    s.along = unit(first, "the first direction of a wedge");
    const Vec<D> other = unit(second, "the second direction of a wedge");
    const Real cosine = s.along.dot(other);
    const Vec<D> across = cosine * s.along - other;
    s.opening = std::atan2(across.norm(), cosine);
    if (!(std::sin(s.opening) > 1e-6))
      throw InputError("the faces of a wedge at an angle of {} rad make no corner; use a half-space or another angle",
                       s.opening);
    s.out = across.normalized();
    return s;
  }

  bool flat() const { return opening == pi; }
  /// The solid of a body where this body is.
  Solid at(const Pose<D>& pose) const {
    return {pose.place(place), pose.direction(along), pose.direction(out), opening};
  }

  /// Coordinates (x, y) of r.
  Vec<2> plane(const Vec<D>& r) const {
    const Vec<D> w = r - place;
    return {w.dot(along), w.dot(out)};
  }
  /// The vector or matrix of space of one in these coordinates.
  Vec<D> lift(const Vec<2>& a) const { return a[0] * along + a[1] * out; }
  Mat<D> lift(const Mat<2>& a) const {
    return lift(Vec<2>(a.col(0))) * along.transpose() + lift(Vec<2>(a.col(1))) * out.transpose();
  }

  /// Direction along the second face, and its normal.
  Vec<2> second_along() const { return {std::cos(opening), -std::sin(opening)}; }
  Vec<2> second_out() const { return {-std::sin(opening), -std::cos(opening)}; }

  /// Distance of r from the solid, with its derivatives: negative inside, where it belongs to the face whose plane is
  /// nearest.
  WallFoot<D> foot(const Vec<D>& r) const {
    const Vec<2> p = plane(r);
    if (flat()) return {p[1], out, Mat<D>::Zero()};
    const Vec<2> out2 = second_out();
    const Real x2 = p.dot(second_along()), y2 = p.dot(out2);
    const bool inside = p[1] <= 0 && y2 <= 0;
    if (inside ? p[1] >= y2 : p[1] > 0 && p[0] >= 0) return {p[1], out, Mat<D>::Zero()};
    if (inside || (y2 > 0 && x2 >= 0)) return {y2, lift(out2), Mat<D>::Zero()};
    const Real d = p.norm();
    const Vec<2> n = direction<2>(p, d);
    return {d, lift(n), lift(distance_curvature<2>(n, d))};
  }

 private:
  static Vec<D> unit(const Vec<D>& a, const char* what) {
    if (!(a.norm() > 0) || !a.allFinite()) throw InputError("{} must be finite and have a direction", what);
    return a.normalized();
  }
};

}  // namespace pliant
