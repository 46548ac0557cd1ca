// Where disks in a channel start.
#pragma once

#include <cstdint>
#include <vector>

#include <pliant/scenarios/channel/channel_shape.h>
#include <pliant/setup/packing.h>

namespace pliant {

struct ChannelStart {
  std::vector<Real> x;  ///< [disks · 2]
  std::int64_t iterations = 0;
  Real max_overlap = 0;  ///< as of Packing
};

/// Random points of the channel, at which disks lie on top of each other, pushed apart until no overlap is larger than
/// the tolerance. walls: with the plungers at rest. Errors: NumericalError where they do not fit.
ChannelStart random_start(const Topology& disks, const Channel& channel, const Walls<2>& walls, Real tolerance,
                          std::uint64_t seed);

}  // namespace pliant
