#include <petscsys.h>
#include <catch2/catch.hpp>

#include <pliant/domain/migration.h>

#include "support/rows.h"

namespace pliant::test::migration_test {

namespace {

/// This rank's particles out of a configuration that all ranks share: every size()-th, in random order. All data of a
/// particle follow from its id.
template <int D>
struct Share {
  const Configuration<D>& all;
  Topology topology;
  State state;
  std::vector<std::int64_t> payload;
  std::vector<std::array<Real, 2>> tags;

  Share(const Configuration<D>& c, const Ranks& ranks, Random& random) : all(c) {
    std::vector<Index> which;
    for (const Index m : random_order(random, c.topology.particles()))
      if (m % ranks.size() == ranks.rank()) which.push_back(m);
    topology = c.topology.select(which);
    std::vector<Real> x, v, a;
    for (const Index m : which) {
      for (Index k = c.topology.offset[m] * D; k < c.topology.offset[m + 1] * D; ++k) {
        x.push_back(c.x[k]);
        v.push_back(c.v[k]);
        a.push_back(10 * c.x[k]);
      }
      payload.push_back(7 * m);
      tags.push_back({Real(m), 0.5});
    }
    state.t = 3.5;
    state.step = 12;
    state.assign(x, v);
  }

  void migrate(const Migration& migration) {
    migration.move(topology);
    migration.move(state, {D});
    migration.move(payload);
    migration.move(tags);
  }

  /// Counts values that do not belong to their particle's id.
  void check() const {
    const Topology &t = topology, &from = all.topology;
    REQUIRE(t.ghosts == 0);
    REQUIRE(t.particles() == static_cast<Index>(t.id.size()));
    REQUIRE(state.size() == static_cast<std::size_t>(t.points()) * D);
    REQUIRE(payload.size() == t.id.size());
    REQUIRE(tags.size() == t.id.size());
    CHECK(state.t == 3.5);
    CHECK(state.step == 12);
    int wrong = 0;
    for (Index m = 0; m < t.particles(); ++m) {
      const Index origin = t.id[m];
      wrong += t.points_of(m) != from.points_of(origin) || t.sigma[m] != from.sigma[origin] ||
               t.a0[m] != from.a0[origin] || t.l0[m] != from.l0[origin] || t.active[m] != from.active[origin] ||
               payload[m] != 7 * origin || tags[m][0] != origin;
      for (Index k = 0; k < t.points_of(m); ++k) {
        const Index i = t.offset[m] + k, j = from.offset[origin] + k;
        wrong += t.particle[i] != m || t.diameter[i] != from.diameter[j] || t.mass(i) != from.mass(j) ||
                 t.inertia[m] != from.inertia[origin] || t.inverse_mass(i) != from.inverse_mass(j) ||
                 t.next[i] - t.offset[m] != from.next[j] - from.offset[origin] ||
                 t.previous[i] - t.offset[m] != from.previous[j] - from.offset[origin];
        for (int d = 0; d < D; ++d)
          wrong += state.x()[i * D + d] != all.x[j * D + d] || state.v()[i * D + d] != all.v[j * D + d];
      }
    }
    CHECK(wrong == 0);
  }

  /// All ranks' ids.
  std::vector<Index> ids(const Ranks& ranks) const {
    std::vector<Index> ids = ranks.all_gather(topology.id);
    std::sort(ids.begin(), ids.end());
    return ids;
  }
};

/// Mean distance of the centres of particles that follow each other.
template <int D>
Real mean_step(const Topology& topology, const State& state) {
  Real sum = 0;
  for (Index m = 1; m < topology.particles(); ++m)
    sum += (mean_of_points<D>(state.x().data(), topology, m) - mean_of_points<D>(state.x().data(), topology, m - 1))
               .norm();
  return sum / (topology.particles() - 1);
}

template <int D>
void check_sorting(const Ranks& ranks, Random& random, Configuration<D> c) {
  for (int k = 0; k < 9; ++k) c.topology.deactivate(random.below(c.topology.particles()));
  Share<D> share(c, ranks, random);
  share.check();
  const std::vector<Index> before = share.ids(ranks);
  CHECK(mean_step<D>(share.topology, share.state) > 4);
  share.migrate(plan_migration<D>(ranks, share.topology, share.state.x().data()));
  share.check();
  CHECK(share.ids(ranks) == before);
  CHECK(mean_step<D>(share.topology, share.state) < 1.7);  // particles are 1 apart
  // Sorted already: nothing changes.
  const std::vector<Index> order = share.topology.id;
  share.migrate(plan_migration<D>(ranks, share.topology, share.state.x().data()));
  share.check();
  CHECK(share.topology.id == order);
}

}  // namespace

TEST_CASE("particles are sorted in space with all that belongs to them", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  Random random(1);
  check_sorting(ranks, random, soft_rows<2>(random, 30, 30));
  check_sorting(ranks, random, soft_rows<3>(random, 11, 11));
  check_sorting(ranks, random, polygon_rows(random, 18, 18));
}

TEST_CASE("particles go where they are sent, sorted by key and then by id", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  Random random(2);
  const Configuration<2> c = polygon_rows(random, 8, 8);
  Share<2> share(c, ranks, random);
  const std::vector<Index> before = share.ids(ranks);
  for (int round = 0; round < 4; ++round) {
    // In the last round all particles move to one rank.
    const auto target = [&](Index id) { return round == 3 ? ranks.size() - 1 : (id / 3 + round) % ranks.size(); };
    const auto key_of = [&](Index id) { return static_cast<std::uint64_t>((id * 5 + round) % 11); };
    // Present ghosts are removed.
    for (Index k = 0; k < round; ++k) share.topology.add_ghost(1000 + k, 5, 0.1, 1, 1, 0.2, 1, 0);
    std::vector<int> destination;
    std::vector<std::uint64_t> key;
    for (Index m = 0; m < share.topology.owned(); ++m) {
      destination.push_back(target(share.topology.id[m]));
      key.push_back(key_of(share.topology.id[m]));
    }
    share.migrate(Migration(ranks, share.topology, destination, key));
    share.check();
    CHECK(share.ids(ranks) == before);
    const std::vector<Index>& id = share.topology.id;
    for (std::size_t m = 0; m < id.size(); ++m) {
      CHECK(target(id[m]) == ranks.rank());
      if (m > 0) CHECK(std::pair(key_of(id[m - 1]), id[m - 1]) < std::pair(key_of(id[m]), id[m]));
    }
  }
}

TEST_CASE("a migration of nothing, and of particles in one place", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  Random random(3);
  Configuration<2> none;
  Share<2> empty(none, ranks, random);
  empty.migrate(plan_migration<2>(ranks, empty.topology, empty.state.x().data()));
  empty.check();
  Configuration<2> heap;
  for (int k = 0; k < 10; ++k) heap.add_soft(1, {0.5, -2});
  Share<2> share(heap, ranks, random);
  const std::vector<Index> before = share.ids(ranks);
  share.migrate(plan_migration<2>(ranks, share.topology, share.state.x().data()));
  share.check();
  CHECK(share.ids(ranks) == before);
}

}  // namespace pliant::test::migration_test
