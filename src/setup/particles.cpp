#include <pliant/setup/particles.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/base/rng.h>
#include <pliant/model/surface.h>
#include <pliant/model/surface_crossing.h>
#include <pliant/model/surface_measures.h>
#include <pliant/setup/streams.h>

namespace pliant {
namespace {

std::vector<Index> shuffled(Index n, std::uint64_t seed) {
  std::vector<Real> draw(n);
  for (Index i = 0; i < n; ++i) draw[i] = rng::uniform(seed, stream::size_order, i);
  std::vector<Index> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](Index a, Index b) { return draw[a] < draw[b] || (draw[a] == draw[b] && a < b); });
  return order;
}

/// A standard normal number for particle m, drawn again where it is beyond ±3.
Real cut_normal(Index m, std::uint64_t seed) {
  for (std::uint64_t attempt = 0;; ++attempt) {
    const Real z = rng::normal(seed, stream::sizes, (static_cast<std::uint64_t>(m) << 16) + attempt);
    if (std::abs(z) <= 3) return z;
  }
}

/// Directions of n edges of length 1, in steps of an angle s.
template <class Direction>
std::vector<Real> directions(Index n, Direction&& direction) {
  std::vector<Real> theta(n);
  for (Index k = 0; k < n; ++k) theta[k] = direction(2 * pi * (k + 0.5) / n);
  return theta;
}

/// Turns each edge by as little as closes the outline, which is open for odd n only. Returns its vertices about their
/// mean.
std::vector<Vec<2>> closed_outline(std::vector<Real> theta) {
  const auto n = static_cast<Real>(theta.size());
  for (int round = 0; round < 50; ++round) {
    Vec<2> open = Vec<2>::Zero();
    Mat<2> turn = Mat<2>::Zero();
    for (const Real t : theta) {
      const Vec<2> across(-std::sin(t), std::cos(t));
      open += Vec<2>(std::cos(t), std::sin(t));
      turn += across * across.transpose();
    }
    if (open.norm() < 1e-14 * n) break;
    const Vec<2> by = -turn.inverse() * open;
    for (Real& t : theta) t += by.dot(Vec<2>(-std::sin(t), std::cos(t)));
  }
  std::vector<Vec<2>> vertices;
  Vec<2> at = Vec<2>::Zero(), mean = at;
  for (const Real t : theta) {
    vertices.push_back(at);
    mean += at / n;
    at += Vec<2>(std::cos(t), std::sin(t));
  }
  for (Vec<2>& r : vertices) r -= mean;
  return vertices;
}

Real area_of(const std::vector<Vec<2>>& r) {
  Real twice = 0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    const Vec<2>& next = r[(k + 1) % r.size()];
    twice += r[k][0] * next[1] - r[k][1] * next[0];
  }
  return twice / 2;
}

/// A polygon with n edges of length 1 and the area n²/(4π 𝒜0), longer than wide. Up to 𝒜0 = 2 directions are
/// s + b sin 2s, for small b the shape of least bending;
/// beyond, where the waist would be as narrow as an edge is long, the directions of a stretched circle, which is
/// convex. Errors: InputError if n edges cannot form such a shape.
std::vector<Vec<2>> elongated_outline(Index n, Real parameter) {
  constexpr Real most_waisted = 0.95, most_stretched = 1e6;
  const Real area = square(static_cast<Real>(n)) / (4 * pi * parameter);
  const auto waisted = [n](Real b) {
    return closed_outline(directions(n, [b](Real s) { return s + b * std::sin(2 * s); }));
  };
  const auto stretched = [n](Real f) {
    return closed_outline(directions(n, [f](Real s) { return std::atan2(f * std::sin(s), std::cos(s)); }));
  };
  const auto with_area = [area](Real low, Real high, auto&& outline) {
    for (int k = 0; k < 100; ++k) {
      const Real middle = (low + high) / 2;
      (area_of(outline(middle)) > area ? low : high) = middle;
    }
    return outline(low);
  };
  if (n > 4 && area >= area_of(waisted(most_waisted))) return with_area(0, most_waisted, waisted);
  std::vector<Vec<2>> vertices = with_area(1, most_stretched, stretched);
  if (const Real least = area_of(vertices); !(least < area * (1 + 1e-9)))
    throw InputError(
        "shape parameter {:g}: {} edges of equal length have at most {:.4g} in a shape without notches; use {}",
        parameter, n, square(static_cast<Real>(n)) / (4 * pi * least),
        cures({Cure::rounder_shape, Cure::even_vertices}));
  return vertices;
}

/// The outline at rest of particle m, in units of l0, if it is not the regular polygon; else nothing. All particles of
/// a run have equal outlines, so the last outline is cached.
const std::vector<Vec<2>>* elongated_outline_of(const Topology& topology, Index m) {
  constexpr Real rounding = 1e-9;
  const Index n = topology.points_of(m);
  const Real parameter = square(n * topology.l0[m]) / (4 * pi * topology.a0[m]);
  if (!(parameter > regular_shape_parameter(n) * (1 + rounding))) return nullptr;
  struct Last {
    Index n = 0;
    Real parameter = 0;
    std::vector<Vec<2>> outline = {};
  };
  thread_local Last last;
  if (last.n != n || !(std::abs(parameter - last.parameter) <= rounding * parameter))
    last = {n, parameter, elongated_outline(n, parameter)};
  return &last.outline;
}

Real circumradius(Index n, Real area) { return std::sqrt(2 * area / (n * std::sin(2 * pi / n))); }

}  // namespace

Real SizeDistribution::smallest() const {
  if (kind == "mono") return 1;
  if (kind == "normal") return 1 - 3 * deviation;
  return 1 / (1 - fraction + fraction * ratio);
}

Real SizeDistribution::largest() const {
  if (kind == "mono") return 1;
  return kind == "normal" ? 1 + 3 * deviation : ratio * smallest();
}

std::vector<Real> draw_diameters(const SizeDistribution& distribution, Index n, std::uint64_t seed) {
  std::vector<Real> sigma(n, 1.0);
  if (distribution.kind == "mono") return sigma;
  if (distribution.kind == "bidisperse") {
    const Real small = distribution.smallest();
    const Index large = static_cast<Index>(std::lround(distribution.fraction * n));
    const std::vector<Index> order = shuffled(n, seed);
    for (Index k = 0; k < n; ++k) sigma[order[k]] = k < large ? distribution.ratio * small : small;
    return sigma;
  }
  if (distribution.smallest() < 0.1)
    throw InputError("a standard deviation of {} would make diameters down to {}; use {}", distribution.deviation,
                     distribution.smallest(), cures({Cure::equal_sizes}));
  for (Index m = 0; m < n; ++m) sigma[m] = 1 + distribution.deviation * cut_normal(m, seed);
  return sigma;
}

std::vector<Real> draw_radii(const RadiusDistribution& distribution, Index n, std::uint64_t seed) {
  std::vector<Real> radius(n);
  const auto small = static_cast<Index>(std::lround(distribution.small_fraction * n));
  const std::vector<Index> order = shuffled(n, seed);
  for (Index k = 0; k < n; ++k) radius[order[k]] = k < small ? distribution.small : 1;
  for (Index m = 0; m < n; ++m) radius[m] *= 1 + distribution.deviation * cut_normal(m, seed);
  return radius;
}

Real regular_shape_parameter(Index vertices) { return vertices / pi * std::tan(pi / vertices); }

namespace {

/// Errors: InputError for a mesh that cannot be a particle.
void check_particle(const Surface& surface, ModelKind kind) {
  check_crosses_nothing(surface);
  const Real delta = surface.mean_rest_length();
  if (const Real gap = widest_gap(surface); kind == ModelKind::rough && gap >= delta)
    throw InputError(
        "a face has a place at {:.3g} times the mean length of an edge from its vertices, so vertices of other rough "
        "particles pass through; use triangles of more equal size, or smooth particles",
        gap / delta);
}

Topology make_surfaces(ModelKind kind, const std::vector<Real>& diameters, const PolygonShape& shape) {
  Topology topology;
  topology.dim = 3;
  const auto surfaces = std::make_shared<Surfaces>();
  const TriangleMesh mesh = shape.mesh ? *shape.mesh : icosphere(shape.vertices);
  surfaces->kinds.push_back(shape.shape_parameter > 0 ? surface_with_shape(mesh, shape.shape_parameter)
                                                      : relaxed_surface(mesh));
  const Surface& surface = surfaces->kinds.back();
  if (shape.mesh) check_particle(surface, kind);
  for (const Real sigma : diameters) {
    const Real volume = pi * sigma * square(sigma) / 6, length = surface.mean_rest_length() * sigma / surface.sigma;
    surfaces->add_particle(topology, 0, volume, kind == ModelKind::smooth ? shape.edge_width * length : length, volume);
  }
  topology.surfaces = surfaces;
  return topology;
}

}  // namespace

Topology make_particles(ModelKind kind, int dim, const std::vector<Real>& diameters, const PolygonShape& shape) {
  const bool soft = kind == ModelKind::sp || kind == ModelKind::disk || kind == ModelKind::bubble;
  if (dim == 3 && !soft) return make_surfaces(kind, diameters, shape);
  Topology topology;
  topology.dim = dim;
  for (const Real sigma : diameters) {
    if (soft) {
      topology.add_soft(sigma, dim == 2 ? pi * square(sigma) / 4 : pi * sigma * square(sigma) / 6);
      continue;
    }
    const Real a0 = pi * square(sigma) / 4;
    const Real parameter = shape.shape_parameter > 0 ? shape.shape_parameter : regular_shape_parameter(shape.vertices);
    const Real l0 = std::sqrt(4 * pi * a0 * parameter) / shape.vertices;
    topology.add_polygon(shape.vertices, a0, l0, kind == ModelKind::rough ? l0 : shape.edge_width * l0, a0);
    elongated_outline_of(topology, topology.particles() - 1);  // refuses a shape parameter that has no polygon
  }
  return topology;
}

Real usual_skin(ModelKind kind, int dim) {
  const bool deformable = kind == ModelKind::rough || kind == ModelKind::smooth || kind == ModelKind::shape;
  if (!deformable) return dim == 3 ? 0.2 : kind == ModelKind::sp ? 0.3 : 0.1;
  return dim == 2 && kind == ModelKind::smooth ? 0.06 : 0.1;
}

Real outer_radius(const Topology& topology, Index m) {
  const Real half = topology.diameter[topology.offset[m]] / 2;
  if (topology.points_of(m) == 1) return half;
  if (topology.surfaces) {
    Real radius2 = 0;
    for (const Vec<3>& r : topology.surfaces->of(topology, m).vertices) radius2 = std::max(radius2, r.squaredNorm());
    return topology.surfaces->scale(topology, m) * std::sqrt(radius2) + half;
  }
  const auto* outline = elongated_outline_of(topology, m);
  if (outline == nullptr) return circumradius(topology.points_of(m), topology.a0[m]) + half;
  Real radius2 = 0;
  for (const Vec<2>& r : *outline) radius2 = std::max(radius2, r.squaredNorm());
  return topology.l0[m] * std::sqrt(radius2) + half;
}

void place_particle(const Topology& topology, Index m, const Real* centre, Real angle, Real* x) {
  const Index first = topology.offset[m], n = topology.points_of(m);
  const int d = topology.dim;
  if (n == 1) {
    std::copy_n(centre, d, x + static_cast<std::size_t>(first) * d);
    return;
  }
  if (const auto* outline = elongated_outline_of(topology, m)) {
    const Real c = topology.l0[m] * std::cos(angle), s = topology.l0[m] * std::sin(angle);
    for (Index k = 0; k < n; ++k) {
      const Vec<2>& r = (*outline)[k];
      x[(first + k) * 2] = centre[0] + c * r[0] - s * r[1];
      x[(first + k) * 2 + 1] = centre[1] + s * r[0] + c * r[1];
    }
    return;
  }
  const Real radius = circumradius(n, topology.a0[m]);
  for (Index k = 0; k < n; ++k) {
    const Real phi = angle + 2 * pi * k / n;
    x[(first + k) * 2] = centre[0] + radius * std::cos(phi);
    x[(first + k) * 2 + 1] = centre[1] + radius * std::sin(phi);
  }
}

void place_surface(const Topology& topology, Index m, const Vec<3>& centre, const Mat<3>& rotation, Real* x) {
  const Real scale = topology.surfaces->scale(topology, m);
  Index i = topology.offset[m];
  for (const Vec<3>& r : topology.surfaces->of(topology, m).vertices)
    point<3>(x, i++) = centre + scale * (rotation * r);
}

void place_at_random_angles(const Topology& topology, const Real* centres, std::uint64_t seed, Real* x) {
  const auto draw = [&](std::uint64_t k) { return rng::uniform(seed, stream::orientation, k); };
  for (Index m = 0; m < topology.particles(); ++m) {
    const auto k = static_cast<std::uint64_t>(m);
    if (topology.surfaces)
      place_surface(topology, m, point<3>(centres, m), random_rotation(draw(3 * k), draw(3 * k + 1), draw(3 * k + 2)),
                    x);
    else
      place_particle(topology, m, centres + k * static_cast<std::uint64_t>(topology.dim), 2 * pi * draw(k), x);
  }
}

Mat<3> random_rotation(Real u, Real v, Real w) {
  // A uniformly random unit quaternion [K. Shoemake, Graphics Gems III (1992), 124].
  const Real a = std::sqrt(1 - u), b = std::sqrt(u);
  return Eigen::Quaternion<Real>(a * std::sin(2 * pi * v), a * std::cos(2 * pi * v), b * std::sin(2 * pi * w),
                                 b * std::cos(2 * pi * w))
      .toRotationMatrix();
}

}  // namespace pliant
