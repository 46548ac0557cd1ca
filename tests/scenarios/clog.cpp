#include <catch2/catch.hpp>
#include <cmath>

#include <pliant/scenarios/clog/clog.h>

namespace pliant::test::clog_test {

namespace {

/// The smallest gaps of droplets to each other and to the walls.
Real smallest_gap(const ClogOptions& p, const std::vector<Real>& radii, const std::vector<Real>& x) {
  const Real angle = p.angle * pi / 180;
  Real gap = 1e9;
  for (std::size_t i = 0; i < radii.size(); ++i) {
    const pliant::Vec<2> r = point<2>(x.data(), static_cast<Index>(i));
    const Real to_wall = (p.half_width() - std::abs(r[0])) * std::cos(angle) + r[1] * std::sin(angle);
    gap = std::min({gap, r[1] - radii[i], to_wall - radii[i]});
    for (std::size_t j = 0; j < i; ++j)
      gap = std::min(gap, (r - point<2>(x.data(), static_cast<Index>(j))).norm() - radii[i] - radii[j]);
  }
  return gap;
}

Real top(const std::vector<Real>& x) {
  Real y = 0;
  for (std::size_t k = 1; k < x.size(); k += 2) y = std::max(y, x[k]);
  return y;
}

}  // namespace

TEST_CASE("droplets start in the wedge without overlap") {
  ClogOptions p;
  std::vector<Real> radii(60);
  for (std::size_t k = 0; k < radii.size(); ++k) radii[k] = 0.9 + 0.2 * static_cast<Real>(k % 7) / 6;
  for (const Real angle : {20., 45., 70.})
    for (const Real width : {0.5, 3.}) {
      p.angle = angle;
      p.width = width;
      const std::vector<Real> x = fill_wedge(p, radii);
      REQUIRE(x.size() == 2 * radii.size());
      CHECK(smallest_gap(p, radii, x) >= 0);
      CHECK(smallest_gap(p, radii, x) < 0.5);
      CHECK(x == fill_wedge(p, radii));
    }
  const std::vector<Real> x = fill_wedge(p, radii);
  p.seed = 2;
  CHECK(x != fill_wedge(p, radii));
  SECTION("as high as the fraction asks for, or higher where they do not fit") {
    p.angle = 45;
    p.fill_fraction = 0.1;
    Real content = 0;
    for (const Real r : radii) content += pi * square(r);
    const Real half = p.half_width(), high = std::sqrt(square(half) + content / p.fill_fraction) - half;
    CHECK(top(fill_wedge(p, radii)) < high);
    CHECK(top(fill_wedge(p, radii)) > 0.8 * high);
    p.width = 0.1;
    p.fill_fraction = 0.5;
    CHECK(smallest_gap(p, radii, fill_wedge(p, radii)) >= 0);
  }
}

TEST_CASE("the granular capillary length [T 4.9, 4.10]") {
  // Where contact and depletion balance, 10 (1 − d/2) is the force of both.
  const auto length = [](Real phi_c, Real g) { return capillary_length({{{phi_c, 0.05}}, {10}}, g); };
  const Real d = 1.99313, force = 10 * (1 - d / 2);
  CHECK(length(1e-4, 0.01) == Approx(std::sqrt(force / pi / 0.01)).epsilon(5e-3));
  CHECK(length(7.5e-5, 0.01) == Approx(0.90).epsilon(0.02));  // as in [T 4.3]
  CHECK(length(1e-4, 0.04) == Approx(length(1e-4, 0.01) / 2));
  CHECK(length(0, 0.01) == 0);
}

}  // namespace pliant::test::clog_test
