// Contact history, with tangential springs. Cases with the tag work on any number of ranks.
#include <omp.h>
#include <petscsys.h>
#include <catch2/catch.hpp>
#include <cmath>
#include <type_traits>
#include <utility>

#include <pliant/ts/ts_integrator.h>

#include "support/disks.h"
#include "support/order.h"
#include "support/problems.h"

namespace pliant::test::contact_history_test {

namespace {

// A view shows the current history; only a workspace is written to.
template <class Workspace, class Table>
concept writes_next = std::is_constructible_v < ContactWorkspace::Next<2>,
const Table&, Workspace > ;
template <class Workspace>
concept gives_scratch = requires(Workspace w, Range range) {
  w.indices(range);
  w.losses(range);
  w.constants(0);
};
template <class Table>
concept accepts = requires(Table table, ContactWorkspace& w) {
  table.accept(w);
};
using ViewedHistory = std::remove_reference_t<decltype(*StateView<2>::history)>;
using ViewedTable = std::remove_reference_t<decltype(std::declval<ViewedHistory&>().of(""))>;
static_assert(std::is_const_v<ViewedHistory> && std::is_const_v<ViewedTable>);
static_assert(accepts<ContactTable&> && !accepts<ViewedTable&>);
static_assert(writes_next<ContactWorkspace&, ContactTable> && !writes_next<const ContactWorkspace&, ContactTable>);
static_assert(!std::is_constructible_v<ContactWorkspace::Next<2>, ViewedTable&>);
static_assert(gives_scratch<ContactWorkspace&> && !gives_scratch<const ContactWorkspace&>);
static_assert(!gives_scratch<ViewedTable&> && !gives_scratch<ContactTable&>);

constexpr Real epsilon = 1000, k_t = 400, mu = 0.4;

/// Constant force on all particles.
struct Push {
  pliant::Vec<2> force;
  static constexpr Elements elements = Elements::points;
  static std::string_view name() { return "push"; }
  bool enabled(const StateView<2>&) const { return true; }
  Real energy(const StateView<2>& s, Index i) const { return -force.dot(s.position(i)); }
  template <class G>
  void add_gradient(const StateView<2>&, Index i, G& grad) const {
    grad.add(i, pliant::Vec<2>(-force));
  }
  void add_hessian(const StateView<2>&, Index, BlockSink<2>&) const {}
  Real max_rate(const Topology&) const { return 0; }
};

std::unique_ptr<Simulation<2>> frictional(const Configuration<2>& c, std::unique_ptr<Integrator> by, Sorting sorting,
                                          const Ranks& ranks = Ranks(), pliant::Vec<2> push = {0, 0}) {
  return simulation_of<2>(c, sorting, ranks, std::move(by), PairContact<2>{epsilon, "pair"},
                          TangentialSpring{k_t, mu, epsilon}, WallContact<2>{epsilon}, WallSpring{k_t, mu, epsilon},
                          Push{push});
}
std::unique_ptr<Simulation<2>> frictional(const Configuration<2>& c, Sorting sorting = Sorting::never,
                                          const Ranks& ranks = Ranks(), pliant::Vec<2> push = {0, 0}) {
  return frictional(c, std::make_unique<FixedStepVerlet>(1e-3), sorting, ranks, push);
}

Configuration<2> two_disks(Real overlap) {
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  c.add_soft(1.4, {0, 1.2 * (1 - overlap)});
  return c;
}

/// Contacts of a term.
std::size_t contacts(const Simulation<2>& s, std::string_view term = "tangential") {
  return s.particles().history().of(term).contacts().keys.size();
}

/// Torques on the particles of a trial state.
std::vector<Real> torques(Simulation<2>& s, const std::vector<Real>& x) {
  std::vector<Real> f(x.size());
  s.particles().field().forces(s.particles().view(x.data(), s.state().v().data()), f.data());
  const auto own = s.particles().rotations_in(std::span(f));
  return {own.begin(), own.end()};
}
void accept(Simulation<2>& s, const std::vector<Real>& x) {
  s.particles().accepted(0, x.data(), s.state().v().data(), 1e-3);
}

/// A block of disks that fall on a floor, spinning.
struct Pile {
  Configuration<2> c;
  std::vector<Real> angles, spins;
  Pile(Random& random, Index columns, Index rows) : c(soft_rows<2>(random, columns, rows)) {
    c.walls = Walls<2>({WallSegment::between({-Real(columns), 0}, {Real(columns), 0})});
    angles.assign(static_cast<std::size_t>(c.topology.particles()), 0);
    spins = random_numbers(random, angles.size(), 3);
  }
  std::unique_ptr<Simulation<2>> simulation(Sorting sorting = Sorting::never, const Ranks& ranks = Ranks()) const {
    auto s = frictional(c, sorting, ranks, {0, -1});
    start(*s, c, angles, spins);
    return s;
  }
};

/// Both histories, of all ranks: sorted, and the number of entries that differ from their twins on another rank.
struct AllContacts {
  std::vector<ContactKey> keys;
  std::vector<Real> values;
  Index different = 0, twice = 0;
  AllContacts(const Simulation<2>& s, std::string_view term) {
    const StoredContacts own = s.particles().history().of(term).contacts();
    const auto all_keys = s.ranks().all_gather(own.keys);
    const auto all_values = s.ranks().all_gather(own.values);
    std::vector<std::size_t> order(all_keys.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](auto a, auto b) { return all_keys[a] < all_keys[b]; });
    for (const std::size_t k : order) {
      if (!keys.empty() && keys.back() == all_keys[k]) {
        ++twice;
        different += all_values[2 * k] != values[values.size() - 2] || all_values[2 * k + 1] != values.back();
        continue;
      }
      keys.push_back(all_keys[k]);
      values.insert(values.end(), {all_values[2 * k], all_values[2 * k + 1]});
    }
  }
};

}  // namespace

TEST_CASE("a table of contacts follows its list") {
  ContactTable table({"test", Elements::point_pairs, 2});
  ContactWorkspace workspace(table.needs());
  const auto list = [&](const std::vector<ContactKey>& keys) {
    table.assign(keys);
    workspace.follow(table);
  };
  list({{1, 2}, {3, 4}, {1, 2}, {5, 6}});
  CHECK(table.current(0).empty());
  // A step after which these elements touch, with these numbers.
  const auto step = [&](Index size, const std::vector<std::pair<Index, Real>>& touching) {
    const ContactWorkspace::Next<2> next(table, workspace);
    next.clear(Range{0, size});
    for (const auto& [e, number] : touching) {
      Real* const numbers = next.set(e);
      CHECK(numbers[0] == 0);
      numbers[0] = number;
    }
    table.accept(workspace);
  };
  step(4, {{0, 7}, {2, 7}, {3, 8}});
  CHECK(table.contacts().keys == std::vector<ContactKey>{{1, 2}, {5, 6}});
  CHECK(table.contacts().values == std::vector<Real>{7, 0, 8, 0});

  // A list for a trial state lacks a contact, which is there again when the trial is rejected.
  list({{5, 6}, {8, 9}});
  CHECK(table.current(0)[0] == 8);
  CHECK(table.current(1).empty());
  list({{3, 4}, {1, 2}});
  CHECK(table.current(0).empty());
  CHECK(table.current(1)[0] == 7);
  // An accepted one ends it.
  step(2, {{1, 7}});
  CHECK(table.contacts().keys == std::vector<ContactKey>{{1, 2}});
  // Evaluations without an accepted step change nothing.
  ContactWorkspace::Next<2>(table, workspace).set(0)[0] = 9;
  CHECK(table.contacts().keys == std::vector<ContactKey>{{1, 2}});
  step(2, {});
  CHECK(table.contacts().keys.empty());
  CHECK(table.current(1).empty());

  // A particle moved to another place has new contacts, listed or not.
  list({{3, 4}, {1, 2}, {7, 8}});
  step(3, {{0, 4}, {1, 3}, {2, 5}});
  list({{1, 2}, {2, 3}, {7, 8}});
  table.forget(3);
  table.forget(2);
  CHECK(table.current(0).empty());
  CHECK(table.contacts().keys == std::vector<ContactKey>{{7, 8}});
  step(3, {{0, 6}, {2, 5}});
  CHECK(table.current(0)[0] == 6);
  CHECK(table.current(2)[0] == 5);

  CHECK_THROWS_AS(ContactHistory({{"a", Elements::walls, 1}, {"a", Elements::point_pairs, 1}}), std::logic_error);
  CHECK_THROWS_AS(ContactHistory({{"a", Elements::vertex_edges, 1}}), std::logic_error);
  CHECK_NOTHROW(ContactHistory({{"a", Elements::points, 1}}));
}

TEST_CASE("a particle that is moved to another place has no history in any table") {
  ContactHistory history({{"pairs", Elements::point_pairs, 1}, {"walls", Elements::walls, 1}});
  for (const char* const name : {"pairs", "walls"}) {
    StoredContacts contacts;
    contacts.add({2, 3}, std::vector<Real>{1});
    contacts.add({4, 5}, std::vector<Real>{2});
    history.set(name, contacts);
  }
  history.forget(2);
  for (const char* const name : {"pairs", "walls"})
    CHECK(history.of(name).contacts().keys == std::vector<ContactKey>{{4, 5}});
}

TEST_CASE("parts of walls that are one surface have one contact with a point") {
  ContactTable table({"test", Elements::walls, 1});
  ContactWorkspace workspace(table.needs());
  // The current history of touching elements, which is counted up.
  const auto step = [&](const std::vector<Index>& touching) {
    std::vector<Real> before;
    const ContactWorkspace::Next<1, true> next(table, workspace);
    next.clear(Range{0, 3});
    for (const Index e : touching) {
      before.push_back(table.current(e).empty() ? 0 : table.current(e)[0]);
      *next.set(e) = before.back() + 1;
    }
    table.accept(workspace);
    return before;
  };
  table.assign({{1, 5}, {1, 7}, {1, 5}});  // elements 0 and 2 are of surface 5
  workspace.follow(table);
  CHECK(step({0}) == std::vector<Real>{0});
  CHECK(step({2}) == std::vector<Real>{1});  // the contact has moved to the other part
  CHECK(table.current(0)[0] == 2);
  CHECK(table.current(2)[0] == 2);
  CHECK(table.current(1).empty());
  table.assign({{1, 7}, {1, 5}, {1, 5}});
  workspace.follow(table);
  CHECK(step({1}) == std::vector<Real>{2});
  CHECK(table.contacts().keys == std::vector<ContactKey>{{1, 5}});
  CHECK(step({}).empty());
  CHECK(table.current(1).empty());
  CHECK(step({2}) == std::vector<Real>{0});
}

TEST_CASE("a tangential spring sticks, slides and releases") {
  const auto s = frictional(two_disks(0.02));
  start(*s, two_disks(0.02), {0, 0}, {0, 0});
  std::vector<Real> x(s->state().x().begin(), s->state().x().end());
  const Real normal = epsilon / 1.2 * 0.02, limit = mu * normal;
  CHECK(contacts(*s) == 0);
  CHECK(torques(*s, x) == std::vector<Real>{0, 0});
  accept(*s, x);
  REQUIRE(contacts(*s) == 1);
  // Turned: k R θ, up to μN.
  bool slid = false;
  for (int step = 1; step <= 60; ++step) {
    x[4] = 0.002 * step;
    const Real expected = std::min(k_t * 0.5 * x[4], limit);
    for (int again = 0; again < 2; ++again) {  // advancing changes no force
      const std::vector<Real> turn = torques(*s, x);
      CHECK(turn[0] == Approx(-0.5 * expected).epsilon(1e-9));
      CHECK(turn[1] == Approx(-0.7 * expected).epsilon(1e-9));
      accept(*s, x);
    }
    slid |= expected == limit;
  }
  CHECK(slid);
  // Back: along the spring at once, down to −μN.
  const Real top = x[4];
  x[4] = top - 0.01;
  CHECK(torques(*s, x)[0] == Approx(-0.5 * (limit - k_t * 0.5 * 0.01)));
  x[4] = top - 1;
  CHECK(torques(*s, x)[0] == Approx(0.5 * limit));
  x[4] = top;
  CHECK(torques(*s, x)[0] == Approx(-0.5 * limit));  // nothing of this was accepted
  // Apart, far beyond the list, and back: without a step in between it is the same contact, after one it is new.
  const Real y = x[3];
  x[3] = 10;
  CHECK(torques(*s, x) == std::vector<Real>{0, 0});
  x[3] = y;
  CHECK(torques(*s, x)[0] == Approx(-0.5 * limit));
  x[3] = 10;
  accept(*s, x);
  CHECK(contacts(*s) == 0);
  x[3] = y;
  CHECK(torques(*s, x) == std::vector<Real>{0, 0});
  accept(*s, x);
  CHECK(torques(*s, x) == std::vector<Real>{0, 0});
  CHECK(contacts(*s) == 1);
}

TEST_CASE("a disk that slides on a floor comes to roll at 2/3 of its velocity") {
  const auto slide = [](std::unique_ptr<Integrator> by) {
    Configuration<2> c;
    c.walls = Walls<2>({WallSegment::between({-5, 0}, {50, 0})});
    constexpr Real weight = 4, depth = weight * 0.25 / epsilon;  // at rest: ε/R (1 − d/R) = weight
    c.add_soft(1, {0, 0.5 - depth});
    c.v = {1, 0};
    const Real mass = c.topology.point_mass[0], rolls_at = mass / (3 * mu * weight);
    const auto s = frictional(c, std::move(by), Sorting::never, Ranks(), {0, -weight});
    start(*s, c, {0}, {0});
    s->advance(0.9 * rolls_at);
    const auto slip = [&] { return s->state().v()[0] + 0.5 * s->spins()[0]; };
    CHECK(slip() == Approx(0.1).margin(0.025));  // sliding begins when the spring is stretched
    s->advance(3 * rolls_at);
    // The sphere starts rolling with a stretched spring, and oscillates about the rolling motion.
    Real sum = 0, most = 0;
    int count = 0;
    s->advance(s->state().t + 2, [&](State& state) {
      sum += state.v()[0];
      most = std::max(most, std::abs(slip()));
      ++count;
      return AfterStep::proceed;
    });
    CHECK(sum / count == Approx(2.0 / 3).epsilon(0.01));
    const Real swing = std::sqrt(k_t * (1 / mass + 0.25 / c.topology.inertia[0])) * mu * weight / k_t;
    CHECK(most == Approx(swing).epsilon(0.02));
    CHECK(contacts(*s, "wall_tangential") == 1);
  };
  slide(std::make_unique<FixedStepVerlet>(1e-3));
  const PetscOptionScope scope(
      "-ts_type rk -ts_rk_type 5dp -ts_adapt_type basic -ts_rtol 1e-5 -ts_atol 1e-6 -ts_adapt_dt_max 2e-3");
  slide(std::make_unique<TsIntegrator>());
}

TEST_CASE("a contact that sticks is integrated at the order of the method") {
  // A disk held to the floor by a spring swings about the place where it touched: q = x + R θ, q̈ = −k (1/m + R²/I) q.
  const auto error = [](std::unique_ptr<Integrator> by) {
    Configuration<2> c;
    c.walls = Walls<2>({WallSegment::between({-5, 0}, {5, 0})});
    constexpr Real weight = 40, depth = weight * 0.25 / epsilon;
    c.add_soft(1, {0, 0.5 - depth});
    c.v = {0.1, 0};
    const auto s = frictional(c, std::move(by), Sorting::never, Ranks(), {0, -weight});
    start(*s, c, {0}, {0});
    s->particles().accepted(0, s->state().x().data(), s->state().v().data(), 0);  // the particles touch already
    s->advance(0.4);
    const Real m = c.topology.point_mass[0], omega = std::sqrt(k_t * (1 / m + 0.25 / c.topology.inertia[0])), t = 0.4,
               q = 0.1 / omega * std::sin(omega * t);
    // x moves with the mean and swings by a third of q.
    const Real x = 0.1 * t * 2 / 3 + q / 3;
    CHECK(mu * weight > k_t * 0.1 / omega);
    return std::abs(s->state().x()[0] - x) + std::abs(s->state().x()[0] + 0.5 * s->angles()[0] - q);
  };
  require_order(
      "Verlet", [&](Real h) { return error(std::make_unique<FixedStepVerlet>(h)); }, 0.004, 2);
  const PetscOptionScope scope("-ts_type rk -ts_rk_type 4 -ts_adapt_type none");
  require_order(
      "RK 4", [&](Real h) { return error(std::make_unique<TsIntegrator>(TsOptions{.dt = h})); }, 0.01, 4);
}

TEST_CASE("energy that is lost is the heat of sliding") {
  const auto lost = [](Real h) {
    Configuration<2> c;
    c.walls = Walls<2>({WallSegment::between({-5, 0}, {50, 0})});
    constexpr Real weight = 4;
    c.add_soft(1, {0, 0.5 - weight * 0.25 / epsilon});
    c.v = {1, 0};
    const auto s = frictional(c, std::make_unique<FixedStepVerlet>(h), Sorting::never, Ranks(), {0, -weight});
    start(*s, c, {0}, {0});
    const auto energy = [&] {
      const StateView<2> view = s->view();
      return kinetic_energy(view) + s->particles().field().energy(view);
    };
    const Real before = energy();
    s->advance(1);
    REQUIRE(contacts(*s, "wall_tangential") == 1);
    const Real heat = s->particles().history().of("wall_tangential").contacts().values[1];
    // A third of the kinetic energy, less the energy of the oscillating spring.
    CHECK(heat == Approx(c.topology.point_mass[0] / 6 - square(mu * weight) / (2 * k_t)).epsilon(0.01));
    return std::abs(before - energy() - heat);
  };
  CHECK(lost(1e-3) < 2e-3);
  CHECK(lost(2.5e-4) < 0.5 * lost(1e-3));
}

TEST_CASE("forces that are computed for output leave the next history as it is") {
  Random random(4);
  const auto s = Pile(random, 8, 6).simulation();
  for (Real t = 0.2; contacts(*s) < 5 && t < 2; t += 0.02) s->advance(t);
  const ForceField<2>& field = s->particles().field();
  const Real h = 1e-3;
  const auto after_step = [&](bool output) {
    ContactHistory history = s->particles().history();
    HistoryWorkspace workspace(history);
    StateView<2> view = s->view();
    REQUIRE(history.follow(view.topology, view.walls, view.neighbours) == false);
    workspace.follow(history);
    view.history = &history;
    std::vector<Real> a(s->state().size()), x(view.x, view.x + 2 * static_cast<std::size_t>(view.topology.points()));
    field.accelerations(view, a.data(), &workspace);
    if (output) {
      for (std::size_t k = 0; k < x.size(); ++k) x[k] *= 1 + 1e-3 * std::sin(Real(k));
      StateView<2> elsewhere = view;
      elsewhere.x = x.data();
      std::vector<Real> f(a.size()), g(a.size());
      field.forces(elsewhere, f.data());
      CHECK(f != a);
      field.accelerations(elsewhere, g.data());
      field.group_accelerations(elsewhere, TermGroup::all, g.data());
      field.force_of({"tangential"}, elsewhere, g.data());
      CHECK(field.report(elsewhere).size() >= 4);
      CHECK(field.energy(elsewhere, g.data()) > 0);
      CHECK(field.power(elsewhere) >= 0);
    }
    field.accept(view, h, history, workspace, true);
    const ContactTable& table = history.of("tangential");
    return std::pair(table.contacts(), std::vector<Real>(table.heat().begin(), table.heat().end()));
  };
  const auto [plain, heat] = after_step(false);
  const auto [watched, watched_heat] = after_step(true);
  CHECK(plain.keys.size() > 4);
  CHECK(plain.values != s->particles().history().of("tangential").contacts().values);
  CHECK(watched.keys == plain.keys);
  CHECK(watched.values == plain.values);
  CHECK(watched_heat == heat);
}

TEST_CASE("histories on ranks are the same on both sides, and those of one rank", "[ranks]") {
  Random random(1);
  const Pile pile(random, 12, 10);
  const auto alone = pile.simulation(), shared = pile.simulation(Sorting::regularly, Ranks(PETSC_COMM_WORLD));
  alone->advance(0.3);
  shared->advance(0.3, [&](State& state) {
    if (state.step % 37 != 0) return AfterStep::proceed;
    shared->sort();
    return AfterStep::reordered;
  });
  CHECK(Snapshot<2>(*alone).difference(Snapshot<2>(*shared)) < 1e-8);
  CHECK(alone->particles().neighbours().rebuilds() >= 3);
  for (const std::string_view term : {"tangential", "wall_tangential"}) {
    INFO(std::string(term));
    const AllContacts one(*alone, term), many(*shared, term);
    CHECK(one.keys.size() > 3);
    CHECK(one.keys == many.keys);
    for (std::size_t k = 0; k < one.values.size(); ++k) CHECK(one.values[k] == Approx(many.values[k]).margin(1e-7));
    CHECK(*std::ranges::max_element(one.values) > 1e-3);
    CHECK(many.different == 0);
    if (shared->ranks().several() && term == "tangential") CHECK(many.twice > 1);
    const AllContacts before(*shared, term);
    shared->sort();
    const AllContacts sorted(*shared, term);
    CHECK(sorted.keys == before.keys);
    CHECK(sorted.values == before.values);
    CHECK(sorted.different == 0);
  }
}

TEST_CASE("rebuilding and sorting at every step changes no bit of a history") {
  // Isolated pairs: sums of one force do not depend on the order of the list.
  Random random(2);
  Configuration<2> c;
  std::vector<Real> spins;
  for (int pair = 0; pair < 30; ++pair) {
    const pliant::Vec<2> at(random(-100, 100), 10 * pair), to(random(-0.2, 0.2), 1);
    c.add_soft(1, at);
    c.add_soft(1.1, at + 1.04 * to.normalized());
    c.v.resize(c.v.size() - 4);
    for (const Real toward : {0.5, -0.5}) c.v.insert(c.v.end(), {0, toward});
    for (int k = 0; k < 2; ++k) spins.push_back(random(-3, 3));
  }
  const auto run = [&](bool disturb) {
    auto s = frictional(c, Sorting::never);
    start(*s, c, std::vector<Real>(spins.size(), 0), spins);
    s->advance(0.03, [&](State& state) {
      if (!disturb) return AfterStep::proceed;
      s->particles().rebuild(state.x().data());
      s->sort();
      return AfterStep::reordered;
    });
    return s;
  };
  const auto calm = run(false), disturbed = run(true);
  CHECK(Snapshot<2>(*calm) == Snapshot<2>(*disturbed));
  const StoredContacts a = calm->particles().history().of("tangential").contacts(),
                       b = disturbed->particles().history().of("tangential").contacts();
  CHECK(a.keys.size() > 10);
  CHECK(a.keys == b.keys);
  CHECK(a.values == b.values);
  CHECK(disturbed->particles().neighbours().rebuilds() > 50);
  CHECK(!std::ranges::is_sorted(disturbed->topology().id));
}

TEST_CASE("a contact across the border of a periodic box is like any other", "[ranks]") {
  Configuration<2> c;
  c.add_soft(1, {0.02, 0.3});
  c.add_soft(1.1, {-0.99, 0.2});
  c.v = {-0.6, 0, 0, 0.1};
  const auto run = [&](const Box<2>& box, const Ranks& ranks) {
    auto s = std::make_unique<Simulation<2>>(
        c.topology,
        ParticleSystem<2>({}, {}, alone<2>(PairContact<2>{epsilon, "pair"}, TangentialSpring{k_t, mu, epsilon}), 0.05,
                          ranks, box),
        Sorting::never);
    s->set_integrator(std::make_unique<FixedStepVerlet>(1e-3));
    start(*s, c, {0, 0}, {2, -1});
    s->advance(0.04, [&](State& state) {
      if (box.open() || state.step % 10 != 0) return AfterStep::proceed;
      s->sort();  // wraps them into the box
      return AfterStep::reordered;
    });
    return s;
  };
  const auto open = run({}, Ranks()), periodic = run(Box<2>({0, 0}, {5, 6}), Ranks(PETSC_COMM_WORLD));
  const Snapshot<2> a(*open), b(*periodic);
  CHECK(std::abs(b.x[2] - a.x[2] - 5) < 1e-10);
  CHECK(std::abs(a.spins[0] - 2) > 0.01);
  for (int m = 0; m < 2; ++m) {
    CHECK(b.spins[m] == Approx(a.spins[m]).margin(1e-10));
    CHECK(b.angles[m] == Approx(a.angles[m]).margin(1e-10));
    CHECK(b.v[2 * m] == Approx(a.v[2 * m]).margin(1e-10));
  }
  const AllContacts one(*open, "tangential"), other(*periodic, "tangential");
  CHECK(one.keys.size() == 1);
  CHECK(one.keys == other.keys);
  CHECK(one.values[1] > 1e-4);
  CHECK(other.values[1] == Approx(one.values[1]).margin(1e-10));
}

TEST_CASE("threads change no bit of a history") {
  Random random(3);
  const Pile pile(random, 60, 80);
  const auto run = [&](int threads) {
    const int before = omp_get_max_threads();
    omp_set_num_threads(threads);
    auto s = pile.simulation(Sorting::at_start);
    s->advance(0.02);
    omp_set_num_threads(before);
    return s;
  };
  const auto one = run(1), two = run(2);
  REQUIRE(one->particles().neighbours().chunks() > 2);
  REQUIRE(one->particles().neighbours().point_pairs.across(0).size() > 5);
  CHECK(Snapshot<2>(*one) == Snapshot<2>(*two));
  const AllContacts a(*one, "tangential"), b(*two, "tangential");
  CHECK(a.keys.size() > 1000);
  CHECK(a.keys == b.keys);
  CHECK(a.values == b.values);
}

}  // namespace pliant::test::contact_history_test
