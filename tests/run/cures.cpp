// Cures in messages, with the options of the scenario that runs.
#include <catch2/catch.hpp>

#include <pliant/base/cure.h>
#include <pliant/run/cure_options.h>

namespace pliant::test::cures_test {

TEST_CASE("cures name the options that the running scenario has") {
  CHECK(cures({Cure::shorter_step}) == "a shorter step");
  CHECK(cures({Cure::shorter_step, Cure::drag}) == "a shorter step or drag");
  Real dt = 1, stiffness = 1;
  Options options;
  options.bind("dt", dt, {.help = "step"});
  options.bind("stiffness", stiffness, {.help = "of contacts"});
  {
    const CureOptions while_it_runs([&](Cure cure) { return option_for(cure, options); });
    CHECK(cures({Cure::shorter_step, Cure::stiffer_contacts, Cure::drag}) ==
          "a shorter step (-dt), stiffer contacts (-stiffness) or drag");
  }
  CHECK(cures({Cure::stiffer_contacts}) == "stiffer contacts");
}

}  // namespace pliant::test::cures_test
