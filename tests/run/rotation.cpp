// Particles that rotate: angles and spins in addition to positions and velocities. Cases with the tag work on any
// number of ranks.
#include <petscsys.h>
#include <catch2/catch.hpp>

#include <pliant/system/point_drag.h>
#include <pliant/ts/ts_integrator.h>

#include "support/disks.h"
#include "support/order.h"
#include "support/problems.h"

namespace pliant::test::rotation_test {

namespace {

/// Disks or spheres in a block, in contact, turned and spinning.
template <int D>
struct Block {
  Configuration<D> c;
  std::vector<Real> angles, spins;
  explicit Block(Random& random, Index columns = 5, Index rows = 6) : c(soft_rows<D>(random, columns, rows)) {
    c.walls = {};
    const auto n = static_cast<std::size_t>(c.topology.particles()) * rotations<D>;
    angles = random_numbers(random, n, 1);
    spins = random_numbers(random, n, 2);
  }
  std::unique_ptr<Simulation<D>> simulation(Sorting sorting = Sorting::never, const Ranks& ranks = Ranks(),
                                            std::unique_ptr<Integrator> by = std::make_unique<FixedStepVerlet>(1e-3)) {
    auto s = simulation_of<D>(c, sorting, ranks, std::move(by), PairContact<D>{100, "pair"}, TorsionBond<D>{30},
                              SpinDrag<D>{0.1}, SurfaceDashpot<D>{0.3});
    start(*s, c, angles, spins);
    return s;
  }
};

template <int D>
void check_derivatives(Random& random) {
  Block<D> block(random, 4, 3);
  const auto s = block.simulation();
  std::vector<Real> x(s->state().x().begin(), s->state().x().end()), f(x.size());
  const auto energy = [&](Real* to = nullptr) {
    return s->particles().field().energy(s->particles().view(x.data(), nullptr), to);
  };
  energy(f.data());
  const std::size_t positions = static_cast<std::size_t>(s->topology().points()) * D;
  Real most = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    constexpr Real h = 1e-5;
    const Real at = x[k];
    x[k] = at + h;
    const Real up = energy();
    x[k] = at - h;
    const Real slope = (up - energy()) / (2 * h);
    x[k] = at;
    CHECK(-slope == Approx(f[k]).margin(1e-6));
    if (k >= positions) most = std::max(most, std::abs(f[k]));
  }
  CHECK(most > 0.1);
}

template <int D>
void check_momenta(Random& random) {
  Block<D> block(random);
  const auto s = block.simulation();
  const StateView<D> view = s->view();
  const Topology& t = view.topology;
  for (const TermReport& term :
       view.topology.points() > 0 ? s->particles().field().report(view) : std::vector<TermReport>{}) {
    if (term.name == "spin_drag") continue;
    INFO(term.name);
    const Real* const torques = term.force.data() + static_cast<std::size_t>(t.points()) * D;
    pliant::Vec<D> force = pliant::Vec<D>::Zero();
    Rotation<D> moment, own;
    if constexpr (D == 2)
      moment = own = 0;
    else
      moment = own = Rotation<D>::Zero();
    Real power = 0, torque_size = 0;
    for (Index i = 0; i < t.points(); ++i) {
      const pliant::Vec<D> f = point<D>(term.force.data(), i);
      const Rotation<D> turn = rotation<D>(torques, i);
      force += f;
      moment += torque(view.position(i), f);
      moment += turn;
      torque_size += std::sqrt(norm2<D>(turn));
      power -= f.dot(view.velocity(i));
      for (int k = 0; k < rotations<D>; ++k) power -= torques[i * rotations<D> + k] * view.spins[i * rotations<D> + k];
    }
    CHECK(force.norm() < 1e-10);
    CHECK(std::sqrt(norm2<D>(moment)) < 1e-9);
    CHECK((torque_size > 1) == (term.name != "pair"));
    if (term.name == "dashpot") {
      std::vector<Real> drag(s->state().size());
      CHECK(power > 1);
      const Real all = s->particles().field().power(view);
      Real spinning = 0;
      for (Index i = 0; i < t.points(); ++i) spinning += 0.1 * norm2<D>(view.spin(i));
      CHECK(all == Approx(power + spinning).epsilon(1e-10));
    }
  }
}

/// One particle with a spring and a drag against turning: I θ̈ = −k θ − γ θ̇.
template <int D>
double oscillator_error(std::unique_ptr<Integrator> integrator, Real t_end) {
  constexpr Real k = 2, gamma = 0.05;
  Configuration<D> c;
  c.add_soft(1.2, pliant::Vec<D>::Zero());
  c.topology.set_inertia(0, 0.5);
  const auto s =
      simulation_of<D>(c, Sorting::never, Ranks(), std::move(integrator), TorsionSpring<D>{k}, SpinDrag<D>{gamma});
  start(*s, c, std::vector<Real>(rotations<D>, 0.7), std::vector<Real>(rotations<D>, 0.0));
  s->advance(t_end);
  const Real decay = gamma / (2 * 0.5), omega = std::sqrt(k / 0.5 - decay * decay), t = s->state().t;
  const Real theta = 0.7 * std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t)),
             spin = -0.7 * std::exp(-decay * t) * (omega + decay * decay / omega) * std::sin(omega * t);
  Real error = 0;
  for (int d = 0; d < rotations<D>; ++d)
    error = std::max({error, std::abs(s->angles()[d] - theta), std::abs(s->spins()[d] - spin)});
  CHECK(std::abs(theta) + std::abs(spin) > 0.1);
  for (int d = 0; d < D; ++d) CHECK(s->state().x()[d] == 0);
  return error;
}

}  // namespace

TEST_CASE("a particle's moment of inertia is that of a disk or of a ball, unless it is set") {
  Topology disk, ball;
  ball.dim = 3;
  disk.add_soft(1.4, 3);
  ball.add_soft(1.4, 3);
  CHECK(disk.inertia[0] == Approx(3 * square(0.7) / 2));
  CHECK(ball.inertia[0] == Approx(3 * square(0.7) * 2 / 5));
  CHECK(disk.inverse_inertia[0] == Approx(1 / disk.inertia[0]));
  disk.set_inertia(0, 5);
  disk.add_soft(1, 1);
  const std::array<Index, 2> order{1, 0};
  const Topology other = disk.select(order);
  CHECK(other.inertia[1] == 5);
  CHECK(other.inverse_inertia[1] == 0.2);
  disk.deactivate(0);
  CHECK(disk.inverse_inertia[0] == 0);
  disk.add_polygon(5, 1, 1, 0.2, 1);
  CHECK(disk.inverse_inertia[2] == 0);
}

TEST_CASE("torques are derivatives of the energy by angles") {
  Random random(1);
  check_derivatives<2>(random);
  check_derivatives<3>(random);
}

TEST_CASE("forces between particles conserve momentum and angular momentum, and dissipate their power") {
  Random random(2);
  check_momenta<2>(random);
  check_momenta<3>(random);
}

TEST_CASE("a particle that turns follows the exact solution at the order of the method") {
  require_order(
      "Verlet", [](Real h) { return oscillator_error<2>(std::make_unique<FixedStepVerlet>(h), 3.2); }, 0.1, 2);
  const PetscOptionScope scope("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
  const auto ts = [](Real h) { return std::make_unique<TsIntegrator>(TsOptions{.dt = h}); };
  require_order(
      "RK 4", [&](Real h) { return oscillator_error<2>(ts(h), 3.2); }, 0.2, 4);
  require_order(
      "RK 4, 3D", [&](Real h) { return oscillator_error<3>(ts(h), 3.2); }, 0.2, 4);
}

TEST_CASE("kinetic energy includes that of spins") {
  Configuration<3> c;
  c.add_soft(1, pliant::Vec<3>::Zero());
  const auto s =
      simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(1e-3), TorsionSpring<3>{3});
  start(*s, c, {0.3, -0.2, 0.5}, {1, 2, -1});
  const auto energy = [&] {
    const StateView<3> view = s->view();
    return kinetic_energy(view) + s->particles().field().energy(view);
  };
  const Real before = energy();
  CHECK(before == Approx(c.topology.inertia[0] / 2 * 6 + 1.5 * (0.09 + 0.04 + 0.25)));
  s->advance(1);
  CHECK(energy() == Approx(before).epsilon(1e-4));
}

TEST_CASE("an inactive particle keeps its spin") {
  Random random(3);
  Block<2> block(random, 4, 4);
  const auto s = block.simulation();
  s->particles().deactivate(4);
  std::vector<Real> a(s->state().size());
  s->particles().acceleration(0, s->state().x().data(), s->state().v().data(), a.data());
  const auto alpha = s->particles().rotations_in(std::span(a));
  for (std::size_t m = 0; m < alpha.size(); ++m) CHECK((alpha[m] == 0) == (m == 4));
}

TEST_CASE("angles and spins go where their particles go, to other ranks too", "[ranks]") {
  Random random(4);
  const auto run = [&]<int D>(Block<D> block) {
    const auto alone = block.simulation(), shared = block.simulation(Sorting::regularly, Ranks(PETSC_COMM_WORLD));
    CHECK(Snapshot<D>(*shared) == Snapshot<D>(*alone));
    shared->sort();
    CHECK(Snapshot<D>(*shared) == Snapshot<D>(*alone));
    const Snapshot<D> before(*alone);
    alone->advance(0.2);
    shared->advance(0.2, [&](State& state) {
      if (state.step % 37 != 0) return AfterStep::proceed;
      shared->sort();
      return AfterStep::reordered;
    });
    const Snapshot<D> after(*alone);
    CHECK(after.difference(Snapshot<D>(*shared)) < 1e-10);
    CHECK(after.difference(before) > 0.1);
    CHECK(alone->particles().neighbours().rebuilds() >= 3);
  };
  run(Block<2>(random, 10, 12));
  run(Block<3>(random, 5, 6));
}

TEST_CASE("a run with spins by PETSc TS on ranks is the same run", "[ranks]") {
  const PetscOptionScope scope("-ts_type rk -ts_rk_type 5dp -ts_adapt_type none -ts_dt 2e-3");
  Random random(5);
  Block<2> block(random, 8, 9);
  const auto alone = block.simulation(Sorting::never, Ranks(), std::make_unique<TsIntegrator>()),
             shared = block.simulation(Sorting::at_start, Ranks(PETSC_COMM_WORLD),
                                       std::make_unique<TsIntegrator>(TsOptions{}, PETSC_COMM_WORLD));
  alone->advance(0.2);
  shared->advance(0.2);
  CHECK(Snapshot<2>(*alone).difference(Snapshot<2>(*shared)) < 1e-8);
  CHECK(alone->integrator().statistics().steps == 100);
}

TEST_CASE("what cannot have spins says so") {
  Random random(6);
  const PetscOptionScope scope("-ts_type beuler");
  Block<2> block(random, 4, 4);
  const auto implicit = block.simulation(Sorting::never, Ranks(), std::make_unique<TsIntegrator>());
  CHECK_THROWS_WITH(implicit->advance(0.1), Catch::Contains("no Jacobian") && Catch::Contains("-ts_type rk"));
  const auto system = [&](Topology topology) {
    return ParticleSystem<2>(std::move(topology), {}, alone<2>(TorsionSpring<2>{1}), 0.05);
  };
  CHECK_THROWS_WITH(OverdampedSystem<2>(system(block.c.topology), std::make_unique<PointDrag<2>>(1.0)),
                    Catch::Contains("without inertia"));
  Topology polygon;
  polygon.add_polygon(5, 1, 1, 0.1, 1);
  CHECK_THROWS_WITH(system(polygon), Catch::Contains("one point"));
  DenseSink<2> sink(block.c.topology.points());
  const auto s = block.simulation();
  CHECK_THROWS_WITH(s->particles().field().hessian(s->view(), sink), Catch::Contains("bond"));
}

}  // namespace pliant::test::rotation_test
