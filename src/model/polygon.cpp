#include <pliant/model/polygon.h>

namespace pliant {
namespace {

Real cross(const Vec<2>& a, const Vec<2>& b) { return a[0] * b[1] - a[1] * b[0]; }

}  // namespace

bool segments_meet(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d) {
  const Real c_side = cross(b - a, c - a), d_side = cross(b - a, d - a);
  const Real a_side = cross(d - c, a - c), b_side = cross(d - c, b - c);
  if (c_side * d_side < 0 && a_side * b_side < 0) return true;
  // An end that lies on the other segment: collinear and within its box.
  const auto on = [](Real side, const Vec<2>& p, const Vec<2>& q, const Vec<2>& r) {
    return side == 0 && (r - p).dot(r - q) <= 0;
  };
  return on(c_side, a, b, c) || on(d_side, a, b, d) || on(a_side, c, d, a) || on(b_side, c, d, b);
}

bool self_intersects(const Real* x, const Topology& topology, Index m) {
  const Index first = topology.offset[m], n = topology.points_of(m);
  const auto at = [&](Index k) { return point<2>(x, first + k % n); };
  for (Index i = 0; i < n; ++i)
    for (Index j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;  // neighbours across the seam
      if (segments_meet(at(i), at(i + 1), at(j), at(j + 1))) return true;
    }
  return false;
}

}  // namespace pliant
