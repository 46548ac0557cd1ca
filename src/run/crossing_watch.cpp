#include <pliant/run/crossing_watch.h>

#include <fmt/format.h>

#include <algorithm>

#include <pliant/base/cure.h>
#include <pliant/kernels/verlet.h>
#include <pliant/model/crossing.h>

namespace pliant {
namespace {

/// For laws that keep vertices out.
std::string cures_of_crossing(const NeighbourNeeds& needs, bool barrier) {
  if (needs.edges == Edges::bare && !needs.vertex_edges)
    return cures({Cure::shorter_step, Cure::stiffer_contacts, Cure::edge_contacts});
  if (needs.edges != Edges::bare && !barrier)
    return cures({Cure::shorter_step, Cure::stiffer_contacts, Cure::contact_barrier});
  return cures({Cure::shorter_step, Cure::stiffer_contacts});
}

void check(const OutlineLook& seen, const StateView<2>& s, const LeastDistances& least, Real dt) {
  const Topology& topology = s.topology;
  const auto named = [&](Index vertex) {
    const Index m = topology.particle[vertex];
    return fmt::format("vertex {} of particle {}", vertex - topology.offset[m], topology.id[m]);
  };
  if (seen.crossing)
    throw NumericalError("{} has crossed the outline of particle {}; use {}", named(seen.crossing->vertex),
                         topology.id[seen.crossing->other], cures_of_crossing(s.neighbours.needs(), dt > 0));
  if (!seen.closest) return;
  const bool wall = seen.closest->other < 0;
  throw NumericalError(
      "{} has come to {:.3f} of the contact distance of {}, where the barrier is too stiff for the step; use {} of "
      "at most {:.2g}, or {}",
      named(seen.closest->vertex), seen.closest->distance,
      wall ? "a wall" : fmt::format("particle {}", topology.id[seen.closest->other]), cures({Cure::shorter_step}),
      dt * seen.closest->distance / (wall ? least.walls : least.outlines) / 2,
      cures({wall ? Cure::stiffer_walls : Cure::stiffer_contacts}));
}

void check(const SelfLook& seen, const Topology& topology, const std::string& cure) {
  if (!seen.crossing) return;
  const auto [m, edges] = *seen.crossing;
  const Index n = topology.points_of(m);
  const std::string what =
      edges ? fmt::format("crosses itself: its edge from vertex {} to {} meets its edge from vertex {} to {}",
                          edges->first, (edges->first + 1) % n, edges->second, (edges->second + 1) % n)
            : fmt::format("has turned inside out: its {} vertices run clockwise", n);
  throw NumericalError("particle {} {}; {}", topology.id[m], what, cure);
}

/// Whether an owned polygon meets a wall, or has passed through one in a single move since it was at `before` [own
/// points · 2].
bool through_wall(const StateView<2>& s, const Real* before) {
  const Topology& topology = s.topology;
  for (Index m = 0; m < topology.owned(); ++m) {
    if (topology.active[m] == 0) continue;
    const Index i = topology.offset[m];
    if (outline_meets(s.x, topology, m, s.walls, s.t) || meets(point<2>(before, i), s.position(i), s.walls, s.t))
      return true;
  }
  return false;
}

}  // namespace

Real CrossingWatch::farthest_from_reference(const ParticleSystem<2>& system, const Real* x) const {
  return system.ranks().max(farthest<2>(reference_.size() / 2, x, reference_.data()));
}

void CrossingWatch::after_step(ParticleSystem<2>& system, const State& s) {
  if (2 * system.motion().since(MotionSince::outline_check) < gap_) return;
  const Real moved = farthest_from_reference(system, s.x().data());
  if (2 * moved < gap_)
    system.outlines_checked(moved);
  else
    look(system, s, 2 * moved - gap_);  // the vertices were outside at the last check
}

bool CrossingWatch::admits(ParticleSystem<2>& system, const Real* x) const {
  const Real moved = farthest_from_reference(system, x);
  if (2 * moved < gap_) return true;
  if (!(moved < 1)) return false;
  const StateView<2> view = system.view(x, nullptr);
  bool crossed = false;
  system.ranks().together([&] {
    crossed = look_at_outlines(view, {}, 2 * moved - gap_).crossing.has_value() ||
              (self_.refuses_trials && look_at_own_outlines(view).crossing) ||
              (least_.walls >= 0 && through_wall(view, reference_.data()));
  });
  return !system.ranks().any(crossed);
}

void CrossingWatch::look(ParticleSystem<2>& system, const State& s, Real deepest) {
  const StateView<2> view = system.view(s.x().data(), s.v().data(), s.t);
  system.ranks().together([&] {
    const OutlineLook seen = look_at_outlines(view, least_, deepest);
    check(seen, view, least_, dt_);
    gap_ = seen.gap;
    if (!self_.stops && !self_.refuses_trials) return;
    const SelfLook own = look_at_own_outlines(view);
    if (self_.stops) check(own, view.topology, self_.cure);
    gap_ = std::min(gap_, own.gap);
  });
  gap_ = system.ranks().min(gap_);
  reference_.assign(s.x().begin(), s.x().end());
  system.outlines_checked();
}

}  // namespace pliant
