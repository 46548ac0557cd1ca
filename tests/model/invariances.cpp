// Invariance under shifts and rotations, and quantities that forces between particles conserve.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/pair_contact.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::invariances_test {

namespace {

constexpr int repeats = 20;

template <int D>
Mat<D> random_rotation(Random& random) {
  if constexpr (D == 2)
    return Eigen::Rotation2D<Real>(random(0, 2 * pi)).toRotationMatrix();
  else
    return Eigen::AngleAxis<Real>(random(0, 2 * pi), random.unit<3>()).toRotationMatrix();
}

template <int D>
Vec<D> total(const VectorXd& f) {
  Vec<D> sum = Vec<D>::Zero();
  for (Index i = 0; i < f.size() / D; ++i) sum += point<D>(f.data(), i);
  return sum;
}

/// Torque of f about the origin.
template <int D>
Vec<3> torque(const Configuration<D>& c, const VectorXd& f) {
  Vec<3> sum = Vec<3>::Zero();
  for (Index i = 0; i < c.topology.points(); ++i) {
    Vec<3> r = Vec<3>::Zero(), force = Vec<3>::Zero();
    r.head<D>() = c.position(i);
    force.head<D>() = point<D>(f.data(), i);
    sum += r.cross(force);
  }
  return sum;
}

template <int D>
void check_invariant(const ForceField<D>& field, Configuration<D> c, Random& random) {
  const Functional u = functional(field, c);
  const VectorXd x = c.positions(), f = -u.gradient(x);
  const Real energy = u.energy(x), size = f.template lpNorm<1>();
  REQUIRE(std::abs(energy) > 1e-6);
  REQUIRE(size > 1e-6);

  const Mat<D> q = random_rotation<D>(random);
  const Vec<D> shift = 3 * random.template unit<D>();
  VectorXd moved(x.size()), turned_force(x.size());
  for (Index i = 0; i < c.topology.points(); ++i) {
    point<D>(moved.data(), i) = q * c.position(i) + shift;
    point<D>(turned_force.data(), i) = q * point<D>(f.data(), i);
  }
  CHECK(u.energy(moved) == Approx(energy).epsilon(1e-10));
  CHECK((-u.gradient(moved) - turned_force).norm() < 1e-9 * size);

  CHECK(total<D>(f).norm() < 1e-12 * size);
  CHECK(torque(c, f).norm() < 1e-11 * size);
}

const ModelParameters parameters{
    .epsilon = 1e3, .epsilon_wall = 1e3, .k_a = 20, .k_l = 3, .k_b = 0.2, .mu = 0.7, .zeta = 0.3};

}  // namespace

TEST_CASE("energies do not see a shift or a rotation; forces turn along and conserve momentum and angular momentum") {
  for (int k = 0; k < repeats; ++k) {
    Random random(k);
    INFO("state " << k);
    for (const char* name : {"area", "perimeter", "bending"}) {
      INFO(name);
      ModelParameters p;
      (std::string(name) == "area" ? p.k_a : std::string(name) == "perimeter" ? p.k_l : p.k_b) = 5;
      Configuration<2> c;
      c.add_polygon(irregular_polygon(random, 5 + random.below(12), 0.7), 0.1);
      check_invariant(*make_force_field<2>(ModelKind::shape, p, Vec<2>::Zero()), std::move(c), random);
    }
    check_invariant(*alone<2>(PairContact<2>{1e3, "pair"}), soft_cluster<2>(random), random);
    check_invariant(*alone<3>(PairContact<3>{1e3, "pair"}), soft_cluster<3>(random), random);
    for (const Place place : interior_places) {
      check_invariant(*alone<2>(EdgeContact{1e3}), touching_polygons(random, place), random);
      check_invariant(*alone<2>(EdgeContact{1e3, Edges::bare}), touching_bare_polygons(random, place), random);
    }
    check_invariant(*make_force_field<2>(ModelKind::rough, parameters, Vec<2>::Zero()),
                    crowd_of_polygons(random, 0.3).with_bare_edges(), random);
    check_invariant(*make_force_field<2>(ModelKind::smooth, parameters, Vec<2>::Zero()),
                    crowd_of_polygons(random, smooth_width), random);
    check_invariant(*make_force_field<2>(ModelKind::sp, parameters, Vec<2>::Zero()), soft_cluster<2>(random), random);
    check_invariant(*make_force_field<3>(ModelKind::sp, parameters, Vec<3>::Zero()), soft_cluster<3>(random), random);
  }
}

TEST_CASE("gravity pulls with the weight, at the centre of mass") {
  Random random(1);
  Configuration<2> c = crowd_of_polygons(random, 0.3);
  const Vec<2> g(0.2, -0.9);
  const auto field = make_force_field<2>(ModelKind::shape, {}, g);
  const Functional u = functional(*field, c);
  const VectorXd f = -u.gradient(c.positions());
  Real mass = 0, energy = 0;
  for (Index m = 0; m < c.topology.particles(); ++m) {
    const Real particle = c.topology.mass(c.topology.offset[m]) * c.topology.points_of(m);
    mass += particle;
    energy -= particle * g.dot(mean_of_points<2>(c.x.data(), c.topology, m));
  }
  CHECK((total<2>(f) - mass * g).norm() < 1e-12 * mass);
  CHECK(u.energy(c.positions()) == Approx(energy));
}

}  // namespace pliant::test::invariances_test
