// The models by name: their sums, terms and critical steps.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::catalogue_test {

namespace {

const ModelParameters all_on{
    .epsilon = 1e3, .epsilon_wall = 2e3, .k_a = 20, .k_l = 3, .k_b = 0.2, .mu = 0.7, .zeta = 0.3};

template <int D>
void check_sums(ModelKind kind, Configuration<D> c, const std::vector<std::string>& names) {
  const auto field = make_force_field<D>(kind, all_on, Vec<D>::LinSpaced(0.1, -1));
  const StateView<D> s = c.view();
  const Index n = static_cast<Index>(c.x.size());
  VectorXd forces(n), energy_forces(n), sum = VectorXd::Zero(n), energy_sum = VectorXd::Zero(n), one(n);
  field->forces(s, forces.data());
  const Real energy = field->energy(s, energy_forces.data());
  CHECK(field->energy(s) == energy);
  Real reported = 0;
  std::vector<std::string> found;
  for (const TermReport& r : field->report(s)) {
    INFO(r.name);
    found.push_back(r.name);
    const auto f = Eigen::Map<const VectorXd>(r.force.data(), n);
    CHECK(f.norm() > 0);  // every term acts here
    CHECK(r.is_energy == (r.name != "drag" && r.name != "friction"));
    sum += f;
    if (r.is_energy) energy_sum += f;
    reported += r.energy;
    field->force_of({r.name}, s, one.data());
    CHECK(one == f);
  }
  CHECK(found == names);
  CHECK(reported == Approx(energy).epsilon(1e-13));
  CHECK((sum - forces).norm() < 1e-13 * forces.norm());
  CHECK((energy_sum - energy_forces).norm() < 1e-13 * forces.norm());
  CHECK((forces - energy_forces).norm() > 0);
  field->force_of({"depletion"}, s, one.data());
  CHECK(one.norm() == 0);
  // Dissipations.
  field->dissipative_forces(s, one.data());
  CHECK((one - (forces - energy_forces)).norm() < 1e-13 * forces.norm());
  CHECK(field->power(s) == Approx(-(forces - energy_forces).dot(Eigen::Map<const VectorXd>(c.v.data(), n))));
}

template <int D>
Configuration<D> soft_in_hopper(Random& random) {
  Configuration<D> c = soft_at_wall<D>(random, 60, WallPlace::slope);
  c.add_soft(1, c.position(0) + 0.8 * Vec<D>::Unit(0));
  c.random_velocities(random);
  return c;
}

/// A polygon at the lip, a second polygon in contact with it, and a third on the sloped wall.
Configuration<2> polygons_at_lip(Random& random, Real delta) {
  Configuration<2> c = polygon_at_lip(random, 60, LipPlace::edge, delta);
  const Vec<2> corner = c.position(4), centre = mean_of_points<2>(c.x.data(), c.topology, 0);
  const Vec<2> away = (corner - centre).normalized();
  c.add_polygon(wedge(corner + 0.4 * delta * away, away), delta);
  const Vec<2> foot(3, 1.5 / std::tan(pi / 3));  // on the slope of a 60° hopper
  c.add_polygon(wedge(foot + Vec<2>(0, 0.3 * delta), {0, 1}), delta);
  c.random_velocities(random);
  return c;
}

/// The small particle of the bidisperse mixture: σ_s = 1/1.2, Nv = 16.
Topology small_polygon(Real delta_over_l0) {
  const Real a0 = pi / 4 / square(1.2), l0 = std::sqrt(4 * a0 * 16 * std::tan(pi / 16)) / 16;
  Topology topology;
  topology.add_polygon(16, a0, l0, delta_over_l0 * l0, a0);
  return topology;
}

/// Fastest frequency of the linearised motion.
template <int D>
Real fastest(const ForceField<D>& field, Configuration<D>& c) {
  MatrixXd h = functional(field, c).hessian(c.positions());
  for (Index i = 0; i < h.rows(); ++i)
    for (Index j = 0; j < h.cols(); ++j)
      h(i, j) *= std::sqrt(c.topology.inverse_mass(i / D) * c.topology.inverse_mass(j / D));
  return std::sqrt(Eigen::SelfAdjointEigenSolver<MatrixXd>(h).eigenvalues().maxCoeff());
}

}  // namespace

TEST_CASE("forces and energies are the sums of the terms") {
  for (int k = 0; k < 5; ++k) {
    Random random(k);
    check_sums<2>(ModelKind::sp, soft_in_hopper<2>(random), {"pair", "friction", "wall", "gravity", "drag"});
    check_sums<3>(ModelKind::sp, soft_in_hopper<3>(random), {"pair", "friction", "wall", "gravity", "drag"});
    std::vector<std::string> names{"area", "perimeter", "bending", "contact", "friction",
                                   "wall", "lip",       "gravity", "drag"};
    check_sums<2>(ModelKind::smooth, polygons_at_lip(random, smooth_width), names);
    names.insert(names.begin() + 5, "edge");
    check_sums<2>(ModelKind::rough, polygons_at_lip(random, 0.3).with_bare_edges(), names);
    Configuration<2> free;
    free.add_polygon(irregular_polygon(random, 9, 0.6), 0.1);
    free.random_velocities(random);
    check_sums<2>(ModelKind::shape, std::move(free), {"area", "perimeter", "bending", "gravity", "drag"});
  }
}

TEST_CASE("coefficients of zero switch terms off") {
  Random random(1);
  Configuration<2> c = polygons_at_lip(random, 0.3);
  const auto field = make_force_field<2>(ModelKind::rough, {.lip_edges = false, .rough_edges = false}, Vec<2>::Zero());
  std::vector<std::string> names;
  for (const TermReport& r : field->report(c.view())) names.push_back(r.name);
  CHECK(names == std::vector<std::string>{"contact", "wall"});
}

TEST_CASE("names of the models") {
  CHECK(to_string(ModelKind::sp) == "sp");
  CHECK(to_string(ModelKind::rough) == "rough");
  CHECK(to_string(ModelKind::smooth) == "smooth");
  CHECK(to_string(ModelKind::shape) == "shape");
  CHECK(to_string(ModelKind::bubble) == "bubble");
}

TEST_CASE("critical steps of the small particle of [H]") {
  const auto step = [](ModelKind kind, Real delta, ModelParameters p) {
    return make_force_field<2>(kind, p, Vec<2>::Zero())->critical_step(small_polygon(delta)).one_contact();
  };
  ModelParameters contact{.epsilon = 1e4, .epsilon_wall = 0}, wall{.epsilon = 0, .epsilon_wall = 1e4};
  CHECK(step(ModelKind::rough, 1, contact) == Approx(4.3e-4).epsilon(0.01));
  CHECK(step(ModelKind::rough, 1, wall) == Approx(3.0e-4).epsilon(0.02));
  // A vertex on an edge has 4.3e-5; head-on against a vertex, both directions count.
  CHECK(step(ModelKind::smooth, 0.1, contact) == Approx(4.3e-5 / std::sqrt(2)).epsilon(0.01));
  CHECK(step(ModelKind::smooth, 0.1, wall) == Approx(3.0e-5).epsilon(0.02));
  // The stiffest term decides; nothing that could vibrate sets no limit.
  wall.epsilon = 1e4;
  CHECK(step(ModelKind::rough, 1, wall) == Approx(3.0e-4).epsilon(0.02));
  CHECK(step(ModelKind::shape, 1, {}) == std::numeric_limits<Real>::infinity());
  // Fast damping: 1/rate, with ζ/(Nv m) = ζ/M.
  CHECK(step(ModelKind::shape, 1, {.zeta = 1e3}) == Approx(pi / 4 / square(1.2) / 1e3));
}

TEST_CASE("critical steps belong to the fastest mode of the linearised motion") {
  const auto frequency = [](const ForceField<2>& field, Configuration<2>& c) { return 2 / fastest<2>(field, c); };
  const auto limit = [](const ForceField<2>& field, Configuration<2>& c) {
    return field.critical_step(c.topology).one_contact();
  };
  SECTION("one contact: exact") {
    Configuration<2> pair;
    pair.add_soft(1, {0, 0});
    pair.add_soft(1, {0.999, 0});
    const auto soft = make_force_field<2>(ModelKind::sp, {.epsilon = 100, .epsilon_wall = 0}, Vec<2>::Zero());
    CHECK(limit(*soft, pair) == Approx(frequency(*soft, pair)));
    Configuration<2> at_wall;
    at_wall.walls = test_hopper(90).walls<2>();
    at_wall.add_soft(1, {4.51, 3});
    const auto hard_wall = make_force_field<2>(ModelKind::sp, {.epsilon = 0, .epsilon_wall = 100}, Vec<2>::Zero());
    CHECK(limit(*hard_wall, at_wall) == Approx(frequency(*hard_wall, at_wall)));
  }
  SECTION("a vertex against an edge: at most 1/√2 of its own limit is allowed for, which vertex against vertex needs") {
    const auto field = make_force_field<2>(ModelKind::smooth, {.epsilon = 100, .epsilon_wall = 0}, Vec<2>::Zero());
    for (const Real t : {0.5, 0.8}) {
      Configuration<2> c;
      c.add_polygon({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 0.1);
      c.add_polygon(wedge({t, -0.0999}, {0, -1}), 0.1);
      for (Index m = 0; m < c.topology.particles(); ++m)
        c.topology.point_mass[m] = 0.1, c.topology.inverse_point_mass[m] = 10;
      const Real ratio = std::sqrt((1 + square(t) + square(1 - t)) / 4);
      CHECK(limit(*field, c) == Approx(ratio * frequency(*field, c)).epsilon(1e-3));
    }
  }
  SECTION("shape of a regular polygon at rest: an upper estimate, and no worse than a factor 2") {
    const Real l0 = 2 * 0.5 * std::sin(pi / 16);
    Configuration<2> c;
    c.add_polygon(regular_polygon(16, 0.5), 0.1);
    c.topology.a0[0] = polygon_area(c.x.data(), c.topology, 0);
    c.topology.l0[0] = l0;
    for (const ModelParameters& p : {ModelParameters{.epsilon = 0, .epsilon_wall = 0, .k_a = 10},
                                     ModelParameters{.epsilon = 0, .epsilon_wall = 0, .k_l = 10},
                                     ModelParameters{.epsilon = 0, .epsilon_wall = 0, .k_b = 10}}) {
      INFO("k_a " << p.k_a << ", k_l " << p.k_l << ", k_b " << p.k_b);
      const auto field = make_force_field<2>(ModelKind::shape, p, Vec<2>::Zero());
      CHECK(limit(*field, c) <= 1.0001 * frequency(*field, c));
      CHECK(limit(*field, c) >= 0.5 * frequency(*field, c));
    }
  }
}

}  // namespace pliant::test::catalogue_test
