#include <pliant/geometry/hinge.h>

#include <cmath>

namespace pliant {

TriangleArea::TriangleArea(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) : opposite_{c - b, a - c, b - a} {
  const Vec<3> n = opposite_[2].cross(c - a);
  const Real length = n.norm();
  area = length / 2;
  normal_ = n / length;
  for (int k = 0; k < 3; ++k) gradient[k] = normal_.cross(opposite_[k]) / 2;
}

Mat<3> TriangleArea::hessian(int i, int j) const {
  // n = a×b + b×c + c×a, so that ∂n/∂r_i = skew(opposite_i).
  const Mat<3> across = (Mat<3>::Identity() - normal_ * normal_.transpose()) / (2 * area);
  Mat<3> h = -skew(opposite_[i]) * across * skew(opposite_[j]) / 2;
  if (j == (i + 1) % 3) h -= skew(normal_) / 2;
  if (i == (j + 1) % 3) h += skew(normal_) / 2;
  return h;
}

HingeAngle::HingeAngle(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d)
    : edge_(b - a), left_(side(edge_.cross(c - a), c - a)), right_(side((d - a).cross(edge_), d - a)) {
  const Real length = edge_.norm(), left2 = left_.normal.squaredNorm(), right2 = right_.normal.squaredNorm();
  const Real product = std::sqrt(left2 * right2);
  cosine = left_.normal.dot(right_.normal) / product;
  sine = edge_.dot(left_.normal.cross(right_.normal)) / (length * product);
  gradient[2] = -length / left2 * left_.normal;
  gradient[3] = -length / right2 * right_.normal;
  gradient[0] = -(1 - left_.foot) * gradient[2] - (1 - right_.foot) * gradient[3];
  gradient[1] = -left_.foot * gradient[2] - right_.foot * gradient[3];
}

HingeAngle::Side HingeAngle::side(const Vec<3>& normal, const Vec<3>& from_a) const {
  return {normal, from_a, from_a.dot(edge_) / edge_.squaredNorm()};
}

std::array<std::array<Mat<3>, 4>, 4> HingeAngle::hessian() const {
  std::array<std::array<Mat<3>, 4>, 4> h;
  for (auto& row : h) row.fill(Mat<3>::Zero());
  const Real length = edge_.norm();
  const auto add = [&](const Side& side, int third, Real sign) {
    const Real n2 = side.normal.squaredNorm();
    const Vec<3> unit = side.normal / std::sqrt(n2), w = side.from_a;
    // Derivatives of the third vertex' row: of 1/|n|² n, and of the length of the edge.
    const Mat<3> turn = -length / n2 * (Mat<3>::Identity() - 2 * unit * unit.transpose()) * sign;
    const Mat<3> stretch = side.normal * edge_.transpose() / (length * n2);
    std::array<Mat<3>, 4> row;
    row.fill(Mat<3>::Zero());
    row[0] = turn * skew(w - edge_) + stretch;
    row[1] = -turn * skew(w) - stretch;
    row[third] = turn * skew(edge_);
    // Derivatives of the place of the foot.
    const Real e2 = edge_.squaredNorm();
    std::array<Vec<3>, 4> foot;
    foot.fill(Vec<3>::Zero());
    foot[0] = (2 * side.foot * edge_ - edge_ - w) / e2;
    foot[1] = (w - 2 * side.foot * edge_) / e2;
    foot[third] = edge_ / e2;
    const Vec<3>& g = gradient[third];
    for (int j = 0; j < 4; ++j) {
      const Mat<3> moved = g * foot[j].transpose();
      h[third][j] += row[j];
      h[0][j] += moved - (1 - side.foot) * row[j];
      h[1][j] -= moved + side.foot * row[j];
    }
  };
  add(left_, 2, 1);
  add(right_, 3, -1);
  return h;
}

}  // namespace pliant
