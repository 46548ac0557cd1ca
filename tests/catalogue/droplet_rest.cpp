// Where droplets rest, against the numbers of the thesis and against differences of the terms' own energy.
#include <catch2/catch.hpp>

#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/catalogue/droplet_rest.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::droplet_rest_test {

namespace {

DropletRest pair_at_rest(const ModelParameters& p, Real a, Real b) {
  return droplets_at_rest({p.f0}, {p.phi_c, p.a_s}, a, b);
}
DropletRest rest_at_wall(const ModelParameters& p, Real radius) {
  return droplet_at_wall({p.f0 * p.mean_radius}, {p.phi_c, p.a_s}, radius);
}

}  // namespace

TEST_CASE("droplets rest where the thesis says") {
  const ModelParameters standard;
  const DropletRest pair = pair_at_rest(standard, 1, 1), wall = rest_at_wall(standard, 1);
  CHECK(pair.distance == Approx(1.993).margin(5e-4));  // [T 2.16]
  CHECK(pair.stiffness == Approx(4.69).margin(5e-3));  // [T 2.18]
  CHECK(pair.energy == Approx(0.00173).margin(5e-6));  // [T 2.23]
  CHECK(wall.stiffness == Approx(9.54).margin(5e-3));  // [T 2.24] prints 9.57, from an expansion
  CHECK(wall.energy == Approx(0.00340).margin(2e-5));  // [T 2.25]
}

TEST_CASE("rest is a minimum of the model's energy") {
  const ModelParameters p{.f0 = 7, .phi_c = 3e-4, .a_s = 0.08};
  const auto field = make_force_field<2>(ModelKind::bubble, p, pliant::Vec<2>::Zero());
  const auto check = [&](const DropletRest& rest, auto&& configuration) {
    const auto energy = [&](Real at) {
      const Configuration<2> c = configuration(at);
      Neighbours<2> lists(field->needs(), 0.1);
      lists.rebuild(c.topology, c.walls, c.x.data());
      return field->energy({c.x.data(), nullptr, c.topology, lists, c.walls});
    };
    const Real h = 1e-5, at = rest.distance;
    CHECK(energy(at) == Approx(-rest.energy).epsilon(1e-9));
    CHECK((energy(at + h) - energy(at - h)) / (2 * h) == Approx(0).margin(1e-8));
    CHECK((energy(at + h) - 2 * energy(at) + energy(at - h)) / square(h) == Approx(rest.stiffness).epsilon(1e-4));
  };
  check(pair_at_rest(p, 1, 0.7), [](Real r) {
    Configuration<2> c;
    c.add_droplet(1, {0, 0});
    c.add_droplet(0.7, {r, 0});
    return c;
  });
  check(rest_at_wall(p, 0.9), [](Real h) {
    Configuration<2> c;
    c.add_droplet(0.9, {0, h});
    c.walls = Walls<2>(std::vector{Solid<2>::half_space({0, 0}, {0, 1})});
    return c;
  });
}

TEST_CASE("without attraction droplets rest in touch; with too much of it they do not") {
  const DropletRest touch = pair_at_rest({.phi_c = 0}, 1, 0.5);
  CHECK(touch.distance == Approx(1.5).epsilon(1e-15));
  CHECK(touch.energy == Approx(0).margin(1e-15));
  CHECK(rest_at_wall({.phi_c = 0}, 1).distance == Approx(1).epsilon(1e-15));
  CHECK_THROWS_AS(pair_at_rest({.phi_c = 1}, 1, 1), InputError);
  CHECK_THROWS_AS(rest_at_wall({.phi_c = 1}, 1), InputError);
}

}  // namespace pliant::test::droplet_rest_test
