// Disks with friction against each other, walls and a substrate at the same time. Cases with the tag work on any number
// of ranks.
#include <petscsys.h>

#include <catch2/catch.hpp>

#include <pliant/ts/ts_integrator.h>

#include "support/frictional.h"
#include "support/order.h"
#include "support/problems.h"

namespace pliant::test::disk_model_test {

namespace {

constexpr const char* terms[] = {"disk_contact", "disk_wall_contact", "base_friction"};

/// Rows of disks between the walls of a hopper that move, as a whole turned and moved to another place.
struct Crowd {
  Configuration<2> c;
  std::vector<Real> angles, spins;

  explicit Crowd(std::uint64_t seed, Index columns = 5, Index rows = 4, Real turn = 0, pliant::Vec<2> place = {0, 0}) {
    Random random(seed);
    c = soft_rows<2>(random, columns, rows);
    const auto at = [&](const pliant::Vec<2>& r) -> pliant::Vec<2> { return Eigen::Rotation2D<Real>(turn) * r; };
    const Real half = 0.95 * columns / 2, top = 0.95 * rows;
    WallParts tray{{WallSegment::between(at({-half, 0}) + place, at({half, 0}) + place),
                    WallSegment::between(at({half, 0}) + place, at({half, 2 * top}) + place)}};
    c.walls = Walls<2>();
    c.walls.add(tray, {.velocity = at({0.4, 0.2})});
    c.walls.add(Solid<2>::half_space(at({-half, 0}) + place, at({1, 0})), {.spin = -0.1, .pivot = place});
    for (Index i = 0; i < c.topology.points(); ++i) {
      point<2>(c.x.data(), i) = at(c.position(i)) + place;
      point<2>(c.v.data(), i) = at(point<2>(c.v.data(), i));
    }
    angles.assign(static_cast<std::size_t>(c.topology.particles()), 0);
    spins = random_numbers(random, angles.size(), 3);
  }

  std::unique_ptr<Simulation<2>> simulation(Real dt = 5e-4, Sorting sorting = Sorting::never,
                                            const Ranks& ranks = Ranks()) const {
    constexpr Real epsilon = 1000;
    const SurfaceFriction disk{.mu_static = 0.5, .mu_dynamic = 0.4, .damping = 0.1},
        wall{.mu_static = 0.4, .mu_dynamic = 0.3, .damping = 0.1};
    const BaseFriction base{.gravity = 1, .mu_static = 0.5, .mu_dynamic = 0.3, .epsilon = 100};
    auto s = simulation_of<2>(c, sorting, ranks, std::make_unique<FixedStepVerlet>(dt), disk_pairs(epsilon, disk),
                              WallContact<2>{2 * epsilon}, DiskWallContact{2 * epsilon, wall}, base);
    start(*s, c, angles, spins);
    touch(*s);
    return s;
  }
};

}  // namespace

TEST_CASE("contacts that the last forces found are advanced like those that are found anew, and no others are") {
  const Crowd crowd(3);
  enum class Between { nothing, look, trial };
  struct End {
    std::vector<std::vector<ContactKey>> keys;
    std::vector<std::vector<Real>> values, heat;
  };
  const auto require_same = [](const End& a, const End& b) {
    CHECK(a.keys == b.keys);
    CHECK(a.values == b.values);
    for (std::size_t k = 0; k < a.heat.size(); ++k)  // sums in any order
      for (std::size_t j = 0; j < a.heat[k].size(); ++j) CHECK(a.heat[k][j] == Approx(b.heat[k][j]).epsilon(1e-12));
  };
  const auto end = [](Simulation<2>& s) {
    End all;
    for (const char* term : terms) {
      const ContactTable& table = s.particles().history().of(term);
      all.keys.push_back(table.contacts().keys);
      all.values.push_back(table.contacts().values);
      all.heat.emplace_back(table.heat().begin(), table.heat().end());
    }
    return all;
  };
  const auto step = [&](bool evaluated, Between between) {
    const auto s = crowd.simulation();
    s->advance(0.02);
    const End before = end(*s);
    ParticleSystem<2>& system = s->particles();
    const Real h = 0.05, t = s->state().t + h;
    std::vector<Real> x(s->state().x().begin(), s->state().x().end()), v(s->state().v().begin(), s->state().v().end()),
        elsewhere = x, a(x.size());
    for (std::size_t k = 0; k < x.size(); ++k) {
      x[k] += h * v[k];
      elsewhere[k] -= h * v[k];
    }
    system.acceleration(t, x.data(), v.data(), a.data());
    if (between == Between::look)
      system.field().forces(system.view(elsewhere.data(), v.data(), t), a.data());
    else if (between == Between::trial)
      system.acceleration(t, elsewhere.data(), v.data(), a.data());
    system.accepted(t, x.data(), v.data(), h, evaluated);
    const End after = end(*s);
    for (std::size_t k = 0; k < 2; ++k) {  // some contacts have ended, others begin
      const auto differ = [](const auto& more, const auto& less) {
        std::vector<ContactKey> only;
        std::set_difference(more.begin(), more.end(), less.begin(), less.end(), std::back_inserter(only));
        return only.size();
      };
      REQUIRE(differ(before.keys[k], after.keys[k]) > 0);
      REQUIRE(differ(after.keys[k], before.keys[k]) > 0);
    }
    return after;
  };
  const End anew = step(false, Between::nothing);
  require_same(step(true, Between::nothing), anew);
  require_same(step(true, Between::look), anew);
  require_same(step(false, Between::trial), anew);
}

TEST_CASE("ranges of elements have the forces of all their elements, bit for bit") {
  Index some = 0, apart = 0;  // incomplete groups of four; separate elements
  for (const std::uint64_t seed : {6, 7, 8}) {
    const auto s = Crowd(seed).simulation();
    s->advance(0.05);
    const StateView<2> view = s->view();
    const auto check = [&](const auto& term, const PairList& list) {
      using Term = std::decay_t<decltype(term)>;
      const ContactTable& table = view.history->of(term.name());
      ContactWorkspace workspace(table.needs());
      workspace.follow(table);
      std::vector<Real> expected(s->state().size()), found(expected.size());
      const auto into = [&](std::vector<Real>& f) {
        return Scatter<2, 1>{f.data(), {}, f.data() + 2 * static_cast<std::size_t>(view.topology.owned_points())};
      };
      const Range all = list.inside(0);
      const ContactWorkspace::Next<Term::history, Term::elements == Elements::walls> next(table, workspace);
      for (Index e = all.first; e < all.last; ++e) next.set(e);  // by an earlier evaluation
      const auto one = into(expected), ranges = into(found);
      typename Term::Touch c;
      std::vector<Index> touches;
      for (Index e = all.first; e < all.last; ++e)
        if (term.find(view, e, table.current(e), c)) {
          term.add_force(view, c, one);
          touches.push_back(e);
        }
      const auto touching = static_cast<Index>(touches.size());
      term.add_forces(view, all, table, workspace, ranges);
      CHECK(found == expected);
      for (const Index e : touches) CHECK(next.touches(e));
      if constexpr (Term::elements == Elements::point_pairs)
        for (Index e = all.first; e < all.last; ++e) CHECK(next.touches(e) == std::ranges::binary_search(touches, e));
      CHECK(touching > 3);
      some += touching % 4;
      apart += all.size() - touching;
    };
    const SurfaceFriction rough{.mu_static = 0.5, .mu_dynamic = 0.4, .damping = 0.1};
    check(DiskContact{1000, rough}, view.neighbours.point_pairs);
    check(DiskContact{1000, rough, ContactLaw::hertz}, view.neighbours.point_pairs);
    check(DiskContact{1000, rough, ContactLaw::spring}, view.neighbours.point_pairs);
    check(DiskWallContact{2000, rough}, view.neighbours.walls);
  }
  CHECK(some > 3);
  CHECK(apart > 20);
}

TEST_CASE("a table resists all disks together as each by itself") {
  for (const Index rows : {1, 2, 3, 4}) {  // rows of five: groups of eight and four, and the rest
    const auto s = Crowd(9, 5, rows).simulation();
    s->advance(0.05);
    const StateView<2> view = s->view();
    const BaseFriction base{.gravity = 1, .mu_static = 0.5, .mu_dynamic = 0.3, .epsilon = 100};
    const ContactTable& table = view.history->of(base.name());
    ContactWorkspace workspace(table.needs());
    workspace.follow(table);
    const Index disks = view.topology.owned_points();
    std::vector<Real> expected(s->state().size()), found(expected.size());
    const auto into = [&](std::vector<Real>& f) {
      return Scatter<2, 1>{f.data(), {}, f.data() + 2 * static_cast<std::size_t>(disks)};
    };
    const auto one = into(expected);
    Index slide = 0;
    for (Index i = 0; i < disks; ++i) {
      BaseFriction::Touch c;
      base.find(view, i, table.current(i), c);
      base.add_force(view, c, one);
      slide += c.next[3] != BaseFriction::sticks ? 1 : 0;
    }
    base.add_forces(view, {0, disks}, table, workspace, into(found));
    for (std::size_t k = 0; k < found.size(); ++k) CHECK(found[k] == Approx(expected[k]).epsilon(1e-12).margin(1e-13));
    CHECK(slide > 0);
  }
}

TEST_CASE("disks on a table between walls do not depend on direction or place") {
  const auto plain = Crowd(4).simulation(), moved = Crowd(4, 5, 4, 2.3, {-7, 11}).simulation();
  plain->advance(0.1), moved->advance(0.1);
  const Eigen::Rotation2D<Real> rotate(2.3);
  for (Index i = 0; i < plain->topology().points(); ++i) {
    const pliant::Vec<2> expected = rotate * point<2>(plain->state().x().data(), i) + pliant::Vec<2>(-7, 11);
    CHECK((point<2>(moved->state().x().data(), i) - expected).norm() < 1e-9);
    CHECK(moved->spins()[i] == Approx(plain->spins()[i]).margin(1e-7));
  }
  for (const char* term : terms) {
    const auto a = plain->particles().history().of(term).heat(), b = moved->particles().history().of(term).heat();
    for (std::size_t k = 0; k < a.size(); ++k) {
      CHECK(a[k] > 1e-3);
      CHECK(b[k] == Approx(a[k]).epsilon(1e-6));
    }
  }
}

TEST_CASE("energy, work of the walls and heat of all causes balance, the better the shorter the step") {
  const auto lost = [&](std::uint64_t seed, Real dt) {
    const auto s = Crowd(seed).simulation(dt);
    const Real before = energy(*s);
    Real work = 0;
    s->advance(0.1, [&](State&) {
      work += dt * wall_power(s->particles().field(), s->view());
      return AfterStep::proceed;
    });
    Real heat = 0;
    for (const char* term : terms) heat += sum_of_heat(*s, term);
    CHECK(heat > 2);
    CHECK(std::abs(work) > 0.01);
    return std::abs(before + work - energy(*s) - heat) / before;
  };
  Real coarse = 0, fine = 0;
  for (const std::uint64_t seed : {5, 6, 7}) coarse += lost(seed, 1e-3), fine += lost(seed, 1.25e-4);
  CHECK(coarse < 0.02);
  CHECK(fine < 0.3 * coarse);
}

TEST_CASE("disks on a table between walls do the same on any number of ranks, with the same heat", "[ranks]") {
  const Crowd crowd(6, 8, 6);
  const auto alone = crowd.simulation(), shared = crowd.simulation(5e-4, Sorting::regularly, Ranks(PETSC_COMM_WORLD));
  alone->advance(0.1);
  shared->advance(0.1, [&](State& state) {
    if (state.step % 23 != 0) return AfterStep::proceed;
    shared->sort();
    return AfterStep::reordered;
  });
  CHECK(Snapshot<2>(*alone).difference(Snapshot<2>(*shared)) < 1e-9);
  for (const char* term : terms) {
    const auto one = alone->particles().history().of(term).heat(), own = shared->particles().history().of(term).heat();
    for (std::size_t k = 0; k < one.size(); ++k) {
      CHECK(one[k] > 1e-3);
      CHECK(shared->ranks().sum(own[k]) == Approx(one[k]).epsilon(1e-8));
    }
  }
}

TEST_CASE("Runge-Kutta methods go through the beginning of sliding at first order") {
  struct End {
    Real x, angle, heat;
  };
  const auto run = [](Real h, Real until) {
    const PetscOptionScope scope("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
    Configuration<2> c;
    c.add_soft(1, {0, 0});
    c.add_soft(1.4, {0, 1.15});
    c.v = {1, 0, 0, 0};
    const auto s = simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<TsIntegrator>(TsOptions{.dt = h}),
                                    disk_pairs(1000, {.mu_static = 0.4, .mu_dynamic = 0.3}));
    start(*s, c, {0, 0}, {0, 0});
    touch(*s);
    s->advance(until);
    return End{s->state().x()[0], s->angles()[1], s->particles().history().of("disk_contact").heat()[2]};
  };
  CHECK(run(1e-3, 0.01).heat == 0);
  const End exact = run(1e-5, 0.04);
  CHECK(exact.heat > 1e-3);
  const OrderFit fit = fit_order(
      [&](Real h) {
        const End end = run(h, 0.04);
        return std::abs(end.x - exact.x) + std::abs(end.angle - exact.angle) + std::abs(end.heat - exact.heat);
      },
      0.002, 5);
  INFO(fit.text());
  CHECK(fit.errors.front() < 0.02);
  CHECK(fit.errors.back() < 0.15 * fit.errors.front());
  CHECK(fit.slope() > 0.7);
}

TEST_CASE("a table is refused in a periodic box") {
  const auto in_box = [](Real gravity) {
    const BaseFriction base{.gravity = gravity, .mu_static = 0.5, .mu_dynamic = 0.3, .epsilon = 100};
    return ParticleSystem<2>({}, {}, alone<2>(base), 0.1, Ranks(), Box<2>({0, 0}, {5, 5}));
  };
  CHECK_THROWS_AS(in_box(1), InputError);
  CHECK_THROWS_WITH(in_box(1), Catch::Contains("base_friction") && Catch::Contains("open box"));
  CHECK_NOTHROW(in_box(0));  // there is none
}

}  // namespace pliant::test::disk_model_test
