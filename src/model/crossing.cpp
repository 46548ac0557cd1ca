#include <pliant/model/crossing.h>

#include <pliant/model/polygon.h>

namespace pliant {

std::optional<Crossing> find_crossing(const StateView<2>& s) {
  const Topology& topology = s.topology;
  std::optional<Crossing> found;
  const auto test = [&](Index vertex, Index other) {
    if (found && found->vertex <= vertex) return;
    if (inside_polygon(s.x, topology, other, s.position(vertex))) found = {vertex, topology.particle[vertex], other};
  };
  for (const auto [i, j] : s.neighbours.point_pairs) {
    test(i, topology.particle[j]);
    test(j, topology.particle[i]);
  }
  for (const auto [vertex, edge] : s.neighbours.vertex_edges) test(vertex, topology.particle[edge]);
  return found;
}

}  // namespace pliant
