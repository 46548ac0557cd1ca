#include <pliant/setup/reinsertion.h>

#include <array>
#include <cmath>
#include <limits>

#include <pliant/base/cure.h>
#include <pliant/base/rng.h>
#include <pliant/model/polygon.h>
#include <pliant/model/surface.h>
#include <pliant/model/surface_search.h>
#include <pliant/setup/streams.h>

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

/// The points of the particle that is reinserted, at the place where it left.
template <int D>
struct Outline {
  std::vector<Real> x;  ///< [points · D]
  Real diameter;
  const Surface* surface = nullptr;  ///< of a closed surface
  Index size() const { return static_cast<Index>(x.size()) / D; }
};

/// Distance between the rims of two deformable particles, the first shifted by `shift`; negative where they overlap.
template <int D>
Real gap(const Outline<D>& outline, const Vec<D>& shift, const Topology& topology, const Real* x, Index n,
         bool smooth) {
  const Real contact = (outline.diameter + topology.diameter[topology.offset[n]]) / 2;
  if constexpr (D == 3)
    if (smooth)
      return surface_distance(*outline.surface, outline.x.data(), shift, topology.surfaces->of(topology, n),
                              x + 3 * static_cast<std::size_t>(topology.offset[n])) -
             contact;
  Real least2 = std::numeric_limits<Real>::infinity();
  for (Index i = 0; i < outline.size(); ++i) {
    const Vec<D> r = point<D>(outline.x.data(), i) + shift;
    for (Index j = topology.offset[n]; j < topology.offset[n + 1]; ++j) {
      const Vec<D> a = point<D>(x, j);
      least2 = std::min(least2, (r - a).squaredNorm());
      if constexpr (D == 2) {
        if (!smooth) continue;
        const Vec<2> next = point<2>(outline.x.data(), (i + 1) % outline.size()) + shift;
        least2 = std::min(least2, segment_foot(r, a, point<2>(x, topology.next[j])).d2);
        least2 = std::min(least2, segment_foot(a, r, next).d2);
      }
    }
  }
  return std::sqrt(least2) - contact;
}

/// Number k = 0, 1 of a draw for particle m.
Real random_number(std::uint64_t seed, std::uint64_t stream, Index m, std::uint64_t draw, std::uint64_t k) {
  // The counter holds the lower 24 bits of the id.
  const auto id = static_cast<std::uint64_t>(m);
  return rng::uniform(seed, stream + (id >> 24 << 32), (id << 40) + 2 * draw + k);
}

/// A candidate for a circle of this radius about the middle.
template <int D>
Vec<D> random_lateral(Real middle, Real radius, std::uint64_t seed, Index m, std::uint64_t draw) {
  const auto next = [&](std::uint64_t k) { return random_number(seed, stream::reinsertion, m, draw, k); };
  Vec<D> r = Vec<D>::Zero();
  if constexpr (D == 2) {
    r[0] = middle + radius * (2 * next(0) - 1);
  } else {
    const Real rho = radius * std::sqrt(next(0)), phi = 2 * pi * next(1);
    r[0] = rho * std::cos(phi);
    r[1] = rho * std::sin(phi);
  }
  return r;
}

}  // namespace

template <int D>
void reinsert(const Ranks& ranks, const Topology& topology, const Container& container, const Walls<D>& walls,
              bool smooth, std::uint64_t seed, const Leaving& leaving, State& state, const Reinsertion& rule) {
  constexpr int up = D - 1;
  constexpr std::uint64_t attempts = 64;
  Real* x = state.x().data();
  Real* v = state.v().data();
  const bool mine = leaving.rank == ranks.rank();
  const Index m = mine ? leaving.particle : -1;

  struct Shape {
    std::array<Real, D> centre;
    Real radius, diameter;
  } shape{};
  Outline<D> outline;
  if (mine) {
    const Vec<D> r = mean_of_points<D>(x, topology, m);
    std::copy_n(r.data(), D, shape.centre.begin());
    shape.radius = reach<D>(topology, x, m, r);
    shape.diameter = topology.diameter[topology.offset[m]];
    outline.x.assign(x + static_cast<std::size_t>(topology.offset[m]) * D,
                     x + static_cast<std::size_t>(topology.offset[m + 1]) * D);
  }
  shape = ranks.broadcast(shape, leaving.rank);
  ranks.broadcast(outline.x, leaving.rank);
  outline.diameter = shape.diameter;
  if (topology.surfaces) outline.surface = &topology.surfaces->kinds[topology.surfaces->kind[leaving.id]];
  const Vec<D> centre = point<D>(shape.centre.data(), 0);
  const Real radius = shape.radius;

  // Calls visit(n, centre) for each other particle of this rank above the orifice.
  const auto for_each_above = [&](auto&& visit) {
    for (Index n = 0; n < topology.owned(); ++n) {
      if (n == m || !topology.active[n]) continue;
      const Vec<D> r = mean_of_points<D>(x, topology, n);
      if (r[up] > 0) visit(n, r);
    }
  };

  const Vec<2> inflow = container.inflow();
  for (std::uint64_t attempt = 0; attempt < attempts; ++attempt) {
    Vec<D> target = random_lateral<D>(inflow.sum() / 2, container.inflow_width() / 2 - radius - rule.clearance, seed,
                                      leaving.id, static_cast<std::uint64_t>(leaving.count) * attempts + attempt);
    // Lower the circle around the particle onto the circles around the other particles.
    Index touched = -1;
    Real top = 0;
    std::vector<Index> column;
    target[up] = 0;
    for_each_above([&](Index n, const Vec<D>& r) {
      const Vec<D> lateral = r - target;
      const Real d2 = lateral.squaredNorm() - square(lateral[up]),
                 contact2 = square(radius + reach<D>(topology, x, n, r));
      if (d2 >= contact2) return;
      column.push_back(n);
      const Real height = r[up] + std::sqrt(contact2 - d2);
      if (height > top) {
        top = height;
        touched = n;
      }
    });
    target[up] = ranks.max(top);
    if (target[up] <= 0) continue;
    bool first_touch = top == target[up];
    if (outline.size() > 1) {
      // Particles do not fill their circles: advance by the clearance, which never overshoots, until they touch.
      for (int k = 0; k < 200; ++k) {
        Real near = std::numeric_limits<Real>::infinity();
        for (const Index n : column) {
          const Real g = gap<D>(outline, target - centre, topology, x, n, smooth);
          if (g < near) {
            near = g;
            touched = n;
          }
        }
        const Real clearance = ranks.min(near);
        first_touch = near == clearance;
        if (clearance < 1e-6 * radius) break;
        target[up] -= clearance;
      }
    }
    target[up] += rule.gap;
    if (!Container::can_fall_to<D>(walls, target, radius + rule.clearance)) continue;

    const int below = ranks.size() - ranks.max(first_touch ? ranks.size() - ranks.rank() : 0);
    std::array<Real, D> velocity{};
    if (below == ranks.rank()) {
      const Vec<D> mean = mean_of_points<D>(v, topology, touched);
      std::copy_n(mean.data(), D, velocity.begin());
    }
    velocity = ranks.broadcast(velocity, below);
    if (rule.lateral_speed)
      for (int k = 0; k < up; ++k)
        velocity[k] = *rule.lateral_speed *
                      (2 * random_number(seed, stream::lateral_velocity, leaving.id,
                                         static_cast<std::uint64_t>(leaving.count), static_cast<std::uint64_t>(k)) -
                       1);
    if (mine)
      for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
        point<D>(x, i) += target - centre;
        point<D>(v, i) = point<D>(velocity.data(), 0);
      }
    return;
  }
  std::int64_t above = 0;
  for_each_above([&](Index, const Vec<D>&) { ++above; });
  throw NumericalError(
      "no free place to reinsert particle {}: {} particles are above the orifice; use {}", leaving.id, ranks.sum(above),
      cures({Cure::more_particles, Cure::narrower_orifice, Cure::wider_obstacles, Cure::no_reinsertion}));
}

template void reinsert<2>(const Ranks&, const Topology&, const Container&, const Walls<2>&, bool, std::uint64_t,
                          const Leaving&, State&, const Reinsertion&);
template void reinsert<3>(const Ranks&, const Topology&, const Container&, const Walls<3>&, bool, std::uint64_t,
                          const Leaving&, State&, const Reinsertion&);

}  // namespace pliant
