// Passes over arrays and over the points of particles, against the same number by number.
#include <pliant/kernels/arrays.h>
#include <pliant/kernels/points.h>

#include <catch2/catch.hpp>
#include <limits>
#include <vector>

#include <pliant/model/topology.h>

#include "support/random.h"

namespace pliant::test::points_test {

TEMPLATE_TEST_CASE_SIG("points are set and scaled by a value of their particle", "", ((int D), D), 2, 3) {
  Random random(1);
  for (const bool polygons : {false, true}) {
    Topology topology;
    topology.dim = D;
    for (Index m = 0; m < 40; ++m)
      if (polygons)
        topology.add_polygon(3 + m % 20, 1, 1, 1, random(1, 2));
      else
        topology.add_soft(1, random(1, 2));
    const Index first = 3, last = 31;
    const Vec<D> g = Vec<D>::Random();
    const auto n = static_cast<std::size_t>(topology.points()) * D;
    std::vector<Real> f(n, 7);
    set_points<D>(topology.offset.data(), topology.point_mass.data(), first, last, g, f.data());
    for (Index i = 0; i < topology.points(); ++i) {
      const bool inside = topology.particle[i] >= first && topology.particle[i] < last;
      const Vec<D> expected = inside ? Vec<D>(topology.mass(i) * g) : Vec<D>::Constant(7);
      CHECK(point<D>(f.data(), i) == expected);
    }
    const std::vector<Real> before = f;
    CHECK(scale_points<D>(topology.offset.data(), topology.inverse_point_mass.data(), first, last, f.data()));
    for (std::size_t c = 0; c < n; ++c) {
      const Index i = static_cast<Index>(c) / D;
      const bool inside = topology.particle[i] >= first && topology.particle[i] < last;
      CHECK(f[c] == (inside ? before[c] * topology.inverse_mass(i) : before[c]));
    }
    for (const Real bad : {std::numeric_limits<Real>::infinity(), std::numeric_limits<Real>::quiet_NaN()})
      for (const Index m : {first, last - 1}) {
        auto strange = before;
        strange[static_cast<std::size_t>(topology.offset[m + 1]) * D - 1] = bad;
        CHECK_FALSE(
            scale_points<D>(topology.offset.data(), topology.inverse_point_mass.data(), first, last, strange.data()));
      }
  }
}

TEST_CASE("numbers of particles of one point are scaled") {
  const std::vector<Index> offset{0, 1, 2, 3, 4};
  const std::vector<Real> values{2, 3, 5, 7};
  std::vector<Real> f{1, 1, 1, 1};
  CHECK(scale_points<1>(offset.data(), values.data(), 1, 3, f.data()));
  CHECK(f == std::vector<Real>{1, 3, 5, 1});
  f[2] = std::numeric_limits<Real>::infinity();
  CHECK_FALSE(scale_points<1>(offset.data(), values.data(), 1, 3, f.data()));
}

TEST_CASE("arrays are subtracted") {
  std::vector<Real> difference{0, 0, 0, 9};
  subtract(std::vector<Real>{5, 7, 9}.data(), std::vector<Real>{1, 2, 3}.data(), 3, difference.data());
  CHECK(difference == std::vector<Real>{4, 5, 6, 9});
}

}  // namespace pliant::test::points_test
