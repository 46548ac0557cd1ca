// Starts of rafts, and the count of their rows.
#include <catch2/catch.hpp>

#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/scenarios/raft/raft.h>

namespace pliant::test::raft_test {

namespace {

using Pairs = std::vector<std::array<Index, 2>>;

Real distance(const std::vector<Real>& x, std::size_t i, std::size_t j) {
  return std::hypot(x[2 * i] - x[2 * j], x[2 * i + 1] - x[2 * j + 1]);
}

/// Pairs closer than `beyond` of the sum of their radii, in units of spacing/2.
Pairs pairs_within(const std::vector<Real>& x, const std::vector<Real>& radii, Real spacing, Real beyond) {
  Pairs pairs;
  for (std::size_t i = 0; i < radii.size(); ++i)
    for (std::size_t j = i + 1; j < radii.size(); ++j)
      if (distance(x, i, j) < (radii[i] + radii[j]) * spacing / 2 * beyond)
        pairs.push_back({static_cast<Index>(i), static_cast<Index>(j)});
  return pairs;
}

}  // namespace

TEST_CASE("a hexagonal raft has p rows of q droplets") {
  RaftOptions p;
  p.rows = 5;
  p.columns = 4;
  p.resolve();
  REQUIRE(p.droplets() == 20);
  const Real d = 1.99;
  const std::vector<Real> radii(20, 1), x = raft_places(p, radii, d);
  REQUIRE(x.size() == 40);
  CHECK(pairs_within(x, radii, d, 1 - 1e-12).empty());
  CHECK(pairs_within(x, radii, d, 1 + 1e-12).size() == 5 * 3 + 4 * (2 * 4 - 1));
  CHECK(x[38] - x[0] == Approx(4 * std::sqrt(3.0) / 2 * d));
  Real middle[2] = {0, 0};
  for (std::size_t k = 0; k < x.size(); ++k) middle[k % 2] += x[k];
  CHECK(middle[0] == Approx(0).margin(1e-12));
  CHECK(middle[1] == Approx(0).margin(20 * d / 4));
}

TEST_CASE("every second row may be one droplet shorter") {
  RaftOptions p;
  p.rows = 3;
  p.columns = 8;
  p.n = 23;  // 8, 7, 8
  p.resolve();
  const std::vector<Real> radii(23, 1), x = raft_places(p, radii, 2);
  REQUIRE(x.size() == 46);
  CHECK(pairs_within(x, radii, 2, 1 + 1e-12).size() == 7 + 6 + 7 + 2 * 14);
  p.n = 22;
  CHECK_THROWS_AS(p.resolve(), InputError);
  p.lattice = RaftLattice::disordered;
  CHECK_NOTHROW(p.resolve());
}

TEST_CASE("a disordered raft is dense and has no overlaps") {
  RaftOptions p;
  p.rows = 5;
  p.columns = 8;
  p.lattice = RaftLattice::disordered;
  p.radii = {.deviation = 1e-3, .small_fraction = 0.5, .small = 0.765};
  p.resolve();
  const std::vector<Real> radii = draw_radii(p.radii, p.droplets(), 3), x = raft_places(p, radii, 1.99);
  CHECK(pairs_within(x, radii, 1.99, 1 - 1e-6).empty());
  // Each but the first touches at least one before it, most two.
  CHECK(pairs_within(x, radii, 1.99, 1 + 1e-6).size() >= 60);
  Real area = 0, low = 0, high = 0;
  for (std::size_t m = 0; m < radii.size(); ++m) {
    CHECK(std::abs(x[2 * m]) <= 2 * std::sqrt(3.0) / 2 * 1.99 + 1e-6);
    area += pi * radii[m] * radii[m];
    low = std::min(low, x[2 * m + 1] - radii[m]);
    high = std::max(high, x[2 * m + 1] + radii[m]);
  }
  CHECK(area / ((high - low) * (4 * std::sqrt(3.0) / 2 * 1.99 + 2)) > 0.6);
}

TEST_CASE("rows are counted along chains of bonds") {
  RaftOptions p;
  p.rows = 4;
  p.columns = 6;
  p.resolve();
  const std::vector<Real> radii(24, 1), x = raft_places(p, radii, 2);
  Pairs bonds = pairs_within(x, radii, 2, 1.01);
  const std::vector<Index> first{0, 1, 2, 3, 4, 5}, last{18, 19, 20, 21, 22, 23};
  CHECK(count_rows(24, bonds, first, last) == 4);
  CHECK(count_rows(24, bonds, first, first) == 1);
  CHECK(count_rows(24, bonds, first, {}) == 0);
  CHECK(count_rows(24, {}, first, last) == 0);
  // A short cut at one end concerns a minority.
  bonds.push_back({0, 18});
  CHECK(count_rows(24, bonds, first, last) == 4);
}

}  // namespace pliant::test::raft_test
