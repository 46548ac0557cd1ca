// Sizes, masses and shapes of the particles that a run starts with.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <pliant/base/errors.h>
#include <pliant/model/polygon.h>
#include <pliant/setup/particles.h>

namespace pliant::test::particles_test {
namespace {

Real mean(const std::vector<Real>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<Real>(values.size());
}

Real edge_length(const Real* x, const Topology& topology, Index i) {
  return (point<2>(x, topology.next[i]) - point<2>(x, i)).norm();
}

}  // namespace

TEST_CASE("a bidisperse mixture is half small, half large, with mean 1", "[particles]") {
  const std::vector<Real> sigma = draw_diameters({}, 1000, 7);
  REQUIRE(sigma.size() == 1000);
  const auto count = [&](Real a) {
    return std::count_if(sigma.begin(), sigma.end(), [a](Real s) { return std::abs(s - a) < 1e-15; });
  };
  CHECK(count(1 / 1.2) == 500);
  CHECK(count(1.4 / 1.2) == 500);
  CHECK(mean(sigma) == Approx(1).epsilon(1e-14));

  // In random order: neither sorted nor alternating.
  Index changes = 0;
  for (std::size_t m = 1; m < sigma.size(); ++m) changes += sigma[m] != sigma[m - 1];
  CHECK(changes > 400);
  CHECK(changes < 600);
}

TEST_CASE("ratio and fraction of a bidisperse mixture keep the mean", "[particles]") {
  SizeDistribution d;
  d.ratio = 2;
  d.fraction = 0.2;
  const std::vector<Real> sigma = draw_diameters(d, 500, 3);
  const auto [small, large] = std::minmax_element(sigma.begin(), sigma.end());
  CHECK(*large / *small == Approx(2).epsilon(1e-14));
  CHECK(std::count(sigma.begin(), sigma.end(), *large) == 100);
  CHECK(mean(sigma) == Approx(1).epsilon(1e-14));

  d.fraction = 0;
  CHECK(draw_diameters(d, 3, 3) == std::vector<Real>(3, 1.0));
  d.fraction = 1;
  CHECK(draw_diameters(d, 3, 3) == std::vector<Real>(3, 1.0));
}

TEST_CASE("normal diameters have their mean and deviation and are cut at three deviations", "[particles]") {
  SizeDistribution d;
  d.kind = "normal";
  d.deviation = 0.1;
  const Index n = 20000;
  const std::vector<Real> sigma = draw_diameters(d, n, 11);
  CHECK(std::abs(mean(sigma) - 1) < 4 * 0.1 / std::sqrt(n));
  Real variance = 0;
  for (const Real s : sigma) variance += square(s - 1) / n;
  // Variance of a normal distribution cut at ±3: 1 − 6 φ(3)/(2 Φ(3) − 1) = 0.97334 of the variance.
  CHECK(variance == Approx(0.97334 * 0.01).epsilon(4 * std::sqrt(2.0 / n)));
  const auto [least, most] = std::minmax_element(sigma.begin(), sigma.end());
  CHECK(*least >= 0.7);
  CHECK(*most <= 1.3);
  CHECK(*most > 1.27);  // the cut is at three, not before

  // A particle's own draw: not a matter of how many there are.
  const std::vector<Real> fewer = draw_diameters(d, 100, 11);
  CHECK(std::equal(fewer.begin(), fewer.end(), sigma.begin()));

  d.deviation = 0.3 + 1e-9;
  CHECK_THROWS_AS(draw_diameters(d, 10, 1), InputError);
  d.deviation = 0;
  CHECK(draw_diameters(d, 4, 1) == std::vector<Real>(4, 1.0));
}

TEST_CASE("radii of droplets: two kinds, each spread about its mean", "[particles]") {
  const Index n = 4000;
  const std::vector<Real> sharp = draw_radii({.small_fraction = 0.3, .small = 0.765}, n, 5);
  CHECK(std::count(sharp.begin(), sharp.end(), 0.765) == 1200);
  CHECK(std::count(sharp.begin(), sharp.end(), 1.0) == 2800);
  CHECK(std::count(sharp.begin(), sharp.begin() + n / 2, 0.765) == Approx(600).margin(80));  // in random places
  const std::vector<Real> spread = draw_radii({.deviation = 0.02, .small_fraction = 0.3, .small = 0.765}, n, 5);
  Real sum = 0, squares = 0;
  for (Index m = 0; m < n; ++m) {
    const Real z = (spread[m] / sharp[m] - 1) / 0.02;
    CHECK(std::abs(z) <= 3);
    sum += z;
    squares += z * z;
  }
  CHECK(sum / n == Approx(0).margin(4 / std::sqrt(Real(n))));
  CHECK(squares / n == Approx(0.973).margin(0.1));  // cut at three deviations
  CHECK(draw_radii({.deviation = 0.02}, 10, 1) != draw_radii({.deviation = 0.02}, 10, 2));
}

TEST_CASE("diameters are a function of the seed", "[particles]") {
  for (const char* kind : {"bidisperse", "normal"}) {
    SizeDistribution d;
    d.kind = kind;
    CHECK(draw_diameters(d, 200, 5) == draw_diameters(d, 200, 5));
    CHECK(draw_diameters(d, 200, 5) != draw_diameters(d, 200, 6));
  }
  SizeDistribution mono;
  mono.kind = "mono";
  CHECK(draw_diameters(mono, 3, 9) == std::vector<Real>(3, 1.0));
}

TEST_CASE("particles have density 1", "[particles]") {
  const std::vector<Real> sigma{0.8, 1.2};
  const PolygonShape shape;
  const Topology disks = make_particles(ModelKind::sp, 2, sigma, shape);
  const Topology spheres = make_particles(ModelKind::sp, 3, sigma, shape);
  for (Index m = 0; m < 2; ++m) {
    const Real area = pi * square(sigma[m]) / 4, volume = pi * std::pow(sigma[m], 3) / 6;
    CHECK(disks.a0[m] == Approx(area).epsilon(1e-14));
    CHECK(disks.mass(m) == Approx(area).epsilon(1e-14));
    CHECK(disks.diameter[m] == sigma[m]);
    CHECK(spheres.a0[m] == Approx(volume).epsilon(1e-14));
    CHECK(spheres.mass(m) == Approx(volume).epsilon(1e-14));
    for (const ModelKind kind : {ModelKind::rough, ModelKind::smooth}) {
      const Topology polygons = make_particles(kind, 2, sigma, shape);
      REQUIRE(polygons.points_of(m) == 16);
      CHECK(polygons.a0[m] == Approx(area).epsilon(1e-14));
      CHECK(polygons.sigma[m] == Approx(sigma[m]).epsilon(1e-14));
      Real mass = 0;
      for (Index i = polygons.offset[m]; i < polygons.offset[m + 1]; ++i) {
        mass += polygons.mass(i);
        CHECK(polygons.mass(i) == Approx(area / 16).epsilon(1e-14));
        CHECK(polygons.diameter[i] == Approx((kind == ModelKind::rough ? 1 : 0.1) * polygons.l0[m]).epsilon(1e-14));
      }
      CHECK(mass == Approx(area).epsilon(1e-13));
    }
  }
}

TEST_CASE("a polygon starts regular, with its rest area around its centre", "[particles]") {
  const Index n = GENERATE(3, 4, 16, 40);
  PolygonShape shape;
  shape.vertices = n;
  const Topology topology = make_particles(ModelKind::rough, 2, {1.3, 0.7}, shape);
  std::vector<Real> x(2 * topology.points());
  const Vec<2> centre(3, -2);
  const Real angle = 0.4;
  for (Index m = 0; m < 2; ++m) {
    place_particle(topology, m, centre.data(), angle, x.data());
    CHECK(polygon_area(x.data(), topology, m) == Approx(topology.a0[m]).epsilon(1e-12));
    CHECK((mean_of_points<2>(x.data(), topology, m) - centre).norm() < 1e-13);
    const Vec<2> first = point<2>(x.data(), topology.offset[m]) - centre;
    CHECK(std::atan2(first[1], first[0]) == Approx(angle).epsilon(1e-12));
    for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
      CHECK(edge_length(x.data(), topology, i) == Approx(topology.l0[m]).epsilon(1e-12));  // at rest
      CHECK((point<2>(x.data(), i) - centre).norm() + topology.diameter[i] / 2 ==
            Approx(outer_radius(topology, m)).epsilon(1e-12));
    }
  }
}

TEST_CASE("the shape parameter sets the rest perimeter at the same area", "[particles]") {
  CHECK(regular_shape_parameter(16) == Approx(1.0130).epsilon(1e-4));
  CHECK(regular_shape_parameter(4) == Approx(4 / pi).epsilon(1e-14));
  PolygonShape shape;
  shape.vertices = 12;
  for (const Real wanted : {0.0, 1.1, 1.5}) {
    shape.shape_parameter = wanted;
    const Topology topology = make_particles(ModelKind::smooth, 2, {0.9}, shape);
    CHECK(topology.a0[0] == Approx(pi * square(0.9) / 4).epsilon(1e-14));
    CHECK(square(12 * topology.l0[0]) / (4 * pi * topology.a0[0]) ==
          Approx(wanted > 0 ? wanted : regular_shape_parameter(12)).epsilon(1e-13));
  }
}

TEST_CASE("above the regular shape parameter a polygon starts at rest too: its area, all edges l0, no corners inwards",
          "[particles]") {
  for (const Index n : {4, 5, 8, 9, 16, 17, 64})
    for (const Real parameter : {1.02, 1.15, 1.5, 2.0, 2.3}) {
      if (parameter < regular_shape_parameter(n)) continue;
      if (n == 5 && parameter >= 2) continue;  // five edges have no such area
      INFO(n << " vertices, shape parameter " << parameter);
      PolygonShape shape;
      shape.vertices = n;
      shape.shape_parameter = parameter;
      const Topology topology = make_particles(ModelKind::rough, 2, {1.3, 0.7}, shape);
      std::vector<Real> x(2 * topology.points());
      const Vec<2> centre(3, -2);
      for (Index m = 0; m < 2; ++m) {
        place_particle(topology, m, centre.data(), 0.4, x.data());
        CHECK(polygon_area(x.data(), topology, m) == Approx(topology.a0[m]).epsilon(1e-8));
        CHECK((mean_of_points<2>(x.data(), topology, m) - centre).norm() < 1e-12);
        CHECK(!self_intersects(x.data(), topology, m));
        Real farthest = 0, sharpest = 0;
        for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) {
          CHECK(edge_length(x.data(), topology, i) == Approx(topology.l0[m]).epsilon(1e-10));
          farthest = std::max(farthest, (point<2>(x.data(), i) - centre).norm() + topology.diameter[i] / 2);
          const Vec<2> u = point<2>(x.data(), i) - point<2>(x.data(), topology.previous[i]),
                       w = point<2>(x.data(), topology.next[i]) - point<2>(x.data(), i);
          sharpest = std::max(sharpest, std::acos(std::clamp(u.dot(w) / (u.norm() * w.norm()), -1.0, 1.0)));
        }
        CHECK(outer_radius(topology, m) == Approx(farthest).epsilon(1e-9));
        if (n >= 16 && parameter < 2.1) CHECK(sharpest < pi / 2);
      }
    }
}

TEST_CASE("a shape parameter that equal edges cannot have is refused", "[particles]") {
  PolygonShape shape;
  shape.vertices = 3;
  shape.shape_parameter = 1.8;
  CHECK_THROWS_WITH(make_particles(ModelKind::rough, 2, {1}, shape), Catch::Contains("have at most 1.654"));
  shape.vertices = 5;
  shape.shape_parameter = 3;
  CHECK_THROWS_AS(make_particles(ModelKind::rough, 2, {1}, shape), InputError);
}

TEST_CASE("a soft particle is placed at its centre", "[particles]") {
  const Topology topology = make_particles(ModelKind::sp, 3, {1, 2}, {});
  std::vector<Real> x(6, 9);
  const Vec<3> centre(1, 2, 3);
  place_particle(topology, 1, centre.data(), 0.3, x.data());
  CHECK(x == std::vector<Real>{9, 9, 9, 1, 2, 3});
  CHECK(outer_radius(topology, 1) == 1);
}

}  // namespace pliant::test::particles_test
