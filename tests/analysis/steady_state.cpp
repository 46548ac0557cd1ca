#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include <pliant/analysis/steady_state.h>
#include <pliant/base/errors.h>

namespace pliant::test::steady_state_test {

namespace {

template <class F>
std::vector<Real> noisy(std::size_t n, unsigned seed, F signal) {
  std::mt19937_64 random(seed);
  std::normal_distribution<Real> normal;
  std::vector<Real> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = signal(Real(i)) + normal(random);
  return values;
}

std::vector<Real> times(std::size_t n) {
  std::vector<Real> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = 10 + 0.5 * Real(i);
  return values;
}

/// The definition of MSER-5, literally.
std::size_t brute_force(const std::vector<Real>& x) {
  std::vector<Real> z(x.size() / 5);
  for (std::size_t j = 0; j < z.size(); ++j)
    z[j] = (x[5 * j] + x[5 * j + 1] + x[5 * j + 2] + x[5 * j + 3] + x[5 * j + 4]) / 5;
  std::size_t best = 0;
  Real least = INFINITY;
  for (std::size_t d = 0; d <= z.size() / 2; ++d) {
    const Real kept = Real(z.size() - d);
    Real mean = 0, sum = 0;
    for (std::size_t j = d; j < z.size(); ++j) mean += z[j] / kept;
    for (std::size_t j = d; j < z.size(); ++j) sum += square(z[j] - mean);
    if (sum / square(kept) < least) {
      least = sum / square(kept);
      best = d;
    }
  }
  return 5 * best;
}

SteadyState judge(const std::vector<Real>& values) {
  const auto time = times(values.size());
  const std::vector<NamedSeries> series{{"energy", values}};
  return steady_state(time, series);
}

/// Normal numbers of unit variance, correlated as exp(−|i − j|/correlation).
std::vector<Real> correlated(std::size_t n, unsigned seed, Real correlation) {
  std::mt19937_64 random(seed);
  std::normal_distribution<Real> normal;
  const Real kept = correlation > 0 ? std::exp(-1 / correlation) : 0;
  std::vector<Real> values(n);
  Real x = normal(random);
  for (Real& value : values) {
    value = x;
    x = kept * x + std::sqrt(1 - square(kept)) * normal(random);
  }
  return values;
}

/// Part of 120 runs that are called unsteady. make(x, noise): the value at the part x of the run.
template <class F>
Real unsteady(std::size_t n, Real correlation, F make) {
  const unsigned runs = 120;
  int count = 0;
  for (unsigned seed = 0; seed < runs; ++seed) {
    std::vector<Real> values = correlated(n, seed, correlation);
    for (std::size_t i = 0; i < n; ++i) values[i] = make(Real(i) / Real(n), values[i]);
    count += !judge(values).steady;
  }
  return Real(count) / runs;
}

/// Numbers of crossings: bursts of Poisson numbers of mean 3 between pauses, a tenth of `mean_pause` long.
std::vector<Real> bursts(std::size_t n, unsigned seed, Real mean_pause) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<Real> uniform;
  std::poisson_distribution<int> burst(3);
  std::vector<Real> values(n);
  bool flows = false;
  for (Real& value : values) {
    if (uniform(random) < (flows ? 10 : 1) / mean_pause) flows = !flows;
    value = flows ? burst(random) : 0;
  }
  return values;
}

}  // namespace

TEST_CASE("MSER-5 cuts a known transient") {
  SECTION("step") {
    const auto values = noisy(1000, 1, [](Real i) { return i < 200 ? 10 : 0; });
    const SteadyState result = judge(values);
    CHECK(result.steady);
    CHECK(result.index == mser5(values));
    CHECK(result.index >= 200);
    CHECK(result.index <= 230);
    CHECK(result.time == 10 + 0.5 * Real(result.index));
    CHECK(result.explanation.find("steady from t = ") == 0);
  }
  SECTION("exponential: what is left of it stays below the noise of the mean") {
    for (unsigned seed = 0; seed < 20; ++seed) {
      const auto values = noisy(2000, seed, [](Real i) { return 20 * std::exp(-i / 60); });
      const SteadyState result = judge(values);
      CHECK(result.steady);
      CHECK(result.index >= 100);
      CHECK(result.index < 700);
    }
  }
  SECTION("agrees with the definition") {
    for (unsigned seed = 0; seed < 20; ++seed) {
      const auto values = noisy(503, seed, [seed](Real i) { return Real(seed) * std::exp(-i / 50); });
      CHECK(mser5(values) == brute_force(values));
    }
  }
  SECTION("constant, from the start and after a step") {
    std::vector<Real> values(200, 0.1);
    CHECK(judge(values).steady);
    CHECK(judge(values).index == 0);
    for (std::size_t i = 0; i < 42; ++i) values[i] = 7;
    CHECK(judge(values).steady);
    CHECK(judge(values).index == 45);
  }
}

TEST_CASE("stationary series are steady: less than 1 % false alarms") {
  for (const std::size_t n : {64, 300, 1000})
    for (const Real correlation : {0.0, 1.0, 3.0, 10.0}) {
      if (Real(n) < 100 * correlation) continue;
      CAPTURE(n, correlation);
      CHECK(unsteady(n, correlation, [](Real, Real noise) { return 5 + noise; }) < 0.01);
    }
  CHECK(unsteady(1000, 3, [](Real, Real noise) { return std::exp(noise / 2); }) < 0.01);  // skewed
  int alarms = 0;
  for (unsigned seed = 0; seed < 400; ++seed) alarms += !judge(bursts(1000, seed, 10)).steady;
  CHECK(alarms <= 4);
}

TEST_CASE("every kind of drift is found") {
  using Kind = Real (*)(Real x, Real noise);
  const auto [name, drifts] = GENERATE(table<const char*, Kind>(
      {{"mean grows", [](Real x, Real noise) { return 5 + 1.5 * x + noise; }},
       {"mean falls", [](Real x, Real noise) { return 5 - 1.5 * x + noise; }},
       {"spread grows", [](Real x, Real noise) { return 5 + (1 + 3 * x) * noise; }},
       {"spread falls", [](Real x, Real noise) { return 5 + (4 - 3.5 * x) * noise; }},
       {"step", [](Real x, Real noise) { return 5 + (x > 0.7) + noise; }},
       {"step of the spread", [](Real x, Real noise) { return 5 + (x > 0.7 ? 2 : 1) * noise; }},
       {"oscillation", [](Real x, Real noise) { return 5 + std::cos(2 * pi * x) + noise; }},
       {"half an oscillation", [](Real x, Real noise) { return 5 + 1.2 * std::cos(pi * x) + noise; }},
       {"one and a half", [](Real x, Real noise) { return 5 + std::sin(3 * pi * x) + noise; }},
       {"decay", [](Real x, Real noise) { return 5 + 6 * std::exp(-2 * x) + noise; }},
       {"growth", [](Real x, Real noise) { return std::exp(2 * x) + 0.5 * noise; }},
       {"mean and spread grow", [](Real x, Real noise) { return (1 + 14 * x) * (1 + 0.3 * noise); }}}));
  CAPTURE(name);
  CHECK(unsteady(1000, 0, drifts) > 0.9);
  CHECK(unsteady(3000, 1, drifts) > 0.9);
}

TEST_CASE("drifts without noise") {
  std::vector<Real> ramp(100), step(100), spread(100);
  for (std::size_t i = 0; i < 100; ++i) {
    ramp[i] = Real(i);
    step[i] = i < 60 ? 1 : 2;
    spread[i] = 5 + (i % 2 == 0 ? 1 : -1) * (1 + Real(i) / 20);
  }
  const SteadyState result = judge(ramp);
  CHECK_FALSE(result.steady);
  CHECK(result.index == 50);
  CHECK(result.explanation.find("not steady: from t = 35 to 59.5 the mean of the energy changes from 57.5 in the first "
                                "third to 91.5 in the last") == 0);
  CHECK(judge(step).explanation.find("the mean of the energy changes from 1 in the first third to 2") !=
        std::string::npos);
  CHECK(judge(spread).explanation.find("the spread of the energy changes") != std::string::npos);
}

TEST_CASE("small changes are no drift where the series tolerates them") {
  const auto values = noisy(3000, 7, [](Real i) { return 100 + i / 1000; });
  CHECK_FALSE(drift({"energy", values}).empty());
  CHECK(drift({"energy", values, 0.05}).empty());
  CHECK_FALSE(drift({"energy", values, 0.01}).empty());
  const auto wide = noisy(3000, 7, [](Real) { return 0; });
  std::vector<Real> wider = wide;
  for (std::size_t i = 0; i < wider.size(); ++i) wider[i] = 100 + wide[i] * (1 + Real(i) / 1000);
  CHECK(drift({"energy", wider, 0.05}).empty());
  CHECK(drift({"energy", wider}).find("the spread of the energy") == 0);
}

TEST_CASE("a start-up that MSER-5 leaves in is dropped") {
  // The start-up comes from another series.
  const auto rate = noisy(1000, 1, [](Real) { return 5; });
  const auto height = noisy(1000, 2, [](Real i) { return 50 + (i < 150 ? 10 : 0); });
  const auto time = times(1000);
  const std::vector<NamedSeries> series{{"flow rate", rate}, {"height", height, 0.01, false}};
  const SteadyState result = steady_state(time, series);
  CHECK(result.steady);
  CHECK(mser5(rate) < 150);
  CHECK(result.index >= 100);
  CHECK(result.index < 350);
}

TEST_CASE("too short or not finite: not steady") {
  const auto values = noisy(49, 1, [](Real) { return 0; });
  const SteadyState result = judge(values);
  CHECK_FALSE(result.steady);
  CHECK(result.index == 0);
  CHECK(result.explanation.find("49 samples") != std::string::npos);
  CHECK_FALSE(judge({}).steady);

  std::vector<Real> broken(100, 1.0);
  broken[77] = std::nan("");
  CHECK_FALSE(judge(broken).steady);
  const auto time = times(10);
  const std::vector<NamedSeries> longer{{"energy", broken}};
  CHECK_THROWS_AS(steady_state(time, longer), InputError);
}

TEST_CASE("several series: the latest truncation, and all must be steady") {
  const auto early = noisy(1000, 1, [](Real i) { return i < 100 ? 10 : 0; });
  const auto late = noisy(1000, 2, [](Real i) { return i < 300 ? 10 : 0; });
  const auto never = noisy(1000, 3, [](Real i) { return i / 20; });
  const auto time = times(1000);
  const std::vector<NamedSeries> good{{"flow rate", early}, {"kinetic energy", late}};
  const std::vector<NamedSeries> swapped{good[1], good[0]};
  const SteadyState result = steady_state(time, good);
  CHECK(result.steady);
  CHECK(result.index == mser5(late));
  CHECK(result.index == steady_state(time, swapped).index);

  const std::vector<NamedSeries> bad{{"flow rate", never}, {"kinetic energy", early}};
  const SteadyState drifting = steady_state(time, bad);
  CHECK_FALSE(drifting.steady);
  CHECK(drifting.explanation.find("the mean of the flow rate") != std::string::npos);
  CHECK(drifting.explanation.find("kinetic energy") == std::string::npos);

  // The unsteady series may differ from the series with the latest truncation.
  std::vector<Real> broken(1000, 1.0);
  broken[999] = std::nan("");
  const std::vector<NamedSeries> mixed{{"flow rate", broken}, {"kinetic energy", late}};
  CHECK_FALSE(steady_state(time, mixed).steady);
  CHECK(steady_state(time, mixed).explanation.find("the flow rate is not finite") != std::string::npos);
  CHECK_THROWS_AS(steady_state(time, {}), InputError);
}

}  // namespace pliant::test::steady_state_test
