// Closed surfaces in space: derivatives, invariances, the continuum limit and the measures of their shape.
#include <catch2/catch.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/model/surface_arrays.h>
#include <pliant/model/surface_measures.h>
#include <pliant/model/surface_terms.h>

#include "support/configurations.h"
#include "support/derivatives.h"

namespace pliant::test::surface_test {

namespace {

using Fields = std::vector<std::pair<std::string, std::unique_ptr<ForceField<3>>>>;

TriangleMesh tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

/// All terms, each alone.
Fields each_term() {
  Fields all;
  all.emplace_back("volume", alone<3>(Volume{{}, 10}));
  all.emplace_back("area", alone<3>(FaceArea{{}, 3}));
  all.emplace_back("tension", alone<3>(SurfaceTension{{}, 2}));
  all.emplace_back("edge", alone<3>(EdgeLength{{}, 4}));
  all.emplace_back("bending", alone<3>(HingeBending{{}, 0.7}));
  all.emplace_back("bending with rest angles", alone<3>(HingeBending{{}, 0.7, true}));
  return all;
}

void add(Configuration<3>& c, Surfaces& surfaces, Index which, Real volume, const std::vector<Vec<3>>& vertices) {
  surfaces.add_particle(c.topology, which, volume, 0.1, volume);
  for (const Vec<3>& r : vertices) c.x.insert(c.x.end(), r.begin(), r.end());
  c.v.resize(c.x.size());
}

/// A tetrahedron and an icosahedron, of other sizes and orientations than their surfaces and deformed.
Configuration<3> deformed(Random& random, Real away = 0) {
  const auto surfaces = std::make_shared<Surfaces>();
  surfaces->kinds = {relaxed_surface(tetrahedron()), surface_with_shape(icosphere(12), 1.2)};
  Configuration<3> c;
  for (const Index which : {0, 1}) {
    TriangleMesh mesh = which == 0 ? tetrahedron() : icosphere(12);
    const Real size = random(0.5, 2);
    const Vec<3> axis = random.unit<3>(), centre = Vec<3>(4 * which, away, 0);
    const Mat<3> turn = Eigen::AngleAxis<Real>(random(0, 3), axis).toRotationMatrix();
    for (Vec<3>& r : mesh.vertices) {
      Vec<3> noise;
      for (int k = 0; k < 3; ++k) noise[k] = random(-0.1, 0.1);
      r = centre + size * (turn * (r + noise));
    }
    add(c, *surfaces, which, (which == 0 ? 0.2 : 0.6) * size * size * size, mesh.vertices);
  }
  c.topology.surfaces = surfaces;
  return c;
}

/// A particle in its rest shape.
Configuration<3> resting(const TriangleMesh& mesh, Real size = 1) {
  const auto surfaces = std::make_shared<Surfaces>();
  surfaces->kinds = {relaxed_surface(mesh)};
  Configuration<3> c;
  std::vector<Vec<3>> vertices = mesh.vertices;
  for (Vec<3>& r : vertices) r *= size;
  add(c, *surfaces, 0, surfaces->kinds[0].volume * size * size * size, vertices);
  c.topology.surfaces = surfaces;
  return c;
}

}  // namespace

TEST_CASE("derivatives of the shape terms of surfaces") {
  for (const auto& [name, field] : each_term()) {
    INFO(name);
    check_smooth<3>(
        *field, [&](Random& random) { return deformed(random); }, 1e-4);
  }
}

TEST_CASE("shape terms of surfaces have no net force and no net torque, here or far away") {
  for (const auto& [name, field] : each_term())
    for (int k = 0; k < 5; ++k) {
      INFO(name << ", state " << k);
      Random random(k), again(k);
      Configuration<3> c = deformed(random);
      // A shift that rounds no position.
      for (Real& a : c.x) a = std::ldexp(std::round(std::ldexp(a, 24)), -24);
      const auto forces = [&] {
        VectorXd f(c.x.size());
        field->energy(c.view(), f.data());
        return f;
      };
      const VectorXd f = forces();
      for (Index m = 0; m < 2; ++m) {
        Vec<3> sum = Vec<3>::Zero(), torque = Vec<3>::Zero();
        for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i) {
          const Vec<3> one = point<3>(f.data(), i);
          sum += one;
          torque += c.position(i).cross(one);
        }
        CHECK(sum.norm() < 1e-13 * f.norm());
        CHECK(torque.norm() < 1e-12 * f.norm());
      }
      const Real energy = field->energy(c.view());
      for (Real& a : c.x) a += std::ldexp(1, 24);
      CHECK((forces() - f).norm() < 1e-13 * f.norm());
      CHECK(field->energy(c.view()) == Approx(energy).epsilon(1e-13));
    }
}

TEST_CASE("the kernel of surfaces computes the forces of the terms") {
  // All terms, each alone, and all with rest angles; particles of two meshes, alone and in batches.
  const std::vector<ParameterValues> all{{{"k_v", 10.0}, {"k_a", 0.0}, {"k_l", 0.0}, {"k_b", 0.0}},
                                         {{"k_v", 0.0}, {"k_a", 3.0}, {"k_l", 0.0}, {"k_b", 0.0}},
                                         {{"k_v", 0.0}, {"k_a", 0.0}, {"k_l", 4.0}, {"k_b", 0.0}},
                                         {{"k_v", 0.0}, {"k_a", 0.0}, {"k_l", 0.0}, {"k_b", 0.7}},
                                         {{"k_v", 0.0}, {"k_a", 0.0}, {"k_l", 0.0}, {"k_b", 0.0}, {"gamma", 2.0}},
                                         {{"k_v", 10.0}, {"k_b", 0.7}, {"gamma", 2.0}, {"rest_angles", 1.0}}};
  for (const ParameterValues& values : all) {
    Random random(5);
    Configuration<3> c = deformed(random);
    for (int k = 0; k < 5; ++k) {
      Configuration<3> more = deformed(random, 3 * (k + 1));
      const auto surfaces = std::make_shared<Surfaces>(*c.topology.surfaces);
      // The icosahedron alone, of the same mesh: it joins the batch of the last one.
      surfaces->add_particle(c.topology, 1, more.topology.a0[1], 0.1, 1);
      c.topology.surfaces = surfaces;
      c.x.insert(c.x.end(), more.x.begin() + 12, more.x.end());
      c.v.resize(c.x.size());
    }
    ParameterValues p = values;
    const auto field = make_force_field<3>(ModelKind::shape, p);
    const StateView<3> s = c.view();
    VectorXd fused(c.x.size()), sum = VectorXd::Zero(static_cast<Eigen::Index>(c.x.size()));
    field->forces(s, fused.data());
    for (const TermReport& term : field->report(s))
      sum += Eigen::Map<const VectorXd>(term.force.data(), static_cast<Eigen::Index>(term.force.size()));
    CHECK(sum.norm() > 0.1);
    CHECK((fused - sum).norm() < 1e-13 * sum.norm());
  }
}

TEST_CASE("a surface at rest has no energy but that of bending and tension") {
  for (const Real size : {1.0, 1.7}) {
    Configuration<3> c = resting(icosphere(42), size);
    CHECK(c.topology.sigma[0] == Approx(size));
    CHECK(c.topology.points_of(0) == 42);
    CHECK(c.topology.l0[0] == Approx(0.30457 * size).epsilon(0.02));
    for (const auto& [name, field] : each_term()) {
      INFO(name);
      const bool at_rest = name != "tension" && name != "bending";
      CHECK((std::abs(field->energy(c.view())) < 1e-20) == at_rest);
    }
  }
}

TEST_CASE("bending of a sphere") {
  // 2π √3 (4 − 4/3)/2 = 7.255 k_b for equilateral triangles; twelve vertices have five neighbours.
  const auto bending = alone<3>(HingeBending{{}, 1});
  for (const auto& [vertices, energy] : {std::pair{12, 7.63932}, std::pair{162, 7.485}, std::pair{642, 7.499}}) {
    Configuration<3> c = resting(icosphere(vertices), 1.3);
    CHECK(std::abs(bending->energy(c.view()) - energy) < 6e-4);
  }
}

TEST_CASE("area and edges of a fine sphere have the moduli of a membrane") {
  std::vector<Real> missing;
  for (const Index vertices : {42, 162, 642}) {
    Configuration<3> c = resting(icosphere(vertices));
    const Real area = c.topology.surfaces->kinds[0].total_rest_area(), stretch = 1e-3;
    missing.push_back(1 - std::pow(pi, 1.5) / std::pow(area, 1.5));
    const VectorXd x = c.positions() * (1 + stretch);
    const Real unit = area * square(2 * stretch) / 2;  // energy per unit of a modulus
    CHECK(alone<3>(FaceArea{{}, 3})->energy(c.view(x.data())) / unit == Approx(3).epsilon(2e-3));
    CHECK(alone<3>(EdgeLength{{}, 4})->energy(c.view(x.data())) / unit == Approx(std::sqrt(3.0) / 2 * 4).epsilon(0.02));
  }
  // The shape parameter converges as 1/Nv.
  for (int k = 1; k < 3; ++k) CHECK(missing[k - 1] / missing[k] == Approx(4).epsilon(0.05));
}

/// The largest ω² of a term, and its bound 4/dt² from the limit of the step.
std::pair<Real, Real> fastest_mode_and_limit(Configuration<3>& c, const ForceField<3>& field) {
  DenseSink<3> sink(c.topology.points());
  field.hessian(c.view(), sink);
  const Real stiffest =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(sink.matrix, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
  return {stiffest / c.topology.mass(0), 4 / square(field.critical_step(c.topology).one_contact())};
}

TEST_CASE("fastest modes of icospheres") {
  for (const Index vertices : {12, 42, 162}) {
    const Real size = 1.4;
    Configuration<3> c = resting(icosphere(vertices), size);
    for (const auto& [name, field] : each_term()) {
      INFO(name << ", " << vertices << " vertices");
      const auto [fastest, limit] = fastest_mode_and_limit(c, *field);
      CHECK(fastest < 1.001 * limit);
      CHECK(fastest > 0.25 * limit);
    }
  }
}

TEST_CASE("fastest modes of uneven surfaces") {
  // Two tips with twelve edges each, and a long icosphere.
  TriangleMesh tips, drawn = icosphere(42);
  for (int k = 0; k < 12; ++k) tips.vertices.emplace_back(std::cos(pi * k / 6), std::sin(pi * k / 6), 0);
  tips.vertices.emplace_back(0, 0, 0.7);
  tips.vertices.emplace_back(0, 0, -0.7);
  for (Index k = 0; k < 12; ++k) {
    tips.faces.push_back({k, (k + 1) % 12, 12});
    tips.faces.push_back({(k + 1) % 12, k, 13});
  }
  for (Vec<3>& r : drawn.vertices) r[2] *= 2.5;
  int beyond_icospheres = 0;
  for (const TriangleMesh& mesh : {tips, drawn}) {
    Configuration<3> c = resting(mesh, 1.4);
    for (const auto& [name, field] : each_term()) {
      INFO(name << ", " << mesh.vertices.size() << " vertices");
      const auto [fastest, limit] = fastest_mode_and_limit(c, *field);
      CHECK(fastest < 1.02 * limit);
      CHECK(fastest > 0.2 * limit);
      if (name == "edge" && fastest > 6.1 * 4 / c.topology.mass(0)) ++beyond_icospheres;
    }
  }
  CHECK(beyond_icospheres > 0);
}

TEST_CASE("surfaces as arrays") {
  Surfaces surfaces;
  surfaces.kinds = {relaxed_surface(tetrahedron()), surface_with_shape(icosphere(12), 1.2)};
  Topology t;
  t.dim = 3;
  for (const Index k : {1, 0, 1}) surfaces.add_particle(t, k, 1 + 0.1 * k, 0.1, 2);
  const SurfaceArrays arrays(surfaces);
  CHECK(arrays.kind == std::vector<Index>{1, 0, 1});
  const std::vector<Surface> again = arrays.kinds();
  REQUIRE(again.size() == 2);
  for (int k = 0; k < 2; ++k) {
    const Surface& one = surfaces.kinds[k];
    CHECK(again[k].vertices == one.vertices);
    CHECK(again[k].faces == one.faces);
    CHECK(again[k].hinges == one.hinges);
    CHECK(again[k].volume == one.volume);
    CHECK(again[k].sigma == one.sigma);
    CHECK(again[k].rest_area == one.rest_area);
    CHECK(again[k].rest_length == one.rest_length);
    CHECK(again[k].rest_angle == one.rest_angle);
    CHECK(again[k].around == one.around);
    CHECK(again[k].lowest_face == one.lowest_face);
  }
  SurfaceArrays bad = arrays;
  bad.rest_area[0] = -1;
  CHECK_THROWS_WITH(bad.kinds(), "a rest size of a surface is -1");
  bad = arrays;
  bad.faces.pop_back();
  CHECK_THROWS_WITH(bad.kinds(), Catch::Contains("do not fit"));
  bad = arrays;
  std::swap(bad.faces[0], bad.faces[1]);
  CHECK_THROWS_WITH(bad.kinds(), Catch::Contains("both run from vertex"));
  bad = arrays;
  bad.kind[0] = 2;
  CHECK_THROWS_WITH(bad.kinds(), "there is no surface 2");
}

TEST_CASE("gaps between the vertices of faces, and the inside of a surface") {
  const Surface corner = relaxed_surface(tetrahedron());  // right angles at the origin: the large face is equilateral
  CHECK(widest_gap(corner) == Approx(std::sqrt(2.0 / 3)));
  CHECK(stretch(surface_with_shape(icosphere(12), 1.2)) == Approx(std::cbrt(1.2 / 1.09844)).epsilon(1e-5));
  TriangleMesh obtuse = tetrahedron();
  obtuse.vertices[3] = Vec<3>(0.5, 0.5, 0.1);  // faces over the long edge have an obtuse angle
  Random random(1);
  const Surface flat = relaxed_surface(obtuse);
  Real widest = 0;
  for (int k = 0; k < 200000; ++k) {
    const Face& face = flat.faces[k % 4];
    Real a = random(0, 1), b = random(0, 1);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const Vec<3>&p = flat.vertices[face[0]], &q = flat.vertices[face[1]], &r = flat.vertices[face[2]];
    const Vec<3> place = p + a * (q - p) + b * (r - p);
    widest = std::max(widest, std::min({(place - p).norm(), (place - q).norm(), (place - r).norm()}));
  }
  CHECK(widest_gap(flat) == Approx(widest).epsilon(0.01));

  Configuration<3> c = resting(icosphere(42), 1);
  const auto inside = [&](const Vec<3>& place) {
    return inside_surface(c.x.data(), c.topology, c.topology.surfaces->kinds[0], 0, place);
  };
  CHECK(inside(Vec<3>::Zero()));
  CHECK(inside(0.95 * c.position(7)));
  CHECK_FALSE(inside(1.05 * c.position(7)));
  CHECK_FALSE(inside(Vec<3>(0, 3, 0)));
}

TEST_CASE("rest shapes of surfaces") {
  const TriangleMesh mesh = icosphere(42);
  const Surface round = relaxed_surface(mesh), floppy = surface_with_shape(mesh, 1.1);
  CHECK(round.sigma == Approx(1));
  CHECK(floppy.volume == round.volume);
  CHECK(shape_parameter(floppy.total_rest_area(), floppy.volume) == Approx(1.1));
  for (std::size_t k = 0; k < floppy.hinges.size(); ++k) {
    CHECK(floppy.rest_length[k] / round.rest_length[k] ==
          Approx(std::sqrt(floppy.total_rest_area() / round.total_rest_area())));
    CHECK(round.rest_angle[k] > 0);
  }
  CHECK_THROWS_WITH(surface_with_shape(mesh, 1.02),
                    Catch::StartsWith("the shape parameter is 1.02, but the surface at rest has 1.02405") &&
                        Catch::EndsWith("; choose that or more"));
}

TEST_CASE("measures of a surface near shapes without meaning") {
  Configuration<3> c = resting(tetrahedron());
  const auto look = [&] { return look_at_surface(c.x.data(), c.topology, *c.topology.surfaces, 0); };
  CHECK(look().volume == Approx(1.0 / 6));
  CHECK(look().least_area == Approx(1));
  CHECK(look().least_cosine == Approx(-1 / std::sqrt(3.0)));
  c.x[11] = 1e-8;  // the tip nearly in the base
  CHECK(look().volume == Approx(1e-8 / 6));
  CHECK(look().least_area == Approx(1e-8));
  CHECK(look().smallest_face == 1);
  CHECK(look().least_cosine == Approx(-1));
  c.x[11] = -1;
  CHECK(look().volume == Approx(-1.0 / 6));

  c = resting(icosphere(12));
  CHECK(look().least_cosine == Approx(std::sqrt(5.0) / 3));
  for (int k = 0; k < 3; ++k) c.x[k] *= -0.2;  // a dent at vertex 0
  const SurfaceShape dent = look();
  const Hinge& fold = c.topology.surfaces->kinds[0].hinges[dent.sharpest_hinge];
  CHECK(dent.least_cosine < -0.5);
  CHECK((fold.a == 0 || fold.c == 0 || fold.d == 0));
}

}  // namespace pliant::test::surface_test
