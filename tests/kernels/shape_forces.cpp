#include <pliant/kernels/shape_forces.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <memory>

#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/perimeter.h>

#include "support/configurations.h"

namespace pliant::test::shape_forces_test {
namespace {

constexpr std::array every_size{3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 20, 31, 32, 40, 500};
const std::array laws{
    ShapeLaw{{3}, {0}, {0}},         ShapeLaw{{0}, {2}, {0}},         ShapeLaw{{0}, {0}, {0.4}},
    ShapeLaw{{3}, {2}, {0}},         ShapeLaw{{3}, {0}, {0.4}},       ShapeLaw{{0}, {2}, {0.4}},
    ShapeLaw{{3}, {2}, {0.4}},       ShapeLaw{{3, true}, {0}, {0}},   ShapeLaw{{0}, {0}, {0.4, true}},
    ShapeLaw{{3}, {0}, {0.4, true}}, ShapeLaw{{0}, {2}, {0.4, true}}, ShapeLaw{{3, true}, {2}, {0.4, true}}};

/// Forces by the element forms. Their lists are not needed for terms within a particle.
std::vector<Real> by_elements(const ShapeLaw& law, const Configuration<2>& c) {
  const Neighbours<2> none({}, 0.1);
  const StateView<2> s{c.x.data(), c.v.data(), c.topology, none, c.walls};
  std::vector<Real> f(c.x.size());
  const Scatter<2, -1> sink{f.data()};
  for (Index m = 0; m < c.topology.particles(); ++m) {
    if (c.topology.points_of(m) == 1) continue;
    if (law.k_a != 0)
      Area{law.k_a, law.relative_area ? AreaEnergy::relative : AreaEnergy::absolute}.add_gradient(s, m, sink);
    for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) {
      if (law.k_l != 0) Perimeter{law.k_l}.add_gradient(s, i, sink);
      if (law.k_b != 0)
        Bending{law.k_b, law.full_edges ? EdgeVectors::full : EdgeVectors::unit}.add_gradient(s, i, sink);
    }
  }
  return f;
}

void add(const ShapeLaw& law, const Configuration<2>& c, Index first, Index last, Real* f) {
  const Topology& t = c.topology;
  add_shape_forces(law, t.offset.data(), t.a0.data(), t.l0.data(), first, last, c.x.data(), f);
}

std::vector<Real> by_kernel(const ShapeLaw& law, const Configuration<2>& c) {
  std::vector<Real> f(c.x.size());
  add(law, c, 0, c.topology.particles(), f.data());
  return f;
}

Real largest(const std::vector<Real>& f) {
  Real most = 0;
  for (const Real a : f) most = std::max(most, std::abs(a));
  return most;
}

/// Not within: also for NaN.
bool agree(const std::vector<Real>& a, const std::vector<Real>& b) {
  const Real scale = largest(b);
  bool all = a.size() == b.size() && scale > 0.01;
  for (std::size_t k = 0; k < b.size(); ++k) all = all && std::abs(a[k] - b[k]) <= 1e-12 * scale;
  return all;
}

/// Polygons of all sizes in mixed order, with soft particles between them.
Configuration<2> mixture(Random& random) {
  Configuration<2> c;
  for (int repeat = 0; repeat < 3; ++repeat)
    for (const int n : every_size) {
      const Vec<2> centre(random(-50, 50), random(-50, 50));
      if (random(0, 1) < 0.3) c.add_soft(1, centre);
      c.add_polygon(irregular_polygon(random, n, random(0.3, 1), centre), 0.1);
    }
  return c;
}

}  // namespace

TEST_CASE("Shape forces of one polygon are those of the element forms", "[kernels]") {
  Random random(1);
  for (const int n : every_size)
    for (const ShapeLaw& law : laws) {
      CAPTURE(n, law.k_a, law.k_l, law.k_b, law.relative_area, law.full_edges);
      Configuration<2> c;
      c.add_polygon(irregular_polygon(random, n, 0.5, {random(-20, 20), random(-20, 20)}), 0.1);
      CHECK(agree(by_kernel(law, c), by_elements(law, c)));
    }
}

TEST_CASE("Shape forces of straight and folded corners", "[kernels]") {
  // Edges in one line, a hairpin, an edge along the axis, and all of it clockwise.
  Polygon vertices{{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 0.3}, {1, 0.5}, {0.3, 0.2}, {0, 1}, {-0.2, 0.4}};
  for (int turn = 0; turn < 2; ++turn) {
    for (std::size_t start = 0; start < vertices.size(); ++start) {
      std::rotate(vertices.begin(), vertices.begin() + 1, vertices.end());
      for (const ShapeLaw& law : laws) {
        CAPTURE(turn, start, law.k_a, law.k_l, law.k_b, law.relative_area, law.full_edges);
        Configuration<2> c;
        c.add_polygon(vertices, 0.1);
        CHECK(agree(by_kernel(law, c), by_elements(law, c)));
      }
    }
    std::reverse(vertices.begin(), vertices.end());
  }
}

TEST_CASE("Shape forces of mixed particles are added to the range asked for", "[kernels]") {
  Random random(2);
  const Configuration<2> c = mixture(random);
  const Topology& t = c.topology;
  Index soft = 0;
  for (Index m = 0; m < t.particles(); ++m) soft += t.points_of(m) == 1;
  REQUIRE(soft > 5);
  for (const ShapeLaw& law : laws) {
    const std::vector<Real> expected = by_elements(law, c), all = by_kernel(law, c);
    CHECK(agree(all, expected));
    const Index first = 7, last = t.particles() - 5;
    std::vector<Real> before(c.x.size());
    for (Real& a : before) a = random(-1, 1);
    std::vector<Real> f = before;
    add(law, c, first, last, f.data());
    const std::size_t begin = 2 * t.offset[first], end = 2 * t.offset[last];
    bool right = true;
    for (std::size_t k = 0; k < f.size(); ++k)
      if (k < begin || k >= end)
        right = right && f[k] == before[k];
      else
        right = right && std::abs(f[k] - before[k] - expected[k]) <= 1e-12 * largest(expected);
    CHECK(right);
    for (Index m = 0; m < t.particles(); ++m)
      if (t.points_of(m) == 1) CHECK((all[2 * t.offset[m]] == 0 && all[2 * t.offset[m] + 1] == 0));

    // Equal bit for bit, for any neighbours in memory.
    std::vector<Real> one_by_one(c.x.size());
    for (Index m = t.particles() - 1; m >= 0; --m) add(law, c, m, m + 1, one_by_one.data());
    CHECK(one_by_one == all);

    f = before;
    add(law, c, first, first, f.data());
    CHECK(f == before);
  }
}

TEST_CASE("Shape forces keep to their particle's points", "[kernels]") {
  // Arrays of exactly the polygon's size, for memory checkers; with guards around f without a memory checker.
  Random random(3);
  for (const int n : every_size) {
    const Polygon vertices = irregular_polygon(random, n, 0.5);
    const Index offset[2]{0, n};
    const Real a0 = 0.5, l0 = 2.5 / n;
    const std::unique_ptr<Real[]> x(new Real[2 * n]);
    for (int i = 0; i < n; ++i) point<2>(x.get(), i) = vertices[i];
    const std::unique_ptr<Real[]> f(new Real[2 * n]());
    for (const bool full_edges : {false, true}) {
      const ShapeLaw law{{3}, {2}, {0.4, full_edges}};
      std::fill_n(f.get(), 2 * n, 0);
      add_shape_forces(law, offset, &a0, &l0, 0, 1, x.get(), f.get());
      std::vector<Real> guarded(2 * n + 16);
      add_shape_forces(law, offset, &a0, &l0, 0, 1, x.get(), guarded.data() + 8);
      CHECK(std::equal(f.get(), f.get() + 2 * n, guarded.begin() + 8));
      CHECK(largest(guarded) > 0.01);
      CHECK(std::all_of(guarded.begin(), guarded.begin() + 8, [](Real a) { return a == 0; }));
      CHECK(std::all_of(guarded.end() - 8, guarded.end(), [](Real a) { return a == 0; }));
    }
  }
}

TEST_CASE("Shape forces have no resultant and no torque", "[kernels]") {
  Random random(4);
  const Configuration<2> c = mixture(random);
  const Topology& t = c.topology;
  for (const ShapeLaw& law : laws) {
    const std::vector<Real> f = by_kernel(law, c);
    for (Index m = 0; m < t.particles(); ++m) {
      if (t.points_of(m) == 1) continue;
      const Vec<2> centre = mean_of_points<2>(c.x.data(), t, m);
      Vec<2> total = Vec<2>::Zero();
      Real torque = 0, size = 0;
      for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) {
        const Vec<2> r = c.position(i) - centre, fi = point<2>(f.data(), i);
        total += fi;
        torque += r[0] * fi[1] - r[1] * fi[0];
        size += fi.norm();
      }
      CAPTURE(m, t.points_of(m), law.k_a, law.k_l, law.k_b, law.relative_area, law.full_edges);
      REQUIRE(size > 1e-3);
      // The positions' rounding at 50 from the origin turns the edges by about 1e-14/l0.
      CHECK(total.norm() <= 1e-11 * size);
      CHECK(std::abs(torque) <= 1e-11 * size);
    }
  }
}

TEST_CASE("A part of the shape forces that is switched off asks for nothing", "[kernels]") {
  const Index offset[2]{0, 5};
  const Real a0 = 1, l0 = 0, nowhere = std::numeric_limits<Real>::quiet_NaN();
  // Two points coincide: an edge without a direction.
  const std::vector<Real> x{0, 0, 1, 0, 1, 0, 1, 1, 0, 1.5};
  std::vector<Real> f(10);
  add_shape_forces({{2}, {0}, {0}}, offset, &a0, &nowhere, 0, 1, x.data(), f.data());
  const Real pressure = 2 * (1.25 - 1);
  for (int i = 0; i < 5; ++i) {
    const int p = (i + 4) % 5, n = (i + 1) % 5;
    CHECK(f[2 * i] == Approx(-pressure / 2 * (x[2 * n + 1] - x[2 * p + 1])));
    CHECK(f[2 * i + 1] == Approx(-pressure / 2 * (x[2 * p] - x[2 * n])));
  }

  const std::vector<Real> y{0, 0, 1, 0, 1.5, 0.5, 1, 1, 0, 1.5};
  std::fill(f.begin(), f.end(), 0);
  add_shape_forces({{0}, {2}, {0}}, offset, &nowhere, &l0, 0, 1, y.data(), f.data());
  CHECK(f[0] == Approx(2 * 5 * (1.0 + 0.0)));
  CHECK(f[1] == Approx(2 * 5 * (0.0 + 1.5)));

  std::fill(f.begin(), f.end(), 7);
  add_shape_forces({{0}, {0}, {0}}, offset, &nowhere, &nowhere, 0, 1, x.data(), f.data());
  CHECK(f == std::vector<Real>(10, 7));
}

}  // namespace pliant::test::shape_forces_test
