// Contact with walls of every shape: segments, outlines with joints, disks, and their figures of revolution.
#include <catch2/catch.hpp>

#include <pliant/geometry/container.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/wall_contact.h>

#include "support/configurations.h"
#include "support/derivatives.h"
#include "support/model_parameters.h"

namespace pliant::test::wall_contact_test {

namespace {

constexpr Real epsilon = 1e3, sigma = 1;

/// A polyline of n segments from a to b, joined.
WallParts line(const Vec<2>& a, const Vec<2>& b, Index n) {
  WallParts walls;
  for (Index k = 0; k < n; ++k) {
    const Vec<2> from = a + (b - a) * k / n, to = a + (b - a) * (k + 1) / n;
    if (k > 0) walls.joints.push_back({from, k, k - 1, true});
    walls.segments.push_back(WallSegment::between(from, to));
  }
  return walls;
}

Obstacle polygon(Index n, const Vec<2>& centre, Real radius) {
  Obstacle o;
  for (Index k = 0; k < n; ++k) o.corners.push_back(centre + radius * at_angle(2 * pi * k / n));
  return o;
}

WallParts rim(const Obstacle& o) {
  WallParts walls;
  o.add_to(walls);
  return walls;
}

template <int D>
Configuration<D> soft(const WallParts& walls, const Vec<2>& p, Real phi = 0) {
  Configuration<D> c;
  c.walls = Walls<D>(walls);
  if constexpr (D == 2)
    c.add_soft(sigma, p);
  else
    c.add_soft(sigma, Vec<3>(p[0] * std::cos(phi), p[0] * std::sin(phi), p[1]));
  return c;
}

template <int D>
VectorXd energy_and_force(const WallParts& walls, const Vec<2>& p) {
  Configuration<D> c = soft<D>(walls, p, 0.7);
  const auto field = alone<D>(WallContact<D>{epsilon});
  VectorXd f(D + 1);
  f[D] = field->energy(c.view(), f.data());
  return f;
}

/// In touch with a disk and an outline that has corners of all kinds, but not where the Hessian jumps.
template <int D>
Configuration<D> at_walls(Random& random, bool disk) {
  WallParts walls = rim({{{2, 0}, {4, 0}, {4.5, 1.5}, {3, 0.8}, {2.2, 2}}});
  walls.segments.push_back(WallSegment::disk({D == 3 && random(0, 1) < 0.5 ? 0.0 : 6.0, 1}, 0.8));
  const Walls<D> all(walls);
  for (;;) {
    const Vec<2> p(random(0.1, 8), random(-1.5, 3.5));
    const Real phi = random(0, 2 * pi);
    const Configuration<D> c = soft<D>(walls, p, phi);
    bool smooth = true, touches_disk = false, touches_outline = false;
    for (Index s = 0; s < static_cast<Index>(all.parts().size()); ++s) {
      const WallSegment& part = all.parts()[s];
      const Real d = all.distance(c.position(0), s, 0), t = (p - part.origin).dot(part.direction);
      smooth = smooth && d > 0.1 && std::abs(d - sigma / 2) > 0.01 &&
               (part.length == 0 || (std::abs(t) > 0.01 && std::abs(t - part.length) > 0.01));
      (part.radius > 0 ? touches_disk : touches_outline) |= d < sigma / 2;
    }
    if (smooth && (disk ? touches_disk : touches_outline)) return soft<D>(walls, p, phi);
  }
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("derivatives at outlines and disks", "[walls]", ((int D), D), 2, 3) {
  const bool disk = GENERATE(false, true);
  CAPTURE(disk);
  const auto check = [&](const auto& field) {
    check_smooth<D>(
        *field, [&](Random& r) { return at_walls<D>(r, disk); }, 1e-5);
  };
  check(alone<D>(WallContact<D>{epsilon}));
  check(alone<D>(WallContact<D>{.epsilon = epsilon, .law = ContactLaw::hertz}));
  check(alone<D>(WallContact<D>{.epsilon = epsilon, .law = ContactLaw::barrier}));
}

namespace {

/// In touch with a solid, from outside or from inside, but not where the Hessian jumps.
template <int D>
Configuration<D> at_solid(Random& random, bool wedge) {
  const Vec<D> tip = 3 * random.unit<D>(), along = random.unit<D>();
  Vec<D> other = random.unit<D>();
  other = (other - other.dot(along) * along).normalized();
  const Real opening = random(0.6, 2.2);
  const Solid<D> solid =
      wedge ? Solid<D>::wedge(tip, along, Vec<D>(std::cos(opening) * along - std::sin(opening) * other))
            : Solid<D>::half_space(tip, other);
  Configuration<D> c;
  c.walls.add(solid);
  const Real angle = wedge ? random(-opening + 0.1, 2 * pi - opening - 0.1) : pi / 2, far = random(0.1, 0.45);
  c.add_soft(sigma, tip + solid.lift(Vec<2>(wedge ? far * at_angle(angle) : Vec<2>(1, random(-0.3, 0.45)))));
  return c;
}

}  // namespace

TEMPLATE_TEST_CASE_SIG("derivatives at half-spaces and wedges", "[walls]", ((int D), D), 2, 3) {
  const bool wedge = GENERATE(false, true);
  CAPTURE(wedge);
  const auto make = [&](Random& r) {
    for (;;) {
      // Not if the foot reaches the edge of a wedge, or changes between its faces.
      Configuration<D> c = at_solid<D>(r, wedge);
      const Vec<2> p = c.walls.solids()[0].plane(c.position(0));
      const Solid<D>& s = c.walls.solids()[0];
      const Real x2 = p.dot(s.second_along()), y2 = p.dot(s.second_out());
      if (!wedge || (std::abs(p[0]) > 0.01 && std::abs(x2) > 0.01 && std::abs(p[1] - y2) > 0.01)) return c;
    }
  };
  check_smooth<D>(*alone<D>(WallContact<D>{epsilon}), make, 1e-5);
  check_smooth<D>(*alone<D>(WallContact<D>{.epsilon = epsilon, .law = ContactLaw::hertz}), make, 1e-5);
}

TEMPLATE_TEST_CASE_SIG("solids push out what has gone through their surface, segments push it on", "[walls]",
                       ((int D), D), 2, 3) {
  const Vec<D> up = Vec<D>::Unit(D - 1);
  Walls<D> floor(std::vector{Solid<D>::half_space(Vec<D>::Zero(), up)}), thin({WallSegment::ray({0, 0}, {1, 0})});
  const auto force = [&](const Walls<D>& walls, Real height) {
    Configuration<D> c;
    c.walls = walls;
    c.add_soft(sigma, Vec<D>(Vec<D>::Unit(0) + height * up));
    std::vector<Real> f(D);
    alone<D>(WallContact<D>{epsilon})->forces(c.view(), f.data());
    return f[D - 1];
  };
  for (const Real height : {0.3, 0.0, -0.2, -0.6, -3.0})
    CHECK(force(floor, height) == Approx(2 * epsilon / sigma * (1 - 2 * height / sigma)));
  CHECK(force(floor, 0.51) == 0);
  CHECK(force(thin, 0.3) == Approx(force(floor, 0.3)));
  CHECK(force(thin, -0.2) < 0);
  CHECK(force(thin, -0.6) == 0);
}

TEMPLATE_TEST_CASE_SIG("a wall is as stiff in one piece as in hundreds", "[walls]", ((int D), D), 2, 3) {
  Random random(2);
  for (int k = 0; k < 40; ++k) {
    const Vec<2> a(1, 0.5), b(7, 2), p = a + (b - a) * random(-0.03, 1.03) + Vec<2>(-0.24, 0.97) * random(-0.6, 0.6);
    const VectorXd one = energy_and_force<D>(line(a, b, 1), p), many = energy_and_force<D>(line(a, b, 300), p);
    CAPTURE(p[0], p[1]);
    CHECK((one - many).norm() < 1e-9 * epsilon);
  }
}

TEST_CASE("an obstacle counts once, at its corners too", "[walls]") {
  const Obstacle square{{{0, 0}, {2, 0}, {2, 2}, {0, 2}}};
  const HarmonicOverlap law{epsilon, sigma / 2};
  Random random(3);
  for (int k = 0; k < 200; ++k) {
    const Vec<2> p(random(-0.7, 2.7), random(-0.7, 2.7));
    if (square.contains(p)) continue;
    const Vec<2> out = (Vec<2>(0, 0) - p).cwiseMax(p - Vec<2>(2, 2)).cwiseMax(Vec<2>(0, 0));
    CHECK(energy_and_force<2>(rim(square), p)[2] == Approx(law.value(out.norm())).margin(1e-9));
  }
}

TEST_CASE("a disk is what polygons of ever more corners come to", "[walls]") {
  const Obstacle disk{{{0, 0}}, 1.5};
  for (const Real d : {0.1, 0.3, 0.45}) {
    const Vec<2> p = (1.5 + d) * at_angle(0.3);
    const VectorXd exact = energy_and_force<2>(rim(disk), p),
                   fine = energy_and_force<2>(rim(polygon(2000, {0, 0}, 1.5)), p);
    CHECK((exact - fine).norm() < 1e-3 * exact.norm());
    CHECK(exact[2] == Approx(HarmonicOverlap{epsilon, sigma / 2}.value(d)));
  }
}

TEST_CASE("a corner of an obstacle does not enter an edge", "[walls]") {
  // Above the tip of a triangle, a slim polygon lies on it with the middle of its long edge.
  Configuration<2> c;
  const Obstacle triangle{{{-1, -2}, {1, -2}, {0, 0}}};
  c.walls = Walls<2>(rim(triangle));
  const Real delta = 0.2, height = 0.05;
  c.add_polygon({{-1, height}, {1, height}, {1, 1}, {-1, 1}}, delta);
  const auto without = alone<2>(WallContact<2>{epsilon}), with = alone<2>(WallContact<2>{epsilon}, LipContact{epsilon});
  std::vector<Real> f(c.x.size());
  CHECK(without->energy(c.view(), f.data()) == 0);
  CHECK(with->energy(c.view(), f.data()) == Approx(HarmonicOverlap{epsilon, delta / 2}.value(height)));
  CHECK(f[1] + f[3] > 0);
  // The force on the polygon is opposite to the force on the obstacle.
  std::vector<Real> on_walls(2 * static_cast<std::size_t>(c.walls.size()));
  with->add_wall_forces(c.view(), on_walls.data());
  Real sum = 0;
  for (std::size_t k = 1; k < on_walls.size(); k += 2) sum += on_walls[k];
  CHECK(sum == Approx(-f[1] - f[3]));
}

TEMPLATE_TEST_CASE_SIG("walls of a diameter are met by so much earlier, and end in beads", "", ((int D), D), 2, 3) {
  // A floor that ends at x = 1 (3D: a plate of radius 1), 0.3 thick, and a particle of diameter 0.7: contact at 0.5.
  constexpr Real size = 0.7, thick = 0.3;
  WallParts floor;
  floor.segments = {WallSegment::between({D == 2 ? -5 : 0, 0}, {1, 0})};
  const auto force = [&](const ForceField<D>& field, Real x, Real y) {
    Configuration<D> c;
    c.walls = Walls<D>(floor);
    Vec<D> r = Vec<D>::Zero();
    r[0] = x, r[D - 1] = y;
    c.add_soft(size, r);
    std::vector<Real> f(D);
    field.forces(c.view(), f.data());
    const Real d = x < 1 ? y : std::hypot(x - 1, y);
    CHECK(field.energy(c.view()) == Approx(d < 0.5 ? 50 * square(1 - d / 0.5) : 0));
    return Vec<2>(f[0], f[D - 1]);
  };
  ModelParameters p{.epsilon_wall = 100, .wall_diameter = thick};
  const auto term = alone<D>(WallContact<D>{100, thick});
  const auto model = make_force_field<D>(ModelKind::sp, p, Vec<D>::Zero());
  for (const ForceField<D>* field : {term.get(), model.get()}) {
    CHECK((force(*field, 0.3, 0.4) - Vec<2>(0, 40)).norm() < 1e-12);
    CHECK((force(*field, 1.24, 0.32) - 40 * Vec<2>(0.6, 0.8)).norm() < 1e-11);  // at the bead
    CHECK(force(*field, 0.3, 0.51).norm() == 0);
    CHECK(force(*field, 1.4, 0.4).norm() == 0);
    CHECK(field->needs().beyond_contact == thick / 2);
  }
  Topology one;
  one.add_soft(size, 2);
  CHECK(term->critical_step(one).elastic == Approx(2 / std::sqrt(100 / square(0.5) / 2)));
}

}  // namespace pliant::test::wall_contact_test
