#include <pliant/setup/polylines.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/base/text.h>

namespace pliant {
namespace {

Real cross(const Vec<2>& u, const Vec<2>& v) { return u[0] * v[1] - u[1] * v[0]; }

}  // namespace

std::optional<std::vector<Real>> parse_numbers(std::string_view text, std::string_view separators) {
  std::vector<Real> all;
  while (true) {
    const std::size_t begin = text.find_first_not_of(separators);
    if (begin == text.npos) return all;
    text.remove_prefix(begin);
    const std::string_view word = text.substr(0, std::min(text.find_first_of(separators), text.size()));
    Real value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) return {};
    all.push_back(value);
    text.remove_prefix(word.size());
  }
}

std::vector<Polyline> parse_polylines(std::string_view text, const std::string& name, std::string_view unit) {
  std::vector<Polyline> all;
  bool fresh = true;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view whole = text.substr(0, end), content = whole.substr(0, whole.find('#'));
    text.remove_prefix(std::min(end + 1, text.size()));
    const auto values = parse_numbers(content, " \t\r,");
    if (!values || (values->size() != 2 && !values->empty()))
      throw InputError("{}:{}: \"{}\" is not a point; write x y, two numbers in {}", name, line, printable(whole),
                       unit);
    if (values->empty()) {
      if (whole.find('#') == whole.npos) fresh = true;  // a comment line does not end a polyline
      continue;
    }
    if (fresh) all.emplace_back();
    fresh = false;
    const Vec<2> r((*values)[0], (*values)[1]);
    if (!all.back().points.empty() && all.back().points.back() == r)
      throw InputError("{}:{}: the segment at ({:g}, {:g}) has no length; leave one of its points out", name, line,
                       r[0], r[1]);
    all.back().points.push_back(r);
    all.back().lines.push_back(line);
  }
  if (all.empty()) throw InputError("{}: has no points; write lines x y, in {}", name, unit);
  for (const Polyline& p : all)
    if (p.points.size() < 2)
      throw InputError("{}:{}: a polyline of one point; give at least two, with no blank line between them", name,
                       p.lines[0]);
  return all;
}

bool cross_each_other(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d) {
  const Real small = 1e-9 * ((b - a).norm() + (d - c).norm());
  const auto sides = [&](const Vec<2>& p, const Vec<2>& q, const Vec<2>& r, const Vec<2>& s) {
    const Real length = (q - p).norm(), x = cross(q - p, r - p) / length, y = cross(q - p, s - p) / length;
    return (x > small && y < -small) || (x < -small && y > small);
  };
  return sides(a, b, c, d) && sides(c, d, a, b);
}

std::vector<Vec<2>> make_polygon(std::vector<Vec<2>> corners) {
  if (corners.size() > 1 && corners.front() == corners.back()) corners.pop_back();  // closed by the user
  const std::size_t n = corners.size();
  if (n < 3) throw InputError("a polygon has at least three corners");
  const auto end = [&](std::size_t k) -> const Vec<2>& { return corners[(k + 1) % n]; };
  Real area = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec<2>&a = corners[i], &b = end(i);
    area += cross(a, b) / 2;
    if (a == b) throw InputError("a side at ({:g}, {:g}) has no length", a[0], a[1]);
    for (std::size_t j = 0; j < i; ++j)
      if (cross_each_other(a, b, corners[j], end(j))) throw InputError("its sides cross near ({:g}, {:g})", a[0], a[1]);
  }
  if (area == 0) throw InputError("it has no area");
  if (area < 0) std::reverse(corners.begin(), corners.end());
  return corners;
}

}  // namespace pliant
