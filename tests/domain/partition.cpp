#include <petscsys.h>
#include <catch2/catch.hpp>

#include <limits>

#include <pliant/domain/partition.h>

#include "support/random.h"

namespace pliant::test::partition_test {

namespace {

/// Weights of the ranks relative to a fair share, and whether their boxes are apart.
template <int D>
void check_bisection(const Ranks& ranks, const std::vector<Real>& centres, const std::vector<Real>& weights) {
  const int n = ranks.size();
  const std::vector<int> destination = bisect<D>(ranks, centres, weights);
  REQUIRE(destination.size() == weights.size());
  std::vector<Real> share(n);
  std::vector<Real> box(2 * D * n, -std::numeric_limits<Real>::max());  // −low, high
  for (std::size_t m = 0; m < weights.size(); ++m) {
    const int to = destination[m];
    REQUIRE((0 <= to && to < n));
    share[to] += weights[m];
    for (int k = 0; k < D; ++k) {
      Real* b = &box[2 * D * to];
      b[k] = std::max(b[k], -centres[m * D + k]);
      b[D + k] = std::max(b[D + k], centres[m * D + k]);
    }
  }
  ranks.sum(share);
  ranks.max(box);
  Real total = 0;
  for (const Real a : share) total += a;
  for (int r = 0; r < n; ++r) {
    INFO("rank " << r);
    CHECK(share[r] == Approx(total / n).epsilon(0.03));
    for (int s = 0; s < r; ++s) {
      bool apart = false;
      for (int k = 0; k < D; ++k) {
        const Real *a = &box[2 * D * r], *b = &box[2 * D * s];
        apart = apart || -a[k] > b[D + k] || -b[k] > a[D + k];
      }
      CHECK(apart);
    }
  }
}

}  // namespace

TEST_CASE("bisection gives every rank a box of its own with a fair share of the weights", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  for (int k = 0; k < 4; ++k) {
    Random random(100 * k + ranks.rank());
    std::vector<Real> flat, solid, weights;
    // Ranks have different numbers of particles, the first none; most of them are near a corner.
    const int count = ranks.several() ? 1500 * ranks.rank() : 1500;
    for (int m = 0; m < count; ++m) {
      weights.push_back(random(1, 20));
      flat.insert(flat.end(), {4 * square(random(0, 1)), square(random(0, 1))});
      solid.insert(solid.end(), {random(0, 1), square(random(0, 1)), 3 * random(0, 1)});
    }
    check_bisection<2>(ranks, flat, weights);
    check_bisection<3>(ranks, solid, weights);
  }
}

TEST_CASE("bisection of what cannot be cut", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  for (const std::size_t count : {0, 1, 50}) {  // all in one place
    const std::vector<int> destination =
        bisect<2>(ranks, std::vector<Real>(2 * count, 0.3), std::vector<Real>(count, 1));
    CHECK(destination.size() == count);
    for (const int to : destination) CHECK((0 <= to && to < ranks.size()));
  }
}

}  // namespace pliant::test::partition_test
