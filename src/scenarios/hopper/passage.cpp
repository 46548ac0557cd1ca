#include <pliant/scenarios/hopper/passage.h>

#include <algorithm>
#include <cmath>

#include <pliant/model/polygon.h>

namespace pliant {
namespace {

template <int D>
Real distance_from_axis(const Real* r) {
  return D == 2 ? std::abs(r[0]) : std::hypot(r[0], r[1]);
}

}  // namespace

bool outline_meets(const Real* x, const Topology& topology, Index m, const WallSegment& wall) {
  Real reach = 0;  // a wall without end counts as far up as the polygon
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    reach = std::max(reach, (point<2>(x, i) - wall.origin).dot(wall.direction));
  const Vec<2> end = wall.origin + std::min(reach, wall.length) * wall.direction;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    if (segments_meet(point<2>(x, i), point<2>(x, topology.next[i]), wall.origin, end)) return true;
  return false;
}

template <int D>
bool Passage<D>::outside(const Real* r) const {
  return r[D - 1] > 0 && distance_from_axis<D>(r) > hopper.half_width(r[D - 1]);
}

template <int D>
bool Passage<D>::through_wall(Index m) const {
  const auto& segments = walls.segments();
  if (D == 2 && topology.deformable() && lip_edges)
    return std::any_of(segments.begin(), segments.end(),
                       [&](const WallSegment& wall) { return outline_meets(x, topology, m, wall); });
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i)
    if (outside(x + static_cast<std::size_t>(i) * D)) return true;
  return false;
}

template <int D>
bool Passage<D>::through_orifice(Index m, std::span<const Real, D> place) const {
  if (D == 3 || !topology.deformable()) return distance_from_axis<D>(place.data()) <= hopper.orifice / 2;
  const auto orifice = WallSegment::between({-hopper.orifice / 2, 0}, {hopper.orifice / 2, 0});
  return outline_meets(x, topology, m, orifice) && !(lip_edges && through_wall(m));
}

template struct Passage<2>;
template struct Passage<3>;

}  // namespace pliant
