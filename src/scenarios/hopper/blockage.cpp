#include <pliant/scenarios/hopper/blockage.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <pliant/analysis/graph.h>
#include <pliant/geometry/distance.h>
#include <pliant/run/frame_data.h>

namespace pliant {
namespace {

/// Whether particle m touches a wall: one of its points does, or an edge touches an end of the wall.
template <int D>
bool touches(const StateView<D>& s, Index m, Index wall) {
  const Topology& topology = s.topology;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
    const Real radius = topology.diameter[i] / 2;
    if (s.walls.distance(s.position(i), wall, s.t) < radius) return true;
    if constexpr (D == 2)
      if (topology.deformable()) {
        const WallSegment& segment = s.walls.segments()[wall];
        const Vec<2> a = s.position(i), b = s.position(topology.next[i]);
        const auto meets = [&](const Vec<2>& end) {
          return std::sqrt(segment_foot(end, a, b).d2) < radius + segment.radius;
        };
        if (meets(segment.origin) || (std::isfinite(segment.length) && meets(segment.end()))) return true;
      }
  }
  return false;
}

}  // namespace

template <int D>
bool arch_over_orifice(ParticleSystem<D>& system, const State& state, const Container& container) {
  const Topology& topology = system.topology();
  const Ranks& ranks = system.ranks();
  const StateView<D> view = system.view(state.x().data(), state.v().data());
  Centres<D> centres;
  centres.update(topology, state);

  Index particles = 0;
  for (const Index id : topology.id) particles = std::max(particles, id + 1);
  particles = static_cast<Index>(ranks.max(Real(particles)));
  const std::vector<Index> bodies = container.bodies(D);
  // Particles by their numbers, then left wall, right wall and obstacles.
  std::vector<std::array<Index, 2>> links;
  system.field().for_each_contact(view, [&](const Contact<D>& c) {
    links.push_back({topology.id[c.first], topology.id[c.second]});
  });
  std::vector<Index> over;  // particles over the middle of the orifice
  Real largest = 0;
  for (const Real sigma : topology.sigma) largest = std::max(largest, sigma);
  const Real middle = std::min(container.orifice() / 2, ranks.max(largest));
  for (Index m = 0; m < topology.owned(); ++m) {
    if (!topology.active[m]) continue;
    for (std::size_t wall = 0; wall < bodies.size(); ++wall)
      if (touches<D>(view, m, static_cast<Index>(wall))) links.push_back({topology.id[m], particles + bodies[wall]});
    const Vec<D> centre = point<D>(centres.position.data(), m);
    if (D == 3 && centre[D - 1] > 0 && in_plane<D>(centre)[0] < middle) over.push_back(topology.id[m]);
  }
  links = ranks.all_gather(links);
  over = ranks.all_gather(over);

  const Index left = particles, right = particles + 1;
  const Index nodes = particles + 1 + *std::max_element(bodies.begin(), bodies.end());
  const std::vector<Index> distance =
      links_from({D == 2 ? left : right}, make_graph(std::max(nodes, right + 1), links));
  if constexpr (D == 2) return distance[right] >= 0;
  return std::ranges::any_of(over, [&](Index id) { return distance[id] >= 0; });
}

template bool arch_over_orifice<2>(ParticleSystem<2>&, const State&, const Container&);
template bool arch_over_orifice<3>(ParticleSystem<3>&, const State&, const Container&);

}  // namespace pliant
