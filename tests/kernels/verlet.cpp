// The passes of velocity Verlet, against the formulas point by point.
#include <pliant/kernels/verlet.h>

#include <catch2/catch.hpp>
#include <limits>

#include "support/random.h"

using namespace pliant;
using namespace pliant::test;

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
    std::vector<Real> x_next(n), predicted(n), v_next = v, x_after(n), predicted_after(n), x_again(n),
                                               predicted_again(n);
    verlet_predict(n, h, x.data(), v.data(), a.data(), x_next.data(), predicted.data());
    verlet_complete(n, h, x_next.data(), v_next.data(), a_next.data(), predicted.data(), x_after.data(),
                    predicted_after.data());
    for (std::size_t i = 0; i < n; ++i) {
      CHECK(x_next[i] == Approx(x[i] + h * v[i] + h * h / 2 * a[i]).margin(1e-15));
      CHECK(predicted[i] == Approx(v[i] + h * a[i]).margin(1e-15));
      CHECK(v_next[i] == Approx(v[i] + h / 2 * (a[i] + a_next[i])).margin(1e-15));
    }
    auto in_place = x, predicted_in_place = v, v_alone = v;
    verlet_predict(n, h, in_place.data(), v.data(), a.data(), in_place.data(), predicted_in_place.data());
    CHECK(in_place == x_next);
    CHECK(predicted_in_place == predicted);
    verlet_complete(n, h, v_alone.data(), a_next.data(), predicted.data());
    CHECK(v_alone == v_next);
    // A restart predicts anew.
    verlet_predict(n, h, x_next.data(), v_next.data(), a_next.data(), x_again.data(), predicted_again.data());
    CHECK(x_again == x_after);
    CHECK(predicted_again == predicted_after);
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

TEMPLATE_TEST_CASE_SIG("points that have left their places are seen", "", ((int D), D), 2, 3) {
  Random random(2);
  for (const std::size_t n : {0, 1, 5, 64, 101}) {
    const auto reference = numbers(random, n * D);
    auto x = reference;
    for (Real& value : x) value += 0.1 / std::sqrt(D) * random(-1, 1);
    CHECK(all_within<D>(n, 0.1, x.data(), reference.data()));
    for (std::size_t i = 0; i < n; ++i)
      for (const Real by :
           {0.15, -1.0, std::numeric_limits<Real>::infinity(), std::numeric_limits<Real>::quiet_NaN()}) {
        auto moved = x;
        moved[i * D + i % D] = reference[i * D + i % D] + by;
        CHECK_FALSE(all_within<D>(n, 0.1, moved.data(), reference.data()));
      }
  }
}
