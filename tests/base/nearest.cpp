#include <pliant/base/nearest.h>

#include <catch2/catch.hpp>
#include <vector>

namespace pliant::test::nearest_test {

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

TEST_CASE("nearest takes a beginning before typing errors, and a single letter for a word") {
  const std::vector<std::string> names{"help",    "n",     "e_w",           "hopper_wall_distance", "hopper_width",
                                       "t_end",   "ts_dt", "max_wall_time", "pack_fraction",        "phi_c",
                                       "ts_rtol", "k_a",   "output"};
  CHECK(nearest("h", names) == "help");
  CHECK(nearest("w", names) == "hopper_width");
  CHECK(nearest("N", names) == "n");
  CHECK(nearest("t", names) == "t_end");
  CHECK(nearest("p", names) == "phi_c");
  CHECK(nearest("k", names) == "k_a");
  CHECK(nearest("out", names) == "output");
  CHECK(nearest("pack", names) == "pack_fraction");
  CHECK(nearest("rtol", names) == "ts_rtol");
  CHECK(nearest("ts_d", names) == "ts_dt");
  CHECK_FALSE(nearest("z", names));
  CHECK_FALSE(nearest("hopper_w", names));  // begins two
}

}  // namespace pliant::test::nearest_test
