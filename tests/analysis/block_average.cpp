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

namespace {

/// Stationary AR(2) series: a noisy oscillation that keeps its phase for one period.
std::vector<Real> oscillation(std::size_t n, Real period, std::mt19937_64& random) {
  const Real decay = std::exp(-1 / period), turn = 2 * decay * std::cos(2 * pi / period);
  std::normal_distribution<Real> normal;
  const auto start = static_cast<std::size_t>(20 * period);
  std::vector<Real> x(n + start);
  for (std::size_t i = 2; i < x.size(); ++i) x[i] = turn * x[i - 1] - decay * decay * x[i - 2] + normal(random);
  return {x.begin() + static_cast<std::ptrdiff_t>(start), x.end()};
}

/// Noise with a slow part that it hides: as packing fractions of hoppers have it.
std::vector<Real> hidden(std::size_t n, Real part, Real time, std::mt19937_64& random) {
  std::vector<Real> x = ar1(n, 0, random);
  const std::vector<Real> slow = ar1(n, std::exp(-1 / time), random);
  for (std::size_t i = 0; i < n; ++i) x[i] += part * slow[i];
  return x;
}

/// How often an average of zero is within one and two of its errors, among series that have an error.
struct Coverage {
  int series = 0, known = 0, once = 0, twice = 0;

  void add(const BlockAverage& average) {
    ++series;
    if (std::isnan(average.error)) return;
    ++known;
    once += std::abs(average.mean) < average.error;
    twice += std::abs(average.mean) < 2 * average.error;
  }
  Real share(int covered) const { return covered / Real(known); }
};

}  // namespace

TEST_CASE("errors of slow averages cover the true mean as often as errors should") {
  const std::size_t n = 650;  // 130 t0 of a hopper
  struct Kind {
    const char* name;
    std::vector<Real> (*make)(std::size_t, std::mt19937_64&);
  };
  const Kind kind = GENERATE(values<Kind>({
      {"white noise", [](std::size_t m, std::mt19937_64& r) { return ar1(m, 0, r); }},
      {"correlated over 1/200", [](std::size_t m, std::mt19937_64& r) { return ar1(m, std::exp(-1 / 3.25), r); }},
      {"correlated over 1/50", [](std::size_t m, std::mt19937_64& r) { return ar1(m, std::exp(-1 / 13.0), r); }},
      {"correlated over 1/25", [](std::size_t m, std::mt19937_64& r) { return ar1(m, std::exp(-1 / 26.0), r); }},
      {"slow part under noise, 1/50", [](std::size_t m, std::mt19937_64& r) { return hidden(m, 0.3, 13, r); }},
      {"slow part under noise, 1/25", [](std::size_t m, std::mt19937_64& r) { return hidden(m, 0.3, 26, r); }},
      {"oscillation of 1/100", [](std::size_t m, std::mt19937_64& r) { return oscillation(m, 6.5, r); }},
      {"oscillation of 1/30", [](std::size_t m, std::mt19937_64& r) { return oscillation(m, 21.7, r); }},
  }));
  std::mt19937_64 random(23);
  Coverage coverage;
  for (int r = 0; r < 1000; ++r) coverage.add(slow_average(kind.make(n, random)));
  CAPTURE(kind.name, coverage.known, coverage.once, coverage.twice);
  CHECK(coverage.known > 0.99 * coverage.series);
  // Normal errors: 0.683 and 0.954. Three standard deviations of 1000 series: 0.044 and 0.020; the rest is the
  // distribution of an error that is itself known to 30 % only.
  CHECK(coverage.share(coverage.once) > 0.60);
  CHECK(coverage.share(coverage.once) < 0.80);
  CHECK(coverage.share(coverage.twice) > 0.88);
  CHECK(coverage.share(coverage.twice) < 0.99);
}

TEST_CASE(
    "slow averages: mean and independent samples are those of blocks, no error without enough samples or of a drift") {
  std::mt19937_64 random(19);
  Real error = 0, inefficiency = 0;
  for (int r = 0; r < 200; ++r) {
    const auto series = ar1(2000, 0.5, random);
    const BlockAverage slow = slow_average(series), blocks = block_average(series);
    CHECK(slow.mean == blocks.mean);
    CHECK(slow.naive_error == blocks.naive_error);
    error += square(slow.error) / 200;
    inefficiency += slow.inefficiency / 200;
  }
  CHECK(std::sqrt(error) == Approx(1.15 * ar1_error(2000, 0.5)).epsilon(0.1));
  CHECK(inefficiency == Approx(1.15 * 1.15 * 3).epsilon(0.2));
  CHECK(std::isnan(slow_average(ar1(63, 0, random)).error));
  CHECK(slow_average(ar1(64, 0, random)).error > 0);
  CHECK(std::isnan(slow_average(line(1000, 1, 0.001)).error));
  CHECK(slow_average(line(1000, 1, 0.001)).lower_bound > 0.1);
  CHECK(std::isnan(slow_average({}).mean));
  const BlockAverage constant = slow_average(std::vector<Real>(1000, 1e8 + 0.1));
  CHECK(constant.error == 0);
  CHECK(constant.inefficiency == 1);
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
  std::vector<Real> single(100), one(100);
  single[7] = 3;
  one[7] = 2;
  CHECK(block_ratio(single, one).mean == 1.5);
  CHECK(std::isnan(block_ratio(single, one).error));  // a single sample with weight
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
