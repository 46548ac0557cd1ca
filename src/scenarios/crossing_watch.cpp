#include <pliant/scenarios/crossing_watch.h>

#include <algorithm>

#include <pliant/kernels/verlet.h>
#include <pliant/model/crossing.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

/// Vertices inside polygons, however deep.
std::optional<Crossing> search_all(const StateView<2>& s) {
  // A point inside an outline of length L is at most L/2π from it: a disk of that radius fits in.
  Real longest = 0;
  for (Index m = 0; m < s.topology.particles(); ++m) longest = std::max(longest, polygon_perimeter(s.x, s.topology, m));
  Neighbours<2> neighbours({.vertex_edges = true}, longest / (2 * pi));
  neighbours.rebuild(s.topology, s.walls, s.x);
  return find_crossing({s.x, nullptr, s.topology, neighbours, s.walls});
}

}  // namespace

void CrossingWatch::after_step(ParticleSystem<2>& system, const State& s) {
  if (2 * system.path() < gap_) return;
  const Real moved = system.ranks().max(farthest<2>(reference_.size() / 2, s.x().data(), reference_.data()));
  if (2 * moved < gap_)
    system.start_path(moved);
  else
    look(system, s, 2 * moved - gap_);  // the vertices were outside at the last look
}

void CrossingWatch::look(ParticleSystem<2>& system, const State& s, Real deepest) {
  const StateView<2> view = system.view(s.x().data(), s.v().data(), s.t);
  const Topology& topology = system.topology();
  system.ranks().together([&] {
    OutlineLook seen = look_at_outlines(view);
    if (deepest >= seen.depth) seen.crossing = search_all(view);
    if (seen.crossing)
      throw NumericalError(
          "vertex {} of particle {} has crossed the outline of particle {}; a smaller -dt or a larger -e_c keeps it "
          "out",
          seen.crossing->vertex - topology.offset[seen.crossing->particle], topology.id[seen.crossing->particle],
          topology.id[seen.crossing->other]);
    gap_ = seen.gap;
  });
  gap_ = system.ranks().min(gap_);
  reference_.assign(s.x().begin(), s.x().end());
  system.start_path();
}

}  // namespace pliant
