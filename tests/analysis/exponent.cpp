#include <catch2/catch.hpp>
#include <limits>

#include <pliant/analysis/exponent.h>

namespace pliant::test::exponent_test {

TEST_CASE("exponent of the flow rate: limits and crossover") {
  const int d = GENERATE(2, 3);
  const Real infinity = std::numeric_limits<Real>::infinity();
  CHECK(beta_sigmoid(0, d, 0.05, 0.7) == d - 0.5);
  CHECK(beta_sigmoid(infinity, d, 0.05, 0.7) == d - 1.5);
  CHECK(beta_sigmoid(0.05, d, 0.05, 0.7) == d - 1);
  // b decades above the crossover: tanh(1).
  CHECK(beta_sigmoid(0.05 * std::pow(10, 0.7), d, 0.05, 0.7) == Approx(d - 1 - std::tanh(1) / 2));
  CHECK_THROWS_AS(beta_sigmoid(-1, d, 0.05, 0.7), InputError);
  CHECK_THROWS_AS(beta_sigmoid(1, d, 0, 0.7), InputError);
}

}  // namespace pliant::test::exponent_test
