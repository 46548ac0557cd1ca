#include <pliant/model/polygon.h>

#include <algorithm>
#include <cmath>

#include <pliant/geometry/distance.h>

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

OwnOutline look_at_own_outline(const Real* x, const Topology& topology, Index m, Real most) {
  const Index first = topology.offset[m], n = topology.points_of(m);
  const auto at = [&](Index k) { return point<2>(x, first + (k < n ? k : k - n)); };
  OwnOutline seen{std::nullopt, !(polygon_area(x, topology, m) > 0), most};
  Real longest2 = 0;
  for (Index i = 0; i < n; ++i) longest2 = std::max(longest2, (at(i + 1) - at(i)).squaredNorm());
  const Real longest = std::sqrt(longest2);
  Real gap2 = square(most);
  for (Index i = 0; i < n; ++i) {
    const Vec<2> p = at(i), q = at(i + 1);
    for (Index k = 1; k <= n - 2;) {
      const Index j = i + k < n ? i + k : i + k - n;
      const Vec<2> a = at(j);
      // The edge that begins an arc length s farther on is at least `far` − s beyond edge i and the gap.
      const Real far = (a - p).norm() - 2 * longest - seen.gap;
      if (far > 0) {
        k += 1 + static_cast<Index>(std::min(far / longest, static_cast<Real>(n)));
        continue;
      }
      const Vec<2> b = at(j + 1);
      if (const Real d2 = segment_foot(p, a, b).d2; d2 < gap2) {
        gap2 = d2;
        seen.gap = std::sqrt(d2);
      }
      if (k >= 2 && i < j && !seen.meet && segments_meet(p, q, a, b)) seen.meet = {i, j};
      ++k;
    }
  }
  return seen;
}

Real star_gap(const Real* x, const Topology& topology, Index m) {
  const Vec<2> centre = mean_of_points<2>(x, topology, m);
  Vec<2> a = point<2>(x, topology.offset[m + 1] - 1) - centre;
  Real least = std::numeric_limits<Real>::infinity(), radius2 = 0;
  Index rounds = 0;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
    const Vec<2> b = point<2>(x, i) - centre;
    least = std::min(least, cross(a, b));
    radius2 = std::max(radius2, b.squaredNorm());
    rounds += a[1] < 0 && b[1] >= 0 ? 1 : 0;
    a = b;
  }
  if (!(least > 0) || rounds != 1) return 0;
  // If all points, and so their mean, move by at most u, a cross product changes by less than 2R w + w², w = 2u.
  return std::sqrt(radius2 + least) - std::sqrt(radius2);
}

}  // namespace pliant
