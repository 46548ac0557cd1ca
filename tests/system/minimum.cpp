#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/system/minimum.h>

#include "support/model_parameters.h"

namespace pliant::test::minimum_test {

namespace {

/// Droplets of radius 1 and weight 0.1 in a valley with slopes of 45°.
ParticleSystem<2> valley(Index droplets) {
  Topology t;
  for (Index m = 0; m < droplets; ++m) t.add_soft(2, 1);
  const Walls<2> walls(
      std::vector<Solid<2>>{Solid<2>::half_space({0, 0}, {1, 1}), Solid<2>::half_space({0, 0}, {-1, 1})});
  const ModelParameters p{.phi_c = 0};
  return {std::move(t), walls, make_force_field<2>(ModelKind::bubble, p, {0, -0.1}), 0.3};
}

/// Height of one droplet at rest, or of the lower of two: each wall carries load/√2 = 10 (1/h − 1), h = y/√2.
Real resting_height(Real load) { return std::sqrt(Real(2)) / (1 + load / std::sqrt(Real(2)) / 10); }

}  // namespace

TEST_CASE("a droplet in a valley is next to its minimum, if it is near") {
  ParticleSystem<2> system = valley(1);
  const Real y = resting_height(0.1);
  for (const Real off : {0., 0.008}) {
    const std::vector<Real> x{off, y};
    CHECK(next_to_minimum<2>(system, x, 0, 0.01));
  }
  CHECK_FALSE(next_to_minimum<2>(system, std::vector<Real>{0.008, y}, 0, 0.005));
  // If only one wall supports the droplet, it can move along that wall.
  CHECK_FALSE(next_to_minimum<2>(system, std::vector<Real>{0.02, y}, 0, 0.03));
}

TEST_CASE("a droplet in the air is not") {
  ParticleSystem<2> system = valley(1);
  CHECK_FALSE(next_to_minimum<2>(system, std::vector<Real>{0, 3}, 0, 1));
}

TEST_CASE("a droplet that balances on another is at rest, but at a saddle") {
  ParticleSystem<2> system = valley(2);
  const Real y = resting_height(0.2), gap = 2 * (1 - 0.1 / 10);
  const std::vector<Real> upright{0, y, 0, y + gap};
  std::vector<Real> force(4);
  system.field().forces(system.view(upright.data(), nullptr), force.data());
  for (const Real f : force) REQUIRE(std::abs(f) < 1e-12);
  CHECK_FALSE(next_to_minimum<2>(system, upright, 0, 0.01));
  SECTION("taken out, the upper one does not count") {
    system.deactivate(1);
    const std::vector<Real> alone{0, resting_height(0.1), 0, y + gap};
    CHECK(next_to_minimum<2>(system, alone, 0, 0.01));
  }
}

}  // namespace pliant::test::minimum_test
