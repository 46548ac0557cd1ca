// Measurements of a hopper run, for a few particles and for series with known values.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <string>

#include <pliant/catalogue/catalogue.h>
#include <pliant/scenarios/hopper/measurements.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::measurements_test {

namespace {

using pliant::Vec;  // PETSc has one, too

constexpr Hopper hopper{.wall_distance = 20, .orifice = 4, .angle = 90};
constexpr Real zeta = 0.5, mu = 0.3;

/// spins: [particles · rotations], of disks and spheres.
template <int D>
Sample<D> sample_of(Configuration<D>& c, ModelKind kind, const std::vector<Real>& spins = {}) {
  const ModelParameters p{.epsilon = 100, .mu = mu, .zeta = zeta};
  ParticleSystem<D> system(c.topology, hopper.walls<D>(), make_force_field<D>(kind, p, -Vec<D>::Unit(D - 1)), 0.1);
  State state(c.topology.points(), system.coordinates().all());
  std::copy(c.x.begin(), c.x.end(), state.x().begin());
  std::copy(c.v.begin(), c.v.end(), state.v().begin());
  std::ranges::copy(spins, system.rotations_in(state.v()).begin());
  state.t = 1.5;
  return take_sample<D>(system, state, hopper, {7, 3.5}, 0.01);
}

template <int D>
std::map<std::string, Real> numbers(const Sample<D>& sample) {
  std::map<std::string, Real> values;
  for (const SeriesValue& v : sample.row)
    if (!v.is_row) values[v.name] = v.values.front();
  return values;
}

/// (x, height) in the plane, or in the plane y = 0 of the space.
template <int D>
Vec<D> at(Real x, Real height) {
  Vec<D> r = Vec<D>::Zero();
  r[0] = x;
  r[D - 1] = height;
  return r;
}

template <int D>
void check_sample() {
  Configuration<D> c;
  const auto add = [&](const Vec<D>& r, const Vec<D>& v) {
    c.add_soft(1, r);
    point<D>(c.v.data(), c.topology.particles() - 1) = v;
  };
  add(at<D>(0, 1), at<D>(0, -2));   // over the orifice
  add(at<D>(0.9, 1), at<D>(0, 0));  // touches the first
  add(at<D>(-3, 5), at<D>(3, 4));   // in the middle of the filling
  add(at<D>(9, 5), at<D>(0, 0));    // too near the wall
  add(at<D>(2, 10), at<D>(0, 0));   // the highest
  add(at<D>(0, -2), at<D>(0, -7));  // has left
  add(at<D>(0.5, 2), at<D>(0, 0));  // out of the run
  c.topology.deactivate(6);
  const Sample<D> sample = sample_of<D>(c, ModelKind::sp);
  auto value = numbers(sample);
  CHECK(value["time"] == 1.5);
  CHECK(value["dt"] == 0.01);
  CHECK(value["crossed_count"] == 7);
  CHECK(value["crossed_area"] == 3.5);
  CHECK(value["in_hopper"] == 5);
  CHECK(value["kinetic_energy"] == Approx(c.topology.mass(0) / 2 * (4 + 25 + 49)));
  CHECK(value["gravity_energy"] == Approx(c.topology.mass(0) * (1 + 1 + 5 + 5 + 10 - 2)));
  CHECK(value["contact_pairs"] == 1);
  CHECK(value["max_speed"] == Approx(5));
  CHECK(value["max_overlap"] == Approx(0.1));
  CHECK(value["top_height"] == Approx(10));
  // Means of the five above the line: 0.5 (2 + 5), and 0.3 · 2 on both of the pair.
  CHECK(value["drag_force"] == Approx(3.5 / 5));
  CHECK(value["friction_force"] == Approx(1.2 / 5));
  // Two of them in the box 8 × 4, or the cylinder of radius 4 and height 4.
  CHECK(value["orifice_density"] == Approx(D == 2 ? 2.0 / 32 : 2 / (64 * pi)));
  // One from 3 to 7, less than 8 from the axis.
  CHECK(value["bulk_fraction"] == Approx(c.topology.a0[0] / (D == 2 ? 4 * 16 : 4 * 64 * pi)));
  CHECK(sample.in_hopper == 5);
  CHECK(sample.first == 0);
  CHECK(sample.second == 1);
}

template <int D>
void check_disks() {
  Configuration<D> c;
  c.add_soft(1, at<D>(0, 5));
  c.add_soft(1, at<D>(0.9, 5));  // touches the first
  c.add_soft(1, at<D>(-3, 5));
  std::vector<Real> spins(3 * rotations<D>);
  spins[rotations<D> - 1] = 50;  // across the contact
  const Sample<D> sample = sample_of<D>(c, ModelKind::disk, spins);
  auto value = numbers(sample);
  CHECK(value["kinetic_energy"] == Approx(c.topology.inertia[0] / 2 * 2500));
  CHECK(value["friction_force"] == Approx(2 * DiskParameters().mu_disk * 10 / 3));  // μN on both, in the mean of three
  CHECK(value["drag_force"] == 0);
}

/// Rows of a steady flow of rate 2. noise: relative, of density and rate.
Series steady_series(Real noise) {
  Series series;
  Random random(4);
  const auto put = [&](const char* name, Real value) {
    series[name].values.push_back(value);
    ++series[name].rows;
  };
  Real crossed = 0;
  for (int k = 0; k < 400; ++k, crossed += 2 * (1 + noise * random(-1, 1))) {
    put("time", k);
    put("crossed_count", crossed);
    put("crossed_area", crossed);
    put("kinetic_energy", 9);
    put("contact_pairs", 30);
    put("orifice_density", 0.5 * (1 + noise * random(-1, 1)));
    put("bulk_fraction", 0.8);
    put("top_height", 12);
    put("max_overlap", 0.05);
    put("drag_force", 3);
    put("friction_force", 1.5);
    for (const Real height : {0.0, 0.5}) {
      put("profile_momentum", 0.6 + height);
      put("profile_weight", 0.2);
    }
  }
  series["profile_momentum"].width = series["profile_weight"].width = 2;
  return series;
}

}  // namespace

TEST_CASE("a sample of a few particles", "[measurements]") {
  check_sample<2>();
  check_sample<3>();
}

TEST_CASE("a sample of disks and spheres that rub", "[measurements]") {
  check_disks<2>();
  check_disks<3>();
}

TEST_CASE("forces on a polygon are those on its points together", "[measurements]") {
  Configuration<2> c;
  c.add_polygon(regular_polygon(6, 0.5, {0, 5}), 0.2);
  c.add_polygon(regular_polygon(6, 0.5, {5, 5}), 0.2);
  for (Index i = 0; i < 6; ++i) point<2>(c.v.data(), i) = pliant::Vec<2>(3, 4);
  // The second turns about itself: drag on its points cancels.
  for (Index i = 6; i < 12; ++i) {
    const pliant::Vec<2> r = c.position(i) - pliant::Vec<2>(5, 5);
    point<2>(c.v.data(), i) = pliant::Vec<2>(-r[1], r[0]);
  }
  auto value = numbers(sample_of<2>(c, ModelKind::rough));
  CHECK(value["drag_force"] == Approx(zeta * 5 / 2));
  CHECK(value["friction_force"] == 0);
  CHECK(value["in_hopper"] == 2);
  CHECK(value["top_height"] == Approx(5));
  CHECK(value["max_speed"] == Approx(5));
}

TEST_CASE("energies are of the active particles", "[measurements]") {
  const auto energies = [](const Configuration<2>& c) {
    ParticleSystem<2> system(c.topology, hopper.walls<2>(),
                             make_force_field<2>(ModelKind::rough, {.k_a = 10, .k_l = 20, .k_b = 3}, {0, -1}), 0.1);
    State state(c.topology.points(), system.coordinates().all());
    std::ranges::copy(c.x, state.x().begin());
    std::ranges::copy(c.v, state.v().begin());
    auto value = numbers(take_sample<2>(system, state, hopper, {}, 0.01));
    return std::array{value["kinetic_energy"], value["potential_energy"],
                      system.field().energy(system.view(state.x().data(), state.v().data()))};
  };
  const auto add_stretched = [](Configuration<2>& c, Real x, Real height) {
    c.add_polygon(regular_polygon(6, 0.5, {x, height}), 0.2);
    const Index n = c.topology.points();
    for (Index i = n - 6; i < n; ++i) {
      point<2>(c.x.data(), i)[0] = x + 1.5 * (point<2>(c.x.data(), i)[0] - x);
      point<2>(c.v.data(), i) = pliant::Vec<2>(1, 2);
    }
  };
  Configuration<2> one, both;
  add_stretched(one, 0, 5);
  add_stretched(both, 0, 5);
  add_stretched(both, 0, -3);
  const auto expected = energies(one), all = energies(both);
  REQUIRE(expected[1] > 0);
  CHECK(all[1] == Approx(2 * expected[1]));
  both.topology.deactivate(1);
  const auto active = energies(both);
  for (std::size_t k = 0; k < 3; ++k) CHECK(active[k] == Approx(expected[k]));
}

TEST_CASE("polygons that touch in several places are one pair", "[measurements]") {
  Configuration<2> c;
  const Polygon square_one{{0, 5}, {1, 5}, {1, 6}, {0, 6}}, square_two{{1.1, 5}, {2.1, 5}, {2.1, 6}, {1.1, 6}};
  c.add_polygon(square_one, 0.2);
  c.add_polygon(square_two, 0.2);
  auto value = numbers(sample_of<2>(c, ModelKind::rough));
  CHECK(value["contact_pairs"] == 1);
  CHECK(value["max_overlap"] == Approx(0.5));
}

TEST_CASE("no particle above the orifice", "[measurements]") {
  Configuration<2> c;
  c.add_soft(1, {0, -1});
  c.v = {0, -1};
  auto value = numbers(sample_of<2>(c, ModelKind::sp));
  CHECK(std::isnan(value["bulk_fraction"]));  // no particles
  for (const char* name :
       {"in_hopper", "drag_force", "friction_force", "orifice_density", "top_height", "max_speed", "contact_pairs"})
    CHECK(value[name] == 0);
}

TEST_CASE("quantities of a series whose averages are known", "[measurements]") {
  HopperOptions options;
  options.container = Hopper{};
  options.particles = 40;
  options.dim = GENERATE(2, 3);
  for (const char* name : {"mu", "zeta"}) options.model.set(name, 1.0);
  const auto result = evaluate_series(steady_series(0), options, 0.8);
  const auto value = [&](const char* name) { return result.at(name).at("value").get<Real>(); };
  CHECK(value("Q") == Approx(2));
  CHECK(value("Q_corrected") == Approx(2 / (0.5 * 0.8)));
  CHECK(value("orifice_density") == Approx(0.5));
  CHECK(value("bulk_fraction") == Approx(0.8));
  CHECK(value("contacts_per_particle") == Approx(2 * 30 / 40.0));
  CHECK(value("top_height") == Approx(12));
  CHECK(value("max_overlap") == Approx(0.05));
  CHECK(result.at("max_overlap").at("error").is_null());  // a maximum has no block error
  CHECK_FALSE(result.at("top_height").at("error").is_null());
  CHECK(value("drag_friction_ratio") == Approx(2));
  CHECK(value("orifice_velocity") == Approx(3));
  const std::string d = std::to_string(options.dim);
  CHECK(result.at("Q_corrected").at("unit") == "sigma_avg^" + d + "/t0");
  CHECK(result.at("orifice_density").at("unit") == "sigma_avg^-" + d);
  CHECK(result.at("orifice_velocity").at("unit") == "sigma_avg/t0");
  CHECK(result.at("axis_velocity").at("error").size() == 2);
  CHECK(result.at("axis_velocity").at("error").front() == result.at("orifice_velocity").at("error"));
  options.model.set("mu", 0.0);
  CHECK_FALSE(evaluate_series(steady_series(0), options, 0.8).contains("drag_friction_ratio"));
}

TEST_CASE("the error of Q_corrected is that of both of its factors", "[measurements]") {
  HopperOptions options;
  options.container = Hopper{};
  options.particles = 40;
  options.model.set("zeta", 1.0);
  const auto result = evaluate_series(steady_series(0.2), options, 0.8);
  const auto part = [&](const char* name, const char* which) { return result.at(name).at(which).get<Real>(); };
  const Real q = part("Q", "error") / part("Q", "value"),
             density = part("orifice_density", "error") / part("orifice_density", "value");
  REQUIRE(q > 0);
  REQUIRE(density > 1e-3);
  CHECK(part("Q_corrected", "value") == Approx(part("Q", "value") / (part("orifice_density", "value") * 0.8)));
  CHECK(part("Q_corrected", "error") / part("Q_corrected", "value") == Approx(std::sqrt(q * q + density * density)));
}

}  // namespace pliant::test::measurements_test
