// Angles between directions and between lines.
#include <catch2/catch.hpp>

#include <pliant/base/simd.h>
#include <pliant/geometry/turn.h>

#include "support/random.h"

namespace pliant::test::turn_test {
using simd::Real4;

namespace {

Vec<2> at(Real angle) { return {std::cos(angle), std::sin(angle)}; }

}  // namespace

TEST_CASE("the turn between directions is exact, small or not") {
  Random random(3);
  for (int k = 0; k < 400; ++k) {
    const Real turn = random(-1, 1) * (k % 2 == 0 ? 0.04 : 3.14), from = random(-4, 4);
    CHECK(turn_between(at(from), at(from + turn)) == Approx(turn).margin(1e-15));
  }
}

TEST_CASE("the turn between lines does not ask for their directions, and is the same for several at a time") {
  Random random(4);
  for (int k = 0; k < 400; ++k) {
    Real4 ax, ay, bx, by, one;
    for (int l = 0; l < 4; ++l) {
      const Real turn = random(-1, 1) * (k % 2 == 0 ? 0.029 : 1.57), from = random(-4, 4);
      const Vec<2> a = (l % 2 == 0 ? 1 : -1) * at(from), b = (l < 2 ? 1 : -1) * at(from + turn);
      ax[l] = a[0], ay[l] = a[1], bx[l] = b[0], by[l] = b[1];
      one[l] = turn_between_lines<Real>(a[0], a[1], b[0], b[1]);
      CHECK(one[l] == Approx(turn).margin(1e-15));
    }
    const Real4 all = turn_between_lines(ax, ay, bx, by);
    for (int l = 0; l < 4; ++l) CHECK(all[l] == one[l]);
  }
  CHECK(turn_between_lines<Real>(0, 0, 0.6, 0.8) == 0);
}

}  // namespace pliant::test::turn_test
