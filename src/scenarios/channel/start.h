// Where disks in a channel start.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <pliant/model/rest_shape.h>
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

/// Polygons in random places and directions: the disks around them, shrunk until they fit, are pushed apart, and then
/// polygons grow in them to their size, in steps in which no vertex can pass an outline, pushed apart in each. walls,
/// tolerance: as above; outlines: their shapes at rest. Errors: NumericalError where they do not fit, or where one
/// reaches into another or out of the channel.
ChannelStart random_polygon_start(const Topology& polygons, const std::shared_ptr<const RestOutlines>& outlines,
                                  const Channel& channel, const Walls<2>& walls, Real tolerance, std::uint64_t seed);

}  // namespace pliant
