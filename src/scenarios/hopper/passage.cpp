#include <pliant/scenarios/hopper/passage.h>

#include <cmath>

#include <pliant/model/crossing.h>

namespace pliant {

template <int D>
bool Passage<D>::through_wall(Index m, bool outside) const {
  Index end = topology.offset[m + 1];
  if constexpr (D == 2)
    if (topology.deformable()) {
      if (outline_meets(x, topology, m, walls, 0)) return true;
      if (outside) return false;     // its parts may be on both sides of the orifice line
      end = topology.offset[m] + 1;  // all vertices are on the same side as the first one
    }
  if (topology.surfaces && outside) return false;  // its parts may be on both sides of the orifice line
  for (Index i = topology.offset[m]; i < end; ++i) {
    const Vec<2> place = in_plane<D>(point<D>(x, i));
    if (place[1] > 0 && container.inside(D, place) == outside) return true;
  }
  return false;
}

template <int D>
bool Passage<D>::through_orifice(Index m, std::span<const Real, D> place) const {
  const Real half = container.orifice() / 2;
  if (D == 3 || !topology.deformable()) return std::abs(in_plane<D>(point<D>(place.data(), 0))[0]) <= half;
  return outline_meets(x, topology, m, WallSegment::between({-half, 0}, {half, 0})) && !through_wall(m);
}

template struct Passage<2>;
template struct Passage<3>;

}  // namespace pliant
