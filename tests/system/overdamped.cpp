// Droplets without inertia: velocities against a dense solve, dissipation, relaxation. The cases with the tag
// [ranks] run on any number of ranks.
#include <petscsys.h>
#include <catch2/catch.hpp>

#include <Eigen/Dense>
#include <array>

#include <pliant/catalogue/catalogue.h>
#include <pliant/system/neighbour_drag.h>
#include <pliant/system/overdamped.h>
#include <pliant/ts/ts_integrator.h>

#include "support/configurations.h"
#include "support/model_parameters.h"
#include "support/problems.h"

namespace pliant::test::overdamped_test {

namespace {

constexpr Real beyond = 0.1;  // 2 a_s
const NeighbourDragOptions standard{.b = 1, .beyond_contact = beyond};

/// Droplets of radii 0.9 … 1.1 on a grid of side 2.05, displaced at random: some overlap, some are bound, some are
/// free; on a wall that moves away along its normal and at the tip of a wedge.
template <int D>
Configuration<D> heap(Random& random, Index side, Index layers) {
  Configuration<D> c;
  const Index layer = D == 2 ? side : side * side;
  for (Index k = 0; k < layer * layers; ++k) {
    pliant::Vec<D> r;
    r[0] = k % side;
    if (D == 3) r[1] = k / side % side;
    r[D - 1] = k / layer;
    r *= 2.05;
    for (int d = 0; d < D; ++d) r[d] += random(-0.06, 0.06);
    c.add_droplet(random(0.9, 1.1), r);
  }
  pliant::Vec<D> up = pliant::Vec<D>::Unit(D - 1), aside = pliant::Vec<D>::Unit(0);
  const Solid<D> corner =
      Solid<D>::wedge(pliant::Vec<D>(-1.04 * aside), pliant::Vec<D>(-aside - up), pliant::Vec<D>(-aside + up));
  c.walls.add(Solid<D>::half_space(-1.03 * up, up), {.velocity = -1e-2 * up + 2e-2 * aside});
  c.walls.add(corner);
  return c;
}

template <int D>
OverdampedSystem<D> system_of(const Configuration<D>& c, const NeighbourDragOptions& mobility = standard,
                              const Ranks& ranks = Ranks()) {
  return {
      ParticleSystem<D>(c.topology, c.walls,
                        make_force_field<D>(ModelKind::bubble, {}, pliant::Vec<D>(-0.01 * pliant::Vec<D>::Unit(D - 1))),
                        0.2, ranks),
      std::make_unique<NeighbourDrag<D>>(mobility)};
}

template <int D>
std::int64_t iterations(const OverdampedSystem<D>& system) {
  return dynamic_cast<const NeighbourDrag<D>&>(system.mobility()).iterations();
}

/// B, and the forces/b including walls, from all pairs.
template <int D>
void dense(const Configuration<D>& c, const ForceField<D>& field, const NeighbourDragOptions& mobility, Real t,
           MatrixXd& b, MatrixXd& load) {
  const Index n = c.topology.points();
  Neighbours<D> lists(field.needs(), 0.3);
  lists.rebuild(c.topology, c.walls, c.x.data(), t);
  std::vector<Real> f(c.x.size());
  field.forces({c.x.data(), nullptr, c.topology, lists, c.walls, t}, f.data());
  b = MatrixXd::Identity(n, n);
  load = Eigen::Map<const MatrixXd>(f.data(), D, n).transpose() / mobility.b;
  for (Index i = 0; i < n; ++i) {
    if (c.topology.active[i] == 0) {
      load.row(i).setZero();
      continue;
    }
    const Real radius = c.topology.diameter[i] / 2;
    for (Index j = 0; j < n; ++j) {
      if (j == i || c.topology.active[j] == 0) continue;
      if ((c.position(i) - c.position(j)).norm() >= radius + c.topology.diameter[j] / 2 + beyond) continue;
      b(i, i) += 1;
      b(i, j) -= 1;
    }
    if (!mobility.walls) continue;
    for (Index k = 0; k < 2; ++k)
      if (c.walls.distance(c.position(i), k, t) < radius + beyond) {
        b(i, i) += 1;
        load.row(i) += c.walls.motion(k).velocity.transpose();
      }
  }
}

template <int D>
MatrixXd rows_of(const std::vector<Real>& v) {
  return Eigen::Map<const MatrixXd>(v.data(), D, static_cast<Eigen::Index>(v.size()) / D).transpose();
}

template <int D>
void check_velocities(const NeighbourDragOptions& mobility) {
  Random random(2);
  Configuration<D> c = heap<D>(random, D == 2 ? 9 : 5, D == 2 ? 8 : 4);
  c.topology.deactivate(7);
  OverdampedSystem<D> system = system_of<D>(c, mobility);
  std::vector<Real> v(c.x.size());
  Real t = 0.3;
  MatrixXd before;
  for (int move = 0; move < 5; ++move) {
    system.rate(t, c.x.data(), v.data());
    MatrixXd b, load;
    dense<D>(c, system.particles().field(), mobility, t, b, load);
    const MatrixXd expected = b.ldlt().solve(load);
    CHECK((rows_of<D>(v) - expected).norm() < 1e-11 * expected.norm());
    CHECK(expected.row(7).norm() == 0);
    CHECK(expected.norm() > 0.01);
    // Not the same neighbours each time, with and without new lists.
    CHECK((b.array() == -1).count() > c.topology.points());
    if (move > 0) CHECK((b - before).norm() > 0);
    before = b;
    for (Real& x : c.x) x += random(-0.02, 0.02);
    t += 0.5;
  }
  CHECK(system.particles().neighbours().rebuilds() < 5);
}

}  // namespace

constexpr const char* iterative = "-mobility_ksp_type cg -mobility_pc_type icc";

TEST_CASE("velocities balance the forces: against a dense solve") {
  const PetscOptionScope none("");
  for (const bool walls : {false, true}) {
    check_velocities<2>({.b = 1, .beyond_contact = beyond, .walls = walls});
    check_velocities<3>({.b = 2.5, .beyond_contact = beyond, .walls = walls});
  }
}

TEST_CASE("an iterative solver by options") {
  const PetscOptionScope options(iterative);
  check_velocities<2>(standard);
}

TEST_CASE("an iterative solver starts from the velocities before") {
  const PetscOptionScope options(iterative);
  Random random(2);
  Configuration<2> c = heap<2>(random, 9, 8);
  OverdampedSystem<2> system = system_of<2>(c);
  std::vector<Real> v(c.x.size()), again(c.x.size());
  system.rate(0, c.x.data(), v.data());
  const std::int64_t cold = iterations(system);
  CHECK(cold < 2 * 40);
  system.rate(0, c.x.data(), again.data());
  CHECK(iterations(system) - cold <= 2);
  CHECK(system.last() == again);
}

TEST_CASE("velocities before that are far from those now do no harm") {
  const PetscOptionScope options(GENERATE("", iterative));
  Configuration<2> c;
  for (const Real x : {0.0, 2.05, 4.1, 6.15}) c.add_droplet(1, {x, 0});
  const Real force = GENERATE(0.0, 1e-14);
  OverdampedSystem<2> system(
      ParticleSystem<2>(c.topology, {}, make_force_field<2>(ModelKind::bubble, {.phi_c = 0}, pliant::Vec<2>(0, force)),
                        0.2),
      std::make_unique<NeighbourDrag<2>>(standard));
  std::vector<Real> v(8);
  system.set_last({1, 2, -3, 4, 5, -6, 7, 8});
  system.rate(0, c.x.data(), v.data());
  // Next to such velocities so small a force is lost in rounding; without velocities the solver's tolerance is relative
  // to the small force.
  for (const Real a : v) CHECK(a == Approx(0).margin(1e-10));
}

TEST_CASE("the lagged form tends to the balance, the printed mean does not") {
  const PetscOptionScope none("");
  Random random(4);
  Configuration<2> c = heap<2>(random, 5, 4);
  MatrixXd b, load;
  std::vector<Real> v(c.x.size());
  const auto settle = [&](Coupling coupling) {
    OverdampedSystem<2> system = system_of<2>(c, {.beyond_contact = beyond, .coupling = coupling});
    dense<2>(c, system.particles().field(), standard, 0, b, load);
    system.rate(0, c.x.data(), v.data());
    // The first iteration has no velocities.
    const MatrixXd first = b.diagonal().cwiseInverse().asDiagonal() * load;
    CHECK((rows_of<2>(v) - first).norm() < 1e-14);
    for (int k = 0; k < 400; ++k) system.rate(0, c.x.data(), v.data());
    return rows_of<2>(v);
  };
  const MatrixXd lagged = settle(Coupling::lagged);
  const MatrixXd balance = b.ldlt().solve(load);
  CHECK((lagged - balance).norm() < 1e-10 * balance.norm());
  const MatrixXd mean = settle(Coupling::mean);
  CHECK((mean - balance).norm() > 0.1 * balance.norm());
  // (N + 1) v_i = mean of the neighbours' v + F_i/b
  for (Index i = 0; i < b.rows(); ++i)
    for (Index j = 0; j < b.cols(); ++j)
      if (j != i && b(i, j) != 0) b(i, j) = -1 / (b(i, i) - 1);
  CHECK((mean - b.lu().solve(load)).norm() < 1e-10 * mean.norm());
}

TEST_CASE("what the energy loses is dissipated") {
  const PetscOptionScope options("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
  Random random(5);
  Configuration<2> c = heap<2>(random, 6, 5);
  c.walls.set_motion(0, {});
  OverdampedSystem<2> system = system_of<2>(c);
  const auto energy = [&](const std::vector<Real>& x) {
    return system.particles().field().energy(system.particles().view(x.data(), nullptr));
  };
  State state(c.topology.points(), 2);
  std::copy(c.x.begin(), c.x.end(), state.x().begin());
  TsIntegrator integrator(TsOptions{.dt = 0.1});
  std::vector<Real> v(c.x.size()), x(c.x.size());
  Real last = energy(c.x);
  int checked = 0;
  integrator.run(system, state, 5, [&](State& s) {
    x.assign(s.x().begin(), s.x().end());
    system.rate(s.t, x.data(), v.data());
    Real power = 0;
    for (Index i = 0; i < c.topology.points(); ++i) {
      power += point<2>(v.data(), i).squaredNorm();
      for (Index j = 0; j < i; ++j)
        if ((point<2>(x.data(), i) - point<2>(x.data(), j)).norm() <
            (c.topology.diameter[i] + c.topology.diameter[j]) / 2 + beyond)
          power += (point<2>(v.data(), i) - point<2>(v.data(), j)).squaredNorm();
    }
    const auto moved = [&](Real h) {
      std::vector<Real> y = x;
      for (std::size_t k = 0; k < y.size(); ++k) y[k] += h * v[k];
      return y;
    };
    const Real h = 1e-4;
    CHECK((energy(moved(-h)) - energy(moved(h))) / (2 * h) == Approx(power).epsilon(1e-6));
    CHECK(system.mobility().power(system.particles().view(x.data(), v.data(), s.t)) == Approx(power).epsilon(1e-12));
    const Real now = energy(x);
    CHECK(now < last);
    last = now;
    checked += power > 1e-6;
    return AfterStep::proceed;
  });
  CHECK(checked == 50);
}

TEST_CASE("walls that rub take their part of the power") {
  const PetscOptionScope none("");
  Random random(7);
  Configuration<2> c = heap<2>(random, 12, 3);
  c.x[0] = -0.05;  // in range of the tip, for any radius
  c.x[1] = 0;
  OverdampedSystem<2> system = system_of<2>(c, {.b = 1.5, .beyond_contact = beyond, .walls = true});
  std::vector<Real> v(c.x.size());
  const Real t = 0.2;
  system.rate(t, c.x.data(), v.data());
  // Forces and the friction of walls, which drives, supply the dissipated power: v·F + Σ b (v_wall − v)·v_wall.
  const StateView<2> s = system.particles().view(c.x.data(), v.data(), t);
  std::vector<Real> f(c.x.size());
  system.particles().field().forces(s, f.data());
  Real power = 0;
  std::array<int, 2> rubbing{};  // droplets at each wall
  for (Index i = 0; i < c.topology.points(); ++i) {
    power += point<2>(f.data(), i).dot(s.velocity(i));
    for (Index k = 0; k < 2; ++k) {
      if (c.walls.distance(s.position(i), k, t) >= c.topology.diameter[i] / 2 + beyond) continue;
      const pliant::Vec<2>& wall = c.walls.motion(k).velocity;
      power += 1.5 * (wall - s.velocity(i)).dot(wall);
      ++rubbing[k];
    }
  }
  CAPTURE(rubbing[0], rubbing[1]);
  CHECK(rubbing[0] > 5);
  CHECK(rubbing[1] > 0);
  CHECK(system.mobility().power(s) == Approx(power).epsilon(1e-9));
}

TEST_CASE("two droplets come to rest at their distance, at the rate 2 k1/(3 b)") {
  const std::string type = GENERATE("-ts_type rk -ts_rk_type 4 -ts_adapt_type none -ts_dt 0.1",  // method of the thesis
                                    "-ts_type rk -ts_atol 1e-8");
  const PetscOptionScope options(type);
  Configuration<2> c;
  c.add_droplet(1, {0, 0});
  c.add_droplet(1, {1.99, 0});
  OverdampedSystem<2> system(
      ParticleSystem<2>(c.topology, {}, make_force_field<2>(ModelKind::bubble, {}, pliant::Vec<2>::Zero()), 0.2),
      std::make_unique<NeighbourDrag<2>>(standard));
  TsIntegrator integrator;
  State state(2, 2);
  std::copy(c.x.begin(), c.x.end(), state.x().begin());
  const auto distance = [&] { return state.x()[2] - state.x()[0]; };
  integrator.run(system, state, 1, {});
  const Real at_1 = distance();
  integrator.run(system, state, 2, {});
  const Real at_2 = distance();
  integrator.run(system, state, 20, {});
  const Real rest = distance();
  CHECK(rest == Approx(1.993).margin(5e-4));
  CHECK(std::log((at_1 - rest) / (at_2 - rest)) == Approx(2 * 4.69 / 3).epsilon(0.01));
  CHECK(state.x()[0] + state.x()[2] == Approx(1.99).epsilon(1e-9));  // momentum: their centre does not move
}

TEST_CASE("a wall that moves drags droplets along") {
  const PetscOptionScope none("");
  Configuration<2> c;
  c.add_droplet(1, {1.05, 0});
  Walls<2> wall(std::vector{Solid<2>::half_space({0, 0}, {1, 0})});
  wall.set_motion(0, {.velocity = {0, 0.4}});
  const auto velocity = [&](Real t, bool walls) {
    OverdampedSystem<2> system(
        ParticleSystem<2>(c.topology, wall,
                          make_force_field<2>(ModelKind::bubble, {.phi_c = 0}, pliant::Vec<2>::Zero()), 0.2),
        std::make_unique<NeighbourDrag<2>>(NeighbourDragOptions{.beyond_contact = beyond, .walls = walls}));
    std::vector<Real> v(2);
    system.rate(t, c.x.data(), v.data());
    return v;
  };
  CHECK(velocity(0, true) == std::vector<Real>{0, 0.2});
  CHECK(velocity(0, false) == std::vector<Real>{0, 0});
  wall.set_motion(0, {.velocity = {0.1, 0}});
  CHECK(velocity(0.5, false)[0] == 0);
  CHECK(velocity(1, false)[0] == Approx(10 * (1 / 0.95 - 1)));  // the wall has come nearer by 0.1
}

TEST_CASE("options of the mobility that make no sense are refused") {
  const PetscOptionScope none("");
  Configuration<2> c;
  c.add_droplet(1, {0, 0});
  CHECK_THROWS_AS(system_of<2>(c, {.b = 0, .beyond_contact = beyond}), InputError);
  CHECK_THROWS_AS(system_of<2>(c, {.beyond_contact = 0}), InputError);
  CHECK_THROWS_WITH(system_of<2>(c, {.beyond_contact = 0.2}), Catch::Contains("lists"));
}

TEST_CASE("viscous neighbours on several ranks are refused", "[ranks]") {
  const PetscOptionScope none("");
  const Ranks ranks(PETSC_COMM_WORLD);
  if (!ranks.several()) return;
  Configuration<2> c;
  for (Index m = 0; m < ranks.size(); ++m) c.add_droplet(1, {1.99 * m, 0});
  OverdampedSystem<2> system = system_of<2>(c, standard, ranks);
  system.particles().take(system.particles().topology().select(std::vector<Index>{ranks.rank()}));
  const pliant::Vec<2> x = c.position(ranks.rank());
  std::vector<Real> place(x.begin(), x.end()), v(2);
  CHECK_THROWS_WITH(system.rate(0, place.data(), v.data()), Catch::Contains("on one rank only"));
}

}  // namespace pliant::test::overdamped_test
