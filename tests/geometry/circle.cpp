// Distance of segments in space to a circle.
#include <catch2/catch.hpp>

#include <cmath>

#include <pliant/geometry/circle.h>

#include "support/random.h"

namespace pliant::test {

TEST_CASE("the nearest place of a segment to a circle is as near as any other place", "[circle]") {
  Random random(1);
  int inside = 0;
  for (int k = 0; k < 2000; ++k) {
    const Circle circle{random(0.5, 2), random(-1, 1)};
    const Real phi = random(0, 2 * pi), size = k % 2 == 0 ? 0.3 : 3;
    const Vec<3> place(circle.radius * std::cos(phi), circle.radius * std::sin(phi), circle.height);
    const Vec<3> a = place + size * Vec<3>(random(-1, 1), random(-1, 1), random(-1, 1)),
                 b = place + size * Vec<3>(random(-1, 1), random(-1, 1), random(-1, 1));
    const Real t = nearest_to_circle(circle, a, b);
    const Vec<3> p = a + t * (b - a);
    CHECK((p - circle.nearest(p)).norm() == Approx(circle.distance(p)).margin(1e-14));
    for (int n = 0; n <= 200; ++n)
      if (!(circle.distance(p) <= circle.distance(a + n / 200.0 * (b - a)) + 1e-12)) FAIL("a nearer place at " << n);
    if (!(t > 0 && t < 1)) continue;
    ++inside;
    CHECK(std::abs((p - circle.nearest(p)).dot(b - a)) < 1e-10 * (b - a).squaredNorm());
  }
  CHECK(inside > 1000);
}

}  // namespace pliant::test
