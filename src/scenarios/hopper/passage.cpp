#include <pliant/scenarios/hopper/passage.h>

#include <algorithm>
#include <cmath>

#include <pliant/model/crossing.h>

namespace pliant {
namespace {

template <int D>
Real distance_from_axis(const Real* r) {
  return D == 2 ? std::abs(r[0]) : std::hypot(r[0], r[1]);
}

}  // namespace

template <int D>
bool Passage<D>::outside(const Real* r) const {
  return r[D - 1] > 0 && distance_from_axis<D>(r) > hopper.half_width(r[D - 1]);
}

template <int D>
bool Passage<D>::through_wall(Index m) const {
  const auto& segments = walls.segments();
  if (D == 2 && topology.deformable())
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
  return outline_meets(x, topology, m, orifice) && !through_wall(m);
}

template struct Passage<2>;
template struct Passage<3>;

}  // namespace pliant
