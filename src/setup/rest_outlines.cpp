#include <pliant/setup/rest_outlines.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

/// Points along an ellipse or a rod of length `aspect` and width 1, from an end on.
std::vector<Vec<2>> drawn(OutlineKind kind, Real aspect) {
  constexpr int fine = 4096;
  std::vector<Vec<2>> curve;
  for (int k = 0; k < fine; ++k) {
    const Real phi = 2 * pi * k / fine;
    Vec<2> r(std::cos(phi) / 2, std::sin(phi) / 2);
    if (kind == OutlineKind::ellipse)
      r[0] *= aspect;
    else
      r[0] += (k <= fine / 4 || k > 3 * fine / 4 ? 1 : -1) * (aspect - 1) / 2;
    curve.push_back(r);
  }
  return curve;
}

/// The ends of steps along a closed polyline from its first point on, each `chord` away from the previous step. Nothing
/// if the steps go round the polyline.
std::optional<std::vector<Vec<2>>> walk(const std::vector<Vec<2>>& curve, Index steps, Real chord) {
  std::vector<Vec<2>> places{curve[0]};
  std::size_t side = 0;  // that the last place lies on
  for (Index n = 0; n < steps; ++n) {
    const Vec<2> at = places.back();
    Vec<2> from = at, to = curve[(side + 1) % curve.size()];
    while ((to - at).norm() < chord) {
      if (++side == curve.size()) return std::nullopt;
      from = to;
      to = curve[(side + 1) % curve.size()];
    }
    const Vec<2> w = from - at, u = to - from;
    const Real a = u.squaredNorm(), b = w.dot(u), c = w.squaredNorm() - square(chord);
    places.emplace_back(from + (-b + std::sqrt(std::max(square(b) - a * c, 0.0))) / a * u);
  }
  return places;
}

/// n points of a closed polyline with equal distances, in units of these.
std::vector<Vec<2>> divided(const std::vector<Vec<2>>& curve, Index n) {
  Real length = 0;
  for (std::size_t k = 0; k < curve.size(); ++k) length += (curve[(k + 1) % curve.size()] - curve[k]).norm();
  // The longest chord of which n steps do not go round the polyline.
  Real low = 0, high = 2 * length / n;
  for (int k = 0; k < 60; ++k) {
    const Real middle = (low + high) / 2;
    (walk(curve, n, middle) ? low : high) = middle;
  }
  auto places = walk(curve, n, low);
  if (!places || !((places->back() - curve[0]).norm() < 1e-6 * low))
    throw InputError("an outline cannot be divided into {} equal edges; use another number of vertices", n);
  places->pop_back();
  std::vector<Vec<2>> vertices;
  Vec<2> mean = Vec<2>::Zero();
  for (const Vec<2>& r : *places) mean += r / n;
  for (const Vec<2>& r : *places) vertices.emplace_back((r - mean) / low);
  return vertices;
}

/// Length and width of the vertices, along x and y.
Vec<2> extent(const std::vector<Vec<2>>& vertices) {
  Vec<2> low = vertices[0], high = low;
  for (const Vec<2>& r : vertices) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  return high - low;
}

}  // namespace

std::vector<Vec<2>> rest_outline(const OutlineShape& shape, Index n) {
  if (shape.kind == OutlineKind::corners) return divided(shape.corners, n);
  constexpr Real narrowest = 0.5;  // smallest distance between the centres of the vertices
  const auto with = [&](Real aspect) { return divided(drawn(shape.kind, aspect), n); };
  if (shape.aspect <= 1) return with(1);
  // The disks make it rounder: the vertices lie on a longer one.
  Real low = 1, high = 1;
  const auto aspect_of = [](const std::vector<Vec<2>>& r) { return (extent(r)[0] + 1) / (extent(r)[1] + 1); };
  const auto too_narrow = [&](const std::vector<Vec<2>>& r) { return extent(r)[1] < narrowest; };
  for (;;) {
    low = high;
    high *= 1.25;
    const std::vector<Vec<2>> longer = with(high);
    if (too_narrow(longer))
      throw InputError("an outline of the aspect {:g} needs more than {} vertices; use {}", shape.aspect, n,
                       cures({Cure::more_vertices, Cure::smaller_aspect}));
    if (aspect_of(longer) >= shape.aspect) break;
  }
  for (int k = 0; k < 40; ++k) {
    const Real middle = (low + high) / 2;
    (aspect_of(with(middle)) < shape.aspect ? low : high) = middle;
  }
  return with(high);
}

Real outline_area(const std::vector<Vec<2>>& vertices) {
  Real twice = 0;
  const std::size_t n = vertices.size();
  for (std::size_t k = 0; k < n; ++k) {
    const Vec<2>&a = vertices[k], &b = vertices[(k + 1) % n];
    twice += a[0] * b[1] - a[1] * b[0];
  }
  // Each disk adds its sector outside the polygon; the angles inside add up to (n − 2) π.
  return twice / 2 + static_cast<Real>(n + 2) * pi / 8;
}

Real outline_radius(const std::vector<Vec<2>>& vertices) {
  Real most = 0;
  for (const Vec<2>& r : vertices) most = std::max(most, r.norm());
  return most + 0.5;
}

}  // namespace pliant
