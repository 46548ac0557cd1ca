#include <catch2/catch.hpp>

#include <pliant/geometry/container.h>

namespace pliant::test::hopper_test {

TEST_CASE("half width of a flat-bottomed and of a sloped hopper") {
  const Hopper flat{.wall_distance = 10, .orifice = 3, .angle = 90};
  CHECK(flat.slope_height() == 0);
  CHECK(flat.half_width(0.001) == 5);
  CHECK(flat.half_width(100) == 5);
  CHECK(flat.half_width(-1) == 1.5);
  const Hopper sloped{.wall_distance = 10, .orifice = 4, .angle = 30};
  CHECK(sloped.slope_height() == Approx(3 * std::sqrt(3.0)));
  CHECK(sloped.half_width(0) == 2);
  CHECK(sloped.half_width(sloped.slope_height() / 2) == Approx(3.5));
  CHECK(sloped.half_width(sloped.slope_height() + 1) == 5);
  CHECK(Hopper{.wall_distance = 10, .orifice = 4, .angle = 45}.slope_height() == Approx(3));
}

TEST_CASE("walls of the hopper") {
  const Hopper hopper{.wall_distance = 10, .orifice = 4, .angle = 45};
  const Walls<2> flat = hopper.walls<2>();
  CHECK(flat.size() == 4);
  REQUIRE(flat.lips().size() == 2);
  CHECK(flat.lips()[0].place == Vec<2>(-2, 0));
  CHECK(flat.lips()[1].place == Vec<2>(2, 0));
  const auto nearest = [](const auto& walls, const auto& r) {
    Real least = std::numeric_limits<Real>::infinity();
    for (Index s = 0; s < walls.size(); ++s) least = std::min(least, walls.distance(r, s, 0));
    return least;
  };
  for (const Real side : {-1.0, 1.0}) {
    CHECK(nearest(flat, Vec<2>(side * 2, 0)) == Approx(0).margin(1e-15));
    CHECK(nearest(flat, Vec<2>(side * 3.5, 1.5)) == Approx(0).margin(1e-15));  // half way up the slope
    CHECK(nearest(flat, Vec<2>(side * 5, 3)) == Approx(0).margin(1e-15));
    CHECK(nearest(flat, Vec<2>(side * 4, 1e3)) == Approx(1));
  }
  CHECK(nearest(flat, Vec<2>(0, 0)) == Approx(2));  // open
  // Walls lie at half_width.
  for (const Real y : {0.5, 1.7, 2.9, 3.1, 8.0}) CHECK(nearest(flat, Vec<2>(hopper.half_width(y), y)) < 1e-14);

  const Walls<3> revolved = hopper.walls<3>();
  CHECK(revolved.size() == 2);
  REQUIRE(revolved.lips().size() == 1);
  CHECK(revolved.lip_circle(0).radius == 2);
  CHECK(revolved.lip_circle(0).height == 0);
  CHECK(nearest(revolved, Vec<3>(0, 0, 0)) == Approx(2 - 0.375 * axis_width));  // a ring seems nearer there
  CHECK(nearest(revolved, Vec<3>(0.6 * 3.5, -0.8 * 3.5, 1.5)) == Approx(0).margin(1e-14));
  CHECK(nearest(revolved, Vec<3>(0, 4, 50)) == Approx(1));

  // 90°: the slope is the bottom.
  const Walls<2> bottom = Hopper{.wall_distance = 10, .orifice = 4, .angle = 90}.walls<2>();
  CHECK(nearest(bottom, Vec<2>(3.5, 0.25)) == Approx(0.25));
  CHECK(nearest(bottom, Vec<2>(-3.5, 0.25)) == Approx(0.25));
}

TEST_CASE("a closed hopper has a shut orifice and a lid") {
  const Container hopper(Hopper{.wall_distance = 10, .orifice = 4, .angle = 60});
  const Walls<2> box = hopper.closed<2>(20);
  CHECK(box.size() == 6);
  CHECK(box.lips().empty());
  CHECK(box.distance({0, 0.5}, 4, 0) == Approx(0.5));
  CHECK(box.distance({-4.9, 19}, 5, 0) == Approx(1));
  const Walls<3> drum = hopper.closed<3>(20);
  CHECK(drum.size() == 4);
  CHECK(drum.distance({-1, 1, 0.5}, 2, 0) == Approx(0.5));
  CHECK(drum.distance({0, -4.9, 19}, 3, 0) == Approx(1));
}

TEST_CASE("impossible hoppers are refused with the option to change") {
  const auto message = [](Real wall_distance, Real orifice, Real angle) -> std::string {
    try {
      (void)Hopper{.wall_distance = wall_distance, .orifice = orifice, .angle = angle}.walls<2>();
    } catch (const InputError& error) {
      CHECK(error.code() == ExitCode::bad_input);
      return error.what();
    }
    return "accepted";
  };
  using Catch::Contains;
  CHECK(message(10, 3, 45) == "accepted");
  CHECK(message(10, 3, 90) == "accepted");
  CHECK_THAT(message(10, 10, 45), Contains("10") && Contains("a narrower orifice or a wider container"));
  CHECK_THAT(message(10, 12.5, 45), Contains("12.5"));
  CHECK_THAT(message(10, 0, 45), Contains("positive") && Contains("a wider orifice"));
  CHECK_THAT(message(10, -2.5, 45), Contains("-2.5"));
  CHECK_THAT(message(10, 3, 0), Contains("angle 0") && Contains("another angle"));
  CHECK_THAT(message(10, 3, 91), Contains("91"));
  CHECK_THAT(message(10, 3, -30), Contains("-30"));
  const Real nan = std::numeric_limits<Real>::quiet_NaN();
  CHECK_THAT(message(10, nan, 45), Contains("nan"));
  CHECK_THAT(message(nan, 3, 45), Contains("nan"));
  CHECK_THAT(message(10, 3, nan), Contains("nan"));
}

}  // namespace pliant::test::hopper_test
