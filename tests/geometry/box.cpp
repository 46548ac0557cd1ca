#include <pliant/geometry/box.h>

#include <catch2/catch.hpp>

#include "support/random.h"

namespace pliant::test::box_test {

namespace {

constexpr Real infinite = Box<2>::infinite;

/// Whether r and s are images of each other, up to rounding.
template <int D>
bool same_place(const Box<D>& box, const Vec<D>& r, const Vec<D>& s) {
  return box.nearest_image(r - s).norm() < 1e-12 * (1 + r.norm() + s.norm());
}

template <int D>
Vec<D> anywhere(Random& random, Real far) {
  Vec<D> r;
  for (Real& a : r) a = random(-far, far);
  return r;
}

}  // namespace

TEST_CASE("an open box leaves everything where it is") {
  const Box<2> box;
  CHECK(box.open());
  CHECK(box.volume() == infinite);
  const Vec<2> r(-1e5, 3);
  CHECK(box.wrap(r) == r);
  CHECK(box.nearest_image(r) == r);
  CHECK(box.image_of(r) == Image{});
  CHECK(box.shift({3, -2, 0}) == Vec<2>(0, 0));
}

TEST_CASE("known places in a box") {
  const Box<2> box({-1, 2}, {4, 3});
  CHECK(!box.open());
  CHECK(box.volume() == 12);
  CHECK(box.wrap({0, 3}) == Vec<2>(0, 3));
  CHECK(box.wrap({-1, 2}) == Vec<2>(-1, 2));  // the lower border belongs to it
  CHECK(box.wrap({3, 5}) == Vec<2>(-1, 2));   // the upper one does not
  CHECK(box.wrap({-1.5, 12}) == Vec<2>(2.5, 3));
  CHECK(box.image_of({-1.5, 12}) == Image{-1, 3, 0});
  CHECK(box.shift({-1, 3, 0}) == Vec<2>(-4, 9));
  CHECK(box.nearest_image({2.5, -2}) == Vec<2>(-1.5, 1));
  CHECK(box.nearest_image({1.5, 7.5}).cwiseAbs() == Vec<2>(1.5, 1.5));
}

TEST_CASE("a direction without length is open") {
  const Box<3> box({0, 0, 0}, {infinite, 2, infinite});
  CHECK(!box.open());
  CHECK((!box.periodic(0) && box.periodic(1) && !box.periodic(2)));
  CHECK(box.volume() == infinite);
  CHECK(box.wrap({50, 5, -50}) == Vec<3>(50, 1, -50));
  CHECK(box.nearest_image({50, 1.5, -50}) == Vec<3>(50, -0.5, -50));
}

TEST_CASE("wrapping and nearest images, wherever particles are") {
  Random random(1);
  for (int k = 0; k < 1000; ++k) {
    const Vec<3> length(random(0.1, 3), k % 2 == 0 ? infinite : random(0.1, 3), random(0.1, 3));
    const Box<3> box(anywhere<3>(random, 5), length);
    const Vec<3> r = anywhere<3>(random, 20), wrapped = box.wrap(r), near = box.nearest_image(r);
    const Image n{random.below(9) - 4, box.periodic(1) ? random.below(9) - 4 : 0, random.below(9) - 4};
    CHECK((wrapped + box.shift(box.image_of(r)) - r).norm() < 1e-12);
    CHECK(same_place<3>(box, wrapped, r));
    CHECK(same_place<3>(box, r + box.shift(n), r));
    CHECK((box.nearest_image(r + box.shift(n)).cwiseAbs() - near.cwiseAbs()).norm() < 1e-12);
    for (int axis = 0; axis < 3; ++axis) {
      if (!box.periodic(axis)) continue;
      const Real place = (wrapped - box.origin())[axis];
      CHECK((place >= -1e-12 && place <= length[axis]));
      CHECK(std::abs(near[axis]) <= length[axis] / 2 * (1 + 1e-12));
    }
  }
}

TEST_CASE("places in a tilted box") {
  const Box<2> box({-1, 2}, {4, 3}, {1.5});
  CHECK(box.tilted());
  CHECK(box.volume() == 12);
  CHECK(box.edge(1) == Vec<2>(1.5, 3));
  CHECK(box.shift({1, -2, 0}) == Vec<2>(1, -6));
  CHECK(box.wrap({0, 3}) == Vec<2>(0, 3));
  CHECK((box.wrap({2.8, 6}) - Vec<2>(1.3, 3)).norm() <
        1e-14);  // the upright cell, above which the next row is offset by the tilt
  CHECK(box.image_of({0, 6}) == Image{-1, 1, 0});
  CHECK(box.wrap({0, 6}) == Vec<2>(2.5, 3));
  const Box<3> space({0, 0, 0}, {2, 3, 4}, {0.5, -0.25, 1});
  CHECK(space.edge(2) == Vec<3>(-0.25, 1, 4));
  CHECK(space.shift({1, 1, 1}) == Vec<3>(2.25, 4, 4));
}

TEST_CASE("wrapping in tilted boxes") {
  Random random(2);
  for (int k = 0; k < 1000; ++k) {
    const Vec<3> length(random(0.1, 3), random(0.1, 3), random(0.1, 3));
    const Box<3> box(anywhere<3>(random, 5), length, {random(-4, 4), random(-4, 4), random(-4, 4)});
    const Vec<3> r = anywhere<3>(random, 20), wrapped = box.wrap(r);
    const Image n{random.below(9) - 4, random.below(9) - 4, random.below(9) - 4};
    CHECK((wrapped + box.shift(box.image_of(r)) - r).norm() < 1e-12);
    CHECK(same_place<3>(box, r + box.shift(n), r));
    CHECK(((wrapped - box.origin()).minCoeff() > -1e-12 && (wrapped - box.origin() - length).maxCoeff() < 1e-12));
  }
}

TEST_CASE("a box is deformed with its places") {
  const Box<2> box({1, 2}, {4, 3}, {0.6});
  Mat<2> f;
  f << 1.1, 0.2, 0, 0.9;
  const Box<2> after = box.deformed(f);
  for (const Image& n : {Image{1, 0, 0}, Image{0, 1, 0}, Image{2, -3, 0}})
    CHECK((after.shift(n) - f * box.shift(n)).norm() < 1e-14);
  CHECK(after.origin() == box.origin());
  CHECK(after.volume() == Approx(12 * 0.99));
  f(1, 0) = 0.1;
  CHECK_THROWS_WITH(box.deformed(f), Catch::Contains("element 10"));
  f << -1, 0, 0, 1;
  CHECK_THROWS_WITH(box.deformed(f), Catch::Contains("direction 0"));
  CHECK_THROWS_AS(Box<2>().deformed(Mat<2>::Identity()), InputError);
}

TEST_CASE("boxes that there are not") {
  CHECK_THROWS_WITH(Box<2>({0, 0}, {1, infinite}, {0.5}), Catch::Contains("not both periodic"));
  CHECK_THROWS_WITH(Box<2>({0, 0}, {1, 1}, {std::nan("")}), Catch::Contains("tilt 01 of the box is nan"));
  CHECK_THROWS_WITH(Box<2>({0, 0}, {1, 0}), Catch::Contains("length 1 of the box is 0"));
  CHECK_THROWS_WITH(Box<2>({0, 0}, {-2, 1}), Catch::Contains("length 0 of the box is -2"));
  CHECK_THROWS_WITH(Box<2>({0, std::nan("")}, {1, 1}), Catch::Contains("origin 1 of the box is nan"));
}

}  // namespace pliant::test::box_test
