// Ghosts compared with a reference: in these tests all ranks have all particles.
#include <petscsys.h>
#include <catch2/catch.hpp>

#include <map>

#include <pliant/domain/halo.h>
#include <pliant/domain/migration.h>

#include "support/rows.h"

namespace pliant::test::halo_test {

namespace {

constexpr Real skin = 0.1;

/// Distance of two particles: of centres, or of vertices and outlines.
template <int D>
Real distance_of(const Configuration<D>& c, Index m, Index n) {
  if constexpr (D == 2) {
    if (c.topology.deformable()) {
      const Polygon a = vertices_of(c, m), b = vertices_of(c, n);
      Real least = std::numeric_limits<Real>::infinity();
      for (const Vec<2>& r : a) least = std::min(least, outline_distance(r, b));
      for (const Vec<2>& r : b) least = std::min(least, outline_distance(r, a));
      return least;
    }
  }
  return (c.position(m) - c.position(n)).norm();
}

/// A rank's share of a configuration: particles by `owner(id)`, and their ghosts.
template <int D>
struct Domain {
  Configuration<D>& all;
  const Ranks& ranks;
  Topology topology;
  Halo<D> halo;
  std::vector<Real> x, v, local_x, local_v;

  template <class Owner>
  Domain(Configuration<D>& c, const Ranks& r, Owner&& owner, const Box<D>& box = {}) : all(c), ranks(r), halo(r, box) {
    std::vector<Index> which;
    for (Index m = 0; m < c.topology.particles(); ++m)
      if (owner(m) == r.rank()) which.push_back(m);
    topology = c.topology.select(which);
    load();
    halo.set_home(topology, x.data());
  }

  /// Owned coordinates, copied from the configuration.
  void load() {
    x.clear();
    v.clear();
    for (Index m = 0; m < topology.owned(); ++m)
      for (Index k = all.topology.offset[topology.id[m]] * D; k < all.topology.offset[topology.id[m] + 1] * D; ++k) {
        x.push_back(all.x[k]);
        v.push_back(all.v[k]);
      }
  }

  void build() {
    load();
    halo.build(topology, x.data(), skin);
    update();
  }
  void update() {
    load();
    halo.update_positions(x.data(), local_x);
    halo.update(v.data(), local_v);
  }

  /// Whether owned particles and ghosts have the right data, and all particles within the cutoff of an owned one exist.
  /// Returns the pairs that reach to another rank.
  Index check() const {
    const Topology &t = topology, &from = all.topology;
    REQUIRE(local_x.size() == static_cast<std::size_t>(t.points()) * D);
    REQUIRE(local_v.size() == local_x.size());
    std::map<Index, Index> place;
    int twice = 0, wrong = 0, missing = 0, pairs = 0;
    for (Index m = 0; m < t.particles(); ++m) {
      const Index origin = t.id[m];
      twice += !place.emplace(origin, m).second;
      wrong += t.points_of(m) != from.points_of(origin) || t.sigma[m] != from.sigma[origin] ||
               t.a0[m] != from.a0[origin] || t.l0[m] != from.l0[origin] || t.active[m] != from.active[origin] ||
               t.inertia[m] != from.inertia[origin];
      for (Index k = 0; k < t.points_of(m); ++k) {
        const Index i = t.offset[m] + k, j = from.offset[origin] + k;
        wrong += std::abs(t.mass(i) - from.mass(j)) > 1e-14 || t.diameter[i] != from.diameter[j] ||
                 t.particle[i] != m || t.next[i] - t.offset[m] != from.next[j] - from.offset[origin];
        for (int d = 0; d < D; ++d)
          wrong += local_x[i * D + d] != all.x[j * D + d] || local_v[i * D + d] != all.v[j * D + d];
      }
    }
    for (Index m = 0; m < t.owned(); ++m) {
      const Index id = t.id[m];
      if (from.active[id] == 0) continue;
      for (Index other = 0; other < from.particles(); ++other) {
        if (other == id || from.active[other] == 0) continue;
        const Index i = from.offset[id], j = from.offset[other];
        const Vec<D> r = mean_of_points<D>(all.x.data(), from, id) - mean_of_points<D>(all.x.data(), from, other);
        if (r.norm() > from.sigma[id] + from.sigma[other] + 1) continue;
        if (distance_of(all, id, other) >= (from.diameter[i] + from.diameter[j]) / 2 + skin) continue;
        const auto found = place.find(other);
        missing += found == place.end();
        pairs += found != place.end() && found->second >= t.owned();
      }
    }
    CHECK(twice == 0);
    CHECK(wrong == 0);
    CHECK(missing == 0);
    for (Index m = t.owned(); m < t.particles(); ++m) wrong += from.active[t.id[m]] == 0;
    CHECK(wrong == 0);
    return pairs;
  }
};

template <int D>
void check_halo(const Ranks& ranks, Random& random, Configuration<D> c) {
  const Index n = c.topology.particles();
  for (int k = 0; k < 9; ++k) c.topology.deactivate(random.below(n));
  // Slabs from below.
  const auto slab = [&](Index m) { return static_cast<int>(static_cast<std::int64_t>(m) * ranks.size() / n); };
  const auto shift = [&](Index m, const Vec<D>& by) {
    for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) point<D>(c.x.data(), i) += by;
  };

  SECTION("at home") {
    Domain<D> domain(c, ranks, slab);
    domain.build();
    CHECK(domain.halo.strays() == 0);
    const Index pairs = domain.check();
    CHECK((pairs > 5) == ranks.several());
    // Some ghosts, but not a copy of all particles.
    if (ranks.several()) CHECK(domain.topology.ghosts > 5);
    CHECK(domain.topology.ghosts < n / 4);
    // The same again, with other positions for the same ghosts.
    const Index ghosts = domain.topology.ghosts;
    for (Real& a : c.x) a += random(-0.01, 0.01);
    for (Real& a : c.v) a = random(-1, 1);
    domain.update();
    domain.check();
    domain.build();
    domain.check();
    CHECK(domain.topology.ghosts == Approx(ghosts).epsilon(0.1));
  }
  SECTION("strays") {
    Domain<D> domain(c, ranks, slab);
    domain.build();
    const Index ghosts = domain.topology.ghosts;
    // From the middle of the first slab to the middle of the last, and far outside.
    Index stray = n / ranks.size() / 2, far = stray + 1;
    while (c.topology.active[stray] == 0) ++stray;
    while (c.topology.active[far] == 0 || far == stray) ++far;
    Vec<D> middle = Vec<D>::Zero();
    Index in_last = 0;
    for (Index m = 0; m < n; ++m) {
      if (slab(m) != ranks.size() - 1) continue;
      middle += mean_of_points<D>(c.x.data(), c.topology, m);
      ++in_last;
    }
    shift(stray, middle / in_last - mean_of_points<D>(c.x.data(), c.topology, stray));
    shift(far, 50 * Vec<D>::Unit(D - 1));
    domain.build();
    domain.check();
    CHECK(ranks.sum(std::int64_t(domain.halo.strays())) == (ranks.several() ? 2 : 1));
    // A stray drags no slab along.
    CHECK(domain.topology.ghosts < ghosts + 30);
    // Back home.
    shift(far, -50 * Vec<D>::Unit(D - 1));
    domain.build();
    domain.check();
    CHECK(ranks.sum(std::int64_t(domain.halo.strays())) == (ranks.several() ? 1 : 0));
  }
  SECTION("all on the last rank") {
    Domain<D> domain(c, ranks, [&](Index) { return ranks.size() - 1; });
    domain.build();
    domain.check();
    CHECK(domain.topology.ghosts == 0);
  }
  SECTION("nothing on the first rank") {
    Domain<D> domain(c, ranks, [&](Index m) { return ranks.several() ? std::max(1, slab(m)) : 0; });
    domain.build();
    domain.check();
    if (ranks.several() && ranks.root()) CHECK(domain.topology.particles() == 0);
  }
  SECTION("mixed up: all have ghosts of nearly all") {
    Domain<D> domain(c, ranks, [&](Index m) { return m % ranks.size(); });
    domain.build();
    CHECK((domain.check() > n / 4) == ranks.several());
  }
}

/// Particle m of a configuration, as an image.
template <int D>
Configuration<D> with_image(const Configuration<D>& c, Index m, const Vec<D>& by) {
  Configuration<D> two;
  two.topology = c.topology;
  two.x = c.x;
  for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) point<D>(two.x.data(), i) += by;
  return two;
}

/// Whether ghosts are images or copies of the right particles, without duplicates, and whether all particles that an
/// owned particle can touch are present.
template <int D>
void check_images(const Domain<D>& domain, const Box<D>& box) {
  const Topology &t = domain.topology, &from = domain.all.topology;
  const Configuration<D>& all = domain.all;
  std::map<std::pair<Index, Image>, Index> place;
  int twice = 0, wrong = 0, missing = 0, found = 0;
  for (Index m = 0; m < t.particles(); ++m) {
    const Index id = t.id[m];
    const Vec<D> by = point<D>(domain.local_x.data(), t.offset[m]) - all.position(from.offset[id]);
    Image n{};
    for (int k = 0; k < D; ++k)
      if (box.periodic(k)) n[k] = std::lround(by[k] / box.length()[k]);
    twice += !place.emplace(std::pair(id, n), m).second;
    wrong += m < t.owned() && n != Image{};
    if (m >= t.owned()) {
      const int side = n < Image{} ? -1 : Image{} < n ? 1 : 0;
      wrong += t.ghost_side[m - t.owned()] != side || (n == Image{} && !domain.ranks.several());
    }
    for (Index k = 0; k < t.points_of(m); ++k) {
      const Index i = t.offset[m] + k, j = from.offset[id] + k;
      wrong += (point<D>(domain.local_x.data(), i) - all.position(j) - box.shift(n)).norm() > 1e-12 ||
               point<D>(domain.local_v.data(), i) != point<D>(all.v.data(), j);
    }
  }
  Image most{};
  for (int k = 0; k < D; ++k) most[k] = box.periodic(k) ? static_cast<std::int64_t>(8 / box.length()[k]) + 4 : 0;
  for (Index m = 0; m < t.owned(); ++m)
    for (Index other = 0; other < from.particles(); ++other) {
      const Index i = from.offset[t.id[m]], j = from.offset[other];
      Image n;
      for (n[0] = -most[0]; n[0] <= most[0]; ++n[0])
        for (n[1] = -most[1]; n[1] <= most[1]; ++n[1])
          for (n[2] = -most[2]; n[2] <= most[2]; ++n[2]) {
            if (other == t.id[m] && n == Image{}) continue;
            const Vec<D> r = all.position(i) - all.position(j) - box.shift(n);
            if (r.norm() > from.sigma[t.id[m]] + from.sigma[other] + 1) continue;
            Real d = r.norm();
            if constexpr (D == 2) {
              if (from.deformable()) {
                const Configuration<2> shifted = with_image<2>(all, other, box.shift(n));
                if (other != t.id[m])
                  d = distance_of<2>(shifted, t.id[m], other);
                else
                  d = std::min(outline_distance(shifted.position(j), vertices_of(all, t.id[m])), r.norm());
              }
            }
            if (d >= (from.diameter[i] + from.diameter[j]) / 2 + skin) continue;
            ++found;
            missing += !place.contains({other, n});
          }
    }
  CHECK(twice == 0);
  CHECK(wrong == 0);
  CHECK(missing == 0);
  CHECK((t.owned() == 0 || found > 0));
}

/// A few particles in boxes of these lengths; then moved by box lengths, and all together by any way.
template <int D>
void check_box(Random& random, Configuration<D> c, const Vec<D>& length) {
  const Ranks ranks(PETSC_COMM_WORLD);
  const Box<D> box(Vec<D>::Constant(-0.3), length);
  Domain<D> domain(
      c, ranks, [&](Index m) { return m % ranks.size(); }, box);
  const auto check = [&] {
    domain.build();
    check_images(domain, box);
    // The same ghosts at other positions.
    for (Real& a : c.x) a += random(-0.01, 0.01);
    domain.update();
    check_images(domain, box);
  };
  check();
  for (Index m = 0; m < c.topology.particles(); m += 2) {
    const Vec<D> by = box.shift({random.below(5) - 2, random.below(5) - 2, random.below(5) - 2});
    for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) point<D>(c.x.data(), i) += by;
  }
  check();
  for (Index i = 0; i < c.topology.points(); ++i) point<D>(c.x.data(), i) += Vec<D>::LinSpaced(0.7, -1.3);
  check();
  domain.load();
  domain.halo.set_home(domain.topology, domain.x.data());
  check();
}

}  // namespace

TEST_CASE("what own soft particles can touch is there", "[ranks]") {
  Random random(1);
  check_halo(Ranks(PETSC_COMM_WORLD), random, soft_rows<2>(random, 12, 40));
}

TEST_CASE("what own spheres can touch is there", "[ranks]") {
  Random random(2);
  check_halo(Ranks(PETSC_COMM_WORLD), random, soft_rows<3>(random, 6, 24));
}

TEST_CASE("what own polygons can touch is there", "[ranks]") {
  Random random(3);
  check_halo(Ranks(PETSC_COMM_WORLD), random, polygon_rows(random, 10, 36));
}

TEST_CASE("sizes decide how far ghosts are looked for", "[ranks]") {
  // A large particle touches small particles of another rank, for any position.
  const Ranks ranks(PETSC_COMM_WORLD);
  Configuration<2> c;
  c.add_soft(10, {0, 0});
  for (int k = 1; k < 40; ++k) c.add_soft(0.2, {4.9 + 0.01 * k, 0.3 * k - 6});
  for (const int large_at : {0, ranks.size() - 1}) {
    Domain<2> domain(c, ranks, [&](Index m) { return m == 0 ? large_at : ranks.size() - 1 - large_at; });
    domain.build();
    CHECK((domain.check() > 0) == (ranks.several() && (ranks.rank() == 0 || ranks.rank() == ranks.size() - 1)));
  }
}

TEST_CASE("what own particles can touch across the borders of a box is there", "[ranks]") {
  Random random(4);
  constexpr Real open = Box<2>::infinite;
  for (const Vec<2>& length : {Vec<2>(5, 5), Vec<2>(5, open), Vec<2>(open, 4), Vec<2>(1.7, 0.6), Vec<2>(0.4, open)}) {
    check_box<2>(random, soft_rows<2>(random, 4, 4), length);
    check_box<2>(random, polygon_rows(random, 3, 2), length);
  }
  for (const Vec<3>& length : {Vec<3>(3, 3, 3), Vec<3>(0.8, open, 1.5)})
    check_box<3>(random, soft_rows<3>(random, 4, 1), length);
}

TEST_CASE("particles that have gone far in a box are at home", "[ranks]") {
  Random random(5);
  const Ranks ranks(PETSC_COMM_WORLD);
  Configuration<2> c = soft_rows<2>(random, 8, 12);
  const Box<2> box({-3.8, 0}, {7.6, 11.4});
  const Index n = c.topology.particles();
  Domain<2> domain(
      c, ranks, [&](Index m) { return static_cast<int>(m * ranks.size() / n); }, box);
  domain.build();
  check_images(domain, box);
  const Index ghosts = domain.topology.ghosts;
  CHECK(domain.halo.strays() == 0);
  for (Index i = 0; i < n; ++i) point<2>(c.x.data(), i) += box.shift({i % 2, -3, 0});
  domain.build();
  check_images(domain, box);
  CHECK(domain.halo.strays() == 2);
  CHECK(ghosts > 5);
  CHECK(domain.topology.ghosts < n + 2 * ghosts);
}

TEST_CASE("a particle that has lost its shape has no end of images") {
  Configuration<2> c;
  c.add_polygon({{0, 0}, {1, 0}, {1e6, 1}}, 0.1);
  Halo<2> halo(Ranks(), Box<2>({0, 0}, {2, 2}));
  halo.set_home(c.topology, c.x.data());
  CHECK_THROWS_WITH(halo.build(c.topology, c.x.data(), skin), Catch::Contains("images"));
}

}  // namespace pliant::test::halo_test
