// Particles on several ranks against the same particles on one. Run on one rank with all tests of the folder, on
// several by those with the tag.
#include <petscsys.h>
#include <algorithm>
#include <catch2/catch.hpp>

#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "support/problems.h"
#include "support/twins.h"

namespace pliant::test::particle_system_test {

namespace {

/// All functions of a system that a run calls.
template <int D>
void compare(Twins<D>& twins) {
  const Ranks& ranks = twins.ranks;
  const Configuration<D>& c = twins.c;
  ParticleSystem<D>&shared = twins.shared, &whole = twins.whole;
  const State &state = twins.state, &whole_state = twins.whole_state;
  REQUIRE(ranks.sum(static_cast<std::int64_t>(shared.topology().owned())) == c.topology.particles());
  std::vector<Real> a(state.size()), b(whole_state.size());
  shared.acceleration(0, state.x().data(), state.v().data(), a.data());
  whole.acceleration(0, whole_state.x().data(), whole_state.v().data(), b.data());
  Real largest = 0;
  for (const Real one : b) largest = std::max(largest, std::abs(one));
  CHECK(largest > 1);
  CHECK(twins.difference(a, b) < 1e-12 * largest);

  const StateView<D> s = shared.view(state.x().data(), state.v().data()),
                     w = whole.view(whole_state.x().data(), whole_state.v().data());
  std::vector<Real> f(s.topology.points() * D), g(w.topology.points() * D);
  const Real energy = whole.field().energy(w, g.data());
  CHECK(ranks.sum(shared.field().energy(s, f.data())) == Approx(energy).epsilon(1e-12));
  CHECK(twins.difference(f, g) < 1e-12 * largest);
  CHECK(ranks.sum(shared.field().power(s)) == Approx(whole.field().power(w)).epsilon(1e-12));
  struct Touch {
    Index first, second;
    auto operator<=>(const Touch&) const = default;
  };
  const auto contacts = [](const ForceField<D>& field, const StateView<D>& view) {
    std::vector<Touch> touching;
    field.for_each_contact(view, [&](const Contact<D>& contact) {
      const Index i = view.topology.id[contact.first], j = view.topology.id[contact.second];
      touching.push_back({std::min(i, j), std::max(i, j)});
    });
    return touching;
  };
  std::vector<Touch> touching = contacts(shared.field(), s), expected = contacts(whole.field(), w);
  touching = ranks.all_gather(touching);
  std::sort(touching.begin(), touching.end());
  std::sort(expected.begin(), expected.end());
  CHECK(expected.size() > 100);
  CHECK(touching == expected);
  std::vector<Real> walls(s.walls.size() * D), all_walls(walls.size());
  shared.field().add_wall_forces(s, walls.data());
  whole.field().add_wall_forces(w, all_walls.data());
  ranks.sum(walls);
  for (std::size_t k = 0; k < walls.size(); ++k) CHECK(walls[k] == Approx(all_walls[k]).margin(1e-9));
  // Each term by itself.
  const std::vector<TermReport> parts = shared.field().report(s), all_parts = whole.field().report(w);
  REQUIRE(parts.size() == all_parts.size());
  for (std::size_t k = 0; k < parts.size(); ++k) {
    INFO(parts[k].name);
    CHECK(ranks.sum(parts[k].energy) == Approx(all_parts[k].energy).epsilon(1e-12).margin(1e-12));
    CHECK(twins.difference(parts[k].force, all_parts[k].force) < 1e-11 * largest);
  }
}

template <int D>
void check_system(Random& random, Configuration<D> c, ModelKind kind) {
  INFO(to_string(kind) << ", " << D << "D");
  const Index n = c.topology.particles();
  for (int k = 0; k < 7; ++k) c.topology.deactivate(random.below(n));
  Twins<D> twins(c, kind);
  compare(twins);
  twins.sort();
  compare(twins);
  const Index ghosts = twins.shared.topology().ghosts;
  CHECK((twins.ranks.sum(static_cast<std::int64_t>(ghosts)) > 0) == twins.ranks.several());
  CHECK(ghosts < n / 2);
  CHECK(!twins.shared.migration_due());

  // A bit, which the lists still hold, and again, which they do not.
  for (int k = 0; k < 4; ++k) {
    for (Real& a : c.x) a += random(-0.3, 0.3) * skin;
    for (Real& a : c.v) a = random(-1, 1);
    twins.load();
    compare(twins);
  }
  // One particle is moved elsewhere.
  const auto shift = [&](Index m, const pliant::Vec<D>& by) {
    for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) point<D>(c.x.data(), i) += by;
  };
  const auto centre = [&](Index m) { return mean_of_points<D>(c.x.data(), c.topology, m); };
  shift(n / 7, centre(n - n / 5) - centre(n / 7) + 0.4 * pliant::Vec<D>::Unit(0));
  twins.load();
  compare(twins);
  CHECK(!twins.shared.migration_due());
  // Many particles change places: every third particle with the opposite one in the order.
  for (Index m = 0; m < n / 2; m += 3) {
    const pliant::Vec<D> by = centre(n - 1 - m) - centre(m);
    shift(m, by);
    shift(n - 1 - m, -by);
  }
  twins.load();
  compare(twins);
  CHECK(twins.shared.migration_due() == twins.ranks.several());
  twins.sort();
  compare(twins);
  CHECK(!twins.shared.migration_due());
}

/// Runs both systems; the shared system is sorted every `period` steps.
template <int D>
void check_run(Configuration<D> c, ModelKind kind, Integrator& one, Integrator& many, Real t_end, int period) {
  INFO(to_string(kind) << ", " << D << "D, " << one.name());
  Twins<D> twins(c, kind);
  twins.sort();
  one.run(twins.whole, twins.whole_state, t_end, true, {});
  many.run(twins.shared, twins.state, t_end, true, [&](State& s) {
    if (s.step % period != 0) return AfterStep::proceed;
    twins.sort(many);
    return AfterStep::reordered;
  });
  CHECK(twins.state.t == twins.whole_state.t);
  CHECK(twins.state.step == twins.whole_state.step);
  CHECK(one.statistics().steps == many.statistics().steps);
  CHECK(one.statistics().steps >= 100);
  CHECK(twins.whole.neighbours().rebuilds() >= 3);
  CHECK(twins.difference(twins.state.x(), twins.whole_state.x()) < 1e-9);
  CHECK(twins.difference(twins.state.v(), twins.whole_state.v()) < 1e-9);
  CHECK(twins.difference(twins.state.x(), c.x) > 0.02);  // they have moved
}

}  // namespace

TEST_CASE("a system on ranks is the same system", "[ranks]") {
  Random random(1);
  check_system(random, soft_rows<2>(random, 20, 40), ModelKind::sp);
  check_system(random, soft_rows<3>(random, 9, 18), ModelKind::sp);
  check_system(random, polygon_rows(random, 10, 30), ModelKind::rough);
  check_system(random, polygon_rows(random, 10, 30), ModelKind::smooth);
}

TEST_CASE("a run on ranks is the same run", "[ranks]") {
  Random random(2);
  const auto verlet = [](auto c, ModelKind kind, Real dt) {
    FixedStepVerlet one(dt), many(dt);
    check_run(std::move(c), kind, one, many, 300 * dt, 37);
  };
  verlet(soft_rows<2>(random, 12, 24), ModelKind::sp, 1e-3);
  verlet(soft_rows<3>(random, 6, 12), ModelKind::sp, 1e-3);
  verlet(polygon_rows(random, 7, 14), ModelKind::rough, 3e-4);
  verlet(polygon_rows(random, 7, 14), ModelKind::smooth, 3e-4);
}

TEST_CASE("one rank's particle is put elsewhere", "[ranks]") {
  Random random(6);
  const auto run = [&]<int dim>(Configuration<dim> c, ModelKind kind, Real dt) {
    Twins<dim> twins(c, kind);
    twins.sort();
    const auto put = [](ParticleSystem<dim>& system, State& s) {
      if (s.step % 40 != 0) return AfterStep::proceed;
      const Topology& t = system.topology();
      for (Index m = 0; m < t.owned(); ++m) {
        if (t.id[m] != static_cast<Index>(s.step / 40)) continue;
        for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) s.x()[(i + 1) * dim - 1] += 40;
        system.relist(s.x().data(), m);
      }
      return AfterStep::changed;
    };
    FixedStepVerlet one(dt), many(dt);
    one.run(twins.whole, twins.whole_state, 300 * dt, true, [&](State& s) { return put(twins.whole, s); });
    many.run(twins.shared, twins.state, 300 * dt, true, [&](State& s) { return put(twins.shared, s); });
    CHECK(twins.difference(twins.state.x(), twins.whole_state.x()) < 1e-9);
    CHECK(twins.difference(twins.state.x(), c.x) > 30);
  };
  run(soft_rows<2>(random, 12, 24), ModelKind::sp, 1e-3);
  run(polygon_rows(random, 7, 14), ModelKind::rough, 3e-4);
}

TEST_CASE("lists are compared only after possible motion, with the rebuilds of a comparison at every step", "[ranks]") {
  Random random(7);
  const auto run = [&]<int dim>(Configuration<dim> c, ModelKind kind, Real dt) {
    Twins<dim> twins(c, kind), always(c, kind);
    FixedStepVerlet verlet(dt), looking(dt);
    verlet.run(twins.shared, twins.state, 300 * dt, true, {});
    looking.run(always.shared, always.state, 300 * dt, true, [&](State& s) {
      always.shared.view(s.x().data(), s.v().data(), s.t);  // drops the bounds of the motion
      return AfterStep::proceed;
    });
    CHECK(twins.shared.neighbours().rebuilds() >= 3);
    CHECK(twins.shared.neighbours().rebuilds() == always.shared.neighbours().rebuilds());
    CHECK(std::ranges::equal(twins.state.x(), always.state.x()));
    CHECK(std::ranges::equal(twins.state.v(), always.state.v()));
    // After the run, any query is allowed.
    const std::int64_t rebuilds = twins.shared.neighbours().rebuilds();
    std::vector<Real> x(twins.state.x().begin(), twins.state.x().end()), a(x.size());
    for (Real& coordinate : x) coordinate += 2 * skin;
    twins.shared.acceleration(twins.state.t, x.data(), twins.state.v().data(), a.data());
    CHECK(twins.shared.neighbours().rebuilds() == rebuilds + 1);
  };
  run(soft_rows<2>(random, 12, 24), ModelKind::sp, 1e-3);
  run(soft_rows<3>(random, 6, 12), ModelKind::sp, 1e-3);
  run(polygon_rows(random, 7, 14), ModelKind::smooth, 3e-4);
}

TEST_CASE("a run by PETSc TS on ranks is the same run", "[ranks]") {
  Random random(3);
  const PetscOptionScope scope("-ts_type rk -ts_adapt_type none");
  TsIntegrator one({.dt = 2e-3}), many({.dt = 2e-3}, PETSC_COMM_WORLD);
  check_run(soft_rows<2>(random, 12, 24), ModelKind::sp, one, many, 0.3, 37);
}

TEST_CASE("ranks without a particle take part", "[ranks]") {
  Random random(4);
  for (const bool all_on_last : {false, true}) {
    INFO((all_on_last ? "all on the last rank" : "none on the first"));
    Configuration<2> c = soft_rows<2>(random, 9, 18);
    const int last = Ranks(PETSC_COMM_WORLD).size() - 1;
    Twins<2> twins(c, ModelKind::sp, [&](Index m) { return all_on_last ? last : std::min(last, 1 + m % 2); });
    compare(twins);
    // Valid lists stay valid, with the rebuild counters of every rank.
    const std::int64_t rebuilds = twins.shared.neighbours().rebuilds();
    compare(twins);
    CHECK(twins.shared.neighbours().rebuilds() == rebuilds);
    for (Real& a : c.x) a += random(-1, 1) * skin;
    twins.load();
    compare(twins);
    twins.sort();
    if (twins.ranks.several()) CHECK(twins.shared.topology().owned() < c.topology.particles());
    CHECK(twins.shared.topology().owned() > 0);
    compare(twins);
  }
}

TEST_CASE("fewer particles than ranks", "[ranks]") {
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  Twins<2> twins(c, ModelKind::sp);
  FixedStepVerlet one(1e-2), many(1e-2);
  one.run(twins.whole, twins.whole_state, 1, true, {});
  many.run(twins.shared, twins.state, 1, true, [&](State& s) {
    if (s.step % 10 != 0) return AfterStep::proceed;
    twins.sort(many);
    return AfterStep::reordered;
  });
  CHECK(twins.state.step == 100);
  CHECK(twins.difference(twins.state.x(), twins.whole_state.x()) < 1e-14);
  CHECK(twins.difference(twins.state.x(), c.x) > 0.1);
}

TEST_CASE("what goes wrong on one rank stops all", "[ranks]") {
  Random random(5);
  Configuration<2> c = soft_rows<2>(random, 9, 18);
  Twins<2> twins(c, ModelKind::sp);
  twins.sort();
  // The first particle of the root.
  const Index id = twins.ranks.broadcast(twins.ranks.root() ? twins.shared.topology().id[0] : 0);
  if (twins.ranks.root()) twins.state.x()[1] = std::numeric_limits<Real>::quiet_NaN();
  std::vector<Real> a(twins.state.size());
  const auto evaluate = [&] { twins.shared.acceleration(0, twins.state.x().data(), twins.state.v().data(), a.data()); };
  CHECK_THROWS_AS(evaluate(), Error);
  CHECK_THROWS_WITH(evaluate(), Catch::Contains(fmt::format("particle {} ", id)));
  FixedStepVerlet verlet(1e-3);
  CHECK_THROWS_WITH(verlet.run(twins.shared, twins.state, 1, true, {}),
                    Catch::Contains(fmt::format("particle {} ", id)));
  CHECK(twins.ranks.sum(1.0) == twins.ranks.size());  // all are still in step
}

}  // namespace pliant::test::particle_system_test
