// Disks that roll and slide along walls, fixed and moving.
#include <catch2/catch.hpp>

#include "support/frictional.h"
#include "support/order.h"

namespace pliant::test::disk_walls_test {

namespace {

constexpr Real epsilon = 1e5;
constexpr SurfaceFriction rough{.mu_static = 0.4, .mu_dynamic = 0.4, .damping = 0.3};

template <class... More>
std::unique_ptr<Simulation<2>> simulation(const Configuration<2>& c, const SurfaceFriction& surface, Real dt,
                                          More... more) {
  return simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(dt), WallContact<2>{epsilon},
                          DiskWallContact{epsilon, surface}, more...);
}
std::size_t contacts(const Simulation<2>& s) {
  return s.particles().history().of("disk_wall_contact").contacts().keys.size();
}

WallParts segment(pliant::Vec<2> a, pliant::Vec<2> b) { return {{WallSegment::between(a, b)}}; }

}  // namespace

TEST_CASE("a disk that slides comes to roll at exactly 2/3 of its velocity") {
  Configuration<2> c;
  c.walls = Walls<2>(segment({-5, 0}, {50, 0}));
  const Real weight = 10, mass = pi / 4, depth = mass * weight * 0.25 / epsilon;
  c.add_soft(1, {0, 0.5 - depth});
  c.v = {1, 0};
  const auto s = simulation(c, rough, 1e-4, Slope{{0, -weight}});
  start(*s, c, {0}, {0});
  touch(*s);
  const Real before = energy(*s), rolls_at = 1 / (3 * 0.4 * weight);
  s->advance(rolls_at / 2);
  CHECK(s->state().v()[0] == Approx(1 - 0.4 * weight * rolls_at / 2).epsilon(1e-3));
  CHECK(s->spins()[0] == Approx(-2 * 0.4 * weight * rolls_at / 2 / 0.5).epsilon(1e-3));
  s->advance(2 * rolls_at);
  CHECK(s->state().v()[0] == Approx(2.0 / 3).epsilon(1e-4));
  CHECK(s->spins()[0] == Approx(-4.0 / 3).epsilon(1e-4));
  const Real x = s->state().x()[0], angle = s->angles()[0];
  s->advance(2 * rolls_at + 1);
  CHECK(s->state().x()[0] - x == Approx(2.0 / 3).epsilon(1e-4));
  CHECK(s->state().x()[0] - x == Approx(-0.5 * (s->angles()[0] - angle)).epsilon(1e-6));
  CHECK(before - energy(*s) == Approx(mass / 6).epsilon(1e-3));
  CHECK(sum_of_heat(*s, "disk_wall_contact") == Approx(mass / 6).epsilon(2e-3));
}

TEST_CASE("a disk between two moving walls goes with their mean and spins by their difference") {
  const auto run = [](Real below, Real above) {
    Configuration<2> c;
    c.walls = Walls<2>();
    c.walls.add(segment({-9, 0}, {9, 0}), {.velocity = {below, 0}});
    c.walls.add(segment({-9, 0.999}, {9, 0.999}), {.velocity = {above, 0}});
    c.add_soft(1, {0, 0.4995});
    const auto s = simulation(c, rough, 1e-4);
    start(*s, c, {0}, {0});
    s->advance(1);
    CHECK(contacts(*s) == 2);
    return std::array{s->state().v()[0], s->state().v()[1], s->spins()[0]};
  };
  const auto opposite = run(-0.3, 0.3), same = run(0.4, 0.4), one = run(0, 0.6);
  CHECK(std::abs(opposite[0]) < 1e-9);
  CHECK(opposite[2] == Approx(-0.6).epsilon(1e-6));
  CHECK(same[0] == Approx(0.4).epsilon(1e-6));
  CHECK(std::abs(same[2]) < 1e-6);
  CHECK(one[0] == Approx(0.3).epsilon(1e-6));
  CHECK(one[2] == Approx(-0.6).epsilon(1e-6));
  // Both walls turn about the middle of the disk at rest there, and it with them.
  Configuration<2> c;
  c.walls = Walls<2>();
  for (const Real y : {0.0, 0.999}) c.walls.add(segment({-9, y}, {9, y}), {.spin = 0.8, .pivot = {0, 0.4995}});
  c.add_soft(1, {0, 0.4995});
  const auto s = simulation(c, rough, 1e-4);
  start(*s, c, {0}, {0});
  s->advance(1);
  CHECK(s->spins()[0] == Approx(0.8).epsilon(1e-5));
  CHECK(contacts(*s) == 2);
}

TEST_CASE("what walls and disks do to each other does not depend on a common velocity, direction or unit of time") {
  const auto run = [](Real turn, pliant::Vec<2> drift, Real faster) {
    const Eigen::Rotation2D<Real> rotate(turn);
    Configuration<2> c;
    c.walls = Walls<2>();
    c.walls.add(segment(rotate * pliant::Vec<2>(-9, 0), rotate * pliant::Vec<2>(9, 0)), {.velocity = drift});
    c.add_soft(1, rotate * pliant::Vec<2>(0, 0.50107));
    const pliant::Vec<2> v = faster * (rotate * pliant::Vec<2>(1, -1)) + drift;
    c.v = {v[0], v[1]};
    auto s = simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(2e-4 / faster),
                              WallContact<2>{square(faster) * epsilon},
                              DiskWallContact{square(faster) * epsilon, {.mu_static = 0.3, .mu_dynamic = 0.2}});
    start(*s, c, {0}, {faster * 0.5});
    s->advance(0.05 / faster);
    CHECK(contacts(*s) == 0);
    const pliant::Vec<2> left =
        rotate.inverse() * pliant::Vec<2>(s->state().v()[0] - drift[0], s->state().v()[1] - drift[1]);
    return std::array{left[0], left[1], s->spins()[0]};
  };
  const auto plain = run(0, {0, 0}, 1), turned = run(2.5, {0, 0}, 1), moving = run(0, {-2, 3}, 1),
             fast = run(0, {0, 0}, 2);
  CHECK(plain[1] > 0.9);
  CHECK(plain[2] < 0.3);
  for (std::size_t k = 0; k < 3; ++k) {
    CHECK(turned[k] == Approx(plain[k]).epsilon(1e-8));
    CHECK(moving[k] == Approx(plain[k]).epsilon(1e-6));
    CHECK(fast[k] == 2 * plain[k]);
  }
}

TEST_CASE("walls of other materials have friction of their own") {
  // On a slope with tan φ < 3 μ a disk rolls, with 2/3 g sin φ; beyond, it slides with g (sin φ − μ cos φ).
  const auto down = [](Index material, Real mu_walls, Real mu_others, Real phi) {
    Configuration<2> c;
    c.walls = Walls<2>();
    c.walls.add(Solid<2>::half_space({0, 0}, {0, 1}), {}, {}, material);
    const Real weight = 10, mass = pi / 4;
    c.add_soft(1, {0, 0.5 - mass * weight * std::cos(phi) * 0.25 / epsilon});
    const auto s =
        simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(1e-4), WallContact<2>{epsilon},
                         DiskWallContact{epsilon,
                                         {.mu_static = mu_walls, .mu_dynamic = mu_walls, .damping = 0.3},
                                         OtherMaterials({{0.9, 0.9}, {mu_others, mu_others}})},
                         Slope{weight * pliant::Vec<2>(std::sin(phi), -std::cos(phi))});
    start(*s, c, {0}, {0});
    touch(*s);
    s->advance(1);
    return std::pair(s->state().v()[0] / weight, -s->spins()[0] * 0.5 / weight);
  };
  const Real mu = 0.2, limit = std::atan(3 * mu);
  for (const Real phi : {limit - 0.03, limit + 0.03}) {
    INFO("slope " << phi << ", limit " << limit);
    const Real rolls = 2.0 / 3 * std::sin(phi), slides = std::sin(phi) - mu * std::cos(phi);
    const auto [v, turns] = down(2, 0, mu, phi);  // while material 0 has no friction
    CHECK(v == Approx(phi < limit ? rolls : slides).epsilon(1e-3));
    CHECK(turns == Approx(phi < limit ? rolls : 2 * mu * std::cos(phi)).epsilon(1e-3));
    CHECK(down(0, mu, 0, phi).first == Approx(v).epsilon(1e-12));
    const auto smooth = down(0, 0, mu, phi);
    CHECK(smooth.first == Approx(std::sin(phi)).epsilon(1e-9));
    CHECK(smooth.second == 0);
    CHECK(down(1, 0, mu, phi).first == Approx(rolls).epsilon(1e-3));
  }
  CHECK_THROWS_WITH(down(3, 0, mu, 0.1), Catch::Contains("of the material 3"));
  // The step limit of a wall with friction counts if the first wall has no friction.
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  const DiskWallContact smooth{epsilon, {}}, one{epsilon, {}, OtherMaterials({{0.1, 0.1}})};
  CHECK(smooth.max_rate(c.topology) == 0);
  CHECK(one.max_rate(c.topology) == DiskWallContact{epsilon, rough}.max_rate(c.topology));
}

TEST_CASE("round a convex corner a disk has one contact with one history") {
  const pliant::Vec<2> corner(0, 0);
  Configuration<2> c;
  WallParts parts = segment({-2, 0}, corner);
  parts.segments.push_back(WallSegment::between(corner, {0, -2}));
  parts.joints.push_back({corner, 1, 0, true});
  c.walls = Walls<2>(parts);
  const Real d = 0.499;
  c.add_soft(1, {-0.1, d});
  const Real k = 2.0 / 7 * 4 * epsilon;
  const auto s = simulation(c, {.mu_static = 1e6, .mu_dynamic = 1e6}, 1e-4);
  start(*s, c, {0}, {0});
  touch(*s);
  std::vector<Real> x(s->state().x().begin(), s->state().x().end()), f(3), v(3);
  const auto torque_at = [&](const pliant::Vec<2>& r) {
    x[0] = r[0], x[1] = r[1];
    const StateView<2> view = s->particles().view(x.data(), v.data());
    s->particles().field().forces(view, f.data());
    s->particles().accepted(0, x.data(), v.data(), 1e-4);
    REQUIRE(contacts(*s) == 1);
    return f[2];
  };
  // Pushed along without turning, 0.1 to the corner, round it and 0.1 down.
  Real torque = 0;
  const int n = 200;
  for (int step = 1; step <= n; ++step) torque = torque_at({-0.1 + 0.1 * step / n, d});
  CHECK(torque == Approx(-k * 0.5 * 0.1).epsilon(1e-6));
  for (int step = 1; step <= n; ++step) torque = torque_at(d * at_angle(pi / 2 - pi / 2 * step / n));
  CHECK(torque == Approx(-k * 0.5 * (0.1 + 0.5 * pi / 2)).epsilon(1e-4));
  for (int step = 1; step <= n; ++step) torque = torque_at({d, -0.1 * step / n});
  CHECK(torque == Approx(-k * 0.5 * (0.2 + 0.5 * pi / 2)).epsilon(1e-4));
  // The force acts on the arm d.
  torque = torque_at(0.4 * at_angle(pi / 4));
  CHECK(pliant::Vec<2>(f[0], f[1]).dot(at_angle(3 * pi / 4)) == Approx(-torque / 0.4).epsilon(1e-9));
  // Off the wall it ends, although the lists still have it.
  x[0] = 0.51;
  s->particles().accepted(0, x.data(), v.data(), 1e-4);
  CHECK(contacts(*s) == 0);
}

TEST_CASE("walls feel what disks feel, friction and damping too") {
  Configuration<2> c;
  c.walls = Walls<2>(segment({-5, 0}, {50, 0}));
  c.add_soft(1, {0, 0.499});
  c.v = {1, -0.5};
  const auto s = simulation(c, rough, 1e-4);
  start(*s, c, {0}, {0});
  touch(*s);
  s->advance(2e-4);
  const StateView<2> view = s->view();
  std::vector<Real> f(3), on_wall(2);
  s->particles().field().forces(view, f.data());
  s->particles().field().add_wall_forces(view, on_wall.data());
  CHECK(f[0] < -1);
  CHECK(f[1] > 1);
  CHECK(on_wall[0] == Approx(-f[0]).epsilon(1e-12));
  CHECK(on_wall[1] == Approx(-f[1]).epsilon(1e-12));
}

}  // namespace pliant::test::disk_walls_test
