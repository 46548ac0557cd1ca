#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <tuple>
#include <vector>

#include <pliant/analysis/flow_precision.h>
#include <pliant/base/errors.h>

namespace pliant::test::flow_precision_test {

namespace {

constexpr Real mean_rate = 2;

/// A sample of a constant filling.
FlowSample sample(Real time, Real area, Real kinetic_energy) {
  return {time, std::floor(area), area, kinetic_energy, 30, 0.8};
}

/// Cumulative area at times 0, 1, 2, …: rate 2 (1 + 0.3 x) start(t) with x AR(1) of unit variance, and an independent
/// kinetic energy of the same kind.
class Flow {
 public:
  Flow(std::uint64_t seed, Real phi, Real amplitude = 0, Real relaxation = 1)
      : random_(seed), phi_(phi), amplitude_(amplitude), relaxation_(relaxation), x_(normal_(random_)) {}

  bool add_to(FlowPrecision& rule) {
    if (samples_ > 0) {
      x_ = phi_ * x_ + std::sqrt(1 - phi_ * phi_) * normal_(random_);
      const Real start = 1 + amplitude_ * std::exp(-Real(samples_) / relaxation_);
      area_ += mean_rate * std::max(Real{0}, 1 + 0.3 * x_) * start;
    }
    return rule.add(sample(Real(samples_++), area_, 1 + 0.1 * normal_(random_)));
  }
  /// Samples until the rule ends the run, or `limit`.
  std::size_t run(FlowPrecision& rule, std::size_t limit) {
    while (samples_ < limit && !add_to(rule)) {
    }
    return samples_;
  }

  Real area() const { return area_; }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<Real> normal_;
  Real phi_, amplitude_, relaxation_, x_, area_ = 0;
  std::size_t samples_ = 0;
};

}  // namespace

TEST_CASE("runs that end by the rule are as precise as asked and unbiased") {
  // The requested error, not the minimum length, ends most runs: σ √(inefficiency) / asked = 225 samples and more.
  const auto [phi, asked] = GENERATE(table<Real, Real>({{0, 0.02}, {0, 0.01}, {0.7, 0.02}, {0.9, 0.02}, {-0.5, 0.01}}));
  const int runs = 400;
  Real sum = 0, squares = 0, error_sum = 0;
  for (int r = 0; r < runs; ++r) {
    Flow flow(static_cast<std::uint64_t>(1000 + r), phi);
    FlowPrecision rule(asked);
    const std::size_t samples = flow.run(rule, 1000000);
    REQUIRE(samples < 1000000);
    REQUIRE(rule.relative_error() <= asked);
    const Real deviation = rule.rate() / mean_rate - 1;
    sum += deviation;
    squares += square(deviation);
    error_sum += rule.relative_error();
  }
  const Real rms = std::sqrt(squares / runs), bias = sum / runs;
  CAPTURE(phi, asked, rms, bias, error_sum / runs);
  CHECK(rms < 1.2 * asked);
  CHECK(std::abs(bias) < 3.5 * rms / std::sqrt(Real(runs)));
  CHECK(error_sum / runs > 0.6 * asked);  // not ended by its least length, long after
}

TEST_CASE("the rule waits for the end of the start-up") {
  const auto [amplitude, relaxation, asked] = GENERATE(table<Real, Real, Real>(
      {{3, 200, 0.05}, {-0.8, 200, 0.05}, {-0.8, 300, 0.02}, {1, 100, 0.03}, {0.5, 30, 0.02}, {-0.9, 2000, 0.1}}));
  const int runs = 60;
  Real squares = 0;
  int ended = 0;
  for (int r = 0; r < runs; ++r) {
    Flow flow(static_cast<std::uint64_t>(r), 0.7, amplitude, relaxation);
    FlowPrecision rule(asked);
    const auto limit = static_cast<std::size_t>(400 * relaxation);
    if (flow.run(rule, limit) == limit) continue;
    ++ended;
    squares += square(rule.rate() / mean_rate - 1);
  }
  CAPTURE(amplitude, relaxation, asked, ended, std::sqrt(squares / ended));
  CHECK(ended >= 0.95 * runs);
  CHECK(std::sqrt(squares / ended) < 1.2 * asked);
}

TEST_CASE("the rule never ends a run that drifts") {
  std::mt19937_64 random(1);
  std::normal_distribution<Real> normal;
  FlowPrecision rule(0.05);
  Real area = 0;
  for (int i = 0; i < 4000; ++i) {
    REQUIRE_FALSE(rule.add(sample(i, area, 1 + 0.1 * normal(random))));
    area += 2 * std::exp(-i / 500.0) * (1 + 0.1 * normal(random));
  }
}

TEST_CASE("the rule never ends a run whose filling swells") {
  std::mt19937_64 random(1);
  std::normal_distribution<Real> normal;
  FlowPrecision rule(0.05);
  Real area = 0;
  for (int i = 0; i < 4000; ++i, area += 2 + 0.2 * normal(random))
    REQUIRE_FALSE(
        rule.add({Real(i), std::floor(area), area, 1 + 0.1 * normal(random), 30 + i / 10.0 + normal(random), 0.8}));
}

TEST_CASE("a drift leaves no error bar") {
  std::mt19937_64 random(1);
  std::normal_distribution<Real> normal;
  std::vector<Real> time, area{0}, energy, height(1000, 30), fraction(1000, 0.8);
  for (int i = 0; i < 1000; ++i) {
    time.push_back(i);
    energy.push_back(100 + i + 10 * normal(random));
    if (i > 0) area.push_back(area.back() + 2 + 0.2 * normal(random));
  }
  const SteadyFlow drifting = steady_flow({time, area, energy, height, fraction});
  CHECK_FALSE(drifting.steady.steady);
  CHECK(std::isnan(drifting.rate.error));
  CHECK(drifting.rate.value == Approx(2).epsilon(0.01));
  const SteadyFlow steady = steady_flow({time, area, height, height, fraction});
  CHECK(steady.steady.steady);
  CHECK(steady.rate.error == Approx(0.2 / std::sqrt(1000)).epsilon(0.2));
}

TEST_CASE("the rule judges at the 100th sample and then at 5 % more each") {
  FlowPrecision rule(0.5);
  Flow flow(1, 0);
  std::size_t before = 0, judged = 0;
  Real known = NAN;
  for (std::size_t n = 1; n <= 20000; ++n) {
    flow.add_to(rule);
    const Real now = rule.relative_error();
    if (now == known || (std::isnan(now) && std::isnan(known))) continue;
    if (before == 0)
      CHECK(n == 100);
    else
      CHECK(n - before == (before + 19) / 20);
    before = n;
    known = now;
    ++judged;
  }
  CHECK(judged > 90);
  CHECK(judged < 120);
}

TEST_CASE("few crossings do not end a run, however even they are") {
  std::mt19937_64 random(2);
  std::normal_distribution<Real> normal;
  FlowPrecision rule(0.9);
  for (int i = 0; i < 9000; ++i)  // a particle every 100 samples
    REQUIRE_FALSE(rule.add(sample(i, std::floor(i / 100.0), 1 + 0.1 * normal(random))));
  bool ended = false;
  for (int i = 9000; i < 40000 && !ended; ++i)
    ended = rule.add(sample(i, std::floor(i / 100.0), 1 + 0.1 * normal(random)));
  CHECK(ended);
}

TEST_CASE("no flow, no end") {
  FlowPrecision rule(0.5);
  for (int i = 0; i < 2000; ++i) REQUIRE_FALSE(rule.add(sample(i, 0, 1)));
  CHECK(std::isnan(rule.relative_error()));
}

TEST_CASE("the rule is a function of the samples") {
  std::vector<FlowSample> samples;
  std::mt19937_64 random(5);
  std::normal_distribution<Real> normal;
  Real area = 0;
  FlowPrecision whole(0.01);
  for (bool ended = false; !ended;) {
    const auto i = static_cast<Real>(samples.size());
    samples.push_back(sample(i, area, 1 + 0.1 * normal(random)));
    ended = whole.add(samples.back());
    area += 2 * std::max(Real{0}, 1 + 0.3 * normal(random));
    REQUIRE(samples.size() < 100000);
  }
  FlowPrecision again(0.01);
  std::size_t n = 0;
  while (n < samples.size() && !again.add(samples[n])) ++n;
  CHECK(n == samples.size() - 1);
  CHECK(again.relative_error() == whole.relative_error());
}

TEST_CASE("a steady flow rate needs two samples") {
  const std::vector<Real> one{0};
  CHECK_THROWS_AS(steady_flow({one, one, one, one, one}), InputError);
}

}  // namespace pliant::test::flow_precision_test
