// Polygons on a substrate that stick, slide and turn, against exact answers. Cases with the tag work on any number of
// ranks.
#include <petscsys.h>

#include <catch2/catch.hpp>

#include <pliant/model/rest_shape.h>
#include <pliant/model/vertex_base_friction.h>

#include "support/on_table.h"

namespace pliant::test::vertex_base_friction_test {

namespace {

constexpr Index vertices = 12;
constexpr Real plate_mass = 2;

/// Corners at different distances from the middle, equal for opposite corners.
pliant::Vec<2> corner(Index k) {
  const Real phi = 2 * pi * k / vertices;
  return (0.6 + 0.2 * std::cos(2 * phi) + 0.05 * std::sin(4 * phi)) * pliant::Vec<2>(std::cos(phi), std::sin(phi));
}
std::shared_ptr<const RestOutlines> outlines() {
  RestOutlines all(vertices + 1);
  for (Index k = 0; k < vertices; ++k) all[vertices].push_back(corner(k));
  return std::make_shared<RestOutlines>(std::move(all));
}

void add_plate(Configuration<2>& c, const pliant::Vec<2>& centre, Real turn) {
  Polygon places;
  for (Index k = 0; k < vertices; ++k) places.emplace_back(centre + Eigen::Rotation2D<Real>(turn) * corner(k));
  c.add_polygon(places, 0.3);
  const Index m = c.topology.particles() - 1;
  c.topology.l0[m] = 1;
  c.topology.point_mass[m] = plate_mass / vertices;
  c.topology.inverse_point_mass[m] = vertices / plate_mass;
}

void start(Simulation<2>& s, const Configuration<2>& c) {
  s.place(c.x);
  const Topology& t = s.topology();
  for (Index m = 0; m < t.owned(); ++m)
    std::copy_n(c.v.begin() + static_cast<std::ptrdiff_t>(2 * vertices) * t.id[m], 2 * vertices,
                s.state().v().begin() + static_cast<std::ptrdiff_t>(2) * t.offset[m]);
}

VertexBaseFriction friction(Real mu_static, Real mu_dynamic, Real g = 10) {
  return {.gravity = g, .mu_static = mu_static, .mu_dynamic = mu_dynamic};
}

/// A polygon that lies on the substrate since the start. The displacement at the limit of μ = 0.3 is `give`.
struct OnTable {
  VertexBaseFriction base;
  std::unique_ptr<Simulation<2>> s;

  OnTable(VertexBaseFriction law, Real dt, pliant::Vec<2> v = {0, 0}, Real spin = 0, pliant::Vec<2> slope = {0, 0},
          Real give = 1e-5, Real stiffness = 1e3)
      : base(law) {
    Configuration<2> c;
    add_plate(c, {7, -3}, 0.4);
    base.epsilon = 0.3 * plate_mass / vertices * base.gravity / give * square(0.3);
    s = simulation_of<2>(c, Sorting::never, Ranks(), std::make_unique<FixedStepVerlet>(dt),
                         RestShape{stiffness, outlines()}, base, Slope{slope});
    for (Index i = 0; i < vertices; ++i) {
      const pliant::Vec<2> r = c.position(i) - pliant::Vec<2>(7, -3);
      point<2>(c.v.data(), i) = v + spin * pliant::Vec<2>(-r[1], r[0]);
    }
    start(*s, c);
    touch(*s);
  }
  Real per_vertex() const { return base.epsilon / square(0.3); }
  pliant::Vec<2> position() const { return mean(s->state().x()) - pliant::Vec<2>(7, -3); }
  pliant::Vec<2> velocity() const { return mean(s->state().v()); }
  /// Σ m r² over the mass.
  static Real inertia() {
    return over([](Real r) { return r * r; });
  }
  static Real lever() {
    return over([](Real r) { return r; });
  }
  /// Angular momentum over the moment of inertia.
  Real spin() const {
    const pliant::Vec<2> centre = mean(s->state().x());
    Real sum = 0;
    for (Index i = 0; i < vertices; ++i) {
      const pliant::Vec<2> r = point<2>(s->state().x().data(), i) - centre, v = point<2>(s->state().v().data(), i);
      sum += r[0] * v[1] - r[1] * v[0];
    }
    return sum / vertices / inertia();
  }

 private:
  template <class F>
  static Real over(F&& f) {
    Real sum = 0;
    for (Index k = 0; k < vertices; ++k) sum += f(corner(k).norm()) / vertices;
    return sum;
  }
  static pliant::Vec<2> mean(std::span<const Real> a) {
    pliant::Vec<2> sum(0, 0);
    for (Index i = 0; i < vertices; ++i) sum += point<2>(a.data(), i) / vertices;
    return sum;
  }
};

}  // namespace

TEST_CASE("a polygon on a slope slides beyond the angle of friction, and not before") {
  for (const Real mu_dynamic : {0.5, 0.3}) {
    for (const Real beyond : {-1e-6, 1e-6}) {
      INFO("dynamic " << mu_dynamic << ", beyond " << beyond);
      const Real phi = std::atan(0.5) + beyond, down = 10 * std::sin(phi);
      OnTable plate(friction(0.5, mu_dynamic, 10 * std::cos(phi)), 2e-4, {0, 0}, 0, {down, 0});
      // Where the springs hold it.
      const Real hangs = plate_mass / vertices * down / plate.per_vertex();
      for (Index i = 0; i < vertices; ++i) plate.s->state().x()[2 * i] += hangs;
      plate.s->advance(0.5);
      if (beyond < 0) {
        CHECK(plate.position()[0] == Approx(hangs).epsilon(1e-9));
        CHECK(plate.velocity().norm() < 1e-11);
      } else {
        const Real a = down - mu_dynamic * 10 * std::cos(phi);
        CHECK(a > 0);
        CHECK(plate.position()[0] - hangs == Approx(a / 8).epsilon(2e-3));
      }
    }
  }
}

TEST_CASE("a polygon slides v²/(2μg) and then rests") {
  const Real give = 1e-3;
  OnTable plate(friction(0.3, 0.3), 2e-4, {0.8, 0.6}, 0, {0, 0}, give);
  Real farthest = 0;
  plate.s->advance(20 * std::sqrt(give) + 1, [&](State&) {
    farthest = std::max(farthest, plate.position().norm());
    return AfterStep::proceed;
  });
  const Real distance = 1.0 / (2 * 0.3 * 10);
  CHECK(farthest == Approx(distance).epsilon(1e-6));
  CHECK(plate.position().norm() == Approx(distance - give).epsilon(1e-5));
  CHECK(plate.position()[1] / plate.position()[0] == Approx(0.75).epsilon(1e-8));
  CHECK(std::abs(plate.spin()) < 1e-9);
  const auto heat = plate.s->particles().history().of("base_friction").heat();
  CHECK(heat[0] + heat[1] == Approx(plate_mass / 2).epsilon(1e-3));
  CHECK(heat[1] > 0.99 * plate_mass / 2);
  // Permanently.
  plate.s->advance(plate.s->state().t + 200 * std::sqrt(give));
  const pliant::Vec<2> rest = plate.position();
  plate.s->advance(plate.s->state().t + 1);
  CHECK((plate.position() - rest).norm() < 1e-13);
}

TEST_CASE("a polygon that turns slows down by μ g Σ m r/I, as a rigid body") {
  const Real spin = 0.8, alpha = 0.3 * 10 * OnTable::lever() / OnTable::inertia(), stops = spin / alpha;
  OnTable plate(friction(0.3, 0.3), 5e-5, {0, 0}, spin, {0, 0}, 1e-6, 1e4);
  plate.s->advance(stops / 2);
  CHECK(plate.spin() == Approx(spin / 2).epsilon(1e-3));
  CHECK(plate.position().norm() < 1e-6);
  plate.s->advance(0.99 * stops);
  CHECK(plate.spin() > 0);
  plate.s->advance(stops + 0.1);
  CHECK(std::abs(plate.spin()) < 1e-3);
  CHECK(sum_of_heat(*plate.s, "base_friction") ==
        Approx(plate_mass * OnTable::inertia() * square(spin) / 2).epsilon(1e-3));
}

TEST_CASE("a polygon that is pushed by less than friction holds does not creep") {
  OnTable plate(friction(0.5, 0.3), 1e-4, {0, 0}, 0, {0.95 * 5 * 0.6, 0.95 * 5 * 0.8}, 1e-4);
  const pliant::Vec<2> hangs = plate_mass / vertices / plate.per_vertex() * pliant::Vec<2>(0.95 * 3, 0.95 * 4);
  for (Index i = 0; i < vertices; ++i) point<2>(plate.s->state().x().data(), i) += 0.97 * hangs;
  plate.s->advance(2);
  const pliant::Vec<2> before = plate.position();
  CHECK((before - hangs).norm() < 1e-9 * hangs.norm() + 1e-13);
  plate.s->advance(4);
  CHECK((plate.position() - before).norm() < 1e-13);
  CHECK(plate.s->particles().history().of("base_friction").heat()[1] == 0);
}

TEST_CASE("a polygon that sticks is integrated at second order, and one that comes to slide at first") {
  check_orders_on_table([](Real v, Real h) {
    VertexBaseFriction base = friction(0.3, 0.3);
    base.damping = 0;
    OnTable plate(base, h, {v, 0}, 0, {0, 0}, 0.01, 10);
    plate.s->advance(0.05);
    return plate.position()[0];
  });
}

TEST_CASE("what a polygon loses as it breaks away, from the static limit to the dynamic one, is heat") {
  VertexBaseFriction base = friction(0.5, 0.3);
  base.damping = 0;
  OnTable plate(base, 2e-5, {0.6, 0}, 0, {0, 0}, 0.01, 10);
  check_heat_of_breaking_away(*plate.s, plate_mass);
}

TEST_CASE("polygons on a table do the same on any number of ranks, with the same heat", "[ranks]") {
  Random random(3);
  Configuration<2> c;
  for (Index k = 0; k < 30; ++k) add_plate(c, {1.7 * (k % 6), 1.5 * (k / 6)}, random(0, 2 * pi));
  for (Index m = 0; m < 30; ++m) {
    const pliant::Vec<2> v(random(-1, 1), random(-1, 1));
    for (Index k = 0; k < vertices; ++k) point<2>(c.v.data(), m * vertices + k) = v;
  }
  const auto simulation = [&](Sorting sorting, const Ranks& ranks) {
    VertexBaseFriction base = friction(0.3, 0.2);
    base.epsilon = 50;
    auto s = simulation_of<2>(c, sorting, ranks, std::make_unique<FixedStepVerlet>(5e-4), RestShape{1e3, outlines()},
                              PairContact<2>{100, "contact"}, base);
    start(*s, c);
    touch(*s);
    return s;
  };
  const auto alone = simulation(Sorting::never, Ranks()),
             shared = simulation(Sorting::regularly, Ranks(PETSC_COMM_WORLD));
  alone->advance(0.3);
  shared->advance(0.3, [&](State& state) {
    if (state.step % 53 != 0) return AfterStep::proceed;
    shared->sort();
    return AfterStep::reordered;
  });
  Real most = 0, moved = 0;
  for (Index m = 0; m < shared->topology().owned(); ++m)
    for (Index k = 0; k < 2 * vertices; ++k) {
      const std::size_t place = 2 * vertices * static_cast<std::size_t>(shared->topology().id[m]) + k;
      most = std::max(most,
                      std::abs(shared->state().x()[2 * shared->topology().offset[m] + k] - alone->state().x()[place]));
      moved = std::max(moved, std::abs(alone->state().x()[place] - c.x[place]));
    }
  CHECK(most < 1e-9);
  CHECK(shared->ranks().max(moved) > 0.05);
  const auto one = alone->particles().history().of("base_friction").heat(),
             own = shared->particles().history().of("base_friction").heat();
  for (std::size_t k = 0; k < one.size(); ++k) {
    CHECK(one[k] > 1e-3);
    CHECK(shared->ranks().sum(own[k]) == Approx(one[k]).epsilon(1e-8));
  }
}

TEST_CASE("a history of pairs is refused for polygons, one of places on a base is not") {
  Configuration<2> c;
  add_plate(c, {0, 0}, 0);
  const auto system = [&](auto term) { return ParticleSystem<2>(c.topology, {}, alone<2>(term), 0.1); };
  CHECK_THROWS_WITH(system(BaseFriction{.gravity = 1, .mu_static = 0.3, .mu_dynamic = 0.3, .epsilon = 1}),
                    Catch::Contains("polygons rotate by their vertices"));
  CHECK_NOTHROW(system(friction(0.3, 0.3)));
}

}  // namespace pliant::test::vertex_base_friction_test
