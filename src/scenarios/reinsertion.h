// Puts a particle that has left the hopper back at its upstream end [H 2.4].
#pragma once

#include <cstdint>

#include <pliant/geometry/hopper.h>
#include <pliant/model/state.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Moves particle m, as it is shaped now, to a uniformly random lateral position, lowered until it touches the first
/// particle above the orifice line, and gives all its points the velocity of that particle. Random numbers depend on
/// (seed, m, count) only. smooth: outlines are circulo-lines; otherwise points are disks. Errors: NumericalError if
/// there is no particle to put it on.
template <int D>
void reinsert(const Topology& topology, const Hopper& hopper, const Walls<D>& walls, bool smooth, std::uint64_t seed,
              Index m, std::uint64_t count, State& state);

}  // namespace pliant
