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
    for (Index m = 0; m < own.owned(); ++m)
      if (own.active[m] && mean_of_points<D>(state.x().data(), own, m)[D - 1] < system.neighbours().skin())
        watched_.push_back(m);
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
void OrificeCounter<D>::save(SharedCheckpoint& c, const Ranks& ranks) const {
  c.add_parts("counted", counted_);
  c.add_parts("outside", outside_);
  c.add_parts("reinserted", reinserted_);
  c.add("crossed", ranks.sum(flow_.crossed));
  c.add("crossed_area", ranks.sum(flow_.area));
}

template <int D>
std::int64_t OrificeCounter<D>::load(const Checkpoint& c, const StoredParticles& stored, const Ranks& ranks,
                                     Real largest) {
  const std::int64_t crossed = c.integer("crossed");
  c.integer("events", crossed, crossed);
  const auto restore = [&](auto& own, const char* name, std::int64_t least, std::int64_t most) {
    const auto values = stored.particles(name, least, most);
    own.assign(values.begin(), values.end());
  };
  restore(counted_, "counted", 0, 1);
  restore(outside_, "outside", 0, 1);
  restore(reinserted_, "reinserted", 0, crossed);
  const Real crossed_area = c.real("crossed_area", 0, static_cast<Real>(crossed) * largest * (1 + 1e-9));
  if (ranks.root()) flow_ = {crossed, crossed_area};
  return crossed;
}

template class OrificeCounter<2>;
template class OrificeCounter<3>;

}  // namespace pliant
