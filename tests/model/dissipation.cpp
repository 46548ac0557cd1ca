// Drag and friction: power, momentum, ∂F/∂v.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/pair_friction.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::dissipation_test {

namespace {

constexpr Friction tangential = Friction::tangential;

template <int D>
void check_dissipation(const ForceField<D>& field, Configuration<D> c, Random& random, bool internal) {
  const Index n = static_cast<Index>(c.x.size());
  const auto force = [&](const VectorXd& v) {
    std::copy(v.begin(), v.end(), c.v.begin());
    VectorXd f(n);
    field.forces(c.view(), f.data());
    return f;
  };
  const VectorXd v = 2 * random_direction(random, n), f = force(v);
  REQUIRE(f.norm() > 1e-6);  // acts
  CHECK(field.energy(c.view()) == 0);
  CHECK(field.power(c.view()) > 0);
  CHECK(field.power(c.view()) == Approx(-f.dot(v)).epsilon(1e-12));
  Vec<D> sum = Vec<D>::Zero();
  for (Index i = 0; i < c.topology.points(); ++i) sum += point<D>(f.data(), i);
  CHECK((sum.norm() < 1e-13 * f.template lpNorm<1>()) == internal);

  DenseSink<D> sink(c.topology.points());
  field.damping(c.view(), sink);
  const MatrixXd& damping = sink.matrix;
  REQUIRE(damping.norm() > 0);
  // Linear in v: differences are exact.
  MatrixXd difference(n, n);
  for (Index k = 0; k < n; ++k) difference.col(k) = force(v + VectorXd::Unit(n, k)) - f;
  CHECK((damping - difference).norm() < 1e-12 * damping.norm());
  CHECK((damping - damping.transpose()).norm() < 1e-14 * damping.norm());
  CHECK(Eigen::SelfAdjointEigenSolver<MatrixXd>(damping).eigenvalues().maxCoeff() < 1e-13 * damping.norm());
  // The common velocity of all points feels drag only.
  VectorXd common(n);
  for (Index i = 0; i < c.topology.points(); ++i) point<D>(common.data(), i) = Vec<D>::LinSpaced(0.3, 0.8);
  CHECK((force(common).norm() < 1e-13) == internal);
}

}  // namespace

TEST_CASE("dissipation: power, momentum and damping matrix") {
  for (int k = 0; k < 15; ++k) {
    INFO("state " << k);
    Random random(k);
    check_dissipation(*alone<2>(Drag<2>{0.4}), soft_cluster<2>(random), random, false);
    check_dissipation(*alone<3>(Drag<3>{0.4}), soft_cluster<3>(random), random, false);
    check_dissipation(*alone<2>(Drag<2>{0.4}), crowd_of_polygons(random, 0.3), random, false);
    check_dissipation(*alone<2>(Drag<2>{0.4, DragLaw::per_mass}), crowd_of_polygons(random, 0.3), random, false);
    check_dissipation(*alone<3>(Drag<3>{0.4, DragLaw::per_mass}), soft_cluster<3>(random), random, false);
    check_dissipation(*alone<2>(PairFriction<2>{0.6}), soft_cluster<2>(random), random, true);
    check_dissipation(*alone<3>(PairFriction<3>{0.6}), soft_cluster<3>(random), random, true);
    check_dissipation(*alone<2>(PairFriction<2>{0.6}), crowd_of_polygons(random, 0.3), random, true);
    for (const FrictionPoint where : {FrictionPoint::contact, FrictionPoint::vertex})
      for (const Place place : interior_places) {
        INFO("friction point " << static_cast<int>(where) << ", place " << static_cast<int>(place));
        check_dissipation(*alone<2>(EdgeFriction{0.6, where}), touching_polygons(random, place), random, true);
        check_dissipation(*alone<2>(EdgeFriction{0.6, where, tangential}), touching_polygons(random, place), random,
                          true);
      }
    check_dissipation(*alone<2>(PairFriction<2>{0.6, tangential}), soft_cluster<2>(random), random, true);
    check_dissipation(*alone<3>(PairFriction<3>{0.6, tangential}), soft_cluster<3>(random), random, true);
    check_dissipation(*alone<2>(PairFriction<2>{0.6, tangential}), crowd_of_polygons(random, 0.3), random, true);
  }
}

TEST_CASE("drag on a particle is -zeta times its mean velocity") {
  Random random(3);
  Configuration<2> c;
  c.add_polygon(regular_polygon(16, 0.5), 0.1);
  c.random_velocities(random);
  std::vector<Real> f(c.x.size());
  alone<2>(Drag<2>{0.4})->forces(c.view(), f.data());
  const Vec<2> sum = 16 * mean_of_points<2>(f.data(), c.topology, 0);
  CHECK((sum + 0.4 * mean_of_points<2>(c.v.data(), c.topology, 0)).norm() < 1e-14);
}

TEMPLATE_TEST_CASE_SIG("drag per mass slows all sizes alike", "", ((int D), D), 2, 3) {
  // The drag coefficient of one particle of diameter σ_avg is zeta; masses have density 1.
  for (const Real sigma : {1.0, 0.5, 1.4}) {
    const Real mass = std::pow(sigma, D) * (D == 2 ? pi / 4 : pi / 6);
    Configuration<D> c;
    c.topology.add_soft(sigma, mass);
    c.x.assign(D, 0);
    c.v.assign(D, 3);
    std::vector<Real> f(c.x.size());
    for (const bool kernels : {false, true}) {
      const auto drag =
          kernels ? make_force_field<D>(ModelKind::sp, {.zeta = 0.4, .drag = DragLaw::per_mass}, Vec<D>::Zero())
                  : alone<D>(Drag<D>{0.4, DragLaw::per_mass});
      drag->forces(c.view(), f.data());
      for (const Real force : f) CHECK(force == Approx(-0.4 * std::pow(sigma, D) * 3).epsilon(1e-14));
      CHECK(drag->power(c.view()) == Approx(0.4 * std::pow(sigma, D) * 9 * D));
      if (!kernels) CHECK(drag->critical_step(c.topology).damping == Approx((D == 2 ? pi / 4 : pi / 6) / 0.4));
    }
  }
  if constexpr (D == 2) {
    // Shared by the vertices.
    Random random(3);
    Configuration<2> c;
    c.add_polygon(regular_polygon(16, 0.5), 0.1);
    c.random_velocities(random);
    std::vector<Real> f(c.x.size());
    alone<2>(Drag<2>{0.4, DragLaw::per_mass})->forces(c.view(), f.data());
    const Vec<2> sum = 16 * mean_of_points<2>(f.data(), c.topology, 0);
    const Real mass = 16 * c.topology.point_mass[0];
    CHECK((sum + 0.4 * mass / (pi / 4) * mean_of_points<2>(c.v.data(), c.topology, 0)).norm() < 1e-14);
  }
}

TEST_CASE("friction is -mu times the whole relative velocity, also along the normal") {
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  c.add_soft(1, {0.9, 0});
  c.v = {0, 0, 2, 3};
  std::vector<Real> f(4);
  alone<2>(PairFriction<2>{0.5})->forces(c.view(), f.data());
  CHECK(f == std::vector<Real>{1, 1.5, -1, -1.5});
  c.x[2] = 1.01;  // apart
  alone<2>(PairFriction<2>{0.5})->forces(c.view(), f.data());
  CHECK(f == std::vector<Real>(4, 0.0));
}

TEMPLATE_TEST_CASE_SIG("tangential friction leaves the velocity along the normal alone", "", ((int D), D), 2, 3) {
  Configuration<D> c;
  Vec<D> n = Vec<D>::Zero(), u = Vec<D>::Zero(), across = Vec<D>::Zero();
  n[0] = 0.6, n[1] = 0.8;
  u[0] = 2, u[1] = 3;                   // 3.6 along the normal
  across[0] = -0.16, across[1] = 0.12;  // the remaining part
  if (D == 3) u[D - 1] = across[D - 1] = 5;
  c.add_soft(1, Vec<D>::Zero());
  c.add_soft(1, 0.9 * n);
  const auto field = alone<D>(PairFriction<D>{0.5, tangential});
  const auto force = [&](const Vec<D>& velocity) {
    point<D>(c.v.data(), 1) = velocity;
    std::vector<Real> f(c.x.size());
    field->forces(c.view(), f.data());
    CHECK((point<D>(f.data(), 0) + point<D>(f.data(), 1)).norm() < 1e-15);
    return Vec<D>(point<D>(f.data(), 0));
  };
  CHECK((force(u) - 0.5 * across).norm() < 1e-14);
  CHECK(field->power(c.view()) == Approx(0.5 * across.squaredNorm()));
  CHECK(force(7 * n).norm() < 1e-14);
  CHECK(field->power(c.view()) < 1e-14);
}

TEST_CASE("tangential friction of an edge acts along the edge") {
  // As below: an upright edge, touched at t = 0.25 from the right.
  Configuration<2> c;
  c.add_polygon({{0, 0}, {0, 1}, {-1, 1}, {-1, 0}}, 0.1);
  c.add_polygon(wedge({0.05, 0.25}, {1, 0}), 0.1);
  point<2>(c.v.data(), 0) = Vec<2>(1, 1);
  point<2>(c.v.data(), 1) = Vec<2>(5, 5);
  std::vector<Real> f(c.x.size());
  const auto at = [&](Index i) { return Vec<2>(point<2>(f.data(), i)); };
  alone<2>(EdgeFriction{1, FrictionPoint::contact, tangential})->forces(c.view(), f.data());
  CHECK((at(4) - Vec<2>(0, 2)).norm() < 1e-14);
  CHECK((at(0) + 0.75 * Vec<2>(0, 2)).norm() < 1e-14);
  CHECK((at(1) + 0.25 * Vec<2>(0, 2)).norm() < 1e-14);
  alone<2>(EdgeFriction{1, FrictionPoint::vertex, tangential})->forces(c.view(), f.data());
  CHECK((at(4) - Vec<2>(0, 1)).norm() < 1e-14);
  CHECK((at(0) + Vec<2>(0, 1)).norm() < 1e-14);
  CHECK(at(1).norm() == 0);
}

TEST_CASE("tangential friction is continuous where a contact goes round a corner") {
  const auto field = alone<2>(EdgeFriction{1, FrictionPoint::contact, tangential});
  for (int k = 0; k < 20; ++k) {
    INFO("state " << k);
    Random random(k);
    Configuration<2> c = touching_polygons(random, Place::edge_end);
    const VectorXd x = c.positions(), p = random_direction(random, x.size());
    const auto force = [&](Real h) {
      const VectorXd moved = x + h * p;
      VectorXd f(x.size());
      field->forces(c.view(moved.data()), f.data());
      return f;
    };
    REQUIRE(force(0).norm() > 0.01);
    CHECK((force(1e-8) - force(-1e-8)).norm() < 1e-5);
  }
}

TEST_CASE("edge friction acts at the material point of the contact; literally, at the first vertex") {
  // An upright edge from (0, 0) to (0, 1) of a square to its left, touched at t = 0.25 by a tip from the right.
  Configuration<2> c;
  c.add_polygon({{0, 0}, {0, 1}, {-1, 1}, {-1, 0}}, 0.1);
  c.add_polygon(wedge({0.05, 0.25}, {1, 0}), 0.1);
  point<2>(c.v.data(), 0) = Vec<2>(1, 2);
  point<2>(c.v.data(), 1) = Vec<2>(5, 2);
  std::vector<Real> f(c.x.size());
  const auto at = [&](Index i) { return Vec<2>(point<2>(f.data(), i)); };
  alone<2>(EdgeFriction{1, FrictionPoint::contact})->forces(c.view(), f.data());
  CHECK((at(4) - Vec<2>(2, 2)).norm() < 1e-14);  // v_c = ¾ (1, 2) + ¼ (5, 2)
  CHECK((at(0) + 0.75 * Vec<2>(2, 2)).norm() < 1e-14);
  CHECK((at(1) + 0.25 * Vec<2>(2, 2)).norm() < 1e-14);
  alone<2>(EdgeFriction{1, FrictionPoint::vertex})->forces(c.view(), f.data());
  CHECK((at(4) - Vec<2>(1, 2)).norm() < 1e-14);
  CHECK((at(0) + Vec<2>(1, 2)).norm() < 1e-14);
  CHECK(at(1).norm() == 0);
}

}  // namespace pliant::test::dissipation_test
