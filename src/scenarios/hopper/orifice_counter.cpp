#include <pliant/scenarios/hopper/orifice_counter.h>

#include <algorithm>

#include <pliant/model/polygon.h>

namespace pliant {

template <int D>
void OrificeCounter<D>::reset(Index owned) {
  const auto n = static_cast<std::size_t>(owned);
  counted_.assign(n, 0);
  outside_.assign(n, 0);
  reinserted_.assign(n, 0);
  seen_.assign(n, {});
}

template <int D>
void OrificeCounter<D>::start(const State& state, const Topology& topology) {
  for (Index m = 0; m < topology.owned(); ++m) seen_[m] = sight(state, topology, m);
}

template <int D>
void OrificeCounter<D>::move(const Migration& migration) {
  migration.move(counted_);
  migration.move(outside_);
  migration.move(reinserted_);
  migration.move(seen_);
}

template <int D>
Sighting<D> OrificeCounter<D>::sight(const State& state, const Topology& topology, Index m) {
  Sighting<D> now{state.t, {}, {}};
  const Vec<D> x = mean_of_points<D>(state.x().data(), topology, m),
               v = mean_of_points<D>(state.v().data(), topology, m);
  std::copy(x.begin(), x.end(), now.x.begin());
  std::copy(v.begin(), v.end(), now.v.begin());
  return now;
}

template <int D>
void OrificeCounter<D>::count(Index m, const OrificeCrossing<D>& crossing, const Topology& topology) {
  ++flow_.crossed;
  flow_.area += topology.a0[m];
  crossings_.push_back(crossing);
}

template <int D>
typename OrificeCounter<D>::Event OrificeCounter<D>::follow(const State& state, const ParticleSystem<D>& system,
                                                            const Container& container, int rank) {
  const Topology& own = system.topology();
  if (system.neighbours().rebuilds() != watched_since_) {
    watched_since_ = system.neighbours().rebuilds();
    watched_.clear();
    const Real skin = system.neighbours().skin();
    for (Index m = 0; m < own.owned(); ++m) {
      const Real height = mean_of_points<D>(state.x().data(), own, m)[D - 1];
      if (own.active[m] && (std::abs(height) < skin || height < skin - depth_)) watched_.push_back(m);
    }
  }
  const Passage<D> passage{state.x().data(), own, container, system.walls()};
  Event event;
  for (const Index m : watched_) {
    const Sighting<D> now = sight(state, own, m);
    const Real height = now.x[D - 1];
    const bool below = height < 0;
    // A particle that is outside may rise behind the walls, and fall from there.
    const bool stays_outside = outside_[m] && (below || !container.inside(D, in_plane<D>(point<D>(now.x.data(), 0))));
    if (below != (seen_[m].x[D - 1] < 0) && !stays_outside) {
      const OrificeCrossing<D> crossing{own.id[m], below ? on_the_line(seen_[m], now) : now};
      if (!passage.through_orifice(m, crossing.at.x)) {
        event.astray = crossing;
      } else {
        outside_[m] = below;
        if (below && !counted_[m] && counting_ == Counting::crossing) {
          counted_[m] = 1;
          count(m, crossing, own);
        }
      }
    }
    seen_[m] = now;
    if (height < -depth_ && own.active[m]) {
      if (counting_ == Counting::removal) count(m, {own.id[m], now}, own);
      event.leaving.push_back({own.id[m], rank, m, reinserted_[m]});
    }
  }
  return event;
}

template <int D>
void OrificeCounter<D>::reinserted(Index m, const State& state, const Topology& topology) {
  seen_[m] = sight(state, topology, m);
  counted_[m] = 0;
  outside_[m] = 0;
  ++reinserted_[m];
}

template <int D>
std::int64_t OrificeCounter<D>::visit(Archive& a, const Ranks& ranks, Real largest) {
  FlowCount all{ranks.sum(flow_.crossed), ranks.sum(flow_.area)};
  a.number("crossed", all.crossed);
  a.number("crossed_area", all.area, 0, static_cast<Real>(all.crossed) * largest * (1 + 1e-9));
  a.per_particle("counted", counted_, 0, 1);
  a.per_particle("outside", outside_, 0, 1);
  a.per_particle("reinserted", reinserted_, 0, all.crossed);
  if (a.reads()) {
    a.from().integer("events", all.crossed, all.crossed);
    if (ranks.root()) flow_ = all;
  }
  return all.crossed;
}

template class OrificeCounter<2>;
template class OrificeCounter<3>;

}  // namespace pliant
