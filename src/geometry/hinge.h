// Areas of triangles, and angles between two triangles with a common edge, with first and second derivatives.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include <pliant/base/types.h>

namespace pliant {

/// The matrix of the cross product: skew(a) b = a × b.
inline Mat<3> skew(const Vec<3>& a) { return (Mat<3>() << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0).finished(); }

/// Area of a triangle a, b, c, and its gradient: ∂area/∂a = n̂ × (c − b)/2, and so on. Smooth while the area is not 0.
struct TriangleArea {
  TriangleArea(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

  Real area;
  std::array<Vec<3>, 3> gradient;
  /// Second derivative with respect to the vertices i and j.
  Mat<3> hessian(int i, int j) const;

 private:
  Vec<3> normal_;                   ///< n̂
  std::array<Vec<3>, 3> opposite_;  ///< edge opposite to each vertex
};

/// Angle θ between the normals of the triangles (a, b, c) and (b, a, d), positive where their edge is convex. With the
/// normals n, n' of length twice the areas, e = b − a and L = |e|,
///   ∂θ/∂c = −L n/|n|²,  ∂θ/∂d = −L n'/|n'|²,
///   ∂θ/∂a = −(1 − s) ∂θ/∂c − (1 − t) ∂θ/∂d,  ∂θ/∂b = −s ∂θ/∂c − t ∂θ/∂d,
/// s, t the places of the feet of c and d along the edge, from 0 at a to 1 at b. Smooth while both areas are not 0.
struct HingeAngle {
  HingeAngle(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d);

  Real cosine, sine;
  std::array<Vec<3>, 4> gradient;  ///< of θ, with respect to a, b, c, d
  /// Second derivatives of θ.
  std::array<std::array<Mat<3>, 4>, 4> hessian() const;

 private:
  /// One of the two triangles.
  struct Side {
    Vec<3> normal;  ///< n
    Vec<3> from_a;  ///< its third vertex − a
    Real foot;      ///< s
  };
  Side side(const Vec<3>& normal, const Vec<3>& from_a) const;

  Vec<3> edge_;
  Side left_, right_;
};

}  // namespace pliant
