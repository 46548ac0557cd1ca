// Spheres that collide and roll with friction. Cases with the tag work on any number of ranks.
#include <petscsys.h>

#include <Eigen/Geometry>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include <pliant/model/sphere_contact.h>
#include <pliant/model/sphere_wall_contact.h>

#include "support/frictional.h"
#include "support/order.h"

namespace pliant::test::sphere_contact_test {

namespace {

using Vector = pliant::Vec<3>;
using Matrix = pliant::Mat<3>;

constexpr Real epsilon = 1000;
constexpr SurfaceFriction rough{.mu_static = 0.5, .mu_dynamic = 0.4, .damping = 0.1};

auto ball_pairs(const SurfaceFriction& surface, ContactLaw law = ContactLaw::harmonic) {
  return Fused<DiskKernel, PairContact<3>, SphereContact>(PairContact<3>{epsilon, "pair", law},
                                                          SphereContact{epsilon, surface, law});
}

struct Weight {
  Vector g;
  static constexpr Elements elements = Elements::points;
  static std::string_view name() { return "weight"; }
  bool enabled(const StateView<3>&) const { return true; }
  Real energy(const StateView<3>& s, Index i) const { return -s.topology.mass(i) * g.dot(s.position(i)); }
  template <class G>
  void add_gradient(const StateView<3>& s, Index i, G& grad) const {
    grad.add(i, Vector(-s.topology.mass(i) * g));
  }
  void add_hessian(const StateView<3>&, Index, BlockSink<3>&) const {}
  Real max_rate(const Topology&) const { return 0; }
};

Vector at(std::span<const Real> values, Index i) { return point<3>(values.data(), i); }

/// Two that begin to touch: the second one is at rest. Turned as a whole, and moving.
struct Collision {
  Vector v, spin;

  std::unique_ptr<Simulation<3>> simulation(const Matrix& turn = Matrix::Identity(),
                                            const Vector& drift = Vector::Zero()) const {
    Configuration<3> c;
    c.add_soft(1, Vector::Zero());
    c.add_soft(1.4, turn * Vector(0, 1.2 + 1e-9, 0));
    const Vector w = turn * v + drift, s = turn * spin;
    c.v = {w[0], w[1], w[2], drift[0], drift[1], drift[2]};
    auto run = simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(2e-4), ball_pairs(rough));
    start(*run, c, std::vector<Real>(6), {s[0], s[1], s[2], 0, 0, 0});
    run->advance(0.2);
    CHECK(run->particles().history().of("sphere_contact").contacts().keys.empty());
    return run;
  }
};

/// Any rotation.
Matrix tilt() { return Eigen::AngleAxis<Real>(2.1, Vector(1, -2, 0.5).normalized()).toRotationMatrix(); }

struct Crowd {
  Configuration<3> c;
  std::vector<Real> angles, spins;
  explicit Crowd(std::uint64_t seed, bool walls = true, Index columns = 4, Index rows = 3) {
    Random random(seed);
    c = soft_rows<3>(random, columns, rows);
    if (!walls) c.walls = Walls<3>();
    angles.assign(static_cast<std::size_t>(c.topology.particles()) * 3, 0);
    spins = random_numbers(random, angles.size(), 3);
  }
  std::unique_ptr<Simulation<3>> simulation(Real dt = 5e-4, Sorting sorting = Sorting::never,
                                            const Ranks& ranks = Ranks()) const {
    auto s = simulation_of<3>(c, sorting, ranks, std::make_unique<FixedStepVerlet>(dt), ball_pairs(rough),
                              WallContact<3>{epsilon}, SphereWallContact{epsilon, rough});
    start(*s, c, angles, spins);
    s->particles().accepted(0, s->state().x().data(), s->state().v().data(), 0);
    return s;
  }
};

Real total_energy(Simulation<3>& s) {
  const StateView<3> view = s.view();
  return kinetic_energy(view) + s.particles().field().energy(view);
}
Real heat_of(const Simulation<3>& s, std::string_view term) {
  Real sum = 0;
  for (const Real heat : s.particles().history().of(term).heat()) sum += heat;
  return sum;
}

}  // namespace

namespace {

/// The full law of two spheres: force and torque on the first, in list order, the next history, and the losses.
struct WholeLaw {
  Vector force, torque_first, torque_second;
  std::array<Real, SphereContact::history> kept;
  std::array<Real, 3> lost;

  WholeLaw(const StateView<3>& s, Index e, const Overlap& law, const SurfaceFriction& f, std::span<const Real> past) {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Topology& t = s.topology;
    const Vector r = s.position(i) - s.position(j), v = s.velocity(i) - s.velocity(j);
    const Real d = r.norm(), a = t.diameter[i] / 2, b = t.diameter[j] / 2, lever = law.delta / d;
    const Vector n = r / d, turn_i = point<3>(s.turns, i), turn_j = point<3>(s.turns, j);
    const Real order = t.id[i] > t.id[j] ? -1 : 1, stiffness = law.curvature(d),
               k = f.stiffness * law.curvature(0.99 * law.delta),
               gamma = 2 * f.damping * std::sqrt(stiffness / (1 / t.mass(i) + 1 / t.mass(j)));
    Vector before = Vector::Zero(), spring = before;
    bool slid = false;
    if (!past.empty()) {
      const Vector n0 = order * at(past, 0), middle = (n0 + n).normalized();
      const Matrix up = turn(n0, middle), down = turn(middle, n),
                   twist = Eigen::AngleAxis<Real>(middle.dot(turn_i + turn_j) / 4, middle).toRotationMatrix();
      const Real half = (n - n0).norm() / 2;
      const Vector arc = half > 0 ? Vector(std::asin(half) / half * (n - n0)) : Vector(Vector::Zero());
      before = down * twist * twist * up * (order * at(past, 1));
      spring = before + down * twist * (law.delta * arc - (a * turn_i + b * turn_j).cross(middle));
      slid = past[6] != 0;
    }
    const Vector stretched = spring;
    const Real parting = n.dot(v), normal = std::max(-law.slope(d) - gamma * parting, 0.0), limit = normal / lever,
               longest = (slid ? f.mu_dynamic : f.mu_static) * limit;
    const Vector rate = lever * (v - parting * n) - (a * s.spin(i) + b * s.spin(j)).cross(n);
    const bool slides = k * spring.norm() > longest;
    if (slides) spring *= f.mu_dynamic * limit / (k * spring.norm());
    const Real most = slides ? f.mu_dynamic * limit : longest;
    Vector pull = k * spring + f.tangential_damping * gamma * rate;
    if (pull.norm() > most) pull *= most / pull.norm();
    force = normal * n - lever * pull;
    torque_first = a * n.cross(pull), torque_second = b * n.cross(pull);
    lost = {(-law.slope(d) - normal) * parting, (pull - k * spring).dot(rate),
            k / 2 * (before + spring).dot(stretched - spring)};
    const std::array<Vector, 2> numbers{order * n, order * spring};
    for (std::size_t m = 0; m < 6; ++m) kept[m] = numbers[m / 3][static_cast<Index>(m % 3)];
    kept[6] = slides ? 1 : 0;
  }

 private:
  static Matrix turn(const Vector& from, const Vector& to) {
    return Eigen::Quaternion<Real>::FromTwoVectors(from, to).toRotationMatrix();
  }
};

}  // namespace

TEST_CASE("balls four at a time have the forces of each by itself bit for bit, and the law of two balls") {
  const SurfaceFriction weak{.mu_static = 0.1, .mu_dynamic = 0.05, .damping = 0.1};
  Index some = 0, slide = 0, hold = 0, fresh = 0, ended = 0;
  const auto check = [&](const Crowd& crowd, const SurfaceFriction& surface, ContactLaw kind, bool own_only, Real h) {
    const auto s = simulation_of<3>(crowd.c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(5e-4),
                                    ball_pairs(surface, kind));
    start(*s, crowd.c, crowd.angles, crowd.spins);
    s->particles().accepted(0, s->state().x().data(), s->state().v().data(), 0);
    s->advance(0.02);
    // A large step by hand: contacts end, begin, slide and turn far.
    std::vector<Real> x(s->state().x().begin(), s->state().x().end()), v(s->state().v().begin(), s->state().v().end());
    std::vector<Real> moved = x;
    for (std::size_t k = 0; k < x.size(); ++k) moved[k] += h * v[k];
    const StateView<3> view = s->particles().view(moved.data(), v.data());
    const SphereContact term{epsilon, surface, kind};
    const ContactTable& table = view.history->of(term.name());
    ContactWorkspace workspace(table.needs());
    workspace.follow(table);
    const ContactWorkspace::Next<SphereContact::history> next(table, workspace);
    const PairList& list = view.neighbours.point_pairs;
    const Index points = view.topology.owned_points();
    const Range all = list.inside(0), own{0, own_only ? points / 2 : points};
    std::vector<Real> found(x.size()), single(x.size()), whole(x.size());
    next.set(all);  // by an earlier evaluation
    std::array<Real, 3> lost{};
    Real largest = 0, most = 0;
    const auto into = [&](std::vector<Real>& f) {
      return Scatter<3, 1, true>{f.data(), own, f.data() + 3 * static_cast<std::size_t>(points)};
    };
    if (own_only)
      term.add_forces(view, all, table, workspace, into(found));
    else
      term.add_forces(view, all, table, workspace, Scatter<3, 1>{found.data(), {}, into(found).torques});
    const auto one = into(single), full = into(whole);
    Index touching = 0;
    SphereContact::Touch c{};
    for (Index e = all.first; e < all.last; ++e) {
      const bool touches = term.find(view, e, table.current(e), c);
      CHECK(next.touches(e) == touches);
      if (!touches) {
        ended += table.current(e).empty() ? 0 : 1;
        continue;
      }
      ++touching;
      term.add_force(view, c, one);
      const WholeLaw law(view, e, Overlap{kind, epsilon, list.reach[e]}, surface, table.current(e));
      const auto [i, j] = list[e];
      const Vector elastic =
          -Overlap{kind, epsilon, list.reach[e]}.slope((view.position(i) - view.position(j)).norm()) *
          (view.position(i) - view.position(j)).normalized();
      full.add(i, Vector(law.force - elastic)), full.add(j, Vector(elastic - law.force));
      full.add_torque(i, law.torque_first), full.add_torque(j, law.torque_second);
      const Real* const kept = next.set(e);
      for (std::size_t k = 0; k < law.kept.size(); ++k) CHECK(std::abs(kept[k] - law.kept[k]) < 1e-12);
      if (!own_only || one.counts<Elements::point_pairs>(view, e))
        for (std::size_t k = 0; k < 3; ++k) lost[k] += law.lost[k];
      (kept[6] != 0 ? slide : hold) += 1;
      fresh += table.current(e).empty() ? 1 : 0;
    }
    some += touching % 4;
    CHECK(all.size() > 64);  // which are searched at once
    CHECK(touching > 32);    // which are computed at once
    CHECK(found == single);
    for (std::size_t k = 0; k < found.size(); ++k) {
      most = std::max(most, std::abs(found[k] - whole[k]));
      largest = std::max(largest, std::abs(found[k]));
    }
    CHECK(most < 1e-12 * largest);
    for (std::size_t k = 0; k < 3; ++k) CHECK(workspace.losses(all)[k] == Approx(lost[k]).epsilon(1e-11));
  };
  for (const std::uint64_t seed : {1, 2, 3})
    for (const bool own_only : {false, true})
      for (const Real h : {5e-4, 0.02}) {
        const Crowd crowd(seed, false, 5, 4);
        check(crowd, rough, ContactLaw::harmonic, own_only, h);
        check(crowd, weak, ContactLaw::harmonic, own_only, h);
        check(crowd, rough, ContactLaw::hertz, own_only, h);
        check(crowd, rough, ContactLaw::spring, own_only, h);
      }
  CHECK(some > 3);
  CHECK(slide > 20);
  CHECK(hold > 20);
  CHECK(fresh > 0);
  CHECK(ended > 0);
}

TEST_CASE("the one kernel for balls is the sum of the terms") {
  const auto s = Crowd(8).simulation();
  s->advance(0.05);
  const StateView<3> view = s->view();
  std::vector<Real> all(s->state().size()), sum(all.size());
  s->particles().field().forces(view, all.data());
  for (const TermReport& r : s->particles().field().report(view))
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += r.force[k];
  Real most = 0, largest = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    most = std::max(most, std::abs(all[k] - sum[k]));
    largest = std::max(largest, std::abs(all[k]));
  }
  CHECK(most < 1e-12 * largest);
}

TEST_CASE("balls that collide in a plane, whichever it is, do what disks of their inertia do") {
  const Collision plane{{0.8, 1, 0}, {0, 0, 1.5}};
  Configuration<2> c;
  c.add_soft(1, {0, 0});
  c.add_soft(1.4, {0, 1.2 + 1e-9});
  c.v = {0.8, 1, 0, 0};
  for (const Index m : {0, 1})
    c.topology.set_inertia(m, 0.4 * c.topology.point_mass[m] * square(c.topology.diameter[m] / 2));
  const auto disks =
      simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(2e-4), disk_pairs(epsilon, rough));
  start(*disks, c, {0, 0}, {1.5, 0});
  disks->advance(0.2);
  CHECK(std::abs(disks->spins()[0] - 1.5) > 0.1);
  for (const Matrix& turn : {Matrix(Matrix::Identity()), tilt()}) {
    const auto balls = plane.simulation(turn, {3, -5, 2});
    for (const Index m : {0, 1}) {
      const Vector v = turn.transpose() * (at(balls->state().v(), m) - Vector(3, -5, 2)),
                   w = turn.transpose() * at(balls->spins(), m);
      CHECK((v.head<2>() - point<2>(disks->state().v().data(), m)).norm() < 1e-9);
      CHECK(std::abs(v[2]) < 1e-9);
      CHECK(w.head<2>().norm() < 1e-9);
      CHECK(w[2] == Approx(disks->spins()[m]).margin(1e-9));
    }
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(balls->particles().history().of("sphere_contact").heat()[k] ==
            Approx(disks->particles().history().of("disk_contact").heat()[k]).epsilon(1e-8));
  }
}

TEST_CASE("collisions of balls do not depend on direction or a common velocity") {
  const Collision skew{{0.5, 1, -0.7}, {1, 4, -2}};
  const auto plain = skew.simulation(), moved = skew.simulation(tilt(), {-2, 7, 1});
  for (const Index m : {0, 1}) {
    CHECK((tilt() * at(plain->state().v(), m) + Vector(-2, 7, 1) - at(moved->state().v(), m)).norm() < 1e-9);
    CHECK((tilt() * at(plain->spins(), m) - at(moved->spins(), m)).norm() < 1e-9);
    CHECK(at(plain->spins(), m).norm() > 0.3);
  }
}

TEST_CASE("balls that stick to each other are integrated at second order, however they twist and roll") {
  const auto run = [](Real dt) {
    Configuration<3> c;
    c.add_soft(1, Vector::Zero());
    c.add_soft(1.4, {0, 1.15, 0});
    c.v = {0.3, 0, 0.1, 0, 0, 0};
    auto s = simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(dt),
                              ball_pairs({.mu_static = 10, .mu_dynamic = 10}));
    start(*s, c, std::vector<Real>(6), {1, 3, -2, 0.5, 4, 1});
    s->particles().accepted(0, s->state().x().data(), s->state().v().data(), 0);
    s->advance(0.04);
    CHECK(s->particles().history().of("sphere_contact").heat()[2] == 0);
    return std::pair(at(s->state().x(), 0), at(s->angles(), 1));
  };
  const auto exact = run(2.5e-5);
  require_order(
      "Verlet",
      [&](Real h) {
        const auto [x, angle] = run(h);
        return (x - exact.first).norm() + (angle - exact.second).norm();
      },
      0.004, 2);
}

TEST_CASE("the spring between balls that turn as one body turns with them") {
  // Pressed together, sheared, and then turned about a prescribed axis, in small steps.
  Configuration<3> c;
  c.add_soft(1, Vector::Zero());
  c.add_soft(1, {0, 0.99, 0});
  const auto s = simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(1e-3),
                                  ball_pairs({.mu_static = 1e6, .mu_dynamic = 1e6}));
  start(*s, c, std::vector<Real>(6), std::vector<Real>(6));
  std::vector<Real> x(s->state().x().begin(), s->state().x().end()), v(12), f(12);
  const auto accept = [&] { s->particles().accepted(0, x.data(), v.data(), 1e-3); };
  const auto torque = [&] {
    s->particles().field().forces(s->particles().view(x.data(), v.data()), f.data());
    return at(f, 2);  // forces on both, then torques
  };
  accept();
  for (const Index m : {0, 1}) point<3>(x.data(), 2 + m) = Vector(0.01, 0, 0);
  accept();
  const Vector before = torque();
  CHECK(before.norm() > 0.1);
  const Vector axis = Vector(1, 2, -1).normalized(), middle(0, 0.495, 0);
  const Vector first = point<3>(x.data(), 0) - middle, second = point<3>(x.data(), 1) - middle;
  const int steps = 400;
  for (int k = 1; k <= steps; ++k) {
    const Real angle = 2.0 * k / steps;
    const Matrix turn = Eigen::AngleAxis<Real>(angle, axis).toRotationMatrix();
    point<3>(x.data(), 0) = turn * first + middle;
    point<3>(x.data(), 1) = turn * second + middle;
    for (const Index m : {0, 1}) point<3>(x.data(), 2 + m) = Vector(0.01, 0, 0) + angle * axis;
    accept();
  }
  CHECK((torque() - Eigen::AngleAxis<Real>(2, axis).toRotationMatrix() * before).norm() < 1e-3 * before.norm());
}

TEST_CASE("balls keep linear and angular momentum to rounding") {
  const auto s = Crowd(5, false).simulation();
  const auto momentum = [&] {
    const StateView<3> view = s->view();
    Vector linear = Vector::Zero(), angular = Vector::Zero();
    for (Index i = 0; i < view.topology.owned_points(); ++i) {
      const Vector p = view.topology.mass(i) * view.velocity(i);
      linear += p;
      angular += view.position(i).cross(p) + view.topology.inertia[i] * view.spin(i);
    }
    return std::pair(linear, angular);
  };
  const auto before = momentum();
  s->advance(0.2);
  const auto after = momentum();
  CHECK((after.first - before.first).norm() < 1e-12);
  CHECK((after.second - before.second).norm() < 1e-11);
  for (const Real heat : s->particles().history().of("sphere_contact").heat()) CHECK(heat > 0.01);
}

TEST_CASE("the energy that balls lose to each other and to walls is heat") {
  const Crowd crowd(6);
  const auto lost = [&](Real dt) {
    const auto s = crowd.simulation(dt);
    const Real before = total_energy(*s);
    s->advance(0.1);
    const Real heat = heat_of(*s, "sphere_contact") + heat_of(*s, "sphere_wall_contact");
    CHECK(heat_of(*s, "sphere_wall_contact") > 0.1);
    CHECK(before - total_energy(*s) > 1);
    const ParticleSystem<3>& system = s->particles();
    const PairList& list = system.neighbours().point_pairs;
    std::size_t touching = 0;  // all contacts that there are, and none that has been
    for (Index e = 0; e < list.size(); ++e)
      touching += (at(s->state().x(), list[e].first) - at(s->state().x(), list[e].second)).norm() < list.reach[e];
    CHECK(system.history().of("sphere_contact").contacts().keys.size() == touching);
    return std::abs(before - total_energy(*s) - heat) / before;
  };
  const Real coarse = lost(1e-3), fine = lost(1.25e-4);
  CHECK(coarse < 0.02);
  CHECK(fine < 0.3 * coarse);
}

namespace {

/// A sphere on a plane that leans in any direction: gravity in the frame of the plane, whose normal is z there.
struct OnPlane {
  Matrix turn = tilt();
  std::unique_ptr<Simulation<3>> s;
  Real mass = 0;

  OnPlane(const Vector& g, const Vector& v, const Vector& spin, const SurfaceFriction& surface) {
    constexpr Real stiff = 1e5;
    Configuration<3> c;
    c.walls = Walls<3>({Solid<3>::half_space(Vector::Zero(), turn * Vector(0, 0, 1))});
    mass = pi / 4;
    c.add_soft(1, turn * Vector(0, 0, 0.5 - mass * std::abs(g[2]) * 0.25 / stiff));
    const Vector w = turn * v, o = turn * spin;
    c.v = {w[0], w[1], w[2]};
    s = simulation_of<3>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(1e-4), WallContact<3>{stiff},
                         SphereWallContact{stiff, surface}, Weight{turn * g});
    start(*s, c, std::vector<Real>(3), {o[0], o[1], o[2]});
    s->particles().accepted(0, s->state().x().data(), s->state().v().data(), 0);
  }
  Vector velocity() const { return turn.transpose() * at(s->state().v(), 0); }
  Vector spin() const { return turn.transpose() * at(s->spins(), 0); }
};

constexpr SurfaceFriction floor_friction{.mu_static = 0.4, .mu_dynamic = 0.4, .damping = 0.3};

}  // namespace

TEST_CASE("a ball that slides comes to roll at exactly 5/7 of its velocity") {
  OnPlane ball({0, 0, -10}, {0.6, -0.8, 0}, {0, 0, 3}, floor_friction);
  const Real rolls_at = 2.0 / (7 * 0.4 * 10);
  ball.s->advance(rolls_at / 2);
  CHECK((ball.velocity() - (1 - 4 * rolls_at / 2) * Vector(0.6, -0.8, 0)).norm() < 1e-3);
  ball.s->advance(2 * rolls_at + 1);
  CHECK((ball.velocity() - 5.0 / 7 * Vector(0.6, -0.8, 0)).norm() < 1e-4);
  CHECK((ball.spin() - Vector(10.0 / 7 * 0.8, 10.0 / 7 * 0.6, 3)).norm() < 2e-4);  // about the normal nothing acts
  CHECK(heat_of(*ball.s, "sphere_wall_contact") == Approx(ball.mass / 7).epsilon(2e-3));
}

TEST_CASE("a ball rolls down a slope up to tan φ = 7/2 μ, and slides down a steeper one") {
  for (const Real beyond : {-0.05, 0.05}) {
    const Real phi = std::atan(3.5 * 0.4 * (1 + beyond));
    OnPlane ball({10 * std::sin(phi), 0, -10 * std::cos(phi)}, Vector::Zero(), Vector::Zero(), floor_friction);
    ball.s->advance(0.5);
    const Vector v = ball.velocity(), w = ball.spin();
    const Real slip = v[0] - 0.5 * w[1];
    if (beyond < 0) {
      CHECK(v[0] == Approx(5.0 / 7 * 10 * std::sin(phi) * 0.5).epsilon(2e-3));
      CHECK(std::abs(slip) < 5e-3);
    } else {
      CHECK(v[0] == Approx(10 * (std::sin(phi) - 0.4 * std::cos(phi)) * 0.5).epsilon(2e-3));
      CHECK(slip > 0.05);
    }
    CHECK(std::abs(v[1]) < 1e-9);
  }
}

TEST_CASE("balls between walls do the same on any number of ranks, with the same heat", "[ranks]") {
  const Crowd crowd(7, true, 4, 4);
  const auto alone = crowd.simulation(), shared = crowd.simulation(5e-4, Sorting::regularly, Ranks(PETSC_COMM_WORLD));
  alone->advance(0.05);
  shared->advance(0.05, [&](State& state) {
    if (state.step % 23 != 0) return AfterStep::proceed;
    shared->sort();
    return AfterStep::reordered;
  });
  CHECK(Snapshot<3>(*alone).difference(Snapshot<3>(*shared)) < 1e-9);
  for (const char* term : {"sphere_contact", "sphere_wall_contact"})
    CHECK(shared->ranks().sum(heat_of(*shared, term)) == Approx(heat_of(*alone, term)).epsilon(1e-8));
}

}  // namespace pliant::test::sphere_contact_test
