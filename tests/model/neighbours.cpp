// When neighbour lists are rebuilt, and that they never lack a contact. The searches themselves:
// tests/geometry/pair_search.cpp.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/geometry/hopper.h>
#include <pliant/model/neighbours.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::neighbours_test {

namespace {

constexpr Real skin = 0.1;
constexpr NeighbourNeeds all_lists{true, true, true, true},
    bare_lists{.point_pairs = true, .vertex_edges = true, .walls = true, .lips = true, .edges = Edges::bare};

/// Polygons strewn over the orifice of a hopper, overlapping at will.
struct Scene {
  Topology topology;
  Walls<2> walls = Hopper{.wall_distance = 8, .orifice = 2, .angle = 60}.walls<2>();
  std::vector<Real> x;

  explicit Scene(Random& random, Index particles = 60) {
    for (Index m = 0; m < particles; ++m) {
      const Real size = random(0.1, 0.5);
      topology.add_polygon(6, 1, 1, size * random(0.2, 1), 1);
      for (const Vec<2>& r : irregular_polygon(random, 6, size, {random(-4, 4), random(-1, 6)}))
        x.insert(x.end(), r.begin(), r.end());
    }
  }
  std::vector<Real> moved(Random& random, Real distance) const {
    std::vector<Real> y = x;
    for (Index i = 0; i < topology.points(); ++i) point<2>(y.data(), i) += distance * random.unit<2>();
    return y;
  }
};

bool contains(const PairList& sorted, const Pair& pair) {
  return std::binary_search(sorted.begin(), sorted.end(), pair);
}

}  // namespace

TEST_CASE("a narrowed list holds every contact until something has moved by half its range") {
  const NeighbourNeeds needs = GENERATE(all_lists, bare_lists);
  const auto field = make_force_field<2>(needs.edges == Edges::bare ? ModelKind::rough : ModelKind::smooth,
                                         {.epsilon = 1, .epsilon_wall = 1, .mu = 0.3}, Vec<2>::Zero());
  constexpr Real range = skin / 2;
  int entered = 0;
  for (int seed = 0; seed < 10; ++seed) {
    Random random(seed);
    const Scene scene(random);
    const Topology& t = scene.topology;
    Neighbours<2> lists(needs, skin);
    lists.ensure(t, scene.walls, scene.x.data());
    const PairList& all = lists.vertex_edges;
    REQUIRE(lists.near_edges().pairs == all.pairs);
    lists.narrow(t, scene.x.data(), range);
    const PairList& near = lists.near_edges();
    REQUIRE(near.size() > 0);
    REQUIRE(near.size() < 0.9 * all.size());
    REQUIRE(near.start.size() == all.start.size());

    const std::vector<Real> y = scene.moved(random, 0.4999 * range);
    const auto distance = [&](const std::vector<Real>& x, const Pair& p) {
      const Vec<2> a = point<2>(x.data(), p.second), b = point<2>(x.data(), t.next[p.second]);
      return std::sqrt(segment_foot(point<2>(x.data(), p.first), a, b).d2);
    };
    // Each part of the list in the same order, with no contact left out.
    for (std::size_t part = 1; part < all.start.size(); ++part) {
      Index k = near.start[part - 1];
      for (Index e = all.start[part - 1]; e < all.start[part]; ++e) {
        const bool kept = k < near.start[part] && near[k] == all[e];
        if (kept) REQUIRE(near.reach[k++] == all.reach[e]);
        if (distance(y, all[e]) >= all.reach[e]) continue;
        REQUIRE(kept);
        entered += distance(scene.x, all[e]) >= all.reach[e];
      }
      REQUIRE(k == near.start[part]);
    }
    // The forces to the last bit.
    const std::vector<Real> v = scene.moved(random, 1);
    std::vector<Real> with(y.size()), without(y.size());
    const StateView<2> view{y.data(), v.data(), t, lists, scene.walls};
    field->forces(view, with.data());
    lists.widen();
    REQUIRE(lists.near_edges().pairs == all.pairs);
    field->forces(view, without.data());
    CHECK(with == without);

    // Another list is not narrow.
    lists.narrow(t, y.data(), range);
    lists.relist(t, scene.walls, y.data(), 3);
    CHECK(!lists.narrowed());
    lists.narrow(t, y.data(), range);
    lists.rebuild(t, scene.walls, y.data());
    CHECK(!lists.narrowed());
  }
  CHECK(entered > 50);
}

TEST_CASE("a list contains every contact until a point has moved by half the skin") {
  const NeighbourNeeds needs = GENERATE(all_lists, bare_lists);
  for (int seed = 0; seed < 10; ++seed) {
    Random random(seed);
    const Scene scene(random);
    const Topology& t = scene.topology;
    Neighbours<2> lists(needs, skin);
    lists.ensure(t, scene.walls, scene.x.data());
    // The largest displacement that keeps the list.
    const std::vector<Real> y = scene.moved(random, 0.4999 * skin);
    lists.ensure(t, scene.walls, y.data());
    REQUIRE(lists.rebuilds() == 1);
    for (auto* list : {&lists.point_pairs, &lists.vertex_edges, &lists.walls, &lists.lips})
      std::sort(list->pairs.begin(), list->pairs.end());
    std::array<int, 4> contacts{};
    std::array<int, 4> missing{};
    const auto expect = [&](int kind, bool touching, bool listed) {
      contacts[kind] += touching;
      missing[kind] += touching && !listed;
    };
    for (Index i = 0; i < t.points(); ++i) {
      const Vec<2> r = point<2>(y.data(), i), next = point<2>(y.data(), t.next[i]);
      for (Index j = 0; j < t.points(); ++j) {
        if (t.particle[i] == t.particle[j]) continue;
        const Vec<2> q = point<2>(y.data(), j);
        const Real reach = (t.diameter[i] + t.diameter[j]) / 2;
        expect(0, (r - q).norm() < reach, contains(lists.point_pairs, {i, j}) || contains(lists.point_pairs, {j, i}));
        const Real on_edge = needs.edges == Edges::wide ? reach : t.diameter[j] / 2;
        expect(1, segment_foot(q, r, next).d2 < square(on_edge), contains(lists.vertex_edges, {j, i}));
      }
      for (Index s = 0; s < static_cast<Index>(scene.walls.parts().size()); ++s)
        expect(2, scene.walls.distance(r, s, 0) < t.diameter[i] / 2, contains(lists.walls, {i, s}));
      for (Index l = 0; l < 2; ++l)
        expect(3, segment_foot(scene.walls.lips()[l].place, r, next).d2 < square(t.diameter[i] / 2),
               contains(lists.lips, {l, i}));
    }
    CHECK(contacts[0] > 20);
    CHECK(contacts[1] > 20);
    CHECK(contacts[2] > 2);
    CHECK(missing == std::array<int, 4>{});
  }
}

TEST_CASE("bare edges are listed once with each vertex within their reach, long ones and short ones") {
  // Edges of 0.2 … 6 diameters. At a skin of 0 nearly all are too long to be found from the pairs of points.
  for (const Real margin : {0.0, skin, 0.5})
    for (int seed = 0; seed < 5; ++seed) {
      INFO("skin " << margin << ", seed " << seed);
      Random random(seed);
      const Scene scene(random, 600);
      const Topology& t = scene.topology;
      Neighbours<2> lists(bare_lists, margin);
      lists.rebuild(t, scene.walls, scene.x.data());
      REQUIRE(lists.chunks() == 2);
      std::vector<Pair> expected, inside, across[2];
      int from_points = 0, beyond_points = 0;
      for (Index i = 0; i < t.points(); ++i)
        for (Index j = 0; j < t.points(); ++j) {
          const Vec<2> a = point<2>(scene.x.data(), i), b = point<2>(scene.x.data(), t.next[i]),
                       r = point<2>(scene.x.data(), j);
          if (t.particle[i] == t.particle[j] || segment_foot(r, a, b).d2 >= square(t.diameter[j] / 2 + margin))
            continue;
          expected.push_back({j, i});
          const Real nearer = std::min((r - a).norm(), (r - b).norm());
          ++(nearer < (t.diameter[i] + t.diameter[j]) / 2 + margin ? from_points : beyond_points);
        }
      REQUIRE(from_points > 50);
      if (margin < 0.2) REQUIRE(beyond_points > 50);
      bool reaches = true;
      for (Index e = 0; e < lists.vertex_edges.size(); ++e)
        reaches &= lists.vertex_edges.reach[e] == t.diameter[lists.vertex_edges[e].first] / 2;
      CHECK(reaches);
      for (Index c = 0; c < 2; ++c) {
        const Range in = lists.vertex_edges.inside(c), out = lists.vertex_edges.across(c), own = lists.points(c);
        for (Index e = in.first; e < in.last; ++e) {
          inside.push_back(lists.vertex_edges[e]);
          CHECK((own.contains(inside.back().first) && own.contains(inside.back().second)));
        }
        for (Index e = out.first; e < out.last; ++e) across[c].push_back(lists.vertex_edges[e]);
        std::sort(across[c].begin(), across[c].end());
      }
      REQUIRE(across[0].size() > 5);
      CHECK(across[0] == across[1]);
      inside.insert(inside.end(), across[0].begin(), across[0].end());
      std::sort(inside.begin(), inside.end());
      std::sort(expected.begin(), expected.end());
      CHECK(inside == expected);
    }
}

TEST_CASE("one point that has moved by more than half the skin rebuilds the lists") {
  Random random(1);
  const Scene scene(random);
  Neighbours<2> lists(all_lists, skin);
  lists.ensure(scene.topology, scene.walls, scene.x.data());
  CHECK(lists.rebuilds() == 1);
  CHECK(lists.reference() == scene.x);
  std::vector<Real> y = scene.x;
  const Index i = 17;
  y[2 * i] += 0.49 * skin;
  lists.ensure(scene.topology, scene.walls, y.data());
  CHECK(lists.rebuilds() == 1);
  CHECK(lists.reference() == scene.x);
  y[2 * i + 1] += 0.49 * skin;  // 0.69 of the skin along the diagonal
  lists.ensure(scene.topology, scene.walls, y.data());
  CHECK(lists.rebuilds() == 2);
  CHECK(lists.reference() == y);
  lists.ensure(scene.topology, scene.walls, scene.x.data());  // and back
  CHECK(lists.rebuilds() == 3);
  lists.invalidate();
  lists.ensure(scene.topology, scene.walls, scene.x.data());
  CHECK(lists.rebuilds() == 4);
}

TEST_CASE("the same reference gives the same lists in the same order, whatever came before") {
  Random random(2);
  const Scene scene(random);
  Neighbours<2> fresh(all_lists, skin), used(all_lists, skin);
  fresh.rebuild(scene.topology, scene.walls, scene.x.data());
  for (int k = 0; k < 3; ++k) {
    const std::vector<Real> y = scene.moved(random, 0.3);
    used.rebuild(scene.topology, scene.walls, y.data());
  }
  CHECK(used.point_pairs.pairs != fresh.point_pairs.pairs);
  used.rebuild(scene.topology, scene.walls, scene.x.data());
  CHECK(fresh.size() > 100);
  CHECK(used.point_pairs.pairs == fresh.point_pairs.pairs);
  CHECK(used.vertex_edges.pairs == fresh.vertex_edges.pairs);
  CHECK(used.walls.pairs == fresh.walls.pairs);
  CHECK(used.lips.pairs == fresh.lips.pairs);
}

TEST_CASE("only the lists that are needed are built") {
  Random random(2);
  const Scene scene(random);
  Neighbours<2> lists({.vertex_edges = true}, skin);
  lists.ensure(scene.topology, scene.walls, scene.x.data());
  CHECK(!lists.vertex_edges.empty());
  CHECK(lists.size() == lists.vertex_edges.pairs.size());
}

TEST_CASE("a position that is not finite stops with the particle's name") {
  Random random(3);
  Scene scene(random);
  Neighbours<2> lists(all_lists, skin);
  for (const Real bad : {std::numeric_limits<Real>::quiet_NaN(), std::numeric_limits<Real>::infinity()}) {
    for (const bool before : {false, true}) {
      // Also where valid lists exist: the check of displacements must not accept NaN.
      if (before) lists.ensure(scene.topology, scene.walls, scene.x.data());
      std::vector<Real> y = scene.x;
      y[2 * (6 * 41 + 4) + 1] = bad;
      CHECK_THROWS_AS(lists.ensure(scene.topology, scene.walls, y.data()), NumericalError);
      CHECK_THROWS_WITH(lists.ensure(scene.topology, scene.walls, y.data()),
                        Catch::Contains("point 4") && Catch::Contains("particle 41"));
    }
  }
}

TEST_CASE("inactive particles are in no list") {
  Random random(4);
  Scene scene(random);
  Neighbours<2> lists(all_lists, skin);
  const auto mentions = [&](Index m) {
    const auto owner = [&](Index i) { return scene.topology.particle[i]; };
    int count = 0;
    for (const auto [i, j] : lists.point_pairs) count += owner(i) == m || owner(j) == m;
    for (const auto [i, j] : lists.vertex_edges) count += owner(i) == m || owner(j) == m;
    for (const auto [i, wall] : lists.walls) count += owner(i) == m;
    for (const auto [lip, i] : lists.lips) count += owner(i) == m;
    return count;
  };
  lists.ensure(scene.topology, scene.walls, scene.x.data());
  Index m = 0;
  while (mentions(m) < 10) ++m;
  scene.topology.deactivate(m);
  lists.invalidate();
  lists.ensure(scene.topology, scene.walls, scene.x.data());
  CHECK(mentions(m) == 0);
  CHECK(lists.size() > 100);
}

TEST_CASE("a far outlier does not change what the others find") {
  Random random(5);
  Scene scene(random);
  Neighbours<2> lists(all_lists, skin), with_outlier(all_lists, skin);
  const Index last = scene.topology.particles() - 1;
  scene.topology.deactivate(last);
  lists.ensure(scene.topology, scene.walls, scene.x.data());
  scene.topology.active[last] = 1;
  std::vector<Real> y = scene.x;
  for (Index i = scene.topology.offset[last]; i < scene.topology.points(); ++i) y[2 * i] += 1e8, y[2 * i + 1] -= 1e8;
  with_outlier.ensure(scene.topology, scene.walls, y.data());
  for (auto* list : {&lists, &with_outlier}) {
    std::sort(list->point_pairs.pairs.begin(), list->point_pairs.pairs.end());
    std::sort(list->vertex_edges.pairs.begin(), list->vertex_edges.pairs.end());
  }
  CHECK(with_outlier.point_pairs.pairs == lists.point_pairs.pairs);
  CHECK(with_outlier.vertex_edges.pairs == lists.vertex_edges.pairs);
}

TEST_CASE("lists of soft particles in 3D follow the same rule") {
  Random random(6);
  Topology topology;
  topology.dim = 3;
  std::vector<Real> x;
  for (int k = 0; k < 300; ++k) {
    topology.add_soft(random(0.2, 1), 1);
    for (int d = 0; d < 3; ++d) x.push_back(random(-2, 2));
  }
  const Walls<3> walls = Hopper{.wall_distance = 4, .orifice = 1, .angle = 90}.walls<3>();
  Neighbours<3> lists({.point_pairs = true, .walls = true}, skin);
  lists.ensure(topology, walls, x.data());
  std::vector<Real> y = x;
  for (Index i = 0; i < 300; ++i) point<3>(y.data(), i) += 0.4999 * skin * random.unit<3>();
  lists.ensure(topology, walls, y.data());
  REQUIRE(lists.rebuilds() == 1);
  std::sort(lists.point_pairs.pairs.begin(), lists.point_pairs.pairs.end());
  int touching = 0, missing = 0;
  for (Index i = 0; i < 300; ++i) {
    for (Index j = 0; j < i; ++j) {
      if ((point<3>(y.data(), i) - point<3>(y.data(), j)).norm() >= (topology.sigma[i] + topology.sigma[j]) / 2)
        continue;
      ++touching;
      missing += !contains(lists.point_pairs, {i, j}) && !contains(lists.point_pairs, {j, i});
    }
    for (Index s = 0; s < static_cast<Index>(walls.parts().size()); ++s) {
      if (walls.distance(point<3>(y.data(), i), s, 0) >= topology.sigma[i] / 2) continue;
      ++touching;
      missing += std::find(lists.walls.pairs.begin(), lists.walls.pairs.end(), Pair{i, s}) == lists.walls.end();
    }
  }
  CHECK(touching > 300);
  CHECK(missing == 0);
}

TEST_CASE("a relisted particle is listed as a rebuild would, also twice and next to another one") {
  const NeighbourNeeds needs = GENERATE(all_lists, bare_lists);
  Random random(7);
  const Scene scene(random, 600);
  const Topology& t = scene.topology;
  Neighbours<2> lists(needs, skin), again(needs, skin);
  lists.ensure(t, scene.walls, scene.x.data());
  REQUIRE(lists.chunks() == 2);
  std::vector<Real> x = scene.x;
  const auto put = [&](Index m, const Vec<2>& shift) {
    for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) point<2>(x.data(), i) += shift;
    lists.relist(t, scene.walls, x.data(), m);
  };
  const auto onto = [&](Index m, Index n) {  // touching it
    put(m, point<2>(x.data(), t.offset[n]) - point<2>(x.data(), t.offset[m]) + Vec<2>(0.3, 0.2));
  };
  onto(17, 200);
  onto(350, 17);
  put(17, {0.01, 0});
  onto(90, 3);
  CHECK(lists.valid(scene.walls, x.data()));
  CHECK(lists.rebuilds() == 1);
  Neighbours<2> fresh(needs, skin);
  fresh.ensure(t, scene.walls, x.data());
  const auto sorted = [&](const PairList& list, Index chunk, bool across) {
    const Range range = across ? list.across(chunk) : list.inside(chunk);
    std::vector<std::pair<Pair, Real>> pairs;
    for (Index e = range.first; e < range.last; ++e) {
      Pair pair = list[e];
      if (&list == &lists.point_pairs || &list == &fresh.point_pairs)
        if (!across && pair.first > pair.second) std::swap(pair.first, pair.second);
      pairs.emplace_back(pair, list.reach.empty() ? 0 : list.reach[e]);
    }
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  };
  const std::array members{&Neighbours<2>::point_pairs, &Neighbours<2>::vertex_edges, &Neighbours<2>::walls,
                           &Neighbours<2>::lips};
  Index across = 0;
  for (const auto member : members)
    for (Index c = 0; c < 2; ++c)
      for (const bool border : {false, true}) {
        CHECK(sorted(lists.*member, c, border) == sorted(fresh.*member, c, border));
        across += border ? static_cast<Index>(sorted(fresh.*member, c, border).size()) : 0;
      }
  CHECK(across > 100);

  again.replay(t, scene.walls, lists.history(t));
  for (const auto member : members) {
    CHECK((again.*member).pairs == (lists.*member).pairs);
    CHECK((again.*member).reach == (lists.*member).reach);
    CHECK((again.*member).start == (lists.*member).start);
  }
  CHECK(again.reference() == lists.reference());
}

}  // namespace pliant::test::neighbours_test
