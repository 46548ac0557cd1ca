// Smooth closed surfaces in space: derivatives, conservation, one contact per place, no jumps, complete lists.
#include <catch2/catch.hpp>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include <pliant/model/fused_surfaces.h>
#include <pliant/model/simplex_friction.h>

#include "support/derivatives.h"
#include "support/smooth_surfaces.h"

namespace pliant::test::smooth_surfaces_test {

namespace {

constexpr Real stiffness = 3;  ///< ε
using VertexFriction = SimplexFriction<Elements::vertex_faces>;
using EdgeFriction3 = SimplexFriction<Elements::edge_pairs>;

TriangleMesh tetrahedron(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d) {
  TriangleMesh mesh{{a, b, c, d}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
  if (volume(mesh) < 0) std::swap(mesh.vertices[0], mesh.vertices[1]);
  return mesh;
}

/// A surface with a long tip, the vertex 0, that points down.
TriangleMesh needle(const Vec<3>& tip) {
  return tetrahedron(tip, tip + Vec<3>(0.3, 0, 3), tip + Vec<3>(-0.2, 0.3, 3), tip + Vec<3>(-0.2, -0.3, 3));
}

/// A flat top at z = 0 of n × n random vertices, 1 apart on average, over a deep apex. The middle is at the origin.
TriangleMesh flat_top(Random& random, Index n) {
  TriangleMesh mesh;
  const Real half = (n - 1) / 2.0;
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) {
      const bool inside = i > 0 && j > 0 && i < n - 1 && j < n - 1;
      mesh.vertices.push_back(
          {i - half + (inside ? random(-0.3, 0.3) : 0), j - half + (inside ? random(-0.3, 0.3) : 0), 0});
    }
  const auto at = [&](Index i, Index j) { return i * n + j; };
  for (Index i = 0; i + 1 < n; ++i)
    for (Index j = 0; j + 1 < n; ++j) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  std::vector<Index> rim;
  for (Index k = 0; k + 1 < n; ++k) rim.push_back(at(k, 0));
  for (Index k = 0; k + 1 < n; ++k) rim.push_back(at(n - 1, k));
  for (Index k = n - 1; k > 0; --k) rim.push_back(at(k, n - 1));
  for (Index k = n - 1; k > 0; --k) rim.push_back(at(0, k));
  const auto apex = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.push_back({0, 0, -10});
  for (std::size_t k = 0; k < rim.size(); ++k) mesh.faces.push_back({rim[(k + 1) % rim.size()], rim[k], apex});
  return mesh;
}

Real vertex_energy(Configuration<3>& c) { return alone<3>(VertexFaceContact{stiffness})->energy(c.view()); }
Real edge_energy(Configuration<3>& c, Real s0) { return alone<3>(EdgePairContact{stiffness, s0})->energy(c.view()); }

/// All contacts.
std::unique_ptr<ForceField<3>> contacts(Real s0) {
  return alone<3>(VertexFaceContact{stiffness}, EdgePairContact{stiffness, s0});
}

/// The kernels of contact and friction.
std::unique_ptr<ForceField<3>> kernels(Real mu, Friction kind, Real s0) {
  return alone<3>(Fused<SimplexKernel<Elements::vertex_faces>, VertexFaceContact, VertexFriction>(
                      VertexFaceContact{stiffness}, VertexFriction{mu, kind}),
                  Fused<SimplexKernel<Elements::edge_pairs>, EdgePairContact, EdgeFriction3>(
                      EdgePairContact{stiffness, s0}, EdgeFriction3{mu, kind, s0}));
}
/// Their terms, one element after the other.
std::unique_ptr<ForceField<3>> terms(Real mu, Friction kind, Real s0) {
  return alone<3>(VertexFaceContact{stiffness}, EdgePairContact{stiffness, s0}, VertexFriction{mu, kind},
                  EdgeFriction3{mu, kind, s0});
}

/// Sum of the forces of the contacts on particle 0 as the output shows them, and their number.
std::pair<Vec<3>, int> shown(Configuration<3>& c, Real s0) {
  Vec<3> sum = Vec<3>::Zero();
  int count = 0;
  contacts(s0)->for_each_contact(c.view(), [&](const Contact<3>& one) {
    sum += one.first == 0 ? one.force : Vec<3>(-one.force);
    ++count;
    CHECK(one.reach == c.topology.diameter[0]);
    CHECK(one.force.dot(one.normal) > 0);
  });
  return {sum, count};
}

/// Follows a path of two particles that `move` leads from t = 0 to 1 until they pierce each other, and looks for the
/// largest jump of the forces in each part of it.
void check_path(const ForceField<3>& field, Configuration<3>& c, Real largest, const std::function<void(Real)>& move) {
  const auto forces = [&](Real t) {
    move(t);
    return forces_of(field, c);
  };
  constexpr int parts = 100;
  int acting = 0;
  for (int n = 0; n < parts; ++n) {
    Real from = Real(n) / parts, to = Real(n + 1) / parts;
    VectorXd first = forces(from), last = forces(to);
    if (pierced(c)) break;
    acting += first.norm() > 0;
    while (to - from > 1e-10) {
      const Real middle = (from + to) / 2;
      const VectorXd between = forces(middle);
      if ((between - first).norm() > (last - between).norm())
        to = middle, last = between;
      else
        from = middle, first = between;
    }
    INFO("at " << from);
    CHECK((last - first).norm() < largest);
  }
  CHECK(acting > 3);
}

/// All pairs of parts of different particles within the contact distance + beyond, as the lists name them.
struct AllPairs {
  std::set<Pair> vertex_faces, edge_pairs;
  AllPairs(const Topology& t, const Real* x, Real beyond) {
    const auto at = [&](Index i) { return Vec<3>(point<3>(x, i)); };
    std::vector<Eigen::AlignedBox<Real, 3>> boxes(static_cast<std::size_t>(t.particles()));
    for (Index i = 0; i < t.points(); ++i) boxes[t.particle[i]].extend(at(i));
    for (Index m = 0; m < t.particles(); ++m)
      for (Index n = 0; n < t.particles(); ++n) {
        const Real reach = contact_distance(t, m, n) + beyond;
        if (m == n || boxes[m].exteriorDistance(boxes[n]) > reach) continue;
        const Surface &own = t.surfaces->of(t, m), &other = t.surfaces->of(t, n);
        for (std::size_t f = 0; f < other.faces.size(); ++f) {
          const auto face = static_cast<Index>(first_face(t, n) + static_cast<Index>(f));
          const auto [a, b, c] = points_of_face(t, face);
          for (Index i = t.offset[m]; i < t.offset[m + 1]; ++i) {
            const FourPoints r{at(i), at(a), at(b), at(c)};
            if (VertexOnFace(r).d2() < square(reach)) vertex_faces.insert({i, face});
          }
        }
        for (std::size_t k = 0; m < n && k < own.hinges.size(); ++k)
          for (std::size_t l = 0; l < other.hinges.size(); ++l) {
            const Index first = first_edge(t, m) + static_cast<Index>(k),
                        second = first_edge(t, n) + static_cast<Index>(l);
            const auto [a, b] = points_of_edge(t, first);
            const auto [c, d] = points_of_edge(t, second);
            const FourPoints r{at(a), at(b), at(c), at(d)};
            if (EdgeOnEdge(r).d2() < square(reach)) edge_pairs.insert({first, second});
          }
      }
  }
};

Pair in_numbers(const Pair& p) { return p.first < p.second ? p : Pair{p.second, p.first}; }

/// Surfaces in two chunks, turned at random, near each other, with velocities.
Configuration<3> crowd_of_surfaces(Random& random, Real edge_width) {
  std::vector<TriangleMesh> meshes;
  for (int k = 0; k < 192; ++k)
    meshes.push_back(moved(icosphere(42), random_turn(random), 1.02 * Vec<3>(k / 36, k / 6 % 6, k % 6)));
  Configuration<3> c = surfaces_in_shape(meshes, edge_width);
  c.random_velocities(random);
  return c;
}

}  // namespace

TEST_CASE("derivatives of the contacts of smooth surfaces") {
  check_smooth<3>(
      *alone<3>(VertexFaceContact{stiffness}), [](Random& random) { return pressed_surfaces(random); }, 1e-5);
  check_smooth<3>(
      *alone<3>(EdgePairContact{stiffness, 0.3}), [](Random& random) { return pressed_surfaces(random); }, 1e-5);
}

TEST_CASE("without a given s0 the mollifier follows from the width of the edges") {
  Random random(1);
  Configuration<3> c = pressed_surfaces(random);
  const Real width = c.topology.diameter[0] / c.topology.l0[0], other = c.topology.diameter[12] / c.topology.l0[1];
  REQUIRE(width != other);
  CHECK(edge_energy(c, 0) == Approx(edge_energy(c, 4 * width * other)).epsilon(1e-14));
  CHECK(edge_energy(c, 0) != edge_energy(c, 0.3));
}

TEST_CASE("contacts of smooth surfaces have no net force and no net torque") {
  for (int k = 0; k < 20; ++k) {
    Random random(k);
    Configuration<3> c = pressed_surfaces(random, 0.2, k % 2 == 0 ? 12 : 42);
    for (const auto& field : {alone<3>(VertexFaceContact{stiffness}), alone<3>(EdgePairContact{stiffness, 0.3})})
      check_balance(c, forces_of(*field, c));
  }
}

TEST_CASE("a vertex over a flat part of a surface feels its distance, whatever the triangles") {
  for (int k = 0; k < 50; ++k) {
    Random random(k);
    const Real h = random(0.1, 0.9), delta = random(1, 1.8);
    Configuration<3> c =
        surfaces_in_shape({flat_top(random, 7), needle({random(-0.8, 0.8), random(-0.8, 0.8), h * delta})}, delta);
    const Real expected = stiffness / 2 * square(1 - h);
    CHECK(vertex_energy(c) == Approx(expected).epsilon(1e-12));
    CHECK(std::abs(edge_energy(c, 0.04)) < 1e-12);
    const auto [force, count] = shown(c, 0.04);
    CHECK(count == 1);
    CHECK((force - Vec<3>(0, 0, -stiffness / delta * (1 - h))).norm() < 1e-11);
    // The force lifts the tip, along the normal.
    const VectorXd f = forces_of(*contacts(0.04), c);
    const Index tip = c.topology.offset[1] + (c.position(c.topology.offset[1])[2] < 2 ? 0 : 1);
    CHECK((point<3>(f.data(), tip) - Vec<3>(0, 0, stiffness / delta * (1 - h))).norm() < 1e-11);
  }
}

TEST_CASE("each contact of convex surfaces counts once") {
  std::array<int, 5> seen{};  // by the points that carry it
  for (int k = 0; k < 600; ++k) {
    Random random(k);
    constexpr Real delta = 1e-3, s0 = 1e-4;
    const auto corner = [&] { return Vec<3>(random(-1, 1), random(-1, 1), random(-1, 1)); };
    std::vector<TriangleMesh> both;
    for (int m = 0; m < 2; ++m) {
      TriangleMesh mesh = tetrahedron(corner(), corner(), corner(), corner());
      while (volume(mesh) < 0.2) mesh = tetrahedron(corner(), corner(), corner(), corner());
      both.push_back(mesh);
    }
    // Vertex against edge or vertex, which do not meet by chance.
    if (k % 3 > 0) {
      const Vec<3> a = both[0].vertices[0], b = both[0].vertices[1];
      const Vec<3> place = k % 3 == 1 ? Vec<3>((a + b) / 2) : a;
      const Vec<3> centre = (both[0].vertices[0] + both[0].vertices[1] + both[0].vertices[2] + both[0].vertices[3]) / 4;
      both[1] =
          moved(needle(Vec<3>::Zero()),
                Eigen::Quaternion<Real>::FromTwoVectors(Vec<3>(0, 0, 1), place - centre).toRotationMatrix(), place);
    }
    // The second one comes along a line until half the range is left.
    const Vec<3> away =
        k % 3 == 0 ? random.unit<3>() : Vec<3>((both[1].vertices[2] - both[1].vertices[0]).normalized());
    NearestPlaces places{};
    const auto distance = [&](Real by) {
      Configuration<3> c = surfaces_in_shape({both[0], moved(both[1], Mat<3>::Identity(), by * away)}, delta);
      if (pierced(c)) return Real(-1);
      Real least = 1e9;
      const auto take = [&](const NearestPlaces& p) {
        if (p.d2 < square(least)) least = std::sqrt(p.d2), places = p;
      };
      const Topology& t = c.topology;
      for (Index m = 0; m < 2; ++m)
        for (Index f = 0; f < 4; ++f)
          for (Index i = t.offset[1 - m]; i < t.offset[2 - m]; ++i) {
            const auto [p, q, r] = points_of_face(t, first_face(t, m) + f);
            const FourPoints four{c.position(i), c.position(p), c.position(q), c.position(r)};
            const VertexOnFace on(four);
            take(on.inside ? *on.inside : on.on_edge(on.nearest_edge()));
          }
      for (Index e = 0; e < 6; ++e)
        for (Index g = 0; g < 6; ++g) {
          const auto [p, q] = points_of_edge(t, e);
          const auto [r, s] = points_of_edge(t, first_edge(t, 1) + g);
          const FourPoints four{c.position(p), c.position(q), c.position(r), c.position(s)};
          const EdgeOnEdge on(four);
          if (on.inside) take(*on.inside);
        }
      return least;
    };
    Real near = k % 3 == 0 ? 0 : -0.2, far = k % 3 == 0 ? 6 : 0.1;
    while (far - near > 1e-9) {
      const Real middle = (near + far) / 2;
      (distance(middle) < delta / 2 ? near : far) = middle;
    }
    const Real d = distance(far);
    if (d < 0.4 * delta || d > 0.6 * delta) continue;  // the particles passed through each other
    Configuration<3> c = surfaces_in_shape({both[0], moved(both[1], Mat<3>::Identity(), far * away)}, delta);
    INFO("pair " << k);
    const Real expected = stiffness / 2 * square(1 - d / delta), total = vertex_energy(c) + edge_energy(c, s0);
    CHECK(total == Approx(expected).epsilon(1e-9));
    CHECK(shown(c, s0).first.norm() == Approx(stiffness / delta * (1 - d / delta)).epsilon(1e-9));
    ++seen[static_cast<std::size_t>(
        std::count_if(places.weight.begin(), places.weight.end(), [](Real w) { return w != 0; }))];
  }
  CHECK(seen[4] > 50);
  CHECK(seen[3] + seen[2] > 50);
}

TEST_CASE("forces of smooth surfaces do not jump along paths without crossing") {
  constexpr Real delta = 0.15, s0 = 0.3;
  const auto field = contacts(s0);
  for (int k = 0; k < 10; ++k) {
    Random random(k);
    Configuration<3> c = pressed_surfaces(random, delta);
    const std::vector<Real> start = c.x;
    std::vector<Real> speed(c.x.size());
    for (Real& a : speed) a = random(-0.1, 0.1);
    const Vec<3> slide = 0.6 * random.unit<3>();
    for (Index i = 12; i < 24; ++i) point<3>(speed.data(), i) += slide;
    INFO("path " << k);
    check_path(*field, c, 1e-5 * stiffness / delta, [&](Real t) {
      for (std::size_t a = 0; a < c.x.size(); ++a) c.x[a] = start[a] + t * speed[a];
    });
  }
}

TEST_CASE("forces of two edges that turn past each other do not jump where they are parallel") {
  constexpr Real delta = 0.15, s0 = 0.04;
  const auto ridge = [](Real turn, const Vec<3>& at, Real up) {
    const Vec<3> u(std::cos(turn), std::sin(turn), 0), v(-std::sin(turn), std::cos(turn), 0), h(0, 0, up);
    return tetrahedron(at + u, at - u, at + 0.5 * v + h, at - 0.5 * v + h);
  };
  Configuration<3> c = surfaces_in_shape({ridge(0, {0, 0, 0}, -1), ridge(-0.05, {0.1, 0.02, 0.05}, 1)}, delta);
  check_path(*contacts(s0), c, 1e-5 * stiffness / delta, [&](Real t) {
    const TriangleMesh turned = ridge(-0.05 + 0.1 * t, {0.1, 0.02, 0.05}, 1);
    for (Index i = 0; i < 4; ++i) point<3>(c.x.data(), 4 + i) = turned.vertices[i];
  });
}

TEST_CASE("surfaces that lie flat on each other do not vibrate faster than the terms state") {
  Real fastest = 0;
  for (int k = 0; k < 10; ++k) {
    Random random(k);
    constexpr Real delta = 0.1;
    const Real h = random(0.3, 0.9) * delta;
    const Mat<3> over = Eigen::AngleAxis<Real>(random(0, 6), Vec<3>(0, 0, 1)).toRotationMatrix() *
                        Eigen::AngleAxis<Real>(pi, Vec<3>(1, 0, 0)).toRotationMatrix();
    Configuration<3> c = surfaces_in_shape(
        {flat_top(random, 7), moved(flat_top(random, 7), over, Vec<3>(random(-0.5, 0.5), random(-0.5, 0.5), h))},
        delta);
    for (Index m = 0; m < 2; ++m) c.topology.point_mass[m] = 1;
    const auto field = contacts(0.04);
    DenseSink<3> hessian(c.topology.points());
    field->hessian(c.view(), hessian);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(hessian.matrix, Eigen::EigenvaluesOnly);
    const Real bound = field->critical_step(c.topology, false).crowded.translation.stiffness;
    CHECK(bound == Approx(26 * stiffness / square(delta)));
    fastest = std::max(fastest, modes.eigenvalues().maxCoeff() / bound);
  }
  CHECK(fastest < 1);
  CHECK(fastest > 0.5);
}

TEST_CASE("friction of smooth surfaces opposes the relative motion of the nearest places") {
  for (const Friction kind : {Friction::whole, Friction::tangential})
    for (int k = 0; k < 20; ++k) {
      Random random(k);
      Configuration<3> c = pressed_surfaces(random);
      const auto field = alone<3>(VertexFriction{0.7, kind}, EdgeFriction3{0.7, kind, 0.3});
      const VectorXd f = forces_of(*field, c);
      Vec<3> sum = Vec<3>::Zero();
      Real power = 0;
      for (Index i = 0; i < c.topology.points(); ++i) {
        sum += point<3>(f.data(), i);
        power -= point<3>(f.data(), i).dot(point<3>(c.v.data(), i));
      }
      REQUIRE(f.norm() > 0);
      CHECK(sum.norm() < 1e-12 * f.norm());
      CHECK(power == Approx(field->power(c.view())).epsilon(1e-12));
      // Both move as one body without friction.
      for (Index i = 0; i < c.topology.points(); ++i) point<3>(c.v.data(), i) = Vec<3>(1, 2, 3);
      CHECK(forces_of(*field, c).norm() < 1e-12 * f.norm());
    }
}

TEST_CASE("derivatives of the friction of smooth surfaces") {
  for (const Friction kind : {Friction::whole, Friction::tangential})
    for (int k = 0; k < 20; ++k) {
      Random random(k);
      Configuration<3> c = pressed_surfaces(random);
      const VertexFriction vertices{0.7, kind};
      const EdgeFriction3 edges{0.7, kind, 0.3};
      const auto field = alone<3>(vertices, edges);
      DenseSink<3> by_x(c.topology.points()), by_v(c.topology.points());
      const StateView<3> s = c.view();
      for (Index e = 0; e < s.neighbours.vertex_faces.size(); ++e)
        vertices.add_dforce_dx(s, e, by_x), vertices.add_dforce_dv(s, e, by_v);
      for (Index e = 0; e < s.neighbours.edge_pairs.size(); ++e)
        edges.add_dforce_dx(s, e, by_x), edges.add_dforce_dv(s, e, by_v);
      const auto change = [&](std::vector<Real> Configuration<3>::*which, const VectorXd& p) {
        constexpr Real h = 1e-7;
        Random again(k), twice(k);
        Configuration<3> plus = pressed_surfaces(again), minus = pressed_surfaces(twice);
        for (Eigen::Index a = 0; a < p.size(); ++a) {
          (plus.*which)[static_cast<std::size_t>(a)] += h * p[a];
          (minus.*which)[static_cast<std::size_t>(a)] -= h * p[a];
        }
        return VectorXd((forces_of(*field, plus) - forces_of(*field, minus)) / (2 * h));
      };
      const VectorXd p = random_direction(random, static_cast<Eigen::Index>(c.x.size()));
      const VectorXd in_x = by_x.matrix * p, in_v = by_v.matrix * p;
      CHECK((change(&Configuration<3>::x, p) - in_x).norm() < 1e-5 * in_x.norm());
      CHECK((change(&Configuration<3>::v, p) - in_v).norm() < 1e-6 * in_v.norm());
    }
}

TEST_CASE("lists of faces and edges hold every contact until a point has moved by half the skin") {
  constexpr Real skin = 0.1;
  for (int seed = 0; seed < 5; ++seed) {
    Random random(seed);
    std::vector<TriangleMesh> meshes;
    for (int k = 0; k < 12; ++k)
      meshes.push_back(moved(icosphere(seed % 2 == 0 ? 12 : 42), random(0.5, 1.3) * random_turn(random),
                             Vec<3>(random(-1, 1), random(-1, 1), random(-1, 1))));
    Configuration<3> c = surfaces_in_shape(meshes, 0.1);
    for (Index i = 0; i < c.topology.points(); ++i) c.topology.diameter[i] = 0.04 * (1 + c.topology.particle[i] % 3);
    Neighbours<3> lists({.vertex_faces = true, .edge_pairs = true}, skin);
    lists.ensure(c.topology, c.walls, c.x.data());
    // Exactly the pairs within the range, each once.
    const AllPairs listed(c.topology, c.x.data(), skin);
    const auto same = [&](const AllPairs& all) {
      std::set<Pair> faces(lists.vertex_faces.begin(), lists.vertex_faces.end()), edges;
      for (const Pair& p : lists.edge_pairs) edges.insert(in_numbers(p));
      CHECK(faces == all.vertex_faces);
      CHECK(edges == all.edge_pairs);
      CHECK(static_cast<Index>(faces.size()) == lists.vertex_faces.size());
      CHECK(static_cast<Index>(edges.size()) == lists.edge_pairs.size());
    };
    same(listed);
    std::vector<Real> y = c.x;
    for (Index i = 0; i < c.topology.points(); ++i) point<3>(y.data(), i) += 0.4999 * skin * random.unit<3>();
    lists.ensure(c.topology, c.walls, y.data());
    REQUIRE(lists.rebuilds() == 1);
    const AllPairs touching(c.topology, y.data(), 0);
    CHECK(touching.vertex_faces.size() > 20);
    CHECK(touching.edge_pairs.size() > 20);
    CHECK(std::ranges::includes(listed.vertex_faces, touching.vertex_faces));
    CHECK(std::ranges::includes(listed.edge_pairs, touching.edge_pairs));

    // A particle that is moved is listed again; then another one, next to its new place, and it again.
    std::vector<Real> x = c.x;
    for (const auto& [m, by] : {std::pair<Index, Real>(3, 1), {5, 1}, {3, -0.3}}) {
      for (Index i = c.topology.offset[m]; i < c.topology.offset[m + 1]; ++i)
        point<3>(x.data(), i) += by * Vec<3>(1, 0.5, 0.2);
      lists.relist(c.topology, c.walls, x.data(), m);
      same(AllPairs(c.topology, x.data(), skin));
    }
    // An inactive particle has no contacts.
    c.topology.deactivate(4);
    lists.rebuild(c.topology, c.walls, c.x.data());
    for (const PairList* list : {&lists.vertex_faces, &lists.edge_pairs})
      for (const Pair& pair : *list) {
        const Pair points = list == &lists.edge_pairs ? ElementKind<Elements::edge_pairs>::points_of_both(pair)
                                                      : ElementKind<Elements::vertex_faces>::points_of_both(pair);
        CHECK((c.topology.particle[points.first] != 4 && c.topology.particle[points.second] != 4));
      }
  }
}

TEST_CASE("kernels of smooth surfaces add the forces of their terms") {
  for (const auto& [mu, kind] : {std::pair(0.0, Friction::whole), {0.7, Friction::whole}, {0.7, Friction::tangential}})
    for (int k = 0; k < 60; ++k) {
      Random random(k);
      Configuration<3> c = pressed_surfaces(random, 0.1 + 0.05 * (k % 3), k % 2 == 0 ? 12 : 42);
      const Real s0 = k % 5 == 0 ? 0 : 0.3;
      const VectorXd by_kernel = forces_of(*kernels(mu, kind, s0), c), by_terms = forces_of(*terms(mu, kind, s0), c);
      REQUIRE(by_terms.norm() > 0);
      CHECK((by_kernel - by_terms).norm() < 1e-11 * by_terms.norm());
    }
}

TEST_CASE("narrowed lists of smooth surfaces change no bit of the forces until points have moved by half the range") {
  Random random(4);
  const Configuration<3> c = crowd_of_surfaces(random, 0.08);
  constexpr Real skin = 0.2, range = 0.03;
  Neighbours<3> lists({.vertex_faces = true, .edge_pairs = true}, skin);
  lists.rebuild(c.topology, c.walls, c.x.data());
  REQUIRE(lists.chunks() == 2);
  std::vector<Real> y = c.x;
  const StateView<3> s{y.data(), c.v.data(), c.topology, lists, c.walls};
  const auto field = kernels(0.7, Friction::whole, 0);
  lists.narrow(c.topology, c.x.data(), range);
  std::size_t near = 0;
  for (const NearSimplices& list : {lists.near_vertex_faces(), lists.near_edge_pairs()})
    for (const auto& part : list) near += part.size();
  CHECK(2 * near < lists.size());
  for (Index i = 0; i < c.topology.points(); ++i) point<3>(y.data(), i) += 0.4999 * range * random.unit<3>();
  VectorXd narrowed(y.size()), all(y.size()), sum(y.size());
  field->forces(s, narrowed.data());
  lists.widen();
  field->forces(s, all.data());
  terms(0.7, Friction::whole, 0)->forces(s, sum.data());
  CHECK(narrowed == all);
  REQUIRE(sum.norm() > 1);
  CHECK((all - sum).norm() < 1e-11 * sum.norm());
}

TEST_CASE("the distance of two surfaces is that of their nearest parts") {
  for (int k = 0; k < 20; ++k) {
    Random random(k);
    const Vec<3> shift(0.3, 0.1, -0.2);
    const Configuration<3> c =
        surfaces_in_shape({moved(icosphere(k % 2 == 0 ? 12 : 42), random_turn(random), -shift),
                           moved(icosphere(42), random_turn(random), random(1, 1.2) * random.unit<3>())},
                          0.1);
    const Topology& t = c.topology;
    std::vector<Real> placed = c.x;
    for (Index i = 0; i < t.offset[1]; ++i) point<3>(placed.data(), i) += shift;
    // The smallest range in which there are pairs.
    Real none = -0.1, some = 2;
    while (some - none > 1e-9) {
      const Real middle = (none + some) / 2;
      const AllPairs pairs(t, placed.data(), middle);
      (pairs.vertex_faces.empty() && pairs.edge_pairs.empty() ? none : some) = middle;
    }
    const Real distance = surface_distance(t.surfaces->of(t, 0), c.x.data(), shift, t.surfaces->of(t, 1),
                                           c.x.data() + 3 * static_cast<std::size_t>(t.offset[1]));
    CHECK(distance == Approx(some + 0.1).margin(1e-8));
  }
}

TEST_CASE("forces of smooth surfaces in chunks are those of all pairs, each once") {
  Random random(3);
  const Configuration<3> c = crowd_of_surfaces(random, 0.12);
  Neighbours<3> lists({.vertex_faces = true, .edge_pairs = true}, 0.05);
  lists.rebuild(c.topology, c.walls, c.x.data());
  REQUIRE(lists.chunks() == 2);
  REQUIRE(lists.vertex_faces.across(0).size() > 50);
  REQUIRE(lists.edge_pairs.across(0).size() > 50);
  const StateView<3> s{c.x.data(), c.v.data(), c.topology, lists, c.walls};
  const auto field = alone<3>(VertexFaceContact{stiffness}, EdgePairContact{stiffness, 0.3}, VertexFriction{0.7},
                              EdgeFriction3{0.7, Friction::whole, 0.3});
  VectorXd forces(c.x.size());
  const Real energy = field->energy(s, nullptr), power = field->power(s);
  field->forces(s, forces.data());

  Neighbours<3> all({.vertex_faces = true, .edge_pairs = true}, 0.05);
  const AllPairs pairs(c.topology, c.x.data(), 0);
  for (const auto& [list, from] :
       {std::pair(&all.vertex_faces, &pairs.vertex_faces), {&all.edge_pairs, &pairs.edge_pairs}}) {
    list->pairs.assign(from->begin(), from->end());
    list->reach.assign(from->size(), 0.12);
  }
  const StateView<3> whole{c.x.data(), c.v.data(), c.topology, all, c.walls};
  VectorXd sum = VectorXd::Zero(static_cast<Eigen::Index>(c.x.size()));
  Real energies = 0, powers = 0;
  Scatter<3, -1> gradient{sum.data()};
  Scatter<3, 1> force{sum.data()};
  const VertexFaceContact faces{stiffness};
  const EdgePairContact edges{stiffness, 0.3};
  for (Index e = 0; e < all.vertex_faces.size(); ++e) {
    faces.add_gradient(whole, e, gradient);
    VertexFriction{0.7}.add_force(whole, e, force);
    energies += faces.energy(whole, e);
    powers += VertexFriction{0.7}.power(whole, e);
  }
  for (Index e = 0; e < all.edge_pairs.size(); ++e) {
    edges.add_gradient(whole, e, gradient);
    EdgeFriction3{0.7, Friction::whole, 0.3}.add_force(whole, e, force);
    energies += edges.energy(whole, e);
    powers += EdgeFriction3{0.7, Friction::whole, 0.3}.power(whole, e);
  }
  CHECK(sum.norm() > 1);
  CHECK((forces - sum).norm() < 1e-12 * sum.norm());
  CHECK(energy == Approx(energies).epsilon(1e-12));
  CHECK(power == Approx(powers).epsilon(1e-12));
}

}  // namespace pliant::test::smooth_surfaces_test
