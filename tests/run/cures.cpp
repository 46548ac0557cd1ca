// Cures in messages, with the options of the scenario that runs.
#include <catch2/catch.hpp>

#include <pliant/base/cure.h>
#include <pliant/base/options.h>

namespace pliant::test::cures_test {

TEST_CASE("cures name the options that the running scenario has") {
  CHECK(cures({Cure::shorter_step}) == "a shorter step");
  CHECK(cures({Cure::shorter_step, Cure::drag}) == "a shorter step or drag");
  Real dt = 1, stiffness = 1, unread = 1;
  std::string integrator = "verlet";
  Options options;
  options.bind("dt", dt, {.help = "step", .cures = {Cure::shorter_step}});
  options.bind("unread", unread,
               {.help = "of another model", .term = [] { return std::nullopt; }, .cures = {Cure::drag}});
  options.bind("stiffness", stiffness, {.help = "of contacts", .cures = {Cure::stiffer_contacts, Cure::stiffer_walls}});
  options.bind("integrator", integrator, {.help = "method", .cures = {{Cure::verlet, "verlet"}, {Cure::ts, "ts"}}});
  {
    const CureOptions while_it_runs([&](Cure cure) { return options.curing(cure); });
    CHECK(cures({Cure::shorter_step, Cure::stiffer_contacts, Cure::drag}) ==
          "a shorter step (-dt) or stiffer contacts (-stiffness)");
    CHECK(cures({Cure::drag, Cure::edge_contacts}) == "drag or contacts with edges");
    CHECK(cures({Cure::stiffer_walls, Cure::ts}) == "stiffer walls (-stiffness) or PETSc TS (-integrator ts)");
  }
  CHECK(cures({Cure::stiffer_contacts}) == "stiffer contacts");
}

TEST_CASE("options extend the runs that they have ended") {
  Real t_end = 1, rtol = 1;
  Options options;
  options.bind("t_end", t_end, {.help = "end", .extends = {"t_end", "LATER"}});
  options.bind("q_rtol", rtol, {.help = "precision"});
  CHECK(options.extending("t_end") == "t_end LATER");
  CHECK(options.extending("q_rtol").empty());
  CHECK(options.extending("").empty());
}

}  // namespace pliant::test::cures_test
