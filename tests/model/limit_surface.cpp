// Coulomb friction of uniform pressure on a disk that slides and spins.
#include <catch2/catch.hpp>

#include <pliant/model/limit_surface.h>

#include "support/random.h"

namespace pliant::test::limit_surface_test {

namespace {

/// Force and torque of a unit disk with the velocity 1 − s and the spin s, by summing over its area: about the centre
/// of rotation, where the direction of the motion jumps, in polar coordinates.
LimitSurface::Point by_area(Real s) {
  // A point at (ρ, φ) about the centre of rotation moves across its radius; the chord through it ends on the disk.
  const Real e = (1 - s) / s;
  const int n = 20000;
  Real force = 0, torque = 0;
  const auto add = [&](Real from, Real to, Real cosine, Real weight) {
    // ∫ ρ dρ of the force along the velocity, cos φ, and of its moment about the middle, ρ − e cos φ
    force += weight * cosine * (square(to) - square(from)) / 2;
    torque += weight * ((to * square(to) - from * square(from)) / 3 - e * cosine * (square(to) - square(from)) / 2);
  };
  const Real widest = e < 1 ? pi : std::asin(1 / e);
  for (int k = 0; k < n; ++k) {
    // φ from the direction of the middle; where that is outside, the tangents limit the range, and sin makes it smooth.
    const Real u = (k + 0.5) / n * pi - pi / 2, phi = e < 1 ? 2 * u : widest * std::sin(u);
    const Real weight = e < 1 ? 2 * pi / n : widest * std::cos(u) * pi / n;
    const Real cosine = std::cos(phi), root = std::sqrt(std::max(1 - square(e * std::sin(phi)), 0.0));
    add(e < 1 ? 0 : e * cosine - root, e * cosine + root, cosine, weight);
  }
  return {force / pi, torque / pi, 0};
}

}  // namespace

TEST_CASE("force and torque on a disk are the sums over its area") {
  for (const Real e : {0.02, 0.1, 0.3, 0.653, 0.9, 0.999, 1.001, 1.1, 2.0, 5.0, 40.0}) {
    const Real s = 1 / (1 + e);
    const LimitSurface::Point expected = by_area(s), exact = LimitSurface::exact(s), table = limit_surface().at(s);
    INFO("v/(Rω) = " << e);
    CHECK(exact.force == Approx(expected.force).epsilon(3e-6));
    CHECK(exact.torque == Approx(expected.torque).margin(3e-6));
    CHECK(table.force == Approx(exact.force).margin(2e-5));
    CHECK(table.torque == Approx(exact.torque).margin(2e-5));
  }
}

TEST_CASE("the table of force and torque is close to the exact curve everywhere, and convex") {
  Real most = 0;
  for (int k = 100; k < 20000; ++k) {
    const Real s = k / 20000.0;
    const LimitSurface::Point exact = LimitSurface::exact(s), table = limit_surface().at(s);
    most = std::max({most, std::abs(table.force - exact.force), std::abs(table.torque - exact.torque)});
    REQUIRE(table.bend > 0);
  }
  CHECK(most < 2e-5);
}

TEST_CASE("a disk that slides and spins stops with v = 0.653 Rω") {
  // v̇ = −F, Rω̇ = −2T, in steps that are as short as the motion is slow.
  for (Real ratio : {0.01, 0.5, 0.7, 3.0, 30.0}) {
    INFO("v/(Rω) at first " << ratio);
    Real v = ratio, w = 1;
    const auto rate = [](Real a, Real b) {
      const LimitSurface::Point p = limit_surface().at(b / (a + b));
      return std::pair(-p.force, -2 * p.torque);
    };
    const Real start = v + w;
    while (v + w > 1e-60 * start) {
      const Real h = 0.02 * (v + w);
      const auto [dv, dw] = rate(v, w);
      const auto [av, aw] = rate(v + h / 2 * dv, w + h / 2 * dw);
      v += h * av, w += h * aw;
    }
    CHECK(v / w == Approx(0.653).margin(5e-4));
  }
}

TEST_CASE("a disk that slides fast spins almost freely, one that spins fast slides almost freely") {
  const Real small = 1e-3;
  // T = μN R² ω/(4v), F = μN v/(Rω): an ellipse would give 4/9 and 9/4 of these ratios.
  CHECK(limit_surface().at(small).torque == Approx(small / (4 * (1 - small))).epsilon(1e-4));
  CHECK(limit_surface().at(1 - small).force == Approx(small / (1 - small)).epsilon(1e-4));
  CHECK(limit_surface().at(0).force == 1);
  CHECK(limit_surface().at(0).torque == 0);
  CHECK(limit_surface().at(1).torque == Approx(2.0 / 3).epsilon(1e-14));
  CHECK(std::abs(limit_surface().at(1).force) < 1e-14);
}

TEST_CASE("eight points at a time are what each is alone, or are said not to be found") {
  Random random(2);
  int found = 0;
  for (int k = 0; k < 2000; ++k) {
    simd::Real8 force, torque, guess;
    for (int j = 0; j < 8; ++j) {
      force.set(j, random(0, 2));
      torque.set(j, random(0, 2));
      guess.set(j, random(0, 1));
    }
    const simd::Mask8 of{{-1, -1, k % 2 - 1, -1}, {-1, k / 2 % 2 - 1, -1, -1}};
    const LimitSurface::Nearest8 eight = limit_surface().nearest(force, torque, guess, of);
    for (const int j : {2, 5}) CHECK((of[j] != 0 || eight.found[j] == 0));
    const auto p = limit_surface().at(guess);
    for (int j = 0; j < 8; ++j) {
      const LimitSurface::Point q = limit_surface().at(guess[j]);
      CHECK(p.force[j] == Approx(q.force).margin(1e-15));
      CHECK(p.torque[j] == Approx(q.torque).margin(1e-15));
      CHECK(p.bend[j] == Approx(q.bend).epsilon(1e-12));
      const LimitSurface::Nearest one = limit_surface().nearest(force[j], torque[j], guess[j]);
      if (eight.found[j] == 0) continue;
      ++found;
      CHECK((eight.outside[j] != 0) == one.outside);
      if (!one.outside) continue;
      CHECK(eight.slip[j] == Approx(one.slip).margin(1e-5));
      CHECK(eight.force[j] == Approx(one.force).margin(2e-6));
      CHECK(eight.torque[j] == Approx(one.torque).margin(2e-6));
    }
  }
  CHECK(found > 6000);
}

TEST_CASE("the nearest point of the limit surface is where the way to it is along its normal") {
  Random random(1);
  int inside = 0;
  for (int k = 0; k < 2000; ++k) {
    const Real s = random(0, 1), norm = std::hypot(s, 1 - s), away = k % 2 == 0 ? random(0, 5) : random(-0.02, 0.02);
    const LimitSurface::Point p = limit_surface().at(s);
    const Real force = p.force + away * (1 - s) / norm, torque = p.torque + away * s / norm;
    if (force < 0 || torque < 0) continue;
    const LimitSurface::Nearest found = limit_surface().nearest(force, torque, random(0, 1));
    INFO("slip " << s << ", " << away << " away");
    CHECK(found.outside == away > 0);
    CHECK(found.slip == Approx(s).margin(2e-5));
    CHECK(found.force == Approx(away > 0 ? p.force : force).margin(2e-6));
    CHECK(found.torque == Approx(away > 0 ? p.torque : torque).margin(2e-6));
    inside += away < 0;
  }
  CHECK(inside > 300);
  for (const Real deep : {0.0, 0.1, 0.3}) CHECK(!limit_surface().nearest(deep, deep, 0.5).outside);
  CHECK(LimitSurface::surely_inside<Real>(square(3 * 0.5), 3 * 0.3, 3));
  CHECK(!LimitSurface::surely_inside<Real>(square(3 * 0.5), 3 * 0.5, 3));
  for (int k = 0; k <= 1000; ++k) {
    const LimitSurface::Point p = LimitSurface::exact(k / 1000.0);
    CHECK(!LimitSurface::surely_inside<Real>(square(3.0003 * p.force), 3.0003 * p.torque, 3));
    CHECK(LimitSurface::surely_inside<Real>(square(2.4 * p.force), 2.4 * p.torque, 3));
  }
  CHECK(!LimitSurface::surely_inside<Real>(0, 3 * 0.7, 3));
}

}  // namespace pliant::test::limit_surface_test
