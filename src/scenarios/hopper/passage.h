// Checks that particles have not passed through walls, before particles are counted or measured.
#pragma once

#include <optional>
#include <span>

#include <pliant/geometry/container.h>
#include <pliant/model/topology.h>

namespace pliant {

/// A particle in a hopper. x [points · D].
template <int D>
struct Passage {
  const Real* x;
  const Topology& topology;
  const Container& container;
  const Walls<D>& walls;

  /// Whether walls have been pierced: the outline of polygon m meets a wall, or, of a sphere, the centre is above the
  /// orifice line and not in the container. Of a particle that is `outside`, which may be anywhere there, behind the
  /// walls too, it is in the container.
  bool through_wall(Index m, bool outside = false) const;

  /// Whether particle m, which has crossed the orifice line at `place`, went through the orifice: the place is within
  /// the orifice; for a polygon, the outline meets the orifice and no wall.
  bool through_orifice(Index m, std::span<const Real, D> place) const;
};

}  // namespace pliant
