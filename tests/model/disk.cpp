// The model disk of the catalogue.
#include <catch2/catch.hpp>

#include <pliant/base/errors.h>
#include <pliant/catalogue/catalogue.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::disk_test {

namespace {

std::unique_ptr<ForceField<2>> disks(const DiskParameters& disk, ContactLaw law = ContactLaw::harmonic,
                                     const BaseParameters& base = {}) {
  return make_force_field<2>(ModelKind::disk,
                             {.epsilon = 1e3, .epsilon_wall = 2e3, .law = law, .zeta = 0.1, .disk = disk, .base = base},
                             pliant::Vec<2>(0, -1));
}
/// Two that meet, and one that meets a wall.
template <int D>
void check_damping(ContactLaw kind) {
  Configuration<D> c;
  c.walls = Hopper{.wall_distance = 20, .orifice = 4, .angle = 90}.walls<D>();
  const auto add = [&](Real x, Real height, Real vx, Real speed) {
    pliant::Vec<D> r = pliant::Vec<D>::Zero();
    r[0] = x, r[D - 1] = height;
    c.add_soft(1, r);
    point<D>(c.v.data(), c.topology.particles() - 1) =
        vx * pliant::Vec<D>::Unit(0) + speed * pliant::Vec<D>::Unit(D - 1);
  };
  const std::vector<Real> still(2 * rotations<D>);
  const auto zeta = [&](const Overlap& law, Real mass) {
    StateView<D> s = c.view();
    s.angles = s.spins = still.data();
    const auto power = [&](Real e) {
      return make_force_field<D>(ModelKind::disk,
                                 {.epsilon = 1e3, .epsilon_wall = 2e3, .law = kind, .disk = {.restitution = e}},
                                 pliant::Vec<D>::Zero())
          ->power(s);
    };
    return (power(0.3) - power(1)) / (2 * std::sqrt(mass * law.curvature(0.9 * law.delta)));
  };
  add(5, 0.45, 0, -1);
  CHECK(restitution(kind, zeta({kind, 2e3, 0.5}, c.topology.mass(0))) == Approx(0.3));
  c = Configuration<D>();
  add(0, 5, 0.5, 0);
  add(0.9, 5, -0.5, 0);
  CHECK(restitution(kind, zeta({kind, 1e3, 1}, c.topology.mass(0) / 2)) == Approx(0.3));
}

std::unique_ptr<ForceField<2>> on_table(const BaseParameters& base) { return disks({}, ContactLaw::harmonic, base); }

}  // namespace

TEST_CASE("the model disk has its terms and keeps what they need") {
  const auto field = on_table({.gravity = 1});
  const auto names = [](const ForceField<2>& f) {
    std::vector<std::string> all;
    for (const HistoryNeeds& needs : f.history_needs()) all.push_back(needs.name);
    return all;
  };
  CHECK(names(*field) == std::vector<std::string>{"disk_contact", "disk_wall_contact", "base_friction"});
  // Without a substrate, or without friction with it, there is no history.
  for (const BaseParameters& none : {BaseParameters{}, {.gravity = 1, .mu = 0, .mu_dynamic = 0}})
    CHECK(names(*on_table(none)) == std::vector<std::string>{"disk_contact", "disk_wall_contact"});
  CHECK(field->rotates());
  CHECK(field->needs().point_pairs);
  CHECK(field->needs().walls);
  CHECK(to_string(ModelKind::disk) == "disk");
}

TEST_CASE("disks without friction, damping and base have the forces of soft particles") {
  Random random(1);
  for (const ContactLaw law : {ContactLaw::harmonic, ContactLaw::hertz}) {
    Configuration<2> c = soft_at_wall<2>(random, 60, WallPlace::slope);
    c.add_soft(1, c.position(0) + 0.8 * pliant::Vec<2>::Unit(0));
    c.random_velocities(random);
    StateView<2> s = c.view();
    const std::vector<Real> still(2);
    s.angles = s.spins = still.data();
    const auto smooth = disks(
                   {.mu_disk = 0, .mu_disk_dynamic = 0, .mu_wall = 0, .mu_wall_dynamic = 0, .restitution = 1}, law),
               soft = make_force_field<2>(ModelKind::sp, {.epsilon = 1e3, .epsilon_wall = 2e3, .law = law, .zeta = 0.1},
                                          pliant::Vec<2>(0, -1));
    std::vector<Real> a(6), b(4);
    smooth->forces(s, a.data());
    soft->forces(s, b.data());
    for (std::size_t k = 0; k < 4; ++k) CHECK(a[k] == Approx(b[k]).epsilon(1e-12).margin(1e-12));
    CHECK(a[4] == 0);
    CHECK(smooth->energy(s) == Approx(soft->energy(s)));
  }
}

TEST_CASE("friction and damping leave the critical step of the contacts nearly as it is") {
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  const Real contact = disks({.mu_disk = 0, .mu_disk_dynamic = 0, .mu_wall = 0, .mu_wall_dynamic = 0})
                           ->critical_step(c.topology)
                           .elastic,
             all = on_table({.gravity = 1})->critical_step(c.topology).elastic;
  CHECK(all == contact);
}

TEST_CASE("the faster the tangential dashpots, the shorter the critical step") {
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  const auto limit = [&](Real ratio) {
    return disks({.tangential_damping = ratio})->critical_step(c.topology).damping;
  };
  CHECK(limit(0.5) == limit(0));
  CHECK(limit(5) == Approx(limit(0.5) / 10));
}

TEST_CASE("disks and spheres of either law are damped as their coefficient of restitution asks for") {
  check_damping<2>(ContactLaw::harmonic);
  check_damping<2>(ContactLaw::hertz);
  check_damping<3>(ContactLaw::harmonic);
  check_damping<3>(ContactLaw::hertz);
}

TEST_CASE("coefficients that no disk has are refused") {
  CHECK_THROWS_WITH(disks({.mu_disk = 0.3, .mu_disk_dynamic = 0.4}),
                    Catch::Contains("mu_disk_dynamic 0.4 is more than mu_disk 0.3"));
  CHECK_THROWS_WITH(disks({.mu_wall = 0.3, .mu_wall_dynamic = 0}),
                    Catch::Contains("mu_wall_dynamic 0 with mu_wall 0.3"));
  CHECK_THROWS_WITH(on_table({.gravity = 1, .mu = -1}), Catch::Contains("mu_base"));
  CHECK_THROWS_WITH(disks({.restitution = 0}), Catch::Contains("restitution"));
  CHECK_THROWS_AS(disks({}, ContactLaw::barrier), InputError);
  CHECK_THROWS_WITH(make_force_field<3>(ModelKind::disk, {.base = {.gravity = 1}}, pliant::Vec<3>(0, 0, -1)),
                    Catch::Contains("no friction with one in 3D"));
  CHECK_THROWS_WITH(disks({.mu_others = {{0.2, 0.2}, {0.2, 0.3}}}),
                    Catch::Contains("mu_material2_dynamic 0.3 is more than mu_material2 0.2"));
  CHECK_THROWS_WITH(make_force_field<2>(ModelKind::sp, {.base = {.gravity = 1}}, pliant::Vec<2>(0, -1)),
                    Catch::Contains("the model sp has no friction"));
}

}  // namespace pliant::test::disk_test
