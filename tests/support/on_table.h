// Common tests of disks and polygons on a substrate.
#pragma once

#include <catch2/catch.hpp>

#include <cmath>

#include "frictional.h"
#include "order.h"

namespace pliant::test {

/// position(v, h): position at t = 0.05 of a particle with initial velocity v along x, with the step h; μg = 3, a
/// displacement of 0.01 at the limit, without damping.
template <class Position>
void check_orders_on_table(Position&& position) {
  const auto error = [&](Real v, Real h, Real exact) { return std::abs(position(v, h) - exact); };
  const Real omega = std::sqrt(0.3 * 10 / 0.01);
  require_order(
      "sticks", [&](Real h) { return error(0.1, h, 0.1 / omega * std::sin(omega * 0.05)); }, 0.005, 2);
  // Until springs are at their limit at sin ωt₁ = 0.01 ω/v, then with the acceleration −μg.
  const Real v = 0.3, t1 = std::asin(0.01 * omega / v) / omega, v1 = v * std::cos(omega * t1), rest = 0.05 - t1;
  REQUIRE(v1 > 3 * rest);
  const Real exact = 0.01 + v1 * rest - 1.5 * square(rest);
  const OrderFit fit = fit_order([&](Real h) { return error(v, h, exact); }, 0.002, 5);
  INFO(fit.text());
  CHECK(fit.errors.front() < 1e-3);
  CHECK(fit.slope() > 0.9);
}

/// Of a particle that starts within the static limit at 0.6 along x, breaks away after 0.02, and has no damping.
inline void check_heat_of_breaking_away(Simulation<2>& s, Real mass) {
  const Real before = energy(s);
  s.advance(0.02);
  CHECK(sum_of_heat(s, "base_friction") < 1e-12);
  s.advance(0.05);
  const Real lost = before - energy(s);
  CHECK(lost > 0.05 * mass);
  CHECK(sum_of_heat(s, "base_friction") == Approx(lost).epsilon(5e-3));
}

}  // namespace pliant::test
