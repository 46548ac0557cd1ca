// Particles among walls that move: energy and work, moving frames, and complete lists.
#include <catch2/catch.hpp>

#include <pliant/geometry/obstacle.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/wall_contact.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::moving_walls_test {

namespace {

template <int D>
Rotation<D> spin_about(Real rate, const pliant::Vec<D>& axis) {
  if constexpr (D == 2)
    return rate;
  else
    return pliant::Vec<3>(rate * axis);
}

/// Soft particles that are squeezed between walls of all kinds with motions of all kinds, and touch all of them all the
/// time, so that forces are smooth.
template <int D>
Configuration<D> squeezed() {
  using V = pliant::Vec<D>;
  const V x = V::Unit(0), z = V::Unit(D - 1);
  Configuration<D> c;
  c.add_soft(2, V(-0.7 * x));
  c.add_soft(2, V(0.8 * x + 0.1 * z));
  c.v = std::vector<Real>(c.x.size());
  c.v[0] = 0.1, c.v[D - 1] = -0.2, c.v[D] = -0.15;
  Walls<D>& walls = c.walls;
  walls.add(Solid<D>::half_space(V(-1.3 * x), V(x + 0.1 * z)), {.velocity = 0.8 * x + 0.3 * z});
  walls.add(Solid<D>::half_space(V(-0.6 * z), z), {.spin = spin_about<D>(0.2, x), .pivot = V(0.3 * x - z)});
  if constexpr (D == 3) {
    Motion<3> m = walls.motion(1);
    m.spin = {0.05, 0.2, 0.1};
    walls.set_motion(1, m);
  }
  Motion<D> shaken{.amplitude = 0.1 * x + 0.05 * z, .frequency = 5, .phase = 0.4, .pivot = V(1.7 * x)};
  shaken.spin = spin_about<D>(-0.3, z);
  walls.add(Solid<D>::wedge(V(1.5 * x + 0.1 * z), V(x + z), V(x - 0.7 * z)), shaken);
  // A segment and a disk, which move together; in 3D a plate and a sphere.
  WallParts lid{{WallSegment::between({0, 0.7}, {3, 0.7}), WallSegment::disk({0, -1.2}, 0.7)}};
  lid.segments[0].origin[0] = D == 2 ? -3 : 0;
  if (D == 2) lid.segments[0].length = 6;
  Motion<D> lifted{.velocity = 0.1 * x - 0.05 * z, .amplitude = 0.03 * z, .frequency = 7, .pivot = V(0.2 * x)};
  if constexpr (D == 2)
    lifted.spin = 0.1;
  else
    lifted.spin = {0.1, -0.1, 0.3};
  walls.add(lid, lifted);
  return c;
}

template <int D>
ParticleSystem<D> soft_system(const Configuration<D>& c, const pliant::Vec<D>& gravity = pliant::Vec<D>::Zero()) {
  return system_of<D>(c, ModelKind::sp, Ranks(), {.epsilon = 30, .epsilon_wall = 50}, {}, gravity);
}

/// The gain of energy besides the work of the walls, which is summed over n equal parts of the time.
template <int D>
Real energy_from_nowhere(Integrator& integrator, Real t_end, int n, bool simpson, Real* gained = nullptr) {
  const Configuration<D> c = squeezed<D>();
  ParticleSystem<D> system = soft_system<D>(c);
  State state(2, D);
  state.assign(c.x, c.v);
  const auto look = [&](auto&& what) { return what(system.view(state.x().data(), state.v().data(), state.t)); };
  const auto energy = [&] {
    return look([&](const StateView<D>& s) {
      for (const auto& [i, part] : s.neighbours.walls) CHECK(s.walls.distance(s.position(i), part, s.t) < 1);
      CHECK((s.position(0) - s.position(1)).norm() < 2);
      return system.field().energy(s) + s.kinetic_energy(0) + s.kinetic_energy(1);
    });
  };
  const auto power = [&] { return look([&](const StateView<D>& s) { return wall_power(system.field(), s); }); };
  const Real before = energy(), h = t_end / n;
  Real work = 0;
  for (int k = 0; k <= n; ++k) {
    if (k > 0) integrator.run(system, state, k * h, k == 1, {});
    const bool end = k == 0 || k == n;
    work += power() * h * (simpson ? (end ? 1.0 : k % 2 == 1 ? 4.0 : 2.0) / 3 : end ? 0.5 : 1.0);
  }
  if (gained != nullptr) *gained = energy() - before;
  return std::abs(energy() - before - work);
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("the energy that particles gain is the work of moving walls", "[motion]", ((int D), D), 2, 3) {
  Real gained = 0;
  require_order(
      "Verlet",
      [&](Real h) {
        FixedStepVerlet verlet(h);
        return energy_from_nowhere<D>(verlet, 0.64, static_cast<int>(std::lround(0.64 / h)), false, &gained);
      },
      0.01, 2);
  CHECK(std::abs(gained) > 0.1);
  const PetscOptionScope scope("-ts_type rk -ts_rk_type 5dp -ts_adapt_type basic -ts_rtol 1e-11 -ts_atol 1e-11");
  TsIntegrator adaptive;
  CHECK(energy_from_nowhere<D>(adaptive, 0.64, 256, true) < 1e-7 * std::abs(gained));
}

TEMPLATE_TEST_CASE_SIG("forces and torques on walls are those of their contacts", "[motion]", ((int D), D), 2, 3) {
  const Configuration<D> c = squeezed<D>();
  ParticleSystem<D> system = soft_system<D>(c);
  const Real t = 0.1;
  const StateView<D> s = system.view(c.x.data(), c.v.data(), t);
  const Index walls = c.walls.size();
  REQUIRE(walls == 5);
  std::vector<Real> force(walls * D), torques(walls * rotations<D>), expected(force.size()), turning(torques.size());
  system.field().add_wall_forces(s, force.data(), torques.data());
  Real power = 0;
  for (Index part = 0; part < c.walls.part_count(); ++part)
    for (Index i = 0; i < 2; ++i) {
      const WallFoot<D> foot = c.walls.foot(c.position(i), part, t);
      const pliant::Vec<D> push = -HarmonicOverlap{50, 1}.slope(foot.d) * foot.n, at = c.position(i) - foot.d * foot.n;
      const Index wall = c.walls.wall_of_part(part);
      const Motion<D>& m = c.walls.motion(c.walls.body_of_wall(wall));
      point<D>(expected.data(), wall) -= push;
      add_rotation<D>(turning.data(), wall, torque(pliant::Vec<D>(at - m.pivot - m.shift(t)), pliant::Vec<D>(-push)));
      power += push.dot(c.walls.velocity(at, part, t));
    }
  for (std::size_t k = 0; k < force.size(); ++k) CHECK(force[k] == Approx(expected[k]).margin(1e-10));
  for (std::size_t k = 0; k < torques.size(); ++k) CHECK(torques[k] == Approx(turning[k]).margin(1e-10));
  CHECK(wall_power(system.field(), s) == Approx(power));
  CHECK(std::abs(power) > 0.1);
}

TEST_CASE("lips that move do work on edges") {
  Configuration<2> c;
  c.add_polygon({{-1, 0}, {1, 0}, {1, 1}, {-1, 1}}, 0.4);
  WallParts tip;
  Obstacle{{{-0.4, -2}, {0.6, -2}, {0.1, -0.12}}}.add_to(tip);
  c.walls.add(tip, {.velocity = {0.3, 0.5}, .spin = 0.4, .pivot = {0.5, -1.5}});
  const auto field = alone<2>(WallContact<2>{50}, LipContact{50});
  ParticleSystem<2> system(c.topology, c.walls, alone<2>(WallContact<2>{50}, LipContact{50}), 0.3);
  const auto energy = [&](Real t) { return field->energy(system.view(c.x.data(), c.v.data(), t)); };
  const Real h = 1e-5, power = wall_power(*field, system.view(c.x.data(), c.v.data(), 0));
  CHECK(power > 1);
  CHECK(power == Approx((energy(h) - energy(-h)) / (2 * h)).epsilon(1e-6));
}

namespace {

/// The same by an observer whose frame moves with the velocity u and is turned.
template <int D>
struct Observer {
  pliant::Mat<D> turn;
  pliant::Vec<D> u;

  pliant::Vec<D> place(const pliant::Vec<D>& r, Real t) const { return turn * r + t * u; }
  Motion<D> motion(Motion<D> m) const {
    REQUIRE(m.since == 0);
    m.velocity = turn * m.velocity + u;
    m.amplitude = turn * m.amplitude;
    m.pivot = turn * m.pivot;
    if constexpr (D == 3) m.spin = turn * m.spin;
    return m;
  }
  Configuration<D> of(const Configuration<D>& c) const {
    Configuration<D> seen;
    for (Index i = 0; i < c.topology.points(); ++i) seen.add_soft(c.topology.diameter[i], place(c.position(i), 0));
    for (Index i = 0; i < c.topology.points(); ++i) point<D>(seen.v.data(), i) = turn * point<D>(c.v.data(), i) + u;
    for (Index k = 0; k < 3; ++k) {
      const Solid<D> s = c.walls.solids()[k];
      seen.walls.add(Solid<D>{turn * s.place, turn * s.along, turn * s.out, s.opening}, motion(c.walls.motion(k)));
    }
    WallParts parts;
    parts.segments.assign(c.walls.segments().begin(), c.walls.segments().end());
    seen.walls.add(parts, motion(c.walls.motion(3)), {turn, pliant::Vec<D>::Zero(), true});
    return seen;
  }
};

}  // namespace

TEMPLATE_TEST_CASE_SIG("particles and walls look the same from a frame that moves and is turned", "[motion]",
                       ((int D), D), 2, 3) {
  Random random(3);
  const pliant::Vec<D> gravity = random.unit<D>();
  const Configuration<D> c = squeezed<D>();
  Observer<D> observer{pliant::Mat<D>::Identity(), 3 * random.unit<D>()};
  if constexpr (D == 2)
    observer.turn << std::cos(0.8), -std::sin(0.8), std::sin(0.8), std::cos(0.8);
  else
    observer.turn = Eigen::AngleAxis<Real>(0.8, random.unit<3>()).toRotationMatrix();
  const auto run = [&](const Configuration<D>& of, const pliant::Vec<D>& g, Real* torque_sum) {
    ParticleSystem<D> system = soft_system<D>(of, g);
    State state(2, D);
    state.assign(of.x, of.v);
    FixedStepVerlet verlet(0.01);
    verlet.run(system, state, 2, true, {});
    *torque_sum = wall_power(system.field(), system.view(state.x().data(), state.v().data(), state.t));
    return std::vector<Real>(state.x().begin(), state.x().end());
  };
  Real power = 0, seen_power = 0;
  const std::vector<Real> here = run(c, gravity, &power),
                          there = run(observer.of(c), pliant::Vec<D>(observer.turn * gravity), &seen_power);
  for (Index i = 0; i < 2; ++i)
    CHECK((point<D>(there.data(), i) - observer.place(point<D>(here.data(), i), 2)).norm() < 1e-10);
  CHECK((point<D>(here.data(), 0) - c.position(0)).norm() > 0.1);
}

namespace {

/// A paddle that turns, a plate that turns without end, a floor that shakes and a wall that translates.
template <int D>
Walls<D> machine(Real width) {
  using V = pliant::Vec<D>;
  Walls<D> walls;
  WallParts paddle;
  if (D == 2)
    Obstacle{{{-2, 3}, {2, 2.8}, {2, 3.2}}}.add_to(paddle);
  else
    Obstacle{{{0.3, 2.5}, {1.5, 2.8}, {1.5, 3.2}}}.add_to(paddle);
  walls.add(paddle, {.spin = spin_about<D>(2, V::Unit(0)), .pivot = 3 * V::Unit(D - 1)});
  walls.add(Solid<D>::half_space(V(-width / 2 * V::Unit(0)), V::Unit(0)),
            {.velocity = 0.2 * V::Unit(0), .spin = spin_about<D>(-0.15, V::Unit(0)), .pivot = V(-width * V::Unit(0))});
  if constexpr (D == 3) {
    Motion<3> m = walls.motion(1);
    m.spin = {0, 0.15, 0};
    walls.set_motion(1, m);
  }
  walls.add(Solid<D>::half_space(V(width / 2 * V::Unit(0)), V(-V::Unit(0))), {.velocity = -1.5 * V::Unit(0)});
  walls.add(WallParts{{WallSegment::between({D == 2 ? -width : 0, 0}, {width, 0})}},
            {.amplitude = 0.3 * V::Unit(D - 1), .frequency = 20});
  return walls;
}

/// Compares runs with persistent lists and a run with new lists in each step, on any number of ranks.
template <int D>
void check_lists(Configuration<D> c, ModelKind kind, Real width, Real dt) {
  INFO(to_string(kind) << ", " << D << "D");
  c.walls = machine<D>(width);
  for (Real& a : c.v) a *= 0.1;  // walls move most
  Twins<D> twins(c, kind);
  twins.sort();
  constexpr int steps = 200;
  FixedStepVerlet one(dt), many(dt);
  std::size_t touching = 0, by_turning = 0;
  one.run(twins.whole, twins.whole_state, steps * dt, true, [&](State& s) {
    twins.whole.neighbours().invalidate();
    twins.whole.view(s.x().data(), s.v().data(), s.t);
    std::vector<Real> force(static_cast<std::size_t>(c.walls.size()) * D);
    twins.whole.field().add_wall_forces(twins.whole.view(s.x().data(), s.v().data(), s.t), force.data());
    for (Index k = 0; k < c.walls.size(); ++k) {
      const bool touches = point<D>(force.data(), k).norm() > 0;
      touching += touches;
      if (k < 4) by_turning += touches;
    }
    return AfterStep::proceed;
  });
  many.run(twins.shared, twins.state, steps * dt, true, {});
  CHECK(touching > 2 * steps);
  CHECK(by_turning > steps / 2);
  CHECK(twins.shared.neighbours().rebuilds() > 5);
  CHECK(twins.shared.neighbours().rebuilds() < steps / 2);
  CHECK(twins.difference(twins.state.x(), twins.whole_state.x()) < 1e-8);
  CHECK(twins.difference(twins.state.x(), c.x) > 0.05);
}

}  // namespace

TEST_CASE("lists hold what walls that move and turn come to touch", "[motion][ranks]") {
  Random random(4);
  check_lists(soft_rows<2>(random, 10, 8), ModelKind::sp, 9, 1e-3);
  check_lists(soft_rows<3>(random, 5, 5), ModelKind::sp, 4.4, 1e-3);
  check_lists(polygon_rows(random, 6, 6), ModelKind::rough, 6.2, 1e-4);
}

TEST_CASE("walls that start to move between steps", "[motion]") {
  // With bounds of the motion carried from step to step: a distant wall approaches fast.
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  c.walls.add(Solid<2>::half_space({-3, 0}, {1, 0}));
  ParticleSystem<2> system = soft_system<2>(c);
  State state(1, 2);
  state.assign(c.x, c.v);
  FixedStepVerlet verlet(0.01);
  verlet.run(system, state, 2, true, [&](State& s) {
    if (s.step == 50) {
      Walls<2> walls = system.walls();
      walls.set_motion(0, {.velocity = {3, 0}, .since = s.t});
      system.set_walls(walls);
    }
    return AfterStep::proceed;
  });
  CHECK(state.x()[0] > 1);
  CHECK(state.v()[0] == Approx(6).epsilon(0.01));  // the particle has bounced off a wall that moves at 3
  CHECK_THROWS_WITH(system_of<2>(c, ModelKind::bubble).set_walls(Walls<2>({WallSegment::between({0, 0}, {1, 0})})),
                    Catch::Contains("is a segment"));
}

}  // namespace pliant::test::moving_walls_test
