// Gradient against energy and Hessian against gradient, for every energy term alone and for every model, by the order
// of Taylor remainders.
#include <catch2/catch.hpp>

#include <pliant/catalogue/catalogue.h>
#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/gravity.h>
#include <pliant/model/lip_contact.h>
#include <pliant/model/pair_contact.h>
#include <pliant/model/perimeter.h>
#include <pliant/model/rest_shape.h>
#include <pliant/model/wall_contact.h>

#include "support/configurations.h"
#include "support/derivatives.h"
#include "support/model_parameters.h"

namespace pliant::test::derivatives_test {

namespace {

constexpr Real epsilon = 1e3;

Configuration<2> single_polygon(Random& random) {
  Configuration<2> c;
  for (int k = 0; k < 2; ++k) {
    // One by one: the order in which arguments are evaluated depends on the compiler.
    const Vec<2> centre{random(-5, 5), random(-5, 5)};
    const Real radius = random(0.3, 1);
    const int n = 3 + random.below(14);
    c.add_polygon(irregular_polygon(random, n, radius, centre), 0.1);
  }
  return c;
}

template <class Range, class Body>
void for_each_place(const Range& places, Body&& body) {
  for (const auto place : places) {
    INFO("place " << static_cast<int>(place));
    body(place);
  }
}

}  // namespace

TEST_CASE("derivatives of the shape terms") {
  SECTION("area") { check_smooth<2>(*alone<2>(Area{10}), single_polygon, 1e-3); }
  SECTION("perimeter") { check_smooth<2>(*alone<2>(Perimeter{3}), single_polygon, 1e-4); }
  SECTION("bending") { check_smooth<2>(*alone<2>(Bending{0.7}), single_polygon, 1e-4); }
  SECTION("relative area") { check_smooth<2>(*alone<2>(Area{10, AreaEnergy::relative}), single_polygon, 1e-3); }
  SECTION("bending of full edges") {
    check_smooth<2>(*alone<2>(Bending{0.7, EdgeVectors::full}), single_polygon, 1e-4);
  }
  SECTION("rest shape") {
    RestOutlines outlines(17);
    for (Index n = 3; n <= 16; ++n)
      for (Index k = 0; k < n; ++k)
        outlines[n].emplace_back(n / (2 * pi) * Vec<2>(1.3 * std::cos(2 * pi * k / n), std::sin(2 * pi * k / n)));
    check_smooth<2>(*alone<2>(RestShape{0.7, std::make_shared<RestOutlines>(outlines)}), single_polygon, 1e-3);
    Random random(1);
    Configuration<2> c = single_polygon(random);
    CHECK_THROWS_AS(alone<2>(RestShape{0.7})->energy(c.view()), std::logic_error);
  }
}

TEST_CASE("derivatives of gravity") {
  check_smooth<2>(*alone<2>(Gravity<2>{{0.3, -1}}), single_polygon, 1e-3, true);
  check_smooth<3>(
      *alone<3>(Gravity<3>{{0.3, 0.1, -1}}), [](Random& r) { return soft_cluster<3>(r); }, 1e-3, true);
}

TEST_CASE("derivatives of the pair contact") {
  const auto field2 = alone<2>(PairContact<2>{epsilon, "pair"});
  const auto field3 = alone<3>(PairContact<3>{epsilon, "pair"});
  check_smooth<2>(
      *field2, [](Random& r) { return soft_cluster<2>(r); }, 1e-5);
  check_smooth<3>(
      *field3, [](Random& r) { return soft_cluster<3>(r); }, 1e-5);
  check_boundary<2>(*field2, touching_soft<2>, 1e-4);
  check_boundary<3>(*field3, touching_soft<3>, 1e-4);
  check_smooth<2>(
      *alone<2>(PairContact<2>{epsilon, "pair", ContactLaw::hertz}), [](Random& r) { return soft_cluster<2>(r); },
      1e-5);
  check_smooth<3>(
      *alone<3>(PairContact<3>{epsilon, "pair", ContactLaw::hertz}), [](Random& r) { return soft_cluster<3>(r); },
      1e-5);
}

TEST_CASE("derivatives of the edge contact") {
  const auto field = alone<2>(EdgeContact{epsilon});
  for_each_place(interior_places, [&](Place place) {
    check_smooth<2>(
        *field, [&](Random& r) { return touching_polygons(r, place); }, 1e-6);
  });
  for_each_place(boundary_places, [&](Place place) {
    check_boundary<2>(
        *field, [&](Random& r) { return touching_polygons(r, place); }, 1e-5);
  });
}

TEST_CASE("derivatives of the twofold edge contact") {
  const auto field = alone<2>(EdgeContact{epsilon, Edges::wide, true, EdgeForce::twofold});
  for_each_place(interior_places, [&](Place place) {
    check_smooth<2>(
        *field, [&](Random& r) { return touching_polygons(r, place); }, 1e-6);
  });
  for_each_place(boundary_places, [&](Place place) {
    check_boundary<2>(
        *field, [&](Random& r) { return touching_polygons(r, place); }, 1e-5);
  });
}

TEST_CASE("derivatives of the contact with bare edges") {
  const auto field = alone<2>(EdgeContact{epsilon, Edges::bare});
  for_each_place(interior_places, [&](Place place) {
    check_smooth<2>(
        *field, [&](Random& r) { return touching_bare_polygons(r, place); }, 1e-6);
  });
  for_each_place(boundary_places, [&](Place place) {
    check_boundary<2>(
        *field, [&](Random& r) { return touching_bare_polygons(r, place); }, 1e-5);
  });
}

TEST_CASE("derivatives of the wall contact") {
  const auto field2 = alone<2>(WallContact<2>{epsilon});
  const auto field3 = alone<3>(WallContact<3>{epsilon});
  for (const Real angle : {90.0, 45.0}) {
    INFO("angle " << angle);
    for_each_place(interior_wall_places, [&](WallPlace place) {
      check_smooth<2>(
          *field2, [&](Random& r) { return soft_at_wall<2>(r, angle, place); }, 1e-5);
      check_smooth<3>(
          *field3, [&](Random& r) { return soft_at_wall<3>(r, angle, place); }, 1e-5);
      check_smooth<2>(
          *field2, [&](Random& r) { return polygon_at_wall(r, angle, place, smooth_width); }, 1e-6);
    });
    for_each_place(boundary_wall_places, [&](WallPlace place) {
      check_boundary<2>(
          *field2, [&](Random& r) { return soft_at_wall<2>(r, angle, place); }, 1e-5);
      check_boundary<3>(
          *field3, [&](Random& r) { return soft_at_wall<3>(r, angle, place); }, 1e-5);
    });
  }
}

TEST_CASE("derivatives of the lip contact") {
  const auto lip = alone<2>(LipContact{epsilon});
  for (const Real angle : {90.0, 45.0}) {
    INFO("angle " << angle);
    // At a corner the lip term by itself vanishes: the wall term of the vertex is all there is (see outline.cpp).
    for_each_place(std::array{LipPlace::edge, LipPlace::notch}, [&](LipPlace place) {
      check_smooth<2>(
          *lip, [&](Random& r) { return polygon_at_lip(r, angle, place, smooth_width); }, 1e-6);
    });
    for_each_place(std::array{LipPlace::edge_onset, LipPlace::edge_end}, [&](LipPlace place) {
      check_boundary<2>(
          *lip, [&](Random& r) { return polygon_at_lip(r, angle, place, smooth_width); }, 4e-6);
    });
  }
}

namespace {

/// Points with the given contact distance from walls, minus half of the diameter of the walls.
constexpr Real thickness = 0.2;
template <int D>
Configuration<D> thinner(Configuration<D> c) {
  for (Real& delta : c.topology.diameter) delta -= thickness;
  return c;
}

}  // namespace

TEST_CASE("derivatives of the contact with thick walls") {
  const auto field2 = alone<2>(WallContact<2>{epsilon, thickness});
  const auto field3 = alone<3>(WallContact<3>{epsilon, thickness, ContactLaw::linear});
  const auto lip = alone<2>(LipContact{epsilon, true, thickness});
  for_each_place(interior_wall_places, [&](WallPlace place) {
    check_smooth<2>(
        *field2, [&](Random& r) { return thinner(soft_at_wall<2>(r, 45, place)); }, 1e-5);
    check_smooth<3>(
        *field3, [&](Random& r) { return thinner(soft_at_wall<3>(r, 90, place)); }, 1e-5);
  });
  for_each_place(boundary_wall_places, [&](WallPlace place) {
    check_boundary<2>(
        *field2, [&](Random& r) { return thinner(soft_at_wall<2>(r, 45, place)); }, 3e-5);
    check_boundary<3>(
        *field3, [&](Random& r) { return thinner(soft_at_wall<3>(r, 90, place)); }, 3e-5);
  });
  for_each_place(std::array{LipPlace::edge, LipPlace::notch}, [&](LipPlace place) {
    check_smooth<2>(
        *lip, [&](Random& r) { return thinner(polygon_at_lip(r, 45, place, 0.3)); }, 1e-6);
  });
  for_each_place(std::array{LipPlace::edge_onset, LipPlace::edge_end}, [&](LipPlace place) {
    check_boundary<2>(
        *lip, [&](Random& r) { return thinner(polygon_at_lip(r, 45, place, 0.3)); }, 1e-5);
  });
}

TEST_CASE("derivatives of the models") {
  ModelParameters p{.epsilon = epsilon, .epsilon_wall = 2e3, .k_a = 20, .k_l = 3, .k_b = 0.2};
  const Vec<2> g(0, -1);
  const auto shape = make_force_field<2>(ModelKind::shape, p, g);
  const auto rough = make_force_field<2>(ModelKind::rough, p, g);
  const auto smooth = make_force_field<2>(ModelKind::smooth, p, g);
  const auto soft2 = make_force_field<2>(ModelKind::sp, p, g);
  const auto soft3 = make_force_field<3>(ModelKind::sp, p, Vec<3>(0, 0, -1));

  SECTION("bulk") {
    check_smooth<2>(*shape, single_polygon, 1e-4);
    check_smooth<2>(
        *rough, [](Random& r) { return crowd_of_polygons(r, 0.3).with_bare_edges(); }, 1e-5);
    check_smooth<2>(
        *smooth, [](Random& r) { return crowd_of_polygons(r, smooth_width); }, 1e-6);
    check_smooth<2>(
        *soft2, [](Random& r) { return soft_cluster<2>(r); }, 1e-5);
    check_smooth<3>(
        *soft3, [](Random& r) { return soft_cluster<3>(r); }, 1e-5);
  }
  SECTION("in the hopper") {
    for_each_place(interior_wall_places, [&](WallPlace place) {
      check_smooth<2>(
          *soft2, [&](Random& r) { return soft_at_wall<2>(r, 45, place); }, 1e-5);
      check_smooth<3>(
          *soft3, [&](Random& r) { return soft_at_wall<3>(r, 90, place); }, 1e-5);
      check_smooth<2>(
          *rough, [&](Random& r) { return polygon_at_wall(r, 45, place, 0.3).with_bare_edges(); }, 1e-6);
      check_smooth<2>(
          *smooth, [&](Random& r) { return polygon_at_wall(r, 90, place, smooth_width); }, 1e-6);
    });
    for_each_place(interior_lip_places, [&](LipPlace place) {
      check_smooth<2>(
          *rough, [&](Random& r) { return polygon_at_lip(r, 90, place, 0.3).with_bare_edges(); }, 1e-6);
      check_smooth<2>(
          *smooth, [&](Random& r) { return polygon_at_lip(r, 45, place, smooth_width); }, 1e-6);
    });
  }
  SECTION("on boundaries") {
    for_each_place(boundary_places, [&](Place place) {
      check_boundary<2>(
          *smooth, [&](Random& r) { return touching_polygons(r, place); }, 1e-6);
    });
    for_each_place(boundary_lip_places, [&](LipPlace place) {
      check_boundary<2>(
          *smooth, [&](Random& r) { return polygon_at_lip(r, 45, place, smooth_width); }, 1e-6);
    });
    for_each_place(boundary_wall_places, [&](WallPlace place) {
      check_boundary<2>(
          *rough, [&](Random& r) { return polygon_at_wall(r, 45, place, 0.3).with_bare_edges(); }, 1e-6);
    });
  }
}

}  // namespace pliant::test::derivatives_test
