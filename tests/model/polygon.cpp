#include <catch2/catch.hpp>

#include "support/configurations.h"

namespace pliant::test::polygon_test {

namespace {

Configuration<2> with(const Polygon& polygon) {
  Configuration<2> c;
  c.add_polygon(polygon, 0.1);
  return c;
}
Real area(const Configuration<2>& c, Index m = 0) { return polygon_area(c.x.data(), c.topology, m); }
bool self_intersecting(const Polygon& polygon) {
  const Configuration<2> c = with(polygon);
  return self_intersects(c.x.data(), c.topology, 0);
}

}  // namespace

TEST_CASE("area, perimeter and centre of known polygons") {
  const Configuration<2> triangle = with({{0, 0}, {4, 0}, {0, 3}});
  CHECK(area(triangle) == 6);
  CHECK(polygon_perimeter(triangle.x.data(), triangle.topology, 0) == 12);
  CHECK(shortest_edge(triangle.x.data(), triangle.topology, 0) == 3);
  CHECK((mean_of_points<2>(triangle.x.data(), triangle.topology, 0) - Vec<2>(4.0 / 3, 1)).norm() < 1e-15);
  CHECK(area(with({{0, 0}, {0, 3}, {4, 0}})) == -6);                         // clockwise
  CHECK(area(with({{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}})) == 3);  // an L
  for (const int n : {3, 5, 16}) {
    const Configuration<2> c = with(regular_polygon(n, 0.5, {1, 2}, 0.3));
    CHECK(area(c) == Approx(n * 0.125 * std::sin(2 * pi / n)));
    CHECK(polygon_perimeter(c.x.data(), c.topology, 0) == Approx(n * std::sin(pi / n)));
  }
}

TEST_CASE("areas of the second particle, and a regular 16-gon of the initial shape of [H 8]") {
  Configuration<2> c = with({{0, 0}, {4, 0}, {0, 3}});
  const Real a0 = pi / 4, l0 = std::sqrt(4 * a0 * 16 * std::tan(pi / 16)) / 16;
  c.add_polygon(regular_polygon(16, l0 / (2 * std::sin(pi / 16)), {5, 5}), 0.1);
  CHECK(area(c, 1) == Approx(a0));
  CHECK(square(polygon_perimeter(c.x.data(), c.topology, 1)) / (4 * pi * area(c, 1)) == Approx(1.013).margin(5e-4));
}

TEST_CASE("area keeps its digits far from the origin") {
  const Real far = 1048576, side = 1.0 / 1024;  // both exact in binary
  const Configuration<2> c = with({{far, far}, {far + side, far}, {far + side, far + side}, {far, far + side}});
  CHECK(area(c) == side * side);
}

TEST_CASE("area gradient is the derivative of the area") {
  Random random(4);
  const Configuration<2> c = with(irregular_polygon(random, 9, 0.8));
  for (Index i = 0; i < 9; ++i)
    for (int k = 0; k < 2; ++k) {
      Configuration<2> moved = with(vertices_of(c, 0));
      moved.x[2 * i + k] += 0.25;  // linear in each coordinate: exact
      CHECK(area(moved) - area(c) == Approx(0.25 * area_gradient(c.x.data(), c.topology, i)[k]));
    }
}

TEST_CASE("self-intersection") {
  CHECK(!self_intersecting({{0, 0}, {1, 0}, {0, 1}}));
  CHECK(!self_intersecting(regular_polygon(16, 1)));
  CHECK(!self_intersecting({{0, 0}, {2, 0}, {2, 2}, {1, 0.5}, {0, 2}}));       // concave
  CHECK(self_intersecting({{0, 0}, {1, 1}, {1, 0}, {0, 1}}));                  // bow-tie
  CHECK(self_intersecting({{0, 0}, {2, 0}, {2, 2}, {1, -0.1}, {0, 2}}));       // the notch pierces the base
  CHECK(self_intersecting({{0, 0}, {2, 0}, {2, 2}, {1, 0}, {0, 2}}));          // a vertex on an edge
  CHECK(self_intersecting({{0, 0}, {1, 0}, {2, 1}, {1, 0}, {0, 1}}));          // two vertices in one place
  CHECK(self_intersecting({{0, 0}, {3, 0}, {3, 1}, {2, 0}, {1, 0}, {0, 1}}));  // edges on top of each other
  Random random(0);
  for (int k = 0; k < 50; ++k) CHECK(!self_intersecting(irregular_polygon(random, 12, 1)));  // star-shaped
}

TEST_CASE("points inside polygons") {
  const Configuration<2> c = with({{0, 0}, {2, 0}, {2, 2}, {1, 0.5}, {0, 2}});
  const auto inside = [&](Real px, Real py) { return inside_polygon(c.x.data(), c.topology, 0, {px, py}); };
  CHECK(inside(1, 0.25));
  CHECK(inside(0.2, 1));
  CHECK(inside(1.8, 1.5));
  CHECK(!inside(1, 1));  // in the notch
  CHECK(!inside(1, -0.1));
  CHECK(!inside(-0.5, 0));  // level with a vertex
  CHECK(!inside(3, 2));
  // Against winding numbers.
  Random random(7);
  for (int k = 0; k < 500; ++k) {
    const Vec<2> p(random(-0.5, 2.5), random(-0.5, 2.5));
    Real turns = 0;
    const Polygon vertices = vertices_of(c, 0);
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const Vec<2> a = vertices[i] - p, b = vertices[(i + 1) % vertices.size()] - p;
      turns += std::atan2(a[0] * b[1] - a[1] * b[0], a.dot(b)) / (2 * pi);
    }
    CHECK(inside(p[0], p[1]) == (turns > 0.5));
  }
}

TEST_CASE("the relative area energy is one modulus for all sizes, the bending of full edges that of edges at rest") {
  // Squares of side 1.1 s, whose area at rest is s².
  for (const Real s : {0.5, 1.0, 2.0}) {
    Configuration<2> c;
    c.add_polygon({{0, 0}, {1.1 * s, 0}, {1.1 * s, 1.1 * s}, {0, 1.1 * s}}, 0.1);
    c.topology.a0[0] = s * s;
    c.topology.l0[0] = s;
    const auto area = [&](AreaEnergy form) { return alone<2>(Area{30, form})->energy(c.view()); };
    CHECK(area(AreaEnergy::absolute) == Approx(15 * square(0.21 * s * s)));
    CHECK(area(AreaEnergy::relative) == Approx(15 * s * s * square(0.21)));
    // A pressure of 30 · 0.21 on half of both sides.
    std::vector<Real> f(8);
    alone<2>(Area{30, AreaEnergy::relative})->forces(c.view(), f.data());
    CHECK(f[0] == Approx(30 * 0.21 * 1.1 * s / 2));
    // Four corners, the difference of two edges is √2 times as long as one.
    const auto bending = [&](EdgeVectors edges) { return alone<2>(Bending{0.8, edges})->energy(c.view()); };
    CHECK(bending(EdgeVectors::unit) == Approx(0.8 / 8 * 4 * 2 / (s * s)));
    CHECK(bending(EdgeVectors::full) == Approx(0.8 / 8 * 4 * 2 * square(1.1) / (s * s)));
  }
}

TEST_CASE("the fastest rate of bending goes as 1/l of edges that have shrunk, of full vectors it stays") {
  constexpr Index n = 64;  // nearly straight at each corner
  for (const EdgeVectors edges : {EdgeVectors::unit, EdgeVectors::full})
    for (const Real part : {1.0, 0.1}) {
      const Bending bending{0.7, edges};
      Configuration<2> c = with(regular_polygon(n, 1));
      c.topology.l0[0] = 2 * std::sin(pi / n) / part;
      DenseSink<2> sink(n);
      alone<2>(bending)->hessian(c.view(), sink);
      const Real stiffest = Eigen::SelfAdjointEigenSolver<MatrixXd>(sink.matrix).eigenvalues().maxCoeff();
      CHECK(std::sqrt(stiffest / c.topology.point_mass[0]) ==
            Approx(bending.max_rate(c.topology) / (edges == EdgeVectors::unit ? part : 1)).epsilon(0.02));
    }
}

}  // namespace pliant::test::polygon_test
