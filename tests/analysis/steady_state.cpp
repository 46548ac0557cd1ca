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

}  // namespace

TEST_CASE("MSER-5 cuts a known transient") {
  SECTION("step") {
    const auto values = noisy(1000, 1, [](Real i) { return i < 200 ? 10 : 0; });
    const SteadyState result = mser5(times(1000), {"flow rate", values});
    CHECK(result.steady);
    CHECK(result.index >= 200);
    CHECK(result.index <= 230);
    CHECK(result.time == 10 + 0.5 * Real(result.index));
    CHECK(result.explanation.find("flow rate: steady from t = ") == 0);
  }
  SECTION("exponential: what is left of it stays below the noise of the mean") {
    for (unsigned seed = 0; seed < 20; ++seed) {
      const auto values = noisy(2000, seed, [](Real i) { return 20 * std::exp(-i / 60); });
      const SteadyState result = mser5(times(2000), {"energy", values});
      CHECK(result.steady);
      CHECK(result.index >= 100);
      CHECK(result.index < 700);
    }
  }
  SECTION("agrees with the definition") {
    for (unsigned seed = 0; seed < 20; ++seed) {
      const auto values = noisy(503, seed, [seed](Real i) { return Real(seed) * std::exp(-i / 50); });
      CHECK(mser5(times(503), {"energy", values}).index == brute_force(values));
    }
  }
  SECTION("constant, from the start and after a step") {
    std::vector<Real> values(200, 0.1);
    CHECK(mser5(times(200), {"energy", values}).steady);
    CHECK(mser5(times(200), {"energy", values}).index == 0);
    for (std::size_t i = 0; i < 42; ++i) values[i] = 7;
    CHECK(mser5(times(200), {"energy", values}).index == 45);
  }
}

TEST_CASE("stationary noise is steady, a drift is not") {
  int steady = 0, drifting = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    steady += mser5(times(1000), {"energy", noisy(1000, seed, [](Real) { return 0; })}).steady;
    drifting += mser5(times(1000), {"energy", noisy(1000, seed, [](Real i) { return i / 100; })}).steady;
  }
  CHECK(steady >= 97);
  CHECK(drifting <= 3);
  const auto ramp = times(100);
  const SteadyState result = mser5(ramp, {"energy", ramp});
  CHECK_FALSE(result.steady);
  CHECK(result.index == 50);
  CHECK(result.explanation.find("not steady") != std::string::npos);
}

TEST_CASE("too short or not finite: not steady") {
  const auto values = noisy(49, 1, [](Real) { return 0; });
  const SteadyState result = mser5(times(49), {"energy", values});
  CHECK_FALSE(result.steady);
  CHECK(result.index == 0);
  CHECK(result.explanation.find("49 samples") != std::string::npos);
  CHECK_FALSE(mser5({}, {"energy", {}}).steady);

  std::vector<Real> broken(100, 1.0);
  broken[7] = std::nan("");
  CHECK_FALSE(mser5(times(100), {"energy", broken}).steady);
  CHECK_THROWS_AS(mser5(times(10), {"energy", broken}), InputError);
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
  CHECK(result.index == mser5(time, good[1]).index);
  CHECK(result.index == steady_state(time, swapped).index);
  CHECK(result.explanation.find("kinetic energy: steady") == 0);

  const std::vector<NamedSeries> bad{{"flow rate", never}, {"kinetic energy", early}};
  const SteadyState unsteady = steady_state(time, bad);
  CHECK_FALSE(unsteady.steady);
  CHECK(unsteady.explanation.find("flow rate: not steady") == 0);
  CHECK(unsteady.explanation.find("kinetic energy") == std::string::npos);

  // The unsteady series need not be the one with the latest truncation.
  std::vector<Real> broken(1000, 1.0);
  broken[999] = std::nan("");
  const std::vector<NamedSeries> mixed{{"flow rate", broken}, {"kinetic energy", late}};
  CHECK_FALSE(steady_state(time, mixed).steady);
  CHECK(steady_state(time, mixed).index == result.index);
  CHECK(steady_state(time, mixed).explanation.find("flow rate: not steady") == 0);
  CHECK_THROWS_AS(steady_state(time, {}), InputError);
}

}  // namespace pliant::test::steady_state_test
