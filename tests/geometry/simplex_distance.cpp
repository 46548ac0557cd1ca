// Nearest places of vertices, edges and faces in space, against a search that halves intervals.
#include <catch2/catch.hpp>

#include <pliant/geometry/simplex_distance.h>

#include "support/random.h"
#include "support/taylor.h"

namespace pliant::test::simplex_distance_test {

namespace {

Vec<3> random_point(Random& random) { return {random(-1, 1), random(-1, 1), random(-1, 1)}; }

/// Smallest value of a convex function on [0, 1].
template <class Function>
Real least(Function&& f) {
  Real a = 0, b = 1;
  for (int k = 0; k < 80; ++k) {
    const Real third = (b - a) / 3;
    (f(a + third) <= f(b - third) ? b : a) = f(a + third) <= f(b - third) ? b - third : a + third;
  }
  return f((a + b) / 2);
}

Real to_segment(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b) {
  return least([&](Real t) { return (p - a - t * (b - a)).norm(); });
}
Real to_face(const FourPoints& r) {
  return least([&](Real t) { return to_segment(r[0], r[1] + t * (r[3] - r[1]), r[2] + t * (r[3] - r[2])); });
}
Real of_segments(const FourPoints& r) {
  return least([&](Real t) { return to_segment(r[0] + t * (r[1] - r[0]), r[2], r[3]); });
}

/// The nearest places of the whole element.
NearestPlaces nearest(const VertexOnFace& on) { return on.inside ? *on.inside : on.on_edge(on.nearest_edge()); }
NearestPlaces nearest(const EdgeOnEdge& on) { return on.inside ? *on.inside : on.of_end(on.nearest_end()); }

/// Whether the weights belong to places of two closed simplices, and give the offset.
void check_places(const FourPoints& r, int first, const NearestPlaces& places) {
  Real of_first = 0, of_second = 0;
  Vec<3> offset = Vec<3>::Zero();
  for (int k = 0; k < 4; ++k) {
    const Real w = places.weight[k];
    (k < first ? of_first : of_second) += w;
    CHECK((k < first ? w : -w) >= 0);
    offset += w * r[k];
  }
  CHECK(of_first == Approx(1).epsilon(1e-13));
  CHECK(of_second == Approx(-1).epsilon(1e-13));
  CHECK((offset - places.offset).norm() < 1e-9);
  CHECK(places.d2 == Approx(places.offset.squaredNorm()).epsilon(1e-14));
}

FourPoints points_of(const VectorXd& x) {
  FourPoints r;
  for (int k = 0; k < 4; ++k) r[k] = x.segment<3>(3 * k);
  return r;
}

/// The distance as a function of the points.
template <class On, int First>
Functional distance_functional() {
  return {[](const VectorXd& x) {
            const FourPoints r = points_of(x);
            return std::sqrt(nearest(On(r)).d2);
          },
          [](const VectorXd& x) {
            const FourPoints r = points_of(x);
            const NearestPlaces places = nearest(On(r));
            VectorXd g(12);
            for (int k = 0; k < 4; ++k) g.segment<3>(3 * k) = places.weight[k] * places.offset / std::sqrt(places.d2);
            return g;
          },
          [](const VectorXd& x) {
            const FourPoints r = points_of(x);
            const PlaceMotion motion(r, First, nearest(On(r)));
            MatrixXd h(12, 12);
            for (int k = 0; k < 4; ++k)
              for (int l = 0; l < 4; ++l) h.block<3, 3>(3 * k, 3 * l) = motion.hessian(k, l);
            return h;
          }};
}

template <class On, int First>
void check_derivatives() {
  const Functional f = distance_functional<On, First>();
  std::array<int, 5> carried{};  // by how many points the nearest places are carried
  for (int k = 0; k < 200; ++k) {
    Random random(k);
    VectorXd x(12);
    for (Real& a : x) a = random(-1, 1);
    const VectorXd p = random_direction(random, 12);
    const auto carriers = [&](const VectorXd& at) {
      const FourPoints r = points_of(at);
      std::array<bool, 4> all;
      for (int l = 0; l < 4; ++l) all[l] = nearest(On(r)).weight[l] != 0;
      return all;
    };
    const std::array<bool, 4> now = carriers(x);
    if (f.energy(x) < 0.1 || carriers(x + 2e-3 * p) != now || carriers(x - 2e-3 * p) != now) continue;
    ++carried[static_cast<std::size_t>(std::count(now.begin(), now.end(), true))];
    INFO("state " << k);
    CHECK(gradient_order(f, x, p, 1e-4) > 1.9);
    CHECK(hessian_order(f, x, p, 1e-4) > 1.9);
  }
  for (const std::size_t n : {2, 3, 4}) CHECK(carried[n] > 5);
}

}  // namespace

TEST_CASE("nearest places of a vertex and a face") {
  for (int k = 0; k < 400; ++k) {
    Random random(k);
    FourPoints r;
    for (Vec<3>& a : r) a = random_point(random);
    if (k % 8 == 0) r[3] = r[1] + random(-1, 2) * (r[2] - r[1]);       // a face without area
    if (k % 8 == 1) r[3] = r[1] + 1e-7 * (r[3] - r[1]) + r[2] - r[1];  // nearly
    if (k % 8 == 2) r[0] = (r[1] + r[2] + r[3]) / 3 + 0.1 * r[0];      // over the inside
    INFO("state " << k);
    const VertexOnFace on(r);
    const NearestPlaces places = nearest(on);
    check_places(r, 1, places);
    CHECK(std::sqrt(on.d2()) == Approx(to_face(r)).margin(1e-7));
    for (int l = 0; l < 3; ++l) {
      check_places(r, 1, on.on_edge(l));
      check_places(r, 1, on.at_corner(l));
      CHECK(std::sqrt(on.foot[l].d2) == Approx(to_segment(r[0], r[1 + l], r[1 + (l + 1) % 3])).margin(1e-7));
      CHECK(on.at_corner(l).offset == r[0] - r[1 + l]);
    }
  }
}

TEST_CASE("nearest places of two edges") {
  for (int k = 0; k < 400; ++k) {
    Random random(k);
    FourPoints r;
    for (Vec<3>& a : r) a = random_point(random);
    if (k % 8 == 0) r[3] = r[2] + random(-1, 1) * (r[1] - r[0]);                             // parallel
    if (k % 8 == 1) r[3] = r[2] + random(-1, 1) * (r[1] - r[0]) + 1e-7 * (r[3] - r[2]);      // nearly
    if (k % 8 == 2) r[3] = r[2];                                                             // without a length
    if (k % 8 == 3) r[1] = 2 * r[2] - r[0] + 0.2 * r[1], r[3] = r[2] + 0.1 * (r[3] - r[2]);  // near an end
    INFO("state " << k);
    const EdgeOnEdge on(r);
    if (k % 8 != 1) check_places(r, 2, nearest(on));
    CHECK(std::sqrt(on.d2()) == Approx(of_segments(r)).margin(1e-7));
    for (int l = 0; l < 4; ++l) {
      check_places(r, 2, on.of_end(l));
      CHECK(std::sqrt(on.foot[l].d2) ==
            Approx(l < 2 ? to_segment(r[l], r[2], r[3]) : to_segment(r[l], r[0], r[1])).margin(1e-7));
    }
    for (const int first : {0, 1})
      for (const int second : {2, 3}) CHECK(on.of_points(first, second).offset == r[first] - r[second]);
  }
}

TEST_CASE("parallel edges that lie side by side are nearest at an end") {
  const FourPoints r{Vec<3>(0, 0, 0), Vec<3>(2, 0, 0), Vec<3>(1, 0, 0.5), Vec<3>(3, 0, 0.5)};
  const EdgeOnEdge on(r);
  CHECK(!on.inside);
  CHECK(on.d2() == 0.25);
}

TEST_CASE("derivatives of the distance of a vertex and a face") { check_derivatives<VertexOnFace, 1>(); }

TEST_CASE("derivatives of the distance of two edges") { check_derivatives<EdgeOnEdge, 2>(); }

TEST_CASE("derivatives of the distance vanish at no distance instead of becoming NaN") {
  const FourPoints r{Vec<3>(0.25, 0.25, 0), Vec<3>(0, 0, 0), Vec<3>(1, 0, 0), Vec<3>(0, 1, 0)};
  const PlaceMotion motion(r, 1, nearest(VertexOnFace(r)));
  CHECK(motion.hessian(0, 0) == Mat<3>::Zero());
  CHECK(motion.hessian(3, 1) == Mat<3>::Zero());
}

}  // namespace pliant::test::simplex_distance_test
