#include <pliant/geometry/container.h>

#include <algorithm>
#include <cmath>

namespace pliant {
namespace {

template <class... F>
struct Overload : F... {
  using F::operator()...;
};
template <class... F>
Overload(F...) -> Overload<F...>;

/// Distance of a wall from the vertical line above p; larger if the wall is nearest to p.
Real distance_from_line_above(const Vec<2>& p, const WallSegment& wall) {
  const auto from_line = [&](const Vec<2>& r) { return r[1] >= p[1] ? std::abs(r[0] - p[0]) : (r - p).norm(); };
  Real d = from_line(wall.origin);
  if (wall.direction[0] != 0) {  // else the nearest point is an end, or level with p
    const Real across = (p[0] - wall.origin[0]) / wall.direction[0];
    if (across >= 0 && across <= wall.length && wall.origin[1] + across * wall.direction[1] >= p[1]) d = 0;
    if (std::isfinite(wall.length)) d = std::min(d, from_line(wall.end()));
  }
  return d - wall.radius;
}

}  // namespace

Real Container::orifice() const {
  return std::visit(Overload{[](const Hopper& h) { return h.orifice; }, [](const Vessel& v) { return v.orifice(); }},
                    shape_);
}

Vec<2> Container::inflow() const {
  return std::visit(Overload{[](const Hopper& h) { return Vec<2>(-h.wall_distance / 2, h.wall_distance / 2); },
                             [](const Vessel& v) { return Vec<2>(v.left(), v.right()); }},
                    shape_);
}

Vec<2> Container::extent() const {
  const Vessel* vessel = std::get_if<Vessel>(&shape_);
  return vessel != nullptr ? vessel->extent() : inflow();
}

Real Container::upright_from() const {
  return std::visit(
      Overload{[](const Hopper& h) { return h.slope_height(); }, [](const Vessel& v) { return v.upright_from(); }},
      shape_);
}

Real Container::half_width(int dim, Real y) const {
  return std::visit(
      Overload{[&](const Hopper& h) { return h.half_width(y); }, [&](const Vessel& v) { return v.half_width(dim, y); }},
      shape_);
}

bool Container::inside(int dim, const Vec<2>& p) const {
  const bool between =
      std::visit(Overload{[&](const Hopper& h) { return p[1] > 0 && std::abs(p[0]) <= h.half_width(p[1]); },
                          [&](const Vessel& v) { return v.inside(dim, p); }},
                 shape_);
  return between &&
         std::none_of(obstacles_.begin(), obstacles_.end(), [&](const Obstacle& o) { return o.contains(p); });
}

template <int D>
bool Container::has_room(const Walls<D>& walls, const Vec<D>& r, Real radius, Real margin) const {
  const Vec<2> p = in_plane<D>(r);
  if (const Hopper* hopper = std::get_if<Hopper>(&shape_))
    if (std::abs(p[0]) > std::max(hopper->half_width(p[1]) - radius, hopper->orifice / 4)) return false;
  if (plain()) return true;
  std::vector<Index> near;
  walls.find_near(r, margin * radius, 0, near);
  return near.empty() && inside(D, p);
}

Real Container::capacity(int dim, Real y) const {
  Real all = std::visit([&](const auto& shape) { return shape.capacity(dim, y); }, shape_);
  for (const Obstacle& o : obstacles_) all -= o.content(dim, y);
  return all;
}

Real Container::capacity_near_axis(int dim, Real half, Real height) const {
  constexpr int rows = 400, columns = 100, halvings = 30;
  const Real left = dim == 2 ? -half : 0, step = (half - left) / columns;
  const auto up_to = [&](Real x) { return dim == 2 ? x : pi * x * x; };
  Real sum = 0;
  bool whole = true;
  for (int row = 0; row < rows; ++row) {
    const Real y = (row + 0.5) * height / rows;
    bool in = inside(dim, {left, y});
    if (in) sum -= up_to(left);
    for (int k = 1; k <= columns; ++k) {
      whole = whole && in;
      Real last = left + (k - 1) * step, next = k < columns ? left + k * step : half;
      const bool now = inside(dim, {next, y});
      if (now != in) {  // the region begins or ends between both
        for (int n = 0; n < halvings; ++n) {
          const Real middle = (last + next) / 2;
          (inside(dim, {middle, y}) == in ? last : next) = middle;
        }
        sum += in ? up_to(next) : -up_to(next);
      }
      in = now;
    }
    whole = whole && in;
    if (in) sum += up_to(half);
  }
  return whole ? (up_to(half) - up_to(left)) * height : sum * height / rows;
}

Real Container::fill_height(int dim, Real content) const {
  Real low = 0, high = 1;
  while (capacity(dim, high) < content) high *= 2;
  for (int k = 0; k < 100; ++k) {
    const Real middle = (low + high) / 2;
    (capacity(dim, middle) < content ? low : high) = middle;
  }
  return high;
}

WallParts Container::parts(int dim) const {
  WallParts walls = std::visit([&](const auto& shape) { return shape.walls(dim); }, shape_);
  if (corners_ == CornerRule::literal) std::erase_if(walls.joints, [](const Joint& joint) { return !joint.convex; });
  for (const Obstacle& o : obstacles_) o.add_to(walls);
  return walls;
}

std::vector<Index> Container::bodies(int dim) const {
  const auto sides = std::visit([&](const auto& shape) { return shape.walls(dim); }, shape_).segments;
  std::vector<Index> bodies;
  // Both sides end with vertical walls.
  bool left = dim == 2;
  for (const WallSegment& wall : sides) {
    bodies.push_back(left ? 0 : 1);
    if (!std::isfinite(wall.length)) left = false;
  }
  Index body = 2;
  for (const Obstacle& o : obstacles_) {
    WallParts parts;
    o.add_to(parts);
    bodies.insert(bodies.end(), parts.segments.size(), body++);
  }
  return bodies;
}

template <int D>
Walls<D> Container::walls() const {
  return Walls<D>(parts(D));
}

template <int D>
Walls<D> Container::closed(Real lid, Real clearance) const {
  WallParts walls = parts(D);
  walls.lips.clear();
  const Vec<2> across = extent();
  const Real bottom = orifice() / 2;
  walls.segments.push_back(WallSegment::between({D == 2 ? -bottom : 0, 0}, {bottom, 0}));
  walls.segments.push_back(WallSegment::between({D == 2 ? across[0] : 0, lid}, {across[1], lid}));
  for (WallSegment& wall : walls.segments) wall.radius += clearance;
  return Walls<D>(std::move(walls));
}

template <int D>
bool Container::can_fall_to(const Walls<D>& walls, const Vec<D>& r, Real radius) {
  const Real least = radius * (1 - 1e-9);
  const Vec<2> p = in_plane<D>(r);
  Index s = 0;
  for (const WallSegment& wall : walls.segments())
    if (walls.distance(r, s++, 0) < least || distance_from_line_above(p, wall) < least) return false;
  return true;
}

template <int D>
bool Container::lets_pass(Real radius) const {
  const Walls<D> all = walls<D>();
  Real top = upright_from();
  for (const Obstacle& o : obstacles_)
    for (const Vec<2>& corner : o.corners) top = std::max(top, corner[1] + o.radius);
  top += 2 * radius;
  const Vec<2> across = extent();
  const Real left = D == 2 ? across[0] : 0, width = across[1] - left;
  constexpr Real most_places = 1e6;
  const Real step = std::max(radius / 4, std::sqrt(width * top / most_places));
  const auto columns = static_cast<Index>(width / step) + 2, rows = static_cast<Index>(top / step) + 2;
  // Any path of the particle passes within half the diagonal of a cell of such places.
  const Real clearance = radius - 0.75 * step;
  std::vector<Index> near;
  const auto is_free = [&](Index place) {
    const Index row = place / columns;
    const Vec<2> p(left + step * (place % columns), step * row);
    if (p[1] > 0 ? !inside(D, p) : std::abs(p[0]) > orifice() / 2) return false;
    Vec<D> r = Vec<D>::Zero();
    r[0] = p[0];
    r[D - 1] = p[1];
    all.find_near(r, clearance, 0, near);
    return near.empty();
  };
  std::vector<std::uint8_t> seen(static_cast<std::size_t>(columns) * rows);
  std::vector<Index> open;
  const auto visit = [&](Index column, Index row) {
    if (column < 0 || column >= columns || row < 0 || row >= rows) return;
    const Index place = row * columns + column;
    if (seen[place] != 0) return;
    seen[place] = 1;
    if (is_free(place)) open.push_back(place);
  };
  for (Index column = 0; column < columns; ++column) visit(column, rows - 1);
  while (!open.empty()) {
    const Index column = open.back() % columns, row = open.back() / columns;
    open.pop_back();
    if (row == 0) return true;
    for (const Index dy : {1, 0, -1})  // downwards first
      for (const Index dx : {-1, 0, 1}) visit(column + dx, row + dy);
  }
  return false;
}

template bool Container::lets_pass<2>(Real) const;
template bool Container::lets_pass<3>(Real) const;
template Walls<2> Container::walls() const;
template Walls<3> Container::walls() const;
template Walls<2> Container::closed(Real, Real) const;
template Walls<3> Container::closed(Real, Real) const;
template bool Container::has_room(const Walls<2>&, const Vec<2>&, Real, Real) const;
template bool Container::has_room(const Walls<3>&, const Vec<3>&, Real, Real) const;
template bool Container::can_fall_to(const Walls<2>&, const Vec<2>&, Real);
template bool Container::can_fall_to(const Walls<3>&, const Vec<3>&, Real);

}  // namespace pliant
