#include <pliant/base/cure.h>
#include <pliant/geometry/vessel.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace pliant {
namespace {

Real cross(const Vec<2>& u, const Vec<2>& v) { return u[0] * v[1] - u[1] * v[0]; }

/// Whether the closed segments a–b and c–d have a point in common.
bool meet(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d) {
  const auto side = [](const Vec<2>& p, const Vec<2>& q, const Vec<2>& r) {
    const Real s = cross(q - p, r - p);
    return s > 0 ? 1 : s < 0 ? -1 : 0;
  };
  const auto between = [](const Vec<2>& p, const Vec<2>& q, const Vec<2>& r) {
    return (r.array() >= p.cwiseMin(q).array()).all() && (r.array() <= p.cwiseMax(q).array()).all();
  };
  const int ac = side(a, b, c), ad = side(a, b, d), ca = side(c, d, a), cb = side(c, d, b);
  if (ac * ad < 0 && ca * cb < 0) return true;
  return (ac == 0 && between(a, b, c)) || (ad == 0 && between(a, b, d)) || (ca == 0 && between(c, d, a)) ||
         (cb == 0 && between(c, d, b));
}

struct Named {
  Vec<2> a, b;
  bool left;
  Index point;  ///< of a, from 1
};

std::string text(const Named& s) {
  return fmt::format("segment ({:g}, {:g}) to ({:g}, {:g})", s.a[0], s.a[1], s.b[0], s.b[1]);
}

void check(const Vessel::Line& left, const Vessel::Line& right, const Vessel::Source& source) {
  const auto where = [&](bool of_left, std::size_t k) {
    const std::vector<int>& lines = of_left ? source.left : source.right;
    return k < lines.size() ? fmt::format(" (line {})", lines[k]) : "";
  };
  for (const auto* line : {&right, &left}) {  // a mirrored one comes last
    const bool of_left = line == &left;
    if (line->size() < 2)
      throw InputError("a polyline of {} points is not a wall; give at least two, from the orifice up", line->size());
    for (std::size_t k = 0; k < line->size(); ++k) {
      const Vec<2>& r = (*line)[k];
      if (!r.allFinite()) throw InputError("point {} of a polyline is not finite{}", k + 1, where(of_left, k));
      if (r[1] < 0)
        throw InputError("point ({:g}, {:g}){} is below the orifice, which is at y = 0; raise it", r[0], r[1],
                         where(of_left, k));
      if (k > 0 && r == (*line)[k - 1])
        throw InputError("a segment at ({:g}, {:g}){} has no length; leave one of its points out", r[0], r[1],
                         where(of_left, k));
    }
    if ((*line)[0][1] != 0)
      throw InputError(
          "a polyline ends at ({:g}, {:g}) instead of y = 0: the orifice is the gap between the ends at y = 0; move "
          "this end",
          (*line)[0][0], (*line)[0][1]);
  }
  const Real from = left[0][0], to = right[0][0];
  if (!(to > from))
    throw InputError("the orifice from x = {:g} to {:g} has no width; move the ends of the polylines at y = 0 apart",
                     from, to);
  if (std::abs(from + to) > 1e-9 * (to - from))
    throw InputError("the orifice from x = {:g} to {:g} is not centred on x = 0; shift all points by {:g}", from, to,
                     -(from + to) / 2);
  for (const auto* line : {&left, &right})
    for (std::size_t k = 1; k < line->size(); ++k)
      if ((*line)[k][1] == 0 && (*line)[k][0] > from && (*line)[k][0] < to)
        throw InputError("point ({:g}, 0) lies in the orifice, which goes from x = {:g} to {:g}; raise it",
                         (*line)[k][0], from, to);

  // The walls continue straight up from their last points, to above all particles.
  Real top = 0;
  for (const auto* line : {&left, &right})
    for (const Vec<2>& r : *line) top = std::max(top, r[1]);
  std::vector<Named> all;
  for (const auto* line : {&left, &right}) {
    const bool is_left = line == &left;
    for (std::size_t k = 0; k + 1 < line->size(); ++k)
      all.push_back({(*line)[k], (*line)[k + 1], is_left, static_cast<Index>(k) + 1});
    const Vec<2>& last = line->back();
    all.push_back({last, {last[0], top + 1}, is_left, static_cast<Index>(line->size())});
  }
  const auto low = [](const Named& s) { return std::min(s.a[0], s.b[0]); };
  const auto high = [](const Named& s) { return std::max(s.a[0], s.b[0]); };
  std::sort(all.begin(), all.end(), [&](const Named& s, const Named& t) {
    return std::tuple(-high(s), s.left, s.point) < std::tuple(-high(t), t.left, t.point);  // from the right
  });
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = i + 1; j < all.size() && high(all[j]) >= low(all[i]); ++j) {
      const Named &s = all[i], &t = all[j];
      if (s.left == t.left && std::abs(s.point - t.point) == 1) {
        const Named &first = s.point < t.point ? s : t, &second = s.point < t.point ? t : s;
        const Vec<2> u = first.b - first.a, v = second.b - second.a;
        if (cross(u, v) == 0 && u.dot(v) < 0)
          throw InputError("{}{} goes back along the segment before it; leave out its first point", text(second),
                           where(s.left, static_cast<std::size_t>(second.point) - 1));
      } else if (meet(s.a, s.b, t.a, t.b)) {
        const auto what = [&](const Named& n) {
          const Vessel::Line& line = n.left ? left : right;
          return n.point == static_cast<Index>(line.size())
                     ? fmt::format("the wall that goes straight up from ({:g}, {:g}){}", n.a[0], n.a[1],
                                   where(n.left, line.size() - 1))
                     : text(n) + where(n.left, static_cast<std::size_t>(n.point));
        };
        throw InputError("{} meets {}; walls must not cross or touch", what(s), what(t));
      }
    }
}

}  // namespace

Vessel::Vessel(Line left, Line right, const Source& source) : left_(std::move(left)), right_(std::move(right)) {
  check(left_, right_, source);
  extent_ = {left_[0][0], right_[0][0]};
  for (const auto* line : {&left_, &right_}) {
    for (std::size_t k = 0; k < line->size(); ++k) {
      const Vec<2>& r = (*line)[k];
      extent_ = {std::min(extent_[0], r[0]), std::max(extent_[1], r[0])};
      top_ = std::max(top_, r[1]);
      if (k > 0 && r[1] != (*line)[k - 1][1]) pieces_.push_back({(*line)[k - 1], r, line == &left_});
    }
    pieces_.push_back({line->back(), {line->back()[0], std::numeric_limits<Real>::infinity()}, line == &left_});
  }
  bands_.resize(top_ > 0 ? std::min<std::size_t>(pieces_.size(), 4096) : 1);
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    const std::size_t low = band(std::min(pieces_[k].a[1], pieces_[k].b[1])),
                      high = band(std::max(pieces_[k].a[1], pieces_[k].b[1]));
    for (std::size_t b = low; b <= high; ++b) bands_[b].push_back(static_cast<Index>(k));
  }
}

std::size_t Vessel::band(Real y) const {
  const auto n = static_cast<Real>(bands_.size());
  return y > 0 && top_ > 0 ? static_cast<std::size_t>(std::min(y / top_ * n, n - 1)) : 0;
}

template <class Visit>
void Vessel::at_height(int dim, Real y, Visit&& visit) const {
  for (const Index k : bands_[band(y)]) {
    const auto& [a, b, left] = pieces_[k];
    if ((left && dim == 3) || (a[1] > y) == (b[1] > y)) continue;
    visit(a[0] == b[0] ? a[0] : a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]));
  }
}

Real Vessel::half_width(int dim, Real y) const {
  if (y <= 0) return orifice() / 2;
  Real least = std::numeric_limits<Real>::infinity();
  at_height(dim, y, [&](Real x) { least = std::min(least, std::abs(x)); });
  return least;
}

bool Vessel::inside(int dim, const Vec<2>& p) const {
  bool inside = false;
  at_height(dim, p[1], [&](Real x) { inside ^= x > p[0]; });
  return inside && p[1] > 0;
}

Real Vessel::capacity(int dim, Real y) const {
  Real sum = 0;
  const auto add = [&](const Line& line, Real sign) {
    for (std::size_t k = 0; k + 1 < line.size(); ++k) sum += sign * swept_area(dim, line[k], line[k + 1], y);
    if (y > line.back()[1]) sum += sign * swept_area(dim, line.back(), {line.back()[0], y}, y);
  };
  add(right_, 1);
  if (dim == 2) add(left_, -1);
  return sum;
}

WallParts Vessel::walls(int dim) const {
  WallParts walls;
  if (dim == 2) add_side(left_, false, walls);
  add_side(right_, true, walls);
  return walls;
}

void Vessel::add_side(const Line& line, bool right, WallParts& walls) {
  const Vec<2> up(0, 1);
  for (std::size_t k = 0; k < line.size(); ++k) {
    const bool last = k + 1 == line.size();
    const Vec<2> next = last ? Vec<2>(line[k] + up) : line[k + 1];
    const Real by = k == 0 ? pi : turn(line[k - 1], line[k], next, !right);
    if (k > 0) walls.joints.push_back({line[k], walls.next(), walls.next() - 1, by > -flat_turn});
    if (by > sharp_turn) walls.lips.push_back({line[k], walls.next()});
    walls.segments.push_back(last ? WallSegment::ray(line[k], up) : WallSegment::between(line[k], next));
  }
}

Vessel uneven_hopper(const Hopper& hopper, Real left_angle) {
  hopper.check();
  if (!(left_angle >= 0 && left_angle < 90 && hopper.angle < 90))
    throw InputError(
        "angles {} of the left wall and {}: two walls with different angles must both be steeper than a flat bottom, "
        "to end at the same height; use angles below 90 degrees or {}",
        left_angle, hopper.angle, cures({Cure::own_outline}));
  const auto slope = [](Real degrees) { return std::tan(degrees * pi / 180); };
  const Real half = hopper.orifice / 2,
             top = (hopper.wall_distance - hopper.orifice) / (slope(left_angle) + slope(hopper.angle));
  return {{{-half, 0}, {-half - top * slope(left_angle), top}}, {{half, 0}, {half + top * slope(hopper.angle), top}}};
}

}  // namespace pliant
