// Outlines and obstacles as users write them.
#include <catch2/catch.hpp>

#include <filesystem>
#include <fstream>

#include <pliant/base/errors.h>
#include <pliant/scenarios/hopper/shapes.h>

namespace pliant::test::shapes_test {
namespace {
using Catch::Contains;

/// A file that lives as long as this.
struct TextFile {
  std::string path = (std::filesystem::temp_directory_path() / ("pliant-shape-" + std::to_string(getpid()) + ".txt"));
  explicit TextFile(const std::string& text) { std::ofstream(path) << text; }
  ~TextFile() { std::filesystem::remove(path); }
};

std::string outline(const std::string& text) { return read_outline(TextFile(text).path, {}); }

void refused(const std::string& text, const char* a, const char* b = "", const char* c = "") {
  INFO(text);
  CHECK_THROWS_AS(outline(text), InputError);
  CHECK_THROWS_WITH(outline(text), Contains(a) && Contains(b) && Contains(c));
}

void obstacle_refused(const std::string& text, const char* a, const char* b = "", int dim = 2) {
  INFO(text);
  const auto read = [&] { parse_obstacles(read_obstacles(text, {}), dim); };
  CHECK_THROWS_AS(read(), InputError);
  CHECK_THROWS_WITH(read(), Contains(a) && Contains(b));
}

}  // namespace

TEST_CASE("an outline is kept as it is read", "[shapes]") {
  const std::string half = "# a bottle\n2 0 # the lip\n5.25 1e0\n\t5.25,10\n";
  CHECK(outline(half) == "2 0\n5.25 1\n5.25 10\n");
  CHECK(outline("\xef\xbb\xbf"
                "2 0\r\n5.25 1\r\n5.25 10\r\n") == outline(half));  // as Windows writes it
  CHECK(outline(outline(half)) == outline(half));
  for (const int dim : {2, 3}) {
    const Vessel vessel = outline_vessel(outline(half), dim);
    CHECK(vessel.orifice() == 4);
    CHECK(vessel.left() == -5.25);
    CHECK(vessel.right() == 5.25);
  }
  // Two sides, either first, each in either direction.
  for (const char* sides :
       {"-1 0\n-3 2\n\n1 0\n4 5\n", "4 5\n1 0\n\n\n-1 0\n-3 2\n", "-3 2\n-1 0\n# no gap\n\n1 0\n4 5"}) {
    const Vessel vessel = outline_vessel(outline(sides), 2);
    CHECK(vessel.left() == -3);
    CHECK(vessel.right() == 4);
    CHECK(vessel.orifice() == 2);
  }
}

TEST_CASE("outlines that make no container are refused with line and cure", "[shapes]") {
  CHECK_THROWS_WITH(read_outline("/no/such/file", {}), Contains("/no/such/file"));
  refused("", "no points");
  refused("# nothing\n", "no points");
  refused("2 0\n5 x\n", ":2:", "\"5 x\"", "write x y");
  refused("2 0\n5\n", ":2:", "\"5\"");
  refused("2 0\n5 1 3\n", ":2:");
  refused("2 0\n5 nan\n", ":2:");
  refused("2 0\n\n5 3\n", ":1:", "one point", "blank line");
  refused("2 0\n5 3\n5 3\n", ":3:", "(5, 3)", "no length");
  refused("2 1\n5 3\n", ":1:", "y = 1 and 3", "begin there");
  refused("2 0\n5 3\n6 0\n", ":1:", "both ends", "raise");
  refused("-2 0\n-5 3\n", ":1:", "x = -2", "mirrored");
  refused("2 0\n5 -1\n5 3\n", "(5, -1)", "line 2", "raise it");
  refused("-2 0\n-5 3\n\n1 0\n5 3\n", "not centred", "shift all points by 0.5");
  refused("2 0\n6 4\n6 1\n2 3\n2 9\n", "line 4", "meets", "must not cross");
  refused("2 0\n-3 3\n", "meets");
  refused("1 0\n2 1\n\n-1 0\n-2 1\n\n0 3\n0 4\n", ":7:", "polyline 3", "-obstacle");
  CHECK_THROWS_WITH(outline_vessel(outline("-1 0\n-3 2\n\n1 0\n4 5\n"), 3), Contains("meridian"));
}

TEST_CASE("obstacles are kept with the points of their files", "[shapes]") {
  const TextFile corners("1 2\n1 4\n3 4 # clockwise, closed\n1 2\n");
  const std::string text = read_obstacles("disk:0,5,1.5, polygon:" + corners.path + " ;disk:4,4,0.5", {});
  CHECK(text == "disk:0,5,1.5;polygon:1,2,1,4,3,4,1,2;disk:4,4,0.5");
  CHECK(read_obstacles(text, {}) == text);
  CHECK(read_obstacles("disk:1,2,3,disk:4,5,6", {}) == "disk:1,2,3;disk:4,5,6");  // as lists in YAML come
  const std::vector<Obstacle> all = parse_obstacles(text, 2);
  REQUIRE(all.size() == 3);
  CHECK(all[0].radius == 1.5);
  CHECK(all[1].corners == std::vector<Vec<2>>{{3, 4}, {1, 4}, {1, 2}});
  CHECK(all[1].content(2, 10) == Approx(2));
}

TEST_CASE("obstacles that are none are refused", "[shapes]") {
  obstacle_refused("ball:1,2,3", "ball:1,2,3", "write disk");
  obstacle_refused("", "empty");
  obstacle_refused("disk:1,2", "three numbers");
  obstacle_refused("disk:1,2,x", "not numbers");
  obstacle_refused("disk:1,2,-3", "positive");
  obstacle_refused("polygon:/no/such/file", "/no/such/file");
  obstacle_refused("polygon:1,2,3", "odd");
  obstacle_refused("polygon:1,2,3,4", "three corners");
  obstacle_refused("polygon:1,2,1,2,3,4", "no length");
  obstacle_refused("polygon:0,1,2,3,2,1,0,3", "cross");
  obstacle_refused("polygon:0,1,1,1,2,1", "no area");
  obstacle_refused("disk:1,5,2", "on the axis", "ring", 3);
  obstacle_refused("polygon:-1,2,1,2,0,3", "rho = -1", "", 3);
}

TEST_CASE("obstacles stand inside the container, may touch walls, and not each other's inside", "[shapes]") {
  const Container box(Hopper{.wall_distance = 10, .orifice = 4, .angle = 45});
  const auto check = [&](const std::string& text) { check_obstacles(box, parse_obstacles(text, 2), 2); };
  CHECK_NOTHROW(check("disk:0,5,1;polygon:2,6,4,6,3,8;disk:-4,10,1"));  // the last touches the wall
  CHECK_NOTHROW(check("polygon:5,6,4,6,5,7"));                          // touches it
  CHECK_NOTHROW(check("disk:0,5,1;disk:0,7,1"));
  const auto bad = [&](const std::string& text, const char* a, const char* b = "") {
    INFO(text);
    CHECK_THROWS_AS(check(text), InputError);
    CHECK_THROWS_WITH(check(text), Contains(a) && Contains(b));
  };
  bad("disk:7,5,1", "(7, 5)", "not inside");
  bad("disk:0,-1,0.5", "above the orifice");
  bad("disk:4.5,8,1", "overlaps the wall at (5, 8)", "0.5 from its centre");
  bad("polygon:3,6,6,6,4,8", "(6, 6)", "not inside");
  bad("disk:0,5,1;disk:0,6.5,1", "disk:0,5,1 and disk:0,6.5,1 overlap");
  bad("disk:0,5,1;polygon:-2,4,2,4,0,9", "overlap");
  bad("polygon:-1,5,1,5,0,7;polygon:-1,6,1,6,0,4", "overlap");
  // A notch: all corners inside, a side through the wall.
  const Container notched(Vessel({{-1, 0}, {-5, 1}, {-5, 9}}, {{1, 0}, {5, 1}, {2, 4}, {5, 7}, {5, 9}}));
  CHECK_THROWS_WITH(check_obstacles(notched, parse_obstacles("polygon:4,1.9,4.3,6.5,0,4", 2), 2),
                    Contains("crosses a wall"));
}

}  // namespace pliant::test::shapes_test
