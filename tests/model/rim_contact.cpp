// Contact of round lips with the edges of closed surfaces.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include <pliant/model/rim_contact.h>

#include "support/derivatives.h"
#include "support/smooth_surfaces.h"

namespace pliant::test::rim_contact_test {
namespace {

constexpr Real epsilon = 3, radius = 1.5, delta = 0.06;

/// A cone that ends in a lip of this radius at the height 0.2.
WallParts cone() { return {{WallSegment::between({radius, 0.2}, {4, 2})}, {{{radius, 0.2}, 0}}}; }

Vec<3> on_lip(Real phi) { return {radius * std::cos(phi), radius * std::sin(phi), 0.2}; }

std::unique_ptr<ForceField<3>> rim() { return alone<3>(RimContact{epsilon}); }
RimContact wide_rim() {
  RimContact rim{epsilon};
  rim.s1 = 1.0 / 16;
  return rim;
}

/// An icosphere that a lip presses between its vertices.
Configuration<3> pressed_on_lip(Random& random) {
  for (;;) {
    const Vec<3> from = on_lip(random(0, 2 * pi)) + random(0.47, 0.53) * random.unit<3>();
    Configuration<3> c = surfaces_in_shape({moved(icosphere(42), random_turn(random), from)}, delta);
    c.walls.add(cone());
    if (rim()->energy(c.view()) > 1e-3) return c;
  }
}

}  // namespace

TEST_CASE("derivatives of the contact of round lips and edges", "[lip]") {
  check_smooth<3>(
      *rim(), [](Random& random) { return pressed_on_lip(random); }, 1e-5);
  check_smooth<3>(
      *alone<3>(wide_rim()), [](Random& random) { return pressed_on_lip(random); }, 1e-5);
}

TEST_CASE("edges that are as wide as they are long feel a lip with a given s1", "[lip]") {
  Random random(3);
  Configuration<3> c = pressed_on_lip(random);
  std::ranges::fill(c.topology.diameter, c.topology.l0[0]);
  Neighbours<3> lists({.lips = true}, 0.02);
  lists.rebuild(c.topology, c.walls, c.x.data());
  const StateView<3> s{c.x.data(), c.v.data(), c.topology, lists, c.walls};
  CHECK(rim()->energy(s) == 0);
  CHECK(std::abs(alone<3>(wide_rim())->energy(s)) > 1e-3);
}

TEST_CASE("an edge across a lip feels its distance, and a parallel edge nothing", "[lip]") {
  const Real phi = 0.7, height = 0.4 * delta / 2;
  const Vec<3> out(std::cos(phi), std::sin(phi), 0), around(-std::sin(phi), std::cos(phi), 0), up(0, 0, 1);
  const auto energy = [&](const Vec<3>& along) {
    const Vec<3> middle = on_lip(phi) + height * up, across = along.cross(up);
    TriangleMesh roof{{middle - 0.4 * along, middle + 0.5 * along, middle + across + up, middle - across + up},
                      {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
    if (volume(roof) < 0) std::swap(roof.vertices[0], roof.vertices[1]);
    Configuration<3> c = surfaces_in_shape({roof}, delta);
    c.walls.add(cone());
    Real edges = 0;
    for (Index e = 0; e < c.view().neighbours.lips.size(); ++e) edges += RimContact{epsilon}.energy(c.view(), e);
    CHECK(edges == Approx(rim()->energy(c.view())));
    CHECK(alone<3>(RimContact{epsilon, false})->energy(c.view()) == 0);
    return edges;
  };
  CHECK(energy(out) == Approx(epsilon / 2 * square(1 - 0.4)).epsilon(1e-3));
  CHECK(energy(around) == 0);
}

TEST_CASE("lists hold the edges near round lips", "[lip]") {
  Random random(2);
  std::vector<TriangleMesh> meshes;
  for (int k = 0; k < 8; ++k)
    meshes.push_back(moved(icosphere(k % 2 == 0 ? 12 : 42), random_turn(random),
                           on_lip(k * 0.8) + random(0.4, 0.6) * random.unit<3>()));
  Configuration<3> c = surfaces_in_shape(meshes, delta);
  c.walls.add(cone());
  c.topology.deactivate(3);
  constexpr Real skin = 0.1;
  Neighbours<3> lists({.lips = true}, skin);
  lists.rebuild(c.topology, c.walls, c.x.data());
  const Circle circle{radius, 0.2};
  std::vector<Pair> all;
  for (Index m = 0; m < c.topology.particles(); ++m)
    for (std::size_t k = 0; m != 3 && k < c.topology.surfaces->of(c.topology, m).hinges.size(); ++k) {
      const Index edge = first_edge(c.topology, m) + static_cast<Index>(k);
      const auto [a, b] = points_of_edge(c.topology, edge);
      const Real t = nearest_to_circle(circle, c.position(a), c.position(b));
      if (circle.distance(c.position(a) + t * (c.position(b) - c.position(a))) < delta / 2 + skin)
        all.push_back({0, edge});
    }
  CHECK(all.size() > 30);
  CHECK(lists.lips.pairs == all);
  // A particle that is moved is listed again.
  for (Index i = c.topology.offset[5]; i < c.topology.offset[6]; ++i) c.x[3 * i + 2] += 3;
  lists.relist(c.topology, c.walls, c.x.data(), 5);
  std::erase_if(all, [&](const Pair& p) { return c.topology.particle[point_of_edge(p.second)] == 5; });
  CHECK(lists.lips.pairs == all);
}

TEST_CASE("round lips move with their walls, which feel the opposite force", "[lip]") {
  Random random(5);
  Configuration<3> c = pressed_on_lip(random), moved = pressed_on_lip(random);
  const Pose<3> pose{random_turn(random), {0.3, -2, 1}, true};
  moved.walls = {};
  moved.walls.add(cone(), {}, pose);
  moved.x = c.x;
  for (Index i = 0; i < c.topology.points(); ++i) point<3>(moved.x.data(), i) = pose.place(c.position(i));
  VectorXd f(c.x.size()), turned(c.x.size());
  rim()->forces(c.view(), f.data());
  rim()->forces(moved.view(), turned.data());
  Vec<3> sum = Vec<3>::Zero();
  for (Index i = 0; i < c.topology.points(); ++i) {
    CHECK((pose.direction(point<3>(f.data(), i)) - point<3>(turned.data(), i)).norm() < 1e-10 * f.norm());
    sum += point<3>(f.data(), i);
  }
  std::vector<Real> on_walls(3);
  rim()->add_wall_forces(c.view(), on_walls.data(), nullptr, WallGroup::all);
  CHECK(sum.norm() > 1);
  CHECK((point<3>(on_walls.data(), 0) + sum).norm() < 1e-11 * sum.norm());
}

}  // namespace pliant::test::rim_contact_test
