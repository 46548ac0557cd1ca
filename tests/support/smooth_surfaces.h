// Smooth closed surfaces that touch.
#pragma once

#include <catch2/catch.hpp>

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include <pliant/model/simplex_contact.h>
#include <pliant/model/surface_crossing.h>

#include "configurations.h"

namespace pliant::test {

inline TriangleMesh moved(TriangleMesh mesh, const Mat<3>& turn, const Vec<3>& by) {
  for (Vec<3>& r : mesh.vertices) r = turn * r + by;
  return mesh;
}

inline Mat<3> random_turn(Random& random) {
  return Eigen::AngleAxis<Real>(random(0, 3), random.unit<3>()).toRotationMatrix();
}

/// Particles at rest in the shapes of these meshes.
inline Configuration<3> surfaces_in_shape(const std::vector<TriangleMesh>& meshes, Real delta) {
  const auto surfaces = std::make_shared<Surfaces>();
  Configuration<3> c;
  for (const TriangleMesh& mesh : meshes) {
    surfaces->kinds.push_back(relaxed_surface(mesh));
    surfaces->add_particle(c.topology, static_cast<Index>(surfaces->kinds.size()) - 1, surfaces->kinds.back().volume,
                           delta, 1 + static_cast<Real>(surfaces->kinds.size()));
    for (const Vec<3>& r : mesh.vertices) c.x.insert(c.x.end(), r.begin(), r.end());
  }
  c.v.resize(c.x.size());
  c.topology.surfaces = surfaces;
  return c;
}

inline bool pierced(Configuration<3>& c) { return look_at_surfaces(c.view()).piercing.has_value(); }

/// Two icospheres at a distance from `nearest` to 1.1, whose vertices are displaced by at most `most`.
inline Configuration<3> two_distorted(Random& random, Index vertices, Real most, Real nearest, Real delta) {
  std::vector<TriangleMesh> both;
  for (const int k : {0, 1}) {
    TriangleMesh mesh = moved(icosphere(vertices), random_turn(random), Vec<3>::Zero());
    for (Vec<3>& r : mesh.vertices) r += random(0, most) * random.unit<3>();
    both.push_back(moved(mesh, Mat<3>::Identity(), k * random(nearest, 1.1) * random.unit<3>()));
  }
  return surfaces_in_shape(both, delta);
}

/// Two distorted icospheres that press each other and do not pierce.
inline Configuration<3> pressed_surfaces(Random& random, Real delta = 0.2, Index vertices = 12) {
  for (;;) {
    Configuration<3> c = two_distorted(random, vertices, 0.05, 0.95, delta);
    if (pierced(c) || alone<3>(VertexFaceContact{1})->energy(c.view()) == 0 ||
        alone<3>(EdgePairContact{1, 0.3})->energy(c.view()) == 0)
      continue;
    c.random_velocities(random);
    return c;
  }
}

inline VectorXd forces_of(const ForceField<3>& field, Configuration<3>& c) {
  VectorXd f(c.x.size());
  field.forces(c.view(), f.data());
  return f;
}

/// That forces on all points have no sum and no torque.
inline void check_balance(const Configuration<3>& c, const VectorXd& f) {
  Vec<3> sum = Vec<3>::Zero(), torque = Vec<3>::Zero();
  for (Index i = 0; i < c.topology.points(); ++i) {
    sum += point<3>(f.data(), i);
    torque += c.position(i).cross(Vec<3>(point<3>(f.data(), i)));
  }
  CHECK(sum.norm() < 1e-11 * f.norm());
  CHECK(torque.norm() < 1e-11 * f.norm());
}

}  // namespace pliant::test
