// Particles on several ranks against the same particles on one. Run on one rank with all tests of the folder, on
// several by those with the tag.
#include <petscsys.h>
#include <catch2/catch.hpp>

#include <pliant/model/catalogue.h>
#include <pliant/ts/particle_system.h>
#include <pliant/ts/ts_integrator.h>
#include <pliant/ts/verlet.h>

#include "problems.h"
#include "support/rows.h"

using namespace pliant;
using namespace pliant::test;

namespace {

constexpr Real skin = 0.05;
const ModelParameters parameters{
    .epsilon = 100, .epsilon_wall = 200, .k_a = 20, .k_l = 3, .k_b = 0.02, .mu = 0.2, .zeta = 0.3};

template <int D>
ParticleSystem<D> system_of(const Configuration<D>& c, ModelKind kind, const Ranks& ranks) {
  return ParticleSystem<D>(c.topology, c.walls,
                           make_force_field<D>(kind, parameters, pliant::Vec<D>::LinSpaced(0.1, -1)),
                           neighbour_needs(kind), skin, ranks);
}

/// The particles of a configuration, ids in order, on one rank and shared out: every size()-th, or by `owner(id)`.
template <int D>
struct Twins {
  Ranks ranks{PETSC_COMM_WORLD};
  Configuration<D>& c;
  ParticleSystem<D> whole, shared;
  State whole_state, state;

  Twins(Configuration<D>& configuration, ModelKind kind)
      : Twins(configuration, kind, [this](Index m) { return m % ranks.size(); }) {}
  template <class Owner>
  Twins(Configuration<D>& configuration, ModelKind kind, Owner&& owner)
      : c(configuration), whole(system_of<D>(c, kind, Ranks())), shared(system_of<D>(c, kind, ranks)) {
    std::vector<Index> mine;
    for (Index m = 0; m < c.topology.particles(); ++m)
      if (owner(m) == ranks.rank()) mine.push_back(m);
    shared.take(c.topology.select(mine));
    load();
  }

  /// Both states as the configuration is.
  void load() {
    whole_state.assign(c.x, c.v, std::vector<Real>(c.x.size()));
    std::vector<Real> x, v;
    for (Index m = 0; m < shared.topology().owned(); ++m)
      for (Index k = first(m); k < first(m) + D * shared.topology().points_of(m); ++k) {
        x.push_back(c.x[k]);
        v.push_back(c.v[k]);
      }
    state.assign(x, v, std::vector<Real>(x.size()));
  }
  /// Where the coordinates of own particle m begin in the whole.
  Index first(Index m) const { return c.topology.offset[shared.topology().id[m]] * D; }

  /// Largest difference between own coordinates and those of the whole, over all ranks; infinity for NaN.
  Real difference(std::span<const Real> own, std::span<const Real> all) const {
    Real most = 0;
    const Topology& t = shared.topology();
    for (Index m = 0; m < t.owned(); ++m)
      for (Index k = 0; k < D * t.points_of(m); ++k) {
        const Real d = std::abs(own[t.offset[m] * D + k] - all[first(m) + k]);
        if (!(d <= most)) most = std::isnan(d) ? std::numeric_limits<Real>::infinity() : d;
      }
    return ranks.max(most);
  }

  /// Everything that is asked of a system in a run.
  void compare() {
    REQUIRE(ranks.sum(static_cast<std::int64_t>(shared.topology().owned())) == c.topology.particles());
    std::vector<Real> a(state.size()), b(whole_state.size());
    shared.acceleration(0, state.x().data(), state.v().data(), a.data());
    whole.acceleration(0, whole_state.x().data(), whole_state.v().data(), b.data());
    Real largest = 0;
    for (const Real one : b) largest = std::max(largest, std::abs(one));
    CHECK(largest > 1);
    CHECK(difference(a, b) < 1e-12 * largest);

    const StateView<D> s = shared.view(state.x().data(), state.v().data()),
                       w = whole.view(whole_state.x().data(), whole_state.v().data());
    std::vector<Real> f(s.topology.points() * D), g(w.topology.points() * D);
    const Real energy = whole.field().energy(w, g.data());
    CHECK(ranks.sum(shared.field().energy(s, f.data())) == Approx(energy).epsilon(1e-12));
    CHECK(difference(f, g) < 1e-12 * largest);
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
      CHECK(difference(parts[k].force, all_parts[k].force) < 1e-11 * largest);
    }
  }

  void tidy() { shared.tidy(state); }
};

template <int D>
void check_system(Random& random, Configuration<D> c, ModelKind kind) {
  INFO(to_string(kind) << ", " << D << "D");
  const Index n = c.topology.particles();
  for (int k = 0; k < 7; ++k) c.topology.deactivate(random.below(n));
  Twins<D> twins(c, kind);
  twins.compare();
  twins.tidy();
  twins.compare();
  const Index ghosts = twins.shared.topology().ghosts;
  CHECK((twins.ranks.sum(static_cast<std::int64_t>(ghosts)) > 0) == twins.ranks.several());
  CHECK(ghosts < n / 2);
  CHECK(!twins.shared.crowded());

  // A bit, which the lists still hold, and again, which they do not.
  for (int k = 0; k < 4; ++k) {
    for (Real& a : c.x) a += random(-0.3, 0.3) * skin;
    for (Real& a : c.v) a = random(-1, 1);
    twins.load();
    twins.compare();
  }
  // One is put elsewhere.
  const auto shift = [&](Index m, const pliant::Vec<D>& by) {
    for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) point<D>(c.x.data(), i) += by;
  };
  const auto centre = [&](Index m) { return mean_of_points<D>(c.x.data(), c.topology, m); };
  shift(n / 7, centre(n - n / 5) - centre(n / 7) + 0.4 * pliant::Vec<D>::Unit(0));
  twins.load();
  twins.compare();
  CHECK(!twins.shared.crowded());
  // Many are: every third one changes places with the one that is opposite in the order.
  for (Index m = 0; m < n / 2; m += 3) {
    const pliant::Vec<D> by = centre(n - 1 - m) - centre(m);
    shift(m, by);
    shift(n - 1 - m, -by);
  }
  twins.load();
  twins.compare();
  CHECK(twins.shared.crowded() == twins.ranks.several());
  twins.tidy();
  twins.compare();
  CHECK(!twins.shared.crowded());
}

/// Runs both, the shared one sorted anew every `period` steps.
template <int D>
void check_run(Configuration<D> c, ModelKind kind, Integrator& one, Integrator& many, Real t_end, int period) {
  INFO(to_string(kind) << ", " << D << "D, " << one.name());
  Twins<D> twins(c, kind);
  twins.tidy();
  one.run(twins.whole, twins.whole_state, t_end, true, {});
  many.run(twins.shared, twins.state, t_end, true, [&](State& s) {
    if (s.step % period != 0) return AfterStep::proceed;
    twins.shared.tidy(s);
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
    twins.compare();
    // Valid lists stay valid, which counts on every rank.
    const std::int64_t rebuilds = twins.shared.neighbours().rebuilds();
    twins.compare();
    CHECK(twins.shared.neighbours().rebuilds() == rebuilds);
    for (Real& a : c.x) a += random(-1, 1) * skin;
    twins.load();
    twins.compare();
    twins.tidy();
    if (twins.ranks.several()) CHECK(twins.shared.topology().owned() < c.topology.particles());
    CHECK(twins.shared.topology().owned() > 0);
    twins.compare();
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
    twins.shared.tidy(s);
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
  twins.tidy();
  // The root's first particle, whichever that is.
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
