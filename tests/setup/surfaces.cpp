// Closed surfaces of a run: the start, piercings and shapes without meaning.
#include <catch2/catch.hpp>

#include <cmath>
#include <memory>
#include <vector>

#include <pliant/model/surface_crossing.h>
#include <pliant/model/surface_measures.h>
#include <pliant/setup/particles.h>

#include "support/configurations.h"

namespace pliant::test::surfaces_test {
namespace {

/// Icospheres of 42 vertices and diameter 1 at these places.
Configuration<3> spheres(const std::vector<Vec<3>>& centres) {
  Configuration<3> c;
  c.topology = make_particles(ModelKind::rough, 3, std::vector<Real>(centres.size(), 1.0), {.vertices = 42});
  c.x.resize(static_cast<std::size_t>(c.topology.points()) * 3);
  c.v.resize(c.x.size());
  for (std::size_t m = 0; m < centres.size(); ++m)
    place_surface(c.topology, static_cast<Index>(m), centres[m], random_rotation(0.3, 0.7, 0.2), c.x.data());
  return c;
}

Vec<3> normal_of(const Configuration<3>& c, Index m, Index face) {
  const Index first = c.topology.offset[m];
  const auto& [a, b, d] = c.topology.surfaces->of(c.topology, m).faces[static_cast<std::size_t>(face)];
  return face_normal(c.position(first + a), c.position(first + b), c.position(first + d)).normalized();
}

Vec<3> middle_of(const Configuration<3>& c, Index m, Index face) {
  const Index first = c.topology.offset[m];
  const auto& [a, b, d] = c.topology.surfaces->of(c.topology, m).faces[static_cast<std::size_t>(face)];
  return (c.position(first + a) + c.position(first + b) + c.position(first + d)) / 3;
}

}  // namespace

TEST_CASE("a segment pierces a triangle only through its inside") {
  const Vec<3> a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  CHECK(pierces({0.2, 0.2, -1}, {0.2, 0.2, 1}, a, b, c));
  CHECK(pierces({0.2, 0.2, 1}, {0.2, 0.2, -1}, a, b, c));
  CHECK(pierces({-1, 0.1, -1}, {1.3, 0.1, 1}, a, b, c));
  CHECK_FALSE(pierces({0.2, 0.2, 0.01}, {0.2, 0.2, 1}, a, b, c));  // ends above it
  CHECK_FALSE(pierces({0.6, 0.6, -1}, {0.6, 0.6, 1}, a, b, c));    // passes next to it
  CHECK_FALSE(pierces({-0.01, 0.2, -1}, {-0.01, 0.2, 1}, a, b, c));
}

TEST_CASE("surfaces beside each other do not pierce, overlapping ones do") {
  for (const Real distance : {1.05, 0.9, 0.5}) {
    Configuration<3> c = spheres({{0, 0, 0}, {distance, 0, 0}, {0, 5, 0}});
    const SurfacesLook seen = look_at_surfaces(c.view());
    INFO(distance);
    CHECK(seen.piercing.has_value() == (distance < 1));
    CHECK(!seen.bad_shape);
    CHECK(seen.self_crossings == 0);
    if (!seen.piercing) continue;
    const Piercing& p = *seen.piercing;
    CHECK(p.particle + p.other == 1);
    const Surface& surface = c.topology.surfaces->of(c.topology, p.other);
    const auto at = [&](Index m, Index i) { return c.position(c.topology.offset[m] + i); };
    const Face& face = surface.faces[static_cast<std::size_t>(p.face)];
    CHECK(pierces(at(p.particle, p.a), at(p.particle, p.b), at(p.other, face[0]), at(p.other, face[1]),
                  at(p.other, face[2])));
  }
}

TEST_CASE("a surface inside another one is found, also in a pair that is not the first") {
  for (const Real offset : {0.0, 0.3}) {
    Configuration<3> c = spheres({{3, 0, 0}, {3.9, 3, 0}, {offset, 0, 0}, {0, 0, 0}});
    const auto shrink = [&](Index m, Real factor) {
      const Vec<3> centre(offset, 0, 0);
      for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i)
        point<3>(c.x.data(), i) = centre + factor * (c.position(i) - centre);
    };
    shrink(2, 0.2);
    INFO(offset);
    const SurfacesLook seen = look_at_surfaces(c.view());
    REQUIRE(seen.enclosure);
    CHECK(seen.enclosure->inner == 2);
    CHECK(seen.enclosure->outer == 3);
    CHECK(!seen.piercing);
    // Its box alone is inside the box of the other one, in a corner beyond the faces.
    for (Index i = c.topology.offset[2]; i < c.topology.offset[3]; ++i)
      point<3>(c.x.data(), i) += Vec<3>(0.38 - offset, 0.38, 0.38);
    CHECK(!look_at_surfaces(c.view()).enclosure);
  }
}

TEST_CASE("an edge that pierces a face is found though each vertex is outside") {
  // A long tooth of the second particle reaches through the first, out at the other side: all vertices are outside.
  Configuration<3> c = spheres({{0, 0, 0}, {1.5, 0, 0}});
  const Index first = c.topology.offset[1];
  Index tooth = first;
  for (Index i = first; i < c.topology.offset[2]; ++i)
    if (c.position(i)[0] < c.position(tooth)[0]) tooth = i;
  point<3>(c.x.data(), tooth) = Vec<3>(-2, 0.05, 0.03);
  const SurfacesLook seen = look_at_surfaces(c.view());
  REQUIRE(seen.piercing);
  CHECK(seen.piercing->particle + seen.piercing->other == 1);
}

TEST_CASE("a surface that crosses itself, folds, or is inverted is found") {
  Configuration<3> c = spheres({{0, 0, 0}, {3, 0, 0}});
  SECTION("a vertex is pushed out at the opposite side") {
    point<3>(c.x.data(), 0) *= -1.5;
    const SurfacesLook seen = look_at_surfaces(c.view());
    REQUIRE(seen.self_piercing);
    CHECK(seen.self_piercing->particle == 0);
    CHECK(seen.self_piercing->other == 0);
    CHECK(seen.crossing_itself == Index{0});
    CHECK(seen.self_crossings == 1);
    CHECK(!seen.piercing);
  }
  SECTION("two faces fold over each other") {
    // The tip of a face moves over the opposite edge, just above the surface.
    const Hinge& h = c.topology.surfaces->of(c.topology, 0).hinges[0];
    const Vec<3> edge = (c.position(h.a) + c.position(h.b)) / 2, other = c.position(h.d);
    point<3>(c.x.data(), h.c) = edge + 0.5 * (other - edge) + 0.15 * edge.normalized();
    const SurfacesLook seen = look_at_surfaces(c.view());
    CHECK(seen.crossing_itself == Index{0});
    CHECK(seen.self_crossings == 1);
  }
  SECTION("inverted") {
    for (Real& a : c.x) a = -a;
    const SurfacesLook seen = look_at_surfaces(c.view());
    REQUIRE(seen.bad_shape);
    CHECK(seen.bad_shape->kind == BadShape::Kind::inverted);
  }
  SECTION("a face without area") {
    const Face& face = c.topology.surfaces->of(c.topology, 1).faces[7];
    const Index first = c.topology.offset[1];
    point<3>(c.x.data(), first + face[2]) = (c.position(first + face[0]) + c.position(first + face[1])) / 2;
    const SurfacesLook seen = look_at_surfaces(c.view());
    REQUIRE(seen.bad_shape);
    CHECK(seen.bad_shape->particle == 1);
    CHECK(seen.bad_shape->kind == BadShape::Kind::flat_face);
  }
  SECTION("a dent is no crossing") {
    const Vec<3> inwards = -0.15 * c.position(0).normalized();
    point<3>(c.x.data(), 0) += inwards;
    const SurfacesLook seen = look_at_surfaces(c.view());
    CHECK(seen.self_crossings == 0);
    CHECK(!seen.bad_shape);
  }
  SECTION("a vertex just through a distant face of its own") {
    // Not star-shaped: the piercing is looked for, and is there only beyond the face.
    const Index far = 40;
    const auto& faces = c.topology.surfaces->of(c.topology, 0).faces;
    Index face = 0;
    while (faces[static_cast<std::size_t>(face)][0] == far || faces[static_cast<std::size_t>(face)][1] == far ||
           faces[static_cast<std::size_t>(face)][2] == far || normal_of(c, 0, face).dot(c.position(far)) > -0.4)
      ++face;
    for (const Real beyond : {-0.02, 0.02}) {
      point<3>(c.x.data(), far) = middle_of(c, 0, face) + beyond * normal_of(c, 0, face);
      INFO(beyond);
      CHECK(look_at_surfaces(c.view()).self_piercing.has_value() == (beyond > 0));
    }
  }
}

TEST_CASE("volumes of rims of surfaces") {
  const auto placed = [](const TriangleMesh& mesh) {
    Configuration<3> c;
    const auto surfaces = std::make_shared<Surfaces>();
    surfaces->kinds.push_back(relaxed_surface(mesh));
    surfaces->add_particle(c.topology, 0, surfaces->kinds[0].volume, 0.1, 1);
    c.topology.dim = 3;
    c.topology.surfaces = surfaces;
    c.x.resize(mesh.vertices.size() * 3);
    c.v.resize(c.x.size());
    place_surface(c.topology, 0, {1e3, 2, 3}, random_rotation(0.1, 0.2, 0.6), c.x.data());
    return c;
  };
  const std::vector<Face> faces{{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                                {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  TriangleMesh block;
  for (const Real x : {0, 1})
    for (const Real y : {0, 2})
      for (const Real z : {0, 3}) block.vertices.emplace_back(x, y, z);
  block.faces = faces;
  {
    // A block with its faces, quarters of cylinders along its edges, and eighths of spheres at its corners.
    const Configuration<3> c = placed(block);
    const Surface& surface = c.topology.surfaces->kinds[0];
    const Real w = 0.2, shell = 22 * w + pi * w * w * (1 + 2 + 3) + 4 * pi / 3 * w * w * w;
    CHECK(shell_volume(c.x.data(), c.topology, surface, 0, w) == Approx(shell).epsilon(1e-9));
    // Seven eighths of each sphere are outside.
    CHECK(outer_spheres_volume(c.x.data(), c.topology, surface, 0, w) == Approx(7 * pi * w * w * w / 6).epsilon(1e-9));
  }
  // The solid angle at a vertex of a regular tetrahedron is acos(23/27).
  TriangleMesh tetrahedron;
  tetrahedron.vertices = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  tetrahedron.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  const Configuration<3> c = placed(tetrahedron);
  const Real d = 0.7, outside = 4 * (1 - std::acos(23.0 / 27) / (4 * pi));
  CHECK(outer_spheres_volume(c.x.data(), c.topology, c.topology.surfaces->kinds[0], 0, d) ==
        Approx(outside * pi * d * d * d / 6).epsilon(1e-9));
}

TEST_CASE("particles of a run in space are icospheres of the volume of a sphere") {
  const Topology t = make_particles(ModelKind::rough, 3, {1.0, 1.4}, {.vertices = 42});
  CHECK(t.dim == 3);
  CHECK(t.points() == 84);
  std::vector<Real> x(84 * 3);
  for (const Index m : {0, 1}) {
    place_surface(t, m, Vec<3>(3 * m, 1, 2), random_rotation(0.9, 0.1 * m, 0.4), x.data());
    const Surface& surface = t.surfaces->of(t, m);
    CHECK(surface_volume(x.data(), t, surface, m) == Approx(t.a0[m]));
    CHECK(t.a0[m] == Approx(pi / 6 * std::pow(t.sigma[m], 3)));
    CHECK((mean_of_points<3>(x.data(), t, m) - Vec<3>(3 * m, 1, 2)).norm() < 1e-14);
    CHECK(t.point_mass[m] * 42 == Approx(t.a0[m]));
    CHECK(t.diameter[t.offset[m]] == Approx(surface.mean_rest_length() * t.sigma[m]));
    // All vertices of an icosphere lie on a sphere, half a contact diameter inside the rim.
    const Real radius = (point<3>(x.data(), t.offset[m]) - Vec<3>(3 * m, 1, 2)).norm();
    CHECK(outer_radius(t, m) == Approx(radius + t.diameter[t.offset[m]] / 2));
    const Real area = surface_area(x.data(), t, surface, m);
    CHECK(shape_parameter(area, t.a0[m]) == Approx(1.02406).epsilon(1e-5));
  }
  const Topology floppy =
      make_particles(ModelKind::smooth, 3, {1.0}, {.vertices = 12, .shape_parameter = 1.3, .edge_width = 0.2});
  CHECK(floppy.diameter[0] == Approx(0.2 * floppy.l0[0]));
  CHECK(shape_parameter(floppy.surfaces->kinds[0].total_rest_area(), floppy.a0[0]) == Approx(1.3));
  CHECK_THROWS_WITH(make_particles(ModelKind::rough, 3, {1.0}, {.vertices = 16}), Catch::Contains("12, 42, 162"));
  CHECK_THROWS_WITH(make_particles(ModelKind::rough, 3, {1.0}, {.vertices = 42, .shape_parameter = 1.01}),
                    Catch::Contains("1.02"));
}

TEST_CASE("random rotations are rotations, and point everywhere") {
  Random random(3);
  Vec<3> mean = Vec<3>::Zero();
  Mat<3> second = Mat<3>::Zero();
  constexpr int n = 20000;
  for (int k = 0; k < n; ++k) {
    const Mat<3> r = random_rotation(random(0, 1), random(0, 1), random(0, 1));
    CHECK((r * r.transpose() - Mat<3>::Identity()).norm() < 1e-13);
    CHECK(r.determinant() == Approx(1));
    mean += r.col(1) / n;
    second += r.col(1) * r.col(1).transpose() / n;
  }
  CHECK(mean.norm() < 0.02);
  CHECK((second - Mat<3>::Identity() / 3).norm() < 0.02);
}

}  // namespace pliant::test::surfaces_test
