// Contact and friction of point pairs in one pass, against the element forms.
#include <pliant/kernels/pair_forces.h>

#include <algorithm>
#include <catch2/catch.hpp>

#include <pliant/model/pair_contact.h>
#include <pliant/model/pair_friction.h>

#include "support/random.h"

namespace pliant::test::pair_forces_test {

namespace {

/// Points with velocities and a list of pairs.
template <int D>
struct Cloud {
  Topology topology;
  std::vector<Real> x, v, reach;
  std::vector<Pair> pairs;

  Cloud() { topology.dim = D; }
  void add_point(Real diameter, const Vec<D>& r, Random& random) {
    topology.add_soft(diameter, 1);
    x.insert(x.end(), r.data(), r.data() + D);
    while (v.size() < x.size()) v.push_back(random(-1, 1));
  }
  void list(Index i, Index j) {
    pairs.push_back({i, j});
    reach.push_back((topology.diameter[i] + topology.diameter[j]) / 2);
  }
  Vec<D> difference(const Pair& p) const { return point<D>(x.data(), p.first) - point<D>(x.data(), p.second); }

  std::vector<Real> forces(const PairLaw& law, Sides sides, Index n) const {
    std::vector<Real> f(x.size());
    // Separate allocations, so that a memory checker detects every access beyond the end.
    const std::vector<Pair> list(pairs.begin(), pairs.begin() + n);
    const std::vector<Real> list_reach(reach.begin(), reach.begin() + n);
    add_pair_forces<D>(law, list, list_reach.data(), sides, x.data(), law.mu == 0 ? nullptr : v.data(), f.data());
    return f;
  }
};

/// Passes on every second vector only: the vectors that an element form adds to its first point.
template <int D, int Sign>
struct FirstOnly {
  Scatter<D, Sign> scatter;
  bool second = false;
  template <class V>
  void add(Index i, const V& vector) {
    if (!second) scatter.add(i, vector);
    second = !second;
  }
};

/// Forces of the first n pairs by the element forms.
template <int D>
std::vector<Real> element_forces(const PairLaw& law, const Cloud<D>& c, Sides sides, Index n) {
  Neighbours<D> neighbours({}, 0);
  neighbours.point_pairs.pairs = c.pairs;
  const Walls<D> walls({}, {});
  const StateView<D> s{c.x.data(), c.v.data(), c.topology, neighbours, walls};
  const PairFriction<D> friction{law.mu, law.tangential ? Friction::tangential : Friction::whole};
  std::vector<Real> f(c.x.size());
  Scatter<D, -1> minus{f.data()};
  Scatter<D, 1> plus{f.data()};
  FirstOnly<D, -1> minus_first{minus};
  FirstOnly<D, 1> plus_first{plus};
  const PairContact<D> contact{law.epsilon, "pair", law.contact};
  for (Index e = 0; e < n; ++e)
    sides == Sides::both ? contact.add_gradient(s, e, minus) : contact.add_gradient(s, e, minus_first);
  for (Index e = 0; e < n && friction.enabled(s); ++e)
    sides == Sides::both ? friction.add_force(s, e, plus) : friction.add_force(s, e, plus_first);
  return f;
}

Real largest(const std::vector<Real>& f) {
  Real most = 0;
  for (const Real a : f) most = std::max(most, std::abs(a));
  return most;
}

void check_equal(const std::vector<Real>& f, const std::vector<Real>& expected, Real scale) {
  REQUIRE(f.size() == expected.size());
  for (std::size_t k = 0; k < f.size(); ++k) {
    CAPTURE(k);
    CHECK(f[k] == Approx(expected[k]).epsilon(0).margin(1e-12 * scale));
  }
}

/// About twenty points of different sizes, with all pairs listed; the last three lie on other points.
template <int D>
Cloud<D> random_cloud(Random& random) {
  Cloud<D> c;
  for (int k = 0; k < 20; ++k) {
    Vec<D> r;
    for (int d = 0; d < D; ++d) r[d] = random(0, D == 2 ? 3 : 2);
    c.add_point(random(0.7, 1.4), r, random);
  }
  for (const Index twin : {0, 7, 19}) c.add_point(random(0.7, 1.4), point<D>(c.x.data(), twin), random);
  for (Index i = 0; i < c.topology.points(); ++i)
    for (Index j = 0; j < i; ++j) random.below(2) == 0 ? c.list(i, j) : c.list(j, i);
  return c;
}

/// Any order will do: several pairs of four then have a point in common, on either side.
template <int D>
void shuffle(Cloud<D>& c, Random& random) {
  for (std::size_t n = c.pairs.size(); n-- > 1;) {
    const Index k = random.below(static_cast<Index>(n + 1));
    std::swap(c.pairs[n], c.pairs[k]);
    std::swap(c.reach[n], c.reach[k]);
  }
}

const PairLaw laws[] = {{{1e3}, {0}},
                        {{1e3}, {20}},
                        {{0}, {20}},
                        {{1e3, ContactLaw::hertz}, {0}},
                        {{1e3, ContactLaw::hertz}, {20}},
                        {{1e3}, {20, true}},
                        {{0}, {20, true}},
                        {{1e3, ContactLaw::hertz}, {20, true}},
                        {{1e3, ContactLaw::linear}, {0}},
                        {{1e3, ContactLaw::linear}, {20}}};

}  // namespace

TEMPLATE_TEST_CASE_SIG("pair forces are those of the element forms", "", ((int D), D), 2, 3) {
  Random random(31 + D);
  for (int trial = 0; trial < 20; ++trial) {
    Cloud<D> c = random_cloud<D>(random);
    if (trial % 2 == 1) shuffle(c, random);
    int touching = 0, apart = 0, coincident = 0;
    for (std::size_t n = 0; n < c.pairs.size(); ++n) {
      const Real d = c.difference(c.pairs[n]).norm();
      ++(d < c.reach[n] ? touching : apart);
      coincident += d == 0;
    }
    REQUIRE(touching > 20);
    REQUIRE(apart > 20);
    REQUIRE(coincident == 3);
    const Index all = static_cast<Index>(c.pairs.size());
    for (const PairLaw& law : laws)
      for (const Sides sides : {Sides::both, Sides::first}) {
        CAPTURE(trial, law.epsilon, law.mu, law.tangential, sides == Sides::both);
        const Real scale = largest(element_forces(law, c, sides, all));
        REQUIRE(scale > 1);
        for (const Index n : {0, 1, 2, 3, 4, 5, 7, 30, all - 1, all})
          check_equal(c.forces(law, sides, n), element_forces(law, c, sides, n), scale);
      }
  }
}

TEMPLATE_TEST_CASE_SIG("coincident points rub but do not push each other", "", ((int D), D), 2, 3) {
  Random random(5);
  Cloud<D> c;
  c.add_point(1, Vec<D>::Constant(0.3), random);
  c.add_point(1.2, Vec<D>::Constant(0.3), random);
  for (int k = 0; k < 5; ++k) c.list(0, 1);
  CHECK(largest(c.forces({{1e3}, {0}}, Sides::both, 5)) == 0);
  for (const bool tangential : {false, true}) {  // there is no normal
    const std::vector<Real> f = c.forces({{1e3}, {2, tangential}}, Sides::both, 5);
    for (int k = 0; k < D; ++k) {
      CHECK(f[k] == Approx(-5 * 2 * (c.v[k] - c.v[D + k])).epsilon(1e-12));
      CHECK(f[D + k] == -f[k]);
    }
  }
}

TEMPLATE_TEST_CASE_SIG("pairs that are just out of reach feel nothing", "", ((int D), D), 2, 3) {
  Random random(6);
  Cloud<D> c;
  c.add_point(0.75, Vec<D>::Zero(), random);
  for (int k = 0; k < D; ++k) {
    c.add_point(1.25, Vec<D>::Unit(k), random);
    c.add_point(1.25, -(1 + 1e-15) * Vec<D>::Unit(k), random);
  }
  for (Index i = 1; i < c.topology.points(); ++i) c.list(i, 0);
  const Index n = static_cast<Index>(c.pairs.size());
  CHECK(largest(c.forces({{1e3}, {2}}, Sides::both, n)) == 0);
  for (Real& d : c.reach) d *= 1 + 1e-14;
  CHECK(largest(c.forces({{1e3}, {2}}, Sides::both, n)) > 0.1);
}

TEMPLATE_TEST_CASE_SIG("pair forces are added to what is there, and to listed points only", "", ((int D), D), 2, 3) {
  Random random(7);
  const Cloud<D> all = random_cloud<D>(random);
  Cloud<D> c = all;
  c.pairs.clear();
  c.reach.clear();
  const Index unlisted = 4, only_second = 5;
  for (const auto [i, j] : all.pairs)
    if (i != unlisted && j != unlisted) i == only_second ? c.list(j, i) : c.list(i, j);
  const Index n = static_cast<Index>(c.pairs.size());
  const PairLaw law{{1e3}, {20}};
  for (const Sides sides : {Sides::both, Sides::first}) {
    std::vector<Real> before(c.x.size()), expected = element_forces(law, c, sides, n);
    for (Real& a : before) a = random(-100, 100);
    std::vector<Real> f = before;
    add_pair_forces<D>(law, c.pairs, c.reach.data(), sides, c.x.data(), c.v.data(), f.data());
    const auto same = [&](Index i) { return point<D>(f.data(), i) == point<D>(before.data(), i); };
    CHECK(same(unlisted));
    CHECK(same(only_second) == (sides == Sides::first));
    for (std::size_t k = 0; k < f.size(); ++k) expected[k] += before[k];
    check_equal(f, expected, largest(expected));
  }
}

}  // namespace pliant::test::pair_forces_test
