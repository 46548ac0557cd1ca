#include <pliant/run/overlap_check.h>

#include <algorithm>

#include <pliant/base/errors.h>

namespace pliant {

template <int D>
Real check_walls_hold(const StateView<D>& s, Real dt, const Ranks& ranks, const std::string& cure) {
  const Topology& topology = s.topology;
  Real largest = 0;
  ranks.together([&] {
    for (const auto& [i, part] : s.neighbours.walls) {
      const Real d = s.walls.distance(s.position(i), part, s.t), radius = topology.diameter[i] / 2;
      if (d < 0)
        throw NumericalError("particle {} went through wall {}: it overlaps by {:.3g} radii; {}",
                             topology.id[topology.particle[i]], s.walls.wall_of_part(part), 1 - d / radius, cure);
      largest = std::max(largest, 1 - d / radius);
    }
    for (Index i = 0; i < topology.owned_points(); ++i) {
      const Index m = topology.particle[i];
      const Real way = s.velocity(i).norm() * dt, radius = topology.sigma[m] / 2;
      if (topology.active[m] != 0 && way > radius)
        throw NumericalError("particle {} moves by {:.3g} radii in a step: contacts may be missed; {}", topology.id[m],
                             way / radius, cure);
    }
  });
  return ranks.max(largest);
}

template Real check_walls_hold<2>(const StateView<2>&, Real, const Ranks&, const std::string&);
template Real check_walls_hold<3>(const StateView<3>&, Real, const Ranks&, const std::string&);

}  // namespace pliant
