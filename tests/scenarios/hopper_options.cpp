// What options of the hopper have to do with each other.
#include <catch2/catch.hpp>

#include <algorithm>
#include <string>
#include <vector>

#include <pliant/scenarios/hopper/options.h>

using namespace pliant;
using Catch::Contains;

namespace {

/// As the program reads them.
HopperOptions resolved(const std::vector<std::string>& arguments) {
  HopperOptions p;
  Options options;
  p.bind(options);
  options.parse(arguments);
  p.resolve();
  p.refuse_unread(options);
  return p;
}

struct Unread {
  const char *option, *value;
  std::vector<std::string> readers;  ///< models
};

}  // namespace

TEST_CASE("automatic values of a hopper", "[options]") {
  const HopperOptions flat = resolved({}), space = resolved({"-dim", "3"});
  CHECK(flat.particles == 1600);
  CHECK(space.particles == 6400);
  CHECK(flat.hopper.wall_distance == 50);
  CHECK(space.hopper.wall_distance == 25);
  CHECK(flat.pack_fraction == 0.84);
  CHECK(space.pack_fraction == 0.64);
  CHECK(flat.t_end == 100);
  CHECK(resolved({"-hopper_q_rtol", "0.1"}).t_end == 10000);
  CHECK(resolved({"-hopper_q_rtol", "0.1", "-t_end", "7"}).t_end == 7);
  CHECK(resolved({"-n", "12", "-hopper_wall_distance", "9", "-pack_fraction", "0.5"}).particles == 12);
  CHECK(resolved({"-hopper_wall_distance", "9"}).hopper.wall_distance == 9);
  CHECK(resolved({"-pack_fraction", "0.5"}).pack_fraction == 0.5);
}

TEST_CASE("standard steps and skins", "[options]") {
  CHECK(resolved({"-mu", "1", "-zeta", "1"}).elastic_fraction(1, 1) == 0.35);
  CHECK(resolved({"-zeta", "1"}).elastic_fraction(1, 1) == 0.4);
  CHECK(resolved({}).elastic_fraction(1, 1) == 0.2);
  // A discharge: 2 sqrt(ζ/m · limit), from 0.05 to that of a flow.
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(0.01, 1) == Approx(0.2));
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(0.01, 4) == Approx(0.1));
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(1, 1) == 0.4);
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(1e-6, 1) == 0.05);
  CHECK(resolved({"-zeta", "1", "-flow", "discharge", "-model", "rough"}).elastic_fraction(1, 1) == 0.2);
  CHECK(resolved({}).first_skin() == 0.3);
  CHECK(resolved({"-dim", "3"}).first_skin() == 0.2);
  CHECK(resolved({"-model", "smooth"}).first_skin() == 0.06);
  CHECK(resolved({"-skin", "0.11"}).first_skin() == 0.11);
}

TEST_CASE("options of a hopper that contradict each other", "[options]") {
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& says) {
    CAPTURE(arguments);
    CHECK_THROWS_AS(resolved(arguments), InputError);
    CHECK_THROWS_WITH(resolved(arguments), Contains(says));
  };
  refused({"-dim", "3", "-model", "rough"}, "-dim 3 with -model rough");
  refused({"-contact_law", "barrier"}, "-contact_law barrier with -model sp");
  refused({"-contact_law", "hertz", "-model", "rough"}, "-contact_law hertz with -model rough");
  refused({"-model", "rough", "-shape_parameter", "1", "-n_vertices", "6"}, "-shape_parameter 1: no polygon of 6");
  refused({"-implicit", "shape"}, "-integrator verlet");
  refused({"-dynamics", "overdamped", "-zeta", "1"}, "-integrator ts");
  refused({"-dynamics", "overdamped", "-integrator", "ts"}, "-zeta 0");
  refused({"-dynamics", "overdamped", "-integrator", "ts", "-zeta", "1", "-mu", "1"}, "-mu 1");
  refused({"-hopper_q_rtol", "0.1", "-flow", "discharge"}, "-flow discharge");
}

TEST_CASE("an option that the model does not read is refused where it is given", "[options]") {
  const std::vector<Unread> table{{"e_sp", "50", {"sp"}},
                                  {"e_c", "50", {"rough", "smooth"}},
                                  {"k_a", "5", {"rough", "smooth"}},
                                  {"k_l", "5", {"rough", "smooth"}},
                                  {"k_b", "5", {"rough", "smooth"}},
                                  {"n_vertices", "8", {"rough", "smooth"}},
                                  {"shape_parameter", "1.2", {"rough", "smooth"}},
                                  {"lip_contact", "literal", {"rough", "smooth"}},
                                  {"rough_contact", "edge", {"rough"}},
                                  {"edge_width", "0.2", {"smooth"}},
                                  {"friction_point", "vertex", {"smooth"}},
                                  {"e_w", "50", {"sp", "rough", "smooth"}},
                                  {"mu", "1", {"sp", "rough", "smooth"}}};
  for (const Unread& row : table)
    for (const std::string model : {"sp", "rough", "smooth"}) {
      const std::vector<std::string> arguments{"-model", model, std::string("-") + row.option, row.value};
      CAPTURE(arguments);
      if (std::find(row.readers.begin(), row.readers.end(), model) != row.readers.end()) {
        CHECK_NOTHROW(resolved(arguments));
        continue;
      }
      CHECK_THROWS_AS(resolved(arguments), InputError);
      CHECK_THROWS_WITH(resolved(arguments),
                        Contains(std::string("-") + row.option + " (command line) with -model " + model) &&
                            Contains(row.readers.front()));
    }
  CHECK_NOTHROW(resolved({"-size_distribution", "normal", "-size_deviation", "0.2"}));
  CHECK_THROWS_AS(resolved({"-size_distribution", "mono", "-size_ratio", "2"}), InputError);
  CHECK_THROWS_AS(resolved({"-size_deviation", "0.2"}), InputError);
  CHECK_THROWS_AS(resolved({"-jacobian", "assembled"}), InputError);
}
