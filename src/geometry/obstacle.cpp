#include <pliant/geometry/obstacle.h>

#include <cmath>

namespace pliant {

Real swept_area(int dim, const Vec<2>& a, const Vec<2>& b, Real y) {
  const auto cut = [&](const Vec<2>& p, const Vec<2>& q) {
    return p[1] <= y ? p : Vec<2>(p[0] + (q[0] - p[0]) * (y - p[1]) / (q[1] - p[1]), y);
  };
  if (a[1] >= y && b[1] >= y) return 0;
  const Vec<2> from = cut(a, b), to = cut(b, a);
  const Real height = to[1] - from[1];
  return dim == 2 ? height * (from[0] + to[0]) / 2
                  : pi / 3 * height * (square(from[0]) + from[0] * to[0] + square(to[0]));
}

Real turn(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, bool left) {
  const Vec<2> u = b - a, v = c - b;
  const Real turn = std::atan2(u[0] * v[1] - u[1] * v[0], u.dot(v));
  return left ? turn : -turn;
}

bool Obstacle::contains(const Vec<2>& p) const {
  if (disk()) return (p - corners[0]).norm() < radius;
  bool inside = false;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const Vec<2>&a = corners[k], &b = corners[(k + 1) % corners.size()];
    if ((a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1])) inside = !inside;
  }
  return inside;
}

void Obstacle::add_to(WallParts& walls) const {
  if (disk()) {
    walls.segments.push_back(WallSegment::disk(corners[0], radius));
    return;
  }
  const std::size_t n = corners.size();
  Index before = walls.next() + static_cast<Index>(n) - 1;
  for (std::size_t k = 0; k < n; ++k) {
    const Vec<2>&corner = corners[k], &next = corners[(k + 1) % n];
    const Real by = turn(corners[(k + n - 1) % n], corner, next, true);
    if (by > sharp_turn) walls.lips.push_back({corner, walls.next()});
    walls.joints.push_back({corner, walls.next(), before, by > -flat_turn});
    before = walls.next();
    walls.segments.push_back(WallSegment::between(corner, next));
  }
}

Real Obstacle::content(int dim, Real y) const {
  if (!disk()) {
    Real sum = 0;
    for (std::size_t k = 0; k < corners.size(); ++k)
      sum += swept_area(dim, corners[k], corners[(k + 1) % corners.size()], y);
    return sum;
  }
  const Vec<2>& centre = corners[0];
  const Real h = std::clamp(y - centre[1], -radius, radius);  // height of the cut above the centre
  if (dim == 3 && centre[0] == 0) return pi * (h * (square(radius) - square(h) / 3) + 2 * std::pow(radius, 3) / 3);
  const Real area = square(radius) * (pi / 2 + std::asin(h / radius)) + h * std::sqrt(square(radius) - square(h));
  return dim == 2 ? area : 2 * pi * centre[0] * area;
}

}  // namespace pliant
