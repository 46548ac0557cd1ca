// Solids, and the volumes that spheres share with spheres and with depletion layers, against quadrature.
#include <catch2/catch.hpp>

#include <pliant/geometry/overlap.h>

#include "support/random.h"

namespace pliant::test::overlap_test {

namespace {

constexpr Real radius = 1.05, layer = 0.05;

Solid<2> wedge(Real opening) { return Solid<2>::wedge({0, 0}, {1, 0}, {std::cos(opening), -std::sin(opening)}); }

/// The sphere as a density on the plane, integrated along rays from its centre. The part within the layer is convex, so
/// that a ray meets it in one interval, which the distance function finds, and that it all lies beyond the tangent at
/// its nearest point.
Real volume_by_rays(const Solid<2>& solid, const Vec<2>& p) {
  const int rays = 2000;
  const WallFoot<2> foot = solid.foot(p);
  if (foot.d - layer >= radius) return 0;
  const Real half = std::acos((foot.d - layer) / radius), middle = std::atan2(-foot.n[1], -foot.n[0]);
  Real sum = 0;
  for (int k = 0; k < rays; ++k) {
    const Real angle = middle + half * (2 * (k + 0.5) / rays - 1);
    const Vec<2> u(std::cos(angle), std::sin(angle));
    const auto depth = [&](Real s) { return solid.foot(p + s * u).d - layer; };
    // The lowest point of a convex function, then the crossings on either side.
    Real low = 0, high = radius;
    for (int i = 0; i < 45; ++i) {
      const Real a = low + (high - low) / 3, b = high - (high - low) / 3;
      (depth(a) < depth(b) ? high : low) = depth(a) < depth(b) ? b : a;
    }
    if (depth(low) >= 0) continue;
    const auto crossing = [&](Real in, Real out) {
      if (depth(out) < 0) return out;
      for (int i = 0; i < 45; ++i) (depth((in + out) / 2) < 0 ? in : out) = (in + out) / 2;
      return out;
    };
    const auto inner = [](Real s) { return std::pow(square(radius) - square(s), 1.5); };
    sum += inner(crossing(low, 0)) - inner(crossing(low, radius));
  }
  return sum * 2 / 3 * 2 * half / rays;
}

}  // namespace

TEST_CASE("the lens of two spheres is the integral of its cross-sections") {
  for (const auto& [a, b, r] : {std::array{1.0, 1.0, 1.9}, {1.05, 0.815, 1.7}, {2.0, 0.5, 1.6}, {1.0, 0.3, 0.75}}) {
    // The disk at x on the line of centres belongs to the narrower of the spheres there.
    const int n = 200000;
    Real sum = 0;
    for (int k = 0; k < n; ++k) {
      const Real x = r - b + (a + b - r) * (k + 0.5) / n;
      sum += pi * std::max(Real(0), std::min(square(a) - square(x), square(b) - square(x - r))) * (a + b - r) / n;
    }
    CAPTURE(a, b, r);
    CHECK(lens_volume(r, a, b).value == Approx(sum).epsilon(1e-8));
  }
  CHECK(lens_volume(2, 1, 1).value == 0);
  CHECK(lens_volume(2.1, 1, 1).value == 0);
}

TEST_CASE("the distance from a wedge is the least over its points") {
  Random random(1);
  const Vec<2> tip(0.3, -0.7);
  for (const Real opening : {0.4, pi / 4, pi / 2, 2.6}) {
    const Real turn = random(0, 2 * pi);
    const auto direction = [&](Real angle) { return Vec<2>(std::cos(turn + angle), std::sin(turn + angle)); };
    const Solid<2> solid = Solid<2>::wedge(tip, direction(0), direction(opening));
    CHECK(solid.opening == Approx(opening));
    for (int k = 0; k < 200; ++k) {
      const Vec<2> w(random(-2, 2), random(-2, 2));
      const Real angle = std::remainder(std::atan2(w[1], w[0]) - turn - opening / 2, 2 * pi);
      const bool inside = std::abs(angle) < opening / 2;
      Real least = 1e9;
      for (int i = 0; i <= 3000; ++i)
        for (const Real face : {Real(0), opening}) least = std::min(least, (w - i * 1e-3 * direction(face)).norm());
      const WallFoot<2> foot = solid.foot(tip + w);
      CHECK(foot.d == Approx(inside ? -least : least).margin(1e-3));
      CHECK(foot.n.norm() == Approx(1));
    }
  }
}

TEST_CASE("wedges and walls without a direction are refused") {
  CHECK_THROWS_AS(Solid<2>::half_space({0, 0}, {0, 0}), InputError);
  CHECK_THROWS_AS(Solid<2>::wedge({0, 0}, {1, 0}, {0, 0}), InputError);
  CHECK_THROWS_AS(Solid<2>::wedge({0, 0}, {1, 0}, {-2, 0}), InputError);
  CHECK_THROWS_AS(Solid<2>::wedge({0, 0}, {1, 0}, {2, 0}), InputError);
}

TEST_CASE("the overlap with a wedge's layer agrees with quadrature all round the tip") {
  for (const Real opening : {0.5, pi / 4, pi / 2, 2.5}) {
    const Solid<2> solid = wedge(opening);
    int acts = 0;
    for (const Real distance : {0.12, 0.4, 0.85, 1.0, 1.07})
      for (int k = 0; k < 12; ++k) {
        const Real angle = 2 * pi * (k + 0.37) / 12;
        const Vec<2> p = distance * Vec<2>(std::cos(angle), std::sin(angle));
        if (solid.foot(p).d < layer + 0.01) continue;
        const Real expected = volume_by_rays(solid, p);
        acts += expected > 0;
        CAPTURE(opening, distance, angle, solid.foot(p).d);
        CHECK(wedge_overlap(p, opening, radius, layer).value == Approx(expected).epsilon(1e-4).margin(1e-6));
      }
    CHECK(acts > 20);
  }
}

TEST_CASE("far from the tip the overlap is that with a half-space") {
  for (const Real h : {0.5, 0.9, 0.985, 1.05}) {
    const Radial cap = cap_volume(h - layer, radius);
    const Expansion<2> near = wedge_overlap({1.2, h}, pi / 4, radius, layer);
    CAPTURE(h);
    CHECK(near.value == Approx(cap.value).epsilon(1e-12));
    CHECK(near.gradient[1] == Approx(cap.slope).epsilon(1e-13));
    CHECK(std::abs(near.gradient[0]) < 1e-15);
    CHECK(near.hessian(1, 1) == Approx(cap.curvature).epsilon(1e-13));
    // And over the other face, which is a mirror image.
    const Solid<2> solid = wedge(pi / 4);
    const Vec<2> p = 1.2 * solid.second_along() + h * solid.second_out();
    CHECK(wedge_overlap(p, pi / 4, radius, layer).value == Approx(cap.value).epsilon(1e-12));
  }
  // Half of a half-space: over the tip of a right angle in line with a face, and beyond the reach.
  CHECK(wedge_overlap({-0.5, 1.101}, pi / 2, radius, layer).value == 0);
  CHECK(wedge_overlap({3, 1.101}, pi / 2, radius, layer).value == 0);
}

TEST_CASE("the overlap of a wedge does not depend on its place, turn and handedness, in the plane and in space") {
  Random random(5);
  for (int k = 0; k < 20; ++k) {
    const Real opening = random(0.4, 2.6);
    const Vec<2> p = random(0.5, 1.0) *
                     Vec<2>(std::cos(pi - opening / 2 + random(-1, 1)), std::sin(pi - opening / 2 + random(-1, 1)));
    if (wedge(opening).foot(p).d < 0.1) continue;
    const Expansion<2> expected = wedge_overlap(p, opening, radius, layer);
    Eigen::Quaterniond turn(random(-1, 1), random(-1, 1), random(-1, 1), random(-1, 1));
    turn.normalize();
    const Vec<3> tip(random(-3, 3), random(-3, 3), random(-3, 3));
    const auto place = [&](const Vec<2>& a) { return Vec<3>(turn * Vec<3>(a[0], a[1], 0)); };
    const Solid<3> solid = Solid<3>::wedge(tip, place({std::cos(opening), -std::sin(opening)}), place({2, 0}));
    const Vec<3> r = tip + place(p) + random(-5, 5) * (turn * Vec<3>(0, 0, 1));
    const Expansion<3> v = layer_overlap<3>(solid, r, radius, layer);
    CHECK(v.value == Approx(expected.value).epsilon(1e-12));
    CHECK((v.gradient - place(expected.gradient)).norm() < 1e-12);
  }
}

}  // namespace pliant::test::overlap_test
