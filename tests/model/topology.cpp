#include <catch2/catch.hpp>

#include <cmath>
#include <numeric>

#include <pliant/model/topology.h>

namespace pliant::test::topology_test {

TEST_CASE("topology of soft particles and polygons") {
  Topology topology;
  topology.add_polygon(5, 0.3, 0.2, 0.05, 2);
  topology.add_soft(1.2, 3);
  topology.add_polygon(3, 0.5, 0.7, 0.1, 6);
  CHECK(topology.particles() == 3);
  CHECK(topology.points() == 9);
  CHECK(topology.offset == std::vector<Index>{0, 5, 6, 9});
  CHECK(topology.particle == std::vector<Index>{0, 0, 0, 0, 0, 1, 2, 2, 2});
  CHECK(topology.next == std::vector<Index>{1, 2, 3, 4, 0, 5, 7, 8, 6});
  for (Index i = 0; i < topology.points(); ++i) {
    CHECK(topology.previous[topology.next[i]] == i);
    CHECK(topology.mass(i) * topology.inverse_mass(i) == Approx(1));
  }
  Real sum = 0;
  for (Index i = 0; i < topology.points(); ++i) sum += topology.mass(i);
  CHECK(sum == Approx(11));
  CHECK(topology.diameter[4] == 0.05);
  CHECK(topology.diameter[5] == 1.2);
  CHECK(topology.sigma[2] == Approx(std::sqrt(4 * 0.5 / pi)));  // the disk of area a0
  CHECK(topology.a0[1] == Approx(pi * 0.36));
  CHECK(topology.l0 == std::vector<Real>{0.2, 0, 0.7});
  CHECK(topology.deformable());
}

TEST_CASE("rest volume of a soft particle in 3D") {
  Topology topology;
  topology.dim = 3;
  topology.add_soft(2, 1);
  CHECK(topology.a0[0] == Approx(4 * pi / 3));
  CHECK(!topology.deformable());
}

TEST_CASE("a deactivated particle keeps its mass but does not accelerate") {
  Topology topology;
  topology.add_soft(1, 2);
  topology.add_polygon(4, 1, 1, 0.1, 4);
  topology.deactivate(1);
  CHECK(topology.active[topology.particle[0]] == 1);
  for (Index i = 1; i < 5; ++i) {
    CHECK(topology.active[topology.particle[i]] == 0);
    CHECK(topology.inverse_mass(i) == 0);
    CHECK(topology.mass(i) == 1);
  }
  CHECK(topology.inverse_mass(0) == 0.5);
}

TEST_CASE("a selection of particles, in the order asked for") {
  Topology topology;
  topology.add_polygon(5, 0.3, 0.2, 0.05, 2);
  topology.add_soft(1.2, 3);
  topology.add_polygon(3, 0.5, 0.7, 0.1, 6);
  topology.deactivate(1);
  const Topology some = topology.select(std::vector<Index>{2, 1});
  CHECK(some.dim == 2);
  CHECK(some.id == std::vector<Index>{2, 1});
  CHECK(some.offset == std::vector<Index>{0, 3, 4});
  CHECK(some.particle == std::vector<Index>{0, 0, 0, 1});
  CHECK(some.next == std::vector<Index>{1, 2, 0, 3});
  CHECK(some.previous == std::vector<Index>{2, 0, 1, 3});
  CHECK(some.diameter == std::vector<Real>{0.1, 0.1, 0.1, 1.2});
  CHECK(some.point_mass == std::vector<Real>{2, 3});
  CHECK(some.inverse_point_mass == std::vector<Real>{0.5, 0});
  CHECK(some.sigma == std::vector<Real>{topology.sigma[2], 1.2});
  CHECK(some.a0 == std::vector<Real>{0.5, topology.a0[1]});
  CHECK(some.l0 == std::vector<Real>{0.7, 0});
  CHECK(some.active == std::vector<std::uint8_t>{1, 0});
  CHECK(topology.select({}).particles() == 0);
}

TEST_CASE("ghosts come after the own particles, and go without a trace") {
  Topology topology;
  topology.add_soft(1.2, 3);
  topology.add_polygon(3, 0.5, 0.7, 0.1, 6);
  const Topology before = topology;
  for (int round = 0; round < 2; ++round) {
    topology.add_ghost(17, 4, 0.3, 1.1, 0.9, 0.6, 8, 0);
    topology.add_ghost(5, 1, 0.8, 0.8, 0.5, 0, 3, 0.2);
    CHECK(topology.ghosts == 2);
    CHECK(topology.particles() == 4);
    CHECK(topology.points() == 9);
    CHECK(topology.owned() == 2);
    CHECK(topology.owned_points() == 4);
    CHECK(topology.id == std::vector<Index>{0, 1, 17, 5});
    CHECK(topology.offset == std::vector<Index>{0, 1, 4, 8, 9});
    CHECK(topology.particle == std::vector<Index>{0, 1, 1, 1, 2, 2, 2, 2, 3});
    CHECK(topology.next == std::vector<Index>{0, 2, 3, 1, 5, 6, 7, 4, 8});
    CHECK(topology.diameter[7] == 0.3);
    CHECK(topology.sigma[2] == 1.1);
    CHECK(topology.a0[2] == 0.9);
    CHECK(topology.l0[2] == 0.6);
    CHECK(topology.active[3] == 1);
    CHECK(topology.mass(7) == 2);
    CHECK(topology.mass(8) == 3);
    CHECK(topology.inertia[3] == 0.2);
    topology.drop_ghosts();
    CHECK(topology.inertia == before.inertia);
    CHECK(topology.inverse_inertia == before.inverse_inertia);
    CHECK(topology.ghosts == 0);
    CHECK(topology.offset == before.offset);
    CHECK(topology.particle == before.particle);
    CHECK(topology.next == before.next);
    CHECK(topology.previous == before.previous);
    CHECK(topology.diameter == before.diameter);
    CHECK(topology.point_mass == before.point_mass);
    CHECK(topology.inverse_point_mass == before.inverse_point_mass);
    CHECK(topology.sigma == before.sigma);
    CHECK(topology.a0 == before.a0);
    CHECK(topology.l0 == before.l0);
    CHECK(topology.active == before.active);
    CHECK(topology.id == before.id);
  }
}

}  // namespace pliant::test::topology_test
