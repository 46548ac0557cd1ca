#include <catch2/catch.hpp>
#include <set>

#include <pliant/geometry/cell_grid.h>

#include "support/random.h"

namespace pliant::test::cell_grid_test {

namespace {

const auto all = [](Index) { return true; };

const std::vector<Real> no_size(300, 0.0);  // diameters

template <int D>
std::vector<Index> in_box(const CellGrid<D>& grid, const Vec<D>& low, const Vec<D>& high) {
  std::vector<Index> found;
  grid.for_each_in_box(low, high, [&](Index i) { found.push_back(i); });
  return found;
}

/// Every point of the box is visited, and none twice.
template <int D>
void check_boxes(const CellGrid<D>& grid, const std::vector<Real>& x, Real extent, Random& random) {
  for (int k = 0; k < 50; ++k) {
    const Vec<D> a = extent * random.template unit<D>() * random(0, 1.5);
    const Vec<D> half = Vec<D>::Constant(extent * random(0, 0.7));
    const std::vector<Index> found = in_box<D>(grid, a - half, a + half);
    const std::set<Index> unique(found.begin(), found.end());
    CHECK(unique.size() == found.size());
    for (Index i = 0; i < static_cast<Index>(x.size()) / D; ++i)
      if (((point<D>(x.data(), i) - a).cwiseAbs() - half).maxCoeff() <= 0) CHECK(unique.count(i) == 1);
  }
}

template <int D>
std::vector<Real> cloud(Random& random, Index n, Real extent) {
  std::vector<Real> x(n * D);
  for (Real& a : x) a = random(-extent, extent);
  return x;
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("a grid visits every point of a box once", "", ((int D), D), 2, 3) {
  Random random(D);
  for (const Real cell : {0.05, 1.0, 30.0}) {
    INFO("cell size " << cell);
    const std::vector<Real> x = cloud<D>(random, 300, 5);
    CellGrid<D> grid;
    grid.build(x.data(), no_size.data(), 300, cell, all);
    check_boxes<D>(grid, x, 5, random);
  }
}

TEST_CASE("a grid of unused points, of one point and of points in one place") {
  CellGrid<2> grid;
  const std::vector<Real> x{1, 2, 1, 2, 1, 2};
  grid.build(x.data(), no_size.data(), 3, 0.5, [](Index) { return false; });
  CHECK(in_box<2>(grid, {-9, -9}, {9, 9}).empty());
  grid.build(x.data(), no_size.data(), 3, 0.5, [](Index i) { return i != 1; });
  CHECK(in_box<2>(grid, {0, 0}, {3, 3}) == std::vector<Index>{0, 2});
  grid.build(x.data(), no_size.data(), 1, 0.5, all);
  CHECK(in_box<2>(grid, {1, 2}, {1, 2}) == std::vector<Index>{0});
}

TEMPLATE_TEST_CASE_SIG("points far away cost no memory", "", ((int D), D), 2, 3) {
  // With cells of the requested size the grid would need 1e18 cells or more, and could not be built.
  Random random(D);
  std::vector<Real> x = cloud<D>(random, 200, 5);
  for (int k = 0; k < D; ++k) x[k] = 1e9, x[D + k] = -1e9;
  CellGrid<D> grid;
  grid.build(x.data(), no_size.data(), 200, 0.5, all);
  check_boxes<D>(grid, x, 5, random);
  CHECK(in_box<D>(grid, Vec<D>::Constant(1e9 - 1), Vec<D>::Constant(1e9 + 1)) == std::vector<Index>{0});
}

TEMPLATE_TEST_CASE_SIG("a grid finds what is near, by the sizes of the points", "", ((int D), D), 2, 3) {
  Random random(5);
  const Index n = 300;
  std::vector<Real> x, diameter;
  for (Index k = 0; k < n * D; ++k) x.push_back(random(-5, 5));
  for (Index k = 0; k < n; ++k) diameter.push_back(random(0.1, 2));
  for (const Real cell : {0.3, 1.7, 40.0}) {
    CellGrid<D> grid;
    grid.build(x.data(), diameter.data(), n, cell, all);
    for (int trial = 0; trial < 20; ++trial) {
      const Vec<D> r = 5 * random.unit<D>();
      const Real reach = random(0.1, 4);
      std::vector<Index> found, expected, room;
      grid.for_each_near(r, reach + 1, reach, room, [&](Index i) { found.push_back(i); });
      for (Index i = 0; i < n; ++i)
        if ((point<D>(x.data(), i) - r).norm() < reach + diameter[i] / 2) expected.push_back(i);
      std::sort(found.begin(), found.end());
      CHECK(found == expected);
    }
  }
}

}  // namespace pliant::test::cell_grid_test
