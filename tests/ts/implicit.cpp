// Implicit and split methods on particles: orders, agreement with explicit methods, failing solves.
#include <catch2/catch.hpp>

#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/model_parameters.h"
#include "support/order.h"
#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::implicit_test {
using Catch::Matchers::Contains;

namespace {

/// A pentagon that swings under its own shape energy, weight and drag: smooth, nothing touches.
Configuration<2> swinging() {
  Random random(1);
  Configuration<2> c;
  c.add_polygon(irregular_polygon(random, 5, 0.6), 0.1);
  c.random_velocities(random);
  return c;
}

State state_of(const auto& c) {
  State s;
  s.assign(c.x, c.v);
  return s;
}

constexpr Real t_end = 0.4;

/// The state at t_end, by a method with a fixed step h.
VectorXd end_of(const std::string& options, Real h, TsOptions o) {
  const PetscOptionScope scope(options +
                               " -ts_adapt_type none -snes_rtol 1e-12 -snes_stol 0 -snes_atol 1e-11 -ksp_rtol 1e-10");
  Configuration<2> c = swinging();
  auto system = system_of(c, ModelKind::shape);
  State s = state_of(c);
  o.dt = h;
  TsIntegrator ts(o);
  ts.run(system, s, t_end, true, {});
  CHECK(s.step == std::llround(t_end / h));
  CHECK(s.t == t_end);
  return y_of(s);
}

/// Mean energy of falling particles with friction that are about to come to rest, in the last eighth of a run.
template <class C>
Real mean_energy(const C& c, ModelKind kind, Integrator& integrator) {
  ModelParameters p = parameters;
  p.zeta = 1;
  auto system = system_of(c, kind, Ranks(), p);
  State s = state_of(c);
  Real sum = 0, time = 0, before = 0;
  integrator.run(system, s, 16, true, [&](State& now) {
    if (now.t > 14) {
      const auto view = system.view(now.x().data(), now.v().data());
      Real energy = system.field().energy(view);
      for (std::size_t k = 0; k < now.size(); ++k)
        energy += system.topology().mass(static_cast<Index>(k / 2)) / 2 * square(now.v()[k]);
      sum += energy * (now.t - before);
      time += now.t - before;
    }
    before = now.t;
    return AfterStep::proceed;
  });
  return sum / time;
}

template <class C>
C on_closed_floor(C c, Real width) {
  c.walls = Hopper{.wall_distance = width, .orifice = 0.05, .angle = 90}.template walls<2>();
  return c;
}

}  // namespace

TEST_CASE("implicit types converge at their order") {
  struct Method {
    const char* options;
    double order;
    Real h;
    TsOptions o = {};
  };
  const TsOptions split{.implicit = TermGroup::shape}, free{.jacobian = JacobianKind::matrix_free};
  static const VectorXd exact = end_of("-ts_type rk -ts_rk_type 8vr", t_end / 400, {});
  for (const Method& method :
       {Method{"-ts_type beuler", 1, 2.5e-3}, Method{"-ts_type cn", 2, 0.02}, Method{"-ts_type cn", 2, 0.02, free},
        Method{"-ts_type theta -ts_theta_theta 0.5", 2, 0.02}, Method{"-ts_type alpha", 2, 0.02},
        Method{"-ts_type alpha2", 2, 0.02}, Method{"-ts_type alpha2", 2, 0.02, free},
        Method{"-ts_type bdf -ts_bdf_order 2", 2, 0.01}, Method{"-ts_type rosw -ts_rosw_type ra34pw2", 3, 0.02},
        Method{"-ts_type rosw -ts_rosw_type 2p", 2, 0.0025}, Method{"-ts_type arkimex", 3, 0.02},
        Method{"-ts_type arkimex", 3, 0.02, split}, Method{"-ts_type arkimex -ts_arkimex_type 4", 4, 0.04, split}})
    require_order(
        method.options, [&](Real h) { return (end_of(method.options, h, method.o) - exact).norm(); }, method.h,
        method.order, 1e-10, 0.3);
}

TEST_CASE("adaptive implicit types reach their tolerance") {
  const Configuration<2> c = swinging();
  const VectorXd exact = end_of("-ts_type rk -ts_rk_type 8vr", t_end / 400, {});
  for (const char* type : {"bdf", "rosw", "arkimex", "cn -ts_adapt_type basic", "alpha2 -ts_adapt_type basic"}) {
    INFO(type);
    std::vector<Real> errors;
    for (const char* tolerance : {"1e-3", "1e-6"}) {
      const PetscOptionScope scope(fmt::format("-ts_type {} -ts_rtol {} -ts_atol {}", type, tolerance, tolerance));
      auto system = system_of(c, ModelKind::shape);
      State s = state_of(c);
      TsIntegrator ts;
      ts.run(system, s, t_end, true, {});
      errors.push_back((y_of(s) - exact).norm());
      CHECK(ts.statistics().jacobian_evaluations > 0);
      CHECK(ts.statistics().linear_iterations >= ts.statistics().steps);
      // Nothing touches, and every particle has its block: one iteration for each solve.
      CHECK(ts.statistics().linear_iterations <= ts.statistics().force_evaluations);
    }
    INFO(errors[0] << ' ' << errors[1]);
    CHECK(errors[1] < errors[0] / 20);
    CHECK(errors[1] < 5e-3);
  }
}

TEST_CASE("a settling pile has the same energy by implicit methods as by Verlet") {
  Random random(2);
  // Polygons may come to rest on another edge, and a bounce more or less changes the mean by ten per cent.
  const auto check = [&](const auto& c, ModelKind kind, Real dt, std::initializer_list<const char*> methods,
                         TermGroup part) {
    FixedStepVerlet verlet(5e-4);
    const Real expected = mean_energy(c, kind, verlet);
    for (const char* options : methods) {
      INFO(to_string(kind) << ' ' << options);
      const PetscOptionScope scope{std::string(options)};
      TsIntegrator ts({.dt = dt, .implicit = part});
      CHECK(mean_energy(c, kind, ts) == Approx(expected).epsilon(kind == ModelKind::sp ? 0.02 : 0.15));
    }
  };
  const auto disks = on_closed_floor(soft_rows<2>(random, 4, 3), 4);
  check(disks, ModelKind::sp, 0.01,
        {"-ts_type bdf -ts_adapt_type none", "-ts_type cn", "-ts_type alpha2", "-ts_type rosw -ts_adapt_type none",
         "-ts_type beuler -snes_mf_operator", "-ts_type arkimex -ts_adapt_type none"},
        TermGroup::all);
  Configuration<2> polygons;
  for (const Real height : {0.7, 1.9, 3.1})
    polygons.add_polygon(regular_polygon(8, 0.45, {random(-0.1, 0.1), height}, random(0, 1)), 0.15);
  polygons = on_closed_floor(std::move(polygons), 1.3);
  check(polygons, ModelKind::rough, 0.01, {"-ts_type bdf -ts_adapt_type none", "-ts_type alpha2 -ts_alpha_radius 0.5"},
        TermGroup::all);
  check(polygons, ModelKind::smooth, 5e-4, {"-ts_type arkimex -ts_adapt_type none"}, TermGroup::shape);
}

TEST_CASE("a solve that fails makes the step shorter, a fixed step only for once") {
  Random random(3);
  const auto c = on_closed_floor(soft_rows<2>(random, 4, 3), 4);
  const auto run = [&](const std::string& options, const StepObserver& observer) {
    const PetscOptionScope scope(options);
    auto system = system_of(c, ModelKind::sp);
    State s = state_of(c);
    TsIntegrator ts({.dt = 0.1});
    ts.run(system, s, 2, true, observer);
    return ts.statistics();
  };
  std::vector<Real> lengths;
  Real last = 0;
  const IntegratorStatistics done = run("-ts_type beuler -snes_max_it 5", [&](State& s) {
    lengths.push_back(s.t - last);
    last = s.t;
    return AfterStep::proceed;
  });
  INFO(fmt::format("{:.3g}", fmt::join(lengths, " ")));
  CHECK(done.rejected > 0);
  const auto shortened = std::find_if(lengths.begin(), lengths.end(), [](Real h) { return h < 0.099; });
  REQUIRE(lengths.end() - shortened > 2);
  CHECK(std::count_if(shortened, lengths.end(), [](Real h) { return h == Approx(0.1); }) > 3);
  const std::string never = " -snes_max_it 1 -snes_rtol 0 -snes_stol 0 -snes_atol 0";
  CHECK_THROWS_AS(run("-ts_type beuler" + never, {}), NumericalError);
  CHECK_THROWS_WITH(run("-ts_type cn" + never, {}), Contains("ts:cn failed") && Contains("rejections"));
  CHECK_THROWS_WITH(run("-ts_type alpha2" + never, {}), Contains("ts:alpha2 failed"));
  CHECK_THROWS_WITH(run("-ts_type bdf -ksp_max_it 1 -ksp_rtol 1e-30 -ksp_atol 0 -pc_type none", {}),
                    Contains("ts:bdf failed"));
}

TEST_CASE("trial states that are not finite are rejected, with their reason if that does not help") {
  const Configuration<2> c = swinging();
  auto system = system_of(c, ModelKind::shape);
  State s = state_of(c);
  s.x()[0] = std::numeric_limits<Real>::quiet_NaN();
  const PetscOptionScope scope("-ts_type beuler -ts_max_reject 5");
  TsIntegrator ts;
  CHECK_THROWS_AS(ts.run(system, s, 1, true, {}), NumericalError);
  s.x()[0] = std::numeric_limits<Real>::quiet_NaN();
  CHECK_THROWS_WITH(ts.run(system, s, 1, true, {}), Contains("ts:beuler failed") && Contains("particle 0"));
  s = state_of(c);
  ts.run(system, s, 0.01, true, {});  // and it still works
  CHECK(s.t == 0.01);
}

TEST_CASE("implicit methods refuse what they cannot do") {
  const Problem p = driven_chain();
  FunctionSystem system = p.system();
  State s = p.state();
  {
    const PetscOptionScope scope("-ts_type bdf");
    TsIntegrator ts;
    CHECK_THROWS_AS(ts.run(system, s, 1, true, {}), InputError);
    CHECK_THROWS_WITH(ts.run(system, s, 1, true, {}), Contains("bdf") && Contains("derivatives"));
    CHECK_THROWS_WITH(TsIntegrator({.implicit = TermGroup::shape}), Contains("in two parts") && Contains("bdf"));
  }
  const PetscOptionScope scope("-ts_type arkimex");
  CHECK(TsIntegrator({.implicit = TermGroup::shape}).name() == "ts:arkimex, shape implicit");
}

TEST_CASE("implicit runs on ranks are the same runs", "[ranks]") {
  Random random(4);
  for (const char* options :
       {"-ts_type alpha2 -snes_rtol 1e-11", "-ts_type beuler -snes_rtol 1e-11", "-ts_type bdf -snes_mf_operator"}) {
    INFO(options);
    const PetscOptionScope scope(std::string(options) + " -ts_adapt_type none -snes_stol 0 -ksp_rtol 1e-10");
    Configuration<2> c = polygon_rows(random, 3, 6);
    Twins<2> twins(c, ModelKind::rough);
    twins.sort();
    TsIntegrator one({.dt = 5e-3}), many({.dt = 5e-3}, PETSC_COMM_WORLD);
    const auto observer = [](auto&& sort) {
      return [sort](State& s) {
        if (s.step != 12) return AfterStep::proceed;
        sort(s);
        return AfterStep::reordered;
      };
    };
    one.run(twins.whole, twins.whole_state, 0.1, true, observer([](State&) {}));
    many.run(twins.shared, twins.state, 0.1, true, observer([&](State& s) { twins.shared.sort(s); }));
    CHECK(twins.state.step == twins.whole_state.step);
    CHECK(twins.state.step >= 20);
    CHECK(twins.difference(twins.state.x(), twins.whole_state.x()) < 1e-7);
    CHECK(twins.difference(twins.state.v(), twins.whole_state.v()) < 1e-6);
    CHECK(twins.difference(twins.state.x(), c.x) > 0.02);
  }
}

}  // namespace pliant::test::implicit_test
