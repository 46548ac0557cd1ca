// Pair searches against all pairs, by brute force.
#include <catch2/catch.hpp>

#include <pliant/geometry/hopper.h>
#include <pliant/geometry/pair_search.h>

#include "support/random.h"

namespace pliant::test::pair_search_test {

namespace {

enum class Sizes { equal, ten_to_one };
enum class Spread { even, clustered };

/// Owners of 1 (soft particles) or `per_owner` points (rings); a few owners are not used.
template <int D>
struct Cloud {
  std::vector<Real> x, diameter;
  std::vector<Index> group, next;
  std::vector<std::uint8_t> used;

  Cloud(Random& random, Index owners, Index per_owner, Sizes sizes, Spread spread) {
    for (Index m = 0; m < owners; ++m) {
      Vec<D> centre = 5 * Vec<D>(Vec<D>::NullaryExpr([&] { return random(-1, 1); }));
      if (spread == Spread::clustered && m % 3 != 0) centre = 0.3 * centre + Vec<D>::Constant(m % 2 == 0 ? 2.5 : -2.5);
      const Real size = sizes == Sizes::equal ? 0.5 : 0.1 * std::pow(10.0, random(0, 1));
      const Index first = static_cast<Index>(group.size());
      for (Index k = 0; k < per_owner; ++k) {
        Vec<D> r = centre;
        if (per_owner > 1)
          r.template head<2>() += size * Vec<2>(std::cos(2 * pi * k / per_owner), std::sin(2 * pi * k / per_owner));
        x.insert(x.end(), r.begin(), r.end());
        diameter.push_back(size);
        group.push_back(m);
        next.push_back(first + (k + 1) % per_owner);
      }
      used.push_back(m % 11 != 5);
    }
  }
  PointCloud view() const { return {x.data(), diameter, group, next, used}; }
  Vec<D> at(Index i) const { return point<D>(x.data(), i); }
  Index size() const { return static_cast<Index>(group.size()); }
  Real reach(Index i, Index j) const { return (diameter[i] + diameter[j]) / 2; }
  CellGrid<D> grid(Real cell) const {
    CellGrid<D> g;
    g.build(x.data(), diameter.data(), size(), cell, [this](Index i) { return used[group[i]] != 0; });
    return g;
  }
};

/// Sorted: a pair that is found twice differs from a pair that is found once.
std::vector<Pair> sorted(std::vector<Pair> pairs) {
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

template <class Body>
void for_each_cloud(Body&& body) {
  for (const Sizes sizes : {Sizes::equal, Sizes::ten_to_one})
    for (const Spread spread : {Spread::even, Spread::clustered})
      for (int seed = 0; seed < 4; ++seed) {
        INFO("sizes " << static_cast<int>(sizes) << ", spread " << static_cast<int>(spread) << ", seed " << seed);
        Random random(seed);
        body(random, sizes, spread);
      }
}

constexpr Real skin = 0.15;

/// Takes the results of a search; the contact distance, if given, must belong to the pair.
template <class C>
auto collect(const C& c, std::vector<Pair>& found, Edges edges = Edges::wide) {
  return [&c, &found, edges](Index i, Index j, auto... reach) {
    found.push_back({i, j});
    if constexpr (sizeof...(reach) > 0)
      CHECK((... + reach) == (edges == Edges::wide ? c.reach(i, j) : c.diameter[i] / 2));
  };
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("point pairs: each once, as by brute force", "", ((int D), D), 2, 3) {
  for_each_cloud([](Random& random, Sizes sizes, Spread spread) {
    for (const Index per_owner : {1, 4}) {
      const Cloud<D> c(random, 400 / per_owner, per_owner, sizes, spread);
      std::vector<Pair> found, expected;
      // In two parts, as threads do.
      find_point_pairs<D>(c.view(), c.grid(0.3), skin, 0, 150, collect(c, found));
      find_point_pairs<D>(c.view(), c.grid(0.3), skin, 150, c.size(), collect(c, found));
      for (Index i = 0; i < c.size(); ++i)
        for (Index j = 0; j < c.size(); ++j) {
          const bool first = c.diameter[i] > c.diameter[j] || (c.diameter[i] == c.diameter[j] && i < j);
          if (first && c.group[i] != c.group[j] && c.used[c.group[i]] && c.used[c.group[j]] &&
              (c.at(i) - c.at(j)).norm() < c.reach(i, j) + skin)
            expected.push_back({i, j});
        }
      REQUIRE(expected.size() > 10);
      CHECK(sorted(found) == expected);
    }
  });
}

TEST_CASE("vertex-edge pairs: each once, as by brute force") {
  const Edges edges = GENERATE(Edges::wide, Edges::bare);
  for_each_cloud([&](Random& random, Sizes sizes, Spread spread) {
    const Cloud<2> c(random, 80, 5, sizes, spread);
    std::vector<Pair> found, expected;
    const Real widest = *std::max_element(c.diameter.begin(), c.diameter.end());
    find_vertex_edge_pairs(c.view(), c.grid(0.3), edges, skin, widest, 0, c.size(), collect(c, found, edges));
    for (Index j = 0; j < c.size(); ++j)
      for (Index i = 0; i < c.size(); ++i)
        if (c.group[i] != c.group[j] && c.used[c.group[i]] && c.used[c.group[j]] &&
            std::sqrt(segment_foot(c.at(j), c.at(i), c.at(c.next[i])).d2) <
                (edges == Edges::wide ? c.reach(i, j) : c.diameter[j] / 2) + skin)
          expected.push_back({j, i});
    REQUIRE(expected.size() > 10);
    CHECK(sorted(found) == expected);
  });
}

TEST_CASE("wall and lip pairs: each once, as by brute force") {
  const Hopper hopper{.wall_distance = 9, .orifice = 3, .angle = 45};
  const Walls<2> flat = hopper.walls<2>();
  const Walls<3> revolved = hopper.walls<3>();
  for_each_cloud([&](Random& random, Sizes sizes, Spread spread) {
    const auto check_walls = [&](const auto& walls, const auto& c) {
      std::vector<Pair> found, expected;
      find_wall_pairs(c.view(), walls, 0, skin, 0, c.size(), collect(c, found));
      for (Index i = 0; i < c.size(); ++i)
        for (Index s = 0; s < static_cast<Index>(walls.parts().size()); ++s)
          if (c.used[c.group[i]] && walls.distance(c.at(i), s, 0) < c.diameter[i] / 2 + skin)
            expected.push_back({i, s});
      REQUIRE(expected.size() > 5);
      CHECK(sorted(found) == expected);
    };
    const Cloud<2> rings(random, 200, 5, sizes, spread);
    check_walls(flat, rings);
    check_walls(revolved, Cloud<3>(random, 400, 1, sizes, spread));

    std::vector<Pair> found, expected;
    find_lip_pairs(rings.view(), flat, 0, skin, 0, rings.size(), collect(rings, found));
    for (Index l = 0; l < 2; ++l)
      for (Index i = 0; i < rings.size(); ++i)
        if (rings.used[rings.group[i]] &&
            std::sqrt(segment_foot(flat.lips()[l].place, rings.at(i), rings.at(rings.next[i])).d2) <
                rings.diameter[i] / 2 + skin)
          expected.push_back({l, i});
    CHECK(sorted(found) == expected);
  });
}

namespace {

/// A closed outline of n segments that waves about a circle of radius 4, with a joint and a lip at each corner.
WallParts waves(Index n) {
  WallParts walls;
  const auto corner = [&](Index k) {
    const Real angle = 2 * pi * (k % n) / n, radius = 4 + 0.3 * std::cos(17 * angle);
    return Vec<2>(radius * std::cos(angle), radius * std::sin(angle));
  };
  for (Index k = 0; k < n; ++k) {
    walls.lips.push_back({corner(k), k});
    walls.joints.push_back({corner(k), k, (k + n - 1) % n, false});
    walls.segments.push_back(WallSegment::between(corner(k), corner(k + 1)));
  }
  walls.segments.push_back(WallSegment::ray({4.5, 0}, {0, 1}));
  walls.segments.push_back(WallSegment::disk({-2, 1}, 0.5));
  return walls;
}

}  // namespace

TEST_CASE("thousands of walls: as by brute force, in the same order, at the price of those that are near") {
  const Index n = 5000;
  const auto check = [&](const auto& walls, const auto& c, Real most) {
    std::vector<Pair> found, expected;
    const std::int64_t tests = find_wall_pairs(c.view(), walls, 0, skin, 0, c.size(), collect(c, found));
    const auto parts = static_cast<Index>(walls.parts().size());
    REQUIRE(parts > 9000);
    for (Index i = 0; i < c.size(); ++i)
      for (Index s = 0; s < parts; ++s)
        if (c.used[c.group[i]] && walls.distance(c.at(i), s, 0) < c.diameter[i] / 2 + skin) expected.push_back({i, s});
    REQUIRE(expected.size() > 1000);
    CHECK(found == expected);
    CAPTURE(tests, c.size(), expected.size());
    // Without boxes every block of points is compared with all walls, and its points with all walls near the block.
    CHECK(static_cast<Real>(tests) < most * static_cast<Real>(c.size() + static_cast<Index>(expected.size())));
  };
  Random random(3);
  const Cloud<2> rings(random, 100, 5, Sizes::equal, Spread::even);
  const Walls<2> flat(waves(n));
  check(flat, rings, 30);
  check(Walls<3>(waves(n)), Cloud<3>(random, 300, 1, Sizes::equal, Spread::even), 30);

  std::vector<Pair> found, expected;
  const std::int64_t tests = find_lip_pairs(rings.view(), flat, 0, skin, 0, rings.size(), collect(rings, found));
  for (Index i = 0; i < rings.size(); ++i)
    for (Index l = 0; l < n; ++l)
      if (rings.used[rings.group[i]] && segment_foot(flat.lips()[l].place, rings.at(i), rings.at(rings.next[i])).d2 <
                                            pliant::square(rings.diameter[i] / 2 + skin))
        expected.push_back({l, i});
  REQUIRE(expected.size() > 1000);
  CHECK(found == expected);
  CHECK(static_cast<Real>(tests) < 30 * static_cast<Real>(rings.size() + static_cast<Index>(expected.size())));
}

}  // namespace pliant::test::pair_search_test
