#include <pliant/setup/particles.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <pliant/base/errors.h>
#include <pliant/base/rng.h>
#include <pliant/setup/streams.h>

namespace pliant {
namespace {

std::vector<Index> shuffled(Index n, std::uint64_t seed) {
  std::vector<Real> key(n);
  for (Index i = 0; i < n; ++i) key[i] = rng::uniform(seed, stream::size_order, i);
  std::vector<Index> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](Index a, Index b) { return key[a] < key[b] || (key[a] == key[b] && a < b); });
  return order;
}

/// A standard normal number for particle m, drawn again where it is beyond ±3.
Real cut_normal(Index m, std::uint64_t seed) {
  for (std::uint64_t attempt = 0;; ++attempt) {
    const Real z = rng::normal(seed, stream::sizes, (static_cast<std::uint64_t>(m) << 16) + attempt);
    if (std::abs(z) <= 3) return z;
  }
}

Real circumradius(Index n, Real area) { return std::sqrt(2 * area / (n * std::sin(2 * pi / n))); }

}  // namespace

std::vector<Real> draw_diameters(const SizeDistribution& distribution, Index n, std::uint64_t seed) {
  std::vector<Real> sigma(n, 1.0);
  if (distribution.kind == "mono") return sigma;
  if (distribution.kind == "bidisperse") {
    const Real small = 1 / (1 - distribution.fraction + distribution.fraction * distribution.ratio);
    const Index large = static_cast<Index>(std::lround(distribution.fraction * n));
    const std::vector<Index> order = shuffled(n, seed);
    for (Index k = 0; k < n; ++k) sigma[order[k]] = k < large ? distribution.ratio * small : small;
    return sigma;
  }
  if (1 - 3 * distribution.deviation < 0.1)
    throw InputError("-size_deviation {}: diameters down to {} would occur; use at most 0.3", distribution.deviation,
                     1 - 3 * distribution.deviation);
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

Topology make_particles(ModelKind kind, int dim, const std::vector<Real>& diameters, const PolygonShape& shape) {
  Topology topology;
  topology.dim = dim;
  for (const Real sigma : diameters) {
    if (kind == ModelKind::sp || kind == ModelKind::disk) {
      topology.add_soft(sigma, dim == 2 ? pi * square(sigma) / 4 : pi * sigma * square(sigma) / 6);
      continue;
    }
    const Real a0 = pi * square(sigma) / 4;
    const Real parameter = shape.shape_parameter > 0 ? shape.shape_parameter : regular_shape_parameter(shape.vertices);
    const Real l0 = std::sqrt(4 * pi * a0 * parameter) / shape.vertices;
    topology.add_polygon(shape.vertices, a0, l0, kind == ModelKind::rough ? l0 : shape.edge_width * l0, a0);
  }
  return topology;
}

Real outer_radius(const Topology& topology, Index m) {
  const Real half = topology.diameter[topology.offset[m]] / 2;
  return topology.points_of(m) == 1 ? half : circumradius(topology.points_of(m), topology.a0[m]) + half;
}

void place_particle(const Topology& topology, Index m, const Real* centre, Real angle, Real* x) {
  const Index first = topology.offset[m], n = topology.points_of(m);
  const int d = topology.dim;
  if (n == 1) {
    std::copy_n(centre, d, x + static_cast<std::size_t>(first) * d);
    return;
  }
  const Real radius = circumradius(n, topology.a0[m]);
  for (Index k = 0; k < n; ++k) {
    const Real phi = angle + 2 * pi * k / n;
    x[(first + k) * 2] = centre[0] + radius * std::cos(phi);
    x[(first + k) * 2 + 1] = centre[1] + radius * std::sin(phi);
  }
}

}  // namespace pliant
