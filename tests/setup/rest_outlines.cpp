// Outlines of rough polygons.
#include <catch2/catch.hpp>

#include <pliant/base/errors.h>
#include <pliant/setup/rest_outlines.h>

namespace pliant::test::rest_outlines_test {

namespace {

Vec<2> extent(const std::vector<Vec<2>>& vertices) {
  Vec<2> low = vertices[0], high = low;
  for (const Vec<2>& r : vertices) low = low.cwiseMin(r), high = high.cwiseMax(r);
  return high - low;
}

void check_edges(const std::vector<Vec<2>>& vertices, Index n) {
  REQUIRE(static_cast<Index>(vertices.size()) == n);
  Vec<2> sum(0, 0);
  for (Index k = 0; k < n; ++k) {
    CHECK((vertices[(k + 1) % n] - vertices[k]).norm() == Approx(1).epsilon(1e-6));
    sum += vertices[k];
  }
  CHECK(sum.norm() < 1e-10 * n);
}

}  // namespace

TEST_CASE("ellipses and rods have equal edges and their aspect, disks included") {
  for (const OutlineKind kind : {OutlineKind::ellipse, OutlineKind::rod})
    for (const Real aspect : {1.0, 1.5, 3.0})
      for (const Index n : {16, 25}) {
        INFO("aspect " << aspect << ", " << n << " vertices");
        const std::vector<Vec<2>> r = rest_outline({kind, aspect}, n);
        check_edges(r, n);
        const Vec<2> size = extent(r) + Vec<2>(1, 1);
        // The extent of a circle's vertices depends on where they are.
        CHECK(size[0] / size[1] == Approx(aspect).epsilon(aspect == 1 ? 0.01 : 1e-6));
        CHECK(outline_radius(r) < 0.5 * size.norm());
        CHECK(outline_radius(r) > 0.48 * size[0]);
      }
  // The vertices of a circle are a regular polygon.
  const std::vector<Vec<2>> circle = rest_outline({OutlineKind::rod, 1}, 12);
  for (const Vec<2>& r : circle) CHECK(r.norm() == Approx(0.5 / std::sin(pi / 12)).epsilon(1e-5));
  CHECK_THROWS_WITH(rest_outline({OutlineKind::ellipse, 8}, 12), Catch::Contains("needs more than 12 vertices"));
}

TEST_CASE("an outline of corners keeps them where edges end there, concave ones too") {
  // A cross of five squares, with vertices at all corners and halfway between them.
  const std::vector<Vec<2>> cross{{1, 0}, {2, 0}, {2, 1}, {3, 1}, {3, 2}, {2, 2},
                                  {2, 3}, {1, 3}, {1, 2}, {0, 2}, {0, 1}, {1, 1}};
  const std::vector<Vec<2>> r = rest_outline({OutlineKind::corners, 1, cross}, 24);
  check_edges(r, 24);
  for (std::size_t k = 0; k < cross.size(); ++k) CHECK((r[2 * k] - 2 * (cross[k] - Vec<2>(1.5, 1.5))).norm() < 1e-5);
  // Five squares of 2 × 2, and a disk at each of 24 vertices: halves at edges, a quarter in each of the four inner
  // corners, three quarters in each of the eight outer corners.
  CHECK(outline_area(r) == Approx(20 + pi / 4 * (12 * 0.5 + 4 * 0.25 + 8 * 0.75)).epsilon(1e-5));
  CHECK(outline_radius(r) == Approx(std::hypot(1, 3) + 0.5).epsilon(1e-5));
}

}  // namespace pliant::test::rest_outlines_test
