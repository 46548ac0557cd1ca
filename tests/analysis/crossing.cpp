#include <catch2/catch.hpp>
#include <cmath>

#include <pliant/analysis/crossing.h>

namespace pliant::test::crossing_test {

namespace {

/// A swing with exact crossings: height cos t.
Sighting<2> swing(Real t) { return {t, {t, std::cos(t)}, {1, -std::sin(t)}}; }

}  // namespace

TEST_CASE("a particle in free fall is found on the line to rounding") {
  const Real t = std::sqrt(0.2);
  const auto fall = [](Real at) { return Sighting<3>{at, {2 * at, -at, 0.1 - at * at / 2}, {2, -1, -at}}; };
  const Sighting<3> found = on_the_line(fall(0.1), fall(0.7));
  CHECK(found.t == Approx(t).epsilon(1e-14));
  CHECK(found.x[0] == Approx(2 * t).epsilon(1e-14));
  CHECK(found.x[1] == Approx(-t).epsilon(1e-14));
  CHECK(std::abs(found.x[2]) < 1e-15);
  CHECK(found.v[0] == Approx(2).epsilon(1e-13));
  CHECK(found.v[2] == Approx(-t).epsilon(1e-13));
}

TEST_CASE("the error of a crossing falls with the fourth power of the step") {
  const auto error = [](Real h) {
    return std::abs(on_the_line(swing(M_PI_2 - 0.3 * h), swing(M_PI_2 + 0.7 * h)).t - M_PI_2);
  };
  CHECK(std::log2(error(0.4) / error(0.2)) > 3.8);
  CHECK(error(0.1) < 1e-6);
}

TEST_CASE("crossings at the ends of a step, and of particles that start below the line") {
  const Sighting<2> first = swing(M_PI_2 - 0.2), on{1, {3, 0}, {0, -1}}, below{2, {3, -1}, {0, -1}};
  CHECK(on_the_line(on, below).t == 1);
  CHECK(on_the_line(first, {M_PI_2, {M_PI_2, -1e-17}, {1, -1}}).t == Approx(M_PI_2).epsilon(1e-13));
  CHECK(on_the_line(below, {2.1, {3, -1.1}, {0, -1}}).t == 2);
  CHECK(on_the_line(below, below).t == 2);
}

}  // namespace pliant::test::crossing_test
