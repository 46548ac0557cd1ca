// A frame of a few particles with known contacts.
#include <catch2/catch.hpp>

#include <memory>
#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/run/frame_data.h>

#include "support/configurations.h"
#include "support/model_parameters.h"

namespace pliant::test::frame_data_test {

namespace {

using pliant::Vec;  // PETSc has one, too

template <int D>
struct Scene {
  explicit Scene(ModelKind kind, Walls<D> walls = {}) : kind_(kind), walls_(std::move(walls)) {}

  /// With contacts of energy 100 E, those with walls of energy 1.
  FrameData<D> frame() {
    const ModelParameters p{.epsilon = 100, .epsilon_wall = 1};
    system = std::make_unique<ParticleSystem<D>>(c.topology, walls_, make_force_field<D>(kind_, p, Vec<D>::Zero()), 0.1,
                                                 Ranks(), box);
    State state(c.topology.points(), D);
    std::copy(c.x.begin(), c.x.end(), state.x().begin());
    std::copy(c.v.begin(), c.v.end(), state.v().begin());
    state.t = 2.5;
    state.step = 40;
    return FrameData<D>(*system, state, reinsertions.empty() ? nullptr : &reinsertions);
  }

  Configuration<D> c;
  Box<D> box;
  std::vector<Index> reinsertions = {};
  std::unique_ptr<ParticleSystem<D>> system;

 private:
  ModelKind kind_;
  Walls<D> walls_;
};

std::vector<Real> listed(std::span<const Real> values) { return {values.begin(), values.end()}; }
std::vector<Index> listed(std::span<const Index> values) { return {values.begin(), values.end()}; }

}  // namespace

TEST_CASE("a frame has particles and contacts in the order of the ids", "[frame]") {
  Scene<2> scene(ModelKind::sp, Walls<2>({WallSegment::between({-10, 0}, {10, 0})}));
  // In memory: 2, 0, 1. Particles 0 and 2 touch by a tenth of their diameter, 1 presses on the wall.
  scene.c.add_soft(1, {0, 5});
  scene.c.add_soft(1, {0.9, 5});
  scene.c.add_soft(1, {-3, 0.4});
  scene.c.topology.id = {2, 0, 1};
  scene.c.v = {2, 2.5, 0, 0.5, 1, 1.5};
  const auto data = scene.frame();
  const Frame& f = data.frame;
  CHECK(f.time == 2.5);
  CHECK(f.step == 40);
  CHECK(listed(f.offset) == std::vector<Index>{0, 1, 2, 3});
  CHECK(listed(f.positions) == std::vector<Real>{0.9, 5, -3, 0.4, 0, 5});
  CHECK(listed(f.velocities) == std::vector<Real>{0, 0.5, 1, 1.5, 2, 2.5});
  CHECK(listed(f.centres) == listed(f.positions));
  CHECK(f.area.empty());
  CHECK(listed(f.contact_count) == std::vector<Index>{1, 0, 1});
  // V = E/2 (1 − 2d/σ)² at d = 0.4: force E 0.2 · 2/σ, downwards on the wall.
  REQUIRE(f.wall_force.size() == 2);
  CHECK(f.wall_force[0] == Approx(0).margin(1e-15));
  CHECK(f.wall_force[1] == Approx(-0.4));
  // V = E/2 (1 − r/δ)² at r = 0.9: force 100 · 0.1, on particle 0 away from 2.
  REQUIRE(f.contacts.count == 1);
  const Index* particles = f.contacts.particles[0];
  CHECK(particles[0] == 0);
  CHECK(particles[1] == 2);
  CHECK(*f.contacts.overlap[0] == Approx(0.1));
  CHECK(f.contacts.normal[0][0] == Approx(1));
  CHECK(f.contacts.normal[0][1] == Approx(0).margin(1e-15));
  CHECK(f.contacts.force[0][0] == Approx(10));
  CHECK(f.contacts.force[0][1] == Approx(0).margin(1e-13));
  CHECK(f.contacts.position[0][0] == Approx(0.45));
  // The wall pushes particle 1 up.
  REQUIRE(f.wall_contacts.count == 1);
  CHECK(std::vector<Index>(f.wall_contacts.particles[0], f.wall_contacts.particles[0] + 2) == std::vector<Index>{1, 0});
  CHECK(*f.wall_contacts.overlap[0] == Approx(0.2));
  const auto rows = [](const Strided<Real>& of) { return std::vector<Real>(of[0], of[0] + 2); };
  CHECK(rows(f.wall_contacts.position) == std::vector<Real>{-3, 0});
  CHECK(rows(f.wall_contacts.normal) == std::vector<Real>{0, 1});
  CHECK(f.wall_contacts.force[0][0] == Approx(0).margin(1e-15));
  CHECK(f.wall_contacts.force[0][1] == Approx(0.4));
  CHECK(f.reinsertions.empty());
}

namespace {

/// Row k: the sum of the forces of contacts with wall k, and −wall_force.
template <int D>
void check_sums(const Frame& f) {
  std::vector<Real> sum(f.wall_force.size(), 0);
  for (std::size_t c = 0; c < f.wall_contacts.count; ++c)
    for (int k = 0; k < D; ++k)
      sum[static_cast<std::size_t>(f.wall_contacts.particles[c][1]) * D + static_cast<std::size_t>(k)] +=
          f.wall_contacts.force[c][k];
  for (std::size_t k = 0; k < sum.size(); ++k) CHECK(sum[k] == Approx(-f.wall_force[k]).margin(1e-14));
}

}  // namespace

TEST_CASE("a disk in a corner has a contact with each wall, and one that is near has none", "[frame]") {
  Scene<2> scene(ModelKind::sp, Walls<2>({WallSegment::between({0, 0}, {10, 0}), WallSegment::between({0, 0}, {0, 10}),
                                          WallSegment::between({0, -1}, {10, -1})}));
  scene.c.add_soft(1, {0.45, 0.4});
  scene.c.add_soft(1, {5, 0.55});  // within the skin
  scene.c.add_soft(1, {3, -0.5});  // between two walls, touches neither
  const auto data = scene.frame();
  const Frame& f = data.frame;
  REQUIRE(f.wall_contacts.count == 2);
  for (const std::size_t wall : {0u, 1u}) {
    const Index* partners = f.wall_contacts.particles[wall];
    CHECK((partners[0] == 0 && partners[1] == static_cast<Index>(wall)));
    const Real d = wall == 0 ? 0.4 : 0.45;
    const std::size_t axis = 1 - wall;
    CHECK(*f.wall_contacts.overlap[wall] == Approx(1 - 2 * d));
    CHECK(f.wall_contacts.normal[wall][axis] == Approx(1));
    CHECK(f.wall_contacts.force[wall][axis] == Approx(2 * (1 - 2 * d)));
    CHECK(f.wall_contacts.force[wall][1 - axis] == Approx(0).margin(1e-15));
  }
  check_sums<2>(f);
  CHECK(listed(f.contact_count) == std::vector<Index>{0, 0, 0});
  // The lists are as they were.
  CHECK(scene.system->neighbours().walls.size() > 3);
  const auto again = scene.frame();
  CHECK(again.frame.wall_contacts.count == 2);
}

TEST_CASE("a polygon touches a lip once, with an edge and with vertices", "[frame]") {
  Scene<2> scene(ModelKind::rough, Walls<2>({WallSegment::between({0, 0}, {-10, 0})}, {{{0, 0}, 0}}));
  scene.c.add_polygon({{0.01, 0.04}, {1, 0.04}, {1, 1}, {0.01, 1}}, 0.1);  // a vertex above the lip, and its edges
  scene.c.add_polygon({{-1, -0.03}, {-0.8, -1}, {1.2, -1}, {1.0, -0.03}},
                      0.1);  // an edge below it, a vertex at the wall
  const auto data = scene.frame();
  const Frame& f = data.frame;
  check_sums<2>(f);
  REQUIRE(f.wall_contacts.count == 3);
  CHECK(*f.wall_contacts.particles[0] == 0);
  CHECK(f.wall_contacts.position[0][0] == Approx(0).margin(1e-12));
  CHECK(*f.wall_contacts.overlap[0] == Approx(1 - 20 * std::hypot(0.01, 0.04)));
  CHECK(f.wall_contacts.force[0][1] > 0);
  CHECK(*f.wall_contacts.particles[1] == 1);
  CHECK(*f.wall_contacts.particles[2] == 1);
  CHECK(f.wall_contacts.position[1][0] == Approx(-1));
  CHECK(f.wall_contacts.position[2][0] == Approx(0).margin(1e-12));
  for (const std::size_t c : {1u, 2u}) {
    CHECK(*f.wall_contacts.overlap[c] == Approx(0.4));
    CHECK(f.wall_contacts.normal[c][1] == Approx(-1));
    CHECK(f.wall_contacts.force[c][1] == Approx(-8));  // V = 1/2 (1 − 2d/δ)²: 0.4 · 2/δ
  }
}

TEST_CASE("a frame says how often particles were reinserted, by id", "[frame]") {
  Scene<2> scene(ModelKind::sp);
  for (int k = 0; k < 3; ++k) scene.c.add_soft(1, {2.0 * k, 0});
  scene.c.topology.id = {2, 0, 1};
  scene.reinsertions = {7, 5, 6};
  CHECK(listed(scene.frame().frame.reinsertions) == std::vector<Index>{5, 6, 7});
}

TEST_CASE("a frame of spheres", "[frame]") {
  Scene<3> scene(ModelKind::sp);
  scene.c.add_soft(1, {0, 0, 0});
  scene.c.add_soft(2, {0, 0, 1.2});
  scene.c.add_soft(1, {0, 0.75, 0});
  const auto data = scene.frame();
  CHECK(listed(data.frame.contact_count) == std::vector<Index>{2, 2, 2});
  REQUIRE(data.frame.contacts.count == 3);
  CHECK(*data.frame.contacts.overlap[0] == Approx(0.2));   // 0 and 1
  CHECK(*data.frame.contacts.overlap[1] == Approx(0.25));  // 0 and 2
  CHECK(data.frame.contacts.normal[1][1] == Approx(-1));
  CHECK(data.frame.contacts.force[1][1] == Approx(-25));
}

TEST_CASE("a frame of polygons has their centres, areas and perimeters, and who has left", "[frame]") {
  Scene<2> scene(ModelKind::rough);
  scene.c.add_polygon(regular_polygon(4, 0.5), 0.1);
  scene.c.add_polygon({{5, 0}, {8, 0}, {5, 4}}, 0.1);
  scene.c.topology.id = {1, 0};
  scene.c.v.assign(scene.c.x.size(), 1);
  scene.c.topology.deactivate(0);
  const auto data = scene.frame();
  const Frame& f = data.frame;
  CHECK(listed(f.offset) == std::vector<Index>{0, 3, 7});
  CHECK(f.positions[2] == 8);
  CHECK(f.centres[0] == Approx(6));
  CHECK(f.centres[1] == Approx(4.0 / 3));
  CHECK(std::vector<std::uint8_t>(f.active.begin(), f.active.end()) == std::vector<std::uint8_t>{1, 0});
  CHECK(f.area[0] == Approx(6));
  CHECK(f.perimeter[0] == Approx(12));
  CHECK(f.area[1] == Approx(0.5));
  CHECK(f.perimeter[1] == Approx(4 * std::sqrt(0.5)));
  CHECK(f.contacts.count == 0);
}

TEST_CASE("a frame of a periodic box has particles inside and contacts across its borders", "[frame]") {
  Scene<2> scene(ModelKind::sp);
  constexpr Real infinite = Box<2>::infinite;
  scene.box = Box<2>({0, 0}, {10, infinite});
  scene.c.add_soft(1, {20.3, 5});  // two box lengths on
  scene.c.add_soft(1, {-0.6, 5});  // touches it by a tenth
  scene.c.add_soft(1, {5, -7});    // nothing wraps it along y
  const auto data = scene.frame();
  const Frame& f = data.frame;
  const std::vector<Real> x = listed(f.positions);
  CHECK(x[0] == Approx(0.3));
  CHECK(x[2] == Approx(9.4));
  CHECK((x[4] == 5 && x[5] == -7));
  CHECK(std::vector<std::int64_t>(f.images.begin(), f.images.end()) == std::vector<std::int64_t>{2, 0, -1, 0, 0, 0});
  REQUIRE(f.contacts.count == 1);
  CHECK(listed(f.contact_count) == std::vector<Index>{1, 1, 0});
  CHECK(f.contacts.normal[0][0] == Approx(1));
  CHECK(f.contacts.force[0][0] == Approx(10));
  CHECK(f.contacts.position[0][0] == Approx(-0.15));
}

TEST_CASE("a particle that touches its own image has one contact, with two sides", "[frame]") {
  Scene<2> scene(ModelKind::sp);
  scene.box = Box<2>({0, 0}, {0.8, 5});
  scene.c.add_soft(1, {0.5, 0.5});
  const auto data = scene.frame();
  REQUIRE(data.frame.contacts.count == 1);
  CHECK(data.frame.contacts.particles[0][0] == data.frame.contacts.particles[0][1]);
  CHECK(listed(data.frame.contact_count) == std::vector<Index>{2});
  CHECK(std::abs(data.frame.contacts.force[0][0]) == Approx(20));
}

TEST_CASE("a polygon across the border of a box is drawn whole, where its centre is", "[frame]") {
  Scene<2> scene(ModelKind::rough);
  scene.box = Box<2>({0, 0}, {4, 4});
  scene.c.add_polygon(regular_polygon(4, 0.5, {-0.2, 1}), 0.1);
  const auto data = scene.frame();
  CHECK(data.frame.positions[0] == Approx(4.3));
  CHECK(data.frame.centres[0] == Approx(3.8));
  CHECK(data.frame.images[0] == -1);
  CHECK(data.frame.area[0] == Approx(0.5));
}

}  // namespace pliant::test::frame_data_test
