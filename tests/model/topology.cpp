#include <catch2/catch.hpp>

#include <cmath>
#include <numeric>

#include <pliant/model/topology.h>

using namespace pliant;

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
    CHECK(topology.mass[i] * topology.inverse_mass[i] == Approx(1));
  }
  CHECK(std::accumulate(topology.mass.begin(), topology.mass.end(), 0.0) == Approx(11));
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
    CHECK(topology.inverse_mass[i] == 0);
    CHECK(topology.mass[i] == 1);
  }
  CHECK(topology.inverse_mass[0] == 0.5);
}
