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

TEST_CASE("boxes that there are not") {
  CHECK_THROWS_WITH(Box<2>({0, 0}, {1, 0}), Catch::Contains("length 1 of the box is 0"));
  CHECK_THROWS_WITH(Box<2>({0, 0}, {-2, 1}), Catch::Contains("length 0 of the box is -2"));
  CHECK_THROWS_WITH(Box<2>({0, std::nan("")}, {1, 1}), Catch::Contains("origin 1 of the box is nan"));
}

}  // namespace pliant::test::box_test
