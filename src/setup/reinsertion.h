// Reinserts a particle that has left its container at the upstream end [H 2.4].
#pragma once

#include <cstdint>
#include <optional>

#include <pliant/base/ranks.h>
#include <pliant/geometry/container.h>
#include <pliant/model/state.h>
#include <pliant/model/topology.h>

namespace pliant {

/// A particle that has left. Plain data, to be sent.
struct Leaving {
  Index id;
  int rank;            ///< its owner
  Index particle;      ///< its place there
  std::int64_t count;  ///< how often it has been reinserted before
};

/// Rule of reinsertion.
struct Reinsertion {
  Real gap = 0;  ///< height above the place of first contact, in σ_avg
  /// Largest lateral velocity, uniformly random, in each direction; without it the velocity of the particle below.
  std::optional<Real> lateral_speed = {};
  Real clearance = 0;  ///< from walls, in σ_avg
};

/// Moves the particle, as it is shaped now, to a uniformly random lateral position, lowered until it touches the first
/// particle above the orifice line, and gives all its points the velocity of that particle unless the rule sets
/// another. There must be no walls on the way down. Random numbers depend on (seed, id, count) only. smooth: outlines
/// are circulo-lines, and faces and edges of surfaces touch; otherwise points are disks, or spheres. The particle stays
/// on its rank. Collective. Errors: NumericalError if there is no particle to place it on.
template <int D>
void reinsert(const Ranks& ranks, const Topology& topology, const Container& container, const Walls<D>& walls,
              bool smooth, std::uint64_t seed, const Leaving& leaving, State& state, const Reinsertion& rule = {});

}  // namespace pliant
