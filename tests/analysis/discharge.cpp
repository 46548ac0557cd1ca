#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <pliant/analysis/discharge.h>
#include <pliant/base/errors.h>

namespace pliant::test::discharge_test {

namespace {

struct Series {
  std::vector<Real> time;
  std::vector<std::int64_t> count;

  DischargeFit fit() const { return fit_discharge(time, count); }
};

/// N(t) = N_res + (sqrt(N0) − c0 t/2)², rounded to the nearest integer, until some time after the last departure.
Series exact(Real n0, Real c0, Real dt, std::int64_t residue = 0) {
  Series series;
  const Real end = 2 * std::sqrt(n0) / c0;
  for (Real t = 0; t < 1.1 * end; t += dt) {
    series.time.push_back(t + 5);
    series.count.push_back(residue + (t < end ? std::llround(square(std::sqrt(n0) - c0 * t / 2)) : 0));
  }
  return series;
}

/// A discharge over a flat bottom: `residue` of 1600 particles stay. The law holds until another `layer` particles
/// remain, which drain as exp(−t/τ), at first at the rate of the law and soon much slower.
Series with_slow_layer(Real c0, Real residue, Real layer) {
  Series series;
  const Real start = std::sqrt(1600 - residue), end = 2 * (start - std::sqrt(layer)) / c0,
             tau = 4 * std::sqrt(layer) / c0;
  for (Real t = 0; t < end + 12 * tau; t += 0.2) {
    const Real flowing = t < end ? square(start - c0 * t / 2) : layer * std::exp(-(t - end) / tau);
    series.time.push_back(t);
    series.count.push_back(std::llround(residue + flowing));
  }
  return series;
}

/// Departures at random, with the rate c0 sqrt(n); where `residue` stay, the last hundred leave four times as slowly.
Series random_departures(std::mt19937_64& random, Real c0, std::int64_t residue = 0) {
  Series series;
  Real next = 0;
  std::int64_t n = 1600;
  for (Real t = 0; n > 0; t += 0.1) {
    while (n > 0 && next <= t) {
      --n;
      const Real rate = c0 * std::sqrt(Real(n) + 1e-9);
      next += std::exponential_distribution<Real>(residue > 0 && n < 100 ? rate / 4 : rate)(random);
    }
    series.time.push_back(t);
    series.count.push_back(n + residue);
  }
  return series;
}

}  // namespace

TEST_CASE("discharge: the exact law, rounded to integers") {
  const Real n0 = GENERATE(1600., 400.), c0 = GENERATE(0.3, 2.);
  const Real dt = GENERATE(0.01, 0.2);
  const std::int64_t residue = GENERATE(0, 45);
  const Series series = exact(n0, c0, dt, residue);
  const DischargeFit fit = series.fit();
  CAPTURE(n0, c0, dt, residue, fit.c0, fit.error);
  CHECK(fit.c0 == Approx(c0).epsilon(1e-3));
  REQUIRE(fit.error > 0);
  CHECK(std::abs(fit.c0 - c0) < 2 * fit.error);
  CHECK(fit.error < 0.01 * c0);
  CHECK(fit.chi2_per_dof < 0.1);
  CHECK(fit.residue == residue);
  CHECK(series.count[fit.begin] - residue <= 0.8 * n0);
  CHECK(series.count[fit.begin - 1] - residue > 0.8 * n0);
  CHECK(series.count[fit.end - 1] - residue > 0.2 * n0);
  CHECK(series.count[fit.end] - residue <= 0.2 * n0);
  CHECK(fit.start_count == Approx(square(std::sqrt(n0) - c0 * (series.time[fit.begin] - 5) / 2)).epsilon(1e-3));
  if (residue > 0) {
    CHECK(std::isnan(fit.total_time));
    return;
  }
  // Rounding counts the last particle as departed when half of it remains: 2 sqrt(1/2)/c0 early.
  const Real emptied = 2 * (std::sqrt(n0) - std::sqrt(0.5)) / c0;
  CHECK(fit.total_time >= emptied - dt);
  CHECK(fit.total_time <= emptied + 2 * dt);
}

TEST_CASE("discharge: the slow last layer on a flat bottom is no part of the law") {
  const Real c0 = 0.7, layer = GENERATE(100., 250.);
  const std::int64_t residue = GENERATE(20, 45, 200);
  const Series series = with_slow_layer(c0, Real(residue), layer);
  const DischargeFit fit = series.fit();
  CAPTURE(layer, residue, fit.c0, fit.error, fit.chi2_per_dof);
  CHECK(fit.c0 == Approx(c0).epsilon(2e-3));
  CHECK(fit.residue == residue);
  CHECK(fit.chi2_per_dof < 0.1);
}

TEST_CASE("discharge: random departures, the error covers the true value") {
  const Real c0 = 1;
  const std::int64_t residue = GENERATE(0, 300);
  std::mt19937_64 random(17);
  int covered_1 = 0, covered_2 = 0;
  Real squares = 0, error_sum = 0, chi2 = 0;
  const int realisations = 300;
  for (int r = 0; r < realisations; ++r) {
    const DischargeFit fit = random_departures(random, c0, residue).fit();
    REQUIRE(fit.residue == residue);
    const Real deviation = std::abs(fit.c0 - c0);
    squares += square(deviation);
    error_sum += fit.error;
    chi2 += fit.chi2_per_dof / realisations;
    covered_1 += deviation < fit.error;
    covered_2 += deviation < 2 * fit.error;
  }
  CAPTURE(std::sqrt(squares / realisations), error_sum / realisations, covered_1, covered_2);
  CHECK(error_sum / realisations == Approx(std::sqrt(squares / realisations)).epsilon(0.2));
  CHECK(covered_1 > 0.55 * realisations);
  CHECK(covered_1 < 0.80 * realisations);
  CHECK(covered_2 > 0.87 * realisations);
  CHECK(chi2 == Approx(1).margin(0.15));
}

TEST_CASE("discharge: another law shows in chi squared") {
  // dN/dt = −k N, and a constant rate.
  Series fading, constant;
  for (Real t = 0; t < 60; t += 0.1) {
    fading.time.push_back(t);
    fading.count.push_back(std::llround(1600 * std::exp(-t / 20)));
    constant.time.push_back(t);
    constant.count.push_back(std::llround(1600 - 25 * t));
  }
  CHECK(fading.fit().chi2_per_dof > 2);
  CHECK(constant.fit().chi2_per_dof > 2);
}

TEST_CASE("discharge: transients at the ends are left out") {
  Series series = exact(1600, 1, 0.05);
  for (std::size_t i = 0; i < series.count.size(); ++i) {
    if (series.count[i] > 1300 && series.count[i] < 1600) series.count[i] = 1450;
    if (series.count[i] < 300) series.count[i] /= 2;
  }
  CHECK(series.fit().c0 == Approx(1).epsilon(1e-3));
}

TEST_CASE("discharge: an arch or the end of the run ends the fit, and what is left then is no residue") {
  const std::int64_t left = GENERATE(700, 390, 150);
  Series series = exact(1600, 1, 0.05);
  const bool arch = GENERATE(true, false);
  const auto stop = std::ranges::find_if(series.count, [&](std::int64_t n) { return n <= left; });
  if (arch) {
    std::fill(stop, series.count.end(), left);
  } else {
    series.time.resize(std::size_t(stop - series.count.begin()) + 1);
    series.count.resize(series.time.size());
  }
  const DischargeFit fit = series.fit();
  CAPTURE(left, arch);
  CHECK(fit.c0 == Approx(1).epsilon(2e-3));
  CHECK(fit.residue == 0);
  CHECK(std::isnan(fit.total_time));
  CHECK(series.count[fit.end - 1] == std::max<std::int64_t>(left, 321));
}

TEST_CASE("discharge: too little to fit, bad input") {
  CHECK(std::isnan(fit_discharge({}, {}).c0));
  const Series nothing{{0, 1, 2, 3, 4}, {50, 50, 50, 50, 50}};
  CHECK(std::isnan(nothing.fit().c0));
  CHECK(std::isnan(nothing.fit().total_time));
  const Series empty{{0, 1, 2, 3}, {0, 0, 0, 0}};
  CHECK(std::isnan(empty.fit().c0));
  CHECK(empty.fit().total_time == 0);
  const Series few{{0, 1, 2, 3, 4, 5}, {121, 81, 64, 49, 36, 25}};
  CHECK(few.fit().c0 == Approx(2));
  CHECK(std::isnan(few.fit().error));
  CHECK(std::isnan(few.fit().chi2_per_dof));

  // With two or three particles the fit contains one departure at most: a line through two numbers has no degree of
  // freedom.
  Series two{{}, {}}, three{{}, {}}, four{{}, {}};
  for (int k = 0; k < 40; ++k) {
    const auto left = [&](std::int64_t n) { return std::max<std::int64_t>(n - k / 8, 0); };
    for (Series* s : {&two, &three, &four}) s->time.push_back(k);
    two.count.push_back(left(2));
    three.count.push_back(left(3));
    four.count.push_back(left(4));
  }
  for (const Series& s : {two, three}) {
    const DischargeFit fit = s.fit();
    CHECK(std::isnan(fit.c0));
    CHECK(std::isnan(fit.error));
    CHECK(std::isnan(fit.start_count));
  }
  CHECK(four.fit().c0 > 0);

  CHECK_THROWS_AS((Series{{0, 1}, {3}}.fit()), InputError);
  CHECK_THROWS_AS((Series{{1, 0}, {3, 2}}.fit()), InputError);
  CHECK_THROWS_AS((Series{{0, 1}, {3, -1}}.fit()), InputError);
}

}  // namespace pliant::test::discharge_test
