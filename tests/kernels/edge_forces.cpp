// Contact and friction of vertices and edges in one pass, against the element forms.
#include <pliant/kernels/edge_forces.h>

#include <catch2/catch.hpp>
#include <limits>

#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>

#include "support/random.h"

namespace pliant::test::edge_forces_test {

namespace {

/// Polygons with velocities and a list of pairs.
struct Outlines {
  Edges edges = Edges::wide;
  Topology topology;
  std::vector<Real> x, v, reach;
  std::vector<Pair> pairs;

  void add_polygon(const std::vector<Vec<2>>& vertices, Real delta, Random& random) {
    topology.add_polygon(static_cast<Index>(vertices.size()), 1, 1, delta, 1);
    for (const Vec<2>& r : vertices) x.insert(x.end(), {r[0], r[1]});
    while (v.size() < x.size()) v.push_back(random(-1, 1));
  }
  void list(Index p, Index a) {
    pairs.push_back({p, a});
    reach.push_back(vertex_edge_reach(edges, topology.diameter[p], topology.diameter[a]));
  }
  SegmentFoot foot(Index p, Index a) const {
    return segment_foot(point<2>(x.data(), p), point<2>(x.data(), a), point<2>(x.data(), topology.next[a]));
  }
};

/// How often the pairs of a list went each way.
struct Ways {
  int apart = 0, inside = 0, at_start = 0, at_end_carried = 0, at_end_passed_on = 0, near_start = 0, coincident = 0;

  void count(const Outlines& o) {
    for (std::size_t n = 0; n < o.pairs.size(); ++n) {
      const auto [p, a] = o.pairs[n];
      const SegmentFoot foot = o.foot(p, a);
      if (foot.d2 >= square(o.reach[n])) {
        ++apart;
        continue;
      }
      inside += foot.interior();
      at_start += foot.t == 0;
      if (foot.t == 1) ++(o.foot(p, o.topology.next[a]).t == 0 ? at_end_carried : at_end_passed_on);
      near_start += foot.t > 0 && (point<2>(o.x.data(), p) - point<2>(o.x.data(), a)).norm() < o.reach[n];
      coincident += foot.d2 == 0;
    }
  }
};

EdgeLaw twofold(EdgeLaw law) {
  const EdgeContact contact{law.epsilon, Edges::wide, true, EdgeForce::twofold};
  law.edge_weight = contact.edge_weight();
  law.vertex_weight = contact.vertex_weight();
  return law;
}

const EdgeLaw laws[] = {{{1e3}, {0, true}},
                        {{1e3}, {20, true}},
                        {{1e3}, {20, false}},
                        {{0}, {20, true}},
                        {{1e3, ContactLaw::hertz}, {0, true}},
                        {{1e3, ContactLaw::hertz}, {20, true}},
                        {{1e3, ContactLaw::barrier}, {0, true}},
                        {{1e3, ContactLaw::barrier}, {20, true}},
                        {{1e3, ContactLaw::barrier}, {20, false}},
                        {{1e3}, {20, true, true}},
                        {{1e3}, {20, false, true}},
                        {{1e3, ContactLaw::barrier}, {20, true, true}},
                        twofold({{1e3}, {0, true}}),
                        twofold({{1e3, ContactLaw::hertz}, {20, true}}),
                        twofold({{1e3}, {20, false, true}})};

/// Forces of the first n pairs by the element forms.
std::vector<Real> element_forces(const EdgeLaw& law, const Outlines& o, Index n) {
  Neighbours<2> neighbours({}, 0);
  neighbours.vertex_edges.pairs = o.pairs;
  const Walls<2> walls({}, {});
  const StateView<2> s{o.x.data(), o.v.data(), o.topology, neighbours, walls};
  const EdgeFriction friction{law.mu, law.at_contact ? FrictionPoint::contact : FrictionPoint::vertex,
                              law.tangential ? Friction::tangential : Friction::whole};
  std::vector<Real> f(o.x.size());
  Scatter<2, -1> minus{f.data()};
  Scatter<2, 1> plus{f.data()};
  const EdgeContact contact{law.epsilon, o.edges, true, law.edge_weight == 1 ? EdgeForce::single : EdgeForce::twofold,
                            law.contact};
  for (Index e = 0; e < n; ++e) contact.add_gradient(s, e, minus);
  for (Index e = 0; e < n && law.mu > 0; ++e) friction.add_force(s, e, plus);
  return f;
}

/// Infinity if a value is NaN.
Real largest(const std::vector<Real>& f) {
  Real most = 0;
  for (const Real a : f) most = std::max(most, std::isnan(a) ? std::numeric_limits<Real>::infinity() : std::abs(a));
  return most;
}

/// Largest difference between the kernel and the element forms, for the first n pairs, relative to the largest force.
Real error(const EdgeLaw& law, const Outlines& o, Index n) {
  // Copies of exactly this length, so that a sanitizer sees reads beyond the end.
  const std::vector<Pair> pairs(o.pairs.begin(), o.pairs.begin() + n);
  const std::vector<Real> reach(o.reach.begin(), o.reach.begin() + n);
  std::vector<Real> f(o.x.size());
  add_edge_forces(law, pairs, reach.data(), o.topology.next.data(), o.x.data(), law.mu > 0 ? o.v.data() : nullptr,
                  f.data());
  const std::vector<Real> expected = element_forces(law, o, n);
  const Real scale = largest(expected);
  for (std::size_t k = 0; k < f.size(); ++k) f[k] -= expected[k];
  return scale > 0 ? largest(f) / scale : largest(f);
}

/// Small polygons, also with notches and of different widths, at random places of a box, which they fill so that they
/// touch and cross in all ways; all pairs of vertices and edges of different polygons, sorted by edge.
Outlines crowd(Random& random, int polygons, Real box, Edges edges = Edges::wide) {
  Outlines o;
  o.edges = edges;
  for (int m = 0; m < polygons; ++m) {
    const Vec<2> centre(random(0, box), random(0, box));
    const int n = 3 + random.below(6);
    std::vector<Vec<2>> vertices;
    for (int k = 0; k < n; ++k) {
      const Real angle = 2 * pi * (k + random(-0.3, 0.3)) / n;
      vertices.push_back(centre + random(0.2, 0.6) * Vec<2>(std::cos(angle), std::sin(angle)));
    }
    o.add_polygon(vertices, random(0.1, 0.4), random);
  }
  const Topology& topology = o.topology;
  for (Index a = 0; a < topology.points(); ++a)
    for (Index p = 0; p < topology.points(); ++p) {
      if (topology.particle[p] == topology.particle[a]) continue;
      // The direction of a vanishing distance is nothing but rounding.
      const Real start = (point<2>(o.x.data(), p) - point<2>(o.x.data(), a)).norm();
      if (std::min(start, std::sqrt(o.foot(p, a).d2)) > 1e-3) o.list(p, a);
    }
  return o;
}

/// A square with an edge of length 0, a notched polygon, and points where feet, distances and corners are exact.
Outlines exact_places() {
  Random random(1);
  Outlines o;
  constexpr Real delta = 0.25;
  o.add_polygon({{0, 0}, {1, 0}, {1, 0}, {1, 1}, {0, 1}}, delta, random);
  o.add_polygon({{4, 0}, {5, 0}, {4.5, 0.5}, {5, 1}, {4, 1}}, delta, random);
  const Real nearly = std::nextafter(delta, 0.0);
  const std::vector<Vec<2>> square_places{
      {0.5, 0},                 // on an edge
      {0, 0},                   // on a corner
      {1, 0},                   // on the edge of length 0
      {0.5, -0.125},            // foot inside
      {0.125, -0.125},          // the same, near the start
      {0, -0.125},              // foot exactly at an end
      {1, -0.125},              // foot exactly at an end, next to the edge of length 0
      {-0.125, -0.125},         // corner nearest on both edges
      {1.125, -0.125},          // the same with three edges
      {1.125, 1.125},           //
      {0.875, 0.875},           // between two edges
      {0.5, -delta},            // just out of reach
      {0.5, -nearly},           // just within
      {-delta, 0},              // just out of reach of a corner
      {-nearly, 0},             //
      {0.5, 0.5},       {7, 7}  // far
  };
  for (const Vec<2>& r : square_places) o.add_polygon({r, {20, 20}, {21, 20}}, delta, random);
  for (const Vec<2>& r : {Vec<2>(4.75, 0.5), Vec<2>(4.5, 0.5), Vec<2>(4.625, 0.5), Vec<2>(4.5, 0.625)})
    o.add_polygon({r, {20, 20}, {21, 20}}, delta, random);
  for (Index a = 0; a < 10; ++a)
    for (Index m = 2; m < o.topology.particles(); ++m) o.list(o.topology.offset[m], a);
  return o;
}

}  // namespace

TEST_CASE("edge forces equal those of the element forms") {
  Ways ways;
  for (int k = 0; k < 60; ++k) {
    INFO("state " << k);
    Random random(k);
    // Loose, and so dense that most pairs touch.
    const Outlines o = crowd(random, 2 + random.below(25), k % 3 == 0 ? 0.8 : 3);
    ways.count(o);
    for (const EdgeLaw& law : laws) CHECK(error(law, o, static_cast<Index>(o.pairs.size())) < 1e-12);
  }
  CHECK(ways.apart > 10000);
  CHECK(ways.inside > 10000);
  CHECK(ways.at_start > 1000);
  CHECK(ways.at_end_carried > 1000);
  CHECK(ways.at_end_passed_on > 300);
  CHECK(ways.near_start > 1000);
}

TEST_CASE("edge forces of bare edges equal those of the element forms") {
  Ways ways;
  for (int k = 0; k < 30; ++k) {
    INFO("state " << k);
    Random random(k);
    const Outlines o = crowd(random, 2 + random.below(25), k % 3 == 0 ? 0.8 : 3, Edges::bare);
    ways.count(o);
    CHECK(error({{1e3}, {0, true}}, o, static_cast<Index>(o.pairs.size())) < 1e-12);
  }
  CHECK(ways.apart > 5000);
  CHECK(ways.inside > 2000);
  CHECK(ways.at_start > 200);
  CHECK(ways.at_end_carried > 200);
  CHECK(ways.near_start > 200);
}

TEST_CASE("edge forces at corners, on edges and at the end of the reach") {
  const Outlines o = exact_places();
  Ways ways;
  ways.count(o);
  CHECK(ways.apart > 0);
  CHECK(ways.inside > 0);
  CHECK(ways.at_start > 0);
  CHECK(ways.at_end_carried > 0);
  CHECK(ways.at_end_passed_on > 0);
  CHECK(ways.near_start > 0);
  CHECK(ways.coincident > 3);
  for (const EdgeLaw& law : laws) {
    CHECK(largest(element_forces(law, o, static_cast<Index>(o.pairs.size()))) > 1);
    CHECK(error(law, o, static_cast<Index>(o.pairs.size())) < 1e-12);
    // Pair by pair, so that no larger force hides a difference.
    for (std::size_t n = 0; n < o.pairs.size(); ++n) {
      INFO("vertex " << o.pairs[n].first << ", edge " << o.pairs[n].second);
      Outlines one = o;
      one.pairs = {o.pairs[n]};
      one.reach = {o.reach[n]};
      CHECK(error(law, one, 1) < 1e-12);
    }
  }
}

TEST_CASE("edge forces of lists of every length, with many contacts or few") {
  Random random(7);
  for (const bool dense : {true, false}) {
    Outlines o = crowd(random, 30, dense ? 0.8 : 3);
    Outlines chosen = o;
    chosen.pairs.clear(), chosen.reach.clear();
    // Dense: nothing but contacts, each a few times.
    for (int repeat = 0; repeat < (dense ? 3 : 1); ++repeat)
      for (std::size_t n = 0; n < o.pairs.size() && chosen.pairs.size() < 3000; ++n)
        if (!dense || o.foot(o.pairs[n].first, o.pairs[n].second).d2 < square(o.reach[n]))
          chosen.list(o.pairs[n].first, o.pairs[n].second);
    REQUIRE(chosen.pairs.size() == 3000);
    Ways ways;
    ways.count(chosen);
    if (dense)
      CHECK(ways.apart == 0);
    else
      CHECK(ways.apart > 2500);
    CHECK(ways.inside > 30);
    for (const EdgeLaw& law : laws)
      for (Index n = 0; n <= 3000; n += n < 20 ? 1 : 1 + random.below(150)) {
        INFO("pairs " << n);
        CHECK(error(law, chosen, n) < 1e-12);
      }
  }
}

TEST_CASE("edge forces on a part of the points leave the others alone") {
  for (int k = 0; k < 40; ++k) {
    INFO("state " << k);
    Random random(k);
    const Outlines o = crowd(random, 12, 2);
    const Index n = static_cast<Index>(o.pairs.size()), points = o.topology.points();
    const Index first = k == 0 ? 0 : random.below(points),
                last = k == 0 ? points : first + random.below(points - first);
    for (const EdgeLaw& law : laws) {
      const std::vector<Real> expected = element_forces(law, o, n);
      const Real scale = largest(expected);
      REQUIRE(scale > 1);
      std::vector<Real> before(o.x.size());
      for (Real& a : before) a = random(-scale, scale);
      std::vector<Real> f = before;
      add_edge_forces(law, o.pairs, o.reach.data(), o.topology.next.data(), first, last, o.x.data(), o.v.data(),
                      f.data());
      bool untouched = true;
      for (Index i = 0; i < 2 * points; ++i) {
        const bool own = 2 * first <= i && i < 2 * last;
        untouched &= own || f[i] == before[i];
        f[i] = own ? f[i] - before[i] - expected[i] : 0;
      }
      CHECK(largest(f) < 1e-12 * scale);
      CHECK(untouched);
    }
  }
}

}  // namespace pliant::test::edge_forces_test
