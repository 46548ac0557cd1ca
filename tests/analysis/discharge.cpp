#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <pliant/analysis/discharge.h>
#include <pliant/base/errors.h>

using namespace pliant;

namespace {

struct Series {
  std::vector<Real> time;
  std::vector<std::int64_t> count;

  DischargeFit fit() const { return fit_discharge(time, count); }
};

/// N(t) = (sqrt(N0) − c0 t/2)², rounded to the nearest integer, until some time after the last particle.
Series exact(Real n0, Real c0, Real dt) {
  Series series;
  const Real end = 2 * std::sqrt(n0) / c0;
  for (Real t = 0; t < 1.1 * end; t += dt) {
    series.time.push_back(t + 5);
    series.count.push_back(t < end ? std::llround(square(std::sqrt(n0) - c0 * t / 2)) : 0);
  }
  return series;
}

}  // namespace

TEST_CASE("discharge: the exact law, rounded to integers") {
  const Real n0 = GENERATE(1600., 400.), c0 = GENERATE(0.3, 2.);
  const Real dt = GENERATE(0.01, 0.2);
  const Series series = exact(n0, c0, dt);
  const DischargeFit fit = series.fit();
  CAPTURE(n0, c0, dt, fit.c0, fit.error, fit.rounding_error);
  CHECK(fit.c0 == Approx(c0).epsilon(1e-3));
  REQUIRE(fit.error > 0);
  CHECK(std::abs(fit.c0 - c0) < 2 * fit.error);
  CHECK(fit.error < 0.01 * c0);
  CHECK(fit.rounding_error < fit.error);
  CHECK(fit.excluded == (n0 == 1600 ? 100 : 40));
  CHECK(series.count[fit.begin] <= n0 - Real(fit.excluded));
  CHECK(series.count[fit.begin - 1] > n0 - Real(fit.excluded));
  CHECK(series.count[fit.end - 1] >= fit.excluded);
  CHECK(series.count[fit.end] < fit.excluded);
  // Rounding shows the last particle as gone when half of it is left: 2 sqrt(1/2)/c0 early.
  const Real emptied = 2 * (std::sqrt(n0) - std::sqrt(0.5)) / c0;
  CHECK(fit.total_time >= emptied - dt);
  CHECK(fit.total_time <= emptied + 2 * dt);
}

TEST_CASE("discharge: random arrivals, the error covers the true value") {
  const Real c0 = 1;
  std::mt19937_64 random(17);
  int covered_1 = 0, covered_2 = 0;
  Real squares = 0, error_sum = 0;
  const int realisations = 300;
  for (int r = 0; r < realisations; ++r) {
    Series series;
    Real next = 0;
    std::int64_t n = 1600;
    for (Real t = 0; n > 0; t += 0.1) {
      while (n > 0 && next <= t) {
        --n;
        // Time change: arrivals with rate c0 sqrt(n).
        next += std::exponential_distribution<Real>(c0 * std::sqrt(Real(n) + 1e-9))(random);
      }
      series.time.push_back(t);
      series.count.push_back(n);
    }
    const DischargeFit fit = series.fit();
    const Real deviation = std::abs(fit.c0 - c0);
    squares += square(deviation);
    error_sum += fit.error;
    covered_1 += deviation < fit.error;
    covered_2 += deviation < 2 * fit.error;
  }
  CAPTURE(std::sqrt(squares / realisations), error_sum / realisations, covered_1, covered_2);
  CHECK(error_sum / realisations == Approx(std::sqrt(squares / realisations)).epsilon(0.2));
  CHECK(covered_1 > 0.55 * realisations);
  CHECK(covered_1 < 0.80 * realisations);
  CHECK(covered_2 > 0.87 * realisations);
}

TEST_CASE("discharge: transients at the ends are left out") {
  Series series = exact(1600, 1, 0.05);
  for (std::size_t i = 0; i < series.count.size(); ++i) {
    if (series.count[i] > 1500 && series.count[i] < 1600) series.count[i] = 1550;
    if (series.count[i] < 100) series.count[i] /= 2;
  }
  CHECK(series.fit().c0 == Approx(1).epsilon(1e-3));
}

TEST_CASE("discharge: a clog ends the fit, the hopper never empties") {
  Series series = exact(1600, 1, 0.05);
  for (auto& n : series.count) n = std::max<std::int64_t>(n, 700);
  const DischargeFit fit = series.fit();
  CHECK(fit.c0 == Approx(1).epsilon(2e-3));
  CHECK(std::isnan(fit.total_time));
  CHECK(series.count[fit.end - 1] == 700);
  CHECK(series.count[fit.end - 2] == 701);
}

TEST_CASE("discharge: too little to fit, bad input") {
  CHECK(std::isnan(fit_discharge({}, {}).c0));
  const Series nothing{{0, 1, 2, 3, 4}, {50, 50, 50, 50, 50}};
  CHECK(std::isnan(nothing.fit().c0));
  CHECK(std::isnan(nothing.fit().total_time));
  const Series empty{{0, 1, 2, 3}, {0, 0, 0, 0}};
  CHECK(std::isnan(empty.fit().c0));
  CHECK(empty.fit().total_time == 0);
  const Series few{{0, 1, 2, 3, 4}, {100, 81, 64, 49, 36}};
  CHECK(few.fit().c0 == Approx(2));
  CHECK(std::isnan(few.fit().error));

  CHECK_THROWS_AS((Series{{0, 1}, {3}}.fit()), InputError);
  CHECK_THROWS_AS((Series{{1, 0}, {3, 2}}.fit()), InputError);
  CHECK_THROWS_AS((Series{{0, 1}, {3, -1}}.fit()), InputError);
}
