// Contacts with outlines: they amount to a law of the distance to the outline, without jumps around corners and lips.
#include <catch2/catch.hpp>
#include <map>

#include <pliant/catalogue/catalogue.h>
#include <pliant/kernels/contact_law.h>
#include <pliant/model/crossing.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/wall_contact.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::outline_test {

namespace {

constexpr Real epsilon = 1e3;

/// Moves polygon `mover` rigidly by path(s), s = 0 … 1. Along it the energy must be the integral of its own gradient,
/// and the gradient must not change faster than the stiffest contact allows: no jumps of either. Returns the largest
/// energy.
template <class Path>
Real check_path(const ForceField<2>& field, Configuration<2>& c, Index mover, Real stiffness, Path&& path) {
  const VectorXd start = c.positions();
  const Functional u = functional(field, c);
  constexpr int steps = 4000;
  Real highest = 0, energy = 0, worst_energy = 0, worst_gradient = 0;
  VectorXd x, gradient;
  for (int k = 0; k <= steps; ++k) {
    VectorXd y = start;
    for (Index i = c.topology.offset[mover]; i < c.topology.offset[mover + 1]; ++i)
      point<2>(y.data(), i) += path(static_cast<Real>(k) / steps);
    const Real e = u.energy(y);
    const VectorXd g = u.gradient(y);
    REQUIRE(!find_crossing(c.view(y.data())));
    if (k > 0) {
      const Real move = (y - x).norm();
      worst_energy = std::max(worst_energy, std::abs(e - energy - (g + gradient).dot(y - x) / 2) / square(move));
      worst_gradient = std::max(worst_gradient, (g - gradient).norm() / move);
    }
    highest = std::max(highest, e);
    x = y, energy = e, gradient = g;
  }
  CHECK(worst_energy < stiffness);    // trapezoidal rule on a Lipschitz gradient
  CHECK(worst_gradient < stiffness);  // Lipschitz
  return highest;
}

Real sum_over_outline(const Polygon& points, const Polygon& outline, Real delta) {
  Real sum = 0;
  for (const Vec<2>& p : points) sum += HarmonicOverlap{epsilon, delta}.value(outline_distance(p, outline));
  return sum;
}

}  // namespace

TEST_CASE("edge contact of convex polygons is V(distance to the outline), in both directions") {
  const auto field = alone<2>(EdgeContact{epsilon});
  int active = 0;
  for (int k = 0; k < 300; ++k) {
    INFO("state " << k);
    Random random(k);
    const Real da = random(0.05, 0.1), db = random(0.05, 0.1), delta = (da + db) / 2;
    const Polygon hexagon = regular_polygon(6, 0.6, {random(-1, 1), random(-1, 1)}, random(0, 1));
    const Vec<2> u = random.unit<2>(), centre = (hexagon[0] + hexagon[3]) / 2;
    // From far outside inwards until the tip touches the outline, at an edge or a corner.
    Vec<2> tip = centre + 0.8 * u;
    const Real gap = random(0.2, 0.95) * delta;
    while (outline_distance(tip, hexagon) > gap) tip -= 1e-3 * u;
    Configuration<2> c;
    c.add_polygon(hexagon, da);
    c.add_polygon(wedge(tip, u), db);
    REQUIRE(!find_crossing(c.view()));
    const Polygon other = vertices_of(c, 1);
    const Real expected = sum_over_outline(other, hexagon, delta) + sum_over_outline(hexagon, other, delta);
    active += expected > 0;
    CHECK(field->energy(c.view()) == Approx(expected).epsilon(1e-10));
  }
  CHECK(active == 300);
}

TEST_CASE("in a notch the edge contact counts both edges and their vertex once less") {
  const auto field = alone<2>(EdgeContact{epsilon});
  Random random(5);
  Configuration<2> c = touching_polygons(random, Place::notch);
  const Polygon a = vertices_of(c, 0);
  const Vec<2> p = c.position(c.topology.offset[1]), r = a[notch_vertex];
  const HarmonicOverlap law{epsilon, smooth_width};
  const auto line = [&](std::size_t i) { return law.value((p - a[i]).dot(outward(a, i))); };
  // The other direction: the vertex in the notch meets the tip, which is a convex corner.
  const Real reverse = sum_over_outline(a, vertices_of(c, 1), smooth_width);
  REQUIRE(reverse == Approx(law.value((p - r).norm())));
  CHECK(field->energy(c.view()) ==
        Approx(line(notch_vertex - 1) + line(notch_vertex) - law.value((p - r).norm()) + reverse).epsilon(1e-10));
}

TEST_CASE("edge contact is C1 along paths around a corner and into a notch") {
  const auto field = alone<2>(EdgeContact{epsilon});
  const Real stiffness = 20 * epsilon / square(smooth_width);
  for (int k = 0; k < 10; ++k) {
    INFO("state " << k);
    Random random(k);
    {
      // Half a turn about vertex 1, a right-angled corner, beginning and ending on the adjacent edges.
      Configuration<2> c;
      const Polygon square_outline{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
      const Real h = random(0.3, 0.7) * smooth_width;
      c.add_polygon(square_outline, smooth_width);
      c.add_polygon(wedge({0.95, -h}, Vec<2>(1, -1).normalized()), smooth_width);
      const Real top = check_path(*field, c, 1, stiffness, [&](Real s) -> Vec<2> {
        Vec<2> p;
        if (s < 0.25)
          p = {0.95 + 0.2 * s, -h};
        else if (s < 0.75)
          p = Vec<2>(1, 0) + h * at_angle(-pi / 2 + pi * (s - 0.25));
        else
          p = {1 + h, 0.2 * (s - 0.75)};
        return p - Vec<2>(0.95, -h);
      });
      // The distance from the outline stays the same; at the corner each vertex is near the other's outline: both
      // directions count.
      CHECK(top == Approx(2 * HarmonicOverlap{epsilon, smooth_width}.value(h)));
    }
    {
      // From far away into the notch, past the onsets of both of its edges and of its vertex.
      Configuration<2> c = touching_polygons(random, Place::notch);
      const Polygon a = vertices_of(c, 0);
      const Vec<2> away = (outward(a, notch_vertex - 1) + outward(a, notch_vertex)).normalized();
      const Vec<2> side = 0.1 * left_of(away) * random(-1, 1);
      const Real top =
          check_path(*field, c, 1, stiffness, [&](Real s) -> Vec<2> { return (1 - s) * (0.2 * away + side); });
      CHECK(top > 0.05 * epsilon);
    }
  }
}

TEST_CASE("lip and wall terms together are V(distance of the lip to the outline)") {
  const auto field = alone<2>(WallContact<2>{epsilon}, LipContact{epsilon});
  for (const LipPlace place : {LipPlace::edge, LipPlace::corner})
    for (int k = 0; k < 50; ++k) {
      INFO("place " << static_cast<int>(place) << ", state " << k);
      Random random(k);
      Configuration<2> c = polygon_at_lip(random, 90, place, smooth_width);
      const Real expected = HarmonicOverlap{epsilon, smooth_width / 2}.value(
          outline_distance(c.walls.lips()[1].place, vertices_of(c, 0)));
      REQUIRE(expected > 0);
      CHECK(field->energy(c.view()) == Approx(expected).epsilon(1e-9));
    }
}

TEST_CASE("lip and wall terms are C1 when a polygon slides past the lip") {
  const auto field = alone<2>(WallContact<2>{epsilon}, LipContact{epsilon});
  const Real stiffness = 20 * epsilon / square(smooth_width / 2);
  for (int k = 0; k < 10; ++k) {
    INFO("state " << k);
    Random random(k);
    // A square in front of the lip at (1.5, 0): its side, then its corner, pass below and next to the end of the wall.
    Configuration<2> c;
    c.walls = test_hopper(90).walls<2>();
    const Real h = random(0.3, 0.7) * smooth_width / 2;
    c.add_polygon({{1, -0.5}, {1.5 - h, -0.5}, {1.5 - h, 0.5}, {1, 0.5}}, smooth_width);
    const Real top = check_path(*field, c, 0, stiffness, [&](Real s) -> Vec<2> {
      if (s < 0.5) return {0, -1.2 * s};                      // down: the lip passes the upper right corner
      return {0.4 * (s - 0.5), -0.6 - h * std::sin(pi * s)};  // then under the wall
    });
    CHECK(top == Approx(HarmonicOverlap{epsilon, smooth_width / 2}.value(h)));
  }
}

TEST_CASE("without the lip term a lip enters an edge unnoticed") {
  Random random(2);
  Configuration<2> c = polygon_at_lip(random, 90, LipPlace::edge, smooth_width);
  ModelParameters p{.epsilon = epsilon, .epsilon_wall = epsilon};
  CHECK(make_force_field<2>(ModelKind::smooth, p, Vec<2>::Zero())->energy(c.view()) > 0);
  p.lip_edges = false;
  CHECK(make_force_field<2>(ModelKind::smooth, p, Vec<2>::Zero())->energy(c.view()) == 0);
}

TEST_CASE("a vertex enters a stretched edge of a rough particle unnoticed, but for the edge contact") {
  // A vertex goes straight through the middle of an edge of a 16-gon, whose vertices are disks of an edge's rest
  // length.
  const ModelParameters p{.epsilon = epsilon, .epsilon_wall = 0};
  ModelParameters literal = p;
  literal.rough_edges = false;
  const auto closed = make_force_field<2>(ModelKind::rough, p, Vec<2>::Zero()),
             open = make_force_field<2>(ModelKind::rough, literal, Vec<2>::Zero());
  for (const Real other : {0.3, 1.0, 1.7})  // diameter of the vertex over the diameter of the edge
    for (const Real stretch : {1.0, 1.7, 2.5}) {
      INFO("stretch " << stretch << ", other " << other);
      const Polygon outline = regular_polygon(16, 1, {0, 0}, -pi / 2 - pi / 16);
      const Real length = (outline[1] - outline[0]).norm(), rest = length / stretch, width = other * rest;
      REQUIRE(outward(outline, 0)[1] == Approx(-1));
      const Real bottom = outline[0][1];
      // The place where its disk touches the disks of both ends, if they extend so far.
      const Real touch = std::sqrt(std::max(0.0, square((rest + width) / 2) - square(length / 2)));
      if (stretch == 1) CHECK(touch > width / 2);  // at rest the disks of the ends are nearer
      Real highest = 0;
      for (Real d = 1.5 * touch + 0.6 * width; d > 0; d -= 0.002 * width) {
        Configuration<2> c;
        c.add_polygon(outline, rest);
        c.add_polygon(wedge({0, bottom - d}, {0, -1}), width);
        c = std::move(c).with_bare_edges();
        const Real with = closed->energy(c.view()), without = open->energy(c.view());
        if (d > 0.501 * width) CHECK(with == without);
        if (stretch > 1 + other) CHECK(without == 0);  // the hole
        highest = std::max(highest, with - without);
      }
      // V at a distance of 0, and a small contribution of the ends' disks against the edges adjacent to the vertex.
      CHECK(highest > 0.99 * epsilon / 8);
      CHECK(highest < 1.05 * epsilon / 8);
    }
}

TEST_CASE("each place of an outline carries the contact of a vertex once") {
  const auto contact = alone<2>(EdgeContact{epsilon});
  const auto friction = alone<2>(EdgeFriction{1});
  // Where the tip meets a corner, the corner meets the tip as well: once in each direction.
  const std::map<Place, std::size_t> directions{{Place::edge, 1}, {Place::corner, 2}, {Place::edge_end, 2}};
  for (const auto& [place, count] : directions)
    for (int k = 0; k < 20; ++k) {
      INFO("place " << static_cast<int>(place) << ", state " << k);
      Random random(k);
      Configuration<2> c = touching_polygons(random, place);
      const Index tip = c.topology.offset[1];
      const Polygon a = vertices_of(c, 0);
      const Real d = outline_distance(c.position(tip), a);
      std::vector<Contact<2>> of_tip, of_corner;
      contact->for_each_contact(c.view(),
                                [&](const Contact<2>& e) { (e.first == 1 ? of_tip : of_corner).push_back(e); });
      REQUIRE(of_tip.size() == 1);
      REQUIRE(of_corner.size() == count - 1);
      CHECK(of_tip[0].overlap == Approx(1 - d / smooth_width));
      CHECK(of_tip[0].reach == smooth_width);
      CHECK(of_tip[0].second == 0);
      CHECK(of_tip[0].normal.norm() == Approx(1));
      CHECK(outline_distance(c.position(tip) - d * of_tip[0].normal, a) < 1e-12);
      // Equal widths: half way between the tip and the outline.
      CHECK((of_tip[0].position - (c.position(tip) - d / 2 * of_tip[0].normal)).norm() < 1e-14);
      Vec<2> reported = of_tip[0].force;
      for (const Contact<2>& e : of_corner) reported -= e.force;
      std::vector<Real> f(c.x.size());
      contact->forces(c.view(), f.data());
      CHECK((reported - point<2>(f.data(), tip)).norm() < 1e-10 * epsilon);

      std::fill(c.v.begin(), c.v.end(), 0);
      const Vec<2> v(0.6, 0.8);
      point<2>(c.v.data(), tip) = v;
      friction->forces(c.view(), f.data());
      CHECK((point<2>(f.data(), tip) + static_cast<Real>(count) * v).norm() < 1e-14);
    }
}

TEST_CASE("a vertex that has crossed an outline is found and named") {
  Configuration<2> c;
  c.add_polygon(regular_polygon(6, 1), 0.1);
  c.add_polygon(wedge({0, std::sqrt(0.75) + 0.02}, {0, 1}), 0.1);
  CHECK(!find_crossing(c.view()));
  c.x[2 * 6 + 1] -= 0.04;  // the tip, through the upper edge
  const std::optional<Crossing> found = find_crossing(c.view());
  REQUIRE(found);
  CHECK(found->vertex == 6);
  CHECK(found->particle == 1);
  CHECK(found->other == 0);
}

TEST_CASE("the gap between outlines is the smallest distance of a vertex, up to the depth of the look") {
  struct Case {
    const char* name;
    ModelKind kind;
    Real delta;
    bool rough_edges = true;
  };
  // Edges are 0.5 long. Also without a list of vertices and edges, if no pair of points lists the middle of an edge.
  for (const Case& look :
       {Case{"smooth", ModelKind::smooth, 0.1}, Case{"rough", ModelKind::rough, 0.5},
        Case{"literal", ModelKind::rough, 0.5, false}, Case{"literal, long edges", ModelKind::rough, 0.2, false}}) {
    int near_enough = 0;
    for (int k = 0; k < 200; ++k) {
      INFO(look.name << ", state " << k);
      Random random(k);
      const Real near = random(0.01, 0.15);
      Configuration<2> c;
      c.add_polygon(regular_polygon(6, 0.5, Vec<2>::Zero(), random(0, 1)), look.delta);
      Vec<2> tip = 2 * random.unit<2>();
      while (outline_distance(tip, vertices_of(c, 0)) > near) tip *= 0.999;
      c.add_polygon(wedge(tip, tip.normalized()), look.delta);
      Neighbours<2> neighbours(needs_of<2>(look.kind, {.rough_edges = look.rough_edges}), 0.02);
      neighbours.rebuild(c.topology, c.walls, c.x.data());
      const StateView<2> view{c.x.data(), nullptr, c.topology, neighbours, c.walls};
      Real least = std::numeric_limits<Real>::infinity();
      for (const Index m : {0, 1})
        for (const Vec<2>& r : vertices_of(c, m)) least = std::min(least, outline_distance(r, vertices_of(c, 1 - m)));
      for (const Real deepest : {0.0, 0.3}) {
        const OutlineLook seen = look_at_outlines(view, {}, deepest);
        CHECK(!seen.crossing);
        CHECK(seen.gap == Approx(std::min(seen.depth, least)).epsilon(1e-12));
        CHECK(seen.depth > std::max(0.09, deepest));
        near_enough += deepest == 0 && least < seen.depth;
      }
    }
    CHECK(near_enough > 50);
  }
}

TEST_CASE("a vertex inside an outline is found as deep as is asked for") {
  for (const bool rough : {false, true})
    for (const Real depth : {0.04, 0.2}) {
      INFO((rough ? "rough" : "smooth") << ", " << depth);
      Configuration<2> c;
      const Real radius = std::sqrt(0.75);  // radius of the inscribed circle of the hexagon
      c.add_polygon(regular_polygon(6, 1), 0.1);
      c.add_polygon(wedge({0, radius - depth}, {0, 1}), 0.1);
      Neighbours<2> neighbours(needs_of<2>(rough ? ModelKind::rough : ModelKind::smooth, {.rough_edges = false}), 0.02);
      neighbours.rebuild(c.topology, c.walls, c.x.data());
      const StateView<2> view{c.x.data(), nullptr, c.topology, neighbours, c.walls};
      const OutlineLook shallow = look_at_outlines(view);
      CHECK(shallow.crossing.has_value() == (depth < shallow.depth));
      const OutlineLook deep = look_at_outlines(view, {}, depth);
      REQUIRE(deep.crossing);
      CHECK(deep.crossing->vertex == 6);
      CHECK(deep.crossing->other == 0);
      CHECK(find_crossing(view));
    }
}

TEST_CASE("an edge pushes a vertex half or twice as hard as a vertex does that meets it head on") {
  constexpr Real range = 0.1, d = 0.08, push = 1e3 / range * 0.2;
  Configuration<2> before_edge, head_on;
  before_edge.add_polygon({{0, 0}, {0, 1}, {-1, 1}, {-1, 0}}, range);
  before_edge.add_polygon(wedge({d, 0.4}, {1, 0}), range);
  head_on.add_polygon(wedge({-d / 2, 0}, {-1, 0}), range);
  head_on.add_polygon(wedge({d / 2, 0}, {1, 0}), range);
  const auto on_tip = [](Configuration<2>& c, EdgeForce force) {
    const auto field = alone<2>(EdgeContact{1e3, Edges::wide, true, force});
    std::vector<Real> f(c.x.size());
    field->forces(c.view(), f.data());
    Real shown = 0;
    field->for_each_contact(c.view(), [&](const Contact<2>& contact) { shown += contact.force.norm(); });
    CHECK(shown == Approx(std::abs(f[2 * 4])));
    return Vec<2>(point<2>(f.data(), 4));
  };
  CHECK((on_tip(before_edge, EdgeForce::single) - push * Vec<2>(1, 0)).norm() < 1e-9);
  CHECK((on_tip(head_on, EdgeForce::single) - 2 * push * Vec<2>(1, 0)).norm() < 1e-9);
  CHECK((on_tip(before_edge, EdgeForce::twofold) - 2 * push * Vec<2>(1, 0)).norm() < 1e-9);
  CHECK((on_tip(head_on, EdgeForce::twofold) - push * Vec<2>(1, 0)).norm() < 1e-9);
}

}  // namespace pliant::test::outline_test
