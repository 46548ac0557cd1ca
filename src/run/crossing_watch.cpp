#include <pliant/run/crossing_watch.h>

#include <fmt/format.h>

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

/// What is seen, vertices inside polygons as deep as they can be among it.
OutlineLook look_everywhere(const StateView<2>& s, const LeastDistances& least, Real deepest) {
  OutlineLook seen = look_at_outlines(s, least);
  if (deepest >= seen.depth) seen.crossing = search_all(s);
  return seen;
}

void check(const OutlineLook& seen, const Topology& topology, const LeastDistances& least, Real dt) {
  const auto named = [&](Index vertex) {
    const Index m = topology.particle[vertex];
    return fmt::format("vertex {} of particle {}", vertex - topology.offset[m], topology.id[m]);
  };
  if (seen.crossing)
    throw NumericalError("{} has crossed the outline of particle {}; a smaller -dt or a larger -e_c keeps it out{}",
                         named(seen.crossing->vertex), topology.id[seen.crossing->other],
                         dt > 0 ? "" : ", or -contact_law barrier");
  if (!seen.closest) return;
  const bool wall = seen.closest->other < 0;
  throw NumericalError(
      "{} has come to {:.3f} of the contact distance of {}, where the barrier is too stiff for the step; use -dt "
      "{:.2g} "
      "or less, or a larger {}",
      named(seen.closest->vertex), seen.closest->distance,
      wall ? "a wall" : fmt::format("particle {}", topology.id[seen.closest->other]),
      dt * seen.closest->distance / (wall ? least.walls : least.outlines) / 2, wall ? "-e_w" : "-e_c");
}

}  // namespace

Real CrossingWatch::farthest_from_reference(const ParticleSystem<2>& system, const Real* x) const {
  return system.ranks().max(farthest<2>(reference_.size() / 2, x, reference_.data()));
}

void CrossingWatch::after_step(ParticleSystem<2>& system, const State& s) {
  if (2 * system.path() < gap_) return;
  const Real moved = farthest_from_reference(system, s.x().data());
  if (2 * moved < gap_)
    system.start_path(moved);
  else
    look(system, s, 2 * moved - gap_);  // the vertices were outside at the last look
}

bool CrossingWatch::admits(ParticleSystem<2>& system, const Real* x) const {
  const Real moved = farthest_from_reference(system, x);
  if (2 * moved < gap_) return true;
  if (!(moved < 1)) return false;
  const StateView<2> view = system.view(x, nullptr);
  bool crossed = false;
  system.ranks().together([&] { crossed = look_everywhere(view, {}, 2 * moved - gap_).crossing.has_value(); });
  return !system.ranks().any(crossed);
}

void CrossingWatch::look(ParticleSystem<2>& system, const State& s, Real deepest) {
  const StateView<2> view = system.view(s.x().data(), s.v().data(), s.t);
  system.ranks().together([&] {
    const OutlineLook seen = look_everywhere(view, least_, deepest);
    check(seen, system.topology(), least_, dt_);
    gap_ = seen.gap;
  });
  gap_ = system.ranks().min(gap_);
  reference_.assign(s.x().begin(), s.x().end());
  system.start_path();
}

}  // namespace pliant
