#include <pliant/scenarios/channel/channel_shape.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/setup/polylines.h>

namespace pliant {
namespace {

/// The arms of a channel: +x, +y, −x, −y.
std::array<bool, 4> arms_of(ChannelKind kind) {
  switch (kind) {
    case ChannelKind::l:
      return {true, true, false, false};
    case ChannelKind::t:
      return {true, true, true, false};
    case ChannelKind::x:
      return {true, true, true, true};
    case ChannelKind::straight:
      return {true, false, true, false};
  }
  return {};
}

/// a, turned by k quarters counterclockwise.
Vec<2> turned(const Vec<2>& a, int k) {
  const Vec<2> quarters[] = {a, {-a[1], a[0]}, -a, {a[1], -a[0]}};
  return quarters[k];
}

Real distance_from(const Vec<2>& r, const Vec<2>& a, const Vec<2>& b) { return std::sqrt(segment_foot(r, a, b).d2); }

}  // namespace

Channel::Channel(ChannelKind kind, const ChannelSize& size) {
  const Real w = size.width;
  if (!(size.arm > w))
    throw InputError(
        "-channel_arm {:g} and -channel_width {:g}: the arm is from its end to the far side of the bend, and must be "
        "longer than the channel is wide",
        size.arm, w);
  const std::array<bool, 4> arms = arms_of(kind);
  const Vec<2> middle = Vec<2>::Constant(w / 2);
  // Each corner of the square, and the side between two of them.
  const auto corner = [&](int k) { return Vec<2>(middle + turned({w / 2, -w / 2}, k)); };
  for (int k = 0; k < 4; ++k) {
    const bool before = arms[(k + 3) % 4];
    if (arms[k] == before) region_.corners.push_back(corner(k));
    if (!arms[k]) continue;
    const Vec<2> out = (size.arm - w) * turned({1, 0}, k);
    sides_.push_back(region_.corners.size());
    region_.corners.emplace_back(corner(k) + out);
    region_.corners.emplace_back(corner((k + 1) % 4) + out);
  }
  straight_ = kind == ChannelKind::straight;
  place_plungers();
}

Channel::Channel(std::vector<Vec<2>> corners) : region_{make_polygon(std::move(corners))} {}

void Channel::set_plungers(const std::vector<Vec<2>>& places) {
  const std::size_t n = region_.corners.size();
  sides_.clear();
  for (const Vec<2>& r : places) {
    std::size_t nearest = 0;
    Real least = std::numeric_limits<Real>::infinity();
    for (std::size_t k = 0; k < n; ++k)
      if (const Real d = distance_from(r, region_.corners[k], region_.corners[(k + 1) % n]); d < least) {
        least = d;
        nearest = k;
      }
    const Vec<2>&a = region_.corners[nearest], &b = region_.corners[(nearest + 1) % n];
    if (!(least < 1e-3 * (b - a).norm()))
      throw InputError(
          "-plungers: ({:g}, {:g}) is {:.3g} cm from the side from ({:g}, {:g}) to ({:g}, {:g}), the nearest one; name "
          "a place on the side that is to be a plunger",
          r[0], r[1], least, a[0], a[1], b[0], b[1]);
    if (std::find(sides_.begin(), sides_.end(), nearest) != sides_.end())
      throw InputError("-plungers: ({:g}, {:g}) is on a side that has been named before; name each once", r[0], r[1]);
    sides_.push_back(nearest);
  }
  place_plungers();
}

void Channel::place_plungers() {
  plungers_.clear();
  for (const std::size_t k : sides_) {
    const Vec<2>&a = region_.corners[k], &b = region_.corners[(k + 1) % region_.corners.size()];
    plungers_.push_back({{a, b}, turned((b - a).normalized(), 1)});
  }
}

Walls<2> Channel::walls(const PlungerMotion& motion) const {
  const std::vector<Vec<2>>& corners = region_.corners;
  const std::size_t n = corners.size();
  const auto is_plunger = [&](std::size_t k) { return std::find(sides_.begin(), sides_.end(), k) != sides_.end(); };
  Walls<2> walls;
  WallParts parts;
  std::vector<Index> number(n, -1);  // number of each segment among the walls
  for (std::size_t k = 0; k < n; ++k) {
    if (is_plunger(k)) continue;
    const Vec<2>&a = corners[k], &b = corners[(k + 1) % n];
    if (straight_) {
      const Vec<2> along = (b - a).normalized();  // below in the direction of x, above against it
      walls.add(Solid<2>::half_space(a, turned(along, 1)), {.velocity = motion.shear * along, .since = motion.since},
                {.shift = motion.sheared * along});
      continue;
    }
    number[k] = parts.next();
    parts.segments.push_back(WallSegment::between(a, b));
  }
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t before = (k + n - 1) % n, after = (k + 1) % n;
    if (number[k] < 0 || number[before] < 0) continue;
    const bool convex = turn(corners[before], corners[k], corners[after], false) > -flat_turn;
    parts.joints.push_back({corners[k], number[k], number[before], convex});
  }
  if (!parts.segments.empty()) walls.add(parts);
  for (std::size_t p = 0; p < plungers_.size(); ++p) {
    const Vec<2>& direction = plungers_[p].direction;
    const bool moves = p == motion.plunger;
    walls.add(Solid<2>::half_space(plungers_[p].ends[0] + (moves ? motion.travel : 0) * direction, direction),
              {.velocity = (moves ? motion.speed : 0) * direction, .since = motion.since}, {}, plunger_material);
  }
  return walls;
}

std::vector<Real> Channel::drawn_walls(std::size_t plunger, Real travel) const {
  std::vector<Real> drawn;
  const auto draw = [&](const Vec<2>& a, const Vec<2>& b) { drawn.insert(drawn.end(), {a[0], a[1], b[0], b[1]}); };
  for (std::size_t k = 0; k < region_.corners.size(); ++k)
    if (std::find(sides_.begin(), sides_.end(), k) == sides_.end())
      draw(region_.corners[k], region_.corners[(k + 1) % region_.corners.size()]);
  for (std::size_t p = 0; p < plungers_.size(); ++p) {
    const Vec<2> moved = (p == plunger ? travel : 0) * plungers_[p].direction;
    draw(plungers_[p].ends[0] + moved, plungers_[p].ends[1] + moved);
  }
  return drawn;
}

void Channel::check_stroke(Real stroke) const {
  const std::size_t n = region_.corners.size();
  for (std::size_t p = 0; p < plungers_.size(); ++p)
    for (std::size_t k = 0; k < n; ++k) {
      if (k == sides_[p] || k == (sides_[p] + 1) % n) continue;
      const Vec<2>& r = region_.corners[k];
      const Real way = (r - plungers_[p].ends[0]).dot(plungers_[p].direction);
      if (way < stroke)
        throw InputError(
            "-stroke {:g}: the plunger from ({:g}, {:g}) to ({:g}, {:g}) runs into the corner ({:g}, {:g}) of the "
            "channel after {:.4g} cm; shorten the stroke",
            stroke, plungers_[p].ends[0][0], plungers_[p].ends[0][1], plungers_[p].ends[1][0], plungers_[p].ends[1][1],
            r[0], r[1], std::max(way, Real(0)));
    }
}

}  // namespace pliant
