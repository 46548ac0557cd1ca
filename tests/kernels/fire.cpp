// The passes of minimisers, against sums in a given order.
#include <pliant/kernels/fire.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace pliant::test::fire_test {

namespace {

std::vector<Real> random_numbers(std::size_t n, int seed, Real unit = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<Real> normal;
  std::vector<Real> values(n);
  for (Real& value : values) value = unit * normal(random);
  return values;
}

/// The sum as four numbers at a time give it.
template <class Term>
Real sum_by_fours(std::size_t n, const Term& term) {
  Real lanes[4] = {};
  for (std::size_t i = 0; i < n / 4 * 4; ++i) lanes[i % 4] += term(i);
  Real pair[2] = {lanes[0] + lanes[2], lanes[1] + lanes[3]};
  for (std::size_t i = n / 4 * 4; i < n / 2 * 2; ++i) pair[i % 2] += term(i);
  return n % 2 == 0 ? pair[0] + pair[1] : pair[0] + pair[1] + term(n - 1);
}

}  // namespace

TEST_CASE("passes of minimisers have the same bits on every machine") {
  for (const std::size_t n : {1, 2, 3, 4, 5, 6, 7, 8, 801, 802, 4096, 4099, 10000}) {
    CAPTURE(n);
    const std::vector<Real> f = random_numbers(n, 1);
    std::vector<Real> v = random_numbers(n, 2), x = random_numbers(n, 3);
    const FireForces forces = fire_forces(n, f.data(), v.data());
    CHECK(forces.power == sum_by_fours(n, [&](std::size_t i) { return f[i] * v[i]; }));
    const auto [least, most] = std::minmax_element(f.begin(), f.end());
    CHECK(forces.largest == std::max(-*least, *most));
    CHECK(std::abs(forces.norm / std::sqrt(sum_by_fours(n, [&](std::size_t i) { return f[i] * f[i]; })) - 1) < 1e-14);

    std::vector<Real> kicked = v;
    for (std::size_t i = 0; i < n; ++i) kicked[i] += 0.3 * f[i];
    CHECK(fire_kick(n, 0.3, f.data(), v.data()) ==
          sum_by_fours(n, [&](std::size_t i) { return kicked[i] * kicked[i]; }));
    CHECK(v == kicked);

    Real largest = 0;
    for (std::size_t i = 0; i < n; ++i) {
      kicked[i] = 0.7 * kicked[i] + 0.1 * f[i];
      largest = std::max(largest, std::abs(kicked[i]));
    }
    CHECK(fire_turn(n, 0.7, 0.1, f.data(), v.data()) == largest);
    CHECK(v == kicked);

    std::vector<Real> moved = x;
    for (std::size_t i = 0; i < n; ++i) moved[i] += 0.2 * v[i];
    add_multiple(n, 0.2, v.data(), x.data());
    CHECK(x == moved);
    CHECK(dot(n, x.data(), f.data()) == sum_by_fours(n, [&](std::size_t i) { return x[i] * f[i]; }));
  }
}

TEST_CASE("the norm of forces holds where their squares underflow, and reports forces that are not finite") {
  const std::size_t n = 5000;
  for (const Real unit : {1e-300, 1e-200, 1e200}) {
    CAPTURE(unit);
    std::vector<Real> f(n, unit);
    const FireForces forces = fire_forces(n, f.data(), f.data());
    CHECK(std::abs(forces.norm / unit / std::sqrt(Real(n)) - 1) < 1e-12);
    CHECK(forces.largest == unit);
  }
  for (const Real bad : {std::numeric_limits<Real>::quiet_NaN(), -std::numeric_limits<Real>::infinity()})
    for (const std::size_t at : {std::size_t{0}, std::size_t{4097}, n - 1}) {
      std::vector<Real> f = random_numbers(n, 4);
      f[at] = bad;
      CHECK_FALSE(std::isfinite(fire_forces(n, f.data(), f.data()).norm));
    }
  CHECK(fire_forces(0, nullptr, nullptr).norm == 0);
}

}  // namespace pliant::test::fire_test
