#include <pliant/scenarios/hopper/shapes.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include <pliant/base/errors.h>
#include <pliant/base/options.h>
#include <pliant/base/text.h>
#include <pliant/setup/polylines.h>

namespace pliant {
namespace {

constexpr std::string_view length_unit = "sigma_avg";

/// From the orifice upwards.
Polyline upwards(Polyline p, const std::string& name) {
  const Real first = p.points.front()[1], last = p.points.back()[1];
  if (first == 0 && last == 0)
    throw InputError(
        "{}:{}: both ends of the polyline are at y = 0; one is an end of the orifice, and from the other end the wall "
        "goes straight up: raise the other end",
        name, p.lines[0]);
  if (first != 0 && last != 0)
    throw InputError(
        "{}:{}: no end of the polyline is at y = 0, but at y = {:g} and {:g}; the orifice is the gap at y = 0: begin "
        "there",
        name, p.lines[0], first, last);
  if (first != 0) {
    std::reverse(p.points.begin(), p.points.end());
    std::reverse(p.lines.begin(), p.lines.end());
  }
  return p;
}

Vessel make_vessel(std::string_view text, const std::string& name, int dim) {
  std::vector<Polyline> all = parse_polylines(text, name, length_unit);
  if (all.size() > 2)
    throw InputError(
        "{}:{}: this is polyline {}; an outline has one for each side of the orifice, or one that is mirrored; use "
        "-obstacle for objects inside",
        name, all[2].lines[0], all.size());
  if (dim == 3 && all.size() == 2)
    throw InputError(
        "{}:{}: a second polyline; with -dim 3 the outline is one, the meridian (rho, z) of a body of revolution", name,
        all[1].lines[0]);
  for (Polyline& p : all) p = upwards(std::move(p), name);
  if (all.size() == 1) {
    if (!(all[0].points[0][0] > 0))
      throw InputError(
          "{}:{}: the end of the orifice at x = {:g}; a single polyline is mirrored at x = 0 and begins at x > 0", name,
          all[0].lines[0], all[0].points[0][0]);
    all.insert(all.begin(), all[0]);
    for (Vec<2>& r : all[0].points) r[0] = -r[0];
  } else if (all[0].points[0][0] > all[1].points[0][0]) {
    std::swap(all[0], all[1]);
  }
  try {
    return Vessel(std::move(all[0].points), std::move(all[1].points), {all[0].lines, all[1].lines});
  } catch (const InputError& error) {
    throw InputError("{}: {}", name, error.what());
  }
}

/// Items "kind:value", in their order.
std::vector<std::pair<std::string, std::string>> items(const std::string& text) {
  std::vector<std::pair<std::string, std::string>> all;
  constexpr std::string_view separators = ",; \t\n";
  std::size_t at = text.find_first_not_of(separators);
  while (at != text.npos) {
    const std::size_t colon = text.find(':', at);
    const std::string kind = text.substr(at, colon == text.npos ? text.npos : colon - at);
    if (kind != "disk" && kind != "polygon")
      throw InputError(
          "-obstacle: \"{}\" is not an obstacle; write disk:x,y,r, polygon:FILE or polygon:x,y,x,y,…, with a comma "
          "between several",
          printable(text.substr(at)));
    std::size_t end = text.size();
    for (const char* next : {"disk:", "polygon:"})
      for (std::size_t k = text.find(next, colon); k != text.npos; k = text.find(next, k + 1))
        if (separators.find(text[k - 1]) != separators.npos) {
          end = std::min(end, k);
          break;
        }
    std::string value = text.substr(colon + 1, end - colon - 1);
    value.erase(value.find_last_not_of(separators) + 1);
    all.emplace_back(kind, value);
    at = end < text.size() ? end : text.npos;
  }
  if (all.empty()) throw InputError("-obstacle: is empty; write disk:x,y,r, polygon:FILE or polygon:x,y,x,y,…");
  return all;
}

std::string text(const Obstacle& o) {
  if (o.disk()) return fmt::format("disk:{:g},{:g},{:g}", o.corners[0][0], o.corners[0][1], o.radius);
  return fmt::format("the polygon from ({:g}, {:g})", o.corners[0][0], o.corners[0][1]);
}

/// Ends of the edges of a polygon; of a disk none.
std::vector<std::pair<Vec<2>, Vec<2>>> edges(const Obstacle& o) {
  std::vector<std::pair<Vec<2>, Vec<2>>> all;
  for (std::size_t k = 0; k < o.corners.size() && !o.disk(); ++k)
    all.emplace_back(o.corners[k], o.corners[(k + 1) % o.corners.size()]);
  return all;
}

Real least_distance(const Obstacle& o, const Vec<2>& p) {
  Real least = std::numeric_limits<Real>::infinity();
  for (const auto& [a, b] : edges(o)) least = std::min(least, std::sqrt(segment_foot(p, a, b).d2));
  return least;
}

/// Whether they share more than touching points.
bool overlap(const Obstacle& a, const Obstacle& b) {
  if (a.disk() && b.disk()) return (a.corners[0] - b.corners[0]).norm() < (a.radius + b.radius) * (1 - 1e-9);
  if (a.disk()) return b.contains(a.corners[0]) || least_distance(b, a.corners[0]) < a.radius * (1 - 1e-9);
  if (b.disk()) return overlap(b, a);
  if (a.contains(b.corners[0]) || b.contains(a.corners[0])) return true;
  for (const auto& [p, q] : edges(a))
    for (const auto& [r, s] : edges(b))
      if (cross_each_other(p, q, r, s)) return true;
  return false;
}

}  // namespace

std::string read_outline(const std::string& given, const std::filesystem::path& folder) {
  const std::string file = path_from(folder, given);
  const std::string name = "outline " + printable(file), text = read_text_file(file, largest_outline, "outline");
  make_vessel(text, name, 2);
  std::string result;
  for (const Polyline& p : parse_polylines(text, name, length_unit)) {
    if (!result.empty()) result += '\n';
    for (const Vec<2>& r : p.points) result += fmt::format("{} {}\n", r[0], r[1]);
  }
  return result;
}

Vessel outline_vessel(const std::string& text, int dim) { return make_vessel(text, "-outline", dim); }

std::string read_obstacles(const std::string& text, const std::filesystem::path& folder) {
  std::string result;
  for (const auto& [kind, value] : items(text)) {
    std::string content = value;
    if (kind == "polygon" && !parse_numbers(value, ", \t")) {
      const std::string file = path_from(folder, value), name = "obstacle " + printable(file);
      const std::vector<Polyline> all =
          parse_polylines(read_text_file(file, largest_outline, "obstacle"), name, length_unit);
      if (all.size() > 1)
        throw InputError("{}:{}: a second polyline; a file has one polygon, use polygon:FILE for each", name,
                         all[1].lines[0]);
      content.clear();
      for (const Vec<2>& r : all[0].points) content += fmt::format("{}{},{}", content.empty() ? "" : ",", r[0], r[1]);
    }
    result += fmt::format("{}{}:{}", result.empty() ? "" : ";", kind, content);
  }
  parse_obstacles(result, 2);
  return result;
}

std::vector<Obstacle> parse_obstacles(const std::string& all, int dim) {
  std::vector<Obstacle> obstacles;
  for (const auto& [kind, value] : items(all)) {
    const auto values = parse_numbers(value, ", \t");
    const auto refuse = [&, &kind = kind, &value = value](const std::string& why) {
      throw InputError("-obstacle {}:{}: {}", kind, printable(value), why);
    };
    if (!values) refuse("not numbers; write disk:x,y,r, polygon:FILE or polygon:x,y,x,y,…");
    Obstacle o;
    if (kind == "disk") {
      if (values->size() != 3) refuse("a disk has three numbers: x,y,r");
      o = {{{(*values)[0], (*values)[1]}}, (*values)[2]};
      if (!(o.radius > 0)) refuse("the radius must be positive");
      if (dim == 3 && !(o.corners[0][0] == 0 || o.corners[0][0] >= o.radius))
        refuse(
            "with -dim 3 a disk is the meridian of a body of revolution: a sphere on the axis, x = 0, or a ring, x at "
            "least r");
    } else {
      if (values->size() % 2 != 0) refuse("an odd number of coordinates");
      std::vector<Vec<2>> corners;
      for (std::size_t k = 0; k < values->size(); k += 2) corners.emplace_back((*values)[k], (*values)[k + 1]);
      try {
        o.corners = make_polygon(std::move(corners));
      } catch (const InputError& error) {
        refuse(error.what());
      }
      for (const Vec<2>& r : o.corners)
        if (dim == 3 && r[0] < 0) refuse(fmt::format("with -dim 3 corners are (rho, z): rho = {:g} is negative", r[0]));
    }
    obstacles.push_back(std::move(o));
  }
  return obstacles;
}

void check_obstacles(const Container& container, const std::vector<Obstacle>& obstacles, int dim) {
  const WallParts walls = container.parts(dim);
  const auto nearest_on_wall = [&](const Vec<2>& p) {
    Vec<2> nearest = Vec<2>::Constant(std::numeric_limits<Real>::infinity());
    for (const WallSegment& s : walls.segments) {
      const Vec<2> foot = s.origin + std::clamp((p - s.origin).dot(s.direction), Real(0), s.length) * s.direction;
      if ((p - foot).norm() < (p - nearest).norm()) nearest = foot;
    }
    return nearest;
  };
  const auto wall_distance = [&](const Vec<2>& p) { return (p - nearest_on_wall(p)).norm(); };
  for (std::size_t k = 0; k < obstacles.size(); ++k) {
    const Obstacle& o = obstacles[k];
    for (const Vec<2>& corner : o.corners)
      if (!container.inside(dim, corner) && (o.disk() || !(wall_distance(corner) < 1e-9)))
        throw InputError("-obstacle {}: ({:g}, {:g}) is not inside the container, above the orifice; move it", text(o),
                         corner[0], corner[1]);
    if (o.disk() && wall_distance(o.corners[0]) < o.radius * (1 - 1e-9)) {
      const Vec<2> wall = nearest_on_wall(o.corners[0]);
      throw InputError(
          "-obstacle {}: overlaps the wall at ({:g}, {:g}), which is {:g} from its centre; it may only touch walls",
          text(o), wall[0], wall[1], wall_distance(o.corners[0]));
    }
    for (const auto& [a, b] : edges(o))
      for (const WallSegment& s : walls.segments) {
        const Real length = std::min(s.length, std::max(a[1], b[1]) + 1);
        if (cross_each_other(a, b, s.origin, s.origin + length * s.direction))
          throw InputError("-obstacle {}: its side from ({:g}, {:g}) to ({:g}, {:g}) crosses a wall; move it", text(o),
                           a[0], a[1], b[0], b[1]);
      }
    for (std::size_t j = 0; j < k; ++j)
      if (overlap(obstacles[j], o))
        throw InputError("-obstacle: {} and {} overlap; move one of them", text(obstacles[j]), text(o));
  }
}

}  // namespace pliant
