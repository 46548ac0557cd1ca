#include <pliant/scenarios/reinsertion.h>

#include <cmath>
#include <limits>

#include <pliant/base/rng.h>
#include <pliant/model/polygon.h>
#include <pliant/scenarios/streams.h>

namespace pliant {
namespace {

/// Farthest point of particle m from its centre, and half its diameter.
template <int D>
Real reach(const Topology& topology, const Real* x, Index m, const Vec<D>& centre) {
  Real far2 = 0;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    far2 = std::max(far2, (point<D>(x, i) - centre).squaredNorm());
  return std::sqrt(far2) + topology.diameter[topology.offset[m]] / 2;
}

/// Distance between the rims of two polygons, the first shifted by `shift`; negative where they overlap.
Real gap(const Topology& topology, const Real* x, Index m, const Vec<2>& shift, Index n, bool smooth) {
  const auto edge = [&](Index i) { return std::pair<Vec<2>, Vec<2>>(point<2>(x, i), point<2>(x, topology.next[i])); };
  Real least2 = std::numeric_limits<Real>::infinity();
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
    const Vec<2> r = point<2>(x, i) + shift;
    for (Index j = topology.offset[n]; j < topology.offset[n + 1]; ++j) {
      if (!smooth) {
        least2 = std::min(least2, (r - point<2>(x, j)).squaredNorm());
        continue;
      }
      const auto [a, b] = edge(j);
      least2 = std::min(least2, segment_foot(r, a, b).d2);
      const auto [c, d] = edge(i);
      least2 = std::min(least2, segment_foot(a, c + shift, d + shift).d2);
    }
  }
  return std::sqrt(least2) - (topology.diameter[topology.offset[m]] + topology.diameter[topology.offset[n]]) / 2;
}

template <int D>
Vec<D> random_lateral(Real radius, std::uint64_t seed, Index m, std::uint64_t draw) {
  const auto next = [&](std::uint64_t k) {
    return rng::uniform(seed, stream::reinsertion, (static_cast<std::uint64_t>(m) << 40) + 2 * draw + k);
  };
  Vec<D> r = Vec<D>::Zero();
  if constexpr (D == 2) {
    r[0] = radius * (2 * next(0) - 1);
  } else {
    const Real rho = radius * std::sqrt(next(0)), phi = 2 * pi * next(1);
    r[0] = rho * std::cos(phi);
    r[1] = rho * std::sin(phi);
  }
  return r;
}

}  // namespace

template <int D>
void reinsert(const Topology& topology, const Hopper& hopper, const Walls<D>& walls, bool smooth, std::uint64_t seed,
              Index m, std::uint64_t count, State& state) {
  constexpr int up = D - 1;
  constexpr std::uint64_t attempts = 64;
  Real* x = state.x().data();
  Real* v = state.v().data();
  const Vec<D> centre = mean_of_points<D>(x, topology, m);
  const Real radius = reach<D>(topology, x, m, centre);

  struct Candidate {
    Index particle;
    Vec<D> centre;
    Real radius;
  };
  std::vector<Candidate> bulk;
  for (Index n = 0; n < topology.particles(); ++n) {
    if (n == m || !topology.active[n]) continue;
    const Vec<D> r = mean_of_points<D>(x, topology, n);
    if (r[up] > 0) bulk.push_back({n, r, reach<D>(topology, x, n, r)});
  }

  for (std::uint64_t attempt = 0; attempt < attempts; ++attempt) {
    Vec<D> target = random_lateral<D>(hopper.wall_distance / 2 - radius, seed, m, count * attempts + attempt);
    // Lower the circle around the particle onto the circles around the others.
    Index touched = -1;
    target[up] = 0;
    std::vector<Index> column;
    for (const Candidate& c : bulk) {
      const Vec<D> lateral = c.centre - target;
      const Real d2 = lateral.squaredNorm() - square(lateral[up]), contact2 = square(radius + c.radius);
      if (d2 >= contact2) continue;
      column.push_back(c.particle);
      const Real height = c.centre[up] + std::sqrt(contact2 - d2);
      if (height > target[up]) {
        target[up] = height;
        touched = c.particle;
      }
    }
    if (touched < 0) continue;
    if constexpr (D == 2) {
      if (topology.deformable()) {
        // Polygons have room left inside their circles: go on by the clearance, which never overshoots, until they
        // touch.
        for (int k = 0; k < 200; ++k) {
          Real clearance = std::numeric_limits<Real>::infinity();
          for (const Index n : column) {
            const Real g = gap(topology, x, m, target - centre, n, smooth);
            if (g < clearance) {
              clearance = g;
              touched = n;
            }
          }
          if (clearance < 1e-6 * radius) break;
          target[up] -= clearance;
        }
      }
    }
    bool free = true;
    for (Index s = 0; s < walls.size(); ++s) free = free && walls.distance(target, s) >= radius * (1 - 1e-9);
    if (!free) continue;

    const Vec<D> velocity = mean_of_points<D>(v, topology, touched);
    for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
      point<D>(x, i) += target - centre;
      point<D>(v, i) = velocity;
    }
    return;
  }
  throw NumericalError(
      "no place to put particle {} back after it left the hopper: {} particles are above the orifice; use more "
      "particles (-n), a narrower hopper, or -flow discharge",
      m, bulk.size());
}

template void reinsert<2>(const Topology&, const Hopper&, const Walls<2>&, bool, std::uint64_t, Index, std::uint64_t,
                          State&);
template void reinsert<3>(const Topology&, const Hopper&, const Walls<3>&, bool, std::uint64_t, Index, std::uint64_t,
                          State&);

}  // namespace pliant
