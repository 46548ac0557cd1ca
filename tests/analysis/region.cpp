#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include <pliant/analysis/region.h>

namespace pliant::test::region_test {

TEST_CASE("density of a square lattice above the orifice") {
  const Real a = 0.5, w = 4;
  std::vector<Real> centres, area;
  std::vector<std::uint8_t> active;
  for (int i = -20; i <= 20; ++i)
    for (int j = -20; j <= 20; ++j) {
      centres.insert(centres.end(), {a * i, a * j});
      area.push_back(0.1 + 0.01 * (j % 2 == 0));
      active.push_back(1);
    }
  const auto region = orifice_region<2>(w);
  CHECK(region.measure() == 2 * w * w);
  // Lower edges belong to the region, upper edges do not: exactly 1/a² although lattice points lie on all edges.
  CHECK(number_density<2>(region, centres, active) == Approx(1 / (a * a)).epsilon(1e-14));
  CHECK(packing_fraction<2>(region, centres, area, active) == Approx(0.105 / (a * a)).epsilon(1e-14));

  for (std::size_t m = 0; m < active.size(); m += 2) active[m] = 0;  // a checkerboard
  CHECK(number_density<2>(region, centres, active) == Approx(0.5 / (a * a)).epsilon(1e-14));
}

TEST_CASE("3D: a cylinder of diameter 2w and height w") {
  const Real a = 0.25, w = 4;
  std::vector<Real> centres;
  for (int i = -20; i < 20; ++i)
    for (int j = -20; j < 20; ++j)
      for (int k = -20; k < 20; ++k) centres.insert(centres.end(), {a * (i + 0.5), a * (j + 0.5), a * (k + 0.5)});
  const std::vector<std::uint8_t> active(centres.size() / 3, 1);
  const std::vector<Real> volume(active.size(), 0.01);
  const auto region = orifice_region<3>(w);
  CHECK(region.measure() == Approx(pi * w * w * w));
  // The rim cuts cells: relative error of Gauss's circle problem, well below a/w.
  CHECK(number_density<3>(region, centres, active) == Approx(1 / (a * a * a)).epsilon(0.02));
  CHECK(packing_fraction<3>(region, centres, volume, active) == Approx(0.64).epsilon(0.02));

  CHECK(region.contains({3.9, 0, 0}));
  CHECK_FALSE(region.contains({4, 0, 0}));
  CHECK_FALSE(region.contains({2.9, 2.9, 1}));
  CHECK_FALSE(region.contains({0, 0, -0.01}));
  CHECK_FALSE(region.contains({0, 0, 4}));
}

TEST_CASE("regions: bad input") {
  CHECK_THROWS_AS(orifice_region<2>(0), InputError);
  const BoxRegion<3> box{{0, 0, 0}, {1, 2, 3}};
  CHECK(box.measure() == 6);
  const std::vector<Real> centres{0.5, 0.5, 0.5};
  CHECK(number_density<3>(box, centres, std::vector<std::uint8_t>{1}) == Approx(1.0 / 6));
  CHECK_THROWS_AS(number_density<3>(box, centres, std::vector<std::uint8_t>{1, 1}), InputError);
  CHECK_THROWS_AS(packing_fraction<3>(box, centres, std::vector<Real>{}, std::vector<std::uint8_t>{1}), InputError);
}

}  // namespace pliant::test::region_test
