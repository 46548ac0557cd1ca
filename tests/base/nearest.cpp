#include <pliant/base/nearest.h>

#include <catch2/catch.hpp>
#include <vector>

using namespace pliant;

TEST_CASE("nearest finds the name that was meant, and only that") {
  const std::vector<std::string> names{"hopper_width", "hopper_angle", "dt", "t_end", "n", "n_vertices", "k_a", "k_l"};
  CHECK(nearest("hoper_width", names) == "hopper_width");   // missing letter
  CHECK(nearest("hopper_witdh", names) == "hopper_width");  // swapped letters
  CHECK(nearest("Hopper_Angle", names) == "hopper_angle");  // case
  CHECK(nearest("tend", names) == "t_end");
  CHECK(nearest("width", names) == "hopper_width");  // part of a name
  CHECK(nearest("vertices", names) == "n_vertices");
  CHECK_FALSE(nearest("hopper", names));  // begins two names
  CHECK_FALSE(nearest("temperature", names));
  CHECK_FALSE(nearest("", names));
  CHECK_FALSE(nearest(std::string(100000, 'x'), names));
}
