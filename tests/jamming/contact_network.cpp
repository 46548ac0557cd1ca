// Contacts and rattlers of arrangements made by hand.
#include <algorithm>
#include <catch2/catch.hpp>

#include <pliant/jamming/contact_network.h>

#include "support/twins.h"

namespace pliant::test::contact_network_test {
using Catch::Matchers::Contains;

namespace {

/// Disks of diameter 1 at these places.
Configuration<2> disks(const std::vector<pliant::Vec<2>>& places) {
  Configuration<2> c;
  for (const pliant::Vec<2>& r : places) c.add_soft(1, r);
  return c;
}

constexpr Real near_touch = 0.98;

/// A disk and the six around it, which have three contacts each.
std::vector<pliant::Vec<2>> flower() {
  std::vector<pliant::Vec<2>> places{{0, 0}};
  for (int k = 0; k < 6; ++k) places.push_back(near_touch * at_angle(k * pi / 3));
  return places;
}

template <int D>
ContactNetwork<D> network_of(const Configuration<D>& c, ModelKind kind, const Box<D>& box = {}, Real threshold = 0) {
  auto system = system_of<D>(c, kind, Ranks(), parameters, box);
  return contact_network<D>(system, c.x, threshold);
}

/// Upright squares of side 1 with vertices of diameter 0.2, by their lower left corners.
Configuration<2> squares(const std::vector<pliant::Vec<2>>& corners) {
  Configuration<2> c;
  for (const pliant::Vec<2>& r : corners)
    c.add_polygon({r, r + pliant::Vec<2>(1, 0), r + pliant::Vec<2>(1, 1), r + pliant::Vec<2>(0, 1)}, 0.2);
  return c;
}

}  // namespace

TEST_CASE("soft particles that too few contacts hold are rattlers", "[contact_network]") {
  auto places = flower();
  auto network = network_of(disks(places), ModelKind::sp);
  CHECK(network.rattlers.empty());
  CHECK(network.touching() == 12);
  CHECK(network.contacts == 12);
  CHECK(network.backbone == 7);
  CHECK(network.coordination() == Approx(24.0 / 7));
  CHECK(network.isostatic() == 13);

  // In the outer gap of two disks, with two contacts; and one that it helps to hold.
  const pliant::Vec<2> outer = places[1] + places[2];
  places.push_back(outer);
  network = network_of(disks(places), ModelKind::sp);
  CHECK(network.rattlers == std::vector<Index>{7});
  CHECK(network.touching() == 12);
  places.push_back(outer + places[1] - places[2]);  // touches disks 1 and 7
  places.push_back(places[1] + 2 * near_touch * at_angle(-pi / 3));
  places.push_back({5, 5});
  network = network_of(disks(places), ModelKind::sp);
  CHECK(network.rattlers == std::vector<Index>{7, 8, 9, 10});
  CHECK(network.touching() == 12);
}

TEST_CASE("pairs have the branch to the touching image, and the force", "[contact_network]") {
  // Triangular lattice; also where a disk touches its own images.
  for (const Index rows : {2, 4}) {
    const Index columns = rows / 2;
    std::vector<pliant::Vec<2>> places;
    for (Index k = 0; k < columns; ++k)
      for (Index l = 0; l < rows; ++l)
        places.emplace_back(near_touch * (k + (l % 2) / 2.0) + 3 * near_touch * columns,
                            near_touch * l * std::sqrt(0.75));
    const Box<2> box({0, 0}, {near_touch * columns, near_touch * rows * std::sqrt(0.75)});
    const auto network = network_of(disks(places), ModelKind::sp, box);
    CHECK(network.rattlers.empty());
    CHECK(network.coordination() == 6);
    CHECK(network.touching() == 3 * network.backbone);
    for (const TouchingPair<2>& pair : network.pairs) {
      CHECK(pair.branch.norm() == Approx(near_touch));
      CHECK((pair.force / network.typical_force + pair.branch / near_touch).norm() < 1e-10);
    }
  }
  Configuration<3> spheres;
  for (Index k = 0; k < 8; ++k) spheres.add_soft(1, near_touch * pliant::Vec<3>(k % 2, k / 2 % 2, k / 4));
  const auto network = network_of(spheres, ModelKind::sp, Box<3>({0, 0, 0}, pliant::Vec<3>::Constant(2 * near_touch)));
  CHECK(network.coordination() == 6);
  CHECK(network.isostatic() == 22);
}

TEST_CASE("contacts with forces far below the typical one do not count", "[contact_network]") {
  auto places = flower();
  places.push_back(places[1] + 0.9999 * at_angle(0));  // a light touch
  CHECK(network_of(disks(places), ModelKind::sp).typical_force ==
        Approx(network_of(disks(flower()), ModelKind::sp).typical_force).epsilon(1e-3));
  places.back() = places[1] + places[2];
  places.push_back(places.back() + 0.9999 * at_angle(-pi / 3));
  places.push_back(places[1] + near_touch * at_angle(-pi / 6));
  // Disk 1 is held by seven disks, of which one pushes little.
  places[1] *= 0.9999 / near_touch;
  const auto all = network_of(disks(places), ModelKind::sp),
             strong = network_of(disks(places), ModelKind::sp, {}, 0.05);
  CHECK(all.rattlers.size() < strong.rattlers.size());
  CHECK(strong.touching() < all.touching());
}

TEST_CASE("bonds of droplets that attract each other at a distance are contacts", "[contact_network]") {
  Configuration<2> c;
  for (const Real distance : {0.0, 1.02, 2.04, 3.3}) c.add_droplet(0.5, {distance, 0});
  auto system = system_of<2>(c, ModelKind::bubble);
  Real force = 0;
  Index in_range = 0;
  system.field().for_each_contact(system.view(c.x.data(), nullptr), [&](const Contact<2>& bond) {
    CHECK(bond.overlap < 0);
    CHECK(bond.force.dot(bond.normal) < 0);
    force = bond.force.norm();
    ++in_range;
  });
  REQUIRE(in_range == 2);
  const auto network = contact_network<2>(system, c.x);
  CHECK(network.typical_force == Approx(force));
  CHECK(network.rattlers.size() == 4);  // a droplet needs three bonds
}

TEST_CASE("polygons need two neighbours and three contacts", "[contact_network]") {
  SECTION("rough") {
    // Two squares face to face: two vertices touch two vertices. A single neighbour does not hold a polygon.
    auto network = network_of(squares({{0, 0}, {1.19, 0}}), ModelKind::rough);
    CHECK(network.rattlers == std::vector<Index>{0, 1});
    Configuration<2> faces;
    faces.add_polygon({{0, 0}, {1, 0}, {1, 0.5}, {1, 1}, {0, 1}}, 0.2);
    faces.add_polygon({{1.19, 0}, {2.19, 0}, {2.19, 1}, {1.19, 1}, {1.19, 0.5}}, 0.2);
    network = network_of(faces, ModelKind::rough);
    CHECK(network.rattlers == std::vector<Index>{0, 1});
    // In a periodic row each has two neighbours and four contacts.
    network = network_of(squares({{0, 0}, {1.19, 0}}), ModelKind::rough, Box<2>({0, 0}, {2.38, Box<2>::infinite}));
    CHECK(network.rattlers.empty());
    CHECK(network.touching() == 2);
    CHECK(network.contacts == 4);
    CHECK(network.coordination() == 2);
    CHECK(network.contacts_per_particle() == 4);
  }
  SECTION("smooth: vertices face to face touch each other once") {
    const auto row =
        network_of(squares({{0, 0}, {1.19, 0}}), ModelKind::smooth, Box<2>({0, 0}, {2.38, Box<2>::infinite}));
    CHECK(row.rattlers.empty());
    CHECK(row.contacts == 4);
    // Corners against corners, four for each square.
    const auto corners = network_of(squares({{0, 0}, {1.13, 1.13}}), ModelKind::smooth, Box<2>({0, 0}, {2.26, 2.26}));
    CHECK(corners.touching() == 4);
    CHECK(corners.contacts == 4);
    const auto edges =
        network_of(squares({{0, 0}, {1.19, 0.4}}), ModelKind::smooth, Box<2>({0, 0}, {2.38, Box<2>::infinite}));
    CHECK(edges.contacts == 4);
    CHECK(edges.rattlers.empty());
  }
}

TEST_CASE("contact networks refuse walls and thresholds out of range", "[contact_network]") {
  Configuration<2> c = disks(flower());
  CHECK_THROWS_WITH(network_of(c, ModelKind::sp, {}, -0.1), Contains("-0.1"));
  CHECK_THROWS_WITH(network_of(c, ModelKind::sp, {}, 1), Contains("below 1"));
  c.walls = test_hopper(45).walls<2>();
  CHECK_THROWS_WITH(network_of(c, ModelKind::sp), Contains("walls"));
}

}  // namespace pliant::test::contact_network_test
