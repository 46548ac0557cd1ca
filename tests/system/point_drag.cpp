#include <pliant/system/point_drag.h>

#include <catch2/catch.hpp>

#include <pliant/system/overdamped.h>
#include <pliant/ts/ts_integrator.h>

#include "support/model_parameters.h"
#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::point_drag_test {

namespace {

ModelParameters with_drag(Real zeta) {
  ModelParameters p = parameters;
  p.mu = 0;
  p.zeta = zeta;
  return p;
}

const std::string tight = "-ts_type rk -ts_rk_type 5dp -ts_rtol 1e-10 -ts_atol 1e-10";

OverdampedSystem<2> limit_of(const Configuration<2>& c, Real zeta) {
  return {system_of<2>(c, ModelKind::rough, Ranks(), with_drag(zeta)), std::make_unique<PointDrag<2>>(zeta)};
}

}  // namespace

TEST_CASE("without inertia velocities are forces over the drag coefficients") {
  Random random(1);
  Configuration<2> c = polygon_rows(random, 4, 6);
  OverdampedSystem<2> limit = limit_of(c, 7);
  ParticleSystem<2>& system = limit.particles();
  std::vector<Real> v(c.x.size()), force(c.x.size());
  limit.rate(0, c.x.data(), v.data());
  system.field().energy(system.view(c.x.data(), nullptr), force.data());
  for (Index i = 0; i < c.topology.points(); ++i)
    for (int k = 0; k < 2; ++k)
      CHECK(v[2 * i + k] == Approx(force[2 * i + k] * c.topology.points_of(c.topology.particle[i]) / 7).margin(1e-12));
  CHECK_THROWS_AS(PointDrag<2>(0), InputError);
  // Drag dissipates the power of the forces.
  Real given = 0;
  for (std::size_t k = 0; k < v.size(); ++k) given += force[k] * v[k];
  CHECK(limit.mobility().power(system.view(c.x.data(), v.data())) == Approx(given).epsilon(1e-12));
}

TEST_CASE("without inertia drag per mass gives all sizes the velocity of their weight") {
  Random random(1);
  Configuration<2> c = polygon_rows(random, 4, 6);
  OverdampedSystem<2> limit{system_of<2>(c, ModelKind::rough, Ranks(), with_drag(7)),
                            std::make_unique<PointDrag<2>>(7, DragLaw::per_mass)};
  ParticleSystem<2>& system = limit.particles();
  std::vector<Real> v(c.x.size()), force(c.x.size());
  limit.rate(0, c.x.data(), v.data());
  system.field().energy(system.view(c.x.data(), nullptr), force.data());
  Real given = 0;
  for (Index i = 0; i < c.topology.points(); ++i)
    for (int k = 0; k < 2; ++k) {
      CHECK(v[2 * i + k] == Approx(force[2 * i + k] * (pi / 4) / (7 * c.topology.mass(i))).margin(1e-12));
      given += force[2 * i + k] * v[2 * i + k];
    }
  CHECK(limit.mobility().power(system.view(c.x.data(), v.data())) == Approx(given).epsilon(1e-12));
}

TEST_CASE("motion with inertia tends to that without as the drag grows") {
  const PetscOptionScope options(tight);
  // In units of ζ both motions agree up to m/ζ².
  const auto difference = [](Real zeta) {
    Random random(2);
    Configuration<2> c = polygon_rows(random, 3, 6);
    const Real end = 0.005 * zeta;
    ParticleSystem<2> heavy = system_of<2>(c, ModelKind::rough, Ranks(), with_drag(zeta));
    OverdampedSystem<2> limit = limit_of(c, zeta);
    State with(c.topology.points(), 2), without(c.topology.points(), 2);
    std::copy(c.x.begin(), c.x.end(), with.x().begin());
    std::copy(c.x.begin(), c.x.end(), without.x().begin());
    TsIntegrator a({.dt = 1e-4}), b({.dt = 1e-4});
    a.run(heavy, with, end, true, {});
    b.run(limit, without, end, {});
    Real most = 0, moved = 0;
    for (std::size_t i = 0; i < c.x.size(); ++i) {
      most = std::max(most, std::abs(with.x()[i] - without.x()[i]));
      moved = std::max(moved, std::abs(without.x()[i] - c.x[i]));
    }
    CHECK(moved > 0.01);
    return most / moved;
  };
  const Real some = difference(400), more = difference(800);
  CHECK(more < 0.02);
  CHECK(some / more > 3);
}

TEST_CASE("the last evaluation of a step is at its end where a method says so") {
  const auto [name, same] =
      GENERATE(table<std::string, bool>({{"3bs", true}, {"5dp", true}, {"5f", false}, {"4", false}}));
  const PetscOptionScope options("-ts_rtol 1e-5 -ts_atol 1e-5 -ts_type rk -ts_rk_type " + name);
  Random random(3);
  Configuration<2> c = polygon_rows(random, 3, 6);
  OverdampedSystem<2> limit = limit_of(c, 50);
  State state(c.topology.points(), 2);
  std::copy(c.x.begin(), c.x.end(), state.x().begin());
  TsIntegrator integrator({.dt = 1e-3});
  CHECK(integrator.first_same_as_last() == same);
  Real most = 0;
  integrator.run(limit, state, 0.1, [&](State& s) {
    const std::vector<Real> last(limit.last().begin(), limit.last().end());
    limit.rate(s.t, s.x().data(), s.v().data());
    Real fastest = 0, difference = 0;
    for (std::size_t i = 0; i < last.size(); ++i) {
      fastest = std::max(fastest, std::abs(s.v()[i]));
      difference = std::max(difference, std::abs(last[i] - s.v()[i]));
    }
    most = std::max(most, difference / fastest);
    return AfterStep::proceed;
  });
  CHECK(integrator.statistics().steps > 5);
  CHECK((most < 1e-10) == same);
}

}  // namespace pliant::test::point_drag_test
