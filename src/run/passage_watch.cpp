#include <pliant/run/passage_watch.h>

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include <pliant/base/cure.h>
#include <pliant/geometry/container.h>
#include <pliant/kernels/verlet.h>
#include <pliant/model/crossing.h>
#include <pliant/run/overlap_check.h>

namespace pliant {
namespace {

std::string cures_of_passage() { return "use " + cures({Cure::stiffer_walls, Cure::shorter_step}); }

}  // namespace

template <int D>
bool PassageWatch<D>::watches_walls(const ParticleSystem<D>& system) const {
  return !ignores_walls_ && system.walls().size() > 0 && system.neighbours().needs().walls;
}

template <int D>
bool PassageWatch<D>::watches_pairs(const ParticleSystem<D>& system) const {
  return !overlaps_allowed_ && !system.topology().deformable() && system.neighbours().needs().point_pairs;
}

template <int D>
Real PassageWatch<D>::look_at_pairs(ParticleSystem<D>& system, const State& s, Real h) {
  const StateView<D> view = system.view(s.x().data(), s.v().data(), s.t);
  const Topology& topology = view.topology;
  Real least = std::numeric_limits<Real>::infinity();  // contact distance
  for (Index i = 0; i < topology.owned_points(); ++i) least = std::min(least, topology.diameter[i]);
  const PassingPair nearest = nearest_passing_pair(view, h);
  if (records_) {
    if (nearest.gap < 0) recorded_ = std::max(recorded_, nearest.overlap);
  } else if (nearest.gap < 0) {
    const auto [first, second] = std::minmax(topology.id[nearest.points.first], topology.id[nearest.points.second]);
    throw NumericalError(
        "particles {} and {} overlap by {:.3g} of their contact distance: they pass through each other; use {}{}",
        first, second, nearest.overlap, cures({Cure::stiffer_contacts, Cure::shorter_step}), advice_);
  }
  return std::min(passing_overlap * least, nearest.gap) / 2;  // pairs that are not listed do not touch
}

template <int D>
void PassageWatch<D>::start(ParticleSystem<D>& system, const State& s) {
  if (!watches_walls(system) && !watches_pairs(system)) return;
  reference_.clear();
  last_t_ = s.t;
  look(system, s, 0, 0);
}

// Another particle cannot pass through it before one of both has moved by half of passing_overlap times the least
// contact distance, which gap_ does not exceed.
template <int D>
void PassageWatch<D>::reinserted(Index m, const State& s) {
  const std::size_t first = static_cast<std::size_t>(m) * D;
  if (first < reference_.size()) std::copy_n(&s.x()[first], D, &reference_[first]);
}

template <int D>
void PassageWatch<D>::after_step(ParticleSystem<D>& system, const State& s) {
  if (!watches_walls(system) && !watches_pairs(system)) return;
  const Real h = inertia_ ? s.t - last_t_ : 0;
  last_t_ = s.t;
  const auto points = static_cast<std::size_t>(system.topology().owned_points());
  const Real* const x = s.x().data();
  Real walls = system.walls().moved(t_, s.t, [&](const Vec<D>& from) {
    Real most = 0;
    for (std::size_t i = 0; i < points; ++i) most = std::max(most, (point<D>(x, static_cast<Index>(i)) - from).norm());
    return most;
  });
  if (system.walls().turn_without_end()) walls = system.ranks().max(walls);
  if (system.motion().since(MotionSince::passage_check) + walls < gap_) return;
  const Real moved = system.ranks().max(farthest<D>(points, x, reference_.data()));
  if (moved + walls < gap_)
    system.passages_checked(moved);
  else
    look(system, s, moved + walls, h);
}

template <int D>
void PassageWatch<D>::look(ParticleSystem<D>& system, const State& s, Real moved, Real h) {
  const Walls<D>& walls = system.walls();
  const Topology& topology = system.topology();
  const Neighbours<D>& lists = system.neighbours();
  const Real* const x = s.x().data();
  const Index points = topology.owned_points();
  Real least = std::numeric_limits<Real>::infinity();  // radius
  for (Index i = 0; i < points; ++i) least = std::min(least, topology.diameter[i] / 2);
  // The lists may be older than the state, and do not hold at once after a change. No pair that they lack is nearer
  // than `listed`; a wall that was crossed is not farther than `moved`.
  const Real listed = least + lists.margin() - 2 * lists.farthest(walls, x, s.t);
  const bool own = !(listed >= std::max(moved, least / 2));
  const Real range = own ? std::max(moved, least) : listed;
  gap_ = range;
  const auto place = [&](const Real* at, Index i, Index part, Real t) {
    return in_plane<D>(walls.pose(walls.body_of_part(part), t).back(point<D>(at, i)));
  };
  const auto test = [&](Index i, Index part) {
    const Index m = topology.particle[i];
    if (topology.active[m] == 0) return;
    const Real d = walls.distance(point<D>(x, i), part, s.t);
    if (d < 0) throw within_wall(topology, i, walls.wall_of_part(part), d, cures_of_passage());
    gap_ = std::min(gap_, d);
    if (d > moved || reference_.empty() || part >= static_cast<Index>(walls.segments().size())) return;
    if (meets(place(reference_.data(), i, part, t_), place(x, i, part, s.t), walls.segments()[part]))
      throw NumericalError(
          "particle {} went through wall {}: its {} crossed the wall between t = {:.6g} and {:.6g}; {}", topology.id[m],
          walls.wall_of_part(part), topology.deformable() ? fmt::format("vertex {}", i - topology.offset[m]) : "centre",
          t_, s.t, cures_of_passage());
  };
  system.ranks().together([&] {
    if (watches_pairs(system)) gap_ = std::min(gap_, look_at_pairs(system, s, h));
    if (!watches_walls(system)) return;
    if (own) {
      std::vector<Index> near;
      for (Index i = 0; i < points; ++i) {
        walls.find_near(point<D>(x, i), range, s.t, near);
        for (const Index part : near) test(i, part);
      }
    } else {
      for (const auto& [i, part] : lists.walls) test(i, part);
    }
  });
  gap_ = system.ranks().min(gap_);
  if (records_) recorded_ = system.ranks().max(recorded_);
  t_ = s.t;
  reference_.assign(x, x + static_cast<std::size_t>(points) * D);
  system.passages_checked();
}

template class PassageWatch<2>;
template class PassageWatch<3>;

}  // namespace pliant
