// The shape energy of [H 8] for a smooth outline drawn with more and more vertices.
#include <catch2/catch.hpp>

#include <pliant/model/bending.h>
#include <pliant/model/perimeter.h>

#include "support/configurations.h"

namespace pliant::test::shape_limit_test {

namespace {

constexpr Real semi_major = 0.7, semi_minor = 0.4;

Vec<2> ellipse(Real phi) { return {semi_major * std::cos(phi), semi_minor * std::sin(phi)}; }
Real speed(Real phi) { return std::hypot(semi_major * std::sin(phi), semi_minor * std::cos(phi)); }
Real curvature(Real phi) { return semi_major * semi_minor / std::pow(speed(phi), 3); }

/// ∫ f ds over the ellipse: the trapezoidal rule converges exponentially for periodic functions.
template <class F>
Real over_arc(F&& f) {
  constexpr int n = 2000;
  Real sum = 0;
  for (int k = 0; k < n; ++k) sum += f(2 * pi * k / n) * speed(2 * pi * k / n);
  return sum * 2 * pi / n;
}

/// n points of the ellipse at equal distances of arc.
Polygon resampled(int n) {
  const Real length = over_arc([](Real) { return 1.0; });
  constexpr int fine = 200000;
  Polygon vertices;
  Real arc = 0;
  for (int k = 0; k < fine && static_cast<int>(vertices.size()) < n; ++k) {
    const Real phi = 2 * pi * k / fine, step = speed(phi + pi / fine) * 2 * pi / fine;
    const Real target = length * static_cast<Real>(vertices.size()) / n;
    if (arc + step > target) vertices.push_back(ellipse(phi + (target - arc) / step * 2 * pi / fine));
    arc += step;
  }
  return vertices;
}

}  // namespace

// [H]: "The factor of N_v in the numerator of the second term and in the denominator of the third ensure that U does
// not depend on N_v". Meant: the outline, a0, the shape parameter 𝒜0 = (Nv l0)²/(4π a0), k_l and k_b stay, so that l0 =
// L0/Nv with a fixed L0. Then with edges of equal length, L the perimeter and κ the curvature,
//   k_l Nv/2 Σ (l_i − l0)² → k_l/2 (L − L0)²,   k_b/(2Nv) Σ |Δl̂_i/l0|² → k_b/2 (L/L0)² ⟨κ²⟩, a mean over s.
TEST_CASE("the shape energy tends to a limit as the vertices become many") {
  const Real length = over_arc([](Real) { return 1.0; }), rest = 0.9 * length, k_l = 3, k_b = 0.2;
  const Real perimeter_limit = k_l / 2 * square(length - rest);
  const Real bending_limit =
      k_b / 2 * square(length / rest) * over_arc([](Real phi) { return square(curvature(phi)); }) / length;
  std::vector<Real> h, perimeter_error, bending_error;
  for (const int n : {16, 32, 64, 128, 256}) {
    Configuration<2> c;
    c.add_polygon(resampled(n), 0.1);
    REQUIRE(c.topology.points() == n);
    c.topology.l0[0] = rest / n;
    h.push_back(1.0 / n);
    perimeter_error.push_back(std::abs(alone<2>(Perimeter{k_l})->energy(c.view()) / perimeter_limit - 1));
    bending_error.push_back(std::abs(alone<2>(Bending{k_b})->energy(c.view()) / bending_limit - 1));
  }
  // A factor Nv too many or too few would give orders ∓1.
  CHECK(observed_order(h, perimeter_error) > 1.9);
  CHECK(observed_order(h, bending_error) > 1.9);
  CHECK(perimeter_error.back() < 1e-3);
  CHECK(bending_error.back() < 1e-3);
}

}  // namespace pliant::test::shape_limit_test
