// The passes of velocity Verlet, against the formulas point by point.
#include <pliant/kernels/verlet.h>

#include <catch2/catch.hpp>
#include <limits>

#include "support/random.h"

namespace pliant::test::verlet_test {

namespace {

std::vector<Real> numbers(Random& random, std::size_t n) {
  std::vector<Real> values(n);
  for (Real& value : values) value = random(-1, 1);
  return values;
}

}  // namespace

TEST_CASE("one pass completes a step and predicts the next") {
  Random random(1);
  const Real h = 0.1;
  // Around the widths of vectors.
  for (const std::size_t n : {0, 1, 3, 8, 17, 1000}) {
    const auto x = numbers(random, n), v = numbers(random, n), a = numbers(random, n), a_next = numbers(random, n);
    std::vector<Real> predicted(n), x_next(n), v_next = v, x_after(n), predicted_after(n);
    verlet_predict(n, h, v.data(), a.data(), predicted.data());
    const Real moved = verlet_drift(n, h, x.data(), v.data(), predicted.data(), x_next.data());
    const Real moves = verlet_kick_drift(n, h, x_next.data(), v_next.data(), a_next.data(), predicted.data(),
                                         x_after.data(), predicted_after.data());
    Real largest = 0, largest_after = 0;
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(x_next[i] == Approx(x[i] + h * v[i] + h * h / 2 * a[i]).margin(1e-15));
      CHECK(predicted[i] == Approx(v[i] + h * a[i]).margin(1e-15));
      CHECK(v_next[i] == Approx(v[i] + h / 2 * (a[i] + a_next[i])).margin(1e-15));
      CHECK(predicted_after[i] == Approx(v_next[i] + h * a_next[i]).margin(1e-15));
      CHECK(x_after[i] == Approx(x_next[i] + h * v_next[i] + h * h / 2 * a_next[i]).margin(1e-15));
      largest = std::max(largest, std::abs(x_next[i] - x[i]));
      largest_after = std::max(largest_after, std::abs(x_after[i] - x_next[i]));
    }
    CHECK(moved == largest);
    CHECK(moves == largest_after);
    // Pass by pass, and in place.
    auto in_place = x, v_alone = v, predicted_in_place = predicted;
    CHECK(verlet_drift(n, h, in_place.data(), v.data(), predicted.data(), in_place.data()) == moved);
    CHECK(in_place == x_next);
    CHECK(verlet_kick(n, h, v_alone.data(), a_next.data(), predicted_in_place.data()));
    CHECK(v_alone == v_next);
    CHECK(predicted_in_place == predicted_after);
    CHECK(verlet_drift(n, h, in_place.data(), v_alone.data(), predicted_in_place.data(), in_place.data()) == moves);
    CHECK(in_place == x_after);
    for (const Real broken : {std::numeric_limits<Real>::infinity(), std::numeric_limits<Real>::quiet_NaN()})
      for (const std::size_t at : {std::size_t{0}, n / 2, n - 1}) {
        if (n == 0) continue;
        auto a_broken = a_next;
        a_broken[at] = broken;
        CHECK(!verlet_kick(n, h, v_alone.data(), a_broken.data(), predicted_in_place.data()));
      }
  }
}

TEST_CASE("errors are weighed by the tolerances") {
  Random random(3);
  for (const std::size_t n : {0, 1, 3, 8, 17, 1000}) {
    const auto f = numbers(random, n), f_old = numbers(random, n), y = numbers(random, n), y_old = numbers(random, n);
    std::vector<Real> absolute(n), relative(n);
    Real sum = 0, largest = 0;
    for (std::size_t i = 0; i < n; ++i) {
      absolute[i] = random(0.1, 1);
      relative[i] = random(0, 1);
      const Real error =
          0.3 * (f[i] - f_old[i]) / (absolute[i] + relative[i] * std::max(std::abs(y[i]), std::abs(y_old[i])));
      sum += error * error;
      largest = std::max(largest, error * error);
    }
    const WeightedSquares squares =
        weighted_squares(n, 0.3, f.data(), f_old.data(), y.data(), y_old.data(), absolute.data(), relative.data());
    CHECK(squares.sum == Approx(sum).margin(1e-15));
    CHECK(squares.largest == Approx(largest).margin(1e-15));
  }
}

TEMPLATE_TEST_CASE_SIG("the point farthest from its place is found", "", ((int D), D), 2, 3) {
  Random random(2);
  for (const std::size_t n : {0, 1, 5, 64, 101}) {
    const auto reference = numbers(random, n * D);
    auto x = reference;
    for (Real& value : x) value += 0.1 / std::sqrt(D) * random(-1, 1);
    const Real among = farthest<D>(n, x.data(), reference.data());
    CHECK(among <= 0.1);
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(among >= (point<D>(x.data(), Index(i)) - point<D>(reference.data(), Index(i))).norm() * (1 - 1e-15));
      auto moved = x;
      point<D>(moved.data(), Index(i)) = point<D>(reference.data(), Index(i));
      moved[i * D + i % D] += 0.15;
      CHECK(farthest<D>(n, moved.data(), reference.data()) == Approx(0.15).epsilon(1e-14));
      for (const Real to : {std::numeric_limits<Real>::infinity(), std::numeric_limits<Real>::quiet_NaN()}) {
        moved[i * D + i % D] = to;
        CHECK(farthest<D>(n, moved.data(), reference.data()) == std::numeric_limits<Real>::infinity());
      }
    }
  }
}

}  // namespace pliant::test::verlet_test
