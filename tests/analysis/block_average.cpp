#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include <pliant/analysis/block_average.h>
#include <pliant/base/errors.h>

namespace pliant::test::block_average_test {

namespace {

/// Stationary AR(1) series x_i = φ x_{i−1} + ε_i of unit variance.
std::vector<Real> ar1(std::size_t n, Real phi, std::mt19937_64& random) {
  std::normal_distribution<Real> normal;
  std::vector<Real> x(n);
  Real value = normal(random);
  for (Real& entry : x) {
    entry = value;
    value = phi * value + std::sqrt(1 - phi * phi) * normal(random);
  }
  return x;
}

/// Exact standard error of the mean of `ar1`: var = (1/n) Σ_k (1 − |k|/n) φ^|k|.
Real ar1_error(std::size_t n, Real phi) {
  Real sum = 1;
  for (std::size_t k = 1; k < n; ++k) sum += 2 * (1 - Real(k) / Real(n)) * std::pow(phi, Real(k));
  return std::sqrt(sum / Real(n));
}

std::vector<Real> line(std::size_t n, Real start, Real step) {
  std::vector<Real> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = start + step * Real(i);
  return values;
}

}  // namespace

TEST_CASE("block error of an AR(1) series agrees with theory and covers the true mean") {
  const Real phi = GENERATE(0.0, 0.5, 0.9, -0.5);
  const std::size_t n = 4096;
  const int realisations = 400;
  const Real expected = ar1_error(n, phi);
  std::mt19937_64 random(7);
  int plateaus = 0, covered_1 = 0, covered_2 = 0;
  Real error_sum = 0, inefficiency_sum = 0;
  for (int r = 0; r < realisations; ++r) {
    const BlockAverage average = block_average(ar1(n, phi, random));
    if (!average.plateau) continue;
    ++plateaus;
    error_sum += average.error;
    inefficiency_sum += average.inefficiency;
    covered_1 += std::abs(average.mean) < average.error;
    covered_2 += std::abs(average.mean) < 2 * average.error;
  }
  CAPTURE(phi, expected, plateaus, covered_1, covered_2, error_sum / plateaus);
  REQUIRE(plateaus >= 0.98 * realisations);
  CHECK(error_sum / plateaus == Approx(expected).epsilon(0.08));
  CHECK(inefficiency_sum / plateaus == Approx((1 + phi) / (1 - phi)).epsilon(0.15));
  // Normal: 0.683 and 0.954; Student's t of 15 degrees of freedom: 0.667 and 0.936. Three standard deviations: 0.07,
  // 0.035.
  CHECK(covered_1 / Real(plateaus) > 0.60);
  CHECK(covered_1 / Real(plateaus) < 0.76);
  CHECK(covered_2 / Real(plateaus) > 0.90);
}

TEST_CASE("a slow part that fast noise hides is in the error of a slow average") {
  // As of a packing fraction: the samples are nearly independent, their mean changes over 60 of them.
  const std::size_t n = 2000;
  const Real part = 0.3, slow = std::exp(-1 / Real{60});
  const Real expected = std::hypot(ar1_error(n, 0), part * ar1_error(n, slow));
  std::mt19937_64 random(17);
  Real blocks = 0, stretches = 0;
  const int realisations = 200;
  for (int r = 0; r < realisations; ++r) {
    auto series = ar1(n, 0, random);
    const auto drifting = ar1(n, slow, random);
    for (std::size_t i = 0; i < n; ++i) series[i] += part * drifting[i];
    blocks += square(block_average(series).error) / realisations;
    stretches += square(slow_average(series).error) / realisations;
  }
  CAPTURE(expected, std::sqrt(blocks), std::sqrt(stretches));
  CHECK(std::sqrt(blocks) < 0.7 * expected);  // one length of blocks does not do
  CHECK(std::sqrt(stretches) > 0.8 * expected);
  CHECK(std::sqrt(stretches) < 1.1 * expected);
}

TEST_CASE("without a slow part a slow average is one of blocks, or a little more careful") {
  std::mt19937_64 random(19);
  Real blocks = 0, stretches = 0;
  for (int r = 0; r < 100; ++r) {
    const auto series = ar1(2000, 0.5, random);
    blocks += block_average(series).error / 100;
    stretches += slow_average(series).error / 100;
    CHECK(slow_average(series).mean == block_average(series).mean);
    CHECK(slow_average(series).error >= block_average(series).error);
  }
  CHECK(stretches < 1.2 * blocks);
  CHECK(std::isnan(slow_average(ar1(30, 0, random)).error));
}

TEST_CASE("white noise: small blocks, error close to the naive one") {
  std::mt19937_64 random(3);
  const auto series = ar1(10000, 0, random);
  const BlockAverage average = block_average(series);
  REQUIRE(average.plateau);
  CHECK(average.block_size == 32);  // first power of two with B³ > 2 · 10000
  CHECK(average.blocks == 312);
  CHECK(average.samples == 10000);
  CHECK(average.error == Approx(0.01).epsilon(0.15));
  CHECK(average.naive_error == Approx(0.01).epsilon(0.03));
  CHECK(average.error_of_error == Approx(average.error / std::sqrt(2 * 311.0)));
  CHECK(average.lower_bound >= average.error);
}

TEST_CASE("no plateau, no error: too short, drifting, or longer correlated than the series") {
  std::mt19937_64 random(5);
  SECTION("too short") {
    for (const std::size_t n : {0, 1, 2, 10, 63}) {
      const BlockAverage average = block_average(ar1(n, 0, random));
      CHECK_FALSE(average.plateau);
      CHECK(std::isnan(average.error));
      CHECK(std::isnan(average.inefficiency));
      CHECK(std::isnan(average.mean) == (n == 0));
      CHECK(std::isnan(average.naive_error) == (n < 2));
    }
    CHECK(std::isnan(block_average(std::vector<Real>(10, 1.0)).error));
  }
  SECTION("drift") {
    auto series = ar1(2000, 0, random);
    for (std::size_t i = 0; i < series.size(); ++i) series[i] += 3 * Real(i) / Real(series.size());
    const BlockAverage average = block_average(series);
    CHECK(std::isnan(average.error));
    CHECK(average.lower_bound > 5 * average.naive_error);
  }
  SECTION("strongly correlated") { CHECK(std::isnan(block_average(ar1(500, 0.99, random)).error)); }
  SECTION("not finite") {
    auto series = ar1(500, 0, random);
    series[100] = std::nan("");
    const BlockAverage average = block_average(series);
    CHECK_FALSE(average.plateau);
    CHECK(std::isnan(average.mean));
    CHECK(std::isnan(average.error));
  }
}

TEST_CASE("a constant series has error 0, also far from zero") {
  const BlockAverage average = block_average(std::vector<Real>(1000, 1e8 + 0.1));
  CHECK(average.mean == 1e8 + 0.1);
  CHECK(average.plateau);
  CHECK(average.error == 0);
  CHECK(average.inefficiency == 1);
}

TEST_CASE("ratio of two correlated series") {
  std::mt19937_64 random(11);
  // Independent draws: relative variance of the ratio of means of 3 + a and 2 + b is (var a/9 + var b/4)/n.
  const std::size_t n = 20000;
  const auto a = ar1(n, 0, random), b = ar1(n, 0, random);
  std::vector<Real> numerator(n), denominator(n), proportional(n);
  for (std::size_t i = 0; i < n; ++i) {
    numerator[i] = 3 + 0.3 * a[i];
    denominator[i] = 2 + 0.2 * b[i];
    proportional[i] = 1.5 * denominator[i];
  }
  const BlockAverage ratio = block_ratio(numerator, denominator);
  const Real expected = 1.5 * std::sqrt((0.01 + 0.01) / n);
  CHECK(ratio.error == Approx(expected).epsilon(0.15));
  CHECK(std::abs(ratio.mean - 1.5) < 4 * expected);
  CHECK(block_ratio(proportional, denominator).mean == Approx(1.5));
  CHECK(block_ratio(proportional, denominator).error < 1e-15);
  CHECK(std::isnan(block_ratio(std::vector<Real>(100), std::vector<Real>(100)).mean));
  CHECK_THROWS_AS(block_ratio(numerator, std::vector<Real>(3)), InputError);
}

TEST_CASE("flow rate of random arrivals has the Poisson error") {
  const Real rate = 4, duration = 1000, area = 0.5;
  const bool uneven = GENERATE(false, true);
  std::mt19937_64 random(13);
  std::uniform_real_distribution<Real> uniform;
  std::exponential_distribution<Real> wait(rate);
  std::vector<Real> time{0};
  while (time.back() < duration) time.push_back(time.back() + (uneven ? 0.2 + uniform(random) : 0.5));
  int covered = 0;
  Real error_sum = 0;
  const int realisations = 200;
  const Real truth = rate * area;
  for (int r = 0; r < realisations; ++r) {
    std::vector<Real> crossed;
    Real next = wait(random), sum = 0;
    for (const Real t : time) {
      for (; next < t; next += wait(random)) sum += area;
      crossed.push_back(sum);
    }
    const FlowRate flow = flow_rate(time, crossed);
    REQUIRE(flow.value == Approx((crossed.back() - crossed.front()) / (time.back() - time.front())));
    REQUIRE(flow.blocks.mean == Approx(flow.value));
    REQUIRE(flow.error > 0);
    error_sum += flow.error;
    covered += std::abs(flow.value - truth) < flow.error;
  }
  CAPTURE(uneven, covered);
  CHECK(error_sum / realisations == Approx(area * std::sqrt(rate / duration)).epsilon(0.06));
  CHECK(covered / Real(realisations) > 0.58);
  CHECK(covered / Real(realisations) < 0.78);
}

TEST_CASE("flow rate: steady, empty and short series") {
  const auto time = line(257, 2, 0.25);
  SECTION("uniform flow is exact, whatever the spacing") {
    const FlowRate flow = flow_rate(time, line(257, 10, 0.75));
    CHECK(flow.value == 3);
    CHECK(flow.error == 0);
    CHECK(flow.bin == 0.25);
    CHECK(flow.blocks.samples == 256);
    auto thinned_time = time;
    auto thinned = line(257, 10, 0.75);
    thinned_time.erase(thinned_time.begin() + 30);
    thinned.erase(thinned.begin() + 30);
    const FlowRate gap = flow_rate(thinned_time, thinned);
    CHECK(gap.bin == 0.5);
    CHECK(gap.blocks.samples == 128);
    CHECK(gap.value == 3);
    CHECK(gap.error == Approx(0).margin(1e-12));
  }
  SECTION("no crossing: rate 0, error unknown") {
    const FlowRate flow = flow_rate(time, std::vector<Real>(257, 5));
    CHECK(flow.value == 0);
    CHECK(std::isnan(flow.error));
    CHECK(std::isnan(flow.correlation_time));
  }
  SECTION("too few samples") {
    CHECK(std::isnan(flow_rate({}, {}).value));
    CHECK(std::isnan(flow_rate(line(1, 0, 1), line(1, 0, 1)).value));
    const FlowRate flow = flow_rate(line(20, 0, 1), line(20, 0, 2));
    CHECK(flow.value == 2);
    CHECK(std::isnan(flow.error));
  }
  SECTION("rounded times do not lose a bin") {
    CHECK(flow_rate(line(1001, 0.3, 0.1), line(1001, 0, 1)).blocks.samples == 1000);
  }
  SECTION("bad input") {
    CHECK_THROWS_AS(flow_rate(time, line(5, 0, 1)), InputError);
    CHECK_THROWS_AS(flow_rate(line(9, 0, -1), line(9, 0, 1)), InputError);
    CHECK_THROWS_AS(flow_rate(line(9, 0, 1), line(9, 0, -1)), InputError);
    CHECK_THROWS_AS(flow_rate(line(9, 0, 1), line(9, std::nan(""), 1)), InputError);
  }
}

TEST_CASE("rates between samples") {
  const std::vector<Real> time{0, 1, 3}, cumulative{2, 5, 6};
  CHECK(rate_series(time, cumulative) == std::vector<Real>{3, 0.5});
  CHECK(rate_series({}, {}).empty());
}

}  // namespace pliant::test::block_average_test
