#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include <pliant/analysis/profile.h>
#include <pliant/base/errors.h>

namespace pliant::test::profile_test {

namespace {

const std::vector<Real> heights{0, 0.5, 1, 2, 4, 8, 16};

template <int D>
struct Configuration {
  std::vector<Real> x, v;
  std::vector<std::uint8_t> active;

  void add(const Vec<D>& position, const Vec<D>& velocity, bool is_active = true) {
    x.insert(x.end(), position.begin(), position.end());
    v.insert(v.end(), velocity.begin(), velocity.end());
    active.push_back(is_active);
  }
  void sums(Real width, std::vector<Real>& momentum, std::vector<Real>& weight) const {
    add_axis_profile<D>(heights, width, x, v, active, momentum, weight);
  }
};

template <int D>
Configuration<D> random_configuration(Index n, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<Real> place(-25, 25);
  std::normal_distribution<Real> normal;
  Configuration<D> configuration;
  for (Index m = 0; m < n; ++m) {
    Vec<D> position, velocity;
    for (Real& c : position) c = place(random);
    for (Real& c : velocity) c = normal(random);
    configuration.add(position, velocity, m % 7 != 0);
  }
  return configuration;
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("axis profile: sums agree with brute force", "", ((int D), D), 2, 3) {
  const Real width = GENERATE(1.0, 0.4);
  const auto configuration = random_configuration<D>(3000, 1);
  std::vector<Real> momentum(heights.size(), 0.25), weight(heights.size(), 0.5);
  configuration.sums(width, momentum, weight);
  for (std::size_t k = 0; k < heights.size(); ++k) {
    Real expected_momentum = 0.25, expected_weight = 0.5;  // the sums are added to
    Vec<D> r = Vec<D>::Zero();
    r[D - 1] = heights[k];
    for (Index m = 0; m < Index(configuration.active.size()); ++m) {
      if (!configuration.active[m]) continue;
      const Real phi = std::pow(std::sqrt(2 * pi) * width, -D) *
                       std::exp(-(r - point<D>(configuration.x.data(), m)).squaredNorm() / (2 * width * width));
      expected_momentum -= point<D>(configuration.v.data(), m)[D - 1] * phi;
      expected_weight += phi;
    }
    CHECK(momentum[k] == Approx(expected_momentum).epsilon(1e-12));
    CHECK(weight[k] == Approx(expected_weight).epsilon(1e-12));
  }
}

TEMPLATE_TEST_CASE_SIG("axis profile: one particle, the cut-off, a flat profile", "", ((int D), D), 2, 3) {
  std::vector<Real> momentum(heights.size()), weight(heights.size());
  Vec<D> position = Vec<D>::Zero(), velocity = Vec<D>::Constant(9);
  velocity[D - 1] = -3;
  SECTION("on the axis: φ(0) is the prefactor, downwards is positive") {
    position[D - 1] = 2;
    Configuration<D> configuration;
    configuration.add(position, velocity);
    configuration.sums(1, momentum, weight);
    CHECK(weight[3] == Approx(D == 2 ? 1 / (2 * pi) : std::pow(2 * pi, -1.5)));
    CHECK(momentum[3] == Approx(3 * weight[3]));
    CHECK(weight[5] == Approx(weight[3] * std::exp(-18.0)));
    CHECK(weight[6] == 0);
  }
  SECTION("just inside and outside of the cut-off sqrt(2 ln 1e16)") {
    position[0] = 8.58;
    Configuration<D> inside, outside;
    inside.add(position, velocity);
    inside.sums(1, momentum, weight);
    CHECK(weight[0] > 0);
    CHECK(weight[1] == 0);
    std::vector<Real> none(heights.size());
    position[0] = 8.59;
    outside.add(position, velocity);
    outside.sums(1, none, none);
    CHECK(none == std::vector<Real>(heights.size()));
  }
  SECTION("uniform flow, many samples") {
    std::vector<Real> momentum_rows, weight_rows;
    for (unsigned sample = 0; sample < 128; ++sample) {
      auto configuration = random_configuration<D>(D == 2 ? 500 : 5000, sample);
      for (std::size_t i = D - 1; i < configuration.v.size(); i += D) configuration.v[i] = -1.75;
      std::fill(momentum.begin(), momentum.end(), 0);
      std::fill(weight.begin(), weight.end(), 0);
      configuration.sums(1, momentum, weight);
      momentum_rows.insert(momentum_rows.end(), momentum.begin(), momentum.end());
      weight_rows.insert(weight_rows.end(), weight.begin(), weight.end());
    }
    const auto profile = axis_profile(momentum_rows, weight_rows, heights.size());
    REQUIRE(profile.size() == heights.size());
    for (const BlockAverage& velocity_at : profile) {
      CHECK(velocity_at.mean == Approx(1.75).epsilon(1e-13));
      CHECK(velocity_at.error < 1e-14);
      CHECK(velocity_at.samples == 128);
    }
  }
}

TEST_CASE("axis profile: velocity and error of each height from rows") {
  // Height 0: ratio of sums, not mean of ratios; height 1: no particle near.
  const std::vector<Real> momentum{2, 0, 9, 0}, weight{1, 0, 3, 0};
  const auto profile = axis_profile(momentum, weight, 2);
  CHECK(profile[0].mean == Approx(11.0 / 4));
  CHECK(std::isnan(profile[0].error));
  CHECK(std::isnan(profile[1].mean));

  std::mt19937_64 random(5);
  std::normal_distribution<Real> normal;
  std::vector<Real> noisy, ones(3 * 4096, 1);
  for (int s = 0; s < 4096; ++s)
    for (const Real k : {1., 2., 3.}) noisy.push_back(k + 0.64 * k * normal(random));
  const auto rows = axis_profile(noisy, ones, 3);
  for (int k = 0; k < 3; ++k) {
    CHECK(rows[k].error == Approx(0.01 * (k + 1)).epsilon(0.25));
    CHECK(std::abs(rows[k].mean - (k + 1)) < 4 * 0.01 * (k + 1));
  }
  CHECK(axis_profile({}, {}, 3).size() == 3);
  CHECK_THROWS_AS(axis_profile(momentum, weight, 3), InputError);
  CHECK_THROWS_AS(axis_profile(momentum, ones, 2), InputError);
}

TEST_CASE("axis profile: bad input") {
  std::vector<Real> sums(2), x{0, 0}, v{0, 0};
  const std::vector<std::uint8_t> active{1};
  CHECK_THROWS_AS(add_axis_profile<2>(std::vector<Real>{1, 0}, 1, x, v, active, sums, sums), InputError);
  CHECK_THROWS_AS(add_axis_profile<2>(std::vector<Real>{0, 1}, 0, x, v, active, sums, sums), InputError);
  CHECK_THROWS_AS(add_axis_profile<3>(std::vector<Real>{0, 1}, 1, x, v, active, sums, sums), InputError);
  CHECK_THROWS_AS(add_axis_profile<2>(std::vector<Real>{0}, 1, x, v, active, sums, sums), InputError);
}

}  // namespace pliant::test::profile_test
