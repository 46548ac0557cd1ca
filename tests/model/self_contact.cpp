// Outlines that come near themselves: the contact that prevents crossings, and the checks that find crossings.
#include <catch2/catch.hpp>

#include <pliant/model/crossing.h>
#include <pliant/model/self_contact.h>

#include "support/configurations.h"
#include "support/derivatives.h"

namespace pliant::test::self_contact_test {

namespace {

constexpr Real epsilon = 1e3, delta = 0.1;

Configuration<2> with(const Polygon& polygon, Real diameter = delta) {
  Configuration<2> c;
  c.add_polygon(polygon, diameter);
  return c;
}

/// A polygon with a slot that is about 0.08 wide; its walls meet with vertices, edges and ends.
Configuration<2> slotted(Random& random, Real diameter = delta) {
  Polygon all{{0, 0},       {3, 0},      {3, 2},       {1.54, 2},   {1.55, 1.4},
              {1.54, 0.48}, {1.46, 0.5}, {1.45, 1.15}, {1.46, 1.9}, {0, 2}};
  const Eigen::Rotation2D<Real> turn(random(0, 2 * pi));
  for (Vec<2>& r : all) r = turn * (r + Vec<2>(random(-0.012, 0.012), random(-0.012, 0.012)));
  return with(all, diameter);
}

/// The edges from (0, −0.5) by (2, 0) to (4, −0.5), and a tip that hangs over them at `tip`.
Configuration<2> tip_over_corner(const Vec<2>& tip) {
  return with({{0, -0.5}, {2, 0}, {4, -0.5}, {4, 3}, {2.2, 3}, tip, {1.8, 3}, {0, 3}});
}

Real energy(const SelfContact& term, Configuration<2>& c) { return alone<2>(term)->energy(c.view()); }

/// Least distance of a vertex to an edge that does not end there.
Real least_distance(const Polygon& r) {
  const std::size_t n = r.size();
  Real least = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (j != i && (j + 1) % n != i) least = std::min(least, std::sqrt(segment_foot(r[i], r[j], r[(j + 1) % n]).d2));
  return least;
}

}  // namespace

TEST_CASE("derivatives of the contact of a particle with itself", "[derivatives][self]") {
  check_smooth<2>(
      *alone<2>(SelfContact{epsilon}), [](Random& r) { return slotted(r); }, 1e-6);
  check_smooth<2>(
      *alone<2>(SelfContact{epsilon, Edges::bare}), [](Random& r) { return slotted(r, 2 * delta); }, 1e-6);
  check_smooth<2>(
      *alone<2>(SelfContact{.epsilon = epsilon, .law = ContactLaw::barrier}), [](Random& r) { return slotted(r); },
      1e-7);
  check_smooth<2>(
      *alone<2>(SelfContact{.epsilon = epsilon, .law = ContactLaw::hertz}), [](Random& r) { return slotted(r); }, 1e-7);
}

TEST_CASE("a vertex that slides round a corner of its own outline feels the distance to it", "[self]") {
  const HarmonicOverlap v{epsilon, delta};
  for (int k = -20; k <= 20; ++k) {
    const Vec<2> tip(2 + 0.004 * k, 0.06), corner(2, 0);
    INFO("tip at " << tip[0]);
    Configuration<2> c = tip_over_corner(tip);
    const Real before = std::min(segment_foot(tip, {0, -0.5}, corner).d2, segment_foot(tip, corner, {4, -0.5}).d2);
    // The tip before the corner, and the corner before the tip.
    CHECK(energy(SelfContact{epsilon}, c) ==
          Approx(v.value(std::sqrt(before)) + v.value((tip - corner).norm())).epsilon(1e-12));
  }
}

TEST_CASE("relaxed shapes have no contact with themselves, however short the edges", "[self]") {
  for (const int n : {3, 4, 5, 16, 40})
    for (const Real diameter : {0.02, 0.1, 0.4}) {
      INFO(n << " vertices, contact distance " << diameter);
      Configuration<2> regular = with(regular_polygon(n, 0.5), diameter);
      CHECK(std::abs(energy(SelfContact{epsilon}, regular)) < 1e-9);
      Polygon longer = regular_polygon(n, 0.5);
      for (pliant::Vec<2>& r : longer) r[0] *= 2;
      Configuration<2> ellipse = with(longer, diameter);
      if (n >= 16) CHECK(std::abs(energy(SelfContact{epsilon}, ellipse)) < 1e-9);
    }
}

TEST_CASE("a corner that folds is pushed open", "[self]") {
  // The angle at (0, 0) closes: its sides have the length 1.
  Real last = 0;
  for (const Real angle : {90.0, 20.0, 5.0, 3.0, 1.0, 0.1}) {
    const pliant::Vec<2> side = at_angle(angle * pi / 180);
    Configuration<2> c = with({{0, 0}, {1, 0}, {4, -1}, {4, 3}, side});
    const Real now = energy(SelfContact{epsilon}, c);
    INFO("angle " << angle);
    if (angle > 10)
      CHECK(now == 0);
    else
      CHECK(now > last);
    last = now;
  }
}

TEST_CASE("the contact of a particle with itself has no net force and no torque", "[self]") {
  for (int k = 0; k < 10; ++k) {
    Random random(k);
    Configuration<2> c = slotted(random);
    std::vector<Real> f(c.x.size());
    alone<2>(SelfContact{epsilon})->forces(c.view(), f.data());
    pliant::Vec<2> sum = pliant::Vec<2>::Zero();
    Real torque = 0, largest = 0;
    for (Index i = 0; i < c.topology.points(); ++i) {
      const pliant::Vec<2> r = point<2>(c.x.data(), i), g = point<2>(f.data(), i);
      sum += g;
      torque += r[0] * g[1] - r[1] * g[0];
      largest = std::max(largest, g.norm());
    }
    CHECK(largest > 1);
    CHECK(sum.norm() < 1e-10 * largest);
    CHECK(std::abs(torque) < 1e-10 * largest);
  }
}

TEST_CASE("a look at an outline finds what all pairs of edges show", "[self]") {
  int crossed = 0, simple = 0, bounded = 0;
  for (int k = 0; k < 400; ++k) {
    Random random(k);
    const int n = 3 + random.below(30);
    Polygon r = irregular_polygon(random, n, 1);
    if (k % 2 == 0)  // crumpled
      for (pliant::Vec<2>& p : r) p += 0.35 * pliant::Vec<2>(random(-1, 1), random(-1, 1));
    Configuration<2> c = with(r);
    const OwnOutline seen = look_at_own_outline(c.x.data(), c.topology, 0, 10);
    INFO("state " << k);
    REQUIRE(seen.meet.has_value() == self_intersects(c.x.data(), c.topology, 0));
    CHECK(seen.inverted == !(polygon_area(c.x.data(), c.topology, 0) > 0));
    CHECK(seen.gap == Approx(least_distance(r)).epsilon(1e-12));
    const Real bound = star_gap(c.x.data(), c.topology, 0);
    if (bound > 0) {
      ++bounded;
      CHECK(seen.simple());
      CHECK(bound <= seen.gap);
    }
    ++(seen.simple() ? simple : crossed);
  }
  CHECK(crossed > 50);
  CHECK(simple > 100);
  CHECK(bounded > 50);
}

TEST_CASE("an outline that goes round twice, or is inside out, is not taken for a simple one", "[self]") {
  Polygon twice;
  for (int k = 0; k < 11; ++k) twice.push_back(at_angle(4 * pi * k / 11));
  Configuration<2> c = with(twice);
  CHECK(star_gap(c.x.data(), c.topology, 0) == 0);
  CHECK(look_at_own_outline(c.x.data(), c.topology, 0, 1).meet.has_value());
  Configuration<2> back = with({{0, 0}, {0, 1}, {1, 0}});
  CHECK(star_gap(back.x.data(), back.topology, 0) == 0);
  CHECK(look_at_own_outline(back.x.data(), back.topology, 0, 1).inverted);
}

}  // namespace pliant::test::self_contact_test
