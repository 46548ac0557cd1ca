// FIRE finds minima and returns the reason of its stop.
#include <omp.h>

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include <pliant/base/errors.h>
#include <pliant/system/fire.h>

namespace pliant::test::fire_test {
using Catch::Matchers::Contains;

namespace {

// E = ½ Σ k_i (x_i − c_i)², with c_i = i.
struct Bowl {
  std::vector<Real> stiffness;
  Real operator()(const Real* x, Real* f) const {
    Real energy = 0;
    for (std::size_t i = 0; i < stiffness.size(); ++i) {
      const Real d = x[i] - static_cast<Real>(i);
      energy += 0.5 * stiffness[i] * d * d;
      f[i] = -stiffness[i] * d;
    }
    return energy;
  }
};

Real valley(const Real* x, Real* f) {
  const Real a = 1 - x[0], b = x[1] - x[0] * x[0];
  f[0] = 2 * a + 4 * 20 * b * x[0];
  f[1] = -2 * 20 * b;
  return a * a + 20 * b * b;
}

// Harmonic disks of diameter 1 in a periodic square of side l: E = ½ k Σ (1 − r)².
struct Disks {
  int n;
  Real l;
  Real operator()(const Real* x, Real* f) const {
    Real energy = 0;
    std::fill_n(f, 2 * n, 0.0);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < i; ++j) {
        Real d[2];
        for (int k = 0; k < 2; ++k) d[k] = std::remainder(x[2 * i + k] - x[2 * j + k], l);
        const Real r = std::hypot(d[0], d[1]);
        if (r >= 1) continue;
        energy += 0.5 * 100 * (1 - r) * (1 - r);
        for (int k = 0; k < 2; ++k) {
          const Real force = 100 * (1 - r) * d[k] / r;
          f[2 * i + k] += force;
          f[2 * j + k] -= force;
        }
      }
    return energy;
  }
};

}  // namespace

TEST_CASE("FIRE finds the bottom of a quadratic bowl") {
  const Bowl bowl{{1, 10, 100, 3}};
  std::vector<Real> x{5, -3, 2, 7};
  const std::vector<Real> mass(4, 1);
  FireOptions o;
  o.force_tolerance = 1e-9;
  std::int64_t calls = 0;
  const FireResult r = fire(
      x, mass,
      [&](const Real* p, Real* f) {
        ++calls;
        return bowl(p, f);
      },
      o);
  CHECK(r.converged);
  CHECK(r.stop == FireStop::force);
  CHECK_THAT(r.reason, Contains("force"));
  for (std::size_t i = 0; i < 4; ++i) CHECK(x[i] == Approx(i).margin(2e-9));
  std::vector<Real> f(4);
  CHECK(r.energy == bowl(x.data(), f.data()));  // energy and force belong to the final x
  Real largest = 0;
  for (const Real value : f) largest = std::max(largest, std::abs(value));
  CHECK(r.max_force == largest);
  CHECK(r.max_force <= 1e-9);
  CHECK(r.evaluations == calls);
  CHECK(r.evaluations == r.iterations + 1);
  CHECK(r.iterations < 2000);
}

TEST_CASE("FIRE takes the published steps") {
  // Algorithm 2 of Guénolé et al. written out for two coordinates of mass 2.
  constexpr int evaluations = 400;
  FireOptions o;
  o.dt = 0.02, o.dt_max = 0.15, o.max_iterations = evaluations - 1, o.delay = 5;
  std::vector<Real> x{-1.2, 1}, path, expected{-1.2, 1};
  (void)fire(
      x, std::vector<Real>{2}, [&](const Real* p, Real* f) { return path.insert(path.end(), p, p + 2), valley(p, f); },
      o);
  Real p[2] = {-1.2, 1}, v[2] = {0, 0}, f[2], dt = 0.02, alpha = 0.25;
  int positive = 0, uphill = 0;
  for (int i = 1; i < evaluations; ++i) {
    valley(p, f);
    if (v[0] * f[0] + v[1] * f[1] > 0) {
      if (++positive > 5) {
        dt = dt * 1.1 < 0.15 ? dt * 1.1 : 0.15;
        alpha *= 0.99;
      }
    } else {
      positive = 0;
      ++uphill;
      if (i > 5) {
        dt = dt * 0.5 > 0.02 * 0.02 ? dt * 0.5 : 0.02 * 0.02;
        alpha = 0.25;
      }
      for (int k = 0; k < 2; ++k) p[k] -= 0.5 * dt * v[k], v[k] = 0;
    }
    for (int k = 0; k < 2; ++k) v[k] += dt * f[k] / 2;
    const Real ratio = alpha * std::hypot(v[0], v[1]) / std::hypot(f[0], f[1]);
    for (int k = 0; k < 2; ++k) v[k] = (1 - alpha) * v[k] + ratio * f[k], p[k] += dt * v[k];
    expected.insert(expected.end(), p, p + 2);
  }
  CHECK(uphill > 3);  // both branches were taken
  REQUIRE(path.size() == expected.size());
  for (std::size_t i = 0; i < path.size(); ++i) REQUIRE(path[i] == Approx(expected[i]).margin(1e-9));
}

TEST_CASE("FIRE follows a curved valley") {
  std::vector<Real> x{-1.2, 1};
  const std::vector<Real> mass(1, 1);  // one mass for both coordinates
  FireOptions o;
  o.force_tolerance = 1e-8;
  const FireResult r = fire(x, mass, valley, o);
  CHECK(r.converged);
  CHECK(x[0] == Approx(1).margin(1e-7));
  CHECK(x[1] == Approx(1).margin(1e-7));
  CHECK(r.iterations < 5000);
}

TEST_CASE("FIRE overtakes steepest descent with the same step") {
  // The reason to have it: the stiffest spring limits the step, the softest one sets the path.
  const Bowl bowl{{1, 1000}};
  FireOptions o;
  o.dt = 0.01, o.dt_max = 0.03, o.force_tolerance = 1e-6;
  std::vector<Real> x{10, 2}, f(2), mass(2, 1);
  const FireResult r = fire(x, mass, bowl, o);
  CHECK(r.converged);
  std::vector<Real> y{10, 2};
  int descent = 0;
  while (bowl(y.data(), f.data()), std::max(std::abs(f[0]), std::abs(f[1])) > 1e-6) {
    for (int i = 0; i < 2; ++i) y[static_cast<std::size_t>(i)] += 1e-3 * f[static_cast<std::size_t>(i)];
    ++descent;
  }
  CHECK(r.evaluations < descent / 10);
}

TEST_CASE("FIRE unjams disks until no overlap is left") {
  constexpr int n = 30;
  const Disks disks{n, 7};  // packing fraction 0.48
  std::mt19937 random(3);
  std::uniform_real_distribution<Real> uniform(0, 7);
  std::vector<Real> x(2 * n), f(2 * n);
  for (Real& value : x) value = uniform(random);
  REQUIRE(disks(x.data(), f.data()) > 100);
  const std::vector<Real> mass(n, pi / 4);
  FireOptions o;
  o.force_tolerance = 0;
  o.energy_tolerance = 1e-16;
  o.max_move = 0.1;
  const FireResult r = fire(x, mass, disks, o);
  CHECK(r.converged);
  CHECK((r.stop == FireStop::energy || r.energy == 0));
  CHECK(disks(x.data(), f.data()) <= 1e-16);
}

TEST_CASE("FIRE balances jammed disks by force") {
  constexpr int n = 30;
  const Disks disks{n, 5};  // packing fraction 0.94: overlaps remain
  std::mt19937 random(4);
  std::uniform_real_distribution<Real> uniform(0, 5);
  std::vector<Real> x(2 * n);
  for (Real& value : x) value = uniform(random);
  const std::vector<Real> mass(n, pi / 4);
  FireOptions o;
  o.force_tolerance = 1e-8;
  o.energy_tolerance = 1e-16;
  const FireResult r = fire(x, mass, disks, o);
  CHECK(r.stop == FireStop::force);
  CHECK(r.energy > 1e-3);
  CHECK(r.max_force <= 1e-8);
}

TEST_CASE("FIRE stops at the energy and at the limit of iterations, and says so") {
  const Bowl bowl{{1, 2}};
  const std::vector<Real> mass(2, 1);
  FireOptions o;
  o.energy_tolerance = 1e-3;
  std::vector<Real> x{4, 4};
  FireResult r = fire(x, mass, bowl, o);
  CHECK(r.stop == FireStop::energy);
  CHECK(r.converged);
  CHECK_THAT(r.reason, Contains("energy"));
  CHECK(r.energy <= 1e-3);
  CHECK(r.max_force > 1e-10);

  o = {};
  o.max_iterations = 7;
  x = {4, 4};
  r = fire(x, mass, bowl, o);
  CHECK(r.stop == FireStop::iterations);
  CHECK(!r.converged);
  CHECK_THAT(r.reason, Contains("limit of 7 iterations"));
  CHECK(r.iterations == 7);

  x = {0, 1};  // already there
  r = fire(x, mass, bowl, {});
  CHECK(r.converged);
  CHECK(r.iterations == 0);
  CHECK(r.evaluations == 1);
}

TEST_CASE("FIRE keeps moves below their limit") {
  const Bowl bowl{{1e4, 1e6}};
  std::vector<Real> x{50, -70}, last = x;
  const std::vector<Real> mass(2, 1);
  FireOptions o;
  o.max_move = 0.25;
  o.max_iterations = 50;
  Real largest = 0;
  (void)fire(
      x, mass,
      [&](const Real* p, Real* f) {
        for (std::size_t i = 0; i < 2; ++i) largest = std::max(largest, std::abs(p[i] - last[i]));
        last.assign(p, p + 2);
        return bowl(p, f);
      },
      o);
  CHECK(largest <= 0.375 * (1 + 1e-12));  // half a move back comes on top of a move
  CHECK(largest > 0.2);
}

TEST_CASE("FIRE reports values that are not finite") {
  const std::vector<Real> mass(2, 1);
  std::vector<Real> x{1, 1};
  const auto nan = std::numeric_limits<Real>::quiet_NaN();
  const auto bad_force = [&](const Real*, Real* f) {
    f[0] = 1, f[1] = nan;
    return 1.0;
  };
  CHECK_THROWS_AS(fire(x, mass, bad_force), NumericalError);
  CHECK_THROWS_WITH(fire(x, mass, bad_force), Contains("coordinate 1"));
  CHECK_THROWS_WITH(fire(x, mass,
                         [&](const Real*, Real* f) {
                           f[0] = f[1] = 1;
                           return nan;
                         }),
                    Contains("the energy is nan"));
}

TEST_CASE("FIRE takes the same path with any number of threads") {
  // Several blocks of coordinates, the last one smaller than the others.
  constexpr std::size_t n = 100001;
  Bowl bowl;
  std::vector<Real> start;
  std::mt19937 random(1);
  for (std::size_t i = 0; i < n; ++i) {
    bowl.stiffness.push_back(1 + static_cast<Real>(i % 7));
    start.push_back(static_cast<Real>(i) + std::uniform_real_distribution<Real>(-1, 1)(random));
  }
  FireOptions o;
  o.force_tolerance = 1e-6;
  o.dt_max = 0.3;
  o.max_move = GENERATE(0, 0.01);
  const std::vector<Real> mass = GENERATE(std::vector<Real>{1}, std::vector<Real>(n, 2));
  const int before = omp_get_max_threads();
  const auto with_threads = [&](int threads) {
    std::vector<Real> x = start;
    omp_set_num_threads(threads);
    const FireResult r = fire(x, mass, bowl, o);
    omp_set_num_threads(before);
    REQUIRE(r.stop == FireStop::force);
    return std::pair(r.iterations, x);
  };
  const auto alone = with_threads(1);
  CHECK(with_threads(3) == alone);
  Real farthest = 0;
  for (std::size_t i = 0; i < n; ++i) farthest = std::max(farthest, std::abs(alone.second[i] - static_cast<Real>(i)));
  CHECK(farthest <= 1e-6 * (1 + 1e-3));
  const auto bad_force = [&](const Real* x, Real* f) {
    const Real energy = bowl(x, f);
    f[70000] = f[90000] = std::numeric_limits<Real>::infinity();
    return energy;
  };
  CHECK_THROWS_WITH(fire(start, mass, bad_force), Contains("coordinate 70000 "));
}

TEST_CASE("FIRE refuses options and sizes out of range") {
  std::vector<Real> x{1, 1, 1};
  const Bowl bowl{{1, 1, 1}};
  CHECK_THROWS_AS(fire(x, std::vector<Real>(2, 1), bowl), InputError);
  CHECK_THROWS_AS(fire(x, std::vector<Real>{}, bowl), InputError);
  CHECK_THROWS_AS(fire(x, std::vector<Real>{1, 0, 1}, bowl), InputError);
  FireOptions o;
  o.dt = 1, o.dt_max = 0.5;
  CHECK_THROWS_AS(fire(x, std::vector<Real>(3, 1), bowl, o), InputError);
  o = {};
  o.shrink = 1;
  CHECK_THROWS_AS(fire(x, std::vector<Real>(3, 1), bowl, o), InputError);
}

}  // namespace pliant::test::fire_test
