#include <pliant/run/overlap_check.h>

#include <algorithm>
#include <cmath>

#include <pliant/geometry/distance.h>
#include <pliant/model/crossing.h>

namespace pliant {

template <int D>
PassingPair nearest_passing_pair(const StateView<D>& s, Real h) {
  PassingPair nearest;
  Real fastest2 = 0;
  if (h > 0)
    for (Index i = 0; i < s.topology.points(); ++i) fastest2 = std::max(fastest2, s.velocity(i).squaredNorm());
  const Real way = 2 * h * std::sqrt(fastest2);  // two particles approach by this in the step, at most
  for (const auto& [i, j] : s.neighbours.point_pairs) {
    const Vec<D> r = s.position(i) - s.position(j);
    const Real contact = (s.topology.diameter[i] + s.topology.diameter[j]) / 2, least = (1 - passing_overlap) * contact;
    if (r.squaredNorm() >= square(nearest.gap + least + way)) continue;  // most pairs
    Vec<D> before_step = r;
    if (h > 0) before_step -= h * (s.velocity(i) - s.velocity(j));
    const Real d = std::sqrt(foot_on_segment<D>(Vec<D>::Zero(), before_step, r).d2);
    if (d - least < nearest.gap) nearest = {d - least, {i, j}, 1 - d / contact};
  }
  return nearest;
}

NumericalError within_wall(const Topology& topology, Index i, Index wall, Real d, const std::string& cure) {
  return NumericalError("particle {} went through wall {}: it overlaps by {:.3g} radii; {}",
                        topology.id[topology.particle[i]], wall, 1 - 2 * d / topology.diameter[i], cure);
}

void check_outlines_meet_no_wall(const StateView<2>& s, const Ranks& ranks, const std::string& cure) {
  const Topology& topology = s.topology;
  ranks.together([&] {
    for (Index m = 0; m < topology.owned(); ++m) {
      if (topology.active[m] == 0 || !outline_meets(s.x, topology, m, s.walls, s.t)) continue;
      Index part = 0;
      while (!outline_meets(s.x, topology, m, s.walls.segment(part, s.t))) ++part;
      throw NumericalError("particle {} went through wall {}: the wall crosses its outline; {}", topology.id[m],
                           s.walls.wall_of_part(part), cure);
    }
  });
}

template <int D>
Real check_walls_hold(const StateView<D>& s, Real dt, const Ranks& ranks, const std::string& cure) {
  const Topology& topology = s.topology;
  Real largest = 0;
  ranks.together([&] {
    for (const auto& [i, part] : s.neighbours.walls) {
      const Real d = s.walls.distance(s.position(i), part, s.t), radius = topology.diameter[i] / 2;
      if (d < 0) throw within_wall(topology, i, s.walls.wall_of_part(part), d, cure);
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

template PassingPair nearest_passing_pair<2>(const StateView<2>&, Real);
template PassingPair nearest_passing_pair<3>(const StateView<3>&, Real);
template Real check_walls_hold<2>(const StateView<2>&, Real, const Ranks&, const std::string&);
template Real check_walls_hold<3>(const StateView<3>&, Real, const Ranks&, const std::string&);

}  // namespace pliant
