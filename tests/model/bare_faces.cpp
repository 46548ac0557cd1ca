// Rough closed surfaces in space whose faces are stretched: vertices touch faces without width.
#include <catch2/catch.hpp>

#include <algorithm>
#include <vector>

#include <pliant/model/fused_surfaces.h>
#include <pliant/model/fused_terms.h>
#include <pliant/model/pair_contact.h>

#include "support/derivatives.h"
#include "support/smooth_surfaces.h"

namespace pliant::test::bare_faces_test {

namespace {

constexpr Real stiffness = 3;  ///< ε of two vertices
const VertexFaceContact bare{stiffness / 4, Edges::bare};
const PairContact<3> vertices{stiffness, "rough"};

/// Two icospheres of 12 vertices with faces of random size, which touch in bare faces and do not pierce.
Configuration<3> touching(Random& random) {
  for (;;) {
    Configuration<3> c = two_distorted(random, 12, 0.1, 0.9, 0.3);
    for (Index i = c.topology.offset[1]; i < c.topology.points(); ++i) c.topology.diameter[i] = 0.4;
    c = std::move(c).with_bare_edges();
    const Real energy = alone<3>(bare)->energy(c.view());
    if (pierced(c) || energy < 1e-3 || energy > 0.2) continue;
    c.random_velocities(random);
    return c;
  }
}

/// Two tetrahedra with vertical axes: the tip of the upper one is at this height above the middle of the upper face of
/// the lower one, whose edges have this length.
Configuration<3> tip_over_face(Real length, Real height) {
  const auto triangle = [](Real side, Real z) {
    const Real r = side / std::sqrt(3.0);
    return std::array{Vec<3>(r, 0, z), Vec<3>(-r / 2, side / 2, z), Vec<3>(-r / 2, -side / 2, z)};
  };
  const auto [a, b, c] = triangle(length, 0);
  const auto [d, e, f] = triangle(6, height + 5);
  const std::vector<Face> faces{{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}};
  return surfaces_in_shape({{{a, b, c, Vec<3>(0, 0, -5)}, faces}, {{d, e, f, Vec<3>(0, 0, height)}, faces}}, 1)
      .with_bare_edges();
}

}  // namespace

TEST_CASE("derivatives of the contacts of bare faces") {
  check_smooth<3>(
      *alone<3>(bare), [](Random& random) { return touching(random); }, 1e-5);
}

TEST_CASE("the kernel of bare faces adds the forces of the term, without a net force and a net torque") {
  const SimplexFriction<Elements::vertex_faces> none{0};
  const auto kernel =
      alone<3>(Fused<SimplexKernel<Elements::vertex_faces>, VertexFaceContact, SimplexFriction<Elements::vertex_faces>>(
          bare, none));
  const auto term = alone<3>(bare);
  for (int k = 0; k < 20; ++k) {
    Random random(k);
    Configuration<3> c = touching(random);
    const VectorXd by_kernel = forces_of(*kernel, c), by_term = forces_of(*term, c);
    CHECK((by_kernel - by_term).norm() < 1e-11 * by_term.norm());
    check_balance(c, by_kernel);
  }
}

TEST_CASE("a vertex needs energy to pass through a stretched face, and only this contact acts there") {
  // Three vertices leave a gap if their distances are larger than √3 contact distances.
  Configuration<3> c = tip_over_face(1.9, 1e-3);
  CHECK(alone<3>(vertices)->energy(c.view()) == 0);
  CHECK(alone<3>(vertices, bare)->energy(c.view()) == Approx(stiffness / 8).epsilon(0.01));
  const VectorXd f = forces_of(*alone<3>(vertices, bare), c);
  CHECK(f[3 * 7 + 2] == Approx(stiffness / 4 / 0.5).epsilon(0.01));  // on the tip, upwards
  // Above a face at rest the term does not act before vertices overlap by a fifth of their diameter.
  for (const Real height : {0.7, 0.6, 0.51}) {
    c = tip_over_face(1.05, height);
    CHECK(alone<3>(bare)->energy(c.view()) == 0);
    CHECK(alone<3>(vertices)->energy(c.view()) > 0);
  }
  const VertexFaceContact off{stiffness / 4, Edges::bare, false};
  c = tip_over_face(1.9, 1e-3);
  CHECK(alone<3>(vertices, off)->energy(c.view()) == 0);
}

TEST_CASE("bare faces are listed once with each vertex within their reach, large ones and small ones") {
  // Particles of different sizes, far more stretched than in any run, in two chunks.
  for (const Real skin : {0.02, 0.1})
    for (int seed = 0; seed < 3; ++seed) {
      INFO("skin " << skin << ", seed " << seed);
      Random random(seed);
      std::vector<TriangleMesh> meshes;
      for (int k = 0; k < 200; ++k) {
        TriangleMesh mesh = moved(icosphere(42), random(0.7, 1.3) * random_turn(random), Vec<3>::Zero());
        if (k % 3 == 0)
          for (Vec<3>& r : mesh.vertices) r += random(0, 0.3) * random.unit<3>();
        meshes.push_back(moved(mesh, Mat<3>::Identity(), 0.8 * Vec<3>(k / 36, k / 6 % 6, k % 6)));
      }
      Configuration<3> c = surfaces_in_shape(meshes, 0.3);
      const Topology& t = c.topology;
      for (Index i = 0; i < t.points(); ++i) c.topology.diameter[i] = 0.2 * (1 + 0.3 * (t.particle[i] % 2));
      Neighbours<3> lists({.point_pairs = true, .edges = Edges::bare, .vertex_faces = true}, skin);
      Neighbours<3> search({.edges = Edges::bare, .vertex_faces = true}, skin);  // without the pairs of points
      lists.rebuild(t, c.walls, c.x.data());
      search.rebuild(t, c.walls, c.x.data());
      REQUIRE(lists.chunks() == 2);
      std::vector<Pair> of_points, of_search;
      bool reaches = true;
      for (Index chunk = 0; chunk < 2; ++chunk)
        for (const auto& [found, all] : {std::pair(&lists, &of_points), {&search, &of_search}}) {
          const PairList& list = found->vertex_faces;
          for (const Range& part : {list.inside(chunk), list.across(chunk)})
            for (Index e = part.first; e < part.last; ++e) {
              reaches &= list.reach[e] == t.diameter[list[e].first] / 2;
              all->push_back({list[e].first, 2 * list[e].second + (part.first == list.inside(chunk).first ? 0 : 1)});
            }
        }
      CHECK(reaches);
      std::ranges::sort(of_points);
      std::ranges::sort(of_search);
      CHECK(of_points == of_search);
      int large = 0, small = 0, beyond = 0;
      for (const Pair& pair : lists.vertex_faces) {
        const auto corners = points_of_face(t, pair.second);
        const auto distance = [&](Index i, Index j) { return (c.position(i) - c.position(j)).norm(); };
        Real nearest = 1e9;
        for (const Index i : corners) nearest = std::min(nearest, distance(pair.first, i));
        const Real contact = (t.diameter[pair.first] + t.diameter[corners[0]]) / 2;
        ++(nearest > contact + skin ? beyond : small);
        large += distance(corners[0], corners[1]) > 2 * t.diameter[corners[0]];
      }
      CHECK(small > 100);
      CHECK(beyond > 20);  // the pairs of points do not have them
      CHECK(large > 20);
    }
}

}  // namespace pliant::test::bare_faces_test
